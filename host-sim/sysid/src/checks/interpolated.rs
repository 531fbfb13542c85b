//! Columns that were brought to the log's rate by straight lines: half of their samples or more say nothing.
//!
//! On a straight line between two samples of the source the second difference is zero; it is not where a line ends. With m
//! samples of the log to n of the source, the zeros therefore come back every m samples. In pieces short enough for two clocks
//! not to drift apart, each of the m places is always zero or (hardly) ever: noise, which is zero nowhere, and coarse
//! steps of a sensor, which are zero anywhere, show no such order. Two samples to one have no zero unless they fall on the
//! source's own; but then a corner shows in two neighbouring second differences in a fixed proportion.
//!
//! A value that is held is no straight line: held commands are what the motors were told. Splines leave no zeros, and are not
//! found by this.

use flights::{COLUMNS, Column, Flight, median_step};
use report::number::fixed;

/// Samples of a piece: long against the pattern of up to ten, short against the drift of a clock.
const PIECE: usize = 80;
/// Longest pattern, samples.
const LONGEST: usize = 10;
/// A second difference below this part of the large ones in its piece is zero: of noise one in forty is.
const ZERO: f64 = 0.02;
const LARGE: f64 = 0.95;
/// A place is always zero from this part of its samples on, and never up to that.
const ALWAYS: f64 = 0.9;
const NEVER: f64 = 0.35;
/// Part of the places that is always zero: two in five of 40 Hz in 100 Hz are the fewest that occur.
const LEAST_ZEROS: f64 = 0.2;
/// Correlation of second differences by pairs on two lines, and at most of the same paired otherwise: those of noise have
/// -2/3 both ways, and those of a smooth curve without noise nearly 1 both ways.
const IN_PROPORTION: f64 = 0.995;
const NOT_IN_PROPORTION: f64 = 0.95;
/// Part of the pieces that must show it. Real logs at their own rate show it in one of ten at most, by chance.
const MOST_PIECES: f64 = 0.5;
const LEAST_PIECES: usize = 3;
/// Steps of time that differ by more than this part: interpolation to them would leave no order.
const EVEN: f64 = 0.02;

/// Columns that a logger writes together.
const GROUPS: [&[Column]; 7] = [
    &[Column::X, Column::Y, Column::Z],
    &[Column::Phi, Column::Theta, Column::Psi],
    &[Column::P, Column::Q, Column::R],
    &[Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4],
    &[Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4],
    &[Column::Ax, Column::Ay, Column::Az],
    &[Column::Vx, Column::Vy, Column::Vz],
];

/// Columns that were interpolated from one rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Interpolated {
    /// The columns.
    pub columns: Vec<Column>,
    /// Rate of the source, 1/s.
    pub from_hz: f64,
    /// Rate of the log, 1/s.
    pub to_hz: f64,
}

impl Interpolated {
    /// For people.
    pub fn sentence(&self) -> String {
        let columns: Vec<&str> = self.columns.iter().map(|c| COLUMNS[*c as usize]).collect();
        let [from, to] = [self.from_hz, self.to_hz].map(|hz| fixed(hz, 0));
        format!(
            "{} look linearly interpolated from {from} to {to} Hz: the samples in between add no information, and interpolated \
             commands act early, so input-delay is not tested for; log at {to} Hz, or resample the flight \
             to {from} Hz with commands held",
            columns.join(", ")
        )
    }
}

