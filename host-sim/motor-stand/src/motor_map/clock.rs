//! The offset of the two clocks before anything else is known: both logs on one coarse grid, laid
//! side by side at every offset at which they overlap by half. The best few are fitted closely.

use model::rotor_lag::RotorLag;

use super::craft_log::{lagged, range};
use super::error::MotorMapError;
use super::quality::LEAST_FIT;
use super::rows::{Point, Shape};
use super::run::{Fitted, Free, NEEDED_S, Run};
use super::terms::Terms;

/// Grid of the search for the clock's offset: finest and coarsest step, s, and points aimed at.
const COARSE_S: (f64, f64) = (0.04, 0.25);
const COARSE_POINTS: f64 = 1500.0;
/// Paces tried where one does not fit.
const SKEWS: [f64; 8] = [0.0025, -0.0025, 0.005, -0.005, 0.01, -0.01, 0.02, -0.02];
/// Part of the variance that is explained at a good offset.
const GOOD_FIT: f64 = 0.97;
/// Offsets looked at closely.
const PEAKS: usize = 6;
/// Offsets this near are one, s.
const SAME_OFFSET_S: f64 = 0.25;
/// An offset is ambiguous if another one fits within this factor.
const AMBIGUOUS: f64 = 1.1;
/// First guess of the lag, rad/s.
const FIRST_LAG: f64 = 20.0;

/// The offset of the clocks, to a few hundredths of a second, and the lag that goes with it.
pub(super) fn synchronise(run: &Run<'_>, terms: Terms) -> Result<Shape, MotorMapError> {
    let coarse = CoarseGrid::new(run);
    let mut peaks = coarse.peaks(0.0);
    if peaks.first().is_none_or(|p| p.explained < GOOD_FIT) {
        peaks.extend(SKEWS.iter().flat_map(|skew| coarse.peaks(*skew)));
        peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
    }
    let best = peaks.iter().map(|p| p.explained).fold(0.0, f64::max);
    if best < LEAST_FIT {
        return Err(MotorMapError::NoOverlap { percent: 100.0 * best });
    }
    let all: Vec<usize> = (0..run.points.len()).collect();
    let mut found: Vec<Fitted> = Vec::new();
    let mut refused = None;
    for peak in peaks.iter().filter(|p| p.explained > 0.8 * best).take(PEAKS) {
        let start = Shape { lag: FIRST_LAG, offset_s: peak.offset_s, skew: peak.skew };
        match run.fit(&all, terms, start, Free::LagAndClock) {
            Ok(fitted) => found.push(fitted),
            Err(why) => refused = refused.or(Some(why)),
        }
    }
    found.sort_by(|a, b| a.rms.total_cmp(&b.rms));
    let Some(first) = found.first() else {
        return Err(refused.unwrap_or(MotorMapError::NoOverlap { percent: 100.0 * best }));
    };
    let other = found.iter().find(|f| (f.shape.offset_s - first.shape.offset_s).abs() > SAME_OFFSET_S);
    match other {
        Some(other) if other.rms < AMBIGUOUS * first.rms => {
            Err(MotorMapError::Ambiguous { first_s: first.shape.offset_s, second_s: other.shape.offset_s })
        }
        _ => Ok(first.shape),
    }
}

/// An offset at which the logs look alike.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    offset_s: f64,
    skew: f64,
    /// Part of the speed's variance that commands and voltage explain.
    explained: f64,
    /// Logarithm of the likelihood ratio.
    score: f64,
}

/// Both logs on one even grid, coarse enough that every offset can be tried.
pub(super) struct CoarseGrid<'a> {
    run: &'a Run<'a>,
    step_s: f64,
    /// First motor's lagged command and voltage from the start of the craft's log on; none in gaps.
    craft: Vec<Option<[f64; 2]>>,
}

