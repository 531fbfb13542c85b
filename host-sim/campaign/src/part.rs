//! Shards: parts of a campaign, each written whole or not at all.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::error::CampaignError;
use crate::flown::Flown;
use crate::plan::{Case, Plan, hex};
use table::{Table, Values};

/// What is told beside a part: the part counts once this is there.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Seal {
    /// Of the campaign.
    pub(crate) campaign_sha256: String,
    /// Which shard of how many.
    pub(crate) shard: u64,
    pub(crate) shards: u64,
    /// First case, and the one after the last.
    pub(crate) cases: [u64; 2],
    /// Of the part's file.
    pub(crate) part_sha256: String,
    /// Of the program that flew it.
    pub(crate) program_sha256: String,
}

/// The file of a shard's part.
pub fn part_path(folder: &Path, shard: u64, shards: u64) -> PathBuf {
    folder.join(format!("part-{shard:06}-of-{shards:06}.parquet"))
}

/// The file that says that a part is whole.
pub(crate) fn seal_path(folder: &Path, shard: u64, shards: u64) -> PathBuf {
    part_path(folder, shard, shards).with_extension("json")
}

/// The seal of a shard, where it was flown; nothing where it was not, or not to the end.
pub(crate) fn sealed(folder: &Path, shard: u64, shards: u64) -> Option<Seal> {
    let text = std::fs::read_to_string(seal_path(folder, shard, shards)).ok()?;
    serde_json::from_str(&text).ok()
}

/// Most cases that one core flies side by side. The more there are, the fewer lanes are empty at their end.
const TOGETHER: usize = 128;

/// Cases that each of `cores` flies side by side where there are `count`: so many that each has some.
pub(crate) fn together(count: usize, cores: usize) -> usize {
    count.div_ceil(cores.max(1)).clamp(1, TOGETHER)
}

/// When a shard was flown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShardFlown {
    /// Its part was there already.
    Before,
    /// Now.
    Now,
    /// Now, because its part was damaged.
    Again,
}

/// Flies a shard of a plan into a folder, on all cores, unless its part is there already and whole; `told` hears how many cases were flown
/// and how many of these were lost.
///
/// # Errors
/// A folder of another campaign, a file that cannot be written, or a flight that cannot be flown.
pub fn run_shard(
    plan: &Plan,
    plan_path: &Path,
    shard: u64,
    folder: &Path,
    told: &(dyn Fn(u64, u64) + Sync),
) -> Result<ShardFlown, CampaignError> {
    let cases = plan.cases_of(shard)?;
    let write =
        |path: &Path, why: &dyn ToString| CampaignError::Write { path: path.into(), why: why.to_string() };
    std::fs::create_dir_all(folder).map_err(|why| write(folder, &why))?;
    claim(plan, folder)?;
    let seal = sealed(folder, shard, plan.shards);
    if seal.as_ref().is_some_and(|seal| seal.campaign_sha256 != plan.campaign_sha256) {
        return Err(CampaignError::OtherCampaign(folder.into()));
    }
    if seal.as_ref().is_some_and(|seal| of_shard(plan, folder, shard, seal).is_ok()) {
        return Ok(ShardFlown::Before);
    }
    let ready = plan.ready(plan_path)?;
    let mut all = Vec::new();
    let cores = rayon::current_num_threads();
    let together = together((cases.end - cases.start) as usize, cores);
    // Somebody hears of them when each core has flown some.
    let at_once = together * cores.max(2);
    for first in cases.clone().step_by(at_once) {
        let some: Vec<u64> = (first..cases.end.min(first + at_once as u64)).collect();
        let flown: Vec<Vec<Flown>> = some
            .par_chunks(together)
            .map(|numbers| ready.flown(numbers))
            .collect::<Result<_, CampaignError>>()?;
        let flown = flown.concat();
        told(flown.len() as u64, flown.iter().filter(|one| one.lost.is_some()).count() as u64);
        all.extend(flown);
    }
    let path = part_path(folder, shard, plan.shards);
    let had_part = seal.is_some();
    let bytes = table(plan, &all).to_parquet().map_err(|why| write(&path, &why))?;
    report::write_atomic(&path, &bytes).map_err(|why| write(&path, &why))?;
    let seal = Seal {
        campaign_sha256: plan.campaign_sha256.clone(),
        shard,
        shards: plan.shards,
        cases: [cases.start, cases.end],
        part_sha256: hex(&Sha256::digest(&bytes)),
        program_sha256: program_sha256(),
    };
    let path = seal_path(folder, shard, plan.shards);
    let text = serde_json::to_string_pretty(&seal).unwrap_or_default() + "\n";
    report::write_atomic(&path, text).map_err(|why| write(&path, &why))?;
    Ok(if had_part { ShardFlown::Again } else { ShardFlown::Now })
}

