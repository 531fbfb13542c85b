//! The program without its hardware.

use control::{Config, ConfigError};
use craft::image::{self, ImageError};
use craft::{Craft, Inputs, LinkStatus, Setup};
use embedded_io::{Read, ReadReady, Write};
use proto::{Deframer, MAX_PACKET_LEN, MAX_STREAM_LEN, Opener, Refused, Role, Sealer};

use crate::board::Board;

/// Version of the program: major, minor, patch.
pub const VERSION: [u16; 3] = [
    number(env!("CARGO_PKG_VERSION_MAJOR")),
    number(env!("CARGO_PKG_VERSION_MINOR")),
    number(env!("CARGO_PKG_VERSION_PATCH")),
];

const fn number(digits: &str) -> u16 {
    match u16::from_str_radix(digits, 10) {
        Ok(number) => number,
        Err(_) => u16::MAX,
    }
}

/// The link's number; a wire joins only two ends, so any will do.
const LINK: u16 = 0;

/// Why a program cannot start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BootError {
    /// The built-in bytes are not an image.
    Image(ImageError),
    /// Its configuration cannot be flown.
    Config(ConfigError),
}

/// Packets in, a tick when it is due, motors, packets out.
#[derive(Debug)]
pub struct Program {
    craft: Craft,
    opener: Opener,
    sealer: Sealer,
    deframer: Deframer,
    config: Config,
    period_us: u32,
    /// When the next tick is due; none before the first.
    due_us: Option<u32>,
    /// Did the outputs take the last commands?
    outputs_ready: bool,
}

impl Program {
    /// A disarmed craft with the gains of an image.
    ///
    /// # Errors
    /// Why the image cannot be flown.
    pub fn new(image: &[u8]) -> Result<Self, BootError> {
        let (config, vehicle_sha256) = image::decode(image).map_err(BootError::Image)?;
        let setup = Setup { vehicle_sha256, program: VERSION, telemetry_every: 1 };
        let mut craft = Craft::new(&config, setup).map_err(BootError::Config)?;
        craft.introduce();
        Ok(Self {
            craft,
            opener: Opener::open(Role::Ground, LINK),
            sealer: Sealer::open(Role::Craft, LINK),
            deframer: Deframer::new(),
            config,
            period_us: (config.sample_time_s * 1e6 + 0.5) as u32,
            due_us: None,
            outputs_ready: true,
        })
    }

    /// What it flies with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Receives, ticks if it is time, or waits. The main loop calls this for ever.
    pub fn step<B: Board>(&mut self, board: &mut B) {
        self.hear(board.link());
        let now_us = board.now_us();
        let due_us = *self.due_us.get_or_insert(now_us);
        let lateness_us = now_us.wrapping_sub(due_us);
        if lateness_us > u32::MAX / 2 {
            board.wait();
            return;
        }
        // After a period without a tick it continues from now: missed ticks are not made up, and
        // the supervisor sees the gap.
        let base_us = if lateness_us >= self.period_us { now_us } else { due_us };
        self.due_us = Some(base_us.wrapping_add(self.period_us));
        self.tick(board, now_us, lateness_us);
        board.feed_watchdog();
    }

    fn tick<B: Board>(&mut self, board: &mut B, time_us: u32, lateness_us: u32) {
        let inputs = Inputs {
            time_us,
            imu: board.imu(),
            battery_v: board.battery_v(),
            current_a: board.current_a(),
            outputs_ready: self.outputs_ready,
            lateness_us,
        };
        let flight = self.craft.tick(&inputs);
        self.outputs_ready = board.drive(&flight.tick.pwm);
        self.speak(board.link());
    }

    /// Receives all packets that have come.
    fn hear(&mut self, link: &mut (impl Read + ReadReady)) {
        let mut bytes = [0; 64];
        while let (Ok(true), Ok(count)) = (link.read_ready(), link.read(&mut bytes)) {
            for byte in bytes.iter().take(count) {
                let Some(packet) = self.deframer.push(*byte) else { continue };
                match self.opener.unseal(packet) {
                    Ok((number, message)) => self.craft.hear(number, &message),
                    Err(Refused::Replayed { .. }) => self.craft.introduce(),
                    Err(_) => {}
                }
            }
        }
    }

