//! What a campaign is to fly: a TOML file.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use model::Model;
use serde::{Deserialize, Serialize};

use crate::error::CampaignError;
use crate::normal::Normal;

/// What a campaign is to fly.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// Name, for people.
    pub name: String,
    /// Seed of everything that is drawn.
    #[serde(default)]
    pub seed: u64,
    /// How often everything that is not known is drawn.
    pub draws: u64,
    /// What is flown in each draw: `tour`, or scenarios of `cargo xtask sil`.
    pub scenarios: Vec<String>,
    /// Model file of the craft, beside this file; the thesis' craft without.
    pub model: Option<PathBuf>,
    /// Gains by name: a gains file beside this file each; the thesis' and the designed ones without.
    #[serde(default)]
    pub gains: BTreeMap<String, PathBuf>,
    /// What is not known.
    #[serde(default)]
    pub unknown: Unknown,
}

/// How a number is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "give a range [low, high] or { mean = ..., deviation = ... }")]
pub enum Spread {
    /// Evenly between two numbers.
    Range([f64; 2]),
    /// Normally, truncated where it reaches beyond what can be simulated.
    Normal(Normal),
}

/// Fewest and most samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, expecting = "give two whole numbers, [fewest, most]")]
pub enum Samples {
    /// Evenly among these, both included.
    Range([u32; 2]),
}

/// What is not known of a craft, its air, its battery and its sensors. What is left out is as in the model and the scenario.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Unknown {
    /// Whether the model's coefficients are drawn from their covariance.
    pub coefficients: bool,
    /// More than the model's mass, kg.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<Spread>,
    /// Centre of mass off the model's, forward and to the right, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub center_of_mass_m: Option<Spread>,
    /// Part of the thrust that each motor lacks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thrust_loss: Option<Spread>,
    /// More than the model's time constant of the rotors, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotor_lag_s: Option<Spread>,
    /// More dead time between command and rotor, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dead_time_s: Option<Spread>,
    /// Wind to the north and to the east, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind_m_s: Option<Spread>,
    /// By how much it grows with the height, 1/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wind_shear_per_s: Option<Spread>,
    /// Standard deviation of gusts on each axis, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gust_m_s: Option<Spread>,
    /// More than the scenario's voltage at the start, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub battery_v: Option<Spread>,
    /// More than the scenario's sag of the voltage in hover, V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub battery_sag_v: Option<Spread>,
    /// Fewest and most samples by which poses are late.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_samples: Option<Samples>,
    /// Noise of the sensors, in units of the usual one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<Spread>,
    /// Start of a tour off the middle of the cage, north and east, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_m: Option<Spread>,
    /// Heading at the start of a tour, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start_yaw_rad: Option<Spread>,
    /// Share of the draws in which a fault comes on top that the supervisor has to survive.
    pub fault: f64,
}

/// Most samples by which poses can be late.
const MOST_DELAY: u32 = 50;

