//! Linked, never run: it links only if no panic can be reached from a tick of a craft, or from what it says afterwards.
//!
//! The panic handler calls a function that nobody defines. As long as anything that may panic is left after optimisation, the
//! linker asks for it by name.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[allow(unsafe_code, reason = "a craft out of nowhere, and a function that must not exist")]
mod target {
    use core::mem::MaybeUninit;
    use core::ptr::{addr_of, addr_of_mut, read_volatile, write_volatile};

    use craft::{Craft, Inputs, Link};
    // For the handlers of the board that the link script asks for.
    use mcu as _;

    static mut CRAFT: MaybeUninit<Craft> = MaybeUninit::uninit();
    static mut INPUTS: MaybeUninit<Inputs> = MaybeUninit::uninit();
    static mut SAID: bool = false;

    #[cortex_m_rt::entry]
    fn main() -> ! {
        loop {
            // SAFETY: none is needed: this is compiled for what the linker makes of it, and never runs.
            unsafe {
                let craft = &mut *addr_of_mut!(CRAFT).cast::<Craft>();
                let inputs = read_volatile(addr_of!(INPUTS).cast::<Inputs>());
                let flight = craft.tick(&inputs);
                write_volatile(addr_of_mut!(SAID), flight.tick.pwm != [0.0; 4]);
                while let Some(message) = craft.next_message(&Link::default()) {
                    write_volatile(addr_of_mut!(SAID), matches!(message, proto::Message::Telemetry(_)));
                }
            }
        }
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        unsafe extern "C" {
            fn a_panic_can_be_reached_from_a_tick() -> !;
        }
        // SAFETY: as above.
        unsafe { a_panic_can_be_reached_from_a_tick() }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("mcu-no-panic is linked for a bare Cortex-M4F by cargo xtask arm, and never run");
}
