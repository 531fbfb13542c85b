//! The motor map and lag from a test stand: thesis 3.3, 4.2.5, equations (4.10) and (4.11).
//!
//! The craft records command and battery voltage, another computer the rotor's speed, each by its own clock; the thesis
//! synchronised the two by hand. Here both clocks, the map and the lag come out of one least squares:
//!
//! ```text
//! speed(t) = G( command * cmd + voltage * vbat + offset )(t + clock + skew (t - middle)),   G = lag / (s + lag)
//! ```
//!
//! with t on the tachometer's clock and G exact for commands held over a sample. The map's coefficients are linear, the rest
//! enters by Gauss and Newton's steps from the best of all offsets at which the logs overlap by half. Standard errors hold
//! for coloured residuals (`regress.rs`). Pulses that a tachometer missed stand out and are left out.
//!
//! **Which map?** Maps with fewer and with more terms than (4.10) are fitted to parts of the run and judged on the others; a
//! longer one is supported where the error it was not fitted to falls by more than chance and enough to matter.
//!
//! **What cannot be told apart.** A dead time of the speed controller, and half the interval over which a pulse counter
//! averages, are in the clock's offset. An average over a long interval also looks like a slower rotor.

use schemars::JsonSchema;
use serde::Serialize;

use crate::stand::Stand;
use flights::median_step;
use sysid::filter::RegressionFilter;
use sysid::fit::least_squares::{self, FlightRows};
use sysid::prepare::smoothed;

/// Window over which the voltmeter's noise is smoothed away, s.
const VOLTAGE_WINDOW_S: f64 = 0.25;
/// Steps longer than this many periods are gaps.
const GAP_PERIODS: f64 = 3.5;
/// Time constants after which it does not matter any more how a rotor began.
const SETTLED: f64 = 5.0;
/// Grid of the search for the clock's offset: finest and coarsest step, s, and points aimed at.
const COARSE_S: (f64, f64) = (0.04, 0.25);
const COARSE_POINTS: f64 = 1500.0;
/// Paces tried where one does not fit.
const SKEWS: [f64; 8] = [0.0025, -0.0025, 0.005, -0.005, 0.01, -0.01, 0.02, -0.02];
/// Part of the variance that is explained at a good offset, and least part at which two logs belong together.
const GOOD_FIT: f64 = 0.97;
const LEAST_FIT: f64 = 0.6;
/// Offsets looked at closely.
const PEAKS: usize = 6;
/// Offsets this near are one, s.
const SAME_OFFSET_S: f64 = 0.25;
/// An offset is ambiguous if another one fits within this factor.
const AMBIGUOUS: f64 = 1.1;
/// First guess of the lag, rad/s, and what motors have.
const FIRST_LAG: f64 = 20.0;
const LAGS: (f64, f64) = (0.5, 400.0);
const MOST_STEPS: usize = 40;
/// Residuals this many times their usual size are missed pulses.
const OUTLIER: f64 = 6.0;
/// Speeds under this part of the largest are a rotor that stands.
const STANDING: f64 = 0.05;
/// Standard error of the voltage's coefficient, part of speed over voltage, beyond which it was not excited.
const VOLTAGE_ERROR: f64 = 0.2;
/// A voltage that moves by less than this is constant, V.
const LEAST_VOLTS: f64 = 0.01;
/// Standard error of the lag, part of it, beyond which it is not known.
const LAG_ERROR: f64 = 0.25;
/// Length of a part of the run that is judged as one, s; and number of folds.
const PART_S: f64 = 2.0;
const FOLDS: usize = 5;
/// Deviations by which the fall of the held-out error has to stand out, and least fall that matters, percent.
const SUPPORT_DEVIATIONS: f64 = 3.0;
const SUPPORT_PERCENT: f64 = 3.0;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Estimated {
    /// Value.
    pub value: f64,
    /// Standard error.
    pub std_error: f64,
}

/// The tachometer's clock against the craft's: craft = tachometer + offset + skew (tachometer - middle).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct StandClock {
    /// At the middle, s.
    pub offset_s: Estimated,
    /// By which part the craft's clock runs faster.
    pub skew: Estimated,
    /// Middle of the run on the tachometer's clock, s.
    pub middle_s: f64,
}

/// Map (4.10) and lag.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Map {
    /// rad/s per command unit.
    pub command: Estimated,
    /// rad/s per volt; absent where it was left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub voltage: Option<Estimated>,
    /// rad/s.
    pub offset: Estimated,
    /// First-order lag, rad/s.
    pub lag: Estimated,
    /// Whether the run determines the lag.
    pub lag_is_known: bool,
    /// Root mean square of what is left, rad/s.
    pub rms_rad_s: f64,
}

