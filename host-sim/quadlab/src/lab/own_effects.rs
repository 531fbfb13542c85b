//! Effects of the user's own while the lab is open: checked while they are typed, tried, kept, edited and removed.
//!
//! A text that was never kept can be tried: it is fitted, but its identifier means nothing. What is kept is a candidate of every
//! diagnosis. An effect that a model has stays as it is, because the model's file and every sentence about it name it by its
//! identifier alone.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use diagnosis::{Options, Why, workflow};
use model::Effect;
use model::user_effects::Definition;
use serde_json::{Value, json};

use super::node::Node;
use super::own_effect::{HERE, OwnEffect, described, have_it, kept_of, models_with, one_of};
use super::refused::Refused;
use super::session::{Session, Telling};

impl Session {
    /// The user's own effects that are kept and can be used.
    pub(super) fn own_effects(&self) -> Vec<Effect> {
        self.lock().own.iter().filter_map(OwnEffect::effect).collect()
    }

    /// Forgets what was found with an effect that is no longer what it was.
    pub(super) fn forget_findings(&self, effect: &str) -> Result<(), Refused> {
        let is_in = |found: &Option<Value>| {
            let found = found.as_ref().and_then(|found| found["effects"].as_array());
            found.is_some_and(|all| all.iter().any(|finding| finding["effect"] == effect))
        };
        for node in &mut self.lock().nodes {
            for found in [&mut node.diagnosis, &mut node.changes] {
                if is_in(found) {
                    *found = None;
                }
            }
            self.store.write_node(node)?;
        }
        Ok(())
    }

    /// What a text says, or what is wrong with it.
    pub(super) fn check_effect(&self, text: &str) -> Value {
        let checked = one_of(text).and_then(|effect| self.may_mean(effect.definition()).map(|()| effect));
        match checked {
            Ok(effect) => json!({ "problem": null, "effect": described(&effect) }),
            Err(refused) => json!({ "problem": refused.sentence(), "effect": null }),
        }
    }

    /// Refuses a definition whose identifier stands for another one in a model.
    fn may_mean(&self, definition: &Definition) -> Result<(), Refused> {
        let is_other = |effect: &Effect| match effect {
            Effect::User(user) => user.definition().id == definition.id && user.definition() != definition,
            _ => false,
        };
        let state = self.lock();
        let has_other = |node: &&Node| node.model.effects().iter().any(is_other);
        let models: Vec<u32> = state.nodes.iter().filter(has_other).map(|node| node.id).collect();
        if models.is_empty() {
            return Ok(());
        }
        let (id, models) = (&definition.id, have_it(&models));
        Err(Refused::new(format!(
            "{HERE}: effect \"{id}\": id: {models} as it was before; give this one another id"
        )))
    }

    /// The effect of a text, to be fitted and drawn.
    pub(super) fn draft(&self, text: &str) -> Result<Effect, Refused> {
        self.may_mean(one_of(text)?.definition())?;
        let user = kept_of(text)?;
        if !user.columns_named().is_empty() {
            self.read_further_columns()?;
        }
        Ok(Effect::User(user))
    }

    /// The evidence for and against an effect that need not be kept, as `quadlab diagnose --why` gives it.
    pub(super) fn try_effect(&self, model: u32, text: &str, cancel: Arc<AtomicBool>) -> Result<Why, Refused> {
        let model = self.node(model)?.model;
        let effect = self.draft(text)?;
        let telling = Telling { session: self, kind: "try", cancel: Some(cancel) };
        let mut sets = self.sets(&model.vehicle, &telling)?;
        // What is kept under its name is what it would replace.
        let without: Vec<Effect> =
            Effect::from_id(effect.id()).filter(|known| *known != effect).into_iter().collect();
        let mut own = self.own_effects();
        own.retain(|kept| *kept != effect && !without.contains(kept));
        own.push(effect);
        Ok(workflow::why(&model, effect, &own, &mut sets, &Options { without }, &telling)?)
    }

    /// Keeps the effect of a text, in place of what was kept under its name.
    pub(super) fn keep_effect(&self, text: &str) -> Result<(), Refused> {
        let Effect::User(user) = self.draft(text)? else { return Ok(()) };
        let id = user.info().id;
        let before = Effect::from_id(id);
        {
            let mut state = self.lock();
            state.has_no_job()?;
            user.make_known(Path::new(HERE))?;
            if let Err(why) = self.store.write_effect(id, text) {
                match before {
                    Some(Effect::User(before)) => before.make_known(Path::new(HERE))?,
                    _ => user.forget(),
                }
                return Err(why.into());
            }
            state.own.retain(|own| own.id != id);
            state.own.push(OwnEffect { id: id.to_owned(), text: text.to_owned(), read: Ok(user) });
            state.own.sort_by(|a, b| a.id.cmp(&b.id));
            state.trials.forget();
        }
        if before.is_some_and(|before| before != Effect::User(user)) {
            self.forget_findings(id)?;
        }
        self.events.changed();
        Ok(())
    }

