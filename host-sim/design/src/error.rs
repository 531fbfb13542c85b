//! Why an analysis or a design cannot be made.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Serialize, Serializer};

/// Why an analysis or a design cannot be made: one clear line each.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// The model lacks an effect that a channel needs.
    #[error(
        "the model has no \"{effect}\", which the {channel} channel needs; identify the craft again or add the effect"
    )]
    MissingEffect {
        /// The effect's identifier.
        effect: &'static str,
        /// The channel.
        channel: &'static str,
    },
    /// The model has states beyond the twelve of (5.13).
    #[error(
        "the model has the effect \"{effect}\", and the linear model of (5.13) has no states for a load that swings: fly without the load, or describe it with the effect mass-change"
    )]
    Swinging {
        /// The effect's identifier.
        effect: &'static str,
    },
    /// The optimiser found no state near enough to rest.
    #[error("no equilibrium: the cost J of (5.13) stays at {cost:.3e}, mostly in {worst}; {hint}")]
    NoEquilibrium {
        /// The least cost reached.
        cost: f64,
        /// The derivative that is furthest from zero.
        worst: &'static str,
        /// What may be wrong.
        hint: &'static str,
    },
    /// The optimiser gave up.
    #[error("the search for an equilibrium failed: {0}")]
    Optimiser(String),
    /// An input does not move what it should.
    #[error("the {channel} channel cannot be controlled: {input} does not move {output} in this model")]
    Uncontrollable {
        /// The channel.
        channel: &'static str,
        /// Its input.
        input: &'static str,
        /// Its output.
        output: &'static str,
    },
    /// A loop cannot be built around a channel.
    #[error("no loop can be closed around the {channel} channel: {reason}")]
    Channel {
        /// The channel.
        channel: &'static str,
        /// Why.
        reason: String,
    },
    /// No gain meets a specification: the design ran and found nothing.
    #[error("{}: {}: wanted {}, reached {} at best", .0.name, .0.what.label(), .0.wanted, .0.reached)]
    Unmet(Shortfall),
    /// An eigenvalue iteration or a matrix inverse failed.
    #[error("numerical failure in {0}: the model's coefficients are far from those of any craft")]
    Numerics(&'static str),
    /// A specifications file cannot be read.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file has the wrong contents.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// What is wrong, on one line.
        message: String,
    },
    /// A gains file is wrong, or belongs to another vehicle.
    #[error(transparent)]
    Gains(#[from] gains_file::GainsError),
}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, DesignError>;

/// A specification that is not met.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Shortfall {
    /// The loop.
    #[serde(rename = "loop")]
    pub name: &'static str,
    /// Which number.
    pub what: Criterion,
    /// What was asked for.
    pub wanted: f64,
    /// What was reached.
    pub reached: f64,
    /// The entry of a specifications file that asks for it; absent where none can be relaxed (an
    /// unstable loop).
    #[serde(skip)]
    pub key: Option<SpecKey>,
}

/// A number that gains are judged by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// Phase margin, degrees.
    PhaseMargin,
    /// Phase margin with what the integral part will take away, degrees.
    PhaseMarginBeforeIntegral,
    /// Gain margin, a factor.
    GainMargin,
    /// Gain crossover frequency, rad/s.
    Crossover,
    /// Overshoot of a commanded step, per cent.
    Overshoot,
    /// Overshoot that the damping of the poles stands for, per cent.
    OvershootByDamping,
    /// Rise time of a commanded step, s.
    Rise,
    /// Least value of a step response after its first peak.
    LeastAfterPeak,
    /// Ki over Kp, rad/s.
    IntegralRate,
    /// Whether the loop is stable, 0 or 1.
    Stability,
    /// Whether it is stable with the oldest pose, 0 or 1.
    LateStability,
    /// Growth of the worst mode of the velocity loop, 1/s.
    VelocityLoopGrowth,
    /// Growth of the worst mode of the loop with its proportional gain, 1/s.
    ProportionalLoopGrowth,
    /// A proportional gain with which the loop is stable.
    StabilisingGain,
    /// Decay of the slowest mode of all loops together, 1/s.
    DecayTogether,
}

