//! The program without its hardware.

use control::{Config, ConfigError};
use craft::image::{self, ImageError};
use craft::{Craft, Inputs, LinkStatus, Setup};
use embedded_io::{Read, ReadReady, Write};
use proto::{CraftEnd, Deframer, Ending, Heard, Key, MAX_PACKET_LEN, MAX_STREAM_LEN};

use crate::board::Board;
use crate::clock::Beats;

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
    key: Option<Key>,
    /// None as long as the board has given no random bytes: nobody is heard.
    end: Option<CraftEnd>,
    /// The session of whoever spoke last.
    ground: Option<u64>,
    deframer: Deframer,
    /// Time since the first step, us, and the board's clock then.
    elapsed_us: u64,
    last_us: Option<u32>,
    config: Config,
    beats: Beats,
    /// Did the outputs take the last commands?
    outputs_ready: bool,
}

impl Program {
    /// A disarmed craft with the gains of an image, and the key that the ground has too, if there is
    /// one. `last_end` is why the chip was started.
    ///
    /// # Errors
    /// Why the image cannot be flown.
    pub fn new(image: &[u8], key: Option<Key>, last_end: Ending) -> Result<Self, BootError> {
        let (config, vehicle_sha256) = image::decode(image).map_err(BootError::Image)?;
        let setup = Setup { vehicle_sha256, program: VERSION, telemetry_every: 1, last_end };
        Ok(Self {
            craft: Craft::new(&config, setup).map_err(BootError::Config)?,
            key,
            end: None,
            ground: None,
            deframer: Deframer::new(),
            elapsed_us: 0,
            last_us: None,
            config,
            beats: Beats::new((config.sample_time_s * 1e6 + 0.5) as u32),
            outputs_ready: true,
        })
    }

    /// What it flies with.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Receives, ticks if it is time, or waits. The main loop calls this for ever.
    pub fn step<B: Board>(&mut self, board: &mut B) {
        let now_us = board.now_us();
        let last_us = self.last_us.replace(now_us).unwrap_or(now_us);
        self.elapsed_us = self.elapsed_us.wrapping_add(u64::from(now_us.wrapping_sub(last_us)));
        if self.end.is_none() {
            self.end = board.random().map(|random| CraftEnd::new(LINK, self.key.clone(), random));
        }
        self.hear(board.link());
        let Some(lateness_us) = self.beats.late_us(now_us) else {
            board.wait();
            return;
        };
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

    /// The craft's clock as packets carry it.
    fn now_ms(&self) -> u32 {
        (self.elapsed_us / 1000) as u32
    }

    /// Receives all packets that have come, and answers hellos.
    fn hear(&mut self, link: &mut (impl Read + ReadReady + Write)) {
        let now_ms = self.now_ms();
        let Self { craft, end: Some(end), deframer, ground, .. } = self else { return };
        let (mut bytes, mut reply, mut stream) = ([0; 64], [0; MAX_PACKET_LEN], [0; MAX_STREAM_LEN]);
        while let (Ok(true), Ok(count)) = (link.read_ready(), link.read(&mut bytes)) {
            for byte in bytes.iter().take(count) {
                let Some(packet) = deframer.push(*byte) else { continue };
                match end.hear(now_ms, None, packet, &mut reply) {
                    Ok(Heard::Hello(challenge)) => send(challenge, link, &mut stream),
                    Ok(Heard::Message(opened)) => {
                        *ground = Some(opened.session);
                        craft.receive(&opened);
                    }
                    Err(_) => {}
                }
            }
        }
        end.forget_silent(now_ms);
    }

    /// Sends all messages of a tick; what the link has no room for is dropped.
    fn speak(&mut self, link: &mut impl Write) {
        let now_ms = self.now_ms();
        let Self { craft, end: Some(end), deframer, ground, .. } = self else { return };
        let mut counted = LinkStatus::from(end.statistics);
        counted.refused = counted.refused.saturating_add(deframer.dropped);
        let (mut packet, mut stream) = ([0; MAX_PACKET_LEN], [0; MAX_STREAM_LEN]);
        while let Some(message) = craft.next_message(&counted) {
            let Some(ground) = *ground else { continue };
            if let Ok((_, packet)) = end.seal(now_ms, ground, &message, &mut packet) {
                send(packet, link, &mut stream);
            }
        }
    }
}

/// Writes a packet in its stuffed form. One that is lost here is missing by its number, as on any
/// other link.
fn send(packet: &[u8], link: &mut impl Write, stream: &mut [u8; MAX_STREAM_LEN]) {
    if let Some(bytes) = proto::enframe(packet, stream) {
        let _ = link.write(bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GAINS_IMAGE;
    use crate::ring::{Ring, Serial};
    use proto::{Command, GroundEnd, ImuSample, Message, Mode, Pose, Request, State, TimedPose, enframe};

    /// A craft on a bench: the ground's ends of two rings, sensors that are set by hand, a clock
    /// that goes on by waiting.
    struct Bench<'a> {
        link: Serial<'a, 4096, 4096>,
        now_us: u32,
        pwm: [f32; 4],
        fed: u32,
        broken_outputs: bool,
        /// Period of a timer that alone wakes it; else something does every ms.
        timer_us: Option<u32>,
        random: Option<[u8; 32]>,
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
            let slept_us = self.timer_us.map_or(1000, |period_us| period_us - self.now_us % period_us);
            self.now_us = self.now_us.wrapping_add(slept_us);
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
        fn random(&mut self) -> Option<[u8; 32]> {
            self.random
        }
    }

    struct Ground<'a> {
        to_craft: &'a Ring<4096>,
        from_craft: &'a Ring<4096>,
        end: GroundEnd,
        deframer: Deframer,
        now_ms: u32,
    }

    impl Ground<'_> {
        fn push(&self, packet: &[u8]) {
            assert!(self.to_craft.push(enframe(packet, &mut [0; MAX_STREAM_LEN]).unwrap()));
        }

        fn say(&mut self, message: Message) {
            let mut packet = [0; MAX_PACKET_LEN];
            let (_, packet) = self.end.seal(self.now_ms, &message, &mut packet).unwrap();
            self.push(packet);
        }

        fn greet(&mut self) {
            if let Some(hello) = self.end.greet(self.now_ms, &mut [0; MAX_PACKET_LEN]) {
                self.push(hello);
            }
        }

        fn heard(&mut self) -> Vec<Message> {
            self.now_ms += 10;
            let mut all = Vec::new();
            while let Some(byte) = self.from_craft.pop() {
                if let Some(packet) = self.deframer.push(byte) {
                    all.extend(self.end.hear(self.now_ms, packet).unwrap().map(|(_, message)| message));
                }
            }
            all
        }
    }