/// One of the maps that were compared.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Judged {
    /// Its terms besides the constant.
    pub terms: &'static str,
    /// Coefficients, the constant last.
    pub coefficients: Vec<f64>,
    /// Root mean square error where it was fitted, rad/s.
    pub fitted_rad_s: f64,
    /// Where it was not, rad/s.
    pub held_out_rad_s: f64,
    /// The map it is held against.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub against: Option<&'static str>,
    /// By how much the held-out squared error is below that one's, percent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub drop_percent: Option<f64>,
    /// Standard deviations by which that fall stands out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub deviations: Option<f64>,
    /// Whether it is better by more than chance and enough to matter.
    pub supported: bool,
}

/// A motor by itself.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MotorMap {
    /// 1 to 4; 0 where the logs do not say.
    pub motor: usize,
    /// Its own map and lag.
    pub map: Map,
    /// How much faster it turns than the common map says on average, rad/s.
    pub faster_rad_s: Estimated,
}

/// Samples behind the fit, for figures.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    /// Motor of each.
    pub motor: Vec<usize>,
    /// On the tachometer's clock, s.
    pub time_s: Vec<f64>,
    /// Command that held, command units.
    pub command: Vec<f64>,
    /// V.
    pub battery_v: Vec<f64>,
    /// rad/s.
    pub measured_rad_s: Vec<f64>,
    /// rad/s.
    pub predicted_rad_s: Vec<f64>,
}

/// What a run says.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct StandResult {
    /// Clocks.
    pub clock: StandClock,
    /// Of all motors together.
    pub map: Map,
    /// Each motor, where there are several.
    pub motors: Vec<MotorMap>,
    /// Maps from the simplest to the longest.
    pub maps: Vec<Judged>,
    /// The terms that the data support.
    pub supported: &'static str,
    /// Samples fitted.
    pub samples: usize,
    /// Samples left out as missed pulses.
    pub missed_pulses: usize,
    /// Samples left out because a log has a gap, a rotor stood, or began.
    pub left_out: usize,
    /// Smallest and largest voltage, V.
    pub battery_v: [f64; 2],
    /// For figures.
    #[serde(skip)]
    pub figures: Samples,
}

/// Why a run says nothing.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MotorMapError {
    /// Too little in common.
    #[error(
        "the two logs do not overlap enough: {craft_s:.1} s and {rotor_s:.1} s without gaps; at least {needed_s} s of both are needed"
    )]
    TooShort {
        /// Length of the craft's log, s.
        craft_s: f64,
        /// Length of the tachometer's, s.
        rotor_s: f64,
        /// Needed, s.
        needed_s: f64,
    },
    /// No offset at which the logs look alike.
    #[error(
        "no overlap of the clocks: wherever the logs are laid side by side, commands and voltage explain at most {percent:.0} % of the rotor's speed; are both of the same run and motor?"
    )]
    NoOverlap {
        /// Part explained at best, percent.
        percent: f64,
    },
    /// Several offsets at which they do.
    #[error(
        "the clocks' offset is ambiguous: {first_s:.2} s and {second_s:.2} s fit alike because the commands repeat themselves; add a part that does not (a pause, a sine of another frequency)"
    )]
    Ambiguous {
        /// One offset, s.
        first_s: f64,
        /// The other, s.
        second_s: f64,
    },
    /// The voltage hardly moved.
    #[error(
        "voltage coefficient not excited: vbat goes from {low_v:.2} to {high_v:.2} V, which determines it to +- {error:.0} rad/s/V only; run the battery down from full, or leave the voltage out with --without-voltage"
    )]
    VoltageNotExcited {
        /// Smallest, V.
        low_v: f64,
        /// Largest, V.
        high_v: f64,
        /// rad/s/V.
        error: f64,
    },
    /// The commands do not determine something.
    #[error(
        "the commands do not determine {what}: drive the motor by a saw-tooth and by sines up to several hertz"
    )]
    NotExcited {
        /// What.
        what: String,
    },
    /// A falling map.
    #[error(
        "the rotor turns slower for larger commands ({command:.3} rad/s per unit): are command and rotor of the same motor?"
    )]
    Falling {
        /// rad/s per command unit.
        command: f64,
    },
}

/// Terms of a map besides the constant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Terms {
    Command,
    Voltage,
    Product,
    Quadratic,
}

impl Terms {
    const ALL: [Self; 4] = [Self::Command, Self::Voltage, Self::Product, Self::Quadratic];

    const fn name(self) -> &'static str {
        match self {
            Self::Command => "command",
            Self::Voltage => "command, voltage",
            Self::Product => "command, voltage, command x voltage",
            Self::Quadratic => "command, voltage, command^2",
        }
    }

    /// The map it has one term more than.
    const fn against(self) -> Option<Self> {
        match self {
            Self::Command => None,
            Self::Voltage => Some(Self::Command),
            Self::Product | Self::Quadratic => Some(Self::Voltage),
        }
    }

    fn of(self, command: f64, volts: f64) -> Vec<f64> {
        match self {
            Self::Command => vec![command, 1.0],
            Self::Voltage => vec![command, volts, 1.0],
            Self::Product => vec![command, volts, command * volts, 1.0],
            Self::Quadratic => vec![command, volts, command * command, 1.0],
        }
    }
}