    /// Keeps an effect no longer.
    pub(super) fn remove_effect(&self, id: &str) -> Result<(), Refused> {
        {
            let mut state = self.lock();
            state.has_no_job()?;
            let Some(place) = state.own.iter().position(|own| own.id == id) else {
                return Err(Refused::new("there is no such effect of your own: load the page again"));
            };
            let user = state.own[place].read.as_ref().ok().copied();
            let models = user.map_or_else(Vec::new, |user| models_with(&state.nodes, user));
            if !models.is_empty() {
                return Err(Refused::new(format!("{id} cannot be removed: {}", have_it(&models))));
            }
            self.store.remove_effect(id)?;
            if let Some(user) = user {
                user.forget();
            }
            state.own.remove(place);
            state.trials.forget();
        }
        self.forget_findings(id)?;
        self.events.changed();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::lab::session::Job;
    use model::Model;
    use tempfile::TempDir;

    fn opened() -> (TempDir, Session) {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::open(folder.path()).unwrap();
        (folder, session)
    }

    /// What is kept is known to the whole program: each test has names of its own.
    fn text(id: &str, formula: &str) -> String {
        format!(
            "[[effect]]\nid = \"{id}\"\nacceleration.u = \"{formula}\"\n\
             coefficient = [{{ name = \"k\", unit = \"1/s\", possible = [-1.0, 1.0], typical = 0.1 }}]\n"
        )
    }

    fn problem(session: &Session, text: &str) -> String {
        let checked = session.check_effect(text);
        assert!(checked["effect"].is_null(), "{checked}");
        checked["problem"].as_str().unwrap().to_owned()
    }

    fn files(folder: &TempDir) -> Vec<String> {
        let Ok(all) = fs::read_dir(folder.path().join("lab/effects")) else { return Vec::new() };
        let mut names: Vec<String> =
            all.map(|file| file.unwrap().file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    fn example() -> &'static str {
        include_str!("own-effect.toml")
    }

    #[test]
    fn the_page_begins_with_an_effect_that_can_be_right() {
        let checked = opened().1.check_effect(example());
        assert_eq!(checked["problem"], Value::Null);
        let effect = &checked["effect"];
        assert_eq!((&effect["forces"], &effect["moments"]), (&json!(["u", "v"]), &json!([])));
        assert_eq!(effect["coefficients"][0]["unit"], "1/m");
        assert!(example().lines().count() < 12);
    }

    #[test]
    fn a_mistake_is_told_in_one_line_with_its_field_and_nothing_is_kept() {
        let (folder, session) = opened();
        let good = text("told", "-k * u");
        for (bad, expected) in [
            (text("told", "-k * height"), "acceleration.u: has the unit m/s, the row needs m/s^2"),
            (text("told", "-k * uu"), "acceleration.u: unknown name \"uu\""),
            (good.replacen("possible", "posible", 1), "line 4: "),
            (text("../told", "-k * u"), "id: is a word of a to z"),
            (text("<b>told</b>", "-k * u"), "id: is a word of a to z"),
            (text("ground-effect", "-k * u"), "is an effect of the catalogue"),
            (text("told", &"(".repeat(400)), "acceleration.u: "),
            (format!("effect = {}", "[".repeat(50_000)), "own effect: "),
            (format!("{good}\n# {}", "x".repeat(70_000)), "is larger than"),
            (format!("{good}\n{}", text("told-too", "k * v")), "one [[effect]]"),
            (String::new(), "one [[effect]]"),
        ] {
            let why = problem(&session, &bad);
            let start: String = bad.chars().take(60).collect();
            assert!(why.contains(expected) && why.lines().count() == 1 && why.len() < 1500, "{start}: {why}");
            assert!(session.keep_effect(&bad).is_err(), "{start}");
        }
        assert_eq!(files(&folder), [""; 0]);
        assert_eq!(Effect::from_id("told"), None);
    }

    #[test]
    fn what_is_kept_is_a_candidate_is_edited_and_is_there_again() {
        let (folder, session) = opened();
        let (first, second) = (text("kept-one", "-k * u"), text("kept-one", "k * v"));
        session.keep_effect(&first).unwrap();
        assert_eq!(session.own_effects(), [Effect::from_id("kept-one").unwrap()]);
        assert_eq!(session.command("identify"), "quadlab identify  --effects lab/effects/kept-one.toml");
        session.keep_effect(&second).unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("lab/effects/kept-one.toml")).unwrap(), second);
        let [Effect::User(user)] = session.own_effects()[..] else { panic!("one effect is kept") };
        assert_eq!(user.definition().acceleration["u"], "k * v");
        assert_eq!(Effect::candidates().filter(|effect| effect.id() == "kept-one").count(), 1);

        drop(session);
        // What is wrong with a file is told; the others are there.
        fs::write(folder.path().join("lab/effects/broken.toml"), text("broken", "k * <u>")).unwrap();
        fs::write(folder.path().join("lab/effects/renamed.toml"), text("kept-two", "k * v")).unwrap();
        let session = Session::open(folder.path()).unwrap();
        let own = session.document()["own"].clone();
        let problems: Vec<bool> =
            own.as_array().unwrap().iter().map(|own| own["problem"].is_null()).collect();
        assert_eq!(problems, [false, true, false], "{own}");
        assert!(own[2]["problem"].as_str().unwrap().contains("kept-two"), "{own}");
        assert_eq!((&own[1]["id"], &own[1]["text"]), (&json!("kept-one"), &json!(second)));

        for id in ["kept-one", "broken", "renamed"] {
            session.remove_effect(id).unwrap();
        }
        assert!(session.remove_effect("../state").is_err());
        assert_eq!((Effect::from_id("kept-one"), files(&folder)), (None, vec![]));
    }

