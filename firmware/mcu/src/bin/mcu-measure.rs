//! What a period costs on the chip: instructions and stack, printed as one line of JSON through
//! semihosting.
//!
//! The whole [`Program`](mcu::Program) runs here, over a link in memory, through everything that
//! makes it work: booting, the ground asking who it is and changing gains, arming, flying in both
//! modes, poses that stop and come back, a landing. Noise is made beside it, so the ground is part
//! of the stack's figure but not of the instructions'.
//!
//! - Instructions: QEMU counts 2^6 ns for each (`-icount shift=6`), and the core's timer counts 25
//!   MHz, so one instruction is 1.6 counts. A real chip takes about as many cycles, more where its
//!   flash waits.
//! - The tick alone, supervisor and input checks included, is measured beside it, a craft wobbling
//!   about hover as in the benches of `control`: the mean in each mode.
//! - Stack: all of it is painted before `main` (`paint-stack` of cortex-m-rt); what was used lost
//!   its colour. That is the greatest depth of this run with its interrupts, not a bound over all
//!   runs.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", not(feature = "stm32f405")))]
#[allow(unsafe_code, reason = "the stack is looked at")]
mod target {
    use core::fmt::Write;
    use core::hint::black_box;

    use control::{Autopilot, Readings};
    use cortex_m::peripheral::SYST;
    use cortex_m::peripheral::syst::SystClkSource;
    use cortex_m_semihosting::{debug, hio};
    use mcu::ring::{Ring, Serial};
    use mcu::{Board, GAINS_IMAGE, Program, mps2};
    use proto::{
        Command, Deframer, Gains, GroundEnd, ImuSample, Key, Loop, MAX_PACKET_LEN, MAX_STREAM_LEN, Message,
        Mode, Pose, Request, TimedPose, enframe,
    };

    static UP: Ring<2048> = Ring::new();
    static DOWN: Ring<2048> = Ring::new();

    /// The greatest count of the timer.
    const FULL: u32 = 0xff_ffff;
    const TICKS: u32 = 2000;
    const KEY: Key = Key::new([1; 32]);

    /// Motors, sensors and time in memory.
    struct Bench {
        link: Serial<'static, 2048, 2048>,
        now_us: u32,
        pwm: [f32; 4],
        noise: u32,
        done: bool,
    }

