//! A campaign that is ready to be flown: on one machine or on many.

use std::path::{Path, PathBuf};

use control::Config;
use design::Gains;
use design::check::CoefficientErrors;
use design::gains_match::gains_match;
use design::plant::{Linear, TrimTarget};
use model::Model;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::definition::{Definition, Unknown};
use crate::draw::{Drawn, Flies};
use crate::error::CampaignError;
use crate::truncation::Truncation;

/// Version of the file.
const FORMAT: u32 = 1;
/// What is longer was not written by `campaign plan`.
const MOST_BYTES: u64 = 64 << 20;

/// A campaign that is ready to be flown: a JSON file that needs no other one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    format: u32,
    /// Of everything but the number of shards: parts of equal campaigns can be joined.
    pub campaign_sha256: String,
    /// Shards that it is flown in.
    pub shards: u64,
    /// What is flown.
    pub campaign: Campaign,
}

/// What is flown.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Campaign {
    /// Name, for people.
    pub name: String,
    /// Seed of everything that is drawn.
    pub seed: u64,
    /// How often everything that is not known is drawn.
    pub draws: u64,
    /// What is flown in each draw.
    pub scenarios: Vec<String>,
    /// The gains, by name.
    pub gains: Vec<NamedText>,
    /// The craft's model file; the thesis' craft without.
    pub model: Option<NamedText>,
    /// What is not known.
    pub unknown: Unknown,
}

/// A file's text with a name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedText {
    /// Name.
    pub name: String,
    /// Text of the file; of gains, nothing for those that are built in.
    pub text: Option<String>,
}

/// Gains that are built in, by name.
const BUILT_IN: [&str; 2] = ["designed", "thesis"];

/// One flight of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Case {
    /// Its number.
    pub number: u64,
    /// Which draw.
    pub draw: u64,
    /// Which of the scenarios.
    pub scenario: usize,
    /// Which of the gains.
    pub gains: usize,
}

/// A plan with its files read: what flies its cases.
pub(crate) struct Ready<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) model: Model,
    pub(crate) flies: Vec<Flies>,
    pub(crate) configs: Vec<Config>,
}

