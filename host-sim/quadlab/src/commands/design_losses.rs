//! How often gains lose the craft over everything that is not known, before they are written.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use campaign::{Answer, Definition, NamedText, Plan, Rate, Summary, merge};
use report::significant;

use crate::commands::campaign::{check_allowed, fly_shards};
use crate::render::campaign::scenario_of;

/// What the gains are asked for.
#[derive(clap::Args)]
pub(crate) struct LossOptions {
    /// Campaign to fly with the gains before they are written: scenarios and what is not known; its model and gains are those of the
    /// design, for example: --campaign campaign.toml
    #[arg(long, value_name = "TOML", requires = "allow")]
    pub(crate) campaign: Option<PathBuf>,

    /// Maximum losses allowed, percent of the draws: "--allow 0.1" requires the upper end of the 95 % interval to be below 1 in 1,000 in
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
        self.rates.iter().all(|rate| rate.is_below(self.allowed_percent) == Answer::Shown)
    }

    /// A line for each scenario.
    pub(crate) fn text(&self) -> String {
        let mut text = String::new();
        for rate in &self.rates {
            let verdict = match rate.is_below(self.allowed_percent) {
                Answer::Shown => "met",
                Answer::Refuted => "NOT MET",
                Answer::Open => "NOT SHOWN",
            };
            let [low, high] = rate.lost_interval_percent.map(|percent| significant(percent, 2));
            let _ = writeln!(
                text,
                "{verdict}: lost in {}: {} of {} draws (95 % interval {low} to {high} %), fewer than {} % wanted",
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
                "no gains written: allow more losses, narrow the uncertainty, or change the margins; where it is not shown, more draws may show it\n",
            );
        }
        text
    }
}

/// A campaign that can show what is asked.
pub(crate) struct Asked<'a> {
    definition: Definition,
    path: &'a Path,
    allowed_percent: f64,
}

impl LossOptions {
    /// What is asked; nothing where nothing is.
    pub(crate) fn asked(&self) -> anyhow::Result<Option<Asked<'_>>> {
        let (Some(path), Some(allowed_percent)) = (&self.campaign, self.allow) else { return Ok(None) };
        let definition = Definition::read(path)?;
        check_allowed(allowed_percent, definition.draws)?;
        Ok(Some(Asked { definition, path, allowed_percent }))
    }
}

impl Asked<'_> {
    /// Flies the campaign with gains on a model: the texts of both.
    pub(crate) fn fly(&self, model: NamedText, gains: &str, json: bool) -> anyhow::Result<Losses> {
        let gains = NamedText { name: "designed".to_owned(), text: Some(gains.to_owned()) };
        let plan = Plan::with(&self.definition, self.path, model, gains)?;
        let parts = tempfile::tempdir()?;
        let shards: Vec<u64> = (0..plan.shards).collect();
        fly_shards((&plan, self.path), &shards, parts.path(), json)?;
        let (table, _) = merge(&plan, parts.path(), "quadlab design")?;
        let summary = Summary::new(&plan, &table)
            .ok_or_else(|| anyhow::anyhow!("{}: its flights cannot be summed up", self.path.display()))?;
        let allowed_percent = self.allowed_percent;
        Ok(Losses { rates: summary.rates, impossible: summary.impossible, allowed_percent })
    }
}
