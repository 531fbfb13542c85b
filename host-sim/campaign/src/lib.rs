//! Campaigns: many flights over everything that is not known of a craft, to learn how often its gains lose it.
//!
//! 1. A [`Definition`] (TOML) says which scenarios are flown under which gains, how often, and what is not known.
//! 2. A [`Plan`] holds all that with the texts of the model and of the gains: it is the same on every machine. Its cases are numbered;
//!    what is drawn for one follows from the campaign's seed and the case's number alone, so that any case can be flown again by itself.
//! 3. [`run_shard`] flies a part of the cases and writes it whole or not at all.
//! 4. [`merge`] joins the parts: the same bytes, however many there were.
//! 5. [`Summary`] says how often control was lost, with confidence intervals, which gains are better, and what drives it.
#![forbid(unsafe_code)]

mod case;
mod causes;
mod definition;
mod draw;
mod drivers;
mod error;
mod flown;
mod merge;
mod normal;
mod part;
mod plan;
mod search;
mod seen;
mod statistics;
mod summary;
mod truncation;

pub use case::CaseFlight;
pub use causes::{Causes, Needed};
pub use definition::{Definition, Samples, Spread, Unknown};
pub use draw::{Drawn, Input};
pub use drivers::{Driver, Group};
pub use error::CampaignError;
pub use flown::Flown;
pub use merge::{MERGED, merge};
pub use normal::Normal;
pub use part::{ShardFlown, claim, part_path, run_shard};
pub use plan::{Campaign, Case, MOST_SHARDS, NamedText, Plan};
pub use search::{Found, Wanted};
pub use statistics::{Interval, exact_interval, mcnemar_p_value, paired_interval};
pub use summary::{Answer, FaultRate, Pair, Rate, Summary, Worst};
pub use table::{Column, Table, Values};
pub use truncation::Truncation;
