//! The wind of each flight.
//!
//! A wind that blows in all flights is the model's (`steady-wind`), and a craft that is pushed all the time may be pushed by
//! something else. One that differs from flight to flight belongs to the flights: left in, it is structure that no effect of the craft
//! explains. It is estimated by each flight alone, about a model of drag, and beside the wind of that model. Where the flights differ,
//! their mean is no wind of its own either: each gets all of its own.
//!
//! The drag must not come from flights that are taken for flights in one wind: what tells it is how the force follows the speed
//! within each flight. So it is fitted beside a constant push of each flight, north and east ([`beside_pushes`]).

use model::{Axis, Effect, LagId, Model, Sample, Sink};
use nalgebra::{DVector, Matrix2, Vector2, Vector3};

use crate::fit::least_squares::{self, FlightRows};
use crate::fit::linearise::About;
use crate::fit::swing::Known;
use crate::fit::terms::{LinearEffects, Terms, coefficient_count};
use crate::prepare::Prepared;
use crate::statistics::squares_p_value;

/// Largest p-value of "the flights have one wind".
const DIFFERENT: f64 = 1e-6;
/// Smallest root mean square of the deviations that counts, m/s: less is the trim of a tracker.
const LEAST_M_S: f64 = 0.2;
/// Standard errors from zero of the drag along both axes without which a push tells no wind.
const DETERMINED: f64 = 2.0;
/// Steps to the wind, with drag that grows with the airspeed.
const STEPS: usize = 3;
/// Independent stretches of a flight that its wind is known from, at least.
const INDEPENDENT: f64 = 10.0;

/// Gives each of the flights its own wind about `model`, where they differ; takes it from them where they do not. Whether they do;
/// nothing where these flights do not tell.
pub fn estimate(flights: &mut [&mut Prepared], model: &Model) -> Option<bool> {
    let winds = winds_of(flights, model, model)?;
    let differ = winds.differ();
    if differ {
        give(flights, winds.0.iter().map(|wind| wind.value));
    }
    Some(differ)
}

/// Gives each of the flights what its wind differs from the mean of all by, about `model`, which has that mean or none. The axes along
/// which drag is known are those of `known`, the model of other flights that they are held against. Whether they differ; where they
/// do not, no flight has a wind of its own.
pub fn estimate_about_mean(flights: &mut [&mut Prepared], model: &Model, known: &Model) -> bool {
    let Some(winds) = winds_of(flights, model, known).filter(Winds::differ) else { return false };
    let mean = winds.mean();
    give(flights, winds.0.iter().map(|wind| wind.value - mean));
    true
}

/// Takes the flights' own winds from them, and says those that they should have; nothing where these are not known.
fn winds_of(flights: &mut [&mut Prepared], model: &Model, known: &Model) -> Option<Winds> {
    clear(flights);
    if flights.len() < 2 || flights.iter().any(|flight| !flight.has_position) {
        return None;
    }
    let model = with_known_drag(model, known)?;
    flights.iter().map(|flight| Wind::of(flight, &model)).collect::<Option<_>>().map(Winds)
}

fn give(flights: &mut [&mut Prepared], winds: impl Iterator<Item = Vector2<f64>>) {
    for (flight, wind) in flights.iter_mut().zip(winds) {
        flight.wind_ned_m_s = Vector3::new(wind.x, wind.y, 0.0);
    }
}

/// The winds of several flights.
struct Winds(Vec<Wind>);

impl Winds {
    fn mean(&self) -> Vector2<f64> {
        self.0.iter().map(|wind| wind.value).sum::<Vector2<f64>>() / self.0.len() as f64
    }

    /// Whether they differ, by more than chance and by more than a trim.
    fn differ(&self) -> bool {
        let (mean, count) = (self.mean(), self.0.len() as f64);
        let deviations: Vec<Vector2<f64>> = self.0.iter().map(|wind| wind.value - mean).collect();
        let squares = |(wind, d): (&Wind, &Vector2<f64>)| Some(d.dot(&(wind.covariance.try_inverse()? * d)));
        let Some(squares) = self.0.iter().zip(&deviations).map(squares).sum::<Option<f64>>() else {
            return false;
        };
        let spread_m_s = (deviations.iter().map(Vector2::norm_squared).sum::<f64>() / count).sqrt();
        let p_value = squares_p_value(squares, 2 * (self.0.len() - 1), INDEPENDENT * count);
        p_value <= DIFFERENT && spread_m_s >= LEAST_M_S
    }
}