/// What is not linear.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    lag: f64,
    offset_s: f64,
    skew: f64,
}

/// The craft's log without missing values: commands centred and in parts of their range, for numbers near one.
struct Craft {
    t: Vec<f64>,
    /// Of each motor.
    command: Vec<Vec<f64>>,
    volts: Vec<f64>,
    /// From which sample on there is no gap, for each sample.
    since: Vec<usize>,
    longest_s: f64,
}

impl Craft {
    fn new(stand: &Stand) -> Self {
        let whole = |k: &usize| {
            stand.battery_v[*k].is_finite() && stand.motors.iter().all(|m| m.command[*k].is_finite())
        };
        let rows: Vec<usize> = (0..stand.craft_s.len()).filter(whole).collect();
        let pick = |column: &[f64]| -> Vec<f64> { rows.iter().map(|&k| column[k]).collect() };
        let t = pick(&stand.craft_s);
        let period_s = median_step(&t);
        let longest_s = GAP_PERIODS * period_s;
        let mut since = vec![0; t.len()];
        for k in 1..t.len() {
            since[k] = if t[k] - t[k - 1] > longest_s { k } else { since[k - 1] };
        }
        let raw = pick(&stand.battery_v);
        let taps = RegressionFilter::smoothing_taps(period_s, VOLTAGE_WINDOW_S);
        let mut volts = Vec::with_capacity(t.len());
        let mut start = 0;
        while start < t.len() {
            let end = (start..t.len()).find(|&k| since[k] > start).unwrap_or(t.len());
            volts.extend(smoothed(&raw[start..end], &taps));
            start = end;
        }
        let command = stand.motors.iter().map(|m| pick(&m.command)).collect();
        Self { t, command, volts, since, longest_s }
    }

    fn duration_s(&self) -> f64 {
        self.t.last().unwrap_or(&0.0) - self.t.first().unwrap_or(&0.0)
    }

    /// The features of a map at each sample, one vector a term. The battery acts all the while: over a sample, the mean of its
    /// ends.
    fn features(&self, motor: usize, terms: Terms) -> Vec<Vec<f64>> {
        let count = terms.of(0.0, 0.0).len();
        let mut all = vec![Vec::with_capacity(self.t.len()); count];
        for (k, command) in self.command[motor].iter().enumerate() {
            let next = self.volts.get(k + 1).unwrap_or(&self.volts[k]);
            let volts = 0.5 * (self.volts[k] + next);
            all.iter_mut().zip(terms.of(*command, volts)).for_each(|(to, value)| to.push(value));
        }
        all
    }

    /// Sample that holds at a time of the craft's clock, if the log goes on there.
    fn holding(&self, time_s: f64) -> Option<usize> {
        let k = self.t.partition_point(|t| *t <= time_s).checked_sub(1)?;
        let next = *self.t.get(k + 1)?;
        (next - self.t[k] <= self.longest_s).then_some(k)
    }
}

/// A feature after the lag: its value at samples, exact for features held between them.
fn lagged(craft: &Craft, feature: &[f64], lag: f64) -> Vec<f64> {
    let mut now = feature.first().copied().unwrap_or(0.0);
    (0..feature.len())
        .map(|k| {
            if k > 0 && craft.since[k] == k {
                now = feature[k];
            } else if k > 0 {
                let decay = (-lag * (craft.t[k] - craft.t[k - 1])).exp();
                now = feature[k - 1] + (now - feature[k - 1]) * decay;
            }
            now
        })
        .collect()
}

/// A speed that was measured, and when.
#[derive(Debug, Clone, Copy)]
struct Point {
    time_s: f64,
    speed: f64,
}

/// Rows of one motor at a shape.
struct Rows {
    /// Which points they are.
    points: Vec<usize>,
    /// Features after the lag, one vector a term.
    features: Vec<Vec<f64>>,
    /// Their derivatives by the lag.
    by_lag: Vec<Vec<f64>>,
    /// By the time.
    by_time: Vec<Vec<f64>>,
}

fn rows(craft: &Craft, motor: usize, terms: Terms, points: &[Point], shape: Shape, middle_s: f64) -> Rows {
    let features = craft.features(motor, terms);
    let step = 1e-4 * shape.lag;
    let settled_s = SETTLED / shape.lag;
    let at: Vec<(usize, f64, usize)> = points
        .iter()
        .enumerate()
        .filter_map(|(index, p)| {
            let time_s = p.time_s + shape.offset_s + shape.skew * (p.time_s - middle_s);
            let k = craft.holding(time_s)?;
            let begun_s = craft.t[craft.since[k]];
            (time_s - begun_s > settled_s).then_some((k, time_s - craft.t[k], index))
        })
        .collect();
    let read = |feature: &[f64], states: &[f64], lag: f64| -> Vec<f64> {
        at.iter()
            .map(|&(k, since_s, _)| feature[k] + (states[k] - feature[k]) * (-lag * since_s).exp())
            .collect()
    };
    let mut found = Rows {
        points: at.iter().map(|(.., index)| *index).collect(),
        features: Vec::new(),
        by_lag: Vec::new(),
        by_time: Vec::new(),
    };
    for feature in &features {
        let here = read(feature, &lagged(craft, feature, shape.lag), shape.lag);
        let faster = read(feature, &lagged(craft, feature, shape.lag + step), shape.lag + step);
        found.by_lag.push(faster.iter().zip(&here).map(|(b, a)| (b - a) / step).collect());
        found.by_time.push(at.iter().zip(&here).map(|(&(k, ..), a)| shape.lag * (feature[k] - a)).collect());
        found.features.push(here);
    }
    found
}

