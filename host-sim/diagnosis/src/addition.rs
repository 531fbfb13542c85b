//! An effect joins a model.

use model::{Effect, Model, PerAxis};
use sysid::prepare::Prepared;
use sysid::{Fit, FitError, errors};

use crate::finding::EffectFinding;
use crate::held_out::{examine, fit_and_validate};
use crate::options::Options;

/// An effect added to a model: the better model and the held-out errors without and with it.
#[derive(Debug, Clone)]
pub struct Addition {
    /// The refitted model with the effect.
    pub fit: Fit,
    /// The evidence.
    pub finding: EffectFinding,
    /// Held-out errors of the model refitted without it.
    pub before: PerAxis<f64>,
    /// Held-out errors with it.
    pub after: PerAxis<f64>,
}

/// Adds an effect to a model, refits everything on the training flights and validates it on the held-out ones. It counts as one
/// of the candidates that `options` leave.
pub fn add(
    model: &Model,
    effect: Effect,
    train: &[&Prepared],
    validate: &[&Prepared],
    options: &Options,
) -> Result<Addition, FitError> {
    let base = fit_and_validate(model, &model.effects(), train, validate)?;
    let mut effects = model.effects();
    effects.push(effect);
    let with = fit_and_validate(&base.fit.model, &effects, train, validate)?;
    let candidates = options.candidates_with(effect, model);
    let finding = examine(&base, &with, effect, (train, validate), candidates.len());
    let (before, after) = (errors(&base.held_out), errors(&with.held_out));
    Ok(Addition {
        fit: with.fit,
        finding,
        before: PerAxis::from_fn(|a| before[a].sse),
        after: PerAxis::from_fn(|a| after[a].sse),
    })
}