/// Takes the flights' own winds from them.
pub fn clear(flights: &mut [&mut Prepared]) {
    flights.iter_mut().for_each(|flight| flight.wind_ned_m_s = Vector3::zeros());
}

/// A model whose linear effects on the forces are fitted to flights of which each is pushed, north and east, by a constant force of its
/// own. Nothing where the flights do not determine them.
pub fn beside_pushes(flights: &[&Prepared], model: &Model) -> Option<Model> {
    let is_force = |axis: &Axis| matches!(axis, Axis::U | Axis::V | Axis::W);
    let linear: Vec<Effect> =
        model.effects().into_iter().filter(|effect| effect.info().axes.iter().any(is_force)).collect();
    let effects = LinearEffects::new(&linear);
    let count = effects.count;
    let terms = |flight| Pushed { effects: LinearEffects::new(&linear), flight, flights: flights.len() };
    let rows = |(index, flight): (usize, &&Prepared)| {
        let targets = flight.targets(&model.vehicle, &model.adjustments(), flight.fit_stride());
        flight.rows_of_fit(targets, flight.columns_of_terms(&terms(index), model))
    };
    let rows: Vec<FlightRows> = flights.iter().enumerate().map(rows).collect();
    let solution = least_squares::solve(&rows, &vec![None; count + 2 * flights.len()]).ok()?;
    let errors = solution.covariance.diagonal();
    let mut estimates = (0..count).map(|k| (solution.value[k], errors[k].max(0.0).sqrt()));
    let mut fitted = model.clone();
    for term in linear.iter().filter(|effect| coefficient_count(**effect) > 0) {
        let term = fitted.terms.iter_mut().find(|own| own.effect == *term)?;
        for (coefficient, (value, error)) in term.coefficients.iter_mut().zip(&mut estimates) {
            (coefficient.value, coefficient.std_error) = (value, Some(error));
        }
    }
    Some(fitted)
}

/// Linear effects, and a push of each flight, north and east, of which a flight has its own only.
struct Pushed {
    effects: LinearEffects,
    flight: usize,
    flights: usize,
}

impl Terms for Pushed {
    fn count(&self) -> usize {
        self.effects.count + 2 * self.flights
    }

    fn lags(&self) -> Vec<LagId> {
        self.effects.lags()
    }

    fn evaluate(&self, sample: &Sample, sink: &mut impl Sink) {
        self.effects.evaluate(sample, sink);
        for direction in 0..2 {
            let push = sample.input.dcm.column(direction);
            let own = self.effects.count + 2 * self.flight + direction;
            for (axis, value) in [Axis::U, Axis::V, Axis::W].into_iter().zip(push.iter()) {
                sink.add(axis, own, *value);
            }
        }
    }
}

/// A model with a drag that a push tells a wind by. Along an axis on which the flights of the model `known` do not show it, it is taken
/// to be as along the other; nothing where they show it on neither.
fn with_known_drag(model: &Model, known: &Model) -> Option<Model> {
    let (drag, shown) = (model.term(Effect::LinearDrag)?, known.term(Effect::LinearDrag)?);
    let known = |axis: usize| {
        let c = shown.coefficients[axis];
        let is_known = c.std_error.is_some_and(|error| -c.value > DETERMINED * error);
        is_known.then_some(drag.coefficients[axis])
    };
    let along = [known(0), known(1)];
    let mut model = model.clone();
    let drag = model.terms.iter_mut().find(|term| term.effect == Effect::LinearDrag)?;
    for (axis, coefficient) in drag.coefficients[..2].iter_mut().enumerate() {
        *coefficient = along[axis].or(along[1 - axis])?;
    }
    Some(model)
}

/// The wind of a flight by itself, north and east.
struct Wind {
    value: Vector2<f64>,
    covariance: Matrix2<f64>,
}

