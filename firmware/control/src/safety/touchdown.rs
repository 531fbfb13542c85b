//! Touchdown: does a landing craft stand on something?
//!
//! The landing's command sinks on, to below the floor if need be. In the air the craft follows; on
//! the floor, or on a table, it cannot, and the altitude loop takes thrust away. So a craft whose
//! motors carry clearly less than it weighs, and which does not sink for a while, stands. (In the
//! air it would fall: half the thrust is 1.5 m/s after 0.3 s.) What its motors have to do to carry
//! it is what they did on average in the flight before.

use crate::safety::limits::TouchdownLimits;
use crate::safety::timers::Held;

/// What is known of a touchdown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Touchdown {
    /// Mean motor command that carries the craft, command units.
    carrying: f32,
    near: Held,
    anywhere: Held,
    /// The craft stands.
    pub(crate) found: bool,
}

/// Mean of four motor commands.
#[inline]
fn mean([a, b, c, d]: [f32; 4]) -> f32 {
    0.25 * ((a + b) + (c + d))
}

impl Touchdown {
    pub(crate) fn new(limits: &TouchdownLimits) -> Self {
        Self { carrying: limits.idle, near: Held::default(), anywhere: Held::default(), found: false }
    }

    /// A tick that is no landing: learns what carries the craft.
    #[inline]
    pub(crate) fn fly(&mut self, pwm: [f32; 4], limits: &TouchdownLimits) {
        self.carrying += limits.smoothing * (mean(pwm) - self.carrying);
    }

    /// A landing begins.
    pub(crate) fn begin(&mut self) {
        (self.near, self.anywhere, self.found) = (Held::default(), Held::default(), false);
    }

    /// A tick of a landing: motor commands, inertial z in m and its rate in m/s, and whether these
    /// two are known.
    #[cold]
    pub(crate) fn land(
        &mut self,
        pwm: [f32; 4],
        [z_m, z_rate_m_s]: [f32; 2],
        known: bool,
        elapsed_us: u32,
        limits: &TouchdownLimits,
    ) {
        let little = mean(pwm) - limits.idle < limits.fraction * (self.carrying - limits.idle);
        let stands = known && little && z_rate_m_s.abs() < limits.still_m_s;
        let near = self.near.step(stands && z_m >= limits.floor_m, elapsed_us, limits.near_us);
        self.found = self.anywhere.step(stands, elapsed_us, limits.anywhere_us) || near;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;
    use crate::safety::limits::Limits;

    /// After how many ticks a craft that hovered at 1700 us is found to stand.
    fn ticks(command: f32, z_m: f32, z_rate_m_s: f32, known: bool) -> Option<usize> {
        let limits = Limits::new(&Config::thesis()).touchdown;
        let mut touchdown = Touchdown::new(&limits);
        (0..1000).for_each(|_| touchdown.fly([1650.0, 1750.0, 1650.0, 1750.0], &limits));
        touchdown.begin();
        (1..200).find(|_| {
            touchdown.land([command; 4], [z_m, z_rate_m_s], known, 10_000, &limits);
            touchdown.found
        })
    }

    /// 70 % of 700 us above idle is 1490 us; the floor is at 0, and 0.3 m/s is the descent.
    #[test]
    fn a_craft_stands_that_is_not_carried_and_does_not_sink() {
        assert_eq!(ticks(1450.0, -0.05, 0.0, true), Some(30));
        assert_eq!(ticks(1450.0, -0.7, 0.0, true), Some(90), "on a table");
        assert_eq!(ticks(1530.0, -0.05, 0.0, true), None, "carried");
        assert_eq!(ticks(1450.0, -0.05, 0.2, true), None, "sinks");
        assert_eq!(ticks(1450.0, -0.05, -0.2, true), None, "rises: it was thrown");
        assert_eq!(ticks(1450.0, -0.05, f32::NAN, true), None);
        assert_eq!(ticks(1450.0, -0.05, 0.0, false), None, "nobody knows");
    }

    /// By hand: of 700 us above idle, 1 - exp(-0.01) in the first tick of 10 ms.
    #[test]
    fn what_carries_the_craft_is_smoothed_over_a_second() {
        let limits = Limits::new(&Config::thesis()).touchdown;
        let mut touchdown = Touchdown::new(&limits);
        touchdown.fly([1600.0, 1800.0, 1650.0, 1750.0], &limits);
        assert!((touchdown.carrying - 1006.965).abs() < 1e-3, "{}", touchdown.carrying);
    }

    /// 70 % of 1000 us, and half the speed of descent: neither is less than itself.
    #[test]
    fn at_the_limits_a_craft_is_carried_and_sinks() {
        let limits = Limits::new(&Config::thesis()).touchdown;
        let stands = |command: f32, sink_m_s: f32| {
            let mut touchdown = Touchdown { carrying: 2000.0, ..Touchdown::new(&limits) };
            for _ in 0..100 {
                touchdown.land([command; 4], [-0.05, sink_m_s], true, 10_000, &limits);
            }
            touchdown.found
        };
        assert!(!stands(1700.0, 0.0) && stands(1699.9, 0.0));
        assert!(!stands(1200.0, limits.still_m_s) && stands(1200.0, limits.still_m_s.next_down()));
    }

    /// As after a landing that was broken off in its last moment, or that a disarm request has ended.
    #[test]
    fn each_landing_begins_anew() {
        let limits = Limits::new(&Config::thesis()).touchdown;
        let mut touchdown = Touchdown { carrying: 1700.0, ..Touchdown::new(&limits) };
        for z_m in [-0.05, -0.7] {
            let needed = if z_m > -0.1 { 30 } else { 90 };
            for landing in 0..3 {
                touchdown.begin();
                assert!(!touchdown.found);
                for tick in 1..=needed {
                    touchdown.land([1200.0; 4], [z_m, 0.0], true, 10_000, &limits);
                    assert_eq!(touchdown.found, tick == needed, "{landing}: {tick} at {z_m} m");
                }
            }
        }
    }

    #[test]
    fn one_tick_of_motion_begins_anew() {
        let limits = Limits::new(&Config::thesis()).touchdown;
        let mut touchdown = Touchdown { carrying: 1700.0, ..Touchdown::new(&limits) };
        for k in 0..100 {
            let sinks = if k % 25 == 0 { 0.3 } else { 0.0 };
            touchdown.land([1200.0; 4], [-0.05, sinks], true, 10_000, &limits);
            assert!(!touchdown.found);
        }
    }
}
