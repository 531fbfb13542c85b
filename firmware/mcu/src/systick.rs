//! The control period and the time, both from the core's own timer.
//!
//! The timer counts down one period and interrupts at its end; the interrupt ends the main loop's
//! sleep.

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::exception;

use crate::clock::time_us;

/// Periods since the start.
static PERIODS: AtomicU32 = AtomicU32::new(0);

/// The running timer.
#[derive(Debug, Clone, Copy)]
pub struct Systick {
    period_us: u32,
    counts_per_us: u32,
}

impl Systick {
    /// Starts periods of `period_s`, of a clock with so many counts a microsecond. 24 bits of
    /// counts: at 25 MHz, 0.67 s.
    pub fn start(timer: &mut SYST, source: SystClkSource, counts_per_us: u32, period_s: f64) -> Self {
        let period_us = (period_s * 1e6 + 0.5) as u32;
        timer.set_clock_source(source);
        timer.set_reload((period_us * counts_per_us).saturating_sub(1));
        timer.clear_current();
        timer.enable_counter();
        timer.enable_interrupt();
        Self { period_us, counts_per_us }
    }

    /// Time since the start in us, modulo 2^32.
    pub fn now_us(self) -> u32 {
        loop {
            let before = PERIODS.load(Ordering::Relaxed);
            let left_us = SYST::get_current() / self.counts_per_us;
            // An interrupt in between: the two do not belong together.
            if PERIODS.load(Ordering::Relaxed) == before {
                return time_us(before, left_us, self.period_us);
            }
        }
    }
}

#[exception]
fn SysTick() {
    PERIODS.fetch_add(1, Ordering::Relaxed);
}
