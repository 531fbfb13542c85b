//! Scripts that a browser runs: the TypeScript compiler reads their JSDoc types and says what does not fit, and what is
//! not used. Nothing is compiled: what is in the repository is what is served.

use std::process::Command;

use anyhow::Result;

use super::tidy::listed_files;
use crate::base::workspace;

/// Where the scripts are that the product serves or writes into pages.
const PRODUCT: &str = "host-sim/";

/// What is checked, as options of `tsc`.
const OPTIONS: &str = "--noEmit --allowJs --checkJs --strict --noUnusedLocals --noUnusedParameters --noImplicitReturns \
    --noFallthroughCasesInSwitch --allowUnreachableCode false --target es2022 --module es2022 \
    --moduleResolution bundler --lib es2023,dom,dom.iterable --pretty false";

/// The command that checks all scripts.
pub(crate) fn command() -> Result<Command> {
    let files = listed_files(&["--cached", "--others", "--exclude-standard"])?;
    let mut command = Command::new("tsc");
    command.current_dir(workspace::root()).args(OPTIONS.split_whitespace());
    command.args(files.into_iter().filter(|file| is_script(file)));
    Ok(command)
}

fn is_script(file: &str) -> bool {
    file.starts_with(PRODUCT) && file.ends_with(".js")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_scripts_of_the_product_are_checked() {
        let command = command().unwrap();
        let named: Vec<&str> = command.get_args().filter_map(|name| name.to_str()).collect();
        assert!(named.contains(&"host-sim/quadlab/src/lab/page/main.js"), "{named:?}");
        assert!(is_script("host-sim/report/src/page.js"));
        assert!(!is_script("tests/tests/lab_page/contrast.js"), "it is the body of a function");
    }
}
