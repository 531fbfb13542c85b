//! A change that can have appeared since a model was good: an effect, of one motor or of the whole craft.

use std::fmt;
use std::ops::Range;

use model::{Effect, Model, Term};

/// One change to explain new flights by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Change {
    /// The effect.
    pub effect: Effect,
    /// Motor number 1 to 4, for a change of one motor; none where each of the four has changed by itself.
    pub motor: Option<u8>,
}

/// Every rotor by itself gives less thrust.
pub(crate) const ALL_ROTORS: Change = Change { effect: Effect::MotorEfficiency, motor: None };
/// More mass.
pub(crate) const HEAVIER: Change = Change { effect: Effect::MassChange, motor: None };
/// Another wind.
pub(crate) const WIND: Change = Change { effect: Effect::SteadyWind, motor: None };

/// Where the coefficients of each change lie among those of all, one change after the other.
pub(crate) fn places(changes: &[Change]) -> impl Iterator<Item = (Change, Range<usize>)> {
    let mut next = 0;
    changes.iter().map(move |change| {
        let first = next;
        next += change.coefficients().len();
        (*change, first..next)
    })
}

impl Change {
    /// Every change that can have happened to a craft of `model`.
    pub fn all(model: &Model) -> Vec<Self> {
        Effect::changes()
            .filter(|effect| !model.has(*effect))
            .filter(|effect| (effect.info().special.can_come_about)(&model.vehicle))
            .flat_map(|effect| {
                let one_each = effect.info().special.one_per_rotor;
                let motors = if one_each { [1, 2, 3, 4].map(Some).to_vec() } else { vec![None] };
                motors.into_iter().map(move |motor| Self { effect, motor })
            })
            .collect()
    }

    /// Indices of the coefficients it frees.
    pub(crate) fn coefficients(self) -> Vec<usize> {
        match self.motor {
            Some(motor) => vec![usize::from(motor) - 1],
            None => (0..self.effect.info().coefficients.len()).collect(),
        }
    }

    /// Gives its coefficients these values in a model, and leaves others of its effect as they are.
    pub(crate) fn set(self, model: &mut Model, values: &[f64]) {
        let own = model.term(self.effect).map(Term::values);
        let mut all = own.unwrap_or_else(|| vec![0.0; self.effect.info().coefficients.len()]);
        self.coefficients().into_iter().zip(values).for_each(|(k, value)| all[k] = *value);
        model.set(self.effect, &all);
    }

    /// `with` without it: with its coefficients as they are in `before`.
    pub fn undone(self, with: &Model, before: &Model) -> Model {
        let own = before.term(self.effect).map(Term::values);
        let values = self.coefficients().into_iter().map(|k| own.as_ref().map_or(0.0, |own| own[k]));
        let mut without = with.clone();
        self.set(&mut without, &values.collect::<Vec<_>>());
        without
    }
}

/// For people: "motor-efficiency of motor 2".
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.motor {
            Some(motor) => write!(f, "{} of motor {motor}", self.effect),
            None if self.effect.info().special.one_per_rotor => write!(f, "{} of all motors", self.effect),
            None => self.effect.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_lie_one_change_after_the_other() {
        let weak = Change { motor: Some(2), ..ALL_ROTORS };
        let found: Vec<_> = places(&[ALL_ROTORS, HEAVIER, weak]).collect();
        assert_eq!(found, [(ALL_ROTORS, 0..4), (HEAVIER, 4..5), (weak, 5..6)]);
    }

    #[test]
    fn a_change_is_undone_and_others_of_its_effect_stay() {
        let before = Model::thesis();
        let [first, second] = [1, 2].map(|motor| Change { motor: Some(motor), ..ALL_ROTORS });
        let mut with = before.clone();
        first.set(&mut with, &[0.05]);
        second.set(&mut with, &[0.03]);
        let losses = |model: &Model| model.term(ALL_ROTORS.effect).unwrap().values();
        assert_eq!(losses(&with), [0.05, 0.03, 0.0, 0.0]);
        assert_eq!(losses(&second.undone(&with, &before)), [0.05, 0.0, 0.0, 0.0]);
        assert_eq!(losses(&second.undone(&with, &with)), [0.05, 0.03, 0.0, 0.0]);
    }

    #[test]
    fn a_weak_motor_is_one_of_four_and_frees_its_own_coefficient() {
        let all = Change::all(&Model::thesis());
        let weak: Vec<Change> = all.iter().copied().filter(|c| c.effect == Effect::MotorEfficiency).collect();
        assert_eq!(weak.iter().map(|c| c.coefficients()).collect::<Vec<_>>(), [[0], [1], [2], [3]]);
        assert_eq!(weak[1].to_string(), "motor-efficiency of motor 2");
    }

    #[test]
    fn only_what_the_model_lacks_and_a_lag_that_was_known_can_have_changed() {
        let mut model = Model::thesis();
        model.set(Effect::MassChange, &[0.1]);
        model.vehicle.motors.lag = None;
        let all = Change::all(&model);
        assert!(all.iter().all(|c| c.effect != Effect::MassChange && c.effect != Effect::MotorLag));
        model.vehicle.motors.lag = Some(20.0);
        assert!(Change::all(&model).iter().any(|c| c.effect == Effect::MotorLag));
    }
}
