//! Model against measurement: where does it fail?
//!
//! Two views, since a good derivative fit can still drift: errors of the six accelerations (per axis, per flight, by
//! condition), and open-loop prediction over 1, 10 and 50 samples from every sample of the flight, with no knowledge
//! of the future except the motor inputs.

use model::{AXES, Axis, AxisError, Effect, Model, PerAxis, Plant, State, frames};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

use crate::filter::RegressionFilter;
use crate::fit::{has_rotation, swing};
use crate::prepare::{Alignment, Prepared, Stretch, smoothed};
use crate::{Residuals, errors, residuals};

/// Longest horizon of the open-loop prediction, samples.
pub const LONGEST_HORIZON: usize = 50;
/// Equal-count bins a condition is cut into.
const BINS: usize = 5;
/// A bin is worth showing when its share of the squared error is this much above its share of the samples, percent.
const NOTABLE_EXCESS_PERCENT: f64 = 5.0;
/// Most bins shown.
const WORST: usize = 12;

/// Window that takes half of the noise and nothing that a rotor does, s.
const BARELY_S: f64 = 0.1;

/// Error of one axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct AxisFigures {
    /// Root mean square of measured minus predicted, m/s^2 or rad/s^2.
    pub rms: f64,
    /// Sum of squares.
    pub sse: f64,
    /// Coefficient of determination.
    pub r2: f64,
}

impl From<AxisError> for AxisFigures {
    fn from(e: AxisError) -> Self {
        Self { rms: e.rms, sse: e.sse, r2: e.r2 }
    }
}

/// One flight.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct FlightComparison {
    /// File name.
    pub name: String,
    /// Rows compared.
    pub samples: usize,
    /// Errors.
    pub axes: PerAxis<AxisFigures>,
    /// What was mended or left out of the flight.
    pub notes: Vec<String>,
    /// Clock of the rotor samples against that of the state.
    pub alignment: Option<Alignment>,
}

/// Mean norm of the open-loop error over all starting samples (attitude: geodesic angle). Of a model without rotation
/// position and velocity are predicted with the logged attitude and rates, and these are not numbers.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct HorizonError {
    /// m.
    pub position_m: f64,
    /// m/s.
    pub velocity_m_s: f64,
    /// rad.
    pub attitude_rad: f64,
    /// rad/s.
    pub rate_rad_s: f64,
}

/// Open-loop errors over the horizons that are reported.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, JsonSchema)]
pub struct Horizons {
    /// One sample ahead.
    #[serde(rename = "1")]
    pub one: HorizonError,
    /// Ten samples ahead.
    #[serde(rename = "10")]
    pub ten: HorizonError,
    /// Fifty samples ahead.
    #[serde(rename = "50")]
    pub fifty: HorizonError,
    /// Sum over every horizon from 1 to 50.
    pub sum_1_50: HorizonError,
}

/// A condition under which an axis fails.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Worst {
    /// Axis.
    pub axis: Axis,
    /// "height 0.14 to 0.36 m".
    pub condition: String,
    /// The quantity by itself: "height".
    pub quantity: &'static str,
    /// Root mean square error under the condition.
    pub rms: f64,
    /// Share of the axis' squared error, percent; the bin holds a fifth of the samples.
    pub share_percent: f64,
}

/// All of a comparison.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Comparison {
    /// Each flight.
    pub flights: Vec<FlightComparison>,
    /// All flights together.
    pub total: PerAxis<AxisFigures>,
    /// Open-loop prediction, all flights together.
    pub horizons: Horizons,
    /// Mean norm of the error at every horizon from 1 to 50 samples, for plots.
    #[serde(skip)]
    pub by_horizon: Vec<HorizonError>,
    /// Where it fails most.
    pub worst: Vec<Worst>,
}