impl Wind {
    fn of(flight: &Prepared, model: &Model) -> Option<Self> {
        let mut windy = model.clone();
        let common = model.term(Effect::SteadyWind).map_or_else(|| vec![0.0; 2], |term| term.values());
        let common = Vector2::new(common[0], common[1]);
        let mut value = common;
        let mut covariance = Matrix2::zeros();
        for _ in 0..STEPS {
            windy.set(Effect::SteadyWind, value.as_slice());
            let about = About::new(
                flight,
                &windy,
                (&[], &[Effect::SteadyWind]),
                flight.fit_stride(),
                &Known::default(),
            );
            let rows = flight.rows_of_fit(about.residuals.residual, about.columns);
            let solution = least_squares::solve(&[rows], &[None; 2]).ok()?;
            let step: &DVector<f64> = &solution.value;
            value += Vector2::new(step[0], step[1]);
            covariance = solution.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        }
        value.iter().all(|v| v.is_finite()).then_some(Self { value: value - common, covariance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// Flights of the true craft in winds, north.
    fn flown(winds_m_s: &[f64]) -> Vec<Prepared> {
        let one = |(seed, wind): (usize, &f64)| {
            let mut model = truth();
            model.set(Effect::SteadyWind, &[*wind, 0.3]);
            Prepared::new(&fly(&model, seed as u64 + 1, 12.0, &NONE), &model.vehicle).unwrap()
        };
        winds_m_s.iter().enumerate().map(one).collect()
    }

    /// The true craft with what a fit knows of its drag.
    fn known() -> Model {
        let mut model = truth();
        let drag = model.terms.iter_mut().find(|term| term.effect == Effect::LinearDrag).unwrap();
        drag.coefficients.iter_mut().for_each(|c| c.std_error = Some(0.01 * c.value.abs()));
        model
    }

    fn estimated(flights: &mut [Prepared], model: &Model) -> Option<bool> {
        estimate(&mut flights.iter_mut().collect::<Vec<_>>(), model)
    }

    #[test]
    fn each_flight_gets_its_own_wind() {
        let mut flights = flown(&[1.0, -0.5, -0.5]);
        assert_eq!(estimated(&mut flights, &known()), Some(true));
        for (flight, expected) in flights.iter().zip([1.0, -0.5, -0.5]) {
            let wind = flight.wind_ned_m_s;
            assert!((wind.x - expected).abs() < 0.1 && (wind.y - 0.3).abs() < 0.1 && wind.z == 0.0, "{wind}");
        }
    }

    /// A fit that takes the flights for flights in one wind gets another drag.
    #[test]
    fn the_drag_beside_pushes_is_the_crafts() {
        let flights = flown(&[0.0, -4.0, -8.0]);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let drag = |model: &Model| {
            let c = &model.term(Effect::LinearDrag).unwrap().coefficients;
            [c[0], c[1]]
        };
        let [real, _] = drag(&truth()).map(|c| c.value);
        let together = crate::fit(&flights, &truth().vehicle, &truth().effects(), None).unwrap().model;
        let [off, _] = drag(&together).map(|c| c.value);
        let [forward, sideward] = drag(&beside_pushes(&flights, &together).unwrap());
        for found in [forward, sideward] {
            assert!((found.value / real - 1.0).abs() < 0.1, "{} of {real} N s/m", found.value);
            assert!(found.std_error.unwrap() < 0.1 * -real);
        }
        assert!((off / real - 1.0).abs() > 0.2, "{off} of {real} N s/m");
    }

    /// Along an axis that no flight excites the drag is as along the other.
    #[test]
    fn a_drag_that_is_known_along_one_axis_tells_the_wind() {
        let mut model = known();
        let drag = model.terms.iter_mut().find(|term| term.effect == Effect::LinearDrag).unwrap();
        let forward = drag.coefficients[0].value;
        (drag.coefficients[1].value, drag.coefficients[1].std_error) =
            (0.1 * forward, Some(0.1 * forward.abs()));
        let taken = with_known_drag(&model, &model).unwrap();
        assert_eq!(taken.term(Effect::LinearDrag).unwrap().coefficients[1].value, forward);
        model.terms.retain(|term| term.effect != Effect::LinearDrag);
        assert!(with_known_drag(&model, &model).is_none());
    }

    #[test]
    fn a_wind_that_all_have_and_drag_that_is_not_known_give_none() {
        let mut alike = flown(&[1.0, 1.0]);
        assert_eq!(estimated(&mut alike, &known()), Some(false));
        assert_eq!(alike[0].wind_ned_m_s, Vector3::zeros());
        assert_eq!(estimated(&mut flown(&[1.0, -1.0]), &truth()), None);
        assert_eq!(estimated(&mut flown(&[1.0]), &known()), None);
    }

    /// Winds of -4 and 2 m/s: about the mean of -1, each has what it differs from that by.
    #[test]
    fn about_their_mean_flights_have_what_they_differ_by() {
        let mut flights = flown(&[-4.0, 2.0]);
        let mut about = known();
        about.set(Effect::SteadyWind, &[-1.0, 0.3]);
        assert!(estimate_about_mean(&mut flights.iter_mut().collect::<Vec<_>>(), &about, &known()));
        for (flight, expected) in flights.iter().zip([-3.0, 3.0]) {
            let wind = flight.wind_ned_m_s;
            assert!((wind.x - expected).abs() < 0.1 && wind.y.abs() < 0.1, "{wind}");
        }
    }
}
