//! How often gains lose the craft over everything that is not known, before they are written.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use campaign::{Definition, NamedText, Plan, Rate, Summary, merge, run_shard};
use report::significant;

use crate::cli::progress;
use crate::commands::campaign::check_allowed;
use crate::render::campaign::scenario_of;

/// What the gains are asked for.
#[derive(clap::Args)]
pub(crate) struct LossOptions {
    /// Campaign to fly with the gains before they are written: scenarios and what is not known; its model and gains are those of the
    /// design, for example: --campaign campaign.toml
    #[arg(long, value_name = "TOML", requires = "allow")]
    pub(crate) campaign: Option<PathBuf>,

    /// Most losses allowed, percent of the draws: "--allow 0.1" asks for fewer than 1 in 1,000, by the upper end of the 95 % interval in
    /// every scenario
    #[arg(long, value_name = "PERCENT", requires = "campaign")]
    allow: Option<f64>,
}

/// What a campaign said of gains.
pub(crate) struct Losses {
    pub(crate) rates: Vec<Rate>,
    /// Draws that count nowhere: the craft cannot hover in them, whoever flies it.
    impossible: u64,
    allowed_percent: f64,
}

impl Losses {
    /// Whether as few draws are lost as are allowed, wherever they are counted.
    pub(crate) fn hold(&self) -> bool {
        self.rates.iter().all(|rate| rate.lost_interval_percent[1] < self.allowed_percent)
    }

    /// A line for each scenario.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for rate in &self.rates {
            let holds = rate.lost_interval_percent[1] < self.allowed_percent;
            let [low, high] = rate.lost_interval_percent.map(|percent| significant(percent, 2));
            let verdict = match (holds, rate.lost_interval_percent[0] > self.allowed_percent) {
                (true, _) => "met: ",
                (false, true) => "NOT MET: ",
                (false, false) => "NOT SHOWN: ",
            };
            let _ = writeln!(
                text,
                "{verdict}lost in {}: {} of {} draws (95 % interval {low} to {high} %), fewer than {} % wanted",
                scenario_of(rate),
                rate.lost,
                rate.draws,
                self.allowed_percent
            );
        }
        if self.impossible > 0 {
            let _ = writeln!(
                text,
                "{} further draws are left out: the craft cannot hover in them, whatever the gains",
                self.impossible
            );
        }
        if !self.hold() {
            text.push_str(
                "no gains written: allow more, make less uncertain, or ask for other margins; where it is not shown, more draws may show it\n",
            );
        }
        text
    }
}

/// Flies the campaign with gains.
pub(crate) fn fly(
    options: &LossOptions,
    model: &Path,
    gains: &str,
    json: bool,
) -> anyhow::Result<Option<Losses>> {
    let (Some(path), Some(allowed_percent)) = (&options.campaign, options.allow) else { return Ok(None) };
    let definition = Definition::read(path)?;
    check_allowed(allowed_percent, definition.draws)?;
    let text = |name: &str, text: &str| NamedText { name: name.to_owned(), text: Some(text.to_owned()) };
    let file = text(&model.display().to_string(), &std::fs::read_to_string(model)?);
    let plan = Plan::with(&definition, path, file, text("designed", gains))?;
    let parts = tempfile::tempdir()?;
    let (progress, done, lost) =
        (progress::bar(plan.cases() as usize, json), AtomicU64::new(0), AtomicU64::new(0));
    let told = |flown: u64, lost_now: u64| {
        let done = done.fetch_add(flown, Ordering::Relaxed) + flown;
        let lost = lost.fetch_add(lost_now, Ordering::Relaxed) + lost_now;
        progress.set_activity(&format!("flying, {lost} lost"), done, plan.cases());
    };
    for shard in 0..plan.shards {
        run_shard(&plan, path, shard, parts.path(), &told)?;
    }
    progress.finish_and_clear();
    let (table, _) = merge(&plan, parts.path(), "quadlab design")?;
    let summary = Summary::new(&plan, &table)
        .ok_or_else(|| anyhow::anyhow!("{}: its flights cannot be summed up", path.display()))?;
    Ok(Some(Losses { rates: summary.rates, impossible: summary.impossible, allowed_percent }))
}
