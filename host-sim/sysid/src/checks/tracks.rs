//! Two streams of one motion, side by side, and how alike they are at every shift in time.
//!
//! A craft's motion is logged twice: by sensors on board (gyro, IMU) and by a tracker (attitude, position). A [`Pair`]
//! holds both as vectors through filters with equal response and no lag, so that they are equal but for noise, bias,
//! wrong clocks ([`crate::checks::clocks`]) and wrong axes ([`crate::checks::frames`]).
//!
//! [`Lags`] holds the products of the two at every lag, in blocks of two seconds. A clock that is off by an offset and runs
//! fast by a skew asks each block for another lag; axes that are turned or mirrored ask for other elements of the
//! products. Both are then sums over few blocks, and a thousand hypotheses cost no more than one.

use nalgebra::{Matrix3, Vector3};

use crate::filter::{RegressionFilter, compose, sum_of_products};
use crate::prepare::{Prepared, Stretch, push, vector};

/// Largest offset looked for, s.
const MOST_OFFSET_S: f64 = 0.26;
/// Largest skew looked for.
const MOST_SKEW: f64 = 0.024;
/// Most that one clock may run away from the other between the middle of a flight and its ends, s: skews of flights over an hour
/// and a half are looked for in a smaller range, so that a log of many hours takes no more memory.
const MOST_DRIFT_S: f64 = 65.0;
/// Lags and the shift at the ends of a flight from one skew to the next are this far apart, s.
const LAG_STEP_S: f64 = 0.01;
/// Time between the rows that are multiplied, s: the filters pass little that is faster.
const ROW_PERIOD_S: f64 = 0.03;
const BLOCK_S: f64 = 2.0;
/// Blocks that are used, about; of a longer flight every second, third, ... one.
const MOST_BLOCKS: usize = 80;
/// Stretches that are used, about, of a log with many.
const MOST_PAIRS: usize = 500;

/// One motion seen twice over a stretch.
pub(crate) struct Pair {
    /// Time of the first sample, s.
    pub(crate) start_s: f64,
    /// As seen on board.
    pub(crate) onboard: [Vec<f64>; 3],
    /// As tracked.
    pub(crate) tracked: [Vec<f64>; 3],
}

impl Pair {
    pub(crate) fn len(&self) -> usize {
        self.onboard[0].len()
    }
}

/// Gyro and the rates of the tracked attitude, body axes, rad/s. `attitude` says what the logged attitude (inertial to
/// body) has to become first.
pub(crate) fn rates(flight: &Prepared, attitude: impl Fn(usize, &Stretch) -> Matrix3<f64>) -> Vec<Pair> {
    let filter = &flight.filter;
    let half = filter.half();
    let usable = flight.stretches.iter().filter(|s| s.time_s.len() > 2 * half);
    usable
        .map(|stretch| {
            let count = stretch.time_s.len();
            let mut turns: [Vec<f64>; 3] = Default::default();
            let mut before = attitude(0, stretch);
            for k in 1..count {
                let now = attitude(k, stretch);
                // For a small turn, the product of old and new attitude is I + [turn x].
                let m = before * now.transpose();
                let turn = Vector3::new(m[(2, 1)] - m[(1, 2)], m[(0, 2)] - m[(2, 0)], m[(1, 0)] - m[(0, 1)]);
                let scale = 0.5 / flight.period_s;
                turns.iter_mut().zip(turn.iter()).for_each(|(column, t)| column.push(scale * t));
                before = now;
            }
            let at = |signal: &Vec<f64>, taps: &[f64]| -> Vec<f64> {
                (half..count - half).map(|k| sum_of_products(&signal[k - half..], taps)).collect()
            };
            Pair {
                start_s: stretch.time_s[half],
                onboard: stretch.rate_rad_s.each_ref().map(|r| at(r, &filter.matched)),
                tracked: turns.each_ref().map(|t| at(t, &filter.between)),
            }
        })
        .collect()
}

