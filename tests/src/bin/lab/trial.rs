//! One trial: a world is flown, and the product is asked what it hides.

use diagnosis::workflow::{self, FlightSets, FlightsOfOneKind, Reading, Silent, WorkflowError};
use diagnosis::{Diagnosis, Verdict};
use flights::Flight;
use model::{Effect, Model, Vehicle};
use serde::Serialize;
use stories::world::{Pattern, Sensors, True, World, draws};
use sysid::fit::open_loop::open_loop;
use sysid::{FaultKind, Prepared};

use crate::condition::Condition;
use crate::plan::{Hidden, Trial};

/// Half width of a 95 % interval in standard errors.
const HALF_95: f64 = 1.959_964;

pub(crate) const ADEQUATE: &str = "adequate";
pub(crate) const UNEXPLAINED: &str = "unexplained";
pub(crate) const NOT_IDENTIFIED: &str = "not-identified";
/// Nothing of the craft is missing, but the wind wanders.
pub(crate) const GUSTS: &str = "gusts";

/// The product's answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Outcome {
    pub(crate) trial: Trial,
    /// What it answered first: an effect's identifier, "adequate", "gusts" (adequate in a wind that
    /// wanders), "unexplained", "not-identified", or why there is no answer.
    pub(crate) answer: String,
    /// Whether the motor it blames is the one, where it blames one.
    pub(crate) motor_is_right: bool,
    /// Effects added one after the other.
    pub(crate) found: Vec<&'static str>,
    /// What it said of each planted effect.
    pub(crate) planted: Vec<OfPlanted>,
    /// Effects that it says it cannot tell from its first answer.
    pub(crate) confounded_with: Vec<&'static str>,
    /// Structure left: axis, what it depends on, percent.
    pub(crate) unexplained: Vec<String>,
    /// Coefficients against the truth, with the right structure.
    pub(crate) coefficients: Vec<Distance>,
    /// Part of the error of prediction that the planted effect leaves on held-out flights, where that is asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) error_left: Option<f64>,
    /// The same with the true coefficients: how much of the error the effect is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) error_left_by_truth: Option<f64>,
}

/// What the diagnosis of the basic model said of a planted effect.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct OfPlanted {
    pub(crate) effect: &'static str,
    /// Place in the ranking, the first is 1.
    pub(crate) rank: usize,
    pub(crate) supported: bool,
    pub(crate) drop_percent: f64,
    pub(crate) reason: String,
}

/// A coefficient's distance from the truth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Distance {
    pub(crate) effect: &'static str,
    pub(crate) coefficient: &'static str,
    pub(crate) value: f64,
    pub(crate) truth: f64,
    /// In standard errors.
    pub(crate) errors: f64,
}

impl Distance {
    pub(crate) fn is_covered(&self) -> bool {
        self.errors.abs() <= HALF_95
    }
}

impl Outcome {
    /// Whether the first answer is right; for several, whether all of them and nothing else were found.
    pub(crate) fn is_right(&self) -> bool {
        if let Some(condition) = self.trial.condition {
            return self.is_right_under(condition);
        }
        match &self.trial.hidden {
            Hidden::Nothing | Hidden::Change(None) => self.answer == ADEQUATE,
            Hidden::Change(Some(id)) => self.answer == *id && self.motor_is_right,
            Hidden::One(id) => self.answer == *id,
            Hidden::Outside(_) => self.answer == UNEXPLAINED,
            Hidden::Together(_) => self.is_clean(),
            Hidden::Beside([(known, _), _]) => self.found == [*known] && !self.unexplained.is_empty(),
        }
    }

    /// Whether the first answer is what the condition itself is.
    pub(crate) fn names_the_condition(&self) -> bool {
        self.trial.condition.is_some_and(|condition| condition.own_effects().contains(&self.answer.as_str()))
    }

    /// Under a condition that is an effect itself, that may be named first if what is hidden follows.
    fn is_right_under(&self, condition: Condition) -> bool {
        let is_own = self.names_the_condition();
        match &self.trial.hidden {
            Hidden::One(id) => self.answer == *id || is_own && self.found.contains(id),
            _ => is_own || self.answer == ADEQUATE && !condition.is_missing_itself(),
        }
    }

    /// Whether the loop ended with the planted effects and nothing else.
    pub(crate) fn is_clean(&self) -> bool {
        let planted: Vec<_> = self.trial.planted().into_iter().map(|(id, _)| id).collect();
        self.found.len() == planted.len() && planted.iter().all(|id| self.found.contains(id))
    }

    pub(crate) fn failed(trial: &Trial, answer: String) -> Self {
        Self {
            trial: trial.clone(),
            answer,
            motor_is_right: false,
            found: Vec::new(),
            planted: Vec::new(),
            confounded_with: Vec::new(),
            unexplained: Vec::new(),
            coefficients: Vec::new(),
            error_left: None,
            error_left_by_truth: None,
        }
    }
}