/// The interpolated columns of a flight, those of one kind together.
pub fn check(flight: &Flight) -> Vec<Interpolated> {
    let t = flight.required(Column::T);
    let step_s = median_step(t);
    let mut found: Vec<Interpolated> = Vec::new();
    for group in GROUPS {
        let factors: Vec<(Column, f64)> = group
            .iter()
            .filter_map(|&column| Some((column, factor(t, step_s, flight.column(column)?)?)))
            .collect();
        // One of a group alone is a coincidence.
        if factors.len() < 2 {
            continue;
        }
        let factor = factors.iter().map(|(_, factor)| factor).sum::<f64>() / factors.len() as f64;
        let columns = factors.iter().map(|(column, _)| *column);
        let from_hz = 1.0 / (factor * step_s);
        match found.iter_mut().find(|other| (other.from_hz / from_hz - 1.0).abs() < EVEN) {
            Some(same) => same.columns.extend(columns),
            None => found.push(Interpolated { columns: columns.collect(), from_hz, to_hz: 1.0 / step_s }),
        }
    }
    found
}

/// Samples of the log to one of the source; nothing of a column that was not interpolated.
fn factor(t: &[f64], step_s: f64, values: &[f64]) -> Option<f64> {
    let mut judged = 0;
    let mut factors: Vec<f64> = Vec::new();
    for (values, times) in values.chunks_exact(PIECE).zip(t.chunks_exact(PIECE)) {
        let is_even = times.windows(2).all(|w| ((w[1] - w[0]) / step_s - 1.0).abs() < EVEN);
        if !is_even || values.iter().any(|value| !value.is_finite()) {
            continue;
        }
        let Some(piece) = Piece::of(values) else { continue };
        judged += 1;
        factors.extend(piece.factor());
    }
    let shown = factors.len() >= LEAST_PIECES && factors.len() as f64 >= MOST_PIECES * judged as f64;
    shown.then(|| crate::statistics::median(&mut factors)).flatten()
}

/// A piece of a column.
struct Piece {
    second_difference: Vec<f64>,
    zero: Vec<bool>,
}

