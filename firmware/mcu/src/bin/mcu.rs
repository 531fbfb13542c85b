//! The program that flies.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod target {
    #[cfg(not(feature = "stm32f405"))]
    use mcu::mps2 as board;
    #[cfg(feature = "stm32f405")]
    use mcu::stm32f405 as board;
    use mcu::{GAINS_IMAGE, LINK_KEY, Program};

    #[cortex_m_rt::entry]
    fn main() -> ! {
        match Program::new(GAINS_IMAGE, LINK_KEY, board::last_end()) {
            Ok(mut program) => {
                let mut board = board::boot(program.config());
                loop {
                    program.step(&mut board);
                }
            }
            // Nothing drives the motors yet, and nothing ever will.
            Err(_) => loop {
                cortex_m::asm::wfi();
            },
        }
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        board::emergency()
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("mcu is a program for a bare Cortex-M4F: cargo xtask arm builds it");
}