/// The IMU's specific force turned into the inertial frame, and the tracked point's acceleration, m/s^2. They differ by
/// gravity, which is constant. Nothing without an IMU.
pub(crate) fn forces(flight: &Prepared) -> Vec<Pair> {
    let filter = RegressionFilter::new(flight.period_s);
    let (second, smooth) =
        (compose(&filter.derivative, &filter.derivative), compose(&filter.matched, &filter.matched));
    let half = second.len() / 2;
    let long_enough = flight.stretches.iter().filter(|s| s.time_s.len() > 2 * half);
    long_enough
        .filter_map(|stretch| {
            let imu = stretch.imu_m_s2.as_ref()?;
            let count = stretch.time_s.len();
            let mut turned: [Vec<f64>; 3] = Default::default();
            for k in 0..count {
                push(&mut turned, stretch.dcm[k].tr_mul(&vector(imu, k)));
            }
            let at = |signal: &Vec<f64>, taps: &[f64]| -> Vec<f64> {
                (half..count - half).map(|k| sum_of_products(&signal[k - half..], taps)).collect()
            };
            Some(Pair {
                start_s: stretch.time_s[half],
                onboard: turned.each_ref().map(|f| at(f, &smooth)),
                tracked: stretch.position_ned_m.each_ref().map(|p| at(p, &second)),
            })
        })
        .collect()
}

/// An axis system in terms of another: axis i is `sign[i]` times axis `from[i]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Axes {
    pub(crate) from: [usize; 3],
    pub(crate) sign: [f64; 3],
}

impl Axes {
    pub(crate) const SAME: Self = Self { from: [0, 1, 2], sign: [1.0; 3] };

    /// The 24 rotations and the 24 mirrored ones: the same axes, then single mirrored ones, then the rest.
    pub(crate) fn all() -> Vec<Self> {
        const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0], [2, 0, 1]];
        let mut all = Vec::with_capacity(48);
        for from in ORDERS {
            for bits in [0_u8, 1, 2, 4, 3, 5, 6, 7] {
                let sign = std::array::from_fn(|i| if bits >> i & 1 == 1 { -1.0 } else { 1.0 });
                all.push(Self { from, sign });
            }
        }
        all
    }

    pub(crate) fn of(self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|i, _| self.sign[i] * v[self.from[i]])
    }

    /// "q, -p, r" for names "p", "q", "r".
    pub(crate) fn named(self, names: [&str; 3]) -> String {
        let one = |i: usize| {
            let sign = if self.sign[i] < 0.0 { "-" } else { "" };
            format!("{sign}{}", names[self.from[i]])
        };
        format!("{}, {}, {}", one(0), one(1), one(2))
    }

    /// The same for the map of columns beside a flight, ready to paste: ` (or in columns.toml: [columns] p = "q", ...)`.
    pub(crate) fn mapped(self, names: [&str; 3]) -> String {
        let changed = (0..3).filter(|&i| self.from[i] != i || self.sign[i] < 0.0);
        let one = |i: usize| {
            let sign = if self.sign[i] < 0.0 { "-" } else { "" };
            format!("{} = \"{sign}{}\"", names[i], names[self.from[i]])
        };
        format!(
            " (or leave the log as it is and say so in columns.toml beside it, under [columns]: {})",
            changed.map(one).collect::<Vec<_>>().join("; ")
        )
    }

    /// The axes of which these are made, in terms of these.
    pub(crate) fn inverse(self) -> Self {
        let mut inverse = Self::SAME;
        for i in 0..3 {
            inverse.from[self.from[i]] = i;
            inverse.sign[self.from[i]] = self.sign[i];
        }
        inverse
    }
}

/// How well two streams agree when one is shifted and its axes are exchanged.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Match {
    /// How much earlier the tracker's row is at which it sees what the board sees, at the middle of the flight, s.
    pub(crate) offset_s: f64,
    /// Growth of the offset with time.
    pub(crate) skew: f64,
    /// Twice the product over the sum of the squares: 1 for equal streams, 0 for unrelated ones.
    pub(crate) similarity: f64,
    /// Correlation of each onboard axis with what it should be.
    pub(crate) correlation: [f64; 3],
}

/// Products at one lag.
#[derive(Debug, Clone, Copy, Default)]
struct Products {
    /// Onboard axis i with tracked axis j.
    cross: Matrix3<f64>,
    /// Squares.
    onboard: Vector3<f64>,
    tracked: Vector3<f64>,
}

impl Products {
    fn add(&mut self, other: &Self) {
        self.cross += other.cross;
        self.onboard += other.onboard;
        self.tracked += other.tracked;
    }
}

struct Block {
    /// Middle of the block, from the middle of the flight, s.
    time_s: f64,
    /// Lag of the first entry of `products`. At other lags the streams have nothing in common.
    first: isize,
    products: Vec<Products>,
}

