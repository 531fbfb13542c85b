//! What a flight will tell us, before it is flown: the pattern is flown in simulation by the
//! current model under the gains that will fly it, and the flight's Fisher information is taken
//! ([`diagnosis::planning::information`]).
//!
//! The noise is that of the simulated sensors, or as large as the residual that the model's own fit
//! recorded, where that is larger: on a real craft it nearly always is.

use control::state_machine::{Action, action};
use control::{Condition, Conditions, Config};
use diagnosis::planning::information::{Colour, Information, Parameter, Sight};
use model::{Effect, Model};
use pattern::Pattern;
use proto::State;
use sysid::Prepared;
use sysid::statistics::correlation;

use crate::flight::{FlightPlan, Recording, SilError, fly, for_identification, with_still_sensors};

/// Standard errors by which an effect of typical size has to stand out to be found.
const SEEN_DEVIATIONS: f64 = 4.0;
/// Share of the squared error that it has to cause, percent: less is not a finding even when it is
/// significant.
const SEEN_PERCENT: f64 = 1.5;
/// Number of flights that the noise is estimated from, and their length, s.
const NOISE_FLIGHTS: u64 = 3;
const NOISE_FLIGHT_S: f64 = 20.0;

/// Why a flight cannot be predicted.
#[derive(Debug, thiserror::Error)]
pub enum PredictError {
    /// The simulation.
    #[error(transparent)]
    Sil(#[from] SilError),
    /// Too short.
    #[error("the simulated flight {0}")]
    Prepare(#[from] sysid::PrepareError),
    /// The model cannot be flown at all.
    #[error(
        "the simulated craft cannot fly an ordinary tour to its end: {0}; give gains that suit the model (--gains, as from quadlab design)"
    )]
    Lost(String),
}

/// A model under its gains, with the noise that its flights have.
#[derive(Debug, Clone)]
pub struct Predictor {
    model: Model,
    config: Config,
    colour: Colour,
    candidates: Vec<Effect>,
}

/// How a flight of a pattern goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Largest roll and pitch, rad.
    pub tilt_rad: [f64; 2],
    /// Smallest and largest x, y and z, m.
    pub position_m: [[f64; 2]; 3],
    /// Largest speed over ground, m/s.
    pub speed_m_s: f64,
    /// Ticks in which a motor stood at an end of its range.
    pub saturated_ticks: usize,
    /// Correlation of the motor commands as flown with each other.
    pub correlation: [[f64; 4]; 4],
    /// What stops it from being flown so.
    pub trouble: Option<String>,
}

/// A predicted flight.
#[derive(Debug, Clone)]
pub struct Foreseen {
    /// How it goes.
    pub course: Course,
    /// What it tells, about the model's own effects and about those of the catalogue that it does
    /// not have.
    pub information: Information,
}

/// An effect of the catalogue that the model does not have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prospect {
    /// Which.
    pub effect: Effect,
    /// How well it would be seen; none where the flight does not move it.
    pub sight: Option<Sight>,
}

impl Prospect {
    /// Whether the effect would be found at its typical size.
    pub fn is_excited(&self) -> bool {
        self.sight.is_some_and(|s| s.deviations >= SEEN_DEVIATIONS && s.share_percent >= SEEN_PERCENT)
    }
}

