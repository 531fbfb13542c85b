//! What the user writes about flights and models, in their own words.

use serde::Deserialize;

use super::refused::Refused;
use super::session::Session;
use super::store::LONGEST_NOTE;

/// What the page asks for: one of the two, and its note.
#[derive(Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum Noted {
    /// Of a file of flights.
    Flight { flight: String, text: String },
    /// Of a model.
    Model { model: u32, text: String },
}

impl Session {
    /// Keeps a note in the place of the one before it; an empty text is none.
    pub(super) fn note(&self, noted: Noted) -> Result<(), Refused> {
        let (Noted::Flight { text, .. } | Noted::Model { text, .. }) = &noted;
        let count = text.chars().count();
        if count > LONGEST_NOTE {
            let most = LONGEST_NOTE;
            return Err(Refused::new(format!(
                "a note has {most} characters at most, and this one {count}: shorten it"
            )));
        }
        {
            let mut state = self.lock();
            match noted {
                Noted::Flight { flight, .. } if state.files.iter().all(|file| file.name != flight) => {
                    return Err(Refused::new(format!("{flight}: there is no such flight in this folder")));
                }
                Noted::Flight { flight, text } if text.is_empty() => _ = state.notes.remove(&flight),
                Noted::Flight { flight, text } => _ = state.notes.insert(flight, text),
                Noted::Model { model, text } => {
                    let node = state.nodes.iter_mut().find(|node| node.id == model);
                    let node = node.ok_or_else(|| {
                        Refused::new(format!("there is no model {model}: load the page again"))
                    })?;
                    node.note = text;
                }
            }
        }
        self.save()?;
        self.events.changed();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::node::Node;
    use model::Model;

    fn of_model(model: u32, text: &str) -> Noted {
        Noted::Model { model, text: text.into() }
    }

    #[test]
    fn a_note_of_a_model_is_there_again_and_not_in_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::open(folder.path()).unwrap();
        session.add_node(|id| Node::of(id, None, Model::thesis())).unwrap();
        let text = "two lines,\n\"quoted\" <b>not bold</b> \u{1f681}";
        session.note(of_model(1, text)).unwrap();
        drop(session);
        let session = Session::open(folder.path()).unwrap();
        assert_eq!(session.document()["models"][0]["note"], text);
        let file = std::fs::read_to_string(folder.path().join("lab/model-1.toml")).unwrap();
        assert!(!file.contains("quoted"), "{file}");
        session.note(of_model(1, "")).unwrap();
        let state = std::fs::read_to_string(folder.path().join("lab/state.json")).unwrap();
        assert!(!state.contains("note"), "{state}");
    }

    #[test]
    fn a_note_of_nothing_and_one_that_is_too_long_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::open(folder.path()).unwrap();
        session.add_node(|id| Node::of(id, None, Model::thesis())).unwrap();
        let why = |noted| session.note(noted).unwrap_err().into_sentence();
        assert!(why(of_model(2, "x")).contains("there is no model 2"));
        let flight = Noted::Flight { flight: "../A.csv".into(), text: "x".into() };
        assert!(why(flight).contains("there is no such flight"));
        // Characters, not bytes.
        session.note(of_model(1, &"ö".repeat(LONGEST_NOTE))).unwrap();
        assert!(why(of_model(1, &"ö".repeat(LONGEST_NOTE + 1))).contains("and this one 4001: shorten it"));
        assert_eq!(session.node(1).unwrap().note.chars().count(), LONGEST_NOTE);
    }

    #[test]
    fn a_folder_from_before_there_were_notes_opens() {
        let folder = tempfile::tempdir().unwrap();
        let session = Session::open(folder.path()).unwrap();
        session.add_node(|id| Node::of(id, None, Model::thesis())).unwrap();
        drop(session);
        let old = r#"{"chosen":{"A.csv":"train"},"models":[{"id":1,"parent":null,"effect":null,"supported":null,"command":""}],"current":1}"#;
        std::fs::write(folder.path().join("lab/state.json"), old).unwrap();
        assert_eq!(Session::open(folder.path()).unwrap().document()["models"][0]["note"], "");
    }
}