/// Weighted sums of columns.
fn combined(columns: &[Vec<f64>], weights: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; columns.first().map_or(0, Vec::len)];
    for (column, weight) in columns.iter().zip(weights) {
        sum.iter_mut().zip(column).for_each(|(s, c)| *s += weight * c);
    }
    sum
}

/// A fit of motors that share a map.
#[derive(Debug, Clone)]
struct Fitted {
    coefficients: Vec<Estimated>,
    shape: Shape,
    /// Standard errors of lag, offset, skew.
    errors: [f64; 3],
    rms: f64,
    rows: usize,
}

/// Which parts of the shape are searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Free {
    LagAndClock,
    Lag,
}

struct Problem<'a> {
    craft: &'a Craft,
    /// Points of each motor.
    points: Vec<Vec<Point>>,
    middle_s: f64,
}

impl Problem<'_> {
    /// Gauss and Newton's steps for some motors with one map.
    fn fit(&self, motors: &[usize], terms: Terms, start: Shape, free: Free) -> Result<Fitted, MotorMapError> {
        let mut shape = start;
        let mut coefficients: Vec<f64> = Vec::new();
        for step in 0..MOST_STEPS {
            let (flights, rows) = self.assemble(motors, terms, shape, &coefficients, free);
            if rows < 100 {
                return Err(self.too_short());
            }
            let count = terms.of(0.0, 0.0).len();
            // The first pass knows no coefficients, and so no slopes.
            let unknowns = if step == 0 { count } else { flights[0].columns.len() };
            let solution =
                least_squares::solve(&flights, &vec![None; unknowns]).map_err(|why| unexcited(why, terms))?;
            coefficients = solution.value.rows(0, count).iter().copied().collect();
            if step == 0 {
                continue;
            }
            let by: Vec<f64> = solution.value.rows(count, unknowns - count).iter().copied().collect();
            let error = |k: usize| {
                if k < unknowns { solution.covariance[(k, k)].max(0.0).sqrt() } else { f64::NAN }
            };
            let before = shape;
            shape.lag = (shape.lag + by[0]).clamp(0.6 * shape.lag, 1.6 * shape.lag).clamp(LAGS.0, LAGS.1);
            if free == Free::LagAndClock {
                shape.offset_s += by[1].clamp(-0.1, 0.1);
                shape.skew = (shape.skew + by[2].clamp(-0.005, 0.005)).clamp(-0.1, 0.1);
            }
            let moved = [
                (shape.lag - before.lag).abs() / error(count),
                (shape.offset_s - before.offset_s).abs() / error(count + 1),
                (shape.skew - before.skew).abs() / error(count + 2),
            ];
            let last = moved.iter().all(|m| !(*m > 0.01)) || step + 1 == MOST_STEPS;
            if last {
                let estimates = coefficients.iter().enumerate();
                return Ok(Fitted {
                    coefficients: estimates
                        .map(|(k, &value)| Estimated { value, std_error: error(k) })
                        .collect(),
                    shape,
                    errors: [error(count), error(count + 1), error(count + 2)],
                    rms: solution.sigma[0],
                    rows,
                });
            }
        }
        Err(MotorMapError::NotExcited { what: "the lag and the clocks together".into() })
    }

    fn too_short(&self) -> MotorMapError {
        let rotor_s = self.points.iter().filter_map(|p| Some(p.last()?.time_s - p.first()?.time_s));
        MotorMapError::TooShort {
            craft_s: self.craft.duration_s(),
            rotor_s: rotor_s.fold(0.0, f64::max),
            needed_s: NEEDED_S,
        }
    }

    fn assemble(
        &self,
        motors: &[usize],
        terms: Terms,
        shape: Shape,
        coefficients: &[f64],
        free: Free,
    ) -> (Vec<FlightRows>, usize) {
        let mut total = 0;
        let flights = motors
            .iter()
            .map(|&motor| {
                let points = &self.points[motor];
                let rows = rows(self.craft, motor, terms, points, shape, self.middle_s);
                let times: Vec<f64> = rows.points.iter().map(|&k| points[k].time_s).collect();
                total += times.len();
                let target: Vec<f64> = rows.points.iter().map(|&k| points[k].speed).collect();
                let mut columns = rows.features;
                if !coefficients.is_empty() {
                    columns.push(combined(&rows.by_lag, coefficients));
                    if free == Free::LagAndClock {
                        let by_time = combined(&rows.by_time, coefficients);
                        let late = times.iter().map(|t| t - self.middle_s);
                        let by_skew = by_time.iter().zip(late).map(|(slope, t)| slope * t).collect();
                        columns.push(by_time);
                        columns.push(by_skew);
                    }
                }
                let period_s = median_step(&times).max(1e-4);
                let starts = std::iter::once(0)
                    .chain((1..times.len()).filter(|&k| times[k] - times[k - 1] > 10.0 * period_s))
                    .collect();
                let rest = || vec![0.0; target.len()];
                FlightRows {
                    targets: [target.clone(), rest(), rest(), rest(), rest(), rest()],
                    columns: columns.into_iter().map(|c| [Some(c), None, None, None, None, None]).collect(),
                    starts,
                    period_s,
                }
            })
            .collect();
        (flights, total)
    }

    /// Measured less predicted of one motor: index of the point and residual.
    fn residuals(&self, motor: usize, terms: Terms, fitted: &Fitted) -> Vec<(usize, f64)> {
        let points = &self.points[motor];
        let rows = rows(self.craft, motor, terms, points, fitted.shape, self.middle_s);
        let weights: Vec<f64> = fitted.coefficients.iter().map(|c| c.value).collect();
        let predicted = combined(&rows.features, &weights);
        rows.points.iter().zip(predicted).map(|(&k, p)| (k, points[k].speed - p)).collect()
    }
}

