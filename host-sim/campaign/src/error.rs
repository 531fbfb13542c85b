//! Why a campaign cannot be planned, flown, merged or read.

use std::path::PathBuf;

/// Why a campaign cannot be planned, flown, merged or read: one line, with the file and what to do.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// A file that cannot be read.
    #[error("{}: cannot be read: {why}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        why: std::io::Error,
    },
    /// A file that cannot be written.
    #[error("{}: cannot be written: {why}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// A definition or plan that says something impossible.
    #[error("{}: {why}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What, and how to mend it.
        why: String,
    },
    /// A flight that cannot be flown at all.
    #[error("case {case}: {why}")]
    Flight {
        /// The case.
        case: u64,
        /// Why.
        why: String,
    },
    /// A folder that holds another campaign.
    #[error("{}: holds parts of another campaign; choose another folder with --out", .0.display())]
    OtherCampaign(PathBuf),
    /// A folder to read from that holds another campaign.
    #[error("{}: holds parts of another campaign; give the folder in which this plan was flown with --parts", .0.display())]
    OtherParts(PathBuf),
    /// Parts that are missing.
    #[error(
        "{}: {} with `{command}`",
        folder.display(), missing_shards(missing, *parts)
    )]
    Missing {
        /// Where they ought to be.
        folder: PathBuf,
        /// How many there are in all.
        parts: u64,
        /// Their numbers.
        missing: Vec<u64>,
        /// What flies them.
        command: String,
    },
    /// A shard that there is not.
    #[error("there is no shard {shard}: the plan has {}", numbered("shard", *shards))]
    NoSuchShard {
        /// Asked for.
        shard: u64,
        /// There are.
        shards: u64,
    },
    /// A case that there is not.
    #[error("there is no case {case}: the plan has {}", numbered("case", *cases))]
    NoSuchCase {
        /// Asked for.
        case: u64,
        /// There are.
        cases: u64,
    },
}

/// "shards 0 and 2 are missing (2 of 7); fly them".
fn missing_shards(missing: &[u64], parts: u64) -> String {
    let (shards, them) = match missing.len() {
        1 => ("shard", "is missing"),
        _ => ("shards", "are missing"),
    };
    let fly = if missing.len() == 1 { "it" } else { "them" };
    format!("{shards} {} {them} ({} of {parts}); fly {fly}", listed(missing), missing.len())
}

/// "cases 0 to 119".
fn numbered(what: &str, count: u64) -> String {
    match count {
        0 => format!("no {what}s"),
        1 => format!("only {what} 0"),
        more => format!("{what}s 0 to {}", more - 1),
    }
}

/// The first few.
fn listed(numbers: &[u64]) -> String {
    const FEW: usize = 10;
    let few: Vec<String> = numbers.iter().take(FEW).map(u64::to_string).collect();
    let more = if numbers.len() > FEW { ", ..." } else { "" };
    format!("{}{more}", few.join(", "))
}

impl CampaignError {
    pub(crate) fn content(path: impl Into<PathBuf>, why: impl ToString) -> Self {
        Self::Content { path: path.into(), why: why.to_string().lines().collect::<Vec<_>>().join(" ") }
    }
}