/// The world of a trial with nothing hidden.
fn calm(trial: &Trial) -> World {
    let world = World::new(trial.size, trial.seed).flown(trial.style);
    match trial.condition {
        Some(condition) => condition.bare(world, trial.seed),
        None => world,
    }
}

/// The world of a trial; for a change, the craft after it.
fn world(trial: &Trial) -> Result<World, String> {
    let world = trial.planted().into_iter().try_fold(calm(trial), |world, (id, strength)| {
        world.with(id, strength).map_err(|error| error.to_string())
    })?;
    Ok(match trial.condition {
        Some(condition) => condition.known(world, trial.seed),
        None => world,
    })
}

fn fly_round(
    world: &World,
    trial: &Trial,
    patterns: impl Iterator<Item = Pattern>,
    round: u64,
) -> Result<Vec<Flight>, String> {
    let sensors = if trial.rough { Sensors::rough(trial.noise) } else { Sensors::noisy(trial.noise) };
    let sensors = if trial.outliers { sensors.with_outliers() } else { sensors };
    patterns
        .map(|pattern| {
            let fly = |world: &World, sensors: &Sensors| {
                world.fly(pattern, trial.duration_s, sensors, round).map_err(|lost| lost.to_string())
            };
            let Some(condition) = trial.condition else { return fly(world, &sensors) };
            let (world, sensors) = condition.in_flight(world.clone(), sensors, pattern, trial.seed);
            Ok(condition.logged(fly(&world, &sensors)?, pattern, trial.seed))
        })
        .collect()
}

/// Five flights, those to fit on first; for a change, two more after it.
pub(crate) fn fly(trial: &Trial) -> Result<(World, Vec<Flight>), String> {
    let world = world(trial)?;
    let all = Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE);
    if !matches!(trial.hidden, Hidden::Change(_)) {
        let flights = fly_round(&world, trial, all, 0)?;
        return Ok((world, flights));
    }
    let mut flights = fly_round(&calm(trial), trial, all, 0)?;
    for mut flight in fly_round(&world, trial, Pattern::VALIDATE.into_iter(), 1)? {
        flight.name.push_str("-after");
        flights.push(flight);
    }
    Ok((world, flights))
}

/// A craft that its pilot cannot keep is no answer of the product: another is drawn.
pub(crate) fn run(trial: &Trial) -> Outcome {
    let mut last = Outcome::failed(trial, "no craft was drawn".into());
    for seed in draws(trial.seed) {
        let trial = Trial { seed, ..trial.clone() };
        let asked = match trial.hidden {
            Hidden::Change(_) => ask_what_changed(&trial),
            _ => ask_what_is_missing(&trial),
        };
        match asked {
            Ok(outcome) => return outcome,
            Err(why) if why.starts_with("the craft was lost") => last = Outcome::failed(&trial, why),
            Err(why) => return Outcome::failed(&trial, why),
        }
    }
    last
}

/// What a user of the program would be told of these flights, training flights first.
fn sets(flights: &[Flight], vehicle: &Vehicle) -> Result<FlightSets, String> {
    let (train, validate) = flights.split_at(Pattern::TRAIN.len());
    FlightSets::from_flights(train, validate, vehicle, Reading::default(), &Silent).map_err(told)
}

fn told(error: WorkflowError) -> String {
    error.to_string()
}

fn ask_what_changed(trial: &Trial) -> Result<Outcome, String> {
    let (world, flights) = fly(trial)?;
    let base = calm(trial);
    let (before, after) = flights.split_at(Pattern::TRAIN.len() + Pattern::VALIDATE.len());
    let mut before = sets(before, &base.vehicle)?;
    let model = workflow::identify(&base.vehicle, &[], &mut before, None, &Silent).map_err(told)?.model;
    let mut after =
        FlightsOfOneKind::from_flights(after, &base.vehicle, Reading::default(), &Silent).map_err(told)?;
    let diagnosis =
        workflow::changed(&model, &[], &mut after, &diagnosis::Options::default(), &Silent).map_err(told)?;
    let blamed = diagnosis.effects.iter().find(|finding| finding.supported).and_then(|finding| finding.motor);
    let other = |rotor: &usize| {
        let craft = &world.craft;
        let parts = [craft.efficiency[*rotor], craft.torque_efficiency[*rotor]];
        parts != [1.0; 2] || craft.lean_rad[*rotor] != [0.0; 2]
    };
    let weak = (0..4).find(other);
    Ok(Outcome {
        motor_is_right: blamed.map(|motor| usize::from(motor) - 1) == weak,
        ..outcome(trial, &diagnosis, diagnosis.best().map(Effect::id).into_iter().collect(), Vec::new())
    })
}