impl Criterion {
    /// The words for it, with its unit.
    pub const fn label(self) -> &'static str {
        match self {
            Self::PhaseMargin => "phase margin, deg",
            Self::PhaseMarginBeforeIntegral => "phase margin before the integral, deg",
            Self::GainMargin => "gain margin",
            Self::Crossover => "crossover, rad/s",
            Self::Overshoot => "overshoot, %",
            Self::OvershootByDamping => "overshoot by damping, %",
            Self::Rise => "rise, s",
            Self::LeastAfterPeak => "least value after the peak",
            Self::IntegralRate => "Ki over Kp, rad/s",
            Self::Stability => "stability (1: stable)",
            Self::LateStability => "stability with the latest pose (1: stable)",
            Self::VelocityLoopGrowth => "growth of the velocity loop's worst mode, 1/s",
            Self::ProportionalLoopGrowth => "growth of the proportional loop's worst mode, 1/s",
            Self::StabilisingGain => "least proportional gain that stabilises the loop",
            Self::DecayTogether => "decay of the slowest mode, 1/s (above 0: stable)",
        }
    }
}

impl Serialize for Criterion {
    fn serialize<S: Serializer>(&self, serializer: S) -> std::result::Result<S::Ok, S::Error> {
        serializer.serialize_str(self.label())
    }
}

impl JsonSchema for Criterion {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Criterion".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "type": "string", "description": "A criterion of a loop, in words." })
    }
}

/// An entry of a specifications file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpecKey {
    /// `delay_samples`.
    DelaySamples,
    /// `stable_delay_samples`.
    StableDelaySamples,
    /// An entry of a table.
    Of(SpecTable, SpecField),
}

/// A table of a specifications file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpecTable {
    /// Roll and pitch.
    Attitude,
    /// Yaw.
    Yaw,
    /// Altitude.
    Altitude,
    /// Position along x and y.
    Position,
}

/// A field of a table of a specifications file; the unit is the end of its name there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the fields of `synthesis::Specs` say what each means")]
pub enum SpecField {
    PhaseMargin,
    GainMargin,
    Crossover,
    DampingOvershoot,
    VelocityGainRatio,
    Integral,
    Zero,
    Prefilter,
    LeastAfterPeak,
    Rise,
    Overshoot,
    RateLimit,
    VelocityFilter,
}

impl std::fmt::Display for SpecKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::DelaySamples => f.write_str("delay_samples"),
            Self::StableDelaySamples => f.write_str("stable_delay_samples"),
            Self::Of(table, field) => write!(f, "{}.{}", table.name(), field.name()),
        }
    }
}

impl SpecTable {
    const fn name(self) -> &'static str {
        match self {
            Self::Attitude => "attitude",
            Self::Yaw => "yaw",
            Self::Altitude => "altitude",
            Self::Position => "position",
        }
    }
}

impl SpecField {
    const fn name(self) -> &'static str {
        match self {
            Self::PhaseMargin => "phase_margin_deg",
            Self::GainMargin => "gain_margin",
            Self::Crossover => "crossover_rad_s",
            Self::DampingOvershoot => "damping_overshoot_percent",
            Self::VelocityGainRatio => "velocity_gain_ratio",
            Self::Integral => "integral_rad_s",
            Self::Zero => "zero_rad_s",
            Self::Prefilter => "prefilter_rad_s",
            Self::LeastAfterPeak => "least_after_peak",
            Self::Rise => "rise_s",
            Self::Overshoot => "overshoot_percent",
            Self::RateLimit => "rate_limit_m_s",
            Self::VelocityFilter => "velocity_filter_rad_s",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unmet_specification_is_one_line_with_both_numbers() {
        let shortfall = Shortfall {
            name: "roll",
            what: Criterion::PhaseMargin,
            wanted: 45.0,
            reached: 40.5,
            key: Some(SpecKey::Of(SpecTable::Attitude, SpecField::PhaseMargin)),
        };
        assert_eq!(shortfall.key.unwrap().to_string(), "attitude.phase_margin_deg");
        let json = serde_json::to_value(&shortfall).unwrap();
        let expected = serde_json::json!({
            "loop": "roll", "what": "phase margin, deg", "wanted": 45.0, "reached": 40.5
        });
        assert_eq!(json, expected);
        let text = DesignError::Unmet(shortfall).to_string();
        assert_eq!(text, "roll: phase margin, deg: wanted 45, reached 40.5 at best");
    }
}
