//! Clocks: do the tracker and the sensors on board tell the same time?
//!
//! A log joins streams that were stamped by different clocks: a motion capture system with network and processing delay,
//! and the sensors and commands of the craft. An offset of 20 ms at 5 rad/s is an error of 6 degrees, and a timer that runs
//! one per cent slow makes every rate one per cent wrong; a regression answers both with wrong coefficients and
//! effects that are not there.
//!
//! **Without a model.** What the gyro says is what the tracked attitude does, and what the IMU says (turned by the
//! attitude, with gravity) is what the tracked position does:
//!
//! ```text
//! gyro(t)                    = rate of the attitude (t + offset + skew (t - middle)) + bias
//! attitude(t)^T imu(t) + g   = second derivative of the position (t + offset + skew (t - middle)) + bias
//! ```
//!
//! Both sides go through filters of equal response. The best lag of each block of two seconds gives a start, Gauss
//! and Newton's steps the estimate, and the regression's own standard errors (which hold for coloured residuals) what it is
//! worth. A positive offset says that the tracker's rows come late: they show the motion that the board had stamped
//! earlier.
//!
//! **What is done about it.** [`align`] keeps the rows of the board, so commands stay as they were sent, and reads the
//! tracker's columns at the moments of these rows. Of two clocks that differ in pace the tracker's is believed, a computer's
//! and not that of a craft's crystal, unless gravity says otherwise: a wrong pace scales the tracked accelerations,
//! but not the 9.81 m/s^2 by which a tilted thrust pulls to the side. An offset between the gyro and an attitude that a filter on board made from it is
//! zero and stays so. The delay between commands and motion is another matter: it is in the rotors, not in the clocks.
//!
//! Deliberately absent: a tracker's clock that wanders within a flight. One offset and one skew are estimated; more would
//! fit noise. Commands that wander against the motion are named in [`crate::checks::command_clock`].

use std::ops::ControlFlow;

use report::number::with_error;
use schemars::JsonSchema;
use serde::Serialize;

use crate::checks::tracks::{self, Axes, Lags, Pair};
use crate::filter::{RegressionFilter, compose, sum_of_products};
use crate::fit::gauss_newton::{self, Linearised, Problem, Rule};
use crate::fit::least_squares::{self, FlightRows, Solution, Unidentifiable};
use crate::fit::low_frequency::{Estimate, at_low_frequency, unless_contradicted};
use crate::prepare::Prepared;
use flights::{Column, Flight};

/// An offset that is worth a correction, s: a third of a sample at 100 Hz.
pub const MATTERS_S: f64 = 0.003;
/// A skew that is worth a correction: 10 ms between start and end of a flight of 20 s.
pub const MATTERS_SKEW: f64 = 5e-4;
/// The same for a position against an IMU, whose low-pass filter alone is 5 to 10 ms late, s.
pub const MATTERS_AGAINST_IMU_S: f64 = 0.012;
/// The same for the skew: a filter's delay looks a little like one.
pub const MATTERS_AGAINST_IMU_SKEW: f64 = 2e-3;
/// Standard errors by which an estimate has to stand out.
const SIGNIFICANT: f64 = 4.0;
/// Less alike than this, the streams tell nothing about each other.
const ALIKE: f64 = 0.6;
const MOST_STEPS: usize = 8;

/// What is known of one clock against another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Clock {
    /// How late the tracker's rows are against the board's at the middle of the flight, s.
    pub offset_s: f64,
    /// Of `offset_s`, s.
    pub offset_std_error_s: f64,
    /// By which part the tracker's stamps run ahead of the board's: 0.01 says that the board's clock is 1 % slow.
    pub skew: f64,
    /// Of `skew`.
    pub skew_std_error: f64,
    /// Whether offset or skew stand out from their error and are large enough to matter.
    pub matters: bool,
    /// Time at which `offset_s` holds, s.
    #[serde(skip)]
    pub middle_s: f64,
    /// Least offset, s, and skew that matter.
    #[serde(skip)]
    pub least: [f64; 2],
}

