//! Linked, never run: it links only if no panic can be reached from what a craft hears, from its
//! tick, or from what it says afterwards.
//!
//! What it hears is any bytes there may be: of the wire, through stuffing, CRC, number and message
//! to the craft, as the microcontroller's whole period does it; the same over a network, as the craft's
//! computer does it; of an IMU board's line; and an image of gains.
//!
//! The panic handler calls a function that nobody defines. As long as anything that may panic is
//! left after optimisation, the linker asks for it by name.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "a craft out of nowhere, and a function that must not exist")]
mod target {
    use core::convert::Infallible;
    use core::mem::MaybeUninit;
    use core::net::SocketAddr;
    use core::ptr::{addr_of, addr_of_mut, read_volatile, write_volatile};

    use craft::{Craft, Inputs, LinkStatus, image};
    use embedded_io::{ErrorType, Read, ReadReady, Write};
    use mcu::{Board, Program};
    use proto::{CraftEnd, Heard, ImuSample, Key, MAX_PACKET_LEN, Message, Opener, Role, Sealer, imu_frame};

    /// Anything, as far as the optimiser knows.
    static mut LINE: [u8; 512] = [0; 512];
    static mut FLAGS: [bool; 4] = [false; 4];
    static mut NUMBERS: [u64; 4] = [0; 4];
    static mut INPUTS: MaybeUninit<Inputs> = MaybeUninit::uninit();
    static mut PROGRAM: MaybeUninit<Program> = MaybeUninit::uninit();
    static mut CRAFT: MaybeUninit<Craft> = MaybeUninit::uninit();
    static mut ENDS: MaybeUninit<(CraftEnd, Opener, Sealer)> = MaybeUninit::uninit();
    static mut PARSER: MaybeUninit<imu_frame::Parser> = MaybeUninit::uninit();
    static mut SAID: u8 = 0;

    fn line() -> [u8; 512] {
        // SAFETY: one thread, no interrupts.
        unsafe { read_volatile(addr_of!(LINE)) }
    }

    fn flag(which: usize) -> bool {
        // SAFETY: as above.
        unsafe { read_volatile(addr_of!(FLAGS)) }.get(which).copied().unwrap_or_default()
    }

    fn inputs() -> Inputs {
        // SAFETY: this is compiled for what the linker makes of it, and never runs.
        unsafe { read_volatile(addr_of!(INPUTS).cast::<Inputs>()) }
    }

    fn say(byte: u8) {
        // SAFETY: as above.
        unsafe { write_volatile(addr_of_mut!(SAID), byte) }
    }

    /// A board of which nothing is known.
    struct Any;

    impl ErrorType for Any {
        type Error = Infallible;
    }

    impl ReadReady for Any {
        fn read_ready(&mut self) -> Result<bool, Infallible> {
            Ok(flag(0))
        }
    }

    impl Read for Any {
        fn read(&mut self, into: &mut [u8]) -> Result<usize, Infallible> {
            for (place, byte) in into.iter_mut().zip(line()) {
                *place = byte;
            }
            Ok(usize::from(line()[0]))
        }
    }

    impl Write for Any {
        fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
            bytes.iter().for_each(|byte| say(*byte));
            Ok(bytes.len())
        }

        fn flush(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    impl Board for Any {
        type Link = Self;

        fn link(&mut self) -> &mut Self {
            self
        }
        fn now_us(&mut self) -> u32 {
            inputs().time_us
        }
        fn wait(&mut self) {}
        fn imu(&mut self) -> Option<ImuSample> {
            inputs().imu
        }
        fn battery_v(&mut self) -> f32 {
            inputs().battery_v
        }
        fn current_a(&mut self) -> Option<f32> {
            inputs().current_a
        }
        fn drive(&mut self, commands: &[f32; 4]) -> bool {
            say(u8::from(*commands != [0.0; 4]));
            flag(1)
        }
        fn random(&mut self) -> Option<[u8; 32]> {
            flag(3).then_some([numbers()[0] as u8; 32])
        }
        fn feed_watchdog(&mut self) {}
    }

    /// A packet over a network, to the craft and back; and a plain one.
    fn over_a_network(craft: &mut Craft, (end, opener, sealer): &mut (CraftEnd, Opener, Sealer)) {
        let (mut reply, [now_ms, session, ip, _]) = ([0; MAX_PACKET_LEN], numbers());
        let from = Some(SocketAddr::from(((ip as u32).to_be_bytes(), session as u16)));
        say(u8::from(end.glance(from, &line()).is_ok()));
        match end.hear(now_ms as u32, from, &line(), &mut reply) {
            Ok(Heard::Message(opened)) => craft.receive(&opened),
            Ok(Heard::Hello(challenge)) => challenge.iter().for_each(|byte| say(*byte)),
            Err(_) => {}
        }
        end.forget_silent(now_ms as u32);
        let mut buffer = [0; MAX_PACKET_LEN];
        while let Some(message) = craft.next_message(&LinkStatus::from(end.statistics)) {
            if let Ok((_, packet)) = end.seal(now_ms as u32, session, &message, &mut buffer) {
                packet.iter().for_each(|byte| say(*byte));
            }
        }
        say(u8::from(opener.unseal(&line()).is_ok()));
        say(u8::from(sealer.seal(&Message::Who, &mut buffer).is_ok()));
    }

    fn numbers() -> [u64; 4] {
        // SAFETY: as above.
        unsafe { read_volatile(addr_of!(NUMBERS)) }
    }

    #[cortex_m_rt::entry]
    fn main() -> ! {
        loop {
            // SAFETY: none is needed: this is compiled for what the linker makes of it, and never
            // runs.
            let (program, craft, ends, parser) = unsafe {
                (
                    &mut *addr_of_mut!(PROGRAM).cast::<Program>(),
                    &mut *addr_of_mut!(CRAFT).cast::<Craft>(),
                    &mut *addr_of_mut!(ENDS).cast::<(CraftEnd, Opener, Sealer)>(),
                    &mut *addr_of_mut!(PARSER).cast::<imu_frame::Parser>(),
                )
            };
            program.step(&mut Any);
            if flag(2) {
                let [random, key, ..] = numbers();
                let end = CraftEnd::new(0, Some(Key::new([key as u8; 32])), [random as u8; 32]);
                *ends = (end, Opener::new(Role::Ground, 0), Sealer::new(Role::Craft, 0));
            }
            over_a_network(craft, ends);
            line().into_iter().for_each(|byte| say(u8::from(parser.push(byte).is_some())));
            say(u8::from(image::decode(&line()).is_ok()));
        }
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        unsafe extern "C" {
            fn a_panic_can_be_reached_in_flight() -> !;
        }
        // SAFETY: as above.
        unsafe { a_panic_can_be_reached_in_flight() }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("mcu-no-panic is linked for a bare Cortex-M4F by cargo xtask arm, and never run");
}
