//! Flights that are held against a model, each in a wind of its own.
//!
//! One wind for all of several flights is what `steady-wind` says has changed. Where they were flown on two days, or at two places before
//! a fan, they differ, and then two flights say next to nothing of one wind: what stands for it is a mass, a centre of mass, or a wind
//! that is sure of itself and wrong. So what each flight's wind differs from their mean by is given to the flight, and the change is
//! the mean.

use model::{Axis, Model, Term};
use nalgebra::Vector3;
use report::number::fixed;
use sysid::fit::linearise::squares_left;
use sysid::fit::weather;
use sysid::{Fault, FaultKind, Prepared, Severity};

use crate::change::WIND;
use crate::change_conclusion::sizes;
use crate::change_fit::{Fitted, fit_change};
use crate::criteria::LEFT_BY_OWN_WINDS;
use crate::finding::{AxisDrop, Diagnosis, EffectFinding};
use crate::workflow::corrections::prepared;
use crate::workflow::sets::FlightsOfOneKind;
use crate::workflow::winds::Winds;

/// The mean of the flights' own winds, m/s north and east.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Mean {
    value: [f64; 2],
    std_error: [f64; 2],
}

impl Mean {
    /// Of winds that were fitted to one flight each, as uncertain as one of these: they miss in the same way.
    fn of(alone: &[Fitted]) -> Self {
        let count = alone.len() as f64;
        let mean = |of: &dyn Fn(&Fitted) -> f64| alone.iter().map(of).sum::<f64>() / count;
        let variance = |fitted: &Fitted, k: usize| {
            fitted.covariance[(k, k)].max(0.0) + (fitted.law_error * fitted.values[k]).powi(2)
        };
        Self {
            value: [0, 1].map(|k| mean(&|fitted| fitted.values[k])),
            std_error: [0, 1].map(|k| mean(&|fitted| variance(fitted, k)).sqrt()),
        }
    }
}

/// Winds of the flights' own that were found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct OwnWinds {
    /// Where each flight alone tells its wind and the drag in it.
    mean: Option<Mean>,
}

impl OwnWinds {
    /// Puts the mean of what each flight tells in the place of one that was fitted to all with one drag: how that follows the airspeed is told
    /// by what the winds differ by, and what is wrong with that comes back many times.
    pub(crate) fn correct(self, diagnosis: &mut Diagnosis) {
        let wind = diagnosis.effects.iter_mut().find(|finding| finding.effect == WIND.effect);
        let Some((mean, wind)) = self.mean.zip(wind) else { return };
        let before = sizes(wind);
        for ((own, value), std_error) in wind.coefficients.iter_mut().zip(mean.value).zip(mean.std_error) {
            (own.value, own.std_error) = (value, std_error);
        }
        // The sentence says it as well, where the wind is the change.
        diagnosis.summary = diagnosis.summary.replacen(&before, &sizes(wind), 1);
    }
}

impl FlightsOfOneKind {
    /// Gives each flight what its wind differs from their mean by, where they do differ, and where the winds explain most of the horizontal
    /// forces that `model` leaves. Nothing where they do not.
    pub(crate) fn find_own_winds(&mut self, model: &Model) -> Option<OwnWinds> {
        let before = self.squares_of_horizontal_forces(model);
        let found = self
            .in_own_winds(model)
            .filter(|(windy, _)| self.squares_of_horizontal_forces(windy) < LEFT_BY_OWN_WINDS * before);
        if found.is_none() {
            self.forget_own_winds();
        }
        found.map(|(_, own)| own)
    }

    /// The model with the mean wind and the drag in it. That the winds differ shows best in one drag. How strong each is shows best in
    /// its own: the same force is a weak wind in one drag and a strong one in another, and all that flights in different winds
    /// have in common of that is wrong for each of them.
    fn in_own_winds(&mut self, model: &Model) -> Option<(Model, OwnWinds)> {
        let about = fit_change(model, WIND, &self.prepared()).ok()?.model;
        if !weather::estimate_about_mean(&mut prepared(&mut self.flights), &about, model) {
            return None;
        }
        let in_one_drag = Winds::of(self.flights.iter());
        self.forget_own_winds();
        let alone = self.each_in_its_own_drag(model);
        let mean = alone.as_deref().map(Mean::of);
        let deviations = alone.zip(mean).map_or(in_one_drag, |(alone, Mean { value: [north, east], .. })| {
            let deviation = |own: &Fitted| Vector3::new(own.values[0] - north, own.values[1] - east, 0.0);
            Winds(alone.iter().map(deviation).collect())
        });
        deviations.blow(self.flights.iter_mut());
        Some((fit_change(model, WIND, &self.prepared()).ok()?.model, OwnWinds { mean }))
    }