fn unexcited(why: least_squares::Unidentifiable, terms: Terms) -> MotorMapError {
    let names = ["the command's coefficient", "the voltage's coefficient"];
    let constant = terms.of(0.0, 0.0).len() - 1;
    let name = |k: usize| match k {
        k if k < constant.min(2) => names[k].to_owned(),
        k if k == constant => "the map's offset".into(),
        k if k < constant => "the map's third term".into(),
        k => ["the lag", "the clocks' offset", "the clocks' skew"]
            .get(k - constant - 1)
            .unwrap_or(&"the lag")
            .to_string(),
    };
    let what = match why {
        least_squares::Unidentifiable::NotExcited(k) => name(k),
        least_squares::Unidentifiable::Collinear(all) => {
            all.into_iter().map(name).collect::<Vec<_>>().join(" apart from ")
        }
    };
    MotorMapError::NotExcited { what }
}

/// Shortest run, s.
const NEEDED_S: f64 = 5.0;

/// Clocks, map and lag of a run. `with_voltage` fits (4.10), otherwise its voltage is left out.
///
/// # Errors
/// Logs that do not overlap or fit at several offsets, and what the run does not excite.
pub fn motor_map(stand: &Stand, with_voltage: bool) -> Result<StandResult, MotorMapError> {
    let craft = Craft::new(stand);
    let points: Vec<Vec<Point>> =
        stand.motors.iter().map(|m| points_of(&stand.rotor_s, &m.speed_rad_s)).collect();
    let given: usize = stand.motors.iter().map(|m| m.speed_rad_s.len()).sum();
    let span = |p: &Vec<Point>| Some((p.first()?.time_s, p.last()?.time_s));
    let (from, to) = points
        .iter()
        .filter_map(span)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
    let mut problem = Problem { craft: &craft, points, middle_s: 0.5 * (from + to) };
    if !(craft.duration_s() >= NEEDED_S && to - from >= NEEDED_S) {
        return Err(problem.too_short());
    }
    let terms = if with_voltage { Terms::Voltage } else { Terms::Command };
    let (low_v, high_v) = range(&craft.volts);
    if with_voltage && high_v - low_v < LEAST_VOLTS {
        return Err(MotorMapError::VoltageNotExcited { low_v, high_v, error: f64::INFINITY });
    }
    let all: Vec<usize> = (0..problem.points.len()).collect();
    let start = synchronise(&problem, terms)?;
    let mut fitted = problem.fit(&all, terms, start, Free::LagAndClock)?;
    let mut missed_pulses = 0;
    // Twice: what a missed pulse pulls aside hides others.
    for _ in 0..2 {
        missed_pulses += leave_out_missed(&mut problem, terms, &fitted);
        fitted = problem.fit(&all, terms, fitted.shape, Free::LagAndClock)?;
    }
    check(&craft, &problem, &fitted, terms)?;
    let motors = if all.len() > 1 { each_motor(&problem, terms, &fitted, stand)? } else { Vec::new() };
    let maps = compare(&problem, fitted.shape, with_voltage)?;
    let supported = maps.iter().rev().find(|m| m.supported).map_or(Terms::Command.name(), |m| m.terms);
    Ok(StandResult {
        clock: StandClock {
            offset_s: Estimated { value: fitted.shape.offset_s, std_error: fitted.errors[1] },
            skew: Estimated { value: fitted.shape.skew, std_error: fitted.errors[2] },
            middle_s: problem.middle_s,
        },
        map: map_of(&fitted, terms),
        motors,
        maps,
        supported,
        samples: fitted.rows,
        missed_pulses,
        left_out: given - fitted.rows - missed_pulses,
        battery_v: [low_v, high_v],
        figures: figures(&problem, terms, &fitted, stand),
    })
}

