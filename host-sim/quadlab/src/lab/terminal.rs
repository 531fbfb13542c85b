//! The same in a terminal: the commands that the page shows.

use std::path::PathBuf;

use super::flights::Use;
use super::session::Session;
use super::store::effect_file;
use crate::cli::model_files::VEHICLE;

impl Session {
    /// The command that takes the same flights, with what comes before them.
    pub(super) fn command(&self, before: &str) -> String {
        let [train, validate] = [Use::Train, Use::Validate].map(|used| self.files(used));
        let sets = match (&train[..], &validate[..]) {
            (all, []) | ([], all) => names(all),
            _ => format!("--train {} --validate {}", names(&train), names(&validate)),
        };
        format!("quadlab {before} {sets}{}", self.effects_option())
    }

    /// ` --effects lab/effects/ID.toml`, where there are effects of the user's own; it stands after all files.
    pub(super) fn effects_option(&self) -> String {
        let files: String =
            self.own_effects().iter().map(|effect| format!(" {}", effect_file(effect.id()))).collect();
        if files.is_empty() { files } else { format!(" --effects{files}") }
    }

    /// ` --vehicle vehicle.toml`, where there is one.
    pub(super) fn vehicle_option(&self) -> &'static str {
        if self.folder.join(VEHICLE).is_file() { " --vehicle vehicle.toml" } else { "" }
    }
}

/// Names of files as a shell takes them.
pub(super) fn names(paths: &[PathBuf]) -> String {
    let names = paths.iter().filter_map(|path| path.file_name());
    names.map(|name| quoted(&name.to_string_lossy())).collect::<Vec<_>>().join(" ")
}

/// A word of a shell.
fn quoted(name: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || "._-/".contains(c);
    if name.chars().all(is_plain) { name.to_owned() } else { format!("'{}'", name.replace('\'', r"'\''")) }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_shell_takes_a_name_for_one_word() {
        assert_eq!(quoted("run-1.csv"), "run-1.csv");
        assert_eq!(quoted("it's $HOME.csv"), r"'it'\''s $HOME.csv'");
    }
}
