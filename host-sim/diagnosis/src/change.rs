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
    /// Every change that can have happened to a craft of `model`. What the model has may be more or less of it now, but for a cable or a
    /// load: half of a cable is none.
    pub fn all(model: &Model) -> Vec<Self> {
        Effect::changes()
            .filter(|effect| !model.has(*effect) || !effect.info().special.is_anchored)
            .filter(|effect| (effect.info().special.can_come_about)(&model.vehicle))
            .flat_map(|effect| {
                let of_motors = effect.info().special.per_rotor > 0;
                let motors = if of_motors { [1, 2, 3, 4].map(Some).to_vec() } else { vec![None] };
                motors.into_iter().map(move |motor| Self { effect, motor })
            })
            .collect()
    }

    /// Indices of the coefficients it frees.
    pub fn coefficients(self) -> Vec<usize> {
        match self.motor {
            Some(motor) => {
                let each = self.effect.info().special.per_rotor;
                let first = each * (usize::from(motor) - 1);
                (first..first + each).collect()
            }
            None => (0..self.effect.info().coefficients.len()).collect(),
        }
    }

    /// All coefficients of its effect in a model; zero where it lacks the effect.
    fn of_effect(self, model: &Model) -> Vec<f64> {
        let own = model.term(self.effect).map(Term::values);
        own.unwrap_or_else(|| vec![0.0; self.effect.info().coefficients.len()])
    }

    /// Its size: by how much its coefficients are more in `with` than in `before`.
    pub(crate) fn size(self, with: &Model, before: &Model) -> Vec<f64> {
        let [with, before] = [with, before].map(|model| self.of_effect(model));
        self.coefficients().into_iter().map(|k| with[k] - before[k]).collect()
    }

    /// Makes its coefficients in a model more by its size, and leaves others of its effect as they are.
    pub(crate) fn add(self, model: &mut Model, size: &[f64]) {
        let mut all = self.of_effect(model);
        self.coefficients().into_iter().zip(size).for_each(|(k, size)| all[k] += size);
        model.set(self.effect, &all);
    }

    /// `with` without it: with its coefficients as they are in `before`.
    pub fn undone(self, with: &Model, before: &Model) -> Model {
        let (mut all, own) = (self.of_effect(with), self.of_effect(before));
        self.coefficients().into_iter().for_each(|k| all[k] = own[k]);
        let mut without = with.clone();
        without.set(self.effect, &all);
        without
    }
}

/// For people: "motor-efficiency of motor 2".
impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.motor {
            Some(motor) => write!(f, "{} of motor {motor}", self.effect),
            None if self.effect.info().special.per_rotor > 0 => write!(f, "{} of all motors", self.effect),
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
        first.add(&mut with, &[0.05]);
        second.add(&mut with, &[0.03]);
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
    fn a_wind_can_be_another_one_but_not_a_cable_nor_a_lag_that_was_not_known() {
        let mut model = Model::thesis();
        let can = |model: &Model, effect| Change::all(model).iter().any(|change| change.effect == effect);
        assert!(can(&model, Effect::Tether) && can(&model, Effect::MotorLag));
        model.set(Effect::SteadyWind, &[1.0, 0.5]);
        model.set(Effect::Tether, &[1.0, 0.0, 0.0, 0.0]);
        model.vehicle.motors.lag = None;
        assert!(can(&model, Effect::SteadyWind));
        assert!(!can(&model, Effect::Tether) && !can(&model, Effect::MotorLag));
        let mut with = model.clone();
        WIND.add(&mut with, &[0.25, -0.5]);
        assert_eq!(with.term(Effect::SteadyWind).unwrap().values(), [1.25, 0.0]);
        assert_eq!(WIND.size(&with, &model), [0.25, -0.5]);
        assert_eq!(WIND.undone(&with, &model).term(Effect::SteadyWind), model.term(Effect::SteadyWind));
    }
}
