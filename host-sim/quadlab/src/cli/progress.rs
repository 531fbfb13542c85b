//! Progress on standard error: a bar where a person watches, nothing with `--json` or in a pipe.

use indicatif::{ProgressBar, ProgressStyle};

/// A bar of `steps` steps with a message; hidden where standard error is no terminal.
pub(crate) fn bar(steps: usize, json: bool) -> ProgressBar {
    if json {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{bar:20} {pos}/{len} {msg}")
        .expect("the template in the source is well-formed");
    ProgressBar::new(steps as u64).with_style(style)
}

/// A spinner for work whose number of steps is not known.
pub(crate) fn spinner(json: bool) -> ProgressBar {
    if json {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {elapsed} {msg}")
        .expect("the template in the source is well-formed");
    let spinner = ProgressBar::new_spinner().with_style(style);
    spinner.enable_steady_tick(std::time::Duration::from_millis(100));
    spinner
}
