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
