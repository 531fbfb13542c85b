//! Refinement on the command line.

use schemars::JsonSchema;
use serde::Serialize;
use sysid::RefinementOutcome;
use sysid::compare::HorizonError;
use sysid::fit::output_error::Rows;

/// Whether to refine, and what.
#[derive(clap::Args)]
pub(crate) struct RefineOptions {
    /// Refine the coefficients of the moments, or all, so that open-loop predictions over half a second fit best.
    /// Kept only if the held-out flights are predicted better. For example: --refine, or --refine all
    #[arg(long, value_name = "ROWS", num_args = 0..=1, default_missing_value = "moments")]
    refine: Option<Refined>,
}

/// Which coefficients are refined.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Refined {
    /// Coefficients that act on p, q and r only; those of the forces keep the values of the fit
    Moments,
    /// Every linear coefficient
    All,
}

impl RefineOptions {
    /// What to refine.
    pub(crate) fn rows(&self) -> Option<Rows> {
        self.refine.map(|refined| match refined {
            Refined::Moments => Rows::Moments,
            Refined::All => Rows::All,
        })
    }
}

/// What a refinement did, for JSON.
#[derive(Serialize, JsonSchema)]
pub(crate) struct RefinementEntry {
    rows: Rows,
    kept: bool,
    reason: String,
    before: HorizonError,
    after: HorizonError,
}

impl From<&RefinementOutcome> for RefinementEntry {
    fn from(o: &RefinementOutcome) -> Self {
        Self { rows: o.rows, kept: o.kept, reason: o.reason.clone(), before: o.before, after: o.after }
    }
}

/// What a refinement did, in one sentence.
pub(crate) fn sentence(outcome: &RefinementOutcome) -> String {
    format!("Refinement {}: {}.", if outcome.kept { "kept" } else { "not kept" }, outcome.reason)
}
