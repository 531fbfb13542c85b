//! What a diagnosis considers.

use model::{Effect, Model};
use sysid::{has_rotation, without_rotation};

/// What to diagnose with.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Options {
    /// Effects that are treated as if nobody knew them.
    pub without: Vec<Effect>,
}

impl Options {
    /// What could be missing from a model. One without rotation lacks none of the rotation's alone.
    pub(crate) fn candidates(&self, model: &Model) -> Vec<Effect> {
        let missing = |e: &Effect| !model.has(*e) && !self.without.contains(e);
        let all: Vec<Effect> = Effect::candidates().filter(missing).collect();
        if has_rotation(model) { all } else { without_rotation(&all) }
    }

    /// What could be missing from a model, and `effect`, which is asked about.
    pub(crate) fn candidates_with(&self, effect: Effect, model: &Model) -> Vec<Effect> {
        let mut candidates = self.candidates(model);
        if !candidates.contains(&effect) {
            candidates.push(effect);
        }
        candidates
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