/// Compares a model with flights.
pub fn compare(model: &Model, flights: &[&Prepared]) -> Comparison {
    let all: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, model)).collect();
    let figures = |error: PerAxis<AxisError>| PerAxis::from_fn(|axis| figures_of(model, axis, error[axis]));
    let total = figures(errors(&all));
    let by_horizon = open_loop(model, flights);
    Comparison {
        flights: flights
            .iter()
            .zip(&all)
            .map(|(flight, residuals)| FlightComparison {
                name: flight.name.clone(),
                samples: flight.rows(),
                axes: figures(errors([residuals])),
                notes: flight.notes.clone(),
                alignment: flight.alignment.clone(),
            })
            .collect(),
        total,
        horizons: summary(&by_horizon),
        by_horizon,
        worst: worst(model, flights, &all),
    }
}

/// The sum over every horizon.
pub(crate) fn sum_of_horizons(by_horizon: &[HorizonError]) -> HorizonError {
    let sum = |f: fn(&HorizonError) -> f64| by_horizon.iter().map(f).sum();
    HorizonError {
        position_m: sum(|e| e.position_m),
        velocity_m_s: sum(|e| e.velocity_m_s),
        attitude_rad: sum(|e| e.attitude_rad),
        rate_rad_s: sum(|e| e.rate_rad_s),
    }
}

/// Not a number where the model does not speak of the axis.
fn figures_of(model: &Model, axis: Axis, error: AxisError) -> AxisFigures {
    if axis.index() >= 3 && !has_rotation(model) {
        return AxisFigures { rms: f64::NAN, sse: f64::NAN, r2: f64::NAN };
    }
    error.into()
}

fn summary(by_horizon: &[HorizonError]) -> Horizons {
    let at = |h: usize| by_horizon.get(h - 1).copied().unwrap_or_default();
    Horizons { one: at(1), ten: at(10), fifty: at(50), sum_1_50: sum_of_horizons(by_horizon) }
}

/// Mean open-loop errors at each horizon from 1 to [`LONGEST_HORIZON`] samples.
pub fn open_loop(model: &Model, flights: &[&Prepared]) -> Vec<HorizonError> {
    open_loop_with(model, flights, true)
}

/// The same without the trim that training flights have: as if they had not been flown before.
pub(crate) fn open_loop_without_trim(model: &Model, flights: &[&Prepared]) -> Vec<HorizonError> {
    open_loop_with(model, flights, false)
}

fn open_loop_with(model: &Model, flights: &[&Prepared], with_trim: bool) -> Vec<HorizonError> {
    let plant = Plant::new(model);
    let mut sums = vec![HorizonError::default(); LONGEST_HORIZON];
    let mut starts = 0_u64;
    for flight in flights {
        for stretch in &flight.stretches {
            let trim = flight.trim.as_ref().filter(|_| with_trim).map_or([0.0; 6], |trim| trim.value);
            starts += add_rollouts(&plant, model, flight, stretch, &trim, &mut sums);
        }
    }
    let n = starts.max(1) as f64;
    let turning = if has_rotation(model) { n } else { f64::NAN };
    for sum in &mut sums {
        sum.position_m /= n;
        sum.velocity_m_s /= n;
        sum.attitude_rad /= turning;
        sum.rate_rad_s /= turning;
    }
    sums
}

