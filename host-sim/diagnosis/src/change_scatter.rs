//! What the flights of a model differ by anyway: how far the estimate of each change scatters between them, and what that
//! makes of the same estimate from new flights.

use model::{ChangeScatter, Effect, Model};
use nalgebra::{DMatrix, DVector};

use crate::change::Change;
use crate::change_fit::{Fitted, fit_alone};
use crate::significance::independent_stretches;
use sysid::prepare::Prepared;

/// Standard errors of the mean of the estimates from a model's own flights beyond which it is not zero, and the fewest flights
/// that tell: three that agree so well by chance are one set in a hundred, by Student's t.
const FAR_FROM_ZERO: f64 = 10.0;
const FEWEST_FOR_A_MEAN: f64 = 3.0;

/// How far each change's estimate scatters between the flights a model was made from: for the model file.
pub(crate) fn scatter(model: &Model, flights: &[&Prepared]) -> Vec<ChangeScatter> {
    let mut result = Vec::new();
    for change in Change::all(model) {
        let names = change.coefficients().into_iter().map(|k| change.effect.info().coefficients[k].name);
        let estimates: Vec<Fitted> =
            flights.iter().filter_map(|flight| fit_alone(model, change, &[flight]).ok()).collect();
        if estimates.len() < 2 {
            continue;
        }
        // Each flight had its part in the model that it is held against; a new one has none.
        let count = estimates.len() as f64;
        let of_a_new_one = count / (count - 1.0);
        for (i, name) in names.enumerate() {
            // About zero, not about the mean: the model is the reference.
            let mean_square = estimates.iter().map(|e| e.values[i] * e.values[i]).sum::<f64>() / count;
            let mean = estimates.iter().map(|e| e.values[i]).sum::<f64>() / count;
            let of_the_mean = ((mean_square - mean * mean) / (count - 1.0)).max(0.0).sqrt();
            result.push(ChangeScatter {
                effect: change.effect.id().into(),
                coefficient: name.into(),
                deviation: of_a_new_one * mean_square.sqrt(),
                mean: (count >= FEWEST_FOR_A_MEAN && mean.abs() > FAR_FROM_ZERO * of_the_mean)
                    .then_some(mean),
            });
        }
    }
    result
}

/// How far the estimate of a coefficient scatters between the flights of a model, where that is known.
pub(crate) fn scatter_of<'a>(model: &'a Model, effect: Effect, name: &str) -> Option<&'a ChangeScatter> {
    model.fit.as_ref()?.scatter.iter().find(|s| s.effect == effect.id() && s.coefficient == name)
}

/// Whether a model says what a change of one motor has to stand out from, where it says anything of the kind: every craft's yaw is trimmed a little
/// differently from day to day. A file of an older version does not know all changes.
pub(crate) fn is_told(model: &Model, change: Change) -> bool {
    let scatter = model.fit.as_ref().map_or(&[][..], |fit| &fit.scatter);
    let is_of_motor = change.effect.info().special.per_rotor > 0;
    !is_of_motor || scatter.is_empty() || scatter.iter().any(|known| known.effect == change.effect.id())
}

/// An estimate of a change beside what the flights of the model differ by.
pub(crate) struct Scattered {
    /// Its covariance with that scatter, about the model. New flights of one day share the trim of that day, so several of them
    /// scatter no less than one.
    pub(crate) total: DMatrix<f64>,
    /// How far it is from what the model's own flights show: from their mean, where that is far from zero.
    pub(crate) from_usual: DVector<f64>,
    /// Covariance of that.
    pub(crate) tested: DMatrix<f64>,
    /// What that is known from. A scatter seen in a few flights is itself uncertain (Welch 1947 and Satterthwaite 1946), as far as
    /// it counts in the combination of the coefficients by which they stand out.
    pub(crate) independent: f64,
}

impl Scattered {
    pub(crate) fn of(model: &Model, change: Change, fitted: &Fitted, flights: &[&Prepared]) -> Self {
        let stretches = independent_stretches(flights);
        let mut all = Self {
            total: fitted.covariance.clone(),
            from_usual: fitted.values.clone(),
            tested: fitted.covariance.clone(),
            independent: stretches,
        };
        let Some(fit) = &model.fit else { return all };
        let count = fit.flights.len().max(2) as f64;
        // Variance between flights of each coefficient, and what it is known from.
        let mut between = vec![(0.0, count); fitted.values.len()];
        for (i, k) in change.coefficients().into_iter().enumerate() {
            let Some(known) = scatter_of(model, change.effect, change.effect.info().coefficients[k].name)
            else {
                continue;
            };
            let about_zero = known.deviation * known.deviation;
            all.total[(i, i)] += about_zero;
            between[i] = match known.mean {
                None => (about_zero, count),
                Some(mean) => {
                    all.from_usual[i] -= mean;
                    (about_mean(about_zero, mean, count), count - 1.0)
                }
            };
            all.tested[(i, i)] += between[i].0;
        }
        all.independent = known_from(&all, &fitted.covariance, &between, stretches);
        all
    }
}

/// Variance of a new flight about the mean of those of a model, from that about zero.
fn about_mean(about_zero: f64, mean: f64, count: f64) -> f64 {
    let of_a_new_one = count / (count - 1.0);
    let mean_square = about_zero / (of_a_new_one * of_a_new_one);
    let between = of_a_new_one * (mean_square - mean * mean).max(0.0);
    between * (1.0 + 1.0 / count)
}

