//! The named flights, and what each has to fulfil.
//!
//! Steps come at t = 1 s and are recorded as long as the reference does (10 s after roll and pitch,
//! 15 s after yaw, 20 s after z, 40 s after x and y). Requirements: overshoot at most 5 % and rise
//! at most 1.5 s (altitude) or 1 s (yaw) are the thesis' (5.3.2, 5.3.3), as is "less than 35 %
//! overshoot" for roll and pitch (5.3.1). For x and y the thesis reports 15 and 17 % with its
//! linear design; 20 % is allowed. The others are bounds well above what the reference simulation
//! shows, so that they fail when something is wrong and not when a seed is unlucky.

use std::fmt;
use std::str::FromStr;

use control::Config;
use control::supervision_limits::Fence;
use model::Model;

use crate::craft::NoiseModel;
use crate::flight::{
    FlightPlan, Script, StepAxis, StepCommand, Waypoint, battery_of, for_identification, with_still_sensors,
};
use design::analysis::StepMetrics;

/// A named flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scenario {
    /// Hold height and heading for 10 s.
    Hover,
    /// Roll by 10 degrees.
    Roll10,
    /// Pitch by 10 degrees.
    Pitch10,
    /// Yaw by 30 degrees.
    Yaw30,
    /// Climb by 0.5 m.
    Climb,
    /// Fly 1 m north.
    X1,
    /// Fly 1 m east.
    Y1,
    /// Roll by 30 degrees: the design's limit, where the thesis' craft loses control at 11.1 V.
    Roll30,
    /// Repeating way-points in the box of 4 m x 2 m x 2 m.
    Pattern,
    /// Identification flight with excited motors.
    Excitation,
}

/// What the user of the program can choose for all scenarios.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The craft; absent: the thesis'.
    pub model: Option<Model>,
    /// What flies it; absent: the thesis' gains. With it a craft's battery is at the voltage that
    /// its model was made at: constant in the steps, which are the reference's flights, and falling
    /// and sagging with the load in `excitation`.
    pub config: Option<Config>,
    /// Age of the pose that the controller gets, samples.
    pub delay_samples: usize,
    /// Noise of the sensors.
    pub noise: Option<NoiseModel>,
    /// Seed of the noise, of the excitation, and of the tour of `excitation`.
    pub seed: u64,
    /// Integration steps in a tick; absent: as many as the model needs.
    pub substeps: Option<u32>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { model: None, config: None, delay_samples: 2, noise: None, seed: 1, substeps: None }
    }
}

/// One requirement and how it came out.
#[derive(Debug, Clone, PartialEq)]
pub struct RequirementCheck {
    /// What is required, with the unit.
    pub requirement: String,
    /// What was found.
    pub found: String,
    /// Whether it holds.
    pub holds: bool,
}

/// What requirements look at beside the response to a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Course {
    /// Distance to floor and cage at its least, m; of a flight with a step, until that comes.
    pub(super) margin_m: f64,
    /// Greatest angle, rad, of `hover`.
    pub(super) angle_rad: f64,
    /// Greatest distance from the height of the start, m, of `hover`.
    pub(super) height_m: f64,
    /// Greatest distance to the way-point at the end of a leg, m, of `pattern`.
    pub(super) miss_m: f64,
}

/// The way-points of `pattern`, inertial NED, m: corners of the box at different heights, 8 s each.
const PATTERN_M: [[f64; 3]; 5] =
    [[0.0, 0.0, -1.0], [1.2, 0.7, -1.4], [1.2, -0.7, -0.6], [-1.2, -0.7, -1.4], [-1.2, 0.7, -0.6]];
pub(super) const PATTERN_LEG_S: f64 = 8.0;
const EXCITATION_S: f64 = 30.0;

impl Scenario {
    /// All, in the order they are flown.
    pub const ALL: [Self; 10] = [
        Self::Hover,
        Self::Roll10,
        Self::Pitch10,
        Self::Yaw30,
        Self::Climb,
        Self::X1,
        Self::Y1,
        Self::Roll30,
        Self::Pattern,
        Self::Excitation,
    ];

