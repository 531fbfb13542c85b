//! Joining the parts of a campaign.

use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::CampaignError;
use crate::part::{CAMPAIGN, part_path, sealed};
use crate::plan::{Plan, hex};
use table::Table;

/// Name of the file with all cases.
pub const MERGED: &str = "cases.parquet";

/// Joins the parts in a folder into one table, in the order of the cases: the same bytes, however many parts there were and in whichever
/// order they were flown. Returns the table and its file.
///
/// # Errors
/// Parts that are missing, with the command that flies them; parts that are damaged, or of another campaign or program.
pub fn merge(plan: &Plan, folder: &Path, command: &str) -> Result<(Table, Vec<u8>), CampaignError> {
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
        let path = part_path(folder, shard, plan.shards);
        let wrong = |why: &str| CampaignError::content(&path, why);
        let cases = plan.cases_of(shard)?;
        if seal.campaign_sha256 != plan.campaign_sha256 || seal.cases != [cases.start, cases.end] {
            return Err(wrong(
                "is a part of another campaign; remove it and its .json, and fly the shard again",
            ));
        }
        if *program.get_or_insert_with(|| seal.program_sha256.clone()) != seal.program_sha256 {
            return Err(wrong(
                "was flown by another version of this program than the parts before it; remove it and its .json, and fly the shard again",
            ));
        }
        let bytes = std::fs::read(&path).map_err(|why| CampaignError::Read { path: path.clone(), why })?;
        if hex(&Sha256::digest(&bytes)) != seal.part_sha256 {
            return Err(wrong("is damaged; remove it and its .json, and fly the shard again"));
        }
        let part = Table::from_parquet(bytes).map_err(|why| CampaignError::content(&path, why))?;
        let numbers = part.whole("case").unwrap_or_default();
        if !numbers.iter().map(|number| *number as u64).eq(cases) || !all.append(part) {
            return Err(wrong(
                "does not hold the cases of its shard; remove it and its .json, and fly the shard again",
            ));
        }
    }
    all.about = vec![(CAMPAIGN.into(), plan.campaign_sha256.clone())];
    let bytes = all.to_parquet().map_err(|why| CampaignError::content(folder.join(MERGED), why))?;
    Ok((all, bytes))
}
