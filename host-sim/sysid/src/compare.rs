//! Model against measurement: where does it fail?
//!
//! Two views, since a good derivative fit can still drift: errors of the six accelerations (per axis, per flight, by
//! condition), and open-loop prediction over 1, 10 and 50 samples from every sample of the flight, with no knowledge
//! of the future except the motor inputs.

use model::{AXES, Axis, AxisError, Model, PerAxis};
use schemars::JsonSchema;
use serde::Serialize;

use crate::fit::has_rotation;
pub use crate::fit::open_loop::{Ahead, HorizonError, LONGEST_HORIZON, open_loop, predict_ahead};
use crate::fit::open_loop::{open_loop_of_cleaned, sum_of_horizons};
use crate::prepare::{Alignment, Prepared};
use crate::{Residuals, errors, residuals};

/// Equal-count bins a condition is cut into.
const BINS: usize = 5;
/// A bin is worth showing when its share of the squared error is this much above its share of the samples, percent.
const NOTABLE_EXCESS_PERCENT: f64 = 5.0;
/// Most bins shown.
const WORST: usize = 12;

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
    /// Open-loop prediction, all flights together, against the samples as logged.
    pub horizons: Horizons,
    /// The same against the samples without the outliers that preparation takes out, where there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub horizons_cleaned: Option<Horizons>,
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
        horizons_cleaned: open_loop_of_cleaned(model, flights).map(|by_horizon| summary(&by_horizon)),
        by_horizon,
        worst: worst(model, flights, &all),
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

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::testing::{NONE, fly, prepared, truth};

    fn error(value: f64) -> HorizonError {
        HorizonError { position_m: value, velocity_m_s: 2.0 * value, attitude_rad: 0.0, rate_rad_s: 0.0 }
    }

    #[test]
    fn the_first_tenth_and_fiftieth_horizon_are_reported_with_the_sum_of_all() {
        let all: Vec<HorizonError> = (1..=50).map(|h| error(f64::from(h))).collect();
        let summary = summary(&all);
        assert_eq!((summary.one, summary.ten, summary.fifty), (error(1.0), error(10.0), error(50.0)));
        assert_eq!(summary.sum_1_50, error(1275.0));
        assert_eq!(super::summary(&[]), Horizons::default());
    }

    #[test]
    fn of_axes_that_a_model_does_not_speak_of_there_are_no_figures() {
        let figures = AxisError { sse: 2.0, rms: 1.0, r2: 0.5, samples: 2 };
        let mut forces_only = truth();
        forces_only.terms.retain(|term| term.effect == Effect::Thrust);
        assert!(figures_of(&forces_only, Axis::Q, figures).rms.is_nan());
        assert_eq!(figures_of(&forces_only, Axis::W, figures).rms, 1.0);
        assert_eq!(figures_of(&truth(), Axis::Q, figures).r2, 0.5);
    }

    /// The craft climbs by 1 mm a sample; the model is wrong by 1 m/s^2 sideways in the lower half.
    #[test]
    fn the_condition_under_which_an_axis_fails_is_named_with_its_range_and_share() {
        let flight = prepared(560, |t, row| row.position_ned_m[2] = -0.1 * t);
        let rows = flight.rows();
        assert_eq!(rows, 500);
        let residual = std::array::from_fn(|_| vec![0.0; rows]);
        let mut residuals = Residuals { residual, ..Residuals::default() };
        residuals.residual[1][..100].fill(1.0);
        let worst = worst(&truth(), &[&flight], &[residuals]);
        assert!(worst.iter().all(|w| w.axis == Axis::V), "{worst:?}");
        let height = worst.iter().find(|w| w.quantity == "height").unwrap();
        // Rows start 30 samples into the flight.
        assert_eq!(height.condition, "height 0.03 to 0.13 m");
        assert!((height.share_percent - 100.0).abs() < 1e-9 && (height.rms - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_even_error_fails_nowhere_in_particular() {
        let flight = prepared(560, |t, row| row.position_ned_m[2] = -0.1 * t);
        let residual = std::array::from_fn(|_| vec![0.3; flight.rows()]);
        let even = Residuals { residual, ..Residuals::default() };
        assert_eq!(worst(&truth(), &[&flight], &[even]), []);
        assert_eq!(worst(&truth(), &[], &[]), []);
    }

    #[test]
    fn the_true_model_explains_its_flights_and_a_weaker_one_less() {
        let model = truth();
        let flights =
            [1, 2].map(|seed| Prepared::new(&fly(&model, seed, 8.0, &NONE), &model.vehicle).unwrap());
        let flights: Vec<&Prepared> = flights.iter().collect();
        let mut weaker = model.clone();
        weaker.set(Effect::LinearDrag, &[0.0; 3]);
        let (right, wrong) = (compare(&model, &flights), compare(&weaker, &flights));
        for axis in AXES {
            assert!(right.total[axis].r2 > 0.95, "{axis}: {:?}", right.total[axis]);
        }
        assert!(wrong.total.u.rms > 3.0 * right.total.u.rms);
        assert_eq!(wrong.total.p, right.total.p);
        let squares: f64 = right.flights.iter().map(|f| f.axes.u.sse).sum();
        assert!((squares / right.total.u.sse - 1.0).abs() < 1e-12);
        assert_eq!(right.flights[1].name, "flight-2.csv");
        assert!(right.by_horizon.windows(2).all(|w| w[0].position_m <= w[1].position_m));
    }
}