impl Piece {
    /// Nothing where nothing happens.
    fn of(values: &[f64]) -> Option<Self> {
        let second_difference: Vec<f64> = values.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
        let mut sizes: Vec<f64> = second_difference.iter().map(|d| d.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let large = sizes[(LARGE * sizes.len() as f64) as usize];
        let zero: Vec<bool> = second_difference.iter().map(|d| d.abs() < ZERO * large).collect();
        let moving =
            values.windows(3).zip(&zero).filter(|(w, zero)| **zero && (w[0] != w[1] || w[1] != w[2]));
        let zeros = zero.iter().filter(|zero| **zero).count();
        // Values that stay are held, not drawn.
        (large > 0.0 && 2 * moving.count() >= zeros).then_some(Self { second_difference, zero })
    }

    fn factor(&self) -> Option<f64> {
        (2..=LONGEST)
            .find_map(|length| self.factor_of_pattern(length))
            .or_else(|| self.is_paired().then_some(2.0))
    }

    /// Samples to one of the source, if zeros come back after so many.
    fn factor_of_pattern(&self, length: usize) -> Option<f64> {
        let share = |place: usize| {
            let here = self.zero.iter().skip(place).step_by(length);
            here.clone().filter(|zero| **zero).count() as f64 / here.count() as f64
        };
        let shares: Vec<f64> = (0..length).map(share).collect();
        let always: Vec<bool> = shares.iter().map(|share| *share > ALWAYS).collect();
        let zeros = always.iter().filter(|always| **always).count();
        let is_order = shares.iter().all(|share| *share > ALWAYS || *share < NEVER);
        if !is_order || zeros == length || (zeros as f64) < f64::max(1.0, LEAST_ZEROS * length as f64) {
            return None;
        }
        // From a zero on: a corner between two samples shows in two second differences, one on a sample in one.
        let first = always.iter().position(|always| *always)?;
        let (mut corners, mut run) = (0, 0_usize);
        for place in 0..=length {
            if always[(first + place) % length] {
                corners += run.div_ceil(2);
                run = 0;
            } else {
                run += 1;
            }
        }
        Some(length as f64 / corners as f64)
    }

    /// Whether second differences are in a fixed proportion to the next by pairs, one way of pairing them and not the other.
    fn is_paired(&self) -> bool {
        let [one, other] = [0, 1].map(|start| {
            let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
            for pair in self.second_difference[start..].chunks_exact(2) {
                ab += pair[0] * pair[1];
                aa += pair[0] * pair[0];
                bb += pair[1] * pair[1];
            }
            f64::abs(ab) / f64::sqrt(aa * bb)
        });
        one.max(other) > IN_PROPORTION && one.min(other) < NOT_IN_PROPORTION
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// Rates of a flight with noise at 100 Hz.
    fn noisy() -> Flight {
        let mut rng = Pcg64Mcg::seed_from_u64(2);
        let mut flight = fly(&truth(), 1, 12.0, &NONE);
        for column in
            [Column::P, Column::Q, Column::R, Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4]
        {
            let size = if (column as usize) < Column::Cmd1 as usize { 0.01 } else { 2.0 };
            let values = flight.required(column).iter().map(|v| v + size * rng.random_range(-1.0..1.0));
            let values = values.collect();
            flight.replace(column, values);
        }
        flight
    }

    /// A column seen at other times and drawn back to the log's by straight lines.
    fn drawn(flight: &mut Flight, columns: &[Column], rate_hz: f64, late_s: f64) {
        let at = |values: &[f64], place: f64| {
            let place = place.clamp(0.0, values.len() as f64 - 1.001);
            let (k, part) = (place as usize, place.fract());
            values[k] + part * (values[k + 1] - values[k])
        };
        for &column in columns {
            let values = flight.required(column).to_vec();
            let source: Vec<f64> =
                (0..2000).map(|k| at(&values, 100.0 * (f64::from(k) / rate_hz + late_s))).collect();
            let back = |k: usize| (1e5 * at(&source, (0.01 * k as f64 - late_s) * rate_hz)).round() / 1e5;
            flight.replace(column, (0..values.len()).map(back).collect());
        }
    }

    const RATES: [Column; 3] = [Column::P, Column::Q, Column::R];

    #[test]
    fn a_log_at_its_own_rate_shows_no_lines() {
        assert_eq!(check(&noisy()), []);
        assert_eq!(check(&fly(&truth(), 1, 12.0, &NONE)), []);
    }

    #[test]
    fn rates_drawn_from_a_lower_rate_are_named_with_it() {
        for rate_hz in [20.0, 25.0, 30.0, 40.0, 50.0] {
            for late_s in [0.0, 0.0033] {
                let mut flight = noisy();
                drawn(&mut flight, &RATES, rate_hz, late_s);
                let found = check(&flight);
                assert_eq!(found.len(), 1, "{rate_hz} Hz, {late_s} s: {found:?}");
                assert_eq!(found[0].columns, RATES);
                assert!((found[0].from_hz / rate_hz - 1.0).abs() < 0.01, "{rate_hz} Hz: {found:?}");
                assert!((found[0].to_hz - 100.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn groups_of_one_rate_are_named_together() {
        let mut flight = noisy();
        let commands = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];
        drawn(&mut flight, &RATES, 50.0, 0.002);
        drawn(&mut flight, &commands, 50.0, 0.002);
        let found = check(&flight);
        assert_eq!(found.len(), 1);
        let said = found[0].sentence();
        let start =
            "p, q, r, cmd1, cmd2, cmd3, cmd4 look linearly interpolated from 50 to 100 Hz: the samples";
        assert!(said.starts_with(start), "{said}");
    }

    #[test]
    fn held_and_coarsely_rounded_values_are_not_drawn() {
        let mut flight = noisy();
        for column in RATES {
            let values = flight.required(column).to_vec();
            flight.replace(column, (0..values.len()).map(|k| values[k - k % 4]).collect());
        }
        for column in [Column::X, Column::Y, Column::Z] {
            let values = flight.required(column).iter().map(|v| (1000.0 * v).round() / 1000.0).collect();
            flight.replace(column, values);
        }
        assert_eq!(check(&flight), []);
    }
}
