//! An autopilot in the emulated chip that a simulator ticks over the serial port, in stuffed
//! frames: readings in, outcomes out. It never drives a motor.
//!
//! Its gains are those at `mps2::IMAGE` if there is an image, else those built in. If there is a
//! recording at `mps2::RECORDING`, the digests of its ticks come out first.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", not(feature = "stm32f405")))]
mod target {
    use craft::Lockstep;
    use craft::image::decode;
    use embedded_io::{Read, Write};
    use mcu::{Board, GAINS_IMAGE, mps2};
    use proto::{Deframer, MAX_FRAME_LEN, MAX_STREAM_LEN, enframe};

    #[cortex_m_rt::entry]
    fn main() -> ! {
        let Ok((config, _)) = decode(mps2::image()).or_else(|_| decode(GAINS_IMAGE)) else { mps2::fail() };
        let Ok(mut lockstep) = Lockstep::new(&config) else { mps2::fail() };
        let mut board = mps2::boot(&config);
        let (mut deframer, mut answer) = (Deframer::new(), [0; MAX_FRAME_LEN]);
        let (mut bytes, mut stream) = ([0; 64], [0; MAX_STREAM_LEN]);
        lockstep.replay(mps2::recording(), |digest| {
            if let Some(bytes) = enframe(&digest.to_le_bytes(), &mut stream) {
                let _ = board.link().write(bytes);
            }
        });
        loop {
            let count = board.link().read(&mut bytes).unwrap_or(0);
            for byte in bytes.iter().take(count) {
                let Some(frame) = deframer.push(*byte) else { continue };
                let answer = lockstep.answer_frame(frame, &mut answer);
                if let Some(bytes) = answer.and_then(|answer| enframe(answer, &mut stream)) {
                    let _ = board.link().write(bytes);
                }
            }
            if count == 0 {
                board.wait();
            }
        }
    }

    #[panic_handler]
    fn panic(_: &core::panic::PanicInfo) -> ! {
        mps2::fail()
    }
}

#[cfg(all(target_os = "none", feature = "stm32f405"))]
compile_error!("mcu-lockstep is for QEMU: build it without the feature stm32f405");

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "mcu-lockstep is a program for the emulated Cortex-M4F: cargo xtask sil --on cortex-m4 runs it"
    );
}
