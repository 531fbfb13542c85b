//! Which trials to run.

use anyhow::bail;
use model::Effect;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;
use stories::world::{OUTSIDE, PLANTED, Size, Style, changes};

use crate::arguments::Arguments;
use crate::condition::Condition;

/// Low, middle and high.
const STRENGTHS: [f64; 3] = [0.3, 0.75, 1.2];
/// Better than usual, usual, bad.
const NOISES: [f64; 3] = [0.8, 1.4, 2.0];
const SEEDS: u64 = 3;
/// Before what has changed, in labels.
pub(crate) const CHANGED: &str = "since then: ";
/// Trials with nothing hidden or changed, with two effects and with three, per seed.
const NOTHING_PER_SEED: u64 = 12;
const PAIRS_PER_SEED: u64 = 12;
const TRIPLES_PER_SEED: u64 = 6;
/// Trials with one effect of the catalogue and one that it does not have, per seed.
const BESIDE_PER_SEED: u64 = 12;
/// Where their draws begin, apart from those of pairs and triples.
const BESIDE_FROM: u64 = 1_000_000;
/// Trials with nothing hidden for each of an effect, where answers are counted.
const NOTHING_TO_COUNT: u64 = 9;
/// Trials of each condition, and in a quick run.
const EACH: [u64; 2] = [50, 2];
/// Names all conditions in `--only`.
const CONDITIONS: &str = "conditions";