    impl Bench {
        /// In [-0.5, 0.5).
        fn noise(&mut self) -> f32 {
            self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.noise >> 8) as f32 / 16_777_216.0 - 0.5
        }
    }

    impl Board for Bench {
        type Link = Serial<'static, 2048, 2048>;
        fn link(&mut self) -> &mut Self::Link {
            &mut self.link
        }
        fn now_us(&mut self) -> u32 {
            self.now_us
        }
        fn wait(&mut self) {}
        fn imu(&mut self) -> Option<ImuSample> {
            let gyro_rad_s = [(); 3].map(|()| 0.05 * self.noise());
            Some(ImuSample { gyro_rad_s, attitude_rad: None, acceleration_m_s2: Some([0.0, 0.0, -9.8]) })
        }
        fn battery_v(&mut self) -> f32 {
            11.5 + 0.1 * self.noise()
        }
        fn current_a(&mut self) -> Option<f32> {
            Some(5.0)
        }
        fn drive(&mut self, commands: &[f32; 4]) -> bool {
            self.pwm = *commands;
            true
        }
        fn random(&mut self) -> Option<[u8; 32]> {
            Some([1; 32])
        }
        fn feed_watchdog(&mut self) {
            self.done = true;
        }
    }

    /// The ground's end of the link: packets with a key, as in flight.
    struct Ground {
        end: GroundEnd,
        deframer: Deframer,
        now_ms: u32,
    }

    impl Ground {
        fn push(packet: &[u8]) {
            if let Some(bytes) = enframe(packet, &mut [0; MAX_STREAM_LEN]) {
                UP.push(bytes);
            }
        }

        fn greet(&mut self) {
            if let Some(hello) = self.end.greet(self.now_ms, &mut [0; MAX_PACKET_LEN]) {
                Self::push(hello);
            }
        }

        /// Empties the link: telemetry has to fit into it each time, as on one that is fast enough.
        fn hear(&mut self) {
            while let Some(byte) = DOWN.pop() {
                if let Some(packet) = self.deframer.push(byte) {
                    let _ = self.end.hear(self.now_ms, packet);
                }
            }
        }
    }

    fn say(ground: &mut Ground, message: &Message) {
        if let Ok((_, packet)) = ground.end.seal(ground.now_ms, message, &mut [0; MAX_PACKET_LEN]) {
            Ground::push(packet);
        }
    }

    /// What the ground says before tick `k`.
    fn speak(ground: &mut Ground, bench: &mut Bench, k: u32) {
        let at_rest = k < 320;
        if !(1200..1220).contains(&k) {
            let [x, y, z] = [(); 3].map(|()| 0.002 * bench.noise());
            let attitude_rad = [(); 3].map(|()| 0.002 * bench.noise());
            // Two seconds of climbing.
            let climbed = k.saturating_sub(320).min(200) as f32 / 200.0;
            let pose = Pose { position_m: [x, y, z - 0.05 - 0.95 * climbed], attitude_rad };
            say(ground, &Message::Pose(TimedPose { frame: k, ground_us: k * 10_000, pose }));
        }
        let command = Command {
            mode: if k % 200 < 100 { Mode::Position } else { Mode::Attitude },
            attitude_rad: [0.05, -0.05],
            yaw_rad: 0.3,
            z_m: -1.0,
            position_m: [0.2, -0.1],
            cut_off: at_rest,
            injection: [1.0, -1.0, 1.0, -1.0],
        };
        say(ground, &Message::Command(command));
        match k {
            5 => say(ground, &Message::Who),
            10 => say(ground, &Message::Gains(Gains { of: Loop::Roll, kp: 100.0, ki: 100.0, kd: 10.0 })),
            310 => say(ground, &Message::Request(Request::Arm)),
            1800 => say(ground, &Message::Request(Request::Land)),
            _ => {}
        }
    }

    /// Counts of the timer since it was at `start`.
    fn since(start: u32) -> u32 {
        start.wrapping_sub(SYST::get_current()) & FULL
    }

    /// Instructions of so many counts: 2^6 ns each, 40 ns a count.
    fn instructions(counts: u32) -> u32 {
        counts * 5 / 8
    }

    /// Instructions of a tick of the autopilot in flight, on average; 0 if it does not fly.
    #[inline(never)]
    fn tick_alone(config: &control::Config, mode: control::Mode) -> u32 {
        const TICKS: u16 = 200;
        let Ok(mut autopilot) = Autopilot::in_flight(config) else { return 0 };
        let mut counts = 0;
        for k in 0..TICKS {
            let angle = f32::from(k) * 0.0628;
            let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
            let readings = Readings {
                time_us: u32::from(k) * 10_000,
                pose: Some(control::Pose {
                    position_m: [0.02 * sin, 0.02 * cos, -1.0 + 0.02 * sin * cos],
                    attitude_rad: [0.01 * cos, 0.01 * sin, 0.05 * sin],
                }),
                pose_age_us: 0,
                gyro_rad_s: Some([-0.01 * sin, 0.01 * cos, 0.05 * cos]),
                battery_v: 11.1,
                command: Some(control::Command { mode, z_m: -1.0, ..control::Command::default() }),
                request: None,
                outputs_ready: true,
            };
            let start = SYST::get_current();
            black_box(autopilot.tick(black_box(&readings)));
            counts += since(start);
        }
        instructions(counts) / u32::from(TICKS)
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Some(mut core) = cortex_m::Peripherals::take() else { mps2::fail() };
        core.SYST.set_clock_source(SystClkSource::Core);
        core.SYST.set_reload(FULL);
        core.SYST.clear_current();
        core.SYST.enable_counter();
        let boot = SYST::get_current();
        let Ok(mut program) = Program::new(GAINS_IMAGE, Some(KEY), mps2::last_end()) else { mps2::fail() };
        let boot = since(boot);
        let end = GroundEnd::new(0, Some(KEY), [2; 32]);
        let mut ground = Ground { end, deframer: Deframer::new(), now_ms: 0 };
        let link = Serial { received: &UP, to_send: &DOWN, start: || {} };
        let mut bench = Bench { link, now_us: 0, pwm: [0.0; 4], noise: 1, done: false };
        let (mut least, mut most, mut sum, mut flown, mut retune) = (u32::MAX, 0, 0_u32, 0, 0);
        for k in 0..TICKS {
            ground.now_ms = k * 10;
            ground.greet();
            speak(&mut ground, &mut bench, k);
            bench.now_us = k * 10_000;
            bench.done = false;
            let start = SYST::get_current();
            while !bench.done {
                program.step(&mut bench);
            }
            let counts = since(start);
            ground.hear();
            if k == 10 {
                retune = instructions(counts);
            } else if bench.pwm != [1000.0; 4] {
                let counts = instructions(counts);
                (least, most, sum, flown) = (least.min(counts), most.max(counts), sum + counts, flown + 1);
            }
        }
        let (boot, stack, program_bytes) = (instructions(boot), stack_used(), size_of::<Program>());
        // Behind the look at the stack, which is the program's.
        let [attitude, position] =
            [control::Mode::Attitude, control::Mode::Position].map(|mode| tick_alone(program.config(), mode));
        let mean = sum.checked_div(flown).unwrap_or(0);
        if let Ok(mut out) = hio::hstdout() {
            let _ = writeln!(
                out,
                "{{\"flown_ticks\":{flown},\"instructions\":{{\"boot\":{boot},\"gains_change\":{retune},\
                 \"period_least\":{least},\"period_mean\":{mean},\"period_most\":{most},\
                 \"tick_attitude\":{attitude},\"tick_position\":{position}}},\
                 \"stack_bytes\":{stack},\"program_bytes\":{program_bytes}}}"
            );
        }
        debug::exit(debug::EXIT_SUCCESS);
        mps2::fail()
    }

    /// Bytes of the stack that have lost their paint.
    fn stack_used() -> usize {
        unsafe extern "C" {
            static _stack_end: u32;
            static _stack_start: u32;
        }
        let (end, start) = (&raw const _stack_end, &raw const _stack_start);
        let mut place = end;
        // SAFETY: from the end of the static variables to the top of the stack there is memory, and
        // words are read one by one.
        while place < start && unsafe { place.read_volatile() } == 0xcccc_cccc {
            place = place.wrapping_add(1);
        }
        (start as usize).saturating_sub(place as usize)
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        mps2::fail()
    }
}

#[cfg(all(target_os = "none", feature = "stm32f405"))]
compile_error!("mcu-measure is for QEMU: build it without the feature stm32f405");

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("mcu-measure is a program for the emulated Cortex-M4F: cargo xtask arm runs it");
}