    /// The wind of each flight, fitted to it alone with the drag in it. Nothing where a flight alone does not tell the drag.
    fn each_in_its_own_drag(&self, model: &Model) -> Option<Vec<Fitted>> {
        let alone =
            |flight: &&Prepared| fit_change(model, WIND, &[flight]).ok().filter(Fitted::knows_its_law);
        self.prepared().iter().map(alone).collect()
    }

    pub(crate) fn forget_own_winds(&mut self) {
        weather::clear(&mut prepared(&mut self.flights));
    }

    /// Says the wind of each flight: the mean that was found, and what the flight's differs from it by.
    pub(crate) fn tell_own_winds(&mut self, model: &Model, diagnosis: &Diagnosis) {
        let before = model.term(WIND.effect).map_or_else(Vec::new, Term::values);
        let finding = wind_of(diagnosis);
        let mean = [0, 1].map(|k| {
            let change = finding.and_then(|finding| finding.coefficients.get(k)).map_or(0.0, |c| c.value);
            before.get(k).unwrap_or(&0.0) + change
        });
        let winds: Vec<String> = self
            .flights
            .iter()
            .map(|flight| {
                let [north, east] = [0, 1].map(|k| fixed(mean[k] + flight.prepared.wind_ned_m_s[k], 2));
                format!("{} {north} north and {east} east", flight.path.display())
            })
            .collect();
        let sentence = format!(
            "each has a wind of its own, and their mean is the wind that was found: in m/s, {}",
            winds.join(", ")
        );
        self.faults.add("flights", Fault::of_all(FaultKind::WindBetweenFlights, Severity::Warning, sentence));
    }

    fn squares_of_horizontal_forces(&self, model: &Model) -> f64 {
        let of = |flight: &&Prepared| squares_left(flight, model)[..2].iter().sum::<f64>();
        self.prepared().iter().map(of).sum()
    }
}

fn wind_of(diagnosis: &Diagnosis) -> Option<&EffectFinding> {
    diagnosis.effects.iter().find(|finding| finding.effect == WIND.effect)
}

/// Whether the mean of the flights' own winds is a better answer than what was found in one wind: it is the change then, where one wind
/// leaves structure in the horizontal forces, or another change was named and leaves far more of them.
pub(crate) fn is_better(in_own_winds: &Diagnosis, in_one: &Diagnosis) -> bool {
    if in_own_winds.best() != Some(WIND.effect) {
        return false;
    }
    if in_one.best() == Some(WIND.effect) {
        return in_one.unexplained.iter().any(|left| matches!(left.axis, Axis::U | Axis::V));
    }
    let Some((own, one)) = wind_of(in_own_winds).zip(wind_of(in_one)) else { return false };
    let other = in_one.effects.iter().find(|finding| Some(finding.effect) == in_one.best());
    let left_by = |axis: &str, finding: Option<&EffectFinding>| {
        let own = finding.and_then(|finding| finding.axes.get(axis));
        own.map(|drop: &AxisDrop| drop.sse_after).or_else(|| one.axes.get(axis).map(|drop| drop.sse_before))
    };
    let sum = |finding: Option<&EffectFinding>| {
        ["u", "v"].iter().filter_map(|axis| left_by(axis, finding)).sum::<f64>()
    };
    sum(Some(own)) < LEFT_BY_OWN_WINDS * sum(other)
}

#[cfg(test)]
mod tests {
    use model::Effect;
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::conclusion::conclude;
    use crate::dependence::Dependence;
    use crate::finding::{CoefficientFigures, Unexplained};
    use crate::reason::Reason;
    use crate::testing::{loaded, truth};
    use crate::workflow::Reading;

    /// A finding that leaves so much of 100 along u, and of v what it found.
    fn finding(effect: Effect, supported: bool, left_of_u: f64) -> EffectFinding {
        let mut finding = EffectFinding::unsupported(effect, 2, Reason::LikeChance);
        finding.supported = supported;
        finding.axes.insert("u", AxisDrop::new(100.0, left_of_u));
        finding.axes.insert("v", AxisDrop::new(20.0, 20.0));
        finding
    }

    fn left(axis: Axis) -> Unexplained {
        Unexplained { axis, depends_on: Dependence::Past, share_percent: 10.0, p_value: 0.0 }
    }

    fn diagnosis(effects: Vec<EffectFinding>, unexplained: Vec<Unexplained>) -> Diagnosis {
        conclude(effects, unexplained, Vec::new())
    }

    #[test]
    fn where_one_wind_is_the_answer_own_winds_are_if_it_leaves_structure_to_the_sides() {
        let wind = |unexplained| diagnosis(vec![finding(Effect::SteadyWind, true, 10.0)], unexplained);
        let own = wind(Vec::new());
        assert!(is_better(&own, &wind(vec![left(Axis::W), left(Axis::V)])));
        assert!(!is_better(&own, &wind(vec![left(Axis::W), left(Axis::P)])));
        let other = diagnosis(vec![finding(Effect::Tether, true, 10.0)], Vec::new());
        assert!(!is_better(&other, &wind(vec![left(Axis::U)])), "own winds are not the answer");
    }