impl<'a> CoarseGrid<'a> {
    fn new(run: &'a Run<'a>) -> Self {
        let craft = run.craft;
        let step_s = (craft.duration_s() / COARSE_POINTS).clamp(COARSE_S.0, COARSE_S.1);
        let command = &craft.command[0];
        let states = lagged(craft, command, RotorLag::new(FIRST_LAG));
        let (low, high) = range(command);
        let middle_v = craft.volts.iter().sum::<f64>() / craft.volts.len() as f64;
        let count = (craft.duration_s() / step_s) as usize;
        let grid = (0..count).map(|i| {
            let k = craft.holding(craft.t[0] + i as f64 * step_s)?;
            Some([(states[k] - low) / (high - low), craft.volts[k] - middle_v])
        });
        Self { run, step_s, craft: grid.collect() }
    }

    /// The tachometer's first motor on the grid, from its first point on, its clock made faster by
    /// `skew`.
    fn rotor(&self, skew: f64) -> Vec<Option<f64>> {
        let points = &self.run.points[0];
        let Some(first) = points.first() else { return Vec::new() };
        let place = |p: &Point| ((1.0 + skew) * (p.time_s - first.time_s) / self.step_s).round() as usize;
        let count = points.last().map_or(0, |p| place(p) + 1);
        let mut sums = vec![(0.0, 0.0); count];
        for p in points {
            let cell = &mut sums[place(p)];
            *cell = (cell.0 + p.speed, cell.1 + 1.0);
        }
        sums.into_iter().map(|(sum, n)| (n > 0.0).then(|| sum / n)).collect()
    }

    /// The best offsets, the best first, none within [`SAME_OFFSET_S`] of a better one.
    fn peaks(&self, skew: f64) -> Vec<Candidate> {
        let rotor = self.rotor(skew);
        let (n, m) = (self.craft.len() as isize, rotor.len() as isize);
        let shorter = n.min(m);
        let points = &self.run.points[0];
        let first_s = points.first().map_or(0.0, |p| p.time_s);
        let mut all: Vec<Candidate> = (-(m - shorter / 2)..=(n - shorter / 2))
            .filter_map(|shift| {
                let (explained, count) = self.explained(&rotor, shift, shorter / 3)?;
                let craft_s = self.run.craft.t[0] + shift as f64 * self.step_s;
                // At the first point the clocks differ by this; the middle of the run is later.
                let offset_s = craft_s - first_s + skew * (self.run.middle_s - first_s);
                let score = -0.5 * count * (1.0 - explained).max(1e-9).ln();
                Some(Candidate { offset_s, skew, explained, score })
            })
            .collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut best: Vec<Candidate> = Vec::new();
        for lay in all {
            if best.iter().all(|b| (b.offset_s - lay.offset_s).abs() > SAME_OFFSET_S) {
                best.push(lay);
                if best.len() == PEAKS {
                    break;
                }
            }
        }
        best
    }

    /// Part of the rotor's variance that command and voltage explain when its log is laid `shift`
    /// steps into the craft's, and how many points they share.
    fn explained(&self, rotor: &[Option<f64>], shift: isize, least: isize) -> Option<(f64, f64)> {
        let (mut s, mut n) = ([0.0; 9], 0.0);
        let from = shift.max(0) as usize;
        let to = (shift + rotor.len() as isize).clamp(0, self.craft.len() as isize) as usize;
        for i in from..to {
            let (Some([a, b]), Some(w)) = (self.craft[i], rotor[(i as isize - shift) as usize]) else {
                continue;
            };
            n += 1.0;
            for (sum, value) in s.iter_mut().zip([a, b, w, a * a, a * b, b * b, a * w, b * w, w * w]) {
                *sum += value;
            }
        }
        if n < (least as f64).max(NEEDED_S / self.step_s) {
            return None;
        }
        let [a, b, w, aa, ab, bb, aw, bw, ww] = s;
        let (aa, ab, bb) = (aa - a * a / n, ab - a * b / n, bb - b * b / n);
        let (aw, bw, ww) = (aw - a * w / n, bw - b * w / n, ww - w * w / n);
        let determinant = aa * bb - ab * ab;
        // A voltage that does not move explains nothing.
        let explained = if determinant > 1e-9 * aa * bb {
            (bb * aw * aw - 2.0 * ab * aw * bw + aa * bw * bw) / determinant
        } else {
            aw * aw / aa
        };
        (ww > 0.0 && aa > 0.0).then(|| ((explained / ww).clamp(0.0, 1.0), n))
    }
}