fn add_rollouts(
    plant: &Plant,
    model: &Model,
    flight: &Prepared,
    stretch: &Stretch,
    trim: &[f64; 6],
    sums: &mut [HorizonError],
) -> u64 {
    let states = reference_states(model, flight, stretch);
    let velocities: Vec<Vector3<f64>> = states.iter().map(velocity_ned_m_s).collect();
    let rotor_mean_rad_s = mean_rotor_speeds(model, flight, stretch);
    let track = Track {
        states: &states,
        rotor_mean_rad_s: &rotor_mean_rad_s,
        battery_v: &stretch.battery_v,
        period_s: flight.period_s,
        turns: has_rotation(model),
    };
    let has_users = model.effects().iter().any(|effect| matches!(effect, Effect::User(_)));
    let mut starts = 0;
    for start in flight.margin..(states.len() - flight.margin).saturating_sub(sums.len()) {
        // A user's formula may have no value where a prediction strays to.
        let mut finite = true;
        if has_users {
            track.roll_out(plant, trim, start, sums.len(), |_, state| finite &= state.is_finite());
        }
        if !finite {
            continue;
        }
        track.roll_out(plant, trim, start, sums.len(), |h, state| {
            let (sum, to) = (&mut sums[h - 1], start + h);
            let measured = &states[to];
            sum.position_m += (state.position_ned_m - measured.position_ned_m).norm();
            sum.velocity_m_s += (velocity_ned_m_s(state) - velocities[to]).norm();
            sum.attitude_rad += frames::geodesic_angle_rad(&state.attitude, &measured.attitude);
            sum.rate_rad_s += (state.rate_rad_s - measured.rate_rad_s).norm();
        });
        starts += 1;
    }
    starts
}

/// Velocity over ground, inertial NED, m/s.
pub(crate) fn velocity_ned_m_s(state: &State) -> Vector3<f64> {
    frames::dcm_from_quaternion(&state.attitude).tr_mul(&state.velocity_m_s)
}

/// A stretch to predict open loop: states by sample, with the rotor speeds that drive the prediction.
pub(crate) struct Track<'a> {
    pub(crate) states: &'a [State],
    /// Mean rotor speeds between neighbouring samples, rad/s.
    pub(crate) rotor_mean_rad_s: &'a [[f64; 4]],
    pub(crate) battery_v: &'a [f64],
    pub(crate) period_s: f64,
    /// Whether the model predicts attitude and rates; the logged ones are taken otherwise.
    pub(crate) turns: bool,
}

impl Track<'_> {
    /// Predicts `samples` from `start` on with nothing but the rotor speeds; `see` is handed each horizon and its state.
    /// `trim`: constant accelerations of the flight, m/s^2 and rad/s^2.
    #[inline]
    pub(crate) fn roll_out(
        &self,
        plant: &Plant,
        trim: &[f64; 6],
        start: usize,
        samples: usize,
        mut see: impl FnMut(usize, &State),
    ) {
        let mut state = self.states[start];
        let push = trim.map(|t| t * self.period_s);
        for h in 1..=samples {
            let (from, to) = (start + h - 1, start + h);
            let (before, after) = (&self.states[from].rotor_rad_s, &self.states[to].rotor_rad_s);
            plant.step_through(
                &mut state,
                [before, &self.rotor_mean_rad_s[from], after],
                self.battery_v[from],
                self.period_s,
            );
            state.velocity_m_s += Vector3::new(push[0], push[1], push[2]);
            state.rate_rad_s += Vector3::new(push[3], push[4], push[5]);
            if !self.turns {
                state.attitude = self.states[to].attitude;
                state.rate_rad_s = self.states[to].rate_rad_s;
            }
            see(h, &state);
        }
    }
}

/// Each rotor's mean speed between neighbouring samples, rad/s.
pub(crate) fn mean_rotor_speeds(model: &Model, flight: &Prepared, stretch: &Stretch) -> Vec<[f64; 4]> {
    let rotor = stretch.rotors(&model.vehicle, &model.adjustments(), flight.period_s, flight.rotor_late_s());
    (1..stretch.time_s.len()).map(|k| std::array::from_fn(|i| rotor[i].mean_rad_s[k - 1])).collect()
}

/// The state at every sample that predictions start from and are judged by: an onboard estimator's as logged, raw
/// tracking smoothed without lag.
pub(crate) fn reference_states(model: &Model, flight: &Prepared, stretch: &Stretch) -> Vec<State> {
    states_of(model, flight, stretch, &flight.filter.smooth)
}

/// The same smoothed over a tenth of a second at most: what is fitted to must not be smoother than the rotors that drive
/// it, and a start with all its noise would be taken for damping.
pub(crate) fn barely_smoothed_states(model: &Model, flight: &Prepared, stretch: &Stretch) -> Vec<State> {
    let taps = RegressionFilter::smoothing_taps(flight.period_s, BARELY_S);
    states_of(model, flight, stretch, &taps)
}