impl Clock {
    /// How much later the tracker stamps what the board stamps at `t`, s.
    pub fn shift_s(&self, t: f64) -> f64 {
        self.offset_s + self.skew * (t - self.middle_s)
    }

    fn estimate(&self) -> Estimate {
        Estimate { value: self.offset_s, variance: self.offset_std_error_s.powi(2) }
    }

    /// Whether the skew stands out from its error.
    pub fn is_skewed(&self) -> bool {
        self.skew.abs() > self.least[1].max(SIGNIFICANT * self.skew_std_error)
    }

    fn judged(mut self) -> Self {
        let late = self.offset_s.abs() > self.least[0].max(SIGNIFICANT * self.offset_std_error_s);
        self.matters = late || self.is_skewed();
        self
    }

    /// For people: "x, y, z are 31.20 ± 0.40 ms late relative to the IMU, and the clock on board runs 1.1800 ± 0.0020 % slow".
    pub fn sentence(&self, tracked: &str, onboard: &str, board_keeps_time: bool) -> String {
        let order = if self.offset_s > 0.0 { "late" } else { "early" };
        let mut text = format!(
            "{tracked} are {} {order} relative to {onboard}",
            with_error(1e3 * self.offset_s.abs(), 1e3 * self.offset_std_error_s, "ms")
        );
        if self.is_skewed() {
            let pace = if (self.skew > 0.0) == board_keeps_time { "fast" } else { "slow" };
            let whose = if board_keeps_time { "the tracker's clock" } else { "the clock on board" };
            text += &format!(
                ", and {whose} runs {} {pace}",
                with_error(100.0 * self.skew.abs(), 100.0 * self.skew_std_error, "%")
            );
        }
        text
    }
}

/// The clocks of a flight; nothing where the flight does not tell.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Clocks {
    /// Tracked attitude against gyro.
    pub attitude: Option<Clock>,
    /// Tracked position against IMU.
    pub position: Option<Clock>,
    /// Whether gravity says that of two paces the board's is right.
    pub board_keeps_time: bool,
    /// Whether the flight was put on one clock.
    pub aligned: bool,
}

impl Clocks {
    /// The attitude's clock of a flight as it was logged. The position's is for when that is mended: the attitude turns the
    /// IMU that judges it ([`of_position`]).
    pub fn of(flight: &Prepared, gravity_m_s2: f64) -> Self {
        let attitude = of_attitude(flight);
        let skew = attitude.filter(|c| c.matters).map_or(0.0, |c| c.skew);
        let board_keeps_time = skew != 0.0 && board_keeps_time(flight, gravity_m_s2, skew);
        Self { attitude, board_keeps_time, ..Self::default() }
    }
}