/// Speeds that were measured on a rotor that turned.
fn points_of(times: &[f64], speeds: &[f64]) -> Vec<Point> {
    let largest = speeds.iter().copied().filter(|w| w.is_finite()).fold(0.0, f64::max);
    let all = times.iter().zip(speeds).map(|(&time_s, &speed)| Point { time_s, speed });
    all.filter(|p| p.speed > STANDING * largest).collect()
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)))
}

/// The offset of the clocks, to a few hundredths of a second, and the lag that goes with it.
fn synchronise(problem: &Problem<'_>, terms: Terms) -> Result<Shape, MotorMapError> {
    let coarse = Coarse::new(problem);
    let mut peaks = coarse.peaks(0.0);
    if peaks.first().is_none_or(|p| p.explained < GOOD_FIT) {
        peaks.extend(SKEWS.iter().flat_map(|skew| coarse.peaks(*skew)));
        peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
    }
    let best = peaks.iter().map(|p| p.explained).fold(0.0, f64::max);
    if best < LEAST_FIT {
        return Err(MotorMapError::NoOverlap { percent: 100.0 * best });
    }
    let all: Vec<usize> = (0..problem.points.len()).collect();
    let mut found: Vec<Fitted> = Vec::new();
    let mut refused = None;
    for peak in peaks.iter().filter(|p| p.explained > 0.8 * best).take(PEAKS) {
        let start = Shape { lag: FIRST_LAG, offset_s: peak.offset_s, skew: peak.skew };
        match problem.fit(&all, terms, start, Free::LagAndClock) {
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
struct Lay {
    offset_s: f64,
    skew: f64,
    /// Part of the speed's variance that commands and voltage explain.
    explained: f64,
    /// Logarithm of the likelihood ratio.
    score: f64,
}

/// Both logs on one even grid, coarse enough that every offset can be tried.
struct Coarse<'a> {
    problem: &'a Problem<'a>,
    step_s: f64,
    /// First motor's lagged command and voltage from the start of the craft's log on; none in gaps.
    craft: Vec<Option<[f64; 2]>>,
}

impl<'a> Coarse<'a> {
    fn new(problem: &'a Problem<'a>) -> Self {
        let craft = problem.craft;
        let step_s = (craft.duration_s() / COARSE_POINTS).clamp(COARSE_S.0, COARSE_S.1);
        let command = &craft.command[0];
        let states = lagged(craft, command, FIRST_LAG);
        let (low, high) = range(command);
        let middle_v = craft.volts.iter().sum::<f64>() / craft.volts.len() as f64;
        let count = (craft.duration_s() / step_s) as usize;
        let grid = (0..count).map(|i| {
            let k = craft.holding(craft.t[0] + i as f64 * step_s)?;
            Some([(states[k] - low) / (high - low), craft.volts[k] - middle_v])
        });
        Self { problem, step_s, craft: grid.collect() }
    }

    /// The tachometer's first motor on the grid, from its first point on, its clock made faster by `skew`.
    fn rotor(&self, skew: f64) -> Vec<Option<f64>> {
        let points = &self.problem.points[0];
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
    fn peaks(&self, skew: f64) -> Vec<Lay> {
        let rotor = self.rotor(skew);
        let (n, m) = (self.craft.len() as isize, rotor.len() as isize);
        let shorter = n.min(m);
        let points = &self.problem.points[0];
        let first_s = points.first().map_or(0.0, |p| p.time_s);
        let mut all: Vec<Lay> = (-(m - shorter / 2)..=(n - shorter / 2))
            .filter_map(|shift| {
                let (explained, count) = self.explained(&rotor, shift, shorter / 3)?;
                let craft_s = self.problem.craft.t[0] + shift as f64 * self.step_s;
                // At the first point the clocks differ by this; the middle of the run is later.
                let offset_s = craft_s - first_s + skew * (self.problem.middle_s - first_s);
                let score = -0.5 * count * (1.0 - explained).max(1e-9).ln();
                Some(Lay { offset_s, skew, explained, score })
            })
            .collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut best: Vec<Lay> = Vec::new();
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

    /// Part of the rotor's variance that command and voltage explain when its log is laid `shift` steps into the craft's,
    /// and how many points they share.
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

/// Takes points out that are far from everything else; how many.
fn leave_out_missed(problem: &mut Problem<'_>, terms: Terms, fitted: &Fitted) -> usize {
    let mut count = 0;
    for motor in 0..problem.points.len() {
        let residuals = problem.residuals(motor, terms, fitted);
        let mut sizes: Vec<f64> = residuals.iter().map(|(_, e)| e.abs()).collect();
        if sizes.is_empty() {
            continue;
        }
        let middle = sizes.len() / 2;
        // The median size of a normal deviate is 0.6745 of its deviation.
        let deviation = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745;
        let missed: Vec<usize> =
            residuals.iter().filter(|(_, e)| e.abs() > OUTLIER * deviation).map(|(k, _)| *k).collect();
        count += missed.len();
        let mut index = 0;
        let mut next = missed.iter().peekable();
        problem.points[motor].retain(|_| {
            let out = next.peek() == Some(&&index);
            if out {
                next.next();
            }
            index += 1;
            !out
        });
    }
    count
}

fn check(craft: &Craft, problem: &Problem<'_>, fitted: &Fitted, terms: Terms) -> Result<(), MotorMapError> {
    let command = fitted.coefficients[0].value;
    if !(command > 0.0) {
        return Err(MotorMapError::Falling { command });
    }
    let explained = 1.0 - fitted.rms.powi(2) / variance(&problem.points);
    if explained < LEAST_FIT {
        return Err(MotorMapError::NoOverlap { percent: 100.0 * explained.max(0.0) });
    }
    if terms == Terms::Voltage {
        let error = fitted.coefficients[1].std_error;
        let volts = craft.volts.iter().sum::<f64>() / craft.volts.len() as f64;
        if !(error < VOLTAGE_ERROR * mean_speed(&problem.points) / volts) {
            let (low_v, high_v) = range(&craft.volts);
            return Err(MotorMapError::VoltageNotExcited { low_v, high_v, error });
        }
    }
    Ok(())
}

fn mean_speed(points: &[Vec<Point>]) -> f64 {
    let count: usize = points.iter().map(Vec::len).sum();
    points.iter().flatten().map(|p| p.speed).sum::<f64>() / count.max(1) as f64
}

fn variance(points: &[Vec<Point>]) -> f64 {
    let mean = mean_speed(points);
    let count: usize = points.iter().map(Vec::len).sum();
    points.iter().flatten().map(|p| (p.speed - mean).powi(2)).sum::<f64>() / count.max(1) as f64
}

fn map_of(fitted: &Fitted, terms: Terms) -> Map {
    let lag = Estimated { value: fitted.shape.lag, std_error: fitted.errors[0] };
    Map {
        command: fitted.coefficients[0],
        voltage: (terms == Terms::Voltage).then(|| fitted.coefficients[1]),
        offset: fitted.coefficients[fitted.coefficients.len() - 1],
        lag,
        lag_is_known: lag.std_error < LAG_ERROR * lag.value && lag.value < 0.99 * LAGS.1,
        rms_rad_s: fitted.rms,
    }
}

/// Each motor with a map and a lag of its own on the common clock.
fn each_motor(
    problem: &Problem<'_>,
    terms: Terms,
    common: &Fitted,
    stand: &Stand,
) -> Result<Vec<MotorMap>, MotorMapError> {
    (0..problem.points.len())
        .map(|motor| {
            let own = problem.fit(&[motor], terms, common.shape, Free::Lag)?;
            let faster_rad_s = mean_residual(problem, motor, terms, common);
            Ok(MotorMap { motor: stand.motors[motor].number, map: map_of(&own, terms), faster_rad_s })
        })
        .collect()
}

/// Mean of what the common map leaves of a motor, with its error from parts of the run.
fn mean_residual(problem: &Problem<'_>, motor: usize, terms: Terms, common: &Fitted) -> Estimated {
    let residuals = problem.residuals(motor, terms, common);
    let mut parts: std::collections::BTreeMap<i64, (f64, f64)> = std::collections::BTreeMap::new();
    for (k, e) in &residuals {
        let part = parts.entry((problem.points[motor][*k].time_s / PART_S) as i64).or_default();
        *part = (part.0 + e, part.1 + 1.0);
    }
    let means: Vec<f64> = parts.values().map(|(sum, n)| sum / n).collect();
    let count = means.len() as f64;
    let value = means.iter().sum::<f64>() / count;
    let spread = means.iter().map(|m| (m - value).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    Estimated { value, std_error: (spread / count).sqrt() }
}

/// Maps of different length, each fitted to four fifths of the run and judged on the rest, all five ways round.
fn compare(problem: &Problem<'_>, shape: Shape, with_voltage: bool) -> Result<Vec<Judged>, MotorMapError> {
    let kinds: &[Terms] = if with_voltage { &Terms::ALL } else { &Terms::ALL[..1] };
    let mut judged: Vec<(Judged, Vec<f64>)> = Vec::new();
    for &terms in kinds {
        let by_motor: Vec<Rows> = (0..problem.points.len())
            .map(|m| rows(problem.craft, m, terms, &problem.points[m], shape, problem.middle_s))
            .collect();
        let (coefficients, fitted, parts) = held_out(problem, &by_motor)
            .ok_or_else(|| MotorMapError::NotExcited { what: format!("a map of {}", terms.name()) })?;
        let count: f64 = by_motor.iter().map(|r| r.points.len() as f64).sum();
        let (fitted_rad_s, held_out_rad_s) =
            ((fitted / count).sqrt(), (parts.iter().sum::<f64>() / count).sqrt());
        let simpler = terms.against().filter(|_| with_voltage);
        let before = simpler.and_then(|s| judged.iter().find(|(j, _)| j.terms == s.name()));
        let (drop_percent, deviations) = match before {
            None => (None, None),
            Some((_, simple)) => {
                let falls: Vec<f64> = simple.iter().zip(&parts).map(|(a, b)| a - b).collect();
                let count = falls.len() as f64;
                let mean = falls.iter().sum::<f64>() / count;
                let spread = falls.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
                let whole: f64 = simple.iter().sum();
                (
                    Some(100.0 * mean * count / whole),
                    Some(mean / (spread / count).sqrt().max(f64::MIN_POSITIVE)),
                )
            }
        };
        let supported = match (drop_percent, deviations) {
            (Some(drop), Some(deviations)) => drop > SUPPORT_PERCENT && deviations > SUPPORT_DEVIATIONS,
            _ => true,
        };
        judged.push((
            Judged {
                terms: terms.name(),
                coefficients,
                fitted_rad_s,
                held_out_rad_s,
                against: simpler.map(Terms::name),
                drop_percent,
                deviations,
                supported,
            },
            parts,
        ));
    }
    let mut judged: Vec<Judged> = judged.into_iter().map(|(j, _)| j).collect();
    // Of two maps with one term more, the better one.
    if let [_, _, product, quadratic] = judged.as_mut_slice()
        && product.supported
        && quadratic.supported
    {
        let better = product.held_out_rad_s < quadratic.held_out_rad_s;
        (product.supported, quadratic.supported) = (better, !better);
    }
    Ok(judged)
}

/// Coefficients of a fit to everything, its squared error, and the held-out squared error of each part of the run.
fn held_out(problem: &Problem<'_>, by_motor: &[Rows]) -> Option<(Vec<f64>, f64, Vec<f64>)> {
    let width = by_motor.first()?.features.len();
    let mut all: Vec<(i64, Vec<f64>, f64)> = Vec::new();
    for (motor, rows) in by_motor.iter().enumerate() {
        for (i, &k) in rows.points.iter().enumerate() {
            let point = problem.points[motor][k];
            let x = rows.features.iter().map(|f| f[i]).collect();
            all.push(((point.time_s / PART_S).floor() as i64, x, point.speed));
        }
    }
    let scale: Vec<f64> = (0..width)
        .map(|c| (all.iter().map(|(_, x, _)| x[c] * x[c]).sum::<f64>() / all.len() as f64).sqrt().max(1e-300))
        .collect();
    let solve = |leave_out: Option<i64>| -> Option<Vec<f64>> {
        let kept: Vec<_> = all
            .iter()
            .filter(|(part, ..)| leave_out.is_none_or(|fold| part.rem_euclid(FOLDS as i64) != fold))
            .collect();
        let x = nalgebra::DMatrix::from_fn(kept.len(), width, |r, c| kept[r].1[c] / scale[c]);
        let y = nalgebra::DVector::from_fn(kept.len(), |r, _| kept[r].2);
        let qr = x.qr();
        let right = qr.q().tr_mul(&y);
        let solved = qr.r().solve_upper_triangular(&right)?;
        Some(solved.iter().zip(&scale).map(|(v, s)| v / s).collect())
    };
    let error = |x: &[f64], y: f64, c: &[f64]| (y - x.iter().zip(c).map(|(a, b)| a * b).sum::<f64>()).powi(2);
    let whole = solve(None)?;
    let fitted = all.iter().map(|(_, x, y)| error(x, *y, &whole)).sum();
    let folds: Vec<Vec<f64>> = (0..FOLDS as i64).map(|fold| solve(Some(fold))).collect::<Option<_>>()?;
    let mut parts: std::collections::BTreeMap<i64, f64> = std::collections::BTreeMap::new();
    for (part, x, y) in &all {
        let fold = &folds[part.rem_euclid(FOLDS as i64) as usize];
        *parts.entry(*part).or_default() += error(x, *y, fold);
    }
    Some((whole, fitted, parts.into_values().collect()))
}

fn figures(problem: &Problem<'_>, terms: Terms, fitted: &Fitted, stand: &Stand) -> Samples {
    let mut samples = Samples::default();
    for (index, motor) in stand.motors.iter().enumerate() {
        for (k, residual) in problem.residuals(index, terms, fitted) {
            let point = problem.points[index][k];
            let late_s = fitted.shape.offset_s + fitted.shape.skew * (point.time_s - problem.middle_s);
            let Some(row) = problem.craft.holding(point.time_s + late_s) else { continue };
            samples.motor.push(motor.number);
            samples.time_s.push(point.time_s);
            samples.command.push(problem.craft.command[index][row]);
            samples.battery_v.push(problem.craft.volts[row]);
            samples.measured_rad_s.push(point.speed);
            samples.predicted_rad_s.push(point.speed - residual);
        }
    }
    samples
}
