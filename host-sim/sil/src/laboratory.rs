//! A laboratory without hardware: the craft's program, the plant that it moves, a floor, and a
//! tracker that sees it.
//!
//! Where [`fly`](crate::fly) commands from inside, here messages of crate `proto` come from a
//! ground station, as over the radio: the craft boots disarmed on the floor, and arms, takes off
//! and lands on command. One tick: the sensors are read, the craft ([`::craft::Craft`]) takes what
//! has arrived and ticks, its motor commands move the plant for a period, and the tracker gives the
//! pose that it saw at the tick's beginning. The ground station sends it to the craft.
//!
//! The floor at z = 0 stops whatever comes down: no bounce, no sliding, legs that stand level.
//! [`Room`] is the plant with that floor and sensors, for whoever brings the craft's program along;
//! [`Radio`] is the craft's end of the link. Deliberately absent: clocks (whoever ticks this
//! decides how fast time goes), and the tracker's format.

use std::io;
use std::net::{SocketAddr, UdpSocket};

use ::craft::{Inputs, Setup};
use control::{Measurement, Pose};
use proto::{CraftEnd, Heard, ImuSample, MAX_PACKET_LEN, Message};

use crate::craft::SimulatedCraft;
use crate::flight::{FlightPlan, SilError};

/// The craft's body in a room with a floor, and the sensors that see it.
#[derive(Debug, Clone)]
pub struct Room {
    body: SimulatedCraft,
}

impl Room {
    /// The craft of `plan` on the floor under its start, for a program that ticks every `period_s`.
    ///
    /// # Errors
    /// A plan that cannot be flown.
    pub fn new(plan: &FlightPlan, period_s: f64) -> Result<Self, SilError> {
        let mut body = plan.craft_with_period(period_s)?;
        body.state.position_ned_m.z = 0.0;
        body.state.rotor_rad_s = [0.0; 4];
        Ok(Self { body })
    }

    /// What the sensors measure now. To be called once a tick: each call draws new noise.
    pub fn sense(&mut self) -> Measurement {
        let voltage_v = self.body.voltage_v();
        self.body.sense(voltage_v)
    }

    /// One period with these motor commands held, or with idle motors.
    pub fn advance(&mut self, pwm: &[f32; 4], idle: bool) {
        let voltage_v = self.body.voltage_v();
        // Motors at idle stand still; the plant's map knows speeds of flight only.
        if idle {
            self.body.state.rotor_rad_s = [0.0; 4];
        }
        if !idle || !self.is_down() {
            self.body.advance(pwm, voltage_v);
        }
        self.body.stop_at(0.0);
    }

    /// A fresh battery, as full as the first.
    pub fn change_battery(&mut self) {
        self.body.change_battery();
    }

    /// Does the craft stand on the floor?
    pub fn is_down(&self) -> bool {
        self.body.state.position_ned_m.z >= 0.0
    }

    /// Where it really is, inertial NED, m.
    pub fn position_m(&self) -> [f64; 3] {
        self.body.state.position_ned_m.into()
    }
}

/// The laboratory.
#[derive(Debug, Clone)]
pub struct Laboratory {
    program: ::craft::Craft,
    room: Room,
    period_s: f64,
    /// A tick by the craft's clock, us.
    tick_us: u32,
    clock_us: u32,
    /// Since it was booted, us.
    elapsed_us: u64,
}

impl Laboratory {
    /// The craft of `plan` on the floor under its start, its program booted. `clock_skew` is by
    /// which part the craft's clock runs fast (the fault of thesis chapter 6): its ticks come the
    /// sooner.
    ///
    /// # Errors
    /// A plan or configuration that cannot be flown.
    pub fn new(plan: &FlightPlan, clock_skew: f64) -> Result<Self, SilError> {
        let nominal_s = plan.config.sample_time_s;
        let period_s = nominal_s / (1.0 + clock_skew);
        if !(period_s > 0.5 * nominal_s && period_s < 2.0 * nominal_s) {
            let (field, value) = ("clock_skew", clock_skew.to_string());
            return Err(SilError::Plan { field, value, expected: "-0.5 to 1" });
        }
        let setup = Setup {
            vehicle_sha256: [0; 32],
            program: [0, 1, 0],
            telemetry_every: 1,
            last_end: proto::Ending::Unknown,
        };
        let program = ::craft::Craft::new(&plan.config, setup)?;
        let room = Room::new(plan, period_s)?;
        let tick_us = (nominal_s * 1e6).round() as u32;
        Ok(Self { program, room, period_s, tick_us, clock_us: plan.clock_us, elapsed_us: 0 })
    }

