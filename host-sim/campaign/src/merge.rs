//! Joining the parts of a campaign.

use std::path::Path;

use crate::error::CampaignError;
use crate::part::{CAMPAIGN, is_of_another, of_shard, part_path, sealed};
use crate::plan::Plan;
use table::Table;

/// Name of the file with all cases.
pub const MERGED: &str = "cases.parquet";

/// Joins the parts in a folder into one table, in the order of the cases: the same bytes, however many parts there were and in whichever
/// order they were flown. Returns the table and its file.
///
/// # Errors
/// Parts that are missing, with the command that flies them; parts that are damaged, or of another campaign or program.
pub fn merge(plan: &Plan, folder: &Path, command: &str) -> Result<(Table, Vec<u8>), CampaignError> {
    if is_of_another(plan, folder) {
        return Err(CampaignError::OtherParts(folder.into()));
    }
    let seals: Vec<_> = (0..plan.shards).map(|shard| sealed(folder, shard, plan.shards)).collect();
    let missing: Vec<u64> =
        (0..).zip(&seals).filter(|(_, seal)| seal.is_none()).map(|(shard, _)| shard).collect();
    if !missing.is_empty() {
        return Err(CampaignError::Missing {
            folder: folder.into(),
            parts: plan.shards,
            missing,
            command: command.to_owned(),
        });
    }
    let mut all = Table::default();
    let mut program: Option<String> = None;
    for (shard, seal) in (0..).zip(seals.into_iter().flatten()) {
        let part = of_shard(plan, folder, shard, &seal)?;
        let wrong = |why: &str| CampaignError::content(part_path(folder, shard, plan.shards), why);
        if *program.get_or_insert_with(|| seal.program_sha256.clone()) != seal.program_sha256 {
            return Err(wrong(
                "was flown by another version of this program than the parts before it; remove it and its .json, and fly the shard again",
            ));
        }
        if !all.append(part) {
            return Err(wrong(
                "has other columns than the parts before it; remove it and its .json, and fly the shard again",
            ));
        }
    }
    all.about = vec![(CAMPAIGN.into(), plan.campaign_sha256.clone())];
    let bytes = all.to_parquet().map_err(|why| CampaignError::content(folder.join(MERGED), why))?;
    Ok((all, bytes))
}