fn ask_what_is_missing(trial: &Trial) -> Result<Outcome, String> {
    let (world, flights) = fly(trial)?;
    let mut sets = sets(&flights, &world.vehicle)?;
    let options = diagnosis::Options::default();
    let basic = workflow::identify(&world.vehicle, &[], &mut sets, None, &Silent).map_err(told)?.model;
    let diagnosis = workflow::diagnose(&basic, &[], &mut sets, &options, &Silent).map_err(told)?;
    let wanders = sets.faults.has(FaultKind::WanderingWind);
    let found = match (trial.rounds, diagnosis.best()) {
        (0 | 1, best) => best.map(Effect::id).into_iter().collect(),
        _ => {
            let mut sets = self::sets(&flights, &world.vehicle)?;
            let explanation =
                workflow::explain(&world.vehicle, &[], &mut sets, &options, None, &Silent).map_err(told)?;
            explanation.found().into_iter().map(Effect::id).collect()
        }
    };
    // Conditions are about names; their worlds differ from flight to flight, and so would the truth.
    let right = if trial.condition.is_none() { with_planted(trial, &basic, &mut sets) } else { None };
    let truth = world.truth();
    let coefficients =
        right.iter().flat_map(|model| truth.iter().filter_map(|truth| distance(model, truth))).collect();
    let mut outcome = outcome(trial, &diagnosis, found, coefficients);
    if let Some(model) = right.filter(|_| trial.predicts) {
        let left = |model: &Model| error_left(&basic, model, &sets.validate());
        outcome.error_left = Some(left(&model));
        outcome.error_left_by_truth = Some(left(&with_true_coefficients(model, &truth)));
    }
    if wanders && outcome.answer == ADEQUATE {
        outcome.answer = GUSTS.into();
    }
    Ok(outcome)
}

fn outcome(
    trial: &Trial,
    diagnosis: &Diagnosis,
    found: Vec<&'static str>,
    coefficients: Vec<Distance>,
) -> Outcome {
    Outcome {
        trial: trial.clone(),
        answer: answer(diagnosis),
        motor_is_right: true,
        found,
        planted: trial.planted().into_iter().filter_map(|(id, _)| of_planted(diagnosis, id)).collect(),
        confounded_with: diagnosis
            .effects
            .first()
            .map_or_else(Vec::new, |f| f.confounded_with.iter().map(|e| e.id()).collect()),
        unexplained: diagnosis
            .unexplained
            .iter()
            .map(|u| format!("{} on {}, {:.1} %", u.axis, u.depends_on, u.share_percent))
            .collect(),
        coefficients,
        error_left: None,
        error_left_by_truth: None,
    }
}

fn answer(diagnosis: &Diagnosis) -> String {
    match (diagnosis.best(), diagnosis.verdict) {
        (_, Verdict::NotIdentified) => NOT_IDENTIFIED.into(),
        (Some(effect), _) => effect.id().into(),
        (None, Verdict::Adequate) => ADEQUATE.into(),
        (None, _) => UNEXPLAINED.into(),
    }
}

fn of_planted(diagnosis: &Diagnosis, id: &str) -> Option<OfPlanted> {
    let place = diagnosis.effects.iter().position(|finding| finding.effect.id() == id)?;
    let finding = &diagnosis.effects[place];
    Some(OfPlanted {
        effect: finding.effect.id(),
        rank: place + 1,
        supported: finding.supported,
        drop_percent: finding.drop_percent,
        reason: finding.reason.to_string(),
    })
}

/// The model with the right structure; none where the catalogue lacks it.
fn with_planted(trial: &Trial, basic: &Model, sets: &mut FlightSets) -> Option<Model> {
    let planted: Option<Vec<Effect>> =
        trial.planted().into_iter().map(|(id, _)| Effect::from_id(id)).collect();
    planted?.into_iter().try_fold(basic.clone(), |model, effect| {
        workflow::add(&model, effect, sets, None, &Silent).ok().map(|added| added.model)
    })
}

/// A model with the right structure and the true coefficients, where it means the same by them.
fn with_true_coefficients(mut model: Model, truth: &[True]) -> Model {
    for of in truth {
        let term =
            Effect::from_id(of.effect).and_then(|effect| model.terms.iter_mut().find(|t| t.effect == effect));
        if let Some(coefficient) = term.and_then(|term| term.coefficients.get_mut(of.index)) {
            coefficient.value = of.value;
        }
    }
    model
}

/// What is left, with a better model, of the open-loop error half a second ahead: of position, velocity, attitude or rate, whichever it
/// takes more of (an effect acts on some of them, and takes little of the others).
fn error_left(before: &Model, after: &Model, held_out: &[&Prepared]) -> f64 {
    let [before, after] = [before, after].map(|model| {
        let farthest = open_loop(model, held_out).last().copied().unwrap_or_default();
        [farthest.position_m, farthest.velocity_m_s, farthest.attitude_rad, farthest.rate_rad_s]
    });
    before.into_iter().zip(after).map(|(before, after)| after / before).fold(f64::INFINITY, f64::min)
}

fn distance(model: &Model, truth: &True) -> Option<Distance> {
    let effect = Effect::from_id(truth.effect)?;
    let estimate = model.term(effect)?.coefficients.get(truth.index)?;
    Some(Distance {
        effect: truth.effect,
        coefficient: effect.info().coefficients.get(truth.index)?.name,
        value: estimate.value,
        truth: truth.value,
        errors: (estimate.value - truth.value) / estimate.std_error?,
    })
}
