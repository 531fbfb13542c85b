//! What a crash is, for long runs: the motors off in the air, the floor hit, the cage left.

use control::{Condition, Conditions};
use proto::State;

use crate::flight::CAGE_M;

/// A landing touches the floor at 0.3 m/s, a fast one at 0.6 m/s; what comes down faster has fallen,
/// m/s.
const HARD_M_S: f64 = 1.0;
/// Higher than this it does not stand on the floor, m.
const STANDS_M: f64 = 0.05;

/// How a craft came down that should not have.
#[derive(Debug, Clone, PartialEq)]
pub enum Crash {
    /// The supervisor stopped the motors, having found this.
    Cut(Vec<Condition>),
    /// It disarmed in the air, at this height, m.
    DisarmedAt(f64),
    /// It hit the floor at this speed, m/s.
    Floor(f64),
    /// It left the cage, here, inertial NED, m.
    Cage([f64; 3]),
    /// It is nowhere any more, or turns at an impossible rate.
    Lost,
}

/// Watches a craft for a crash, tick by tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct Watch {
    period_s: f64,
    /// Height of the two ticks before, m, the newer first.
    before_m: [f64; 2],
    state: State,
    /// How far off the tracker may see it, m.
    tracker_off_m: [f64; 3],
    /// Whether there are walls.
    caged: bool,
}

impl Watch {
    /// Of a craft at this height in m, in this state.
    pub(super) fn new(period_s: f64, height_m: f64, state: State) -> Self {
        Self { period_s, before_m: [height_m; 2], state, tracker_off_m: [0.0; 3], caged: true }
    }

    /// Whose tracker may see it so far off, m. Where it is in the cage as seen it has not left it: nobody
    /// on board can know better.
    pub(super) fn with_tracker_off(self, tracker_off_m: [f64; 3]) -> Self {
        Self { tracker_off_m, ..self }
    }

    /// In the open, unless there are walls.
    pub(super) fn with_walls(self, caged: bool) -> Self {
        Self { caged, ..self }
    }

    /// A tick: where the craft is (inertial NED, m), what it is doing, and why.
    #[inline]
    pub(super) fn look(&mut self, position_m: [f64; 3], state: State, conditions: u32) -> Option<Crash> {
        let height_m = -position_m[2];
        let [newer_m, older_m] = self.before_m;
        self.before_m = [height_m, newer_m];
        let stood_down = self.state != State::Disarmed && state == State::Disarmed;
        self.state = state;
        // The floor stops it within the tick, so its speed is that of the tick before.
        let sinks_m_s = (older_m - newer_m) / self.period_s;
        let seen_m = [0, 1, 2].map(|axis| position_m[axis] + self.tracker_off_m[axis]);
        if !position_m.iter().all(|m| m.is_finite()) {
            Some(Crash::Lost)
        } else if state == State::Cut {
            Some(Crash::Cut(Conditions::from_bits(conditions).iter().collect()))
        } else if stood_down && height_m > STANDS_M {
            Some(Crash::DisarmedAt(height_m))
        } else if height_m <= 0.0 && newer_m > 0.0 && sinks_m_s > HARD_M_S {
            Some(Crash::Floor(sinks_m_s))
        } else if self.caged && is_outside(position_m) && is_outside(seen_m) {
            Some(Crash::Cage(position_m))
        } else {
            None
        }
    }
}

/// Whether a place is beyond the walls or the ceiling.
fn is_outside([x, y, z]: [f64; 3]) -> bool {
    let [wall_x, wall_y, ceiling] = CAGE_M;
    x.abs() > wall_x || y.abs() > wall_y || -z > ceiling
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(ticks: &[([f64; 3], State)]) -> Option<Crash> {
        let mut watch = Watch::new(0.01, 1.0, State::Flying);
        ticks.iter().find_map(|(position_m, state)| watch.look(*position_m, *state, Condition::Tilted.bit()))
    }

    #[test]
    fn each_kind_of_crash_is_told_from_a_landing() {
        let at = |height_m: f64| [0.0, 0.0, -height_m];
        // 0.6 m/s, the fast descent.
        let landing = [
            (at(0.010), State::Land),
            (at(0.004), State::Land),
            (at(0.0), State::Land),
            (at(0.0), State::Disarmed),
        ];
        assert_eq!(seen(&landing), None);
        let fall = [(at(0.04), State::Land), (at(0.02), State::Land), (at(0.0), State::Land)];
        assert!(matches!(seen(&fall), Some(Crash::Floor(v)) if (v - 2.0).abs() < 1e-9));
        assert_eq!(seen(&[(at(1.0), State::Cut)]), Some(Crash::Cut(vec![Condition::Tilted])));
        assert_eq!(seen(&[(at(0.3), State::Disarmed)]), Some(Crash::DisarmedAt(0.3)));
        assert_eq!(seen(&[([0.0, 2.7, -1.0], State::Flying)]), Some(Crash::Cage([0.0, 2.7, -1.0])));
        let mut shifted = Watch::new(0.01, 1.0, State::Flying).with_tracker_off([0.0, -0.2, 0.0]);
        assert_eq!(shifted.look([0.0, 2.7, -1.0], State::Flying, 0), None, "it sees itself inside");
        assert!(matches!(shifted.look([0.0, 2.9, -1.0], State::Flying, 0), Some(Crash::Cage(_))));
        assert!(matches!(shifted.look([0.0, -2.7, -1.0], State::Flying, 0), Some(Crash::Cage(_))));
        assert_eq!(seen(&[([0.0, f64::NAN, -1.0], State::Flying)]), Some(Crash::Lost));
    }
}