    const KEY: Key = Key::new([3; 32]);

    /// A craft and a ground station that have a session.
    fn with_bench(test: impl FnOnce(&mut Program, &mut Bench, &mut Ground)) {
        with_keys([Some(KEY), Some(KEY)], |program, bench, ground| {
            ground.greet();
            tick(program, bench);
            assert_eq!(ground.heard(), []);
            test(program, bench, ground);
        });
    }

    fn with_keys(keys: [Option<Key>; 2], test: impl FnOnce(&mut Program, &mut Bench, &mut Ground)) {
        let [craft_key, ground_key] = keys;
        let (up, down) = (Ring::new(), Ring::new());
        let link = Serial { received: &up, to_send: &down, start: || {} };
        let mut bench = Bench {
            link,
            now_us: u32::MAX - 500_000,
            pwm: [0.0; 4],
            fed: 0,
            broken_outputs: false,
            timer_us: None,
            random: Some([1; 32]),
        };
        let mut ground = Ground {
            to_craft: &up,
            from_craft: &down,
            end: GroundEnd::new(0, ground_key, [2; 32]),
            deframer: Deframer::new(),
            now_ms: 0,
        };
        test(&mut Program::new(GAINS_IMAGE, craft_key, Ending::Watchdog).unwrap(), &mut bench, &mut ground);
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
            ground.say(Message::Who);
            tick(program, bench);
            let start_us = bench.now_us;
            for _ in 0..100 {
                tick(program, bench);
                assert_eq!(bench.pwm, [1000.0; 4]);
            }
            assert_eq!(bench.now_us.wrapping_sub(start_us), 1_000_000, "across the wrap of the clock");
            let heard = ground.heard();
            let Message::Identity(identity) = heard[0] else { panic!("{:?}", heard[0]) };
            assert_eq!((identity.state, identity.program), (State::Disarmed, VERSION));
            assert_eq!(heard[1], Message::LastEnd(Ending::Watchdog), "and why it was started");
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

    /// Nothing but the timer's period wakes it, after a start in the middle of one; and a tick of
    /// 25 ms comes between.
    #[test]
    fn ticks_lie_where_the_timers_periods_begin() {
        with_bench(|program, bench, _| {
            bench.now_us = 3_000_037;
            program.beats = Beats::new(10_000);
            bench.timer_us = Some(10_000);
            tick(program, bench);
            for k in 1..=20 {
                tick(program, bench);
                assert_eq!(bench.now_us, 3_000_000 + k * 10_000, "one a period");
                bench.now_us += 150; // what a tick takes
            }
            bench.now_us += 25_000;
            for k in [22, 23, 24, 25] {
                tick(program, bench);
                assert_eq!(bench.now_us / 10_000, 300 + k);
            }
        });
    }

    #[test]
    fn a_late_tick_is_reported_and_no_tick_is_made_up() {
        with_bench(|program, bench, ground| {
            ground.say(Message::Who);
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
            assert_eq!(bench.now_us - before_us, 5_000, "where it would have been");
        });
    }

    #[test]
    fn noise_on_the_wire_is_counted_and_does_no_more() {
        with_bench(|program, bench, ground| {
            for k in 0..300_u32 {
                ground.say(Message::Who);
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

    /// Who has another key, or none, is not heard; nor is anybody by a board without random bytes.
    #[test]
    fn the_wire_has_a_key() {
        let other = Key::new([4; 32]);
        for (keys, random, heard) in [
            ([Some(KEY), Some(KEY)], Some([1; 32]), true),
            ([None, None], Some([1; 32]), true),
            ([Some(KEY), Some(other)], Some([1; 32]), false),
            ([Some(KEY), None], Some([1; 32]), false),
            ([None, Some(KEY)], Some([1; 32]), false),
            ([Some(KEY), Some(KEY)], None, false),
        ] {
            with_keys(keys, |program, bench, ground| {
                bench.random = random;
                for _ in 0..20 {
                    ground.greet();
                    tick(program, bench);
                    ground.heard();
                }
                assert_eq!(ground.end.is_open(), heard, "{heard}");
            });
        }
    }

    #[test]
    fn a_damaged_image_does_not_boot() {
        let mut image = GAINS_IMAGE.to_vec();
        image[100] ^= 1;
        assert!(matches!(
            Program::new(&image, None, Ending::Unknown),
            Err(BootError::Image(ImageError::Damaged))
        ));
    }
}