    /// Time between two ticks, s.
    pub fn period_s(&self) -> f64 {
        self.period_s
    }

    /// Hands the craft's program a message from the packet with this number.
    pub fn hear(&mut self, number: u64, message: &Message) {
        self.program.hear(number, message);
    }

    /// A fresh battery, as full as the first.
    pub fn change_battery(&mut self) {
        self.room.change_battery();
    }

    /// The craft's next message, to be taken after a tick until there is none.
    pub(crate) fn next_message(&mut self, link: &::craft::LinkStatus) -> Option<Message> {
        self.program.next_message(link)
    }

    /// One tick; gives what the tracker saw at its beginning.
    pub fn tick(&mut self) -> Pose {
        let seen = self.room.sense();
        let imu = seen.gyro_rad_s.map(|gyro_rad_s| ImuSample {
            gyro_rad_s,
            attitude_rad: None,
            acceleration_m_s2: None,
        });
        let inputs = Inputs {
            time_us: self.clock_us,
            imu,
            battery_v: seen.battery_v,
            current_a: None,
            outputs_ready: true,
            lateness_us: 0,
        };
        let flight = self.program.tick(&inputs);
        let (idle, pwm) = (flight.state.motors_idle(), flight.tick.pwm);
        self.room.advance(&pwm, idle);
        self.clock_us = self.clock_us.wrapping_add(self.tick_us);
        self.elapsed_us += u64::from(self.tick_us);
        Pose { position_m: seen.position_m, attitude_rad: seen.attitude_rad }
    }

    /// The craft's clock as packets carry it, ms.
    fn now_ms(&self) -> u32 {
        (self.elapsed_us / 1000) as u32
    }

    /// Does the craft stand on the floor?
    pub fn is_down(&self) -> bool {
        self.room.is_down()
    }

    /// Where it really is, inertial NED, m.
    pub fn position_m(&self) -> [f64; 3] {
        self.room.position_m()
    }

    /// What the craft is doing.
    pub fn state(&self) -> control::State {
        self.program.state()
    }
}

/// The simulated craft's end of the link: UDP on this machine, without a key.
#[derive(Debug)]
pub struct Radio {
    socket: UdpSocket,
    end: CraftEnd,
    /// The session of whoever spoke last.
    ground: Option<u64>,
    /// Answers to hellos, for the end of the tick.
    challenges: Vec<(SocketAddr, Vec<u8>)>,
}

