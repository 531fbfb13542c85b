//! The flight that tells two effects apart, as a pattern file.

use model::{Effect, Model};
use serde_json::{Value, json};
use sil::next_flight::{Goal, check_effect, plan};

use super::refused::Refused;
use super::session::Session;
use crate::cli::effect_names::known_effect;
use crate::cli::next_flight::{DURATION_S, SEED, is_enough, predictor};

/// The flight that best tells two effects apart, as `quadlab plan --separate` finds it.
pub(super) fn flight(session: &Session, id: u32, effects: [&str; 2]) -> Result<Value, Refused> {
    session.node(id)?;
    let refuse = |error: anyhow::Error| Refused::new(format!("{error:#}"));
    let name = format!("lab/model-{id}.toml");
    let path = session.folder.join(&name);
    let model = Model::read_to_simulate(&path).map_err(|error| refuse(error.into()))?;
    let [first, second]: [Effect; 2] = [known_effect(effects[0])?, known_effect(effects[1])?];
    if first == second {
        return Err(Refused::new(format!("{first}: choose two different effects to tell apart")));
    }
    let predictor = predictor(&model, &path, None, SEED).map_err(refuse)?;
    for effect in [first, second] {
        check_effect(&predictor, effect).map_err(|error| refuse(error.into()))?;
    }
    let goal = Goal::Separate(first, second);
    let proposals = plan(&predictor, goal, DURATION_S, SEED).map_err(|error| refuse(error.into()))?;
    let best = proposals.first().filter(|best| is_enough(best, goal));
    let best = best.ok_or_else(|| {
        Refused::new(format!(
            "no flight of {DURATION_S} s tells {first} from {second}: fly longer, or repeat flights"
        ))
    })?;
    Ok(json!({
        "file": format!("{first}-or-{second}.csv"),
        "csv": best.pattern.to_csv(),
        "words": best.words,
        "deviations": best.worth,
    }))
}