/// Products of two streams at every lag, in blocks.
pub(crate) struct Lags {
    blocks: Vec<Block>,
    step_s: f64,
    duration_s: f64,
    /// Root mean square of each axis about its mean, on board and tracked.
    pub(crate) rms_onboard: [f64; 3],
    pub(crate) rms_tracked: [f64; 3],
}

/// Middle and length of the time that pairs cover, s.
pub(crate) fn span(pairs: &[Pair], period_s: f64) -> (f64, f64) {
    let ends = |p: &Pair| (p.start_s, p.start_s + period_s * p.len() as f64);
    let from = pairs.iter().map(|p| ends(p).0).fold(f64::INFINITY, f64::min);
    let to = pairs.iter().map(|p| ends(p).1).fold(f64::NEG_INFINITY, f64::max);
    (0.5 * (from + to), to - from)
}

impl Lags {
    pub(crate) fn new(pairs: &[Pair], period_s: f64) -> Self {
        let (middle_s, duration_s) = span(pairs, period_s);
        let lag_samples = ((LAG_STEP_S / period_s).round() as usize).max(1);
        let step_s = lag_samples as f64 * period_s;
        let row_samples = ((ROW_PERIOD_S / period_s).round() as usize).max(1);
        let block_samples = ((BLOCK_S / period_s).round() as usize).max(row_samples);
        let (mean_onboard, rms_onboard) = moments(pairs, |p| &p.onboard);
        let (mean_tracked, rms_tracked) = moments(pairs, |p| &p.tracked);
        let most_skew = most_skew(duration_s);
        let every = ((duration_s / BLOCK_S) as usize).div_ceil(MOST_BLOCKS).max(1);
        // Of many short stretches every second, third, ... one.
        let every_pair = pairs.len().div_ceil(MOST_PAIRS).max(1);
        let mut blocks = Vec::new();
        for pair in pairs.iter().step_by(every_pair) {
            for start in (0..pair.len()).step_by(block_samples * every) {
                let end = (start + block_samples).min(pair.len());
                let time_s = pair.start_s + 0.5 * (start + end) as f64 * period_s - middle_s;
                let reach = ((MOST_OFFSET_S + most_skew * time_s.abs()) / step_s).ceil() as isize + 3;
                let reach = reach.min((pair.len() / lag_samples) as isize + 1);
                let at_lag = |lag: isize| {
                    let shift = lag * lag_samples as isize;
                    let mut products = Products::default();
                    for k in (start..end).step_by(row_samples) {
                        let other = k as isize + shift;
                        if other < 0 || other >= pair.len() as isize {
                            continue;
                        }
                        let a = Vector3::from_fn(|i, _| pair.onboard[i][k] - mean_onboard[i]);
                        let b = Vector3::from_fn(|i, _| pair.tracked[i][other as usize] - mean_tracked[i]);
                        products.cross += a * b.transpose();
                        products.onboard += a.component_mul(&a);
                        products.tracked += b.component_mul(&b);
                    }
                    products
                };
                let products = (-reach..=reach).map(at_lag).collect();
                blocks.push(Block { time_s, first: -reach, products });
            }
        }
        Self { blocks, step_s, duration_s, rms_onboard, rms_tracked }
    }

    fn at(&self, offset_s: f64, skew: f64) -> Products {
        let mut sum = Products::default();
        for block in &self.blocks {
            let lag = ((offset_s + skew * block.time_s) / self.step_s).round() as isize - block.first;
            if let Some(products) = usize::try_from(lag).ok().and_then(|lag| block.products.get(lag)) {
                sum.add(products);
            }
        }
        sum
    }

    /// Every offset and skew with its products.
    fn shifts(&self) -> Vec<(f64, f64, Products)> {
        let offsets = (MOST_OFFSET_S / self.step_s) as isize;
        let skew_step = 4.0 * self.step_s / self.duration_s.max(1.0);
        let skews = (most_skew(self.duration_s) / skew_step).ceil() as isize;
        let mut all = Vec::new();
        for s in -skews..=skews {
            for o in -offsets..=offsets {
                let (offset, skew) = (o as f64 * self.step_s, s as f64 * skew_step);
                all.push((offset, skew, self.at(offset, skew)));
            }
        }
        all
    }

    /// The best shift for each of several hypotheses of the onboard axes in terms of the tracked ones.
    pub(crate) fn best(&self, hypotheses: &[Axes]) -> Vec<Match> {
        let shifts = self.shifts();
        hypotheses.iter().map(|&axes| best_of(&shifts, axes)).collect()
    }
}

