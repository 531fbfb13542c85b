//! The whole of what flies: detectors, supervisor, guidance and the [`Controller`], ticked
//! together.
//!
//! Firmware and simulation call nothing below this. Order of a tick:
//! 1. the detectors (`safety/detectors.rs`) check what came: clock, commands, pose, gyro,
//!    voltage, tilt;
//! 2. the [`state_machine`](crate::safety::state_machine) goes to the next state;
//! 3. in flight the pilot's command goes to the controller as it came; in hold and land the
//!    guidance here makes one;
//! 4. the controller ticks, with motors at idle when disarmed, armed or cut;
//! 5. what only the outcome shows (loss of thrust, gyro against motion capture, a result that is
//!    not a number) counts in the next tick.
//!
//! Poses that come late are brought to now by gyro and motors (`whereabouts.rs`). Without poses (thesis
//! chapter 3 has no other position): the position is held and the attitude carried on from the last
//! pose by the gyro, with Euler rates from body rates (thesis (2.3)). Up
//! to [`PoseLimits::coast_s`] the command stays; then level at the held height, with the thrust that
//! carried the craft while it was seen (`safety/hover_thrust.rs`), which brakes it too; then down: the altitude loop sees
//! a craft too high by [`Landing::blind_offset_m`], which takes `kp` times that off this thrust. At
//! [`PoseLimits::cut_after_s`] the motors stop. (No barometer and no range sensor: [`Readings`] has
//! neither.)
//!
//! Not here: sensors, links and clocks of a board, and the take-off, which is a command like
//! another.
//!
//! [`PoseLimits::coast_s`]: crate::config::supervision_limits::PoseLimits::coast_s
//! [`PoseLimits::cut_after_s`]: crate::config::supervision_limits::PoseLimits::cut_after_s
//! [`Landing::blind_offset_m`]: crate::config::supervision_limits::Landing::blind_offset_m

use crate::config::error::ConfigError;
use crate::config::gains::Config;
use crate::inputs::input_checks::is_finite;
use crate::inputs::readings::{Command, Measurement, Mode, Pose, Readings, Request};
use crate::law::controller::{Controller, Guided, LANDING_DEPTH_M};
use crate::law::terms::Tick;
use crate::safety::aftermath::Aftermath;
use crate::safety::conditions::{Condition, Conditions};
use crate::safety::detectors::{Counters, Detectors, LastKnown, count};
use crate::safety::hover_thrust::HoverThrust;
use crate::safety::limits::Limits;
use crate::safety::plausibility::tilt_bound;
use crate::safety::preflight::Preflight;
use crate::safety::standing::Standing;
use crate::safety::state_machine::{State, next};
use crate::safety::touchdown::Touchdown;
use crate::whereabouts::{Leap, Lift, Since, Whereabouts};

/// The outcome of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Flight {
    /// Motor commands and how they came about.
    pub tick: Tick,
    /// What the craft is doing.
    pub state: State,
    /// What the detectors found.
    pub conditions: Conditions,
    /// Which preflight checks are good; looked at while disarmed only.
    pub preflight: Preflight,
}

/// Where to stay or to come down.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Anchor {
    position_m: [f32; 2],
    yaw_rad: f32,
    z_m: f32,
    /// Made without poses, or outdated by a time without them: to be made anew with the next one.
    blind: bool,
}

/// Numbers of the landing, in the units of flight.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Descent {
    slow_m_per_us: f32,
    fast_m_per_us: f32,
    blind_offset_m: f32,
    /// Inertial z that a landing commands at the most, m.
    deepest_m: f32,
}

/// All that flies. Copying it is taking a snapshot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Autopilot {
    controller: Controller,
    limits: Limits,
    descent: Descent,
    detectors: Detectors,
    aftermath: Aftermath,
    state: State,
    /// Mode of the pilot's last command.
    mode: Mode,
    idle_wanted: bool,
    whereabouts: Whereabouts,
    anchor: Anchor,
    touchdown: Touchdown,
    standing: Standing,
    hover: HoverThrust,
    flight: Flight,
}

/// A command with motors at idle.
const IDLE: Command = Command {
    mode: Mode::Attitude,
    attitude_rad: [0.0; 2],
    yaw_rad: 0.0,
    z_m: 0.0,
    position_m: [0.0; 2],
    cut_off: true,
    injection: [0.0; 4],
};

