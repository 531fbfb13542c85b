//! Arithmetic of the clock, microseconds modulo 2^32: the time by a timer, and when a tick is due.

/// Time since the start in us, modulo 2^32: so many whole periods, and `left_us` of the running one
/// still to come.
#[cfg(any(target_os = "none", test))]
pub(crate) fn time_us(periods: u32, left_us: u32, period_us: u32) -> u32 {
    let since_us = period_us.saturating_sub(1).saturating_sub(left_us);
    periods.wrapping_mul(period_us).wrapping_add(since_us)
}

/// When ticks are due.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Beats {
    period_us: u32,
    /// None before the first.
    due_us: Option<u32>,
}

impl Beats {
    /// The first is due where the timer's period began in which it is asked for.
    pub(crate) fn new(period_us: u32) -> Self {
        Self { period_us, due_us: None }
    }

    /// If a tick is due, how much later than it should have been, us. Up to half a turn of the clock
    /// before it is due is early. Ticks lie where the timer's periods begin, for that is what ends the
    /// sleep; missed ones are not made up, and the supervisor sees the gap.
    pub(crate) fn late_us(&mut self, now_us: u32) -> Option<u32> {
        let period_us = self.period_us.max(1);
        let due_us = *self.due_us.get_or_insert(now_us - now_us % period_us);
        let late_us = now_us.wrapping_sub(due_us);
        if late_us > u32::MAX / 2 {
            return None;
        }
        let periods = 1 + late_us / period_us;
        self.due_us = Some(due_us.wrapping_add(periods.wrapping_mul(period_us)));
        Some(late_us)
    }
}

/// Every residue of 2^32 with a boundary as the time that is due, as the time between that and now, and
/// as the number of periods: against wide integers that never wrap.
#[cfg(test)]
mod arithmetic {
    use super::*;
    use crate::residues::{TURN, residues};

    /// The least, the thesis', an odd and the greatest period that a configuration may have.
    const PERIODS_US: [u32; 4] = [100, 10_000, 2_001, 100_000];

    #[test]
    fn a_tick_is_due_when_its_time_has_come() {
        for period_us in PERIODS_US {
            let about = |us: u32| [us - 1, us, us + 1];
            let after = || residues().into_iter().chain(about(period_us)).chain(about(2 * period_us));
            for due_us in residues() {
                for passed_us in after() {
                    let mut beats = Beats { period_us, due_us: Some(due_us) };
                    // What shows as more than half a turn late is early by the rest of the turn.
                    let late = i128::from(passed_us);
                    let late = if late < TURN / 2 { late } else { late - TURN };
                    let now = i128::from(due_us) + late;
                    let got = beats.late_us(now.rem_euclid(TURN) as u32);
                    assert_eq!(got.map(i128::from), (late >= 0).then_some(late), "{due_us} {passed_us}");
                    let period = i128::from(period_us);
                    let periods = if late >= 0 { 1 + late / period } else { 0 };
                    let next = i128::from(due_us) + periods * period;
                    assert_eq!(beats.due_us, Some(next.rem_euclid(TURN) as u32), "{due_us} {passed_us}");
                }
            }
        }
    }

    /// Each microsecond of a period, in each period.
    #[test]
    fn time_goes_on_from_period_to_period() {
        for period_us in PERIODS_US {
            for periods in residues() {
                for passed_us in (0..period_us).step_by(7).chain([period_us - 1]) {
                    let want = i128::from(periods) * i128::from(period_us) + i128::from(passed_us);
                    let left_us = period_us - 1 - passed_us;
                    assert_eq!(i128::from(time_us(periods, left_us, period_us)), want % TURN);
                }
            }
        }
        assert_eq!(time_us(3, 10_000, 10_000), 30_000, "a timer that has not begun to count down");
    }
}
