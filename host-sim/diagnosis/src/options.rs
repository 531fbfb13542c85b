//! What a diagnosis considers.

use model::{Effect, Model};
use sysid::{Prepared, has_rotation, rotors_differ, without_rotation};

use crate::change::Change;
use crate::change_scatter::is_told;
use crate::{not_logged, wander};

/// Periods of slow logs, s, slower than 80 and than 40 Hz: loops of craft command at 100 Hz and more, and their rotors answer within 20 to
/// 50 ms.
pub(crate) const SLOW_S: f64 = 0.0125;
pub(crate) const SLOWER_S: f64 = 0.025;

/// Whether an effect shows in quantities of a kind.
fn shows_in(effect: &Effect, kind: &str) -> bool {
    effect.info().through.iter().any(|name| name.ends_with(kind))
}

/// What to diagnose with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// Effects that are treated as if nobody knew them.
    pub without: Vec<Effect>,
}

impl Options {
    /// The same without the effects that show in accelerations: those that commands between the logged ones make look alike.
    pub(crate) fn without_quick(&self) -> Self {
        let mut without = self.without.clone();
        without.extend(Effect::candidates().filter(|effect| shows_in(effect, "acceleration")));
        Self { without }
    }

    /// What could be missing from a model. One without rotation lacks none of the rotation's alone.
    pub(crate) fn candidates(&self, model: &Model) -> Vec<Effect> {
        let missing = |e: &Effect| !model.has(*e) && !self.without.contains(e);
        let all: Vec<Effect> = Effect::candidates().filter(missing).collect();
        if has_rotation(model) { all } else { without_rotation(&all) }
    }

    /// What could be missing from a model, by these flights. A dead time cannot be told from what interpolation does to a log, nor how
    /// rotors speed up from what was commanded between the rows of a slow one; of a slower one, nothing that shows in accelerations. Nor can
    /// what shows in columns that were not logged, what a wind that wanders looks like, or a wind of all flights where each has its own.
    /// Rotors of unequal thrust show in roll and in pitch before they show in the lift: where they do not, something else is in the lift.
    pub(crate) fn candidates_by(&self, model: &Model, flights: &[&Prepared]) -> Vec<Effect> {
        let period_s = flights.iter().map(|flight| flight.period_s).fold(0.0, f64::max);
        let interpolated = flights.iter().any(|flight| flight.is_interpolated);
        let has_own_winds = flights.iter().any(|flight| flight.has_own_wind());
        let is_told = |effect: &Effect| {
            !(interpolated && *effect == Effect::InputDelay
                || period_s > SLOW_S && shows_in(effect, "rotor_acceleration")
                || period_s > SLOWER_S && shows_in(effect, "acceleration")
                || not_logged::hide(flights, *effect)
                || has_own_winds && *effect == Effect::SteadyWind
                || *effect == Effect::UnequalThrust && !rotors_differ(model, flights)
                || wander::looks_like(flights, model, *effect))
        };
        self.candidates(model).into_iter().filter(is_told).collect()
    }

    /// What could be missing from a model, and `effect`, which is asked about.
    pub(crate) fn candidates_with(&self, effect: Effect, model: &Model) -> Vec<Effect> {
        let mut candidates = self.candidates(model);
        if !candidates.contains(&effect) {
            candidates.push(effect);
        }
        candidates
    }

    /// What can have changed since a model was good, and stands out from what the model's flights differ by, where it says that.
    pub(crate) fn changes(&self, model: &Model) -> Vec<Change> {
        self.not_left_out(model).filter(|change| is_told(model, *change)).collect()
    }

    /// Changes that are not tried, because a model does not say what they must stand out from.
    pub fn untold_changes(&self, model: &Model) -> Vec<Effect> {
        let untold = self.not_left_out(model).filter(|change| !is_told(model, *change));
        let mut untold: Vec<Effect> = untold.map(|change| change.effect).collect();
        untold.dedup();
        untold
    }

    fn not_left_out(&self, model: &Model) -> impl Iterator<Item = Change> {
        Change::all(model).into_iter().filter(|change| !self.without.contains(&change.effect))
    }