/// Largest skew that is looked for in a flight of this length.
fn most_skew(duration_s: f64) -> f64 {
    MOST_SKEW.min(MOST_DRIFT_S / (0.5 * duration_s).max(1.0))
}

fn best_of(shifts: &[(f64, f64, Products)], axes: Axes) -> Match {
    let nothing = Match { offset_s: 0.0, skew: 0.0, similarity: -1.0, correlation: [0.0; 3] };
    shifts.iter().fold(nothing, |best, (offset_s, skew, p)| {
        let product: f64 = (0..3).map(|i| axes.sign[i] * p.cross[(i, axes.from[i])]).sum();
        let squares = p.onboard.sum() + p.tracked.sum();
        let similarity = 2.0 * product / squares.max(f64::MIN_POSITIVE);
        if similarity <= best.similarity {
            return best;
        }
        let correlation = std::array::from_fn(|i| {
            let j = axes.from[i];
            axes.sign[i] * p.cross[(i, j)] / (p.onboard[i] * p.tracked[j]).sqrt().max(f64::MIN_POSITIVE)
        });
        Match { offset_s: *offset_s, skew: *skew, similarity, correlation }
    })
}

/// Mean and root mean square about it.
fn moments(pairs: &[Pair], stream: impl Fn(&Pair) -> &[Vec<f64>; 3]) -> ([f64; 3], [f64; 3]) {
    let count = pairs.iter().map(Pair::len).sum::<usize>().max(1) as f64;
    let sum = |f: &dyn Fn(usize, f64) -> f64| -> [f64; 3] {
        std::array::from_fn(|i| {
            pairs.iter().flat_map(|p| &stream(p)[i]).map(|v| f(i, *v)).sum::<f64>() / count
        })
    };
    let mean = sum(&|_, v| v);
    let variance = sum(&|i, v| (v - mean[i]) * (v - mean[i]));
    (mean, variance.map(f64::sqrt))
}

#[cfg(test)]
mod tests {
    use model::Vehicle;

    use super::*;
    use crate::testing::{prepared, waving_with_imu};

    #[test]
    fn there_are_48_different_axes_of_which_half_are_rotations() {
        let all = Axes::all();
        assert_eq!((all.len(), all[0]), (48, Axes::SAME));
        let matrix = |axes: &Axes| Matrix3::from_fn(|i, j| axes.of(Matrix3::identity().column(j).into())[i]);
        for (k, axes) in all.iter().enumerate() {
            assert!(!all[..k].contains(axes), "{axes:?}");
            let m = matrix(axes);
            assert_eq!(m * m.transpose(), Matrix3::identity());
        }
        let rotations = all.iter().filter(|axes| matrix(axes).determinant() > 0.0).count();
        assert_eq!(rotations, 24);
    }

    #[test]
    fn inverse_axes_lead_back() {
        let v = Vector3::new(1.0, 2.0, 3.0);
        for axes in Axes::all() {
            assert_eq!(axes.inverse().of(axes.of(v)), v, "{axes:?}");
            assert_eq!(axes.of(axes.inverse().of(v)), v, "{axes:?}");
        }
    }

    #[test]
    fn axes_are_named_as_they_are_written() {
        let axes = Axes { from: [1, 0, 2], sign: [1.0, -1.0, 1.0] };
        assert_eq!(axes.named(["p", "q", "r"]), "q, -p, r");
        assert_eq!(axes.of(Vector3::new(1.0, 2.0, 3.0)), Vector3::new(2.0, -1.0, 3.0));
    }

    #[test]
    fn the_gyro_and_the_tracked_attitude_tell_the_same_rates() {
        let flight = prepared(600, |_, row| {
            row.wave();
        });
        let pairs = rates(&flight, |k, stretch| stretch.dcm[k]);
        assert_eq!((pairs.len(), pairs[0].len()), (1, 570));
        assert!((pairs[0].start_s - 0.15).abs() < 1e-12);
        for (onboard, tracked) in pairs[0].onboard.iter().zip(&pairs[0].tracked) {
            for (a, b) in onboard.iter().zip(tracked) {
                // The product of two attitudes is a small turn but for its third power.
                assert!((a - b).abs() < 1e-3, "{a} {b}");
            }
        }
    }