    /// Those that have to pass: all but `roll-30`.
    pub fn standard() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|scenario| *scenario != Self::Roll30)
    }

    /// Its name in commands, files and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Hover => "hover",
            Self::Roll10 => "roll-10",
            Self::Pitch10 => "pitch-10",
            Self::Yaw30 => "yaw-30",
            Self::Climb => "z-0.5",
            Self::X1 => "x-1",
            Self::Y1 => "y-1",
            Self::Roll30 => "roll-30",
            Self::Pattern => "pattern",
            Self::Excitation => "excitation",
        }
    }

    /// The figure of the thesis that shows it.
    pub const fn thesis_figure(self) -> Option<&'static str> {
        match self {
            Self::Roll10 => Some("5.25"),
            Self::Pitch10 => Some("5.26"),
            Self::Yaw30 => Some("5.27"),
            Self::X1 => Some("5.28"),
            Self::Y1 => Some("5.29"),
            Self::Climb => Some("5.30"),
            Self::Hover | Self::Roll30 | Self::Pattern | Self::Excitation => None,
        }
    }

    /// What steps, and by how much (rad or m).
    pub(super) fn stepped(self) -> Option<(StepAxis, f64)> {
        match self {
            Self::Roll10 => Some((StepAxis::Roll, 10_f64.to_radians())),
            Self::Pitch10 => Some((StepAxis::Pitch, 10_f64.to_radians())),
            Self::Yaw30 => Some((StepAxis::Yaw, 30_f64.to_radians())),
            Self::Climb => Some((StepAxis::Z, -0.5)),
            Self::X1 => Some((StepAxis::X, 1.0)),
            Self::Y1 => Some((StepAxis::Y, 1.0)),
            Self::Roll30 => Some((StepAxis::Roll, 30_f64.to_radians())),
            Self::Hover | Self::Pattern | Self::Excitation => None,
        }
    }

    /// The flight.
    pub fn plan(self, settings: &Settings) -> FlightPlan {
        let plan = match (self, self.stepped()) {
            (_, Some((axis, size))) => FlightPlan::thesis_step(axis, size),
            (Self::Pattern, _) => pattern(),
            (Self::Excitation, _) => FlightPlan::identification(Model::thesis(), settings.seed, EXCITATION_S),
            _ => FlightPlan::thesis(),
        };
        let plan = match &settings.config {
            Some(config) => self.flown_by(*config, settings.model.as_ref(), plan),
            None => plan,
        };
        let &Settings { ref model, delay_samples, noise, seed, substeps, .. } = settings;
        let model = model.clone().unwrap_or(plan.model);
        let mut plan = FlightPlan { model, delay_samples, noise, seed, substeps, ..plan };
        // Level is not at rest where there is wind: the craft goes with it, at most by its speed.
        let held = matches!(self, Self::Hover | Self::Yaw30 | Self::Climb);
        if held && plan.model.adjustments().moves_air() {
            plan.config.supervision.fence = Fence::NONE;
        }
        if plan.noise.is_none() && settings.config.is_some() {
            plan.config = with_still_sensors(plan.config);
        }
        plan
    }

    /// A plan with other gains, but with the room that its flight needs: a held angle goes tens of
    /// metres, an identification flight goes up to the walls.
    fn flown_by(self, config: Config, model: Option<&Model>, plan: FlightPlan) -> FlightPlan {
        let no_walls = plan.config.supervision.fence == Fence::NONE;
        let mut config = if self == Self::Excitation { for_identification(config) } else { config };
        if no_walls {
            config.supervision.fence = Fence::NONE;
        }
        let battery = model.and_then(|model| battery_of(model, plan.battery)).unwrap_or(plan.battery);
        FlightPlan { config, battery, ..plan }
    }

    /// What the flight had to fulfil, and whether it did.
    pub(super) fn checks(
        self,
        plan: &FlightPlan,
        course: &Course,
        metrics: Option<&StepMetrics>,
    ) -> Vec<RequirementCheck> {
        match (self, metrics) {
            (Self::Roll10 | Self::Pitch10 | Self::Roll30, Some(m)) => vec![overshoot(m, 35.0)],
            (Self::Yaw30, Some(m)) => vec![overshoot(m, 5.0), rise(m, 1.0)],
            (Self::Climb, Some(m)) => vec![overshoot(m, 5.0), rise(m, 1.5)],
            (Self::X1 | Self::Y1, Some(m)) => vec![
                overshoot(m, 20.0),
                rise(m, 2.5),
                at_most("steady-state error", m.steady_state_error.abs(), 0.05, "of the step"),
            ],
            (Self::Hover, _) => hover_checks(plan, course),
            (Self::Pattern, _) => pattern_checks(plan, course),
            _ => vec![at_least("distance to floor and cage", course.margin_m, 0.0, "m")],
        }
    }
}

fn at_most(what: &str, value: f64, limit: f64, unit: &str) -> RequirementCheck {
    RequirementCheck {
        requirement: format!("{what} <= {limit} {unit}"),
        found: report::significant(value, 3),
        holds: value <= limit,
    }
}