    #[test]
    fn an_effect_that_a_model_has_stays_as_it_is() {
        let (folder, session) = opened();
        let first = text("in-model", "-k * u");
        session.keep_effect(&first).unwrap();
        let mut model = Model::thesis();
        model.set(Effect::from_id("in-model").unwrap(), &[0.1]);
        session.add_node(|id| Node::of(id, None, model)).unwrap();
        let other = text("in-model", "k * v");
        let why = problem(&session, &other);
        assert!(why.contains("model 1 has it as it was before"), "{why}");
        assert!(session.keep_effect(&other).is_err() && session.draft(&other).is_err());
        let why = session.remove_effect("in-model").unwrap_err().into_sentence();
        assert!(why.contains("model 1 has it"), "{why}");
        // A remark changes nothing.
        session.keep_effect(&format!("# mine\n{first}")).unwrap();
        session.keep_effect(&text("in-model-2", "k * v")).unwrap();
        assert_eq!(files(&folder), ["in-model-2.toml", "in-model.toml"]);

        // Somebody edits the file of one that a model has.
        drop(session);
        fs::write(folder.path().join("lab/effects/in-model.toml"), &other).unwrap();
        let session = Session::open(folder.path()).unwrap();
        let own = session.document()["own"].clone();
        assert!(own[0]["problem"].as_str().unwrap().contains("a model has it with other formulas"), "{own}");
        assert_eq!(session.own_effects().len(), 1);
        session.remove_effect("in-model-2").unwrap();
    }

    #[test]
    fn what_was_found_with_an_edited_effect_is_forgotten() {
        let (folder, session) = opened();
        session.keep_effect(&text("found", "-k * u")).unwrap();
        let found = |effect: &str| Some(json!({ "verdict": "adequate", "effects": [{ "effect": effect }] }));
        for effect in ["found", "tether"] {
            session
                .add_node(|id| Node { diagnosis: found(effect), ..Node::of(id, None, Model::thesis()) })
                .unwrap();
        }
        session.keep_effect(&text("found", "k * v")).unwrap();
        let has = |id: u32| session.node(id).unwrap().diagnosis.is_some();
        assert_eq!((has(1), has(2)), (false, true));
        let file = |id: u32| folder.path().join(format!("lab/diagnosis-{id}.json")).exists();
        assert_eq!((file(1), file(2)), (false, true));
        session.remove_effect("found").unwrap();
    }

    #[test]
    fn nothing_is_changed_under_a_job() {
        let (folder, session) = opened();
        let job = Job { kind: "diagnose", activity: String::new(), steps: None, cancel: Arc::default() };
        session.lock().job = Some(job);
        let why = session.keep_effect(&text("under-a-job", "-k * u")).unwrap_err().into_sentence();
        assert!(why.contains("diagnose is running"), "{why}");
        assert_eq!((files(&folder).len(), Effect::from_id("under-a-job")), (0, None));
    }
}
