//! `quadlab campaign search`: the worst that what is not known can do, by search.

use std::fmt::Write as _;
use std::path::PathBuf;

use campaign::{Found, Plan, Wanted};
use report::significant;

use crate::cli::output::{Outcome, OutputOptions, provenance};
use crate::render;

/// Search the uncertain ranges for a loss, and fly as many random draws for comparison. Exit status 1 if a loss is found
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Plan file
    #[arg(value_name = "JSON")]
    plan: PathBuf,

    /// Gains to try [default: the first of the plan]
    #[arg(long, value_name = "NAME")]
    gains: Option<String>,

    /// Scenario to fly [default: the first of the plan]
    #[arg(long, value_name = "NAME")]
    scenario: Option<String>,

    /// Flights of the search, rounded up to a multiple of 24, and as many random draws
    #[arg(long, value_name = "N", default_value_t = 480, value_parser = clap::value_parser!(u64).range(48..=1_000_000))]
    flights: u64,

    /// Seed of the search
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Page to write, for example: --html search.html
    #[arg(long, value_name = "HTML")]
    html: Option<PathBuf>,

    #[command(flatten)]
    output: OutputOptions,
}

pub(crate) fn run(options: &Options) -> anyhow::Result<Outcome> {
    options.output.check(&options.html, &[&options.plan])?;
    let plan = Plan::read(&options.plan)?;
    let Options { gains, scenario, flights, seed, .. } = options;
    let wanted = Wanted { gains: gains.clone(), scenario: scenario.clone(), flights: *flights, seed: *seed };
    let found = plan.search(&wanted, &options.plan)?;
    let sentence = sentence(&found);
    if let Some(path) = &options.html {
        let page =
            render::campaign::search_page(&found, &sentence).provenance(provenance(&[&options.plan], []));
        report::write_atomic(path, page.render())?;
    }
    let outcome =
        if options.output.json { Outcome::json(&found)? } else { Outcome::done(text(&found, &sentence)) };
    Ok(Outcome { holds: found.lost_by.is_none(), ..outcome })
}

fn text(found: &Found, sentence: &str) -> String {
    let mut text = render::grid::paragraph(sentence);
    for one in &found.worst {
        let mark = if found.needs(&one.name) == Some(true) { "  (needed)" } else { "" };
        let _ = writeln!(
            text,
            "  {} = {} (nominal {}){mark}",
            one.name,
            significant(one.value, 4),
            significant(one.usual, 4)
        );
    }
    text
}

fn sentence(found: &Found) -> String {
    let Found { gains, scenario, flights, lost, sampled_lost, lost_by, after_s, tilt_deg, causes, .. } =
        found;
    let counts = format!(
        "{lost} of {flights} flights of the search were lost, and {sampled_lost} of {flights} that were drawn."
    );
    let (Some(why), Some(after_s)) = (lost_by, after_s) else {
        return format!(
            "The search found no loss in {scenario} under {gains}: the worst of {flights} flights tilts by {} deg. That does not \
             prove that there is none. {counts}",
            significant(*tilt_deg, 3)
        );
    };
    let enough = causes.as_ref().map_or_else(String::new, |causes| {
        let share = causes
            .enough_percent
            .filter(|percent| *percent < 99.0)
            .map(|percent| format!(", {} % of these deviations is enough", significant(percent, 2)));
        let needed = match causes.needed.len() {
            0 => "It is lost even with everything nominal".to_owned(),
            1 => "One value is enough".to_owned(),
            count => format!("{count} values together are enough"),
        };
        format!(" {needed}{}.", share.unwrap_or_default())
    });
    format!(
        "The worst flight of {scenario} under {gains} is lost after {after_s:.2} s: {why}.{enough} {counts}"
    )
}
