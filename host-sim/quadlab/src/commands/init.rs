//! `quadlab init`: a vehicle file from logs, with what must be measured marked.

use std::path::PathBuf;

use crate::cli::logs::{draft, read_logs, refused};
use crate::cli::output::{Outcome, OutputOptions};
use crate::render::import_text::to_measure;

/// Make a vehicle file from logs and mark what you still have to measure.
///
/// Fills in motor order, spin, command range and rotor positions, air density and gravity where the logs have them. Mass, sizes
/// and the tracked point must be measured: the file says how. Until then the file holds typical values, and every command warns
/// you of that.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  quadlab init log.ulg --out vehicle.toml")]
pub(crate) struct Options {
    /// Logs of the craft: files, folders or patterns such as '*.ulg'
    #[arg(value_name = "LOG", num_args = 1.., required = true)]
    logs: Vec<PathBuf>,

    /// Vehicle file to write, for example: --out vehicle.toml
    #[arg(long, value_name = "TOML")]
    out: PathBuf,

    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    options.output.check([&options.out], &options.logs.iter().collect::<Vec<_>>())?;
    let read = read_logs(&options.logs, options.output.json)?;
    let refused = refused(&read);
    let Some(draft) = draft(&read)? else {
        let first = refused.into_iter().next();
        anyhow::bail!(
            first.unwrap_or_else(|| "no flight in these logs: there is no craft to describe".into())
        );
    };
    report::write_atomic(&options.out, draft.to_toml())?;
    let outcome = if options.output.json {
        let missing: Vec<String> =
            draft.missing.iter().map(|(field, how)| format!("{field}: {how}")).collect();
        Outcome::json(
            &serde_json::json!({ "vehicle": options.out.display().to_string(), "missing": missing }),
        )?
    } else {
        Outcome::done(format!("{}vehicle file written to {}\n", to_measure(&draft), options.out.display()))
    };
    Ok(Outcome { refused, ..outcome })
}
