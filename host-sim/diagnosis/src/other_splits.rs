//! What other flights held out would say. A load that swings shows where the craft brakes: held out, a flight that does not
//! brake confirms nothing. Where there are few flights, an answer must not hang on which of them were held out, so each is held
//! out once, and what most of these diagnoses find is found.

use model::{Effect, Model};
use sysid::prepare::Prepared;

use crate::conclusion::conclude;
use crate::criteria::SIGNIFICANCE;
use crate::diagnose::diagnose_with;
use crate::finding::{Diagnosis, EffectFinding};
use crate::observer::Observer;
use crate::options::Options;
use crate::reason::Reason;
use crate::search_error::{SearchError, Steps, going_on};

/// Most flights that are each held out once.
const FEW: usize = 6;

/// The diagnosis with the effect that it would have found with most other flights held out: one that is certain on the flights of the
/// fit, and that those held out do not confirm. `diagnosis` as it is, where it found an effect, or there is none.
pub(crate) fn or_by_other_splits(
    diagnosis: Diagnosis,
    model: &Model,
    flights: &[&Prepared],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Diagnosis, SearchError> {
    let is_lost =
        |f: &EffectFinding| matches!(f.reason, Reason::NotBorneOut { .. }) && f.p_value < SIGNIFICANCE;
    if diagnosis.best().is_some() || flights.len() > FEW || !diagnosis.effects.iter().any(is_lost) {
        return Ok(diagnosis);
    }
    let of = flights.len();
    let mut found: Vec<Effect> = Vec::new();
    let times = |found: &[Effect], effect: Effect| found.iter().filter(|other| **other == effect).count();
    let mut steps = Steps::new(observer, of);
    for (k, held_out) in flights.iter().enumerate() {
        // The splits that are left may be too few for any of them.
        let is_open = |f: &EffectFinding| is_lost(f) && 2 * (times(&found, f.effect) + of - k) > of;
        if !diagnosis.effects.iter().any(is_open) {
            break;
        }
        steps.next(&format!("diagnosing with {} held out", held_out.name))?;
        let rest: Vec<&Prepared> =
            flights.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, f)| *f).collect();
        // A split whose base model cannot be fitted finds nothing.
        found.extend(diagnose_with(model, &rest, &[held_out], options, observer).ok().and_then(|d| d.best()));
        going_on(observer)?;
    }
    let Diagnosis { mut effects, unexplained, not_identified, .. } = diagnosis;
    let confirmed = effects.iter_mut().find(|f| is_lost(f) && 2 * times(&found, f.effect) > of);
    if let Some(finding) = confirmed {
        finding.supported = true;
        finding.reason = Reason::OnOtherSplits { found: times(&found, finding.effect), of };
    }
    effects.sort_by_key(|finding| !finding.supported);
    Ok(conclude(effects, unexplained, not_identified))
}