    /// Sends all messages of a tick; what the link has no room for is dropped.
    fn speak(&mut self, link: &mut impl Write) {
        let mut state = LinkStatus::from(&self.opener);
        state.refused = state.refused.saturating_add(self.deframer.dropped);
        let (mut packet, mut stream) = ([0; MAX_PACKET_LEN], [0; MAX_STREAM_LEN]);
        while let Some(message) = self.craft.next_message(&state) {
            let Ok((_, packet)) = self.sealer.seal(&message, &mut packet) else { continue };
            if let Some(bytes) = proto::enframe(packet, &mut stream) {
                // A message that is lost here is missing by its number, as on any other link.
                let _ = link.write(bytes);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GAINS_IMAGE;
    use crate::ring::{Ring, Serial};
    use proto::{Command, ImuSample, Message, Mode, Pose, Request, State, TimedPose, enframe};

    /// A craft on a bench: the ground's ends of two rings, sensors that are set by hand, a clock
    /// that goes on by waiting.
    struct Bench<'a> {
        link: Serial<'a, 4096, 4096>,
        now_us: u32,
        pwm: [f32; 4],
        fed: u32,
        broken_outputs: bool,
    }

    impl<'a> Board for Bench<'a> {
        type Link = Serial<'a, 4096, 4096>;
        fn link(&mut self) -> &mut Self::Link {
            &mut self.link
        }
        fn now_us(&mut self) -> u32 {
            self.now_us
        }
        fn wait(&mut self) {
            self.now_us = self.now_us.wrapping_add(1000);
        }
        fn imu(&mut self) -> Option<ImuSample> {
            let dither = (self.now_us % 70_000) as f32 * 1e-8;
            Some(ImuSample { gyro_rad_s: [dither; 3], attitude_rad: None, acceleration_m_s2: None })
        }
        fn battery_v(&mut self) -> f32 {
            11.8
        }
        fn current_a(&mut self) -> Option<f32> {
            None
        }
        fn drive(&mut self, commands: &[f32; 4]) -> bool {
            self.pwm = *commands;
            !self.broken_outputs
        }
        fn feed_watchdog(&mut self) {
            self.fed += 1;
        }
    }

    struct Ground<'a> {
        to_craft: &'a Ring<4096>,
        from_craft: &'a Ring<4096>,
        sealer: Sealer,
        opener: Opener,
        deframer: Deframer,
    }

    impl Ground<'_> {
        fn say(&mut self, message: Message) {
            let (mut packet, mut stream) = ([0; MAX_PACKET_LEN], [0; MAX_STREAM_LEN]);
            let (_, packet) = self.sealer.seal(&message, &mut packet).unwrap();
            assert!(self.to_craft.push(enframe(packet, &mut stream).unwrap()));
        }

        fn heard(&mut self) -> Vec<Message> {
            let mut all = Vec::new();
            while let Some(byte) = self.from_craft.pop() {
                if let Some(packet) = self.deframer.push(byte) {
                    all.push(self.opener.unseal(packet).unwrap().1);
                }
            }
            all
        }
    }

    fn with_bench(test: impl FnOnce(&mut Program, &mut Bench, &mut Ground)) {
        let (up, down) = (Ring::new(), Ring::new());
        let link = Serial { received: &up, to_send: &down, start: || {} };
        let mut bench =
            Bench { link, now_us: u32::MAX - 500_000, pwm: [0.0; 4], fed: 0, broken_outputs: false };
        let mut ground = Ground {
            to_craft: &up,
            from_craft: &down,
            sealer: Sealer::open(Role::Ground, 0),
            opener: Opener::open(Role::Craft, 0),
            deframer: Deframer::new(),
        };
        test(&mut Program::new(GAINS_IMAGE).unwrap(), &mut bench, &mut ground);
    }

    /// Runs to the end of the next tick.
    fn tick(program: &mut Program, bench: &mut Bench) {
        let fed = bench.fed;
        while bench.fed == fed {
            program.step(bench);
        }
    }

