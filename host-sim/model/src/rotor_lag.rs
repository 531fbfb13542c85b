//! A rotor's way to the speed it is commanded to: the first-order lag `lag / (s + lag)`, exactly
//! for a command that is held.

/// First-order lag of a rotor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotorLag {
    rad_s: f64,
}

impl RotorLag {
    /// A lag of a bandwidth in rad/s, the inverse of its time constant.
    pub const fn new(rad_s: f64) -> Self {
        Self { rad_s }
    }

    /// Part of the distance to a held command that is left after a time.
    #[inline]
    pub fn decay(self, time_s: f64) -> f64 {
        (-self.rad_s * time_s).exp()
    }

    /// Where a signal that was at `start` is under a held command after a time.
    #[inline]
    pub fn response(self, start: f64, commanded: f64, time_s: f64) -> f64 {
        decayed(start, commanded, self.decay(time_s))
    }
}

/// Where a signal is of whose distance to a held command, at `start`, the part `decay` is left.
#[inline(always)]
pub fn decayed(start: f64, commanded: f64, decay: f64) -> f64 {
    commanded + (start - commanded) * decay
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn after_a_time_constant_one_part_in_e_of_the_step_is_left() {
        let lag = RotorLag::new(21.5);
        let left = 700.0 - lag.response(600.0, 700.0, 1.0 / 21.5);
        assert!((left - 100.0 / std::f64::consts::E).abs() < 1e-12, "{left}");
    }

    /// What the lag reaches at once it reaches by way of any moment in between: it has no memory
    /// but its speed.
    #[test]
    fn two_parts_of_a_time_lead_where_the_whole_leads() {
        let lag = RotorLag::new(21.5);
        let whole = lag.response(500.0, 640.0, 0.037);
        let half_way = lag.response(500.0, 640.0, 0.012);
        // Some roundings of numbers of 640.
        assert!((lag.response(half_way, 640.0, 0.025) - whole).abs() < 1e-11);
    }

    #[test]
    fn the_rotor_turns_towards_the_command_with_the_lags_slope_at_first() {
        let lag = RotorLag::new(21.5);
        let time_s = 1e-6;
        let slope = (lag.response(500.0, 640.0, time_s) - 500.0) / time_s;
        // The slope falls by lag * time within the time.
        assert!((slope / (21.5 * 140.0) - 1.0).abs() < 2.0 * 21.5 * time_s, "{slope}");
    }
}