impl Radio {
    /// Listens on a free port of this machine.
    ///
    /// # Errors
    /// What the system says.
    pub fn open() -> io::Result<Self> {
        let socket = UdpSocket::bind(("127.0.0.1", 0))?;
        socket.set_nonblocking(true)?;
        // A simulation repeats itself, and there is nobody to play its recordings to.
        let end = CraftEnd::new(0, None, [0; 32]);
        Ok(Self { socket, end, ground: None, challenges: Vec::new() })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// Hands the craft the packets that have arrived; returns their number.
    pub fn receive(&mut self, lab: &mut Laboratory) -> usize {
        let (mut buffer, mut reply) = ([0; MAX_PACKET_LEN + 1], [0; MAX_PACKET_LEN]);
        let mut count = 0;
        while let Ok((length, from)) = self.socket.recv_from(&mut buffer) {
            count += 1;
            match self.end.hear(lab.now_ms(), Some(from), &buffer[..length], &mut reply) {
                Ok(Heard::Hello(challenge)) => self.challenges.push((from, challenge.to_vec())),
                Ok(Heard::Message(opened)) => {
                    self.ground = Some(opened.session);
                    lab.program.receive(&opened);
                }
                Err(_) => {}
            }
        }
        count
    }

    /// Sends what the craft has to say; returns the number of packets.
    pub fn send(&mut self, lab: &mut Laboratory) -> usize {
        let mut count = 0;
        for (peer, challenge) in self.challenges.drain(..) {
            count += usize::from(self.socket.send_to(&challenge, peer).is_ok());
        }
        self.end.forget_silent(lab.now_ms());
        let link = ::craft::LinkStatus::from(self.end.statistics);
        while let Some(message) = lab.next_message(&link) {
            let mut buffer = [0; MAX_PACKET_LEN];
            let ground = self.ground.and_then(|ground| Some((ground, self.end.peer(ground)??)));
            let Some((session, peer)) = ground else { continue };
            if let Ok((_, packet)) = self.end.seal(lab.now_ms(), session, &message, &mut buffer) {
                count += usize::from(self.socket.send_to(packet, peer).is_ok());
            }
        }
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::craft::NoiseModel;
    use control::State;
    use model::Model;
    use proto::{Command, Request, TimedPose};

    const IDLE: Command = Command::IDLE;

    /// A ground station of a few lines: the pose of the tick before and a command each tick.
    fn fly(lab: &mut Laboratory, ticks: u32, command: Command, request: Option<Request>) {
        let mut request = request;
        for frame in 0..ticks {
            let pose = lab.tick();
            let pose = proto::Pose { position_m: pose.position_m, attitude_rad: pose.attitude_rad };
            lab.hear(0, &Message::Pose(TimedPose { frame, ground_us: 0, pose }));
            lab.hear(0, &Message::Command(command));
            if let Some(request) = request.take() {
                lab.hear(0, &Message::Request(request));
            }
            let link = ::craft::LinkStatus::default();
            while lab.next_message(&link).is_some() {}
        }
    }

    #[test]
    fn a_craft_stands_takes_off_flies_and_lands() {
        let plan = FlightPlan {
            noise: Some(NoiseModel::default()),
            ..FlightPlan::identification(Model::thesis(), 1, 1.0)
        };
        let mut lab = Laboratory::new(&plan, 0.0).unwrap();
        fly(&mut lab, 100, IDLE, None);
        assert!(lab.is_down() && lab.state() == State::Disarmed);
        fly(&mut lab, 20, IDLE, Some(Request::Arm));
        assert!(lab.is_down() && lab.state() == State::Armed);
        fly(&mut lab, 800, Command { z_m: -1.0, cut_off: false, ..IDLE }, None);
        let [x, y, z] = lab.position_m();
        assert!(x.abs() < 0.1 && y.abs() < 0.1 && (z + 1.0).abs() < 0.1, "{x} {y} {z}");
        fly(&mut lab, 700, Command { z_m: -1.0, cut_off: false, ..IDLE }, Some(Request::Land));
        assert!(lab.is_down() && lab.state() == State::Disarmed, "{:?} {:?}", lab.state(), lab.position_m());
    }

    #[test]
    fn a_craft_that_is_cut_falls_and_stays() {
        let plan = FlightPlan::identification(Model::thesis(), 2, 1.0);
        let mut lab = Laboratory::new(&plan, 0.0).unwrap();
        fly(&mut lab, 100, IDLE, None);
        fly(&mut lab, 20, IDLE, Some(Request::Arm));
        fly(&mut lab, 500, Command { z_m: -1.0, cut_off: false, ..IDLE }, None);
        assert!(lab.position_m()[2] < -0.8);
        // Free fall over 1 m takes 0.45 s.
        fly(&mut lab, 60, IDLE, Some(Request::Cut));
        assert!(lab.is_down() && lab.state() == State::Cut);
    }

    #[test]
    fn a_fast_clock_ticks_sooner() {
        let plan = FlightPlan::identification(Model::thesis(), 2, 1.0);
        let lab = Laboratory::new(&plan, 0.01).unwrap();
        assert!((lab.period_s() - 0.01 / 1.01).abs() < 1e-12);
        for skew in [f64::NAN, -0.9, 5.0] {
            assert!(Laboratory::new(&plan, skew).unwrap_err().to_string().contains("clock_skew"));
        }
    }
}