    /// A cable leaves 80 + 20 of the horizontal forces: own winds stand for it if they leave less than half of that, 29 + 20 and not 31 + 20.
    /// A mass speaks of w alone and leaves these forces as they were in one wind, 100 + 20: less than 60 is enough then.
    #[test]
    fn own_winds_stand_where_they_leave_less_than_half_of_what_another_change_leaves() {
        let one = |other: EffectFinding| {
            diagnosis(vec![other, finding(Effect::SteadyWind, false, 60.0)], Vec::new())
        };
        let own = |left| diagnosis(vec![finding(Effect::SteadyWind, true, left)], Vec::new());
        let cable = one(finding(Effect::Tether, true, 80.0));
        assert!(is_better(&own(29.0), &cable) && !is_better(&own(31.0), &cable));
        let mut mass = finding(Effect::MassChange, true, 0.0);
        mass.axes = [("w", AxisDrop::new(100.0, 1.0))].into();
        let mass = one(mass);
        assert!(is_better(&own(39.0), &mass) && !is_better(&own(41.0), &mass));
    }

    /// North: (0.3^2 + (0.05 * 6)^2 + 0.4^2 + (0.05 * 2)^2) / 2 = 0.175 m^2/s^2. East, the law adds 0.05^2 and nothing: (0.0925 + 0.16) / 2.
    #[test]
    fn the_mean_of_winds_is_as_uncertain_as_one_of_them() {
        let alone = |values: [f64; 2], deviation: f64| Fitted {
            model: truth(),
            values: DVector::from_column_slice(&values),
            covariance: DMatrix::identity(2, 2) * deviation.powi(2),
            sigma: [0.0; 6],
            together: Vec::new(),
            law_error: 0.05,
        };
        let mean = Mean::of(&[alone([-6.0, 1.0], 0.3), alone([-2.0, 0.0], 0.4)]);
        assert_eq!(mean.value, [-4.0, 0.5]);
        let [north, east] = mean.std_error;
        assert!((north - 0.175_f64.sqrt()).abs() < 1e-12 && (east - 0.126_25_f64.sqrt()).abs() < 1e-12);
        let mut wind = finding(Effect::SteadyWind, true, 10.0);
        let figures = |c| CoefficientFigures::new(c, -9.0, 0.1, &truth());
        wind.coefficients = Effect::SteadyWind.info().coefficients.iter().map(figures).collect();
        let said = format!("steady-wind ({}). With it, less is left.", sizes(&wind));
        let mut before = diagnosis(vec![finding(Effect::Tether, true, 5.0), wind], Vec::new());
        before.summary.clone_from(&said);
        let corrected = |own: OwnWinds| {
            let mut diagnosis = before.clone();
            own.correct(&mut diagnosis);
            let wind = wind_of(&diagnosis).unwrap();
            assert!(diagnosis.summary.contains(&sizes(wind)), "{}", diagnosis.summary);
            wind_of(&diagnosis)
                .unwrap()
                .coefficients
                .iter()
                .map(|c| (c.value, c.std_error))
                .collect::<Vec<_>>()
        };
        assert_eq!(corrected(OwnWinds { mean: None }), [(-9.0, 0.1); 2]);
        assert_eq!(corrected(OwnWinds { mean: Some(mean) }), [(-4.0, north), (0.5, east)]);
    }

    #[test]
    fn the_wind_of_each_flight_is_the_mean_and_what_it_differs_by() {
        let vehicle = truth().vehicle;
        let mut held = FlightsOfOneKind::from_loaded(loaded([1, 2]), &vehicle, Reading::default()).unwrap();
        for (flight, north) in held.flights.iter_mut().zip([0.5, -0.5]) {
            flight.prepared.wind_ned_m_s = Vector3::new(north, 0.25, 0.0);
        }
        let mut wind = finding(Effect::SteadyWind, true, 10.0);
        let figures = |(value, c)| CoefficientFigures::new(c, value, 0.1, &truth());
        wind.coefficients =
            [3.0, -1.0].into_iter().zip(Effect::SteadyWind.info().coefficients).map(figures).collect();
        held.tell_own_winds(&truth(), &diagnosis(vec![wind], Vec::new()));
        let told =
            held.faults.listed().iter().find(|l| l.fault.kind == FaultKind::WindBetweenFlights).unwrap();
        assert!(
            told.fault.sentence.ends_with(
                "in m/s, flight-1.csv 3.50 north and -0.75 east, flight-2.csv 2.50 north and -0.75 east"
            ),
            "{}",
            told.fault.sentence
        );
        held.forget_own_winds();
        assert!(held.prepared().iter().all(|flight| flight.wind_ned_m_s == Vector3::zeros()));
    }
}
