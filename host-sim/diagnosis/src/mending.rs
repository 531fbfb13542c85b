//! Does a missing effect mend a rotation whose motors push the wrong way?
//!
//! A fit gives motors impossible signs where clocks disagree or nothing is excited, and then the rotation is refused. But so
//! does a strong effect that the basic model lacks: with a product of inertia, the yaw that the motors make rolls the craft, and
//! the motors' own yaw is lost in what rolling makes. There, the effect is the finding.

use model::{AXES, Axis, Effect, Model};
use sysid::prepare::Prepared;
use sysid::{errors, rotation_doubts};

use crate::held_out::{Validated, examine, fit_and_validate};
use crate::observer::{Observer, Progress};
use crate::options::Options;
use crate::search_error::{SearchError, Steps};

/// Least part of each axis of the rotation, R2 on the flights held out, that a model with the mending effect predicts. An effect
/// strong enough to turn motors round is seen in brisk motion, and with it most is explained (0.99 and more in simulated
/// flights); where clocks wander, motors explain a hundredth (nanobench), and any effect may push their signs a little to the
/// right side of zero.
const LEAST_R2: f64 = 0.5;

/// The effect that, joined to a whole model whose rotation is in doubt, leaves no doubt and meets every criterion of support, with
/// most of each axis of the rotation predicted on the flights held out. The one that lowers the error there most, of several.
pub(crate) fn mending(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Option<Effect>, SearchError> {
    observer.progress(Progress { activity: "looking for an effect that mends the rotation", steps: None });
    let Ok(without) = fit_and_validate(model, &model.effects(), train, validate) else { return Ok(None) };
    // What is found by a search over shapes (a load on a cable) pulls at the frame and turns nothing.
    let turns = |effect: &Effect| {
        effect.info().axes.iter().any(|axis| !axis.is_force()) && effect.starts().is_empty()
    };
    let flown = options.candidates_by(model, &[train, validate].concat());
    let candidates: Vec<Effect> = flown.into_iter().filter(turns).collect();
    let mut steps = Steps::new(observer, candidates.len());
    let mut best: Option<(f64, Effect)> = None;
    for effect in candidates.iter().copied() {
        steps.next(&format!("trying {effect} for the rotation"))?;
        let mut effects = model.effects();
        effects.push(effect);
        // One that cannot be fitted mends nothing.
        let Ok(with) = fit_and_validate(&without.fit.model, &effects, train, validate) else { continue };
        if !is_sound(&with, train) {
            continue;
        }
        let finding = examine(&without, &with, effect, (train, validate), candidates.len());
        if finding.supported && best.is_none_or(|(gain, _)| finding.gain > gain) {
            best = Some((finding.gain, effect));
        }
    }
    Ok(best.map(|(_, effect)| effect))
}

/// Whether a rotation is without doubts, and for the most part predicted on the flights held out.
fn is_sound(with: &Validated, train: &[&Prepared]) -> bool {
    let held_out = errors(&with.held_out);
    let is_predicted = |axis: Axis| axis.is_force() || held_out[axis].r2 >= LEAST_R2;
    AXES.into_iter().all(is_predicted) && rotation_doubts(&with.fit.model, train).is_empty()
}

#[cfg(test)]
mod tests {
    use model::Kind;

    use super::*;
    use crate::observer::Silent;
    use crate::testing::{ORDINARY, prepared, truth};

    fn mended(world: &Model, options: &Options) -> Option<Effect> {
        let flights = prepared(world, 70..75, 12.0, &ORDINARY);
        let all: Vec<&Prepared> = flights.iter().collect();
        let (train, validate) = all.split_at(3);
        let mut basic = world.clone();
        basic.terms.retain(|term| term.effect.info().kind == Kind::Basic);
        mending(&basic, train, validate, options, &Silent).unwrap()
    }

    #[test]
    fn what_the_rotation_lacks_mends_it_and_nothing_mends_what_lacks_nothing() {
        let mut world = truth();
        world.set(Effect::ProductOfInertia, &[0.2, 0.19, 0.12]);
        assert_eq!(mended(&world, &Options::default()), Some(Effect::ProductOfInertia));
        assert_eq!(mended(&truth(), &Options::default()), None);
    }

    #[test]
    fn an_effect_that_is_left_out_mends_nothing() {
        let mut world = truth();
        world.set(Effect::ProductOfInertia, &[0.2, 0.19, 0.12]);
        let options = Options { without: vec![Effect::ProductOfInertia] };
        assert_ne!(mended(&world, &options), Some(Effect::ProductOfInertia));
    }
}