fn known_from(all: &Scattered, noise: &DMatrix<f64>, between: &[(f64, f64)], stretches: f64) -> f64 {
    let fewest = between.iter().map(|b| b.1).fold(stretches, f64::min);
    let Some(cholesky) = all.tested.clone().cholesky() else { return fewest };
    let weights = cholesky.solve(&all.from_usual);
    let of_noise = weights.dot(&(noise * &weights));
    let scattered = weights.iter().zip(between).map(|(w, (variance, known))| (w * w * variance, *known));
    let (mut sum, mut spread) = (of_noise, of_noise * of_noise / stretches);
    for (part, known) in scattered {
        sum += part;
        spread += part * part / known;
    }
    if spread > 0.0 { (sum * sum / spread).min(stretches) } else { stretches }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::change::HEAVIER;
    use crate::testing::{ORDINARY, prepared, truth};

    /// Two flights that had their part in the model: twice the root of the mean square.
    #[test]
    fn the_scatter_is_about_the_model_and_that_of_a_new_flight() {
        let flights = prepared(&truth(), 30..32, 4.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let scatter = scatter(&truth(), &flights);
        let mass = scatter.iter().find(|s| s.effect == "mass-change").unwrap();
        let [a, b]: [f64; 2] = [0, 1].map(|k| fit_alone(&truth(), HEAVIER, &[flights[k]]).unwrap().values[0]);
        assert!((mass.deviation / (2.0 * (0.5 * (a * a + b * b)).sqrt()) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_single_flight_scatters_from_nothing() {
        let flights = prepared(&truth(), 30..31, 4.0, &ORDINARY);
        assert!(scatter(&truth(), &[&flights[0]]).is_empty());
    }

    fn with(effect: Effect, scatters: &[(f64, Option<f64>)], flights: usize) -> Model {
        let mut model = truth();
        let names = effect.info().coefficients.iter().map(|c| c.name.to_owned());
        let scatter = names.zip(scatters).map(|(coefficient, &(deviation, mean))| ChangeScatter {
            effect: effect.id().into(),
            coefficient,
            deviation,
            mean,
        });
        let record = model::FlightRecord {
            name: String::new(),
            sha256: String::new(),
            role: model::FlightRole::Train,
            samples: 1,
            wind_m_s: None,
        };
        model.fit = Some(model::FitRecord {
            scatter: scatter.collect(),
            flights: vec![record; flights],
            ..Default::default()
        });
        model
    }

    fn fitted(values: &[f64], variances: &[f64]) -> Fitted {
        Fitted {
            model: truth(),
            values: DVector::from_column_slice(values),
            covariance: DMatrix::from_diagonal(&DVector::from_column_slice(variances)),
            sigma: [1.0; 6],
            together: Vec::new(),
            law_error: 0.0,
        }
    }

    /// What base flights scatter by adds to the variance of an estimate, and is known from few of them.
    #[test]
    fn the_scatter_of_the_base_flights_adds_to_the_error() {
        let flights = prepared(&truth(), 30..31, 10.0, &ORDINARY);
        let flights = [&flights[0]];
        let found = fitted(&[0.15], &[1e-6]);
        let bare = Scattered::of(&truth(), HEAVIER, &found, &flights);
        assert_eq!(bare.total, found.covariance);
        let model = with(Effect::MassChange, &[(0.3, None)], 0);
        let scattered = Scattered::of(&model, HEAVIER, &found, &flights);
        assert!((scattered.total[(0, 0)] - 1e-6 - 0.09).abs() < 1e-12);
        assert_eq!((&scattered.tested, &scattered.from_usual), (&scattered.total, &found.values));
        // Two flights at least are behind a scatter, next to which the noise is nothing.
        assert!((scattered.independent - 2.0).abs() < 0.1 && bare.independent > scattered.independent);
    }

    /// Four flights of 2 and 4 m/s alternately: mean 3, variance 4/3, of a new one about the mean 5/4 of that; about zero, a mean square of
    /// 10 times 16/9.
    #[test]
    fn what_all_base_flights_show_is_no_change() {
        let flights = prepared(&truth(), 30..31, 10.0, &ORDINARY);
        let model = with(Effect::SteadyWind, &[((160.0_f64 / 9.0).sqrt(), Some(3.0)), (0.0, None)], 4);
        let wind = Change { effect: Effect::SteadyWind, motor: None };
        let scattered = Scattered::of(&model, wind, &fitted(&[3.5, 0.0], &[1e-6; 2]), &[&flights[0]]);
        assert!((scattered.from_usual[0] - 0.5).abs() < 1e-12);
        assert!((scattered.tested[(0, 0)] - 5.0 / 3.0).abs() < 1e-3, "{}", scattered.tested);
        assert!((scattered.total[(0, 0)] - 160.0 / 9.0).abs() < 1e-3, "{}", scattered.total);
    }

    /// A wind from the north whose error is noise alone stands out whatever is known of that from the east.
    #[test]
    fn a_coefficient_that_does_not_stand_out_leaves_the_others_as_certain_as_they_are() {
        let flights = prepared(&truth(), 30..31, 30.0, &ORDINARY);
        let model = with(Effect::SteadyWind, &[(0.0, None), (0.3, None)], 4);
        let wind = Change { effect: Effect::SteadyWind, motor: None };
        let known_from = |north: f64, east: f64| {
            Scattered::of(&model, wind, &fitted(&[north, east], &[0.25, 1e-4]), &[&flights[0]]).independent
        };
        assert!(known_from(12.0, 0.1) > 15.0 && known_from(0.1, 3.0) < 5.0);
    }
}