/// The table of a shard's part, which is whole and the shard's own.
///
/// # Errors
/// A part that is missing or damaged, or of another campaign.
pub(crate) fn of_shard(plan: &Plan, folder: &Path, shard: u64, seal: &Seal) -> Result<Table, CampaignError> {
    let path = part_path(folder, shard, plan.shards);
    let wrong = |why: &str| CampaignError::content(&path, why);
    let cases = plan.cases_of(shard)?;
    if seal.campaign_sha256 != plan.campaign_sha256 || seal.cases != [cases.start, cases.end] {
        return Err(wrong("is a part of another campaign; remove it and its .json, and fly the shard again"));
    }
    let bytes = std::fs::read(&path).map_err(|why| CampaignError::Read { path: path.clone(), why })?;
    if hex(&Sha256::digest(&bytes)) != seal.part_sha256 {
        return Err(wrong("is damaged; `quadlab campaign run` flies its shard again"));
    }
    let part = Table::from_parquet(bytes).map_err(|why| CampaignError::content(&path, why))?;
    let numbers = part.whole("case").unwrap_or_default();
    if !numbers.iter().map(|number| *number as u64).eq(cases) {
        return Err(wrong(
            "does not hold the cases of its shard; remove it and its .json, and fly the shard again",
        ));
    }
    Ok(part)
}

/// The file that says whose parts a folder holds.
const CLAIM: &str = "campaign.json";

fn claim_of(plan: &Plan) -> String {
    format!("{{ \"campaign_sha256\": \"{}\" }}\n", plan.campaign_sha256)
}

/// Whether a folder holds another campaign.
pub(crate) fn is_of_another(plan: &Plan, folder: &Path) -> bool {
    std::fs::read_to_string(folder.join(CLAIM)).is_ok_and(|own| own != claim_of(plan))
}

/// Makes a folder that of a campaign.
///
/// # Errors
/// A folder that is one of another campaign, which stays as it is, or that cannot be written to.
pub fn claim(plan: &Plan, folder: &Path) -> Result<(), CampaignError> {
    if is_of_another(plan, folder) {
        return Err(CampaignError::OtherCampaign(folder.into()));
    }
    let path = folder.join(CLAIM);
    if path.exists() {
        return Ok(());
    }
    report::write_atomic(&path, claim_of(plan))
        .map_err(|why| CampaignError::Write { path, why: why.to_string() })
}

/// Of the program that runs: parts of different programs may differ. It is read once, however many shards it flies.
fn program_sha256() -> String {
    static OWN: OnceLock<String> = OnceLock::new();
    let read = || {
        let digest = std::env::current_exe().and_then(|program| file_sha256(&program));
        digest.map_or_else(|_| "unknown".into(), |digest| hex(&digest))
    };
    OWN.get_or_init(read).clone()
}

/// Of a file, a piece at a time: fresh memory for a large one takes as long as its digest.
fn file_sha256(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = std::fs::File::open(path)?;
    let mut piece = vec![0; 1 << 16];
    let mut digest = Sha256::new();
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Ok(digest.finalize().to_vec()),
            Ok(count) => digest.update(&piece[..count]),
            Err(why) if why.kind() == std::io::ErrorKind::Interrupted => {}
            Err(why) => return Err(why),
        }
    }
}

/// Key of the campaign in tables.
pub(crate) const CAMPAIGN: &str = "campaign_sha256";

/// Cases as a table: a row each.
fn table(plan: &Plan, flown: &[Flown]) -> Table {
    let mut table =
        Table { about: vec![(CAMPAIGN.into(), plan.campaign_sha256.clone())], ..Table::default() };
    let whole =
        |of: &dyn Fn(&Case) -> u64| Values::Whole(flown.iter().map(|one| of(&one.case) as i64).collect());
    let text = |of: &dyn Fn(&Flown) -> String| Values::Text(flown.iter().map(of).collect());
    let real = |of: &dyn Fn(&Flown) -> f64| Values::Real(flown.iter().map(of).collect());
    let flag = |of: &dyn Fn(&Flown) -> bool| Values::Flag(flown.iter().map(of).collect());
    let campaign = &plan.campaign;
    table.push("case", whole(&|case| case.number));
    table.push("draw", whole(&|case| case.draw));
    table.push("scenario", text(&|one| campaign.scenarios[one.case.scenario].clone()));
    table.push("gains", text(&|one| campaign.gains[one.case.gains].name.clone()));
    table.push("seed", text(&|one| one.drawn.seed.to_string()));
    table.push("lost", flag(&|one| one.lost.is_some()));
    table.push("lost_by", text(&|one| one.lost.as_ref().map(|(why, _)| why.clone()).unwrap_or_default()));
    table.push("lost_after_s", real(&|one| one.lost.as_ref().map_or(f64::NAN, |(_, at_s)| *at_s)));
    table.push("impossible", flag(&|one| one.impossible.is_some()));
    table.push(
        "requirements_hold",
        text(&|one| match one.requirements_hold {
            Some(true) => "yes".into(),
            Some(false) => "no".into(),
            None => String::new(),
        }),
    );
    table.push("ended", text(&|one| one.ended.clone()));
    table.push("events", text(&|one| one.events.clone()));
    table.push(
        "fault",
        text(&|one| one.drawn.fault.map(|fault| fault.kind.name().to_owned()).unwrap_or_default()),
    );
    table.push("overshoot_percent", real(&|one| one.overshoot_percent));
    table.push("rise_s", real(&|one| one.rise_s));
    table.push("tilt_deg", real(&|one| one.tilt_deg));
    table.push("height_error_m", real(&|one| one.height_error_m));
    table.push("saturated_percent", real(&|one| one.saturated_percent));
    let names = flown.first().map_or(&[][..], |one| &one.drawn.inputs[..]);
    for (place, input) in names.iter().enumerate() {
        table.push(format!("{INPUT}{}", input.name), real(&|one| one.drawn.inputs[place].value));
    }
    table
}

/// What names of columns begin with that hold what was drawn.
pub(crate) const INPUT: &str = "drawn.";