/// What a world hides.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Hidden {
    /// A calm world.
    Nothing,
    /// One effect of the catalogue.
    One(&'static str),
    /// Two or three effects of the catalogue, each with its strength.
    Together(Vec<(&'static str, f64)>),
    /// What the catalogue does not have.
    Outside(&'static str),
    /// One effect of the catalogue, and beside it one that the catalogue does not have, each with its strength.
    Beside([(&'static str, f64); 2]),
    /// A craft whose model was good, and what happened to it since; nothing, perhaps.
    Change(Option<&'static str>),
}

/// One world, flown and diagnosed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Trial {
    pub(crate) hidden: Hidden,
    pub(crate) strength: f64,
    pub(crate) noise: f64,
    pub(crate) size: Size,
    pub(crate) seed: u64,
    pub(crate) duration_s: f64,
    /// Most effects to add one after the other.
    pub(crate) rounds: usize,
    pub(crate) style: Style,
    /// Whether it is asked how far the effect's error of prediction falls.
    pub(crate) predicts: bool,
    /// A log with jitter, lost rows and a gap.
    pub(crate) rough: bool,
    /// A log with gross outliers.
    pub(crate) outliers: bool,
    /// What makes the flights or logs difficult.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) condition: Option<Condition>,
}

impl Hidden {
    /// Whether more than one thing is hidden.
    pub(crate) fn is_several(&self) -> bool {
        matches!(self, Self::Together(_) | Self::Beside(_))
    }
}

impl Trial {
    /// Effects to plant.
    pub(crate) fn planted(&self) -> Vec<(&'static str, f64)> {
        match &self.hidden {
            Hidden::Nothing | Hidden::Change(None) => Vec::new(),
            Hidden::Change(Some(id)) => vec![(id, self.strength)],
            Hidden::One(id) | Hidden::Outside(id) => vec![(id, self.strength)],
            Hidden::Together(effects) => effects.clone(),
            Hidden::Beside(effects) => effects.to_vec(),
        }
    }

    /// Row of the confusion matrix.
    pub(crate) fn label(&self) -> String {
        match self.condition {
            Some(condition) => format!("{}: {}", condition.name(), self.hides()),
            None => self.hides(),
        }
    }

    fn hides(&self) -> String {
        match &self.hidden {
            Hidden::Nothing => "nothing".into(),
            Hidden::One(id) | Hidden::Outside(id) => (*id).into(),
            Hidden::Change(Some(id)) => format!("{CHANGED}{id}"),
            Hidden::Change(None) => format!("{CHANGED}nothing"),
            Hidden::Together(effects) => effects.iter().map(|(id, _)| *id).collect::<Vec<_>>().join(" + "),
            Hidden::Beside([(known, _), (unknown, _)]) => format!("{known} + {unknown}"),
        }
    }

    pub(crate) fn folder_name(&self) -> String {
        let label = self.label().replace(" + ", "-and-").replace(':', "").replace(' ', "-");
        format!("{label}-s{}-n{}-{}-{}", self.strength, self.noise, self.size.name(), self.seed)
    }
}

/// All trials, and what they are chosen from.
pub(crate) struct Plan {
    pub(crate) strengths: Vec<f64>,
    pub(crate) noises: Vec<f64>,
    pub(crate) seeds: u64,
    pub(crate) first_seed: u64,
    pub(crate) duration_s: f64,
    pub(crate) trials: Vec<Trial>,
}

/// Effects of the product's catalogue, and whether the worlds can hide them.
pub(crate) fn catalogue() -> Vec<(&'static str, bool)> {
    let can = |id: &str| PLANTED.iter().any(|p| p.id == id) && !changes().any(|change| change == id);
    Effect::candidates().map(|effect| (effect.id(), can(effect.id()))).collect()
}

/// What can happen to a craft of the worlds and is in the product's list of changes. A map that
/// leaves out the voltage was wrong from the start: nothing changes there.
fn changeable() -> impl Iterator<Item = &'static str> {
    let ids = Effect::changes().map(Effect::id);
    ids.filter(|id| *id != "battery-voltage" && PLANTED.iter().any(|planted| planted.id == *id))
}

/// The sizes of craft that an effect is tried on: all, or in a quick run one in turn.
struct Sizes {
    quick: bool,
    turn: usize,
}

impl Sizes {
    fn next(&mut self) -> Vec<Size> {
        self.turn += 1;
        if self.quick { vec![Size::MAIN[self.turn % 2]] } else { Size::MAIN.to_vec() }
    }
}

impl Plan {
    pub(crate) fn new(arguments: &Arguments) -> anyhow::Result<Self> {
        let mut plan = match arguments.counts {
            Some(trials) => Self::to_count(arguments, trials),
            None => Self::to_survey(arguments),
        };
        plan.keep_only(&arguments.only)?;
        Ok(plan)
    }

    /// As many trials of each effect and of pairs, and more with nothing hidden; what is asked of each is the ranking alone.
    fn to_count(arguments: &Arguments, trials: u64) -> Self {
        let one = |given: &[f64]| given.first().copied().unwrap_or(1.0);
        let mut plan = Self {
            strengths: vec![one(&arguments.strength)],
            noises: vec![one(&arguments.noise)],
            seeds: trials,
            first_seed: arguments.seed,
            duration_s: arguments.duration,
            trials: Vec::new(),
        };
        let known: Vec<&str> = catalogue().into_iter().filter(|(_, can)| *can).map(|(id, _)| id).collect();
        let (strength, noise) = (plan.strengths[0], plan.noises[0]);
        for id in &known {
            for k in 0..trials {
                plan.push(Hidden::One(id), strength, noise, Size::MAIN[(k / 3) as usize % 2], k, 1);
            }
        }
        plan.trials.iter_mut().for_each(|trial| trial.predicts = true);
        plan.without_effect(&Hidden::Nothing, NOTHING_TO_COUNT);
        for k in 0..trials {
            let effects = together(&known, 2, plan.first_seed, k);
            let strength = effects[0].1;
            plan.push(Hidden::Together(effects), strength, noise, Size::ALL[(k / 3) as usize % 3], k, 1);
        }
        plan
    }

    fn to_survey(arguments: &Arguments) -> Self {
        let chosen = |given: &[f64], all: &[f64], quick: f64| match (given.is_empty(), arguments.quick) {
            (false, _) => given.to_vec(),
            (true, true) => vec![quick],
            (true, false) => all.to_vec(),
        };
        let mut plan = Self {
            strengths: chosen(&arguments.strength, &STRENGTHS, STRENGTHS[1]),
            noises: chosen(&arguments.noise, &NOISES, NOISES[1]),
            seeds: arguments.seeds.unwrap_or(if arguments.quick { 1 } else { SEEDS }),
            first_seed: arguments.seed,
            duration_s: arguments.duration,
            trials: Vec::new(),
        };
        let known: Vec<&str> = catalogue().into_iter().filter(|(_, can)| *can).map(|(id, _)| id).collect();
        let unnamed = PLANTED
            .iter()
            .map(|p| p.id)
            .filter(|id| !known.contains(id) && !changes().any(|change| change == *id));
        let outside: Vec<&str> = unnamed.chain(OUTSIDE.iter().map(|p| p.id)).collect();
        let mut sizes = Sizes { quick: arguments.quick, turn: 0 };
        let rounds = if arguments.quick { 1 } else { 3 };
        for id in &known {
            plan.grid(&Hidden::One(id), &plan.strengths.clone(), &sizes.next(), rounds);
        }
        for &id in &outside {
            let strongest = plan.strengths[plan.strengths.len() - 1];
            plan.grid(&Hidden::Outside(id), &[strongest], &sizes.next(), 1);
        }
        let per_seed = |all: u64| if arguments.quick { all / 3 } else { all };
        plan.without_effect(&Hidden::Nothing, per_seed(NOTHING_PER_SEED));
        for (several, trials) in [(2, PAIRS_PER_SEED), (3, TRIPLES_PER_SEED)] {
            plan.several_effects(&known, several, per_seed(trials));
        }
        plan.beside(&known, &outside, per_seed(BESIDE_PER_SEED));
        plan.changes(&mut sizes);
        plan.without_effect(&Hidden::Change(None), per_seed(NOTHING_PER_SEED));
        plan.conditions(arguments.each.unwrap_or(EACH[usize::from(arguments.quick)]));
        plan
    }

    /// Trials in which there is nothing to find.
    fn without_effect(&mut self, hidden: &Hidden, per_seed: u64) {
        for k in 0..self.seeds * per_seed {
            let noise = self.noises[k as usize % self.noises.len()];
            self.push(hidden.clone(), 0.0, noise, Size::ALL[(k / 3) as usize % 3], k, 1);
        }
    }

    /// Trials with so many effects at once.
    fn several_effects(&mut self, known: &[&'static str], several: usize, per_seed: u64) {
        for k in 0..self.seeds * per_seed {
            let effects = together(known, several, self.first_seed, k);
            let noise = self.noises[k as usize % self.noises.len()];
            let (strength, size) = (effects[0].1, Size::ALL[(k / 3) as usize % 3]);
            self.push(Hidden::Together(effects), strength, noise, size, k, several + 1);
        }
    }

    /// Trials with an effect of the catalogue beside one that it does not have.
    fn beside(&mut self, known: &[&'static str], outside: &[&'static str], per_seed: u64) {
        for k in 0..self.seeds * per_seed {
            let draw = |ids, k| together(ids, 1, self.first_seed, BESIDE_FROM + k)[0];
            let ((of_known, strength), (of_outside, other)) = (draw(known, 2 * k), draw(outside, 2 * k + 1));
            let noise = self.noises[k as usize % self.noises.len()];
            let hidden = Hidden::Beside([(of_known, strength), (of_outside, other)]);
            self.push(hidden, strength, noise, Size::ALL[(k / 3) as usize % 3], k, 3);
        }
    }

    /// Trials in which the craft changes between flights.
    fn changes(&mut self, sizes: &mut Sizes) {
        for id in changeable() {
            // What only a change can be is told apart at every strength; the rest at the middle
            // one, if there is time.
            let own = changes().any(|own| own == id);
            if sizes.quick && !own {
                continue;
            }
            let middle = [self.strengths[self.strengths.len() / 2]];
            let strengths = if own { self.strengths.clone() } else { middle.to_vec() };
            self.grid(&Hidden::Change(Some(id)), &strengths, &sizes.next(), 1);
        }
    }

    fn grid(&mut self, hidden: &Hidden, strengths: &[f64], sizes: &[Size], rounds: usize) {
        for &strength in strengths {
            for noise in self.noises.clone() {
                for &size in sizes {
                    for k in 0..self.seeds {
                        self.push(hidden.clone(), strength, noise, size, k, rounds);
                    }
                }
            }
        }
    }

    fn push(&mut self, hidden: Hidden, strength: f64, noise: f64, size: Size, k: u64, rounds: usize) {
        // Styles and logs take turns: of any three repetitions each style has one, of any two one
        // log is rough, of any four two have outliers.
        let turn = (self.first_seed - 1 + k) as usize;
        let mut trial = Trial {
            hidden,
            strength,
            noise,
            size,
            seed: 0,
            duration_s: self.duration_s,
            rounds,
            predicts: false,
            style: Style::ALL[(turn + 1) % 3],
            rough: turn % 2 == 1,
            outliers: turn / 2 % 2 == 1,
            condition: None,
        };
        trial.seed = seed(&trial, self.first_seed + k);
        self.trials.push(trial);
    }

    /// Trials of difficult flights and logs: so many of each condition, every other one with nothing
    /// hidden. The log has no further faults, so that what goes wrong is the condition's.
    fn conditions(&mut self, each: u64) {
        for condition in Condition::ALL {
            for k in 0..each {
                let turn = (self.first_seed - 1 + k) as usize;
                let nothing = turn.is_multiple_of(2);
                let mut trial = Trial {
                    hidden: Hidden::Nothing,
                    strength: if nothing { 0.0 } else { self.strengths[self.strengths.len() / 2] },
                    noise: self.noises[turn % self.noises.len()],
                    size: Size::MAIN[turn / 2 % 2],
                    seed: 0,
                    duration_s: condition.duration_s(self.duration_s),
                    rounds: 1,
                    predicts: false,
                    style: Style::ALL[turn / 2 % 3],
                    rough: false,
                    outliers: false,
                    condition: Some(condition),
                };
                trial.seed = seed(&trial, self.first_seed + k);
                if !nothing {
                    let mut rng = Pcg64::seed_from_u64(trial.seed);
                    let hideable = condition.hideable();
                    trial.hidden = hideable.choose(&mut rng).map_or(Hidden::Nothing, |id| Hidden::One(id));
                    // Where the condition may be named first, the effect has to follow.
                    trial.rounds = if condition.own_effects().is_empty() { 1 } else { 3 };
                }
                self.trials.push(trial);
            }
        }
    }

    fn keep_only(&mut self, only: &[String]) -> anyhow::Result<()> {
        if only.is_empty() {
            return Ok(());
        }
        let is_named = |trial: &Trial, name: &String| match &trial.hidden {
            _ if trial.condition.is_some() => {
                name == CONDITIONS || trial.condition.is_some_and(|condition| condition.name() == *name)
            }
            Hidden::Together(effects) => name == if effects.len() == 2 { "pairs" } else { "triples" },
            Hidden::Beside(_) => name == "beside",
            Hidden::Change(_) => name == "changes",
            _ => trial.label() == *name,
        };
        if let Some(unknown) = only.iter().find(|name| !self.trials.iter().any(|t| is_named(t, name))) {
            let plain = self.trials.iter().filter(|trial| trial.condition.is_none());
            let mut names: Vec<String> = plain.map(Trial::label).collect();
            names.retain(|name| !name.contains(" + ") && !name.starts_with(CHANGED));
            names.dedup();
            names.extend(Condition::ALL.map(Condition::name));
            bail!(
                "--only {unknown}: no trial hides that; there are: pairs, triples, beside, changes, {CONDITIONS}, {}",
                names.join(", ")
            );
        }
        self.trials.retain(|trial| only.iter().any(|name| is_named(trial, name)));
        Ok(())
    }
}

/// Different effects with strengths from the middle to the high.
fn together(known: &[&'static str], several: usize, first_seed: u64, k: u64) -> Vec<(&'static str, f64)> {
    let mut rng = Pcg64::seed_from_u64(first_seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(k));
    let chosen: Vec<&&str> = known.sample(&mut rng, several).collect();
    let mut strength = || (rng.random_range(0.6..1.2_f64) * 100.0).round() / 100.0;
    chosen.into_iter().map(|id| (*id, strength())).collect()
}

/// A seed of its own for every trial, the same whatever else is in the catalogue: FNV-1a over what
/// the trial is.
fn seed(trial: &Trial, k: u64) -> u64 {
    let text = format!("{} {} {} {} {k}", trial.label(), trial.strength, trial.noise, trial.size.name());
    let hash = text
        .bytes()
        .fold(0xCBF2_9CE4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0000_0100_0000_01B3));
    hash % 1_000_000
}