fn at_least(what: &str, value: f64, limit: f64, unit: &str) -> RequirementCheck {
    RequirementCheck {
        requirement: format!("{what} >= {limit} {unit}"),
        found: report::significant(value, 3),
        holds: value >= limit,
    }
}

fn overshoot(metrics: &StepMetrics, limit_percent: f64) -> RequirementCheck {
    at_most("overshoot", metrics.overshoot_percent, limit_percent, "%")
}

fn rise(metrics: &StepMetrics, limit_s: f64) -> RequirementCheck {
    match metrics.rise_s {
        Some(rise_s) => at_most("rise", rise_s, limit_s, "s"),
        None => RequirementCheck {
            requirement: format!("rise <= {limit_s} s"),
            found: "does not reach 90 %".into(),
            holds: false,
        },
    }
}

/// Reference: 0.0044 degrees and 0.075 mm with ideal sensors. Noise of 1 mrad shakes the weakly
/// damped pitch loop.
fn hover_checks(plan: &FlightPlan, course: &Course) -> Vec<RequirementCheck> {
    let (tilt_limit_deg, height_limit_mm) = if plan.noise.is_some() { (1.0, 5.0) } else { (0.02, 0.5) };
    vec![
        at_most("attitude", course.angle_rad.to_degrees(), tilt_limit_deg, "deg"),
        at_most("height error", 1e3 * course.height_m, height_limit_mm, "mm"),
    ]
}

/// The way-point is reached by the end of its leg, and the craft keeps to the cage.
fn pattern_checks(plan: &FlightPlan, course: &Course) -> Vec<RequirementCheck> {
    let Script::Waypoints { .. } = &plan.script else { return Vec::new() };
    vec![
        at_most("distance to the way-point at the end of a leg", course.miss_m, 0.3, "m"),
        at_least("distance to floor and cage", course.margin_m, 0.3, "m"),
    ]
}

/// Two rounds of the way-points.
fn pattern() -> FlightPlan {
    let list: Vec<Waypoint> = (0..)
        .zip(PATTERN_M)
        .map(|(k, position_m)| Waypoint { from_s: f64::from(k) * PATTERN_LEG_S, position_m, yaw_rad: 0.0 })
        .collect();
    let round_s = PATTERN_LEG_S * list.len() as f64;
    FlightPlan {
        script: Script::Waypoints { list, repeat_s: Some(round_s) },
        duration_s: 2.0 * round_s,
        ..FlightPlan::thesis()
    }
}

/// The step of a plan, if it is one, and the value it starts from.
pub(crate) fn step_of(plan: &FlightPlan) -> Option<(StepCommand, f64)> {
    let Script::Step(step) = plan.script else { return None };
    let [x, y, z] = plan.start_m;
    let base = match step.axis {
        StepAxis::Roll | StepAxis::Pitch => 0.0,
        StepAxis::Yaw => plan.start_yaw_rad,
        StepAxis::X => x,
        StepAxis::Y => y,
        StepAxis::Z => z,
    };
    Some((step, base))
}

impl fmt::Display for Scenario {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Scenario {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|scenario| scenario.name() == name).ok_or_else(|| {
            format!("there is no such scenario; known are {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_others_are_answered_with_the_list() {
        for scenario in Scenario::ALL {
            assert_eq!(scenario.name().parse(), Ok(scenario));
        }
        let error = "roll-20".parse::<Scenario>().unwrap_err();
        assert!(Scenario::ALL.iter().all(|scenario| error.contains(scenario.name())), "{error}");
        assert!(Scenario::standard().all(|scenario| scenario != Scenario::Roll30));
    }

    #[test]
    fn a_limit_belongs_to_what_holds() {
        assert!(at_most("a", 5.0, 5.0, "%").holds && at_least("a", 5.0, 5.0, "m").holds);
        assert!(!at_most("a", 5.1, 5.0, "%").holds && !at_least("a", 4.9, 5.0, "m").holds);
        assert!(!at_most("a", f64::NAN, 5.0, "%").holds && !at_least("a", f64::NAN, 5.0, "m").holds);
    }

    #[test]
    fn a_step_starts_from_where_the_craft_stands() {
        let base = |scenario: Scenario| step_of(&scenario.plan(&Settings::default())).map(|(_, base)| base);
        assert_eq!((base(Scenario::Climb), base(Scenario::Yaw30)), (Some(-1.0), Some(0.0)));
        assert_eq!(base(Scenario::Hover), None);
    }
}