/// Whether the tracked accelerations are those of a clock that runs ahead by `skew`.
///
/// The thrust of a tilted craft pulls to the side by the tilt times gravity less the vertical acceleration, and by nothing
/// else but a drag along the velocity: the factor between the two is 1 for a tracker that keeps time and
/// `1 / (1 + skew)^2` for one that does not.
fn board_keeps_time(flight: &Prepared, gravity_m_s2: f64, skew: f64) -> bool {
    let filter = RegressionFilter::with_window(flight.period_s, 0.6);
    let second = compose(&filter.derivative, &filter.derivative);
    let first = compose(&filter.derivative, &filter.matched);
    let smooth = compose(&filter.matched, &filter.matched);
    let half = second.len() / 2;
    let stride = ((0.03 / flight.period_s).round() as usize).max(1);
    let mut targets: [Vec<f64>; 6] = Default::default();
    let (mut pull, mut drag): ([Vec<f64>; 2], [Vec<f64>; 2]) = Default::default();
    let mut starts = Vec::new();
    for stretch in flight.stretches.iter().filter(|s| s.time_s.len() > 2 * half) {
        starts.push(targets[0].len());
        let down: [Vec<f64>; 3] =
            std::array::from_fn(|i| stretch.dcm.iter().map(|dcm| dcm[(2, i)]).collect());
        for k in (half..stretch.time_s.len() - half).step_by(stride) {
            let at = |signal: &Vec<f64>, taps: &[f64]| sum_of_products(&signal[k - half..], taps);
            let [x, y, z] = stretch.position_ned_m.each_ref();
            let thrust = (gravity_m_s2 - at(z, &second)) / at(&down[2], &smooth).max(0.2);
            for (i, position) in [x, y].into_iter().enumerate() {
                targets[i].push(at(position, &second));
                pull[i].push(-thrust * at(&down[i], &smooth));
                drag[i].push(-at(position, &first));
            }
        }
    }
    let rows = targets[0].len();
    targets[2..].iter_mut().for_each(|t| *t = vec![0.0; rows]);
    let sideways = |[x, y]: [Vec<f64>; 2]| [Some(x), Some(y), None, None, None, None];
    let ones = || vec![1.0; rows];
    let columns = vec![
        sideways(pull),
        sideways(drag),
        [Some(ones()), None, None, None, None, None],
        [None, Some(ones()), None, None, None, None],
    ];
    let rows = FlightRows { targets, columns, starts, period_s: stride as f64 * flight.period_s };
    let Ok(solution) = least_squares::solve(&[rows], &[None; 4]) else { return false };
    let (factor, error) = (solution.value[0], solution.covariance[(0, 0)].max(0.0).sqrt());
    let if_wrong = (1.0 + skew).powi(-2);
    (factor - if_wrong).abs() + 2.0 * error < (factor - 1.0).abs()
}

/// The tracked attitude's clock against the gyro's. A controller answers the noise of both with a motion that both see later, which makes
/// the attitude of a slow flight seem 10 to 30 ms early.
pub fn of_attitude(flight: &Prepared) -> Option<Clock> {
    // An estimator's attitude lags its own gyro by part of a sample, which is no clock.
    let least_s = if flight.has_logged_velocity { MATTERS_S.max(flight.period_s) } else { MATTERS_S };
    let of = |flight: &Prepared| {
        let pairs = tracks::rates(flight, |k, stretch| stretch.dcm[k]);
        estimate(&pairs, flight.period_s, [least_s, MATTERS_SKEW])
    };
    let low = at_low_frequency(flight).and_then(|low| of(&low));
    unless_contradicted(of(flight), low, |clock| vec![Some(clock.estimate())])
}

/// The tracked position's clock against the IMU's. Nothing without an IMU, and nothing where velocities are logged: then the
/// position is an estimate made from the same IMU.
pub fn of_position(flight: &Prepared) -> Option<Clock> {
    if flight.has_logged_velocity || !flight.has_position {
        return None;
    }
    estimate(&tracks::forces(flight), flight.period_s, [MATTERS_AGAINST_IMU_S, MATTERS_AGAINST_IMU_SKEW])
}

fn estimate(pairs: &[Pair], period_s: f64, least: [f64; 2]) -> Option<Clock> {
    if pairs.is_empty() {
        return None;
    }
    let start = Lags::new(pairs, period_s).best(&[Axes::SAME])[0];
    if start.similarity < ALIKE {
        return None;
    }
    let (middle_s, _) = tracks::span(pairs, period_s);
    let clock = Clock {
        offset_s: start.offset_s,
        offset_std_error_s: f64::NAN,
        skew: start.skew,
        skew_std_error: f64::NAN,
        matters: false,
        middle_s,
        least,
    };
    let both = refined(pairs, period_s, clock, true);
    // A skew that does not stand out would only make the offset less certain.
    let skewed = both.filter(Clock::is_skewed);
    let answer = skewed.or_else(|| {
        let mut alone = refined(pairs, period_s, Clock { skew: 0.0, ..clock }, false)?;
        alone.skew_std_error = both.map_or(f64::NAN, |c| c.skew_std_error);
        Some(alone)
    });
    answer.map(Clock::judged)
}