    fn command(cut_off: bool) -> Message {
        Message::Command(Command {
            mode: Mode::Position,
            attitude_rad: [0.0; 2],
            yaw_rad: 0.0,
            z_m: -1.0,
            position_m: [0.0; 2],
            cut_off,
            injection: [0.0; 4],
        })
    }

    fn pose(k: u32) -> Message {
        let pose = Pose { position_m: [(k % 7) as f32 * 1e-4, 0.0, -0.05], attitude_rad: [0.0; 3] };
        Message::Pose(TimedPose { frame: k, ground_us: k * 10_000, pose })
    }

    #[test]
    fn it_introduces_itself_idles_and_reports_at_100_hz() {
        with_bench(|program, bench, ground| {
            let start_us = bench.now_us;
            for _ in 0..100 {
                tick(program, bench);
                assert_eq!(bench.pwm, [1000.0; 4]);
            }
            assert_eq!(bench.now_us.wrapping_sub(start_us), 990_000, "across the wrap of the clock");
            let heard = ground.heard();
            let Message::Identity(identity) = heard[0] else { panic!("{:?}", heard[0]) };
            assert_eq!((identity.state, identity.program), (State::Disarmed, VERSION));
            let telemetry = heard.iter().filter(|m| matches!(m, Message::Telemetry(_))).count();
            // What no one reads fills the buffer; the rest is left out and the loop goes on.
            assert!(telemetry > 10 && telemetry < 100, "{telemetry}");
        });
    }

    #[test]
    fn the_ground_arms_it_and_takes_off() {
        with_bench(|program, bench, ground| {
            for k in 0..400 {
                ground.say(pose(k));
                ground.say(command(k < 350));
                if k == 300 {
                    ground.say(Message::Request(Request::Arm));
                }
                tick(program, bench);
                let answered = ground.heard().iter().any(|m| matches!(m, Message::Answer(a) if a.done));
                assert_eq!(answered, k == 300);
                assert_eq!(bench.pwm == [1000.0; 4], k < 350, "tick {k}: {:?}", bench.pwm);
            }
        });
    }

    #[test]
    fn outputs_that_fail_keep_it_on_the_ground() {
        with_bench(|program, bench, ground| {
            bench.broken_outputs = true;
            for k in 0..310 {
                ground.say(pose(k));
                ground.say(command(true));
                if k > 300 {
                    ground.say(Message::Request(Request::Arm));
                }
                tick(program, bench);
                assert!(!ground.heard().iter().any(|m| matches!(m, Message::Answer(a) if a.done)));
            }
        });
    }

    #[test]
    fn a_late_tick_is_reported_and_no_tick_is_made_up() {
        with_bench(|program, bench, ground| {
            for _ in 0..20 {
                tick(program, bench);
                ground.heard();
            }
            bench.now_us += 35_000;
            tick(program, bench);
            let heard = ground.heard();
            let [Message::Telemetry(telemetry)] = heard[..] else { panic!("{heard:?}") };
            assert!(
                telemetry.counters.jitter_us >= 25_000 && telemetry.counters.overruns == 1,
                "{telemetry:?}"
            );
            let before_us = bench.now_us;
            tick(program, bench);
            assert_eq!(bench.now_us - before_us, 10_000);
        });
    }

    #[test]
    fn noise_on_the_wire_is_counted_and_does_no_more() {
        with_bench(|program, bench, ground| {
            for k in 0..300_u32 {
                let garbage: Vec<u8> = (0..50).map(|j| (k * 31 + j * 17) as u8).collect();
                ground.to_craft.push(&garbage);
                tick(program, bench);
                assert_eq!(bench.pwm, [1000.0; 4]);
                if let Some(Message::Telemetry(t)) = ground.heard().last()
                    && k == 299
                {
                    assert!(t.counters.packets_refused > 10, "{t:?}");
                }
            }
        });
    }

    #[test]
    fn a_damaged_image_does_not_boot() {
        let mut image = GAINS_IMAGE.to_vec();
        image[100] ^= 1;
        assert!(matches!(Program::new(&image), Err(BootError::Image(ImageError::Damaged))));
    }
}