impl Unknown {
    /// Each spread with its name.
    pub(crate) fn spreads(&self) -> [(&'static str, Option<Spread>); 13] {
        [
            ("mass_kg", self.mass_kg),
            ("center_of_mass_m", self.center_of_mass_m),
            ("thrust_loss", self.thrust_loss),
            ("rotor_lag_s", self.rotor_lag_s),
            ("dead_time_s", self.dead_time_s),
            ("wind_m_s", self.wind_m_s),
            ("wind_shear_per_s", self.wind_shear_per_s),
            ("gust_m_s", self.gust_m_s),
            ("battery_v", self.battery_v),
            ("battery_sag_v", self.battery_sag_v),
            ("noise", self.noise),
            ("start_m", self.start_m),
            ("start_yaw_rad", self.start_yaw_rad),
        ]
    }

    /// What cannot be drawn for a craft, and why.
    pub(crate) fn refused(&self, model: &Model) -> Option<String> {
        for (name, spread) in self.spreads() {
            let limits @ [least, most] = limits(name, model);
            let is_within = |value: f64| (least..=most).contains(&value);
            let why = match spread {
                Some(Spread::Range([low, high])) if low > high => {
                    format!("[{low}, {high}] is not a valid range; give the lower number first")
                }
                Some(Spread::Normal(Normal { deviation, .. }))
                    if !(0.0..f64::INFINITY).contains(&deviation) =>
                {
                    format!("the deviation {deviation} must not be negative")
                }
                Some(Spread::Range(ends)) if !ends.into_iter().all(is_within) => beyond(limits),
                Some(Spread::Normal(normal)) if !is_within(normal.mean) => beyond(limits),
                Some(Spread::Normal(normal)) => match normal.refused(limits) {
                    Some(why) => why,
                    None => continue,
                },
                _ => continue,
            };
            return Some(format!("unknown.{name}: {why}"));
        }
        if !(0.0..=1.0).contains(&self.fault) {
            return Some(format!("unknown.fault: {} is not a share of the draws; give 0 to 1", self.fault));
        }
        let Some(Samples::Range([fewest, most])) = self.delay_samples else { return None };
        (fewest > most || most > MOST_DELAY).then(|| {
            format!(
                "unknown.delay_samples: [{fewest}, {most}] is not a valid range; give two whole numbers from 0 to {MOST_DELAY}, the lower \
                 one first"
            )
        })
    }
}

fn beyond([least, most]: [f64; 2]) -> String {
    format!("must be from {} to {}", report::significant(least, 3), report::significant(most, 3))
}

/// Least and most of what a craft can be simulated with.
pub(crate) fn limits(name: &str, model: &Model) -> [f64; 2] {
    let vehicle = &model.vehicle;
    match name {
        // Lighter ones with the fastest rotors are beyond what a step of the simulation follows.
        "mass_kg" => [-0.75 * vehicle.mass, 10.0 * vehicle.mass],
        "center_of_mass_m" => [-0.5, 0.5].map(|arms| arms * vehicle.arm_length),
        "thrust_loss" => [-0.5, 1.0],
        // No rotor follows within 2 ms.
        "rotor_lag_s" => [vehicle.motors.lag.map_or(0.0, |lag_rad_s| 0.002 - 1.0 / lag_rad_s).min(0.0), 1.0],
        "dead_time_s" => [0.0, 0.5],
        "wind_m_s" => [-30.0, 30.0],
        "wind_shear_per_s" => [-10.0, 10.0],
        "gust_m_s" => [0.0, 20.0],
        "battery_v" => [-0.5, 0.5].map(|part| part * model.reference.battery_v.max(1.0)),
        "battery_sag_v" => [0.0, 0.5 * model.reference.battery_v.max(1.0)],
        "noise" => [0.0, 100.0],
        "start_m" => [-2.0, 2.0],
        "start_yaw_rad" => [-std::f64::consts::TAU, std::f64::consts::TAU],
        _ => [f64::NEG_INFINITY, f64::INFINITY],
    }
}

impl Definition {
    /// Reads a definition.
    ///
    /// # Errors
    /// A file that cannot be read, or says what cannot be flown.
    pub fn read(path: &Path) -> Result<Self, CampaignError> {
        let text =
            std::fs::read_to_string(path).map_err(|why| CampaignError::Read { path: path.into(), why })?;
        let definition: Self = toml::from_str(&text).map_err(|error| {
            // A key of the whole file is missing in no line of it.
            if error.message().starts_with("missing field") && error.span().is_none_or(|span| span.start == 0)
            {
                let why = format!("{}; a definition needs name, draws and scenarios", error.message());
                return CampaignError::content(path, why);
            }
            let line = error.span().map(|span| 1 + text[..span.start].matches('\n').count());
            let said = |line: usize| {
                format!("line {line}, {}: ", text.lines().nth(line - 1).unwrap_or_default().trim())
            };
            let place = line.map(said).unwrap_or_default();
            CampaignError::content(path, format!("{place}{}", error.message()))
        })?;
        if let Some(why) = definition.refused() {
            return Err(CampaignError::content(path, why));
        }
        Ok(definition)
    }

    fn refused(&self) -> Option<String> {
        if self.draws == 0 {
            return Some("draws: 0 asks for no flight; give 1 or more".into());
        }
        if self.scenarios.is_empty() {
            return Some(
                "scenarios: the list is empty; give \"tour\" or a scenario of cargo xtask sil".into(),
            );
        }
        let doubled = self.scenarios.iter().enumerate().find(|(k, name)| self.scenarios[..*k].contains(name));
        doubled.map(|(_, name)| {
            format!("scenarios: {name} is named twice; the same flight again tells nothing new")
        })
    }
}