/// A clock after steps on its offset and, if asked for, its skew, with a bias for each axis.
fn refined(pairs: &[Pair], period_s: f64, clock: Clock, with_skew: bool) -> Option<Clock> {
    let stride = ((0.03 / period_s).round() as usize).max(1);
    let mut problem = ClockFit { pairs, period_s, stride, clock, with_skew };
    gauss_newton::solve(&mut problem, Rule::of_steps(MOST_STEPS)).ok()?;
    Some(problem.clock)
}

/// A clock that steps lead to what two sensors saw of the same motion.
struct ClockFit<'a> {
    pairs: &'a [Pair],
    period_s: f64,
    stride: usize,
    clock: Clock,
    with_skew: bool,
}

/// The motion says nothing about the clocks, or the steps lead beyond all clocks.
struct NoClock;

impl Problem for ClockFit<'_> {
    type End = ();
    type Error = NoClock;

    fn linearise(&mut self) -> Result<Linearised, NoClock> {
        let rows = rows(self.pairs, self.period_s, self.stride, &self.clock, self.with_skew);
        Ok(Linearised::without_priors(vec![rows]))
    }

    fn unidentifiable(&self, _: Unidentifiable) -> NoClock {
        NoClock
    }

    fn step(&mut self, _: Linearised, solution: Solution) -> Result<ControlFlow<()>, NoClock> {
        let error = |k: usize| solution.covariance[(k, k)].max(0.0).sqrt();
        let clock = &mut self.clock;
        let step = solution.value[0].clamp(-0.05, 0.05);
        clock.offset_s += step;
        clock.offset_std_error_s = error(0);
        if self.with_skew {
            clock.skew += solution.value[1].clamp(-0.01, 0.01);
            clock.skew_std_error = error(1);
        }
        if clock.offset_s.abs() > 0.5 || clock.skew.abs() > 0.05 {
            return Err(NoClock);
        }
        Ok(if step.abs() < 1e-6 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }
}

fn rows(pairs: &[Pair], period_s: f64, stride: usize, clock: &Clock, with_skew: bool) -> FlightRows {
    let mut targets: [Vec<f64>; 6] = Default::default();
    let mut slope: [Vec<f64>; 3] = Default::default();
    let mut times: Vec<f64> = Vec::new();
    let mut starts = Vec::new();
    for pair in pairs {
        starts.push(times.len());
        for k in (0..pair.len()).step_by(stride) {
            let time_s = pair.start_s + k as f64 * period_s;
            let place = k as f64 + clock.shift_s(time_s) / period_s;
            // Within what was tracked, with room for the neighbours of the interpolation and the difference.
            if place < 2.0 || place > pair.len() as f64 - 4.0 {
                continue;
            }
            times.push(time_s - clock.middle_s);
            for i in 0..3 {
                let at = |place: f64| interpolated(&pair.tracked[i], place);
                targets[3 + i].push(pair.onboard[i][k] - at(place));
                slope[i].push(0.5 * (at(place + 1.0) - at(place - 1.0)) / period_s);
            }
        }
    }
    starts.dedup();
    targets[..3].iter_mut().for_each(|t| *t = vec![0.0; times.len()]);
    let on_axes = |column: [Vec<f64>; 3]| -> [Option<Vec<f64>>; 6] {
        let [p, q, r] = column;
        [None, None, None, Some(p), Some(q), Some(r)]
    };
    let mut columns = vec![on_axes(slope.clone())];
    if with_skew {
        columns.push(on_axes(slope.map(|s| s.iter().zip(&times).map(|(s, t)| s * t).collect())));
    }
    for axis in 3..6 {
        let mut bias = [const { None }; 6];
        bias[axis] = Some(vec![1.0; times.len()]);
        columns.push(bias);
    }
    FlightRows { targets, columns, starts, period_s: stride as f64 * period_s }
}

