//! Whether a model speaks of the rotation, and which effects do.

use model::{Effect, Model};

/// Whether an effect has rows of p, q and r and no others.
pub(crate) fn acts_on_rotation_alone(effect: Effect) -> bool {
    effect.info().axes.iter().all(|axis| axis.index() >= 3)
}

/// Whether a model says anything about the rotation: one whose rotor moments were refused has force rows alone.
pub fn has_rotation(model: &Model) -> bool {
    model.has(Effect::RotorMoments)
}

/// Effects without those of the rotation.
pub fn without_rotation(effects: &[Effect]) -> Vec<Effect> {
    effects.iter().copied().filter(|e| !acts_on_rotation_alone(*e)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::truth;

    #[test]
    fn of_the_basic_model_thrust_and_drag_alone_are_left_without_rotation() {
        let basic: Vec<Effect> = Effect::basic().collect();
        assert_eq!(without_rotation(&basic), [Effect::Thrust, Effect::LinearDrag]);
        assert_eq!(without_rotation(&[]), []);
    }

    #[test]
    fn an_effect_on_forces_and_moments_stays() {
        // A wind moves the air that drag and flapping see, an offset of the centre of mass the
        // thrust's lever.
        for effect in Effect::all() {
            let on_forces = effect.info().axes.iter().any(|axis| axis.is_force());
            assert_eq!(without_rotation(&[effect]).len(), usize::from(on_forces), "{effect}");
        }
        assert!(
            acts_on_rotation_alone(Effect::AngularDamping) && !acts_on_rotation_alone(Effect::MassChange)
        );
    }

    #[test]
    fn a_model_speaks_of_the_rotation_by_its_rotor_moments() {
        let mut model = truth();
        assert!(has_rotation(&model));
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        assert!(model.has(Effect::AngularDamping) && !has_rotation(&model));
    }
}