impl Plan {
    /// The plan of a definition; files that it names lie beside it.
    ///
    /// # Errors
    /// Files that cannot be read or do not fit together, and more cases than can be counted.
    pub fn new(definition: &Definition, path: &Path, shards: Option<u64>) -> Result<Self, CampaignError> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let text = |name: &str, file: &PathBuf| {
            let path = folder.join(file);
            let text = std::fs::read_to_string(&path).map_err(|why| CampaignError::Read { path, why })?;
            Ok(NamedText { name: name.to_owned(), text: Some(text) })
        };
        let model = definition.model.as_ref();
        let model = model.map(|file| text(&file.display().to_string(), file)).transpose()?;
        let mut gains: Vec<NamedText> = definition
            .gains
            .iter()
            .map(|(name, file)| text(name, file))
            .collect::<Result<_, CampaignError>>()?;
        if gains.is_empty() {
            if model.is_some() {
                return Err(CampaignError::content(
                    path,
                    "gains: none are named, and those that are built in are for the thesis' craft; name a gains file: [gains] mine = \
                     \"gains.toml\" (quadlab design makes one)",
                ));
            }
            gains = BUILT_IN.map(|name| NamedText { name: name.to_owned(), text: None }).into();
        }
        Self::of(definition, path, shards, model, gains)
    }

    /// The plan of a definition for a craft and gains that are given as the texts of their files, in the place of those it names.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn with(
        definition: &Definition,
        path: &Path,
        model: NamedText,
        gains: NamedText,
    ) -> Result<Self, CampaignError> {
        Self::of(definition, path, None, Some(model), vec![gains])
    }

    fn of(
        definition: &Definition,
        path: &Path,
        shards: Option<u64>,
        model: Option<NamedText>,
        gains: Vec<NamedText>,
    ) -> Result<Self, CampaignError> {
        let campaign = Campaign {
            name: definition.name.clone(),
            seed: definition.seed,
            draws: definition.draws,
            scenarios: definition.scenarios.clone(),
            gains,
            model,
            unknown: definition.unknown.clone(),
        };
        let campaign_sha256 = campaign.sha256();
        let mut plan = Self { format: FORMAT, campaign_sha256, shards: 1, campaign };
        let cases = plan.campaign.cases().filter(|cases| *cases <= MOST_CASES).ok_or_else(|| {
            let why = format!(
                "draws: {} draws times scenarios times gains are more than {} million flights, the most of a campaign; give fewer",
                plan.campaign.draws,
                MOST_CASES / 1_000_000
            );
            CampaignError::content(path, why)
        })?;
        plan.shards =
            shards.unwrap_or_else(|| cases.div_ceil(CASES_OF_A_SHARD)).clamp(1, cases.min(MOST_SHARDS));
        let model = plan.ready(path)?.model;
        let has_errors = CoefficientErrors::of(&model).is_some();
        if plan.campaign.unknown.coefficients && !has_errors {
            return Err(CampaignError::content(
                path,
                "unknown.coefficients: the model has no standard errors; give a model of quadlab identify",
            ));
        }
        Ok(plan)
    }

    /// Reads a plan.
    ///
    /// # Errors
    /// A file that cannot be read or is no plan.
    pub fn read(path: &Path) -> Result<Self, CampaignError> {
        let unreadable = |why| CampaignError::Read { path: path.into(), why };
        let length = std::fs::metadata(path).map_err(unreadable)?.len();
        if length > MOST_BYTES {
            return Err(CampaignError::content(
                path,
                "is longer than any plan; give the file of `campaign plan`",
            ));
        }
        let text = std::fs::read_to_string(path).map_err(unreadable)?;
        let plan: Self = serde_json::from_str(&text).map_err(|error| {
            // Of a file of another kind, where its first letter is wrong helps nobody.
            let why = if text.trim_start().starts_with('{') { format!(" ({error})") } else { String::new() };
            let why = format!("is not a campaign's plan{why}; make one with `quadlab campaign plan`");
            CampaignError::content(path, why)
        })?;
        plan.check(path)?;
        Ok(plan)
    }

    fn check(&self, path: &Path) -> Result<(), CampaignError> {
        let wrong = |why: String| Err(CampaignError::content(path, why));
        if self.format != FORMAT {
            return wrong(format!(
                "is a plan of format {}, and this program knows {FORMAT}; plan again",
                self.format
            ));
        }
        if self.campaign.sha256() != self.campaign_sha256 {
            return wrong("was changed after it was made; change the definition and plan again".into());
        }
        let cases = self.campaign.cases().unwrap_or(0);
        if cases == 0 || !(1..=cases.min(MOST_SHARDS)).contains(&self.shards) {
            return wrong(format!("{cases} cases in {} shards cannot be flown; plan again", self.shards));
        }
        Ok(())
    }

    /// As a file.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// How many cases there are.
    pub fn cases(&self) -> u64 {
        self.campaign.cases().unwrap_or(0)
    }

    /// A case by its number: the gains change fastest, then the scenarios, then the draws.
    ///
    /// # Errors
    /// A number that there is not.
    pub fn case(&self, number: u64) -> Result<Case, CampaignError> {
        let cases = self.cases();
        if number >= cases {
            return Err(CampaignError::NoSuchCase { case: number, cases });
        }
        let (gains, scenarios) = (self.campaign.gains.len() as u64, self.campaign.scenarios.len() as u64);
        let flight = number / gains;
        let [gains, scenario] = [number % gains, flight % scenarios].map(|place| place as usize);
        Ok(Case { number, draw: flight / scenarios, scenario, gains })
    }

    /// The cases of a shard: as many in each, but for one more in the first ones.
    ///
    /// # Errors
    /// A number that there is not.
    pub fn cases_of(&self, shard: u64) -> Result<std::ops::Range<u64>, CampaignError> {
        let (cases, shards) = (self.cases(), self.shards);
        if shard >= shards {
            return Err(CampaignError::NoSuchShard { shard, shards });
        }
        let start = |k: u64| cases / shards * k + (cases % shards).min(k);
        Ok(start(shard)..start(shard + 1))
    }

    /// The normal distributions that reach beyond what can be simulated, and are truncated there; none of a model that cannot be read.
    pub fn truncations(&self) -> Vec<Truncation> {
        self.campaign.model().map_or_else(|_| Vec::new(), |model| self.campaign.unknown.truncations(&model))
    }

    /// What is drawn for a draw, about the model of the plan.
    pub(crate) fn drawn(&self, draw: u64, model: &Model) -> Drawn {
        Drawn::new(self.campaign.seed, draw, &self.campaign.unknown, model)
    }

    /// With its texts read.
    pub(crate) fn ready(&self, path: &Path) -> Result<Ready<'_>, CampaignError> {
        let wrong = |why: String| CampaignError::content(path, why);
        let campaign = &self.campaign;
        let model = campaign.model().map_err(wrong)?;
        if let Some(why) = campaign.unknown.refused(&model) {
            return Err(wrong(why));
        }
        let flies = campaign.scenarios.iter().map(|name| Flies::named(name));
        let flies = flies.collect::<Result<_, _>>().map_err(|why| wrong(format!("scenarios: {why}")))?;
        let config = |gains: &NamedText| match (&gains.text, gains.name.as_str()) {
            (Some(text), name) => {
                let read = Gains::parse(text, Path::new(name)).map_err(|why| wrong(why.to_string()))?;
                let matches = Linear::new(&model, &TrimTarget::default())
                    .and_then(|linear| gains_match(&read, &model, &linear, Path::new(name)));
                matches.map_err(|why| wrong(why.to_string()))?;
                Ok(read.config)
            }
            (None, "thesis") => Ok(Config::thesis()),
            (None, "designed") => sil::designed_config().map_err(|why| wrong(why.to_string())),
            (None, other) => Err(wrong(format!("gains {other}: no such gains are built in"))),
        };
        let configs = campaign.gains.iter().map(config).collect::<Result<_, _>>()?;
        Ok(Ready { plan: self, model, flies, configs })
    }
}

/// About so many flights take some seconds.
const CASES_OF_A_SHARD: u64 = 2000;
/// Most shards of a plan: each is two files.
pub const MOST_SHARDS: u64 = 100_000;
/// Most flights of a campaign: each shard and the report hold their flights in memory.
const MOST_CASES: u64 = MOST_SHARDS * CASES_OF_A_SHARD;

impl Campaign {
    /// The craft's model, or why it is none.
    fn model(&self) -> Result<Model, String> {
        let Some(NamedText { name, text }) = &self.model else { return Ok(Model::thesis()) };
        Model::parse(text.as_deref().unwrap_or_default(), Path::new(name)).map_err(|why| why.to_string())
    }

    fn cases(&self) -> Option<u64> {
        let each = (self.scenarios.len() as u64).checked_mul(self.gains.len() as u64)?;
        self.draws.checked_mul(each)
    }

    fn sha256(&self) -> String {
        let text = serde_json::to_string(self).unwrap_or_default();
        hex(&Sha256::digest(text))
    }
}

/// Bytes as people write them.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
