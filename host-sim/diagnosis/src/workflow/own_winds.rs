//! Flights that are held against a model, each in a wind of its own.
//!
//! One wind for all of several flights is what `steady-wind` says has changed. Where they were flown on two days, or at two places before
//! a fan, they differ, and then two flights say next to nothing of one wind: what stands for it is a mass, a centre of mass, or a wind
//! that is sure of itself and wrong. So what each flight's wind differs from their mean by is given to the flight, and the change is
//! the mean.

use model::{Axis, Effect, Model};
use nalgebra::Vector3;
use report::number::fixed;
use sysid::fit::linearise::squares_left;
use sysid::fit::weather;
use sysid::{Fault, FaultKind, Prepared, Severity};

use crate::change::Change;
use crate::change_fit::{Fitted, fit_change};
use crate::criteria::LEFT_BY_OWN_WINDS;
use crate::finding::{AxisDrop, Diagnosis, EffectFinding};
use crate::workflow::corrections::prepared;
use crate::workflow::sets::FlightsOfOneKind;

pub(crate) const WIND: Change = Change { effect: Effect::SteadyWind, motor: None };

impl FlightsOfOneKind {
    /// Gives each flight what its wind differs from their mean by, where they do differ, and where the winds explain most of the horizontal
    /// forces that `model` leaves. Whether they do.
    pub(crate) fn find_own_winds(&mut self, model: &Model) -> bool {
        let before = self.squares_of_horizontal_forces(model);
        let found = self
            .in_own_winds(model)
            .is_some_and(|windy| self.squares_of_horizontal_forces(&windy) < LEFT_BY_OWN_WINDS * before);
        if !found {
            self.forget_own_winds();
        }
        found
    }

    /// The model with the mean wind and the drag in it. That the winds differ shows best in one drag. How strong each is shows best in
    /// its own: the same force is a weak wind in one drag and a strong one in another, and all that flights in different winds
    /// have in common of that is wrong for each of them.
    fn in_own_winds(&mut self, model: &Model) -> Option<Model> {
        let about = fit_change(model, WIND, &self.prepared()).ok()?.model;
        if !weather::estimate_about_mean(&mut prepared(&mut self.flights), &about, model) {
            return None;
        }
        let in_one_drag: Vec<Vector3<f64>> =
            self.prepared().iter().map(|flight| flight.wind_ned_m_s).collect();
        self.forget_own_winds();
        let deviations = self.deviations_in_own_drag(model).unwrap_or(in_one_drag);
        for (flight, deviation) in self.flights.iter_mut().zip(deviations) {
            flight.prepared.wind_ned_m_s = deviation;
        }
        Some(fit_change(model, WIND, &self.prepared()).ok()?.model)
    }

    /// What the wind of each flight, fitted to it alone with the drag in it, differs from the mean by. Nothing where a flight alone does
    /// not tell the drag.
    fn deviations_in_own_drag(&self, model: &Model) -> Option<Vec<Vector3<f64>>> {
        let alone = |flight: &&Prepared| {
            let fitted = fit_change(model, WIND, &[flight]).ok().filter(Fitted::knows_its_law)?;
            Some(Vector3::new(fitted.values[0], fitted.values[1], 0.0))
        };
        let winds: Vec<Vector3<f64>> = self.prepared().iter().map(alone).collect::<Option<_>>()?;
        let mean = winds.iter().sum::<Vector3<f64>>() / winds.len() as f64;
        Some(winds.into_iter().map(|wind| wind - mean).collect())
    }

    pub(crate) fn forget_own_winds(&mut self) {
        weather::clear(&mut prepared(&mut self.flights));
    }

    /// Says the wind of each flight: the mean that was found, and what the flight's differs from it by.
    pub(crate) fn tell_own_winds(&mut self, diagnosis: &Diagnosis) {
        let mean = wind_of(diagnosis).map_or([0.0; 2], |finding| {
            let value = |k: usize| finding.coefficients.get(k).map_or(0.0, |c| c.value);
            [value(0), value(1)]
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
            "each has a wind of its own, of which the change is the mean: in m/s, {}",
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