/// Along the cubic through four samples.
fn interpolated(signal: &[f64], place: f64) -> f64 {
    let at = (place.floor() as usize).clamp(1, signal.len() - 3);
    let s = place - at as f64;
    let [a, b, c, d] = [signal[at - 1], signal[at], signal[at + 1], signal[at + 2]];
    // Lagrange's weights of the points -1, 0, 1, 2.
    -s * (s - 1.0) * (s - 2.0) / 6.0 * a + (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0 * b
        - (s + 1.0) * s * (s - 2.0) / 2.0 * c
        + (s + 1.0) * s * (s - 1.0) / 6.0 * d
}

/// What `align` moves: position and logged velocity by one clock, attitude by another.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// For x, y, z, vx, vy, vz.
    pub position: Option<Clock>,
    /// For phi, theta, psi.
    pub attitude: Option<Clock>,
    /// Whether the times of the rows stay as they are.
    pub board_keeps_time: bool,
}

impl Correction {
    /// The pace by which the clocks differ.
    fn skew(&self) -> f64 {
        self.attitude.or(self.position).map_or(0.0, |c| c.skew)
    }
}

impl Clocks {
    /// What has to be corrected, if anything. A position without a clock of its own shares the attitude's.
    pub fn correction(&self) -> Option<Correction> {
        let attitude = self.attitude.filter(|c| c.matters);
        let position = match &self.position {
            Some(own) => own.matters.then_some(*own),
            None => attitude,
        };
        (attitude.is_some() || position.is_some()).then_some(Correction {
            position,
            attitude,
            board_keeps_time: self.board_keeps_time,
        })
    }
}

/// The flight on one clock. Rows whose moment the tracker did not see have missing values.
pub fn align(flight: &Flight, correction: &Correction) -> Flight {
    use Column::*;
    let t = flight.required(T);
    let mut aligned = flight.clone();
    // The offset stays out of the time, which would only begin elsewhere.
    let pace = if correction.board_keeps_time { 1.0 } else { 1.0 + correction.skew() };
    let first = t.first().copied().unwrap_or(0.0);
    if pace != 1.0 {
        aligned.replace(T, t.iter().map(|t| first + (t - first) * pace).collect());
    }
    let streams = [
        (correction.position, &[X, Y, Z, Vx, Vy, Vz][..], false),
        (correction.attitude, &[Phi, Theta, Psi][..], true),
    ];
    for (clock, columns, angles) in streams {
        let Some(clock) = clock else { continue };
        for &column in columns {
            if let Some(values) = flight.column(column) {
                aligned.replace(column, read_at(t, values, |t| t + clock.shift_s(t), angles));
            }
        }
    }
    aligned
}

/// A column read at other times, along cubics; missing where a neighbour is missing or far.
fn read_at(t: &[f64], values: &[f64], moved: impl Fn(f64) -> f64, angles: bool) -> Vec<f64> {
    use std::f64::consts::TAU;
    let longest = flights::GAP_PERIODS * flights::median_step(t);
    let mut at = 0;
    t.iter()
        .map(|&row| {
            let time = moved(row);
            while at + 2 < t.len() && t[at + 1] <= time {
                at += 1;
            }
            if at == 0 || at + 2 >= t.len() || time < t[at] || time > t[at + 1] {
                return f64::NAN;
            }
            if t[at + 1] - t[at] > longest {
                return f64::NAN;
            }
            let (times, mut points) = (&t[at - 1..at + 3], [0.0; 4]);
            for (k, point) in points.iter_mut().enumerate() {
                let value = values[at - 1 + k];
                let turns = if angles { ((value - values[at]) / TAU).round() } else { 0.0 };
                *point = value - turns * TAU;
            }
            let near = times[1] - times[0] < longest && times[3] - times[2] < longest;
            if near && points.iter().all(|p| p.is_finite()) {
                return lagrange(times, &points, time);
            }
            let s = (time - times[1]) / (times[2] - times[1]);
            points[1] + s * (points[2] - points[1])
        })
        .collect()
}