    /// What can have changed since a model was good, and `effect`, which is asked about.
    pub(crate) fn changes_with(&self, effect: Effect, model: &Model) -> Vec<Change> {
        let is_candidate =
            |change: &Change| change.effect == effect || !self.without.contains(&change.effect);
        Change::all(model).into_iter().filter(is_candidate).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_that_are_left_out_are_not_counted() {
        let model = Model::thesis();
        let all = Options::default().changes(&model);
        let options = Options { without: vec![Effect::MotorEfficiency] };
        let fewer = options.changes(&model);
        assert_eq!(fewer.len() + 4, all.len(), "one for each motor");
        assert!(fewer.iter().all(|change| change.effect != Effect::MotorEfficiency));
        assert_eq!(options.changes_with(Effect::MotorEfficiency, &model), all);
    }

    #[test]
    fn slow_logs_tell_nothing_of_rotors_and_slower_ones_nothing_of_accelerations() {
        let flights =
            crate::testing::prepared(&crate::testing::truth(), 1..2, 4.0, &crate::testing::ORDINARY);
        let at = |rate_hz: f64| {
            let flight = Prepared { period_s: 1.0 / rate_hz, ..flights[0].clone() };
            let told = Options::default().candidates_by(&Model::thesis(), &[&flight]);
            [Effect::MotorLag, Effect::TrackingOffset, Effect::SteadyWind].map(|e| told.contains(&e))
        };
        assert_eq!(at(100.0), [true; 3]);
        assert_eq!(at(50.0), [false, true, true]);
        assert_eq!(at(25.0), [false, false, true]);
    }

    #[test]
    fn what_shows_in_accelerations_is_quick() {
        let quick = Options::default().without_quick().without;
        assert!(quick.contains(&Effect::TrackingOffset) && quick.contains(&Effect::MotorLag), "{quick:?}");
        assert!(!quick.contains(&Effect::GroundEffect) && !quick.contains(&Effect::SteadyWind), "{quick:?}");
    }

    #[test]
    fn candidates_are_neither_in_the_model_nor_left_out_nor_of_a_rotation_that_it_lacks() {
        let mut model = Model::thesis();
        model.set(Effect::Tether, &[0.0; 4]);
        let all = Options::default().candidates(&model);
        assert!(!all.contains(&Effect::Tether) && all.contains(&Effect::SteadyWind));
        assert!(!all.contains(&Effect::MassChange), "a fit of everything absorbs it");
        let options = Options { without: vec![Effect::SteadyWind] };
        let fewer = options.candidates(&model);
        assert_eq!(fewer.len() + 1, all.len());
        assert!(!fewer.contains(&Effect::SteadyWind));
        assert_eq!(options.candidates_with(Effect::SteadyWind, &model).len(), all.len());
        assert_eq!(options.candidates_with(Effect::RotorInertia, &model), fewer);
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        let of_forces = Options::default().candidates(&model);
        assert!(of_forces.contains(&Effect::SteadyWind) && !of_forces.contains(&Effect::RotorInertia));
    }

    /// A file from before there were changes of a motor's torque and tilt: no yaw trim is to pass for one.
    #[test]
    fn what_a_model_does_not_say_the_scatter_of_is_not_tried() {
        let mut model = Model::thesis();
        let scatter = |effect: Effect| model::ChangeScatter {
            effect: effect.id().into(),
            coefficient: effect.info().coefficients[0].name.into(),
            deviation: 0.01,
            mean: None,
        };
        let options = Options::default();
        let tries =
            |model: &Model, effect| options.changes(model).iter().any(|change| change.effect == effect);
        assert!(tries(&model, Effect::MotorTorque) && options.untold_changes(&model).is_empty());
        let known = vec![scatter(Effect::MotorEfficiency)];
        model.fit = Some(model::FitRecord { scatter: known.clone(), ..Default::default() });
        assert!(tries(&model, Effect::MotorEfficiency) && !tries(&model, Effect::MotorTorque));
        assert_eq!(options.untold_changes(&model), [Effect::MotorTilt, Effect::MotorTorque]);
        let all = [Effect::MotorEfficiency, Effect::MotorTilt, Effect::MotorTorque].map(scatter);
        model.fit = Some(model::FitRecord { scatter: all.to_vec(), ..Default::default() });
        assert!(tries(&model, Effect::MotorTilt) && options.untold_changes(&model).is_empty());
    }
}