fn states_of(model: &Model, flight: &Prepared, stretch: &Stretch, taps: &[f64]) -> Vec<State> {
    let adjust = model.adjustments();
    let lever = Vector3::from(model.vehicle.tracked_point) + adjust.tracked_point_m();
    let rotor = stretch.rotors(&model.vehicle, &adjust, flight.period_s, flight.rotor_late_s());
    let at = |parts: &[Vec<f64>; 3], k: usize| Vector3::new(parts[0][k], parts[1][k], parts[2][k]);
    let swings = swing::followed(flight, stretch, model);
    let smooth = (!flight.has_logged_velocity).then(|| {
        [&stretch.euler_rad, &stretch.rate_rad_s].map(|s| s.each_ref().map(|one| smoothed(one, taps)))
    });
    (0..stretch.time_s.len())
        .map(|k| {
            let (tracked, rate) = match &smooth {
                None => (stretch.dcm[k], at(&stretch.rate_rad_s, k)),
                Some([euler, rate]) => (frames::dcm_from_euler(at(euler, k)), at(rate, k)),
            };
            let dcm = adjust.true_dcm(&tracked);
            State {
                position_ned_m: at(&stretch.position_ned_m, k) - dcm.tr_mul(&lever),
                attitude: frames::quaternion_from_euler(frames::euler_from_dcm(&dcm)),
                velocity_m_s: dcm * at(&stretch.velocity_ned_m_s, k) - rate.cross(&lever),
                rate_rad_s: rate,
                rotor_rad_s: std::array::from_fn(|i| rotor[i].speed_rad_s[k]),
                pendulum: swings.get(k).copied().unwrap_or_default(),
            }
        })
        .collect()
}

/// Bins of the conditions in which an axis has more than its share of the squared error.
fn worst(model: &Model, flights: &[&Prepared], all: &[Residuals]) -> Vec<Worst> {
    let adjust = model.adjustments();
    let conditions: Vec<_> = flights.iter().map(|f| f.conditions(&model.vehicle, &adjust).all()).collect();
    let mut found: Vec<(f64, Worst)> = Vec::new();
    let count = conditions.first().map_or(0, Vec::len);
    for axis in AXES {
        for index in 0..count {
            let mut points: Vec<(f64, f64)> = conditions
                .iter()
                .zip(all)
                .flat_map(|(c, r)| {
                    c[index].values.iter().copied().zip(r.residual[axis.index()].iter().copied())
                })
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let total: f64 = points.iter().map(|(_, e)| e * e).sum();
            if points.len() < 10 * BINS || total <= 0.0 {
                continue;
            }
            let bin = points.chunks(points.len().div_ceil(BINS)).max_by(|a, b| {
                let mean =
                    |chunk: &[(f64, f64)]| chunk.iter().map(|(_, e)| e * e).sum::<f64>() / chunk.len() as f64;
                mean(a).total_cmp(&mean(b))
            });
            let Some(bin) = bin else { continue };
            let sse: f64 = bin.iter().map(|(_, e)| e * e).sum();
            let share_percent = 100.0 * sse / total;
            let excess = share_percent - 100.0 * bin.len() as f64 / points.len() as f64;
            if excess > NOTABLE_EXCESS_PERCENT {
                let info = &conditions[0][index];
                let (low, high) = (bin[0].0, bin[bin.len() - 1].0);
                found.push((
                    excess,
                    Worst {
                        axis,
                        condition: format!("{} {low:.2} to {high:.2} {}", info.name, info.unit),
                        quantity: info.name,
                        rms: (sse / bin.len() as f64).sqrt(),
                        share_percent,
                    },
                ));
            }
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found.truncate(WORST);
    found.into_iter().map(|(_, worst)| worst).collect()
}
