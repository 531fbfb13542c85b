//! Which flight tells what: a model under gains that fly it, and whether the best of some flights is good enough.

use std::path::{Path, PathBuf};

use control::Config;
use control::gains::Law;
use design::Gains;
use design::plant::{Linear, TrimTarget};
use design::synthesis::{Method, Specs, design};
use model::Model;
use sil::next_flight::{APART, Goal, Proposal};
use sil::predict::Predictor;

/// Duration of a planned flight where nothing is said, s.
pub(crate) const DURATION_S: f64 = 20.0;
/// Its seed.
pub(crate) const SEED: u64 = 1;

#[derive(Debug, thiserror::Error)]
enum NotFlown {
    #[error("{}: no gains were found that fly this model in simulation; give --gains", .0.display())]
    NoGains(PathBuf),
    #[error("{}: vehicle.motors: has no map from command to rotor speed; find it with quadlab motor-map to simulate flights", .0.display())]
    NoMap(PathBuf),
}

/// The model under the gains of a file, or else under the first that fly it: designed the thesis'
/// way, which takes a second; by the search for a late pose; the thesis' own, if they suit; and
/// these without the cancellers that only flapping asks for.
pub(crate) fn predictor(
    model: &Model,
    path: &Path,
    gains: Option<&Path>,
    seed: u64,
) -> anyhow::Result<Predictor> {
    if !model.can_be_commanded() {
        return Err(NotFlown::NoMap(path.into()).into());
    }
    let under = |config: Config| anyhow::Ok(Predictor::new(model.clone(), config, seed)?);
    if let Some(gains) = gains {
        return under(design::gains_match::read_for(gains, model)?.config);
    }
    let designed = |method: Method| under(design(model, &Specs { method, ..Specs::default() })?.config);
    let of_thesis = |cancellers: bool| {
        let mut config = Config::thesis();
        let linear = Linear::new(model, &TrimTarget::default())?;
        design::gains_match::gains_match(&Gains { config, provenance: None }, model, &linear, path)?;
        if !cancellers {
            without_cancellers(&mut config);
        }
        under(config)
    };
    designed(Method::Thesis)
        .or_else(|_| designed(Method::Delay))
        .or_else(|why| of_thesis(true).or_else(|_| of_thesis(false)).map_err(|_| why))
        .map_err(|why| why.context(NotFlown::NoGains(path.into())))
}

/// Takes the zero-cancellers of roll and pitch out of the thesis' law, for a craft without flapping moments.
pub(crate) fn without_cancellers(config: &mut Config) {
    if let Law::ModelBased(law) = &mut config.law {
        law.loops.roll.canceller = None;
        law.loops.pitch.canceller = None;
    }
}

/// Whether a flight tells what is asked.
pub(crate) fn is_enough(best: &Proposal, goal: Goal) -> bool {
    let tells = match (goal, best.worth) {
        (Goal::Separate(..), Some(deviations)) => deviations >= APART,
        (Goal::Shrink(_), worth) => worth.is_some(),
        _ => false,
    };
    tells && best.course.trouble.is_none()
}