    #[test]
    fn what_an_imu_feels_and_what_a_tracker_sees_differ_by_gravity() {
        let flight = Prepared::new(&waving_with_imu(600, |f, _| f), &Vehicle::thesis()).unwrap();
        let pairs = forces(&flight);
        for (i, gravity) in [0.0, 0.0, 9.81].into_iter().enumerate() {
            for (a, b) in pairs[0].onboard[i].iter().zip(&pairs[0].tracked[i]) {
                assert!((b - a - gravity).abs() < 1e-2, "axis {i}: {a} {b}");
            }
        }
        let without = prepared(600, |_, _| {});
        assert!(forces(&without).is_empty());
    }

    /// A minute of two streams of one motion at 100 Hz; the tracker's clock is late by `offset_s`
    /// at the middle and grows later by `skew`.
    fn pair(offset_s: f64, skew: f64, seen: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<Pair> {
        let motion = |t: f64| {
            let wave = |w: f64, f: f64| (w * t + f).sin() + (1.7 * w * t - f).cos() * 0.6;
            Vector3::new(wave(3.1, 0.2), 0.8 * wave(4.3, 1.0), 1.3 * wave(2.3, 2.0))
        };
        let (mut onboard, mut tracked): ([Vec<f64>; 3], [Vec<f64>; 3]) = Default::default();
        for k in 0..6000 {
            let t = 0.01 * f64::from(k);
            let (a, b) = (motion(t), seen(motion(t - offset_s - skew * (t - 30.0))));
            (0..3).for_each(|i| {
                onboard[i].push(a[i]);
                tracked[i].push(b[i]);
            });
        }
        vec![Pair { start_s: 0.0, onboard, tracked }]
    }

    #[test]
    fn the_offset_and_the_skew_of_a_clock_are_found() {
        for (offset_s, skew) in [(0.0, 0.0), (0.12, 0.0), (-0.2, 0.0), (0.05, 0.01), (-0.08, -0.005)] {
            let lags = Lags::new(&pair(offset_s, skew, |v| v), 0.01);
            let best = lags.best(&[Axes::SAME])[0];
            // Half a step of the lags, and what that is from the middle to an end.
            assert!((best.offset_s - offset_s).abs() < 0.0101, "{best:?}");
            assert!((best.skew - skew).abs() < 0.0015, "{best:?}");
            assert!(best.similarity > 0.98, "{best:?}");
        }
    }

    /// Two minutes of a log, an hour or more than a day apart.
    #[test]
    fn hours_without_a_log_cost_nothing() {
        for apart_s in [3600.0, 1e5] {
            let mut pairs = pair(0.05, 0.0, |v| v);
            pairs.extend(pair(0.05, 0.0, |v| v));
            pairs[1].start_s = apart_s;
            let lags = Lags::new(&pairs, 0.01);
            let products: usize = lags.blocks.iter().map(|block| block.products.len()).sum();
            assert!(products < 80 * 13_500, "{products} products");
            let shifts = lags.shifts().len();
            assert!(shifts < 53 * 6600, "{shifts} shifts");
        }
    }

    #[test]
    fn exchanged_axes_agree_as_what_they_are_and_as_nothing_else() {
        let axes = Axes { from: [1, 0, 2], sign: [1.0, -1.0, 1.0] };
        let lags = Lags::new(&pair(0.0, 0.0, |v| axes.inverse().of(v)), 0.01);
        let all = Axes::all();
        let matches = lags.best(&all);
        let best = (0..48).max_by(|a, b| matches[*a].similarity.total_cmp(&matches[*b].similarity)).unwrap();
        assert_eq!(all[best], axes);
        assert!(matches[best].correlation.iter().all(|c| *c > 0.999), "{:?}", matches[best]);
        assert!(matches[0].similarity < 0.7, "{:?}", matches[0]);
    }

    #[test]
    fn the_rms_of_a_stream_is_about_its_mean() {
        let wave: Vec<f64> = (0..6284).map(|k| 7.0 + 2.0 * (0.01 * f64::from(k)).sin()).collect();
        let streams = || [wave.clone(), vec![5.0; wave.len()], vec![0.0; wave.len()]];
        let pairs = [Pair { start_s: 1.0, onboard: streams(), tracked: streams() }];
        let lags = Lags::new(&pairs, 0.01);
        assert!((lags.rms_onboard[0] - 2.0_f64.sqrt()).abs() < 1e-3, "{:?}", lags.rms_onboard);
        assert_eq!(lags.rms_tracked[1], 0.0);
        let (middle_s, length_s) = span(&pairs, 0.01);
        assert!((middle_s - 32.42).abs() < 1e-9 && (length_s - 62.84).abs() < 1e-9);
    }
}
