//! Files as a shell takes them.

use std::path::PathBuf;

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