impl Predictor {
    /// A predictor for `model` under `config`, with what identification flights need beside the
    /// gains.
    ///
    /// # Errors
    /// A configuration that cannot be flown, or that loses the craft.
    pub fn new(model: Model, config: Config, seed: u64) -> Result<Self, PredictError> {
        let config = for_identification(config);
        let mut flights = Vec::new();
        for k in 0..NOISE_FLIGHTS {
            let plan = FlightPlan {
                config,
                ..FlightPlan::identification(model.clone(), seed.wrapping_add(k), NOISE_FLIGHT_S)
            };
            let recording = fly(&plan)?;
            if let Some(why) = end_before_time(&recording) {
                return Err(PredictError::Lost(why));
            }
            flights.push(prepared(&recording, &model)?);
        }
        let all: Vec<&Prepared> = flights.iter().collect();
        let mut colour =
            Colour::of(&model, &all).ok_or_else(|| PredictError::Lost("none was flown".into()))?;
        if let Some(fit) = &model.fit {
            colour = colour.at_least(&fit.train);
        }
        // What starts from a shape of its own (a pendulum's length) has no column before it is
        // there.
        let candidates = Effect::candidates().filter(|e| !model.has(*e) && e.starts().is_empty()).collect();
        Ok(Self { model, config, colour, candidates })
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The configuration that flies.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Standard deviation of the residual on each axis that predictions assume.
    pub fn noise(&self) -> [f64; 6] {
        self.colour.deviation()
    }

    /// Effects that the model does not have and flights are asked about.
    pub fn candidates(&self) -> &[Effect] {
        &self.candidates
    }

    /// The plan of a pattern, with ideal sensors.
    pub fn plan(&self, pattern: &Pattern) -> FlightPlan {
        let config = with_still_sensors(self.config);
        FlightPlan { noise: None, ..FlightPlan::pattern(self.model.clone(), config, pattern.clone(), 0) }
    }

    /// Flies a pattern and says what it would tell.
    ///
    /// # Errors
    /// A pattern that cannot be flown at all. One that only loses the craft says so in
    /// [`Course::trouble`].
    pub fn foresee(&self, pattern: &Pattern) -> Result<Foreseen, PredictError> {
        let plan = self.plan(pattern);
        let recording = fly(&plan)?;
        let course = Course::of(&recording, &plan);
        let flight = prepared(&recording, &self.model)?;
        let effects: Vec<Effect> = self.model.effects().into_iter().chain(self.candidates.clone()).collect();
        let information = Information::of(&flight, &self.model, &effects, &self.colour);
        Ok(Foreseen { course, information })
    }

    /// How well each effect would be seen that the model does not have.
    pub fn prospects(&self, information: &Information) -> Vec<Prospect> {
        let own = self.model.effects();
        let look = |&effect: &Effect| Prospect {
            effect,
            sight: information.sight(effect, &own, &[], |p| self.size(p)),
        };
        self.candidates.iter().map(look).collect()
    }

    /// How well `effect` would be seen with `other` fitted beside it: the chance to tell the two
    /// apart.
    pub fn apart(&self, information: &Information, effect: Effect, other: Effect) -> Option<Sight> {
        information.sight(effect, &self.model.effects(), &[other], |p| self.size(p))
    }

    /// A coefficient's value in the model, or a typical one.
    fn size(&self, parameter: Parameter) -> f64 {
        let known = self.model.term(parameter.effect).map(|t| t.coefficients[parameter.index].value);
        known.filter(|v| *v != 0.0).unwrap_or(parameter.info().typical)
    }
}

fn prepared(recording: &Recording, model: &Model) -> Result<Prepared, PredictError> {
    Ok(Prepared::new(&recording.to_flight("simulated", false), &model.vehicle)?)
}

impl Course {
    fn of(recording: &Recording, plan: &FlightPlan) -> Self {
        let rows = &recording.rows;
        let euler = recording.euler_rad();
        let tilt = |k: usize| euler.iter().fold(0.0_f64, |m, e| m.max(e[k].abs()));
        let position = |k: usize| {
            rows.iter()
                .map(|r| f64::from(r.truth.position_m[k]))
                .fold([f64::INFINITY, f64::NEG_INFINITY], |m, v| [m[0].min(v), m[1].max(v)])
        };
        let speed = |r: &crate::flight::Row| {
            r.truth.velocity_m_s.iter().map(|v| f64::from(v * v)).sum::<f64>().sqrt()
        };
        let margin_m = recording.cage_margin_m();
        let outside = || {
            (margin_m < 0.0).then(|| format!("it leaves the cage or hits the floor, by {:.2} m", -margin_m))
        };
        let trouble = end_before_time(recording).or_else(outside);
        let motors: [Vec<f64>; 4] =
            std::array::from_fn(|k| rows.iter().map(|r| f64::from(r.output.pwm[k])).collect());
        Self {
            tilt_rad: [tilt(0), tilt(1)],
            position_m: [position(0), position(1), position(2)],
            speed_m_s: rows.iter().map(speed).fold(0.0, f64::max),
            saturated_ticks: recording.saturated_ticks(plan.config.command_range),
            correlation: std::array::from_fn(|a| {
                std::array::from_fn(|b| correlation(&motors[a], &motors[b]))
            }),
            trouble,
        }
    }
}

/// Why a flight was not flown as commanded to its end.
fn end_before_time(recording: &Recording) -> Option<String> {
    let rows = &recording.rows;
    let taken_over = rows.iter().position(|r| r.supervision.state != State::Flying);
    if let Some(row) = taken_over {
        return Some(format!("{} after {:.1} s", taking_over(&rows[row]), recording.time_s(row)));
    }
    (!recording.complete).then(|| format!("the craft is lost after {:.1} s", recording.time_s(rows.len())))
}

/// What the supervisor does in a flight at the first row that is not flown as commanded, and why.
fn taking_over(row: &crate::flight::Row) -> String {
    let does = match row.supervision.state {
        State::Hold => "holds the craft where it is",
        State::Land => "lands the craft",
        State::Cut => "cuts the motors",
        State::Disarmed | State::Armed | State::Flying => "ends the flight",
    };
    let at = row.truth.position_m;
    let why = |condition: Condition| match condition {
        Condition::OutsideFence => {
            format!("outside the cage at x {:.2}, y {:.2}, height {:.2} m", at[0], at[1], -at[2])
        }
        Condition::Tilted => {
            let [roll, pitch, _] = row.truth.euler_rad().map(f64::to_degrees);
            format!("tilted to roll {roll:.0}, pitch {pitch:.0} deg")
        }
        other => other.name().to_owned(),
    };
    let found = Conditions::from_bits(row.supervision.conditions);
    let reasons: Vec<String> = found
        .iter()
        .filter(|c| action(control::State::Flying, Conditions::from_bits(c.bit())) != Action::Stay)
        .map(why)
        .collect();
    format!("the supervisor {does} ({})", reasons.join(", "))
}