fn lagrange(t: &[f64], y: &[f64; 4], time: f64) -> f64 {
    (0..4)
        .map(|i| {
            let weight: f64 = (0..4).filter(|j| *j != i).map(|j| (time - t[j]) / (t[i] - t[j])).product();
            weight * y[i]
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use model::Vehicle;

    use super::*;
    use crate::testing::{FED_BACK, Row, flight, fly, truth, waving_with_imu};

    fn clock(offset_s: f64, skew: f64) -> Clock {
        let least = [MATTERS_S, MATTERS_SKEW];
        let (offset_std_error_s, skew_std_error) = (4e-4, 2e-4);
        let middle_s = 10.0;
        Clock { offset_s, offset_std_error_s, skew, skew_std_error, matters: false, middle_s, least }.judged()
    }

    /// Stamps that run ahead are those of a fast tracker, or of a slow board where the tracker keeps time.
    #[test]
    fn a_clock_says_what_is_late_and_whose_pace_is_wrong() {
        let said = |offset_s, skew, board_keeps_time| {
            clock(offset_s, skew).sentence("x, y, z", "the IMU", board_keeps_time)
        };
        assert_eq!(said(0.0312, 0.0, false), "x, y, z are 31.20 ± 0.40 ms late relative to the IMU");
        let ahead = said(-0.0312, 0.0118, false);
        assert!(ahead.starts_with("x, y, z are 31.20 ± 0.40 ms early"), "{ahead}");
        assert!(ahead.contains("and the clock on board runs 1.18") && ahead.ends_with(" slow"), "{ahead}");
        for (skew, keeps, end) in [(0.0118, true, "fast"), (-0.0118, true, "slow"), (-0.0118, false, "fast")]
        {
            let whose = if keeps { "the tracker's clock" } else { "the clock on board" };
            let said = said(0.0312, skew, keeps);
            assert!(said.contains(whose) && said.ends_with(end), "{said}");
        }
        // 1 % for ten seconds after the middle.
        assert!((clock(0.02, 0.01).shift_s(20.0) - 0.12).abs() < 1e-15);
    }

    #[test]
    fn a_position_without_a_clock_of_its_own_shares_that_of_the_attitude() {
        // Two milliseconds are a fifth of a sample, and a skew of three standard errors is chance.
        assert!(!clock(0.002, 6e-4).matters && clock(-0.004, 0.0).matters && clock(0.0, 9e-4).matters);
        let of = |attitude, position| Clocks { attitude, position, ..Clocks::default() }.correction();
        let moved = |attitude, position| {
            let found: Correction = of(attitude, position)?;
            Some([found.position, found.attitude].map(|clock| clock.map(|c| c.offset_s)))
        };
        let (late, right) = (Some(clock(0.03, 0.0)), Some(clock(0.001, 0.0)));
        assert_eq!(moved(late, None), Some([Some(0.03), Some(0.03)]));
        assert_eq!(moved(late, right), Some([None, Some(0.03)]));
        assert_eq!(moved(right, late), Some([Some(0.03), None]));
        assert_eq!((moved(right, None), moved(None, None)), (None, None));
    }

    /// The tracker's rows show what was 30 ms before: three samples.
    #[test]
    fn a_late_tracker_is_found_out_and_its_columns_are_brought_forward() {
        let mut late = waving_with_imu(2000, |force, _| force);
        let columns = [Column::X, Column::Y, Column::Z, Column::Phi, Column::Theta, Column::Psi];
        let right = columns.map(|column| late.required(column).to_vec());
        let was = flight(2000, |t, row| {
            let mut before = Row::hover(t - 0.03);
            before.wave();
            (row.position_ned_m, row.euler_rad) = (before.position_ned_m, before.euler_rad);
        });
        columns.iter().for_each(|&column| late.replace(column, was.required(column).to_vec()));
        let clocks = Clocks::of(&Prepared::new(&late, &Vehicle::thesis()).unwrap(), 9.81);
        let found = clocks.attitude.unwrap();
        assert!(found.matters && (found.offset_s - 0.03).abs() < 1e-5, "{found:?}");
        let aligned = align(&late, &clocks.correction().unwrap());
        assert_eq!(aligned.required(Column::P), late.required(Column::P));
        for (column, right) in columns.into_iter().zip(&right) {
            let pairs = aligned.required(column).iter().zip(right);
            // Waves of 2 m/s at most, moved to a hundredth of a millisecond; the last rows were not seen.
            let worst = pairs.take(1990).map(|(value, right)| (value - right).abs()).skip(10);
            let worst = worst.fold(0.0, |worst: f64, off| if off < worst { worst } else { off });
            assert!(worst < 2e-5, "{column:?}: {worst}");
        }
        let mended = of_position(&Prepared::new(&aligned, &Vehicle::thesis()).unwrap()).unwrap();
        assert!(!mended.matters && mended.offset_s.abs() < 1e-5, "{mended:?}");
    }

    /// A controller that answers the noise of its gyro makes the attitude of slow flights seem early. A tracker that is 20 ms late is seen through it.
    #[test]
    fn an_attitude_is_in_time_where_the_controller_answers_the_noise_of_the_gyro() {
        println!("seeds 50 to 55");
        let mut mistaken = 0;
        for seed in 50..56 {
            let mut flight = fly(&truth(), seed, 40.0, &FED_BACK);
            let of = |flight: &Flight| Prepared::new(flight, &Vehicle::thesis()).unwrap();
            let all =
                estimate(&tracks::rates(&of(&flight), |k, s| s.dcm[k]), 0.01, [MATTERS_S, MATTERS_SKEW]);
            let found = of_attitude(&of(&flight)).unwrap();
            mistaken += usize::from(all.unwrap().matters);
            assert!(!found.matters, "seed {seed}: {found:?}");
            for column in [Column::Phi, Column::Theta, Column::Psi] {
                let mut late = flight.required(column).to_vec();
                late.rotate_right(2);
                (0..2).for_each(|k| late[k] = late[2]);
                flight.replace(column, late);
            }
            let found = of_attitude(&of(&flight)).unwrap();
            assert!(found.matters && (found.offset_s - 0.02).abs() < 0.003, "seed {seed}: {found:?}");
        }
        assert!(mistaken >= 1, "none of 6 flights seems early in all rows");
    }

    #[test]
    fn cubics_are_read_between_samples_across_a_whole_turn_and_not_across_a_gap() {
        let cubic = |t: f64| 0.2 * (t - 3.0) + 5e-3 * (t - 4.0).powi(2) + 1.5e-4 * (t - 5.0).powi(3);
        let mut t: Vec<f64> = (0..20).map(f64::from).collect();
        let even: Vec<f64> = t.iter().map(|t| cubic(*t)).collect();
        for place in [1.0, 2.3, 7.75, 16.5] {
            assert!((interpolated(&even, place) - cubic(place)).abs() < 1e-12, "{place}");
        }
        // Uneven, and a gap of twenty periods behind the tenth.
        t.iter_mut()
            .enumerate()
            .for_each(|(k, t)| *t += 0.1 * (k % 3) as f64 + if k > 10 { 20.0 } else { 0.0 });
        let angles: Vec<f64> = t.iter().map(|t| cubic(*t)).collect();
        let turn = std::f64::consts::TAU;
        let wrapped: Vec<f64> = angles.iter().map(|a| a - turn * (a / turn).round()).collect();
        let read = read_at(&t, &wrapped, |t| t + 0.4, true);
        for k in 1..17 {
            let expected = match k {
                // Beside the gap, along a straight line.
                9 | 11 => angles[k] + 0.4 / (t[k + 1] - t[k]) * (angles[k + 1] - angles[k]),
                _ => cubic(t[k] + 0.4),
            };
            let off = read[k] - expected;
            assert!(k == 10 || (off - turn * (off / turn).round()).abs() < 1e-9, "{k}: {off}");
            assert_eq!(read[k].is_nan(), k == 10, "{k}");
        }
    }
}