impl Autopilot {
    /// A disarmed craft that has received nothing yet.
    ///
    /// # Errors
    /// The first parameter that is not finite or out of range, by name.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        let controller = Controller::new(config)?;
        let landing = &config.supervision.landing;
        let [_, lowest_m] = config.position_limits.z_m;
        let limits = Limits::new(config);
        Ok(Self {
            controller,
            touchdown: Touchdown::new(&limits.touchdown),
            standing: Standing::NOT,
            hover: HoverThrust::of_the_law(&limits.hover),
            limits,
            descent: Descent {
                slow_m_per_us: (landing.descent_m_s * 1e-6) as f32,
                fast_m_per_us: (landing.fast_descent_m_s * 1e-6) as f32,
                blind_offset_m: landing.blind_offset_m as f32,
                deepest_m: lowest_m as f32 + LANDING_DEPTH_M,
            },
            detectors: Detectors::at_rest(),
            aftermath: Aftermath::GOOD,
            state: State::Disarmed,
            mode: IDLE.mode,
            idle_wanted: true,
            whereabouts: Whereabouts::UNKNOWN,
            anchor: Anchor::default(),
            flight: Flight::default(),
        })
    }

    /// A craft that is already flying, with every stream in order: for simulations that begin in
    /// the air. A board boots with [`Autopilot::new`].
    ///
    /// # Errors
    /// Those of [`Autopilot::new`].
    pub fn in_flight(config: &Config) -> Result<Self, ConfigError> {
        Ok(Self { detectors: Detectors::in_flight(), state: State::Flying, ..Self::new(config)? })
    }

    /// What the craft is doing.
    pub fn state(&self) -> State {
        self.state
    }

    /// Counts of what has been refused so far.
    pub fn counters(&self) -> Counters {
        self.detectors.counters
    }

    /// The motor, 0 to 3, that failed first; none after a request to disarm on the ground.
    pub fn failed_motor(&self) -> Option<u8> {
        self.aftermath.failed_motor
    }

    /// The outcome of the last tick; the default before the first.
    pub fn flight(&self) -> &Flight {
        &self.flight
    }

    /// Switches to the law of another configuration, with its loops and estimators at rest: only
    /// while disarmed; returns whether it did. Supervision, landing and counts stay as they are.
    ///
    /// # Errors
    /// Those of [`Autopilot::new`].
    pub fn retune(&mut self, config: &Config) -> Result<bool, ConfigError> {
        if self.state != State::Disarmed {
            return Ok(false);
        }
        let controller = Controller::new(config)?;
        self.controller = controller.with_faults_of(&self.controller);
        Ok(true)
    }

    /// The law alone.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// One control period. Total: whatever comes in, motor commands are finite and inside the
    /// range.
    #[inline]
    pub fn tick(&mut self, readings: &Readings) -> &Flight {
        let mut conditions = Conditions::NONE;
        let found = &mut conditions;
        let elapsed_us = self.detectors.clock(readings.time_us, &self.limits, found);
        let pilot = self.hear_pilot(readings);
        let commanded = pilot.is_some();
        self.detectors.link(commanded, elapsed_us, &self.limits, found);
        let (measurement, seen) = self.measure(readings, elapsed_us, found);
        let attitude_rad = measurement.attitude_rad;
        self.detectors.battery(readings.battery_v, elapsed_us, &self.limits, found);
        self.detectors.tilt(attitude_rad, elapsed_us, &self.limits, found);
        self.detectors.outputs(readings.outputs_ready, elapsed_us, &self.limits, found);
        self.aftermath.report(found);
        let mut preflight = Preflight::default();
        if self.state != State::Flying || readings.request.is_some() || self.idle_wanted {
            preflight = self.attend(readings, commanded, attitude_rad, elapsed_us, &mut conditions);
        }
        let state = next(self.state, conditions);
        let stands = self.standing.found;
        let command;
        let guided = if state == State::Flying && self.state == State::Flying {
            Guided {
                mode: self.mode,
                cut_off: self.idle_wanted,
                lands: false,
                stands,
                command: pilot,
                finite: true,
            }
        } else {
            command = self.guide(state, pilot, attitude_rad, elapsed_us, conditions);
            let Command { mode, cut_off, .. } = command;
            Guided {
                mode,
                cut_off,
                lands: state == State::Land,
                stands,
                command: Some(&command),
                finite: false,
            }
        };
        self.controller.tick_into(&measurement, seen, &guided, &mut self.flight.tick);
        self.look_back(readings, seen, attitude_rad, elapsed_us);
        (self.flight.state, self.flight.conditions, self.flight.preflight) = (state, conditions, preflight);
        &self.flight
    }

    /// The pilot's command, if a good one came; its mode and cut-off stay until the next.
    #[inline]
    fn hear_pilot<'a>(&mut self, readings: &'a Readings) -> Option<&'a Command> {
        let pilot = readings.command.as_ref().filter(|command| is_finite(command));
        match pilot {
            Some(command) => (self.mode, self.idle_wanted) = (command.mode, command.cut_off),
            None if readings.command.is_some() => count(&mut self.detectors.counters.commands_refused),
            None => {}
        }
        pilot
    }

    /// Where the craft is and how it turns: by the pose if a good one came (then `true`), else
    /// carried on by the gyro.
    #[inline]
    fn measure(
        &mut self,
        readings: &Readings,
        elapsed_us: u32,
        conditions: &mut Conditions,
    ) -> (Measurement, bool) {
        let Self { limits, detectors, whereabouts, .. } = self;
        let anchored = self.state != State::Disarmed && whereabouts.is_known();
        let known =
            LastKnown { last: whereabouts.pose(), attitude_rad: whereabouts.attitude_rad(), anchored };
        let mut pose = readings.pose.as_ref();
        if readings.pose_age_us > limits.pose_oldest_us && pose.take().is_some() {
            detectors.old_pose(conditions);
        }
        let seen = detectors.pose(pose, &known, elapsed_us, limits, conditions);
        let gyro_rad_s = detectors.imu(readings.gyro_rad_s, elapsed_us, limits, conditions);
        whereabouts.hear(gyro_rad_s, elapsed_us);
        match pose.filter(|_| seen) {
            Some(pose) => {
                if !whereabouts.counts_as_it_comes(readings.pose_age_us) {
                    self.see_again(pose, readings.pose_age_us, gyro_rad_s, elapsed_us);
                }
                self.whereabouts.see(pose);
            }
            None => self.go_blind(gyro_rad_s, elapsed_us),
        }
        (self.whereabouts.measurement(gyro_rad_s, readings.battery_v), seen)
    }

    /// A good pose that does not count as it comes.
    #[cold]
    fn see_again(&mut self, pose: &Pose, age_us: u32, gyro_rad_s: Option<[f32; 3]>, elapsed_us: u32) {
        let since = self.since(gyro_rad_s, elapsed_us);
        if let Some(Leap { turned_rad, down_m }) = self.whereabouts.see_again(pose, age_us, &since) {
            // What the estimators make of the way between is no velocity.
            self.controller.leap(turned_rad, down_m);
        }
    }

    /// No good pose in this tick.
    #[cold]
    fn go_blind(&mut self, gyro_rad_s: Option<[f32; 3]>, elapsed_us: u32) {
        let since = self.since(gyro_rad_s, elapsed_us);
        self.whereabouts.go_blind(&since);
    }

    /// What happened since the tick before.
    fn since(&self, gyro_rad_s: Option<[f32; 3]>, elapsed_us: u32) -> Since {
        let (tick, limits) = (&self.flight.tick, &self.limits.hover);
        let terms = &tick.terms;
        let flies_by_forces = limits.are_forces() && !self.state.motors_idle();
        let lift = flies_by_forces.then(|| Lift {
            thrust: HoverThrust::vertical(self.controller.given_thrust(tick), terms.attitude_rad, limits),
            hover: self.hover.value(limits),
        });
        let silent = self.detectors.pose.late;
        Since { elapsed_us, gyro_rad_s, silent, z_rate_m_s: terms.z_rate_m_s, lift }
    }

    /// What only the outcome shows, for the next tick.
    #[inline]
    fn look_back(&mut self, readings: &Readings, seen: bool, attitude_rad: [f32; 3], elapsed_us: u32) {
        let tick = &self.flight.tick;
        let terms = &tick.terms;
        let evenly = self.detectors.poses_come_evenly(seen);
        if let (true, true, Some(rates)) = (seen, evenly, readings.gyro_rad_s) {
            self.detectors.compare_rates(rates, terms.body_rates_rad_s, &self.limits);
        }
        let rates_rad_s = readings.gyro_rad_s.unwrap_or(terms.body_rates_rad_s);
        let refused = tick.refused.thrust.high();
        let no_number = tick.faults.internal.now;
        let (aftermath, limits) = (&mut self.aftermath, &self.limits);
        aftermath.after(refused, terms.z_rate_m_s, attitude_rad, no_number, elapsed_us, limits);
        let seen_rad = [attitude_rad, terms.attitude_error_rad];
        aftermath.motors(refused, tick.pwm, seen_rad, elapsed_us, limits);
        aftermath.turns(seen_rad, rates_rad_s, elapsed_us, limits);
        // With motors at idle there is no error, so nothing stands.
        self.standing.step(
            self.whereabouts.pose(),
            !self.detectors.pose.late,
            terms.attitude_error_rad,
            elapsed_us,
        );
        if seen && !refused && self.detectors.pose_is_new() {
            self.hover.learn(terms.thrust, attitude_rad, terms.z_rate_m_s, &self.limits.hover);
        }
        let touchdown = &self.limits.touchdown;
        if self.state == State::Land {
            let [_, _, z_m] = self.whereabouts.pose().position_m;
            let known = !self.detectors.pose.late;
            self.touchdown.land(tick.pwm, [z_m, terms.z_rate_m_s], known, elapsed_us, touchdown);
        } else {
            self.touchdown.fly(tick.pwm, touchdown);
        }
    }

    /// What matters only on the ground, while landing, or on a request.
    #[cold]
    fn attend(
        &mut self,
        readings: &Readings,
        commanded: bool,
        attitude_rad: [f32; 3],
        elapsed_us: u32,
        conditions: &mut Conditions,
    ) -> Preflight {
        let mut preflight = Preflight::default();
        if self.state == State::Disarmed {
            preflight = self.preflight(readings, attitude_rad, *conditions);
        }
        self.detectors.armed(self.state == State::Armed, elapsed_us, &self.limits, conditions);
        let asked = |request| readings.request == Some(request);
        let flies = !self.state.motors_idle();
        if asked(Request::Disarm) && !flies {
            // The pilot has taken note.
            self.aftermath.failed_motor = None;
        }
        conditions.note(Condition::ArmRequested, asked(Request::Arm) && preflight.ready());
        conditions.note(Condition::FlightRequested, commanded && !self.idle_wanted);
        conditions.note(Condition::DisarmRequested, asked(Request::Disarm));
        conditions.note(Condition::LandRequested, asked(Request::Land));
        conditions
            .note(Condition::CutRequested, asked(Request::Cut) || flies && commanded && self.idle_wanted);
        conditions.note(Condition::Landed, self.state == State::Land && self.touchdown.found);
        preflight
    }

    /// The checks before arming.
    fn preflight(&self, readings: &Readings, attitude_rad: [f32; 3], conditions: Conditions) -> Preflight {
        let mut checks = Preflight::default();
        let none = |of: &[Condition]| !of.iter().any(|condition| conditions.has(*condition));
        checks.note(Preflight::LINK, none(&[Condition::LinkLate]));
        checks.note(
            Preflight::POSE,
            none(&[Condition::PoseLate, Condition::PoseFrozen, Condition::PoseJumped, Condition::PoseOld]),
        );
        checks.note(
            Preflight::IMU,
            none(&[Condition::ImuLate, Condition::ImuStuck, Condition::ImuDisagrees, Condition::ImuGone]),
        );
        let sags = [Condition::BatteryLow, Condition::BatteryCritical, Condition::BatteryEmpty];
        checks.note(Preflight::BATTERY, none(&sags) && readings.battery_v.is_finite());
        checks.note(Preflight::LEVEL, tilt_bound(attitude_rad) <= self.limits.arming_tilt_rad);
        checks.note(Preflight::INSIDE, self.detectors.is_inside());
        let timing = [Condition::ClockJumped, Condition::LoopOverrun];
        checks.note(Preflight::TIMING, none(&timing) && self.detectors.on_time(&self.limits));
        checks.note(Preflight::CONTROLLER, none(&[Condition::NotANumber]));
        checks.note(Preflight::OUTPUTS, readings.outputs_ready);
        checks.note(Preflight::IDLE, self.idle_wanted);
        for (motor, check) in (0..).zip(Preflight::MOTORS) {
            checks.note(check, self.aftermath.failed_motor != Some(motor));
        }
        checks
    }

    /// The command in every state but flying, and in the tick in which a state changes. (Back in
    /// flight, the place is held until the next command.)
    #[cold]
    fn guide(
        &mut self,
        state: State,
        pilot: Option<&Command>,
        attitude_rad: [f32; 3],
        elapsed_us: u32,
        conditions: Conditions,
    ) -> Command {
        let before = core::mem::replace(&mut self.state, state);
        if state.motors_idle() {
            self.hover = HoverThrust::of_the_law(&self.limits.hover);
            return IDLE;
        }
        if let (State::Flying, Some(pilot)) = (state, pilot) {
            return *pilot;
        }
        if state == State::Land && before != State::Land {
            self.touchdown.begin();
        }
        let blind = conditions.has(Condition::PoseLate);
        let entered = before == State::Flying;
        if entered || self.anchor.blind != blind {
            self.cast_anchor(attitude_rad, blind, entered);
        }
        let anchor = &mut self.anchor;
        let level = Command { yaw_rad: anchor.yaw_rad, cut_off: false, ..IDLE };
        if blind {
            let thrust = self.hover.carry_on(elapsed_us, &self.limits.hover);
            self.controller.carry_with(thrust);
            let offset_m = if state == State::Land { self.descent.blind_offset_m } else { 0.0 };
            return Command { z_m: anchor.z_m + offset_m, ..level };
        }
        if state == State::Land {
            let empty = conditions.has(Condition::BatteryEmpty);
            let rate = if empty { self.descent.fast_m_per_us } else { self.descent.slow_m_per_us };
            anchor.z_m = (anchor.z_m + rate * elapsed_us as f32).min(self.descent.deepest_m);
        }
        Command { mode: Mode::Position, position_m: anchor.position_m, z_m: anchor.z_m, ..level }
    }

    /// Makes the craft stay where it is. When poses come back, the old place is kept, at the
    /// present height.
    fn cast_anchor(&mut self, attitude_rad: [f32; 3], blind: bool, entered: bool) {
        let [x, y, z] = self.whereabouts.position_m();
        let [_, _, yaw] = attitude_rad;
        if entered {
            (self.anchor.position_m, self.anchor.yaw_rad) = ([x, y], yaw);
        }
        (self.anchor.z_m, self.anchor.blind) = (z, blind);
        if blind {
            // Without poses no one can see a climb end.
            self.controller.settle_height(z);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocation::mixer::Directions;

    const HOVER: Readings = Readings {
        time_us: 0,
        pose: Some(Pose { position_m: [0.0, 0.0, -1.0], attitude_rad: [0.0; 3] }),
        pose_age_us: 0,
        gyro_rad_s: Some([0.0; 3]),
        battery_v: 11.1,
        command: Some(Command { cut_off: false, z_m: -1.0, ..IDLE }),
        request: None,
        outputs_ready: true,
    };

    /// What a flight comes to within a tick of these readings.
    fn after(change: impl FnOnce(&mut Readings)) -> Autopilot {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        autopilot.tick(&HOVER);
        let mut readings = Readings { time_us: 10_000, ..HOVER };
        change(&mut readings);
        autopilot.tick(&readings);
        autopilot
    }

    #[test]
    fn what_is_asked_for_in_flight_is_done_at_once() {
        let state = |change: fn(&mut Readings)| {
            let autopilot = after(change);
            assert_eq!(autopilot.state(), autopilot.flight().state);
            autopilot.state()
        };
        assert_eq!(state(|_| {}), State::Flying);
        assert_eq!(state(|readings| readings.request = Some(Request::Arm)), State::Flying);
        assert_eq!(state(|readings| readings.request = Some(Request::Land)), State::Land);
        assert_eq!(state(|readings| readings.request = Some(Request::Cut)), State::Cut);
        assert_eq!(state(|readings| readings.request = Some(Request::Disarm)), State::Disarmed);
        assert_eq!(state(|readings| readings.command = Some(IDLE)), State::Cut);
    }

    /// Half a second without commands, half a second without poses: what is commanded instead, at the
    /// place and heading that the craft had.
    #[test]
    fn a_craft_that_is_left_alone_stays_where_it_is() {
        let stays = |has_pose: bool, ticks: u32| {
            let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
            for k in 0..10 + ticks {
                let (shiver, left_alone) = ((k % 3) as f32 * 1e-4, k >= 10);
                let position_m = [0.4, -0.3 + shiver, -1.3];
                let pose = Some(Pose { position_m, attitude_rad: [0.0, 0.0, 0.7] });
                autopilot.tick(&Readings {
                    time_us: 10_000 * k,
                    pose: pose.filter(|_| has_pose || !left_alone),
                    gyro_rad_s: Some([0.0, shiver, 0.0]),
                    command: HOVER.command.filter(|_| !has_pose || !left_alone),
                    ..HOVER
                });
            }
            let terms = autopilot.flight().tick.terms;
            let [roll, pitch, yaw] = terms.attitude_command_rad;
            let [x, y] = terms.outer.map_or([0.4, -0.3], |outer| outer.reference_m);
            assert!([yaw - 0.7, x - 0.4, y + 0.3].iter().all(|off| off.abs() < 1e-3), "{yaw} {x} {y}");
            (autopilot.state(), terms.outer.is_some(), terms.z_command_m, [roll, pitch] == [0.0; 2])
        };
        assert_eq!(stays(true, 55), (State::Hold, true, -1.3, false));
        assert_eq!(stays(false, 10), (State::Hold, false, -1.3, true));
        assert_eq!(stays(false, 50), (State::Land, false, -1.3 + 0.06, true), "down, blind");
    }

    /// A flight of this many ticks, in each of which the readings are those of a hover, shivering and changed.
    fn flown(autopilot: &mut Autopilot, ticks: core::ops::Range<u32>, change: impl Fn(u32, &mut Readings)) {
        for k in ticks {
            let shiver = (k % 3) as f32 * 1e-4;
            let mut readings =
                Readings { time_us: 10_000 * k, gyro_rad_s: Some([0.0, shiver, 0.0]), ..HOVER };
            readings.pose.iter_mut().for_each(|pose| pose.position_m[1] = shiver);
            change(k, &mut readings);
            autopilot.tick(&readings);
        }
    }

    /// By the table 0.3 m/s, to 1 m below the box whose floor is at 0: a craft that cannot follow is carried less and less.
    #[test]
    fn a_landing_goes_down_at_its_rate_and_on_below_the_floor() {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        flown(&mut autopilot, 0..10, |_, _| {});
        flown(&mut autopilot, 10..11, |_, readings| readings.request = Some(Request::Land));
        flown(&mut autopilot, 11..111, |_, _| {});
        let z_m = autopilot.flight().tick.terms.z_command_m;
        assert!((z_m - (-1.0 + 0.3 * 1.01)).abs() < 1e-3, "a second later: {z_m} m");
        for (k, from_m, want_m) in [(111, 0.9, 0.903), (112, 0.999, 1.0)] {
            autopilot.anchor.z_m = from_m;
            flown(&mut autopilot, k..k + 1, |_, _| {});
            let z_m = autopilot.flight().tick.terms.z_command_m;
            assert!((z_m - want_m).abs() < 1e-5, "{z_m} m after {from_m} m");
        }
    }

    /// Half a second of them is another matter: see above.
    #[test]
    fn a_command_that_is_missed_leaves_the_one_before() {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        flown(&mut autopilot, 0..20, |k, readings| {
            readings.command =
                HOVER.command.map(|command| Command { z_m: -1.2, ..command }).filter(|_| k < 19);
        });
        let terms = autopilot.flight().tick.terms;
        assert_eq!((autopilot.state(), terms.z_command_m, terms.outer), (State::Flying, -1.2, None));
    }

    /// The place is that of the moment in which the pilot was lost, wherever the wind takes the craft.
    #[test]
    fn a_hold_does_not_drift_with_the_craft() {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        flown(&mut autopilot, 0..100, |k, readings| {
            let drift_m = 0.01 * k.saturating_sub(60) as f32;
            let position_m = &mut readings.pose.as_mut().unwrap().position_m;
            *position_m = [drift_m, position_m[1], -1.0 + 0.5 * drift_m];
            readings.command = readings.command.filter(|_| k < 5);
        });
        assert_eq!(autopilot.state(), State::Hold);
        let terms = autopilot.flight().tick.terms;
        let [x, _] = terms.outer.unwrap().reference_m;
        assert!(x.abs() < 1e-3 && terms.z_command_m == -1.0, "{x} {}", terms.z_command_m);
    }

    /// A craft may be carried about on the ground, and one that is seen for the first time may be anywhere; in flight it cannot leap.
    #[test]
    fn a_leap_is_one_in_flight_only() {
        let leaps = |mut autopilot: Autopilot| {
            flown(&mut autopilot, 0..30, |k, readings| {
                readings.pose.as_mut().unwrap().position_m[0] = if k < 29 { 0.0 } else { 1.5 };
            });
            (
                autopilot.flight().conditions.has(Condition::PoseJumped),
                autopilot.whereabouts.pose().position_m[0],
            )
        };
        assert_eq!(leaps(Autopilot::new(&Config::thesis()).unwrap()), (false, 1.5));
        assert_eq!(leaps(Autopilot::in_flight(&Config::thesis()).unwrap()), (true, 0.0));
    }

    /// One pose that is missed leaves the velocity what it was; the way of a long silence is none.
    #[test]
    fn the_way_of_a_silence_is_no_velocity_and_that_of_a_gap_is() {
        let climbing_m_s = |silent: u32, leap_m: f32| {
            let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
            [1, 2, 3, 4].map(|ticks| {
                let from = if ticks == 1 { 0 } else { 59 + silent + ticks };
                flown(&mut autopilot, from..60 + silent + ticks, |k, readings| {
                    let leap_m = if k > 60 { leap_m } else { 0.0 };
                    readings.pose.as_mut().unwrap().position_m[2] = -1.0 - 0.005 * k as f32 - leap_m;
                    readings.pose = readings.pose.filter(|_| !(60..60 + silent).contains(&k));
                });
                -autopilot.flight().tick.terms.z_rate_m_s
            })
        };
        let after_gap = climbing_m_s(1, 0.0);
        assert!(after_gap.iter().all(|rate| (0.35..0.65).contains(rate)), "0.5 m/s, a gap: {after_gap:?}");
        let after_silence = climbing_m_s(10, 0.3);
        assert!(
            after_silence.iter().all(|rate| (-0.01..0.6).contains(rate)) && after_silence[3] > 0.2,
            "0.1 s without poses, 0.3 m on: {after_silence:?}"
        );
    }

    /// A craft that turns on through silences, and is then seen a little further than the gyro had said: its rate is what it was.
    #[test]
    fn a_silence_does_not_stop_a_turn() {
        for axis in [0, 1, 2] {
            let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
            for k in 0..90 {
                flown(&mut autopilot, k..k + 1, |k, readings| {
                    readings.pose.as_mut().unwrap().attitude_rad[axis] = 0.005 * (k + k / 20) as f32 - 0.2;
                    readings.pose = readings.pose.filter(|_| k % 20 < 12);
                    readings.gyro_rad_s.as_mut().unwrap()[axis] = 0.5 + (k % 3) as f32 * 1e-4;
                });
                let rate_rad_s = autopilot.flight().tick.terms.euler_rates_rad_s[axis];
                assert!(k < 20 || (rate_rad_s - 0.5).abs() < 0.05, "axis {axis}, {k}: {rate_rad_s}");
            }
            assert_eq!(autopilot.counters(), Counters::default(), "axis {axis}");
        }
    }

    /// A flight at a roll rate of 0.5 rad/s whose poses are so old, tick by tick; what the law makes of attitude and rate in each, less what
    /// they are.
    fn rolling(ticks: u32, age_us: impl Fn(u32) -> u32) -> Vec<(f32, f32)> {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        let roll_rad = |time_us: u32| 0.5 * (time_us as f32 * 1e-6 - 0.5);
        let at = |k: u32| (10_000 * k).saturating_sub(age_us(k));
        (0..ticks)
            .map(|k| {
                flown(&mut autopilot, k..k + 1, |k, readings| {
                    let pose = readings.pose.as_mut().unwrap();
                    pose.attitude_rad[0] = roll_rad(at(k));
                    // One that was taken before the last is overtaken by it.
                    readings.pose = readings.pose.filter(|_| k == 0 || at(k) > at(k - 1));
                    readings.pose_age_us = age_us(k);
                    let [_, q, _] = readings.gyro_rad_s.unwrap();
                    readings.gyro_rad_s = Some([0.5, q, 0.0]);
                });
                let terms = autopilot.flight().tick.terms;
                (terms.attitude_rad[0] - roll_rad(10_000 * k), terms.euler_rates_rad_s[0] - 0.5)
            })
            .collect()
    }

    /// On a good link a pose counts as it came. On a slow one, attitude and rate are those of now, and
    /// nothing is felt of the way from one to the other and back.
    #[test]
    fn late_poses_are_brought_to_now() {
        let good = rolling(100, |_| 20_000);
        assert!(good[50..].iter().all(|(off_rad, _)| (off_rad + 0.01).abs() < 1e-5), "{good:?}");
        let age_us = |k| match k {
            0..30 => 20_000,
            30..60 => 60_000 + 10_000 * (k % 3),
            60.. => 15_000,
        };
        let slow = rolling(130, age_us);
        let off_rad_s = slow[20..].iter().map(|(_, off)| off.abs()).fold(0.0, f32::max);
        assert!(off_rad_s < 0.05, "{off_rad_s} {slow:?}");
        assert!(slow[36..105].iter().all(|(off_rad, _)| off_rad.abs() < 1e-3), "{slow:?}");
        assert!(slow[115..].iter().all(|(off_rad, _)| (off_rad + 0.0075).abs() < 1e-5), "{slow:?}");
    }

    /// By a new pose, with thrust that the motors have.
    #[test]
    fn what_carries_the_craft_is_learned_where_it_is_seen() {
        let learns = |seen: bool, refused: bool, is_new: bool| {
            let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
            flown(&mut autopilot, 0..3, |_, readings| {
                readings.pose.as_mut().unwrap().position_m = [0.0, 0.0, -1.0];
            });
            flown(&mut autopilot, 3..4, |_, readings| {
                readings.pose.as_mut().unwrap().position_m = [if is_new { 1e-3 } else { 0.0 }, 0.0, -1.0];
            });
            assert_eq!(autopilot.detectors.pose_is_new(), is_new);
            (autopilot.flight.tick.terms.thrust, autopilot.flight.tick.refused.thrust) =
                (20.0, Directions::new(refused, false));
            let before = autopilot.hover;
            autopilot.look_back(&HOVER, seen, [0.0; 3], 10_000);
            autopilot.hover != before
        };
        assert!(learns(true, false, true));
        assert!(!learns(false, false, true) && !learns(true, true, true) && !learns(true, false, false));
    }

    /// What a landing before had found says nothing of the next one.
    #[test]
    fn a_landing_after_another_begins_anew() {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        let limits = autopilot.limits.touchdown;
        // High up, told to be low: with motors that carry little, as of a craft that stands.
        let high = |_: u32, readings: &mut Readings| {
            readings.pose.as_mut().unwrap().position_m[2] = -1.9;
            readings.command.as_mut().unwrap().z_m = 0.0;
        };
        flown(&mut autopilot, 0..50, high);
        (0..1000).for_each(|_| autopilot.touchdown.fly([2000.0; 4], &limits));
        (0..100).for_each(|_| autopilot.touchdown.land([1000.0; 4], [-1.9, 0.0], true, 10_000, &limits));
        assert!(autopilot.touchdown.found);
        flown(&mut autopilot, 50..51, |k, readings| {
            high(k, readings);
            readings.request = Some(Request::Land);
        });
        assert_eq!((autopilot.state(), autopilot.touchdown.found), (State::Land, false));
    }

    #[test]
    fn what_was_refused_is_counted() {
        let nothing = Command { z_m: f32::NAN, ..IDLE };
        let counters = after(|readings| readings.command = Some(nothing)).counters();
        assert_eq!(counters, Counters { commands_refused: 1, ..Counters::default() });
        let counters = after(|readings| readings.pose_age_us = 200_000).counters();
        assert_eq!(counters, Counters { poses_refused: 1, ..Counters::default() });
        assert_eq!(after(|readings| readings.command = None).counters(), Counters::default());
    }

    /// Told to roll by 0.1 rad, something holds it level for two seconds: within half of one its
    /// integrator has come to rest. From its first motion on it integrates again.
    #[test]
    fn what_holds_a_craft_winds_nothing_up() {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        let rolls = Command { attitude_rad: [0.1, 0.0], ..HOVER.command.unwrap() };
        let mut integral = |ticks: core::ops::Range<u32>, roll_rad: f32| {
            flown(&mut autopilot, ticks, |_, readings| {
                readings.command = Some(rolls);
                readings.pose.as_mut().unwrap().attitude_rad[0] = roll_rad;
            });
            autopilot.flight().tick.terms.roll.i
        };
        let [soon, late] = [integral(0..50, 0.0), integral(50..200, 0.0)];
        assert!(soon > 0.0 && late == soon, "{soon} {late}");
        let moved = integral(200..202, 0.04);
        assert!(moved > late, "{moved} {late}");
    }

    #[test]
    fn a_law_changes_on_the_ground_alone() {
        let other = Config::thesis_hand_tuned();
        let mut flying = after(|_| {});
        let before = *flying.controller();
        assert_eq!((flying.retune(&other), *flying.controller() == before), (Ok(false), true));
        let mut standing = Autopilot::new(&Config::thesis()).unwrap();
        assert_eq!(standing.retune(&other), Ok(true));
        assert_eq!(*standing.controller(), Controller::new(&other).unwrap());
        assert!(standing.retune(&Config { sample_time_s: 0.0, ..other }).is_err());
        assert_eq!(*standing.controller(), Controller::new(&other).unwrap());
    }

    /// It keeps the craft on the ground until the pilot has taken note.
    #[test]
    fn a_motor_that_has_failed_is_remembered() {
        for motor in 0..4_u8 {
            let mut autopilot = Autopilot::new(&Config::thesis()).unwrap();
            autopilot.aftermath.failed_motor = Some(motor);
            let mut preflight = |request, time_us| {
                let bits = autopilot.tick(&Readings { request, time_us, ..HOVER }).preflight.bits();
                (autopilot.failed_motor(), Preflight::MOTORS.map(|check| bits & check == 0))
            };
            let missing = |motor: Option<u8>| [0, 1, 2, 3].map(|k| motor == Some(k));
            assert_eq!(preflight(None, 10_000), (Some(motor), missing(Some(motor))));
            // In the tick of the request the checks have been made already.
            assert_eq!(preflight(Some(Request::Disarm), 20_000).0, None);
            assert_eq!(preflight(None, 30_000), (None, missing(None)));
        }
    }

    /// A result that is no number cannot be brought about from outside (see `tests/totality.rs`);
    /// here it is said to be so.
    #[test]
    fn a_result_that_is_no_number_lands_and_then_cuts() {
        let mut autopilot = Autopilot::in_flight(&Config::thesis()).unwrap();
        let mut readings = HOVER;
        let mut state = |no_number| {
            readings.time_us += 10_000;
            readings.pose.as_mut().unwrap().position_m[0] += 1e-4;
            readings.gyro_rad_s.as_mut().unwrap()[0] += 1e-4;
            autopilot.aftermath.after(false, 0.0, [0.0; 3], no_number, 10_000, &autopilot.limits);
            autopilot.tick(&readings).state
        };
        assert_eq!([state(false), state(false)], [State::Flying; 2]);
        assert_eq!([state(true), state(false)], [State::Land; 2]);
        assert_eq!(state(true), State::Cut);
        assert_eq!(state(false), State::Cut);
    }
}
