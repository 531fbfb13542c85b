//! What belongs to one flight and not to the craft, and is taken out of it: the clock of its rotor samples, and constants.

use report::number::{fixed, with_error};
use schemars::JsonSchema;
use serde::Serialize;

/// The clock of a flight's rotor samples against that of its state.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Alignment {
    /// How late rotor samples (measured speeds or commands) come, s; early if negative. Of commands: later than in the
    /// other flights.
    pub late_s: f64,
    /// Standard error of it, coloured residuals accounted for, s.
    pub std_error_s: f64,
    /// Whether the flight is corrected for it.
    pub corrected: bool,
    /// Offsets of pieces of the flight, where they differ by more than their errors: the clock wanders.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub wandering: Vec<PieceOffset>,
}

/// The offset of a piece of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct PieceOffset {
    /// Middle of the piece, s.
    pub time_s: f64,
    /// How late rotor samples come there, s.
    pub late_s: f64,
    /// Standard error, s.
    pub std_error_s: f64,
}

impl Alignment {
    /// What is taken out, s.
    pub fn corrected_s(&self) -> f64 {
        if self.corrected { self.late_s } else { 0.0 }
    }

    /// What was found, for people; nothing where there is nothing to say.
    pub fn note(&self) -> Option<String> {
        let milliseconds = |s: f64| format!("{} ms", fixed(1e3 * s, 1));
        if !self.wandering.is_empty() {
            let late = |f: fn(f64, f64) -> f64, start| self.wandering.iter().map(|p| p.late_s).fold(start, f);
            return Some(format!(
                "rotor clock wanders from {} to {} late within the flight",
                milliseconds(late(f64::min, f64::INFINITY)),
                milliseconds(late(f64::max, f64::NEG_INFINITY)),
            ));
        }
        self.corrected.then(|| {
            let way = if self.late_s < 0.0 { "early" } else { "late" };
            format!(
                "rotor samples {} {way}, corrected",
                with_error(1e3 * self.late_s.abs(), 1e3 * self.std_error_s, "ms")
            )
        })
    }
}

/// Constants of a flight beyond the mean of all flights; zero where they do not stand out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Trim {
    /// u v w in m/s^2, p q r in rad/s^2.
    pub value: [f64; 6],
    /// Standard errors of the estimates, those that do not stand out too.
    pub std_error: [f64; 6],
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alignment(late_s: f64, corrected: bool) -> Alignment {
        Alignment { late_s, std_error_s: 0.0004, corrected, wandering: Vec::new() }
    }

    #[test]
    fn only_a_corrected_offset_is_taken_out_and_told() {
        let (kept, taken) = (alignment(0.012, false), alignment(0.012, true));
        assert_eq!((kept.corrected_s(), kept.note()), (0.0, None));
        assert_eq!(taken.corrected_s(), 0.012);
        assert_eq!(taken.note().unwrap(), "rotor samples 12.00 ± 0.40 ms late, corrected");
    }

    #[test]
    fn samples_before_their_time_are_early() {
        let early = alignment(-0.0053, true);
        assert_eq!(early.note().unwrap(), "rotor samples 5.30 ± 0.40 ms early, corrected");
        assert_eq!(early.corrected_s(), -0.0053);
    }

    #[test]
    fn a_wandering_clock_is_told_from_its_smallest_to_its_largest_offset_whether_corrected_or_not() {
        let piece = |late_s| PieceOffset { time_s: 0.0, late_s, std_error_s: 0.001 };
        for corrected in [false, true] {
            let wandering = vec![piece(0.004), piece(-0.0102), piece(0.03)];
            let note = Alignment { wandering, ..alignment(0.01, corrected) }.note();
            assert_eq!(note.unwrap(), "rotor clock wanders from -10.2 ms to 30.0 ms late within the flight");
        }
    }
}
