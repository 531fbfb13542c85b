//! An effect that the user writes on the page: its text, what it says, and its file in `lab/effects/`.

use std::path::Path;

use model::user_effects::{User, UserEffect};
use model::{AXES, Axis, Effect, QUANTITIES, effects, user_effects};
use serde_json::{Value, json};

use super::node::Node;
use super::refused::Refused;
use super::store::EffectFile;

/// Where an error is, instead of a file.
pub(super) const HERE: &str = "own effect";
/// What the page begins with.
const EXAMPLE: &str = include_str!("own-effect.toml");

/// An effect that is kept.
#[derive(Debug)]
pub(super) struct OwnEffect {
    /// Its file's name without the ending.
    pub(super) id: String,
    pub(super) text: String,
    /// What it is, or what is wrong with its file.
    pub(super) read: Result<User, String>,
}

impl OwnEffect {
    /// Makes the effects of all files known. One that another is confused with may come after it.
    pub(super) fn all(files: &[EffectFile]) -> Vec<Self> {
        let mut all: Vec<Self> = files.iter().map(Self::new).collect();
        for _ in files {
            let mut is_better = false;
            for (own, file) in all.iter_mut().zip(files).filter(|(own, _)| own.read.is_err()) {
                *own = Self::new(file);
                is_better |= own.read.is_ok();
            }
            if !is_better {
                break;
            }
        }
        all
    }

    fn new(file: &EffectFile) -> Self {
        let read = file.text.clone().and_then(|text| know(&file.id, &text).map_err(Refused::into_sentence));
        Self { id: file.id.clone(), text: file.text.clone().unwrap_or_default(), read }
    }

    /// The effect, where it can be used.
    pub(super) fn effect(&self) -> Option<Effect> {
        self.read.as_ref().ok().copied().map(Effect::User)
    }

    /// What the page shows.
    pub(super) fn entry(&self, nodes: &[Node]) -> Value {
        json!({
            "id": self.id,
            "text": self.text,
            "problem": self.read.as_ref().err(),
            "models": self.read.as_ref().map_or_else(|_| Vec::new(), |user| models_with(nodes, *user)),
        })
    }
}

/// Makes the effect of a file known, unless a model has another one of its name.
fn know(id: &str, text: &str) -> Result<User, Refused> {
    let path = Path::new(HERE);
    let effect = one_of(text)?;
    if effect.id() != id {
        return Err(Refused::new(format!("the file defines \"{}\": name it {0}.toml", effect.id())));
    }
    let user = kept_of(text)?;
    if Effect::from_id(id).is_some_and(|known| known != Effect::User(user)) {
        let why = "a model has it with other formulas; give this one another id";
        return Err(Refused::new(format!("effect \"{id}\": {why}")));
    }
    user.make_known(path)?;
    Ok(user)
}

/// The one effect of a text, checked only.
pub(super) fn one_of(text: &str) -> Result<UserEffect, Refused> {
    let mut all = match text.trim() {
        "" => Vec::new(),
        _ => effects::parse(text, Path::new(HERE))?,
    };
    match (all.pop(), all.is_empty()) {
        (Some(only), true) => Ok(only),
        _ => Err(Refused::new("write one [[effect]] here: each has a file of its own")),
    }
}

/// The one effect of a text, so that it can be fitted.
pub(super) fn kept_of(text: &str) -> Result<User, Refused> {
    one_of(text)?;
    let all = effects::draft(text, Path::new(HERE))?;
    all.first().copied().ok_or_else(|| Refused::new("there is no effect in this text"))
}

/// Numbers of the models that have an effect.
pub(super) fn models_with(nodes: &[Node], user: User) -> Vec<u32> {
    nodes.iter().filter(|node| node.model.has(Effect::User(user))).map(|node| node.id).collect()
}

/// "model 3 has it", "models 3, 4 have it".
pub(super) fn have_it(models: &[u32]) -> String {
    let numbers = models.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
    if models.len() == 1 { format!("model {numbers} has it") } else { format!("models {numbers} have it") }
}

/// What can be named in formulas.
pub(super) fn names() -> Value {
    let quantity = |q: &model::Quantity| json!({ "name": q.name, "unit": q.unit, "meaning": q.meaning });
    json!({
        "quantities": QUANTITIES.iter().map(quantity).collect::<Vec<_>>(),
        "functions": user_effects::functions().collect::<Vec<_>>(),
        "example": EXAMPLE,
    })
}

/// What the page shows of an effect that can be right.
pub(super) fn described(effect: &UserEffect) -> Value {
    let definition = effect.definition();
    let unit = |row: &str| {
        let of = AXES.into_iter().find(|axis| axis.name() == row);
        of.map_or(Axis::U.unit(), Axis::unit)
    };
    let row =
        |(row, formula): (&String, &String)| json!({ "row": row, "formula": formula, "unit": unit(row) });
    let named = |axes: Vec<Axis>, is_force: bool| -> Vec<&str> {
        axes.into_iter().filter(|axis| axis.is_force() == is_force).map(Axis::name).collect()
    };
    json!({
        "id": effect.id(),
        "forces": named(effect.axes(), true),
        "moments": named(effect.axes(), false),
        "rows": definition.acceleration.iter().map(row).collect::<Vec<_>>(),
        "coefficients": definition.coefficient,
        "linear": effect.is_linear(),
    })
}
