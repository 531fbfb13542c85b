//! What is asked of gains: the specifications of `quadlab design`, from a file or the thesis'.

use control::gains::{Config, VelocityEstimator};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result, SpecField, SpecKey, SpecTable};
use crate::loops::View;
use crate::plant::Linear;

/// How gains are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The thesis' procedure on continuous loops.
    Thesis,
    /// A search on the loops as they fly.
    Delay,
}

/// What is asked of the gains; the defaults are the thesis' specifications and, for the late pose,
/// twice its gain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Specs {
    /// How gains are found.
    pub method: Method,
    /// Age of the pose at which the margins are to hold, samples (thesis 5.5: about 2).
    pub delay_samples: usize,
    /// Age of the pose with which every loop is to be stable, samples.
    pub stable_delay_samples: usize,
    /// Roll and pitch.
    pub attitude: AttitudeSpecs,
    /// Yaw.
    #[serde(deserialize_with = "yaw_given")]
    pub yaw: SlowSpecs,
    /// Altitude.
    #[serde(deserialize_with = "altitude_given")]
    pub altitude: SlowSpecs,
    /// Position along x and y.
    pub position: PositionSpecs,
}

/// Specifications of roll and pitch, thesis 5.3.1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AttitudeSpecs {
    /// Least phase margin, degrees (thesis: 45).
    pub phase_margin_deg: f64,
    /// Least gain margin.
    pub gain_margin: f64,
    /// Greatest gain crossover frequency, rad/s (thesis: 6).
    pub crossover_rad_s: f64,
    /// Greatest overshoot by the damping of the closed-loop poles, per cent (thesis: 35).
    pub damping_overshoot_percent: f64,
    /// Velocity gain over the least one that stabilises (the thesis' 10 is 1.18 times).
    pub velocity_gain_ratio: f64,
    /// Least Ki over Kp of a search: how fast a constant disturbance is taken away, rad/s (the
    /// thesis' gains: 1.0; its other loops 1/15). It costs overshoot, all the more the faster it
    /// is.
    pub integral_rad_s: f64,
    /// Where the canceller moves the slow zero, rad/s (thesis: 0.6).
    pub zero_rad_s: f64,
    /// Corner of the prefilter, rad/s (thesis: 5); the search starts from it.
    pub prefilter_rad_s: f64,
    /// Least value of a commanded step's response after its first peak (the thesis' gains: 0.62).
    /// Less dip costs margin: the plant's slow zero has to be moved further, or the integral
    /// raised.
    pub least_after_peak: f64,
    /// Greatest rise time of a commanded step, s (the thesis' gains: 0.38 roll, 0.33 pitch; 0.30
    /// and 0.27 as they fly). Absent: 0.3 s, or on a craft with slower rotors or more delay than
    /// the thesis' three times all the loop's delays.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rise_s: Option<f64>,
    /// Greatest overshoot of a commanded step, per cent.
    pub overshoot_percent: f64,
}

/// Specifications of yaw or altitude, thesis 5.3.2.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SlowSpecs {
    /// Least phase margin, degrees, for the late pose (the thesis' gains have more than 60 without
    /// one).
    pub phase_margin_deg: f64,
    /// Least gain margin, for the late pose.
    pub gain_margin: f64,
    /// Greatest overshoot, per cent (thesis: 5).
    pub overshoot_percent: f64,
    /// Greatest rise time, s (thesis: 1 yaw, 1.5 altitude).
    pub rise_s: f64,
    /// Corner of the prefilter, rad/s (thesis: 4 yaw, 2 altitude).
    pub prefilter_rad_s: f64,
    /// Ki over Kp: how fast a constant disturbance is taken away, rad/s (thesis: 1/15 yaw, 1/18
    /// altitude).
    pub integral_rad_s: f64,
}

impl SlowSpecs {
    /// Yaw, thesis 5.3.2.
    const YAW: Self = Self {
        phase_margin_deg: 45.0,
        gain_margin: 2.0,
        overshoot_percent: 5.0,
        rise_s: 1.0,
        prefilter_rad_s: 4.0,
        integral_rad_s: 1.0 / 15.0,
    };
    /// Altitude, thesis 5.3.2.
    const ALTITUDE: Self =
        Self { rise_s: 1.5, prefilter_rad_s: 2.0, integral_rad_s: 1.0 / 18.0, ..Self::YAW };
}

/// What a file says of yaw or altitude; the rest are the thesis' specifications of that axis.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SlowGiven {
    phase_margin_deg: Option<f64>,
    gain_margin: Option<f64>,
    overshoot_percent: Option<f64>,
    rise_s: Option<f64>,
    prefilter_rad_s: Option<f64>,
    integral_rad_s: Option<f64>,
}

impl SlowGiven {
    fn or(&self, rest: &SlowSpecs) -> SlowSpecs {
        SlowSpecs {
            phase_margin_deg: self.phase_margin_deg.unwrap_or(rest.phase_margin_deg),
            gain_margin: self.gain_margin.unwrap_or(rest.gain_margin),
            overshoot_percent: self.overshoot_percent.unwrap_or(rest.overshoot_percent),
            rise_s: self.rise_s.unwrap_or(rest.rise_s),
            prefilter_rad_s: self.prefilter_rad_s.unwrap_or(rest.prefilter_rad_s),
            integral_rad_s: self.integral_rad_s.unwrap_or(rest.integral_rad_s),
        }
    }
}

fn yaw_given<'de, D: serde::Deserializer<'de>>(from: D) -> std::result::Result<SlowSpecs, D::Error> {
    Ok(SlowGiven::deserialize(from)?.or(&SlowSpecs::YAW))
}

fn altitude_given<'de, D: serde::Deserializer<'de>>(from: D) -> std::result::Result<SlowSpecs, D::Error> {
    Ok(SlowGiven::deserialize(from)?.or(&SlowSpecs::ALTITUDE))
}

/// Specifications of the position loops, thesis 5.4.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PositionSpecs {
    /// Least phase margin, degrees (thesis: 45).
    pub phase_margin_deg: f64,
    /// Least gain margin, for the late pose.
    pub gain_margin: f64,
    /// Gain crossover frequency, rad/s (thesis: about 1, found 1.17 and 1.12).
    pub crossover_rad_s: f64,
    /// Ki over Kp, rad/s (thesis: 1/15).
    pub integral_rad_s: f64,
    /// Fastest motion of the reference, m/s (thesis: 0.5).
    pub rate_limit_m_s: f64,
    /// Corner of the velocity filter, rad/s (thesis: 10).
    pub velocity_filter_rad_s: f64,
    /// Greatest overshoot of 1 m through the rate limit, per cent (thesis: 15 and 17).
    pub overshoot_percent: f64,
}

impl Default for Specs {
    fn default() -> Self {
        Self {
            method: Method::Delay,
            delay_samples: 2,
            stable_delay_samples: 4,
            attitude: AttitudeSpecs::default(),
            yaw: SlowSpecs::YAW,
            altitude: SlowSpecs::ALTITUDE,
            position: PositionSpecs::default(),
        }
    }
}

impl Default for AttitudeSpecs {
    fn default() -> Self {
        Self {
            phase_margin_deg: 45.0,
            gain_margin: 2.0,
            crossover_rad_s: 6.0,
            damping_overshoot_percent: 35.0,
            velocity_gain_ratio: 1.2,
            integral_rad_s: 1.0 / 30.0,
            zero_rad_s: 0.6,
            prefilter_rad_s: 5.0,
            least_after_peak: 0.7,
            rise_s: None,
            overshoot_percent: 2.0,
        }
    }
}

impl Default for PositionSpecs {
    fn default() -> Self {
        Self {
            phase_margin_deg: 45.0,
            gain_margin: 2.0,
            crossover_rad_s: 1.2,
            integral_rad_s: 1.0 / 15.0,
            rate_limit_m_s: 0.5,
            velocity_filter_rad_s: 10.0,
            overshoot_percent: 17.0,
        }
    }
}

impl Specs {
    /// The thesis' procedure and specifications.
    pub fn thesis() -> Self {
        Self { method: Method::Thesis, ..Self::default() }
    }

    /// The view in which the method judges its loops.
    pub fn view(&self) -> View {
        match self.method {
            Method::Thesis => View::Continuous,
            Method::Delay => View::Sampled { delay_samples: self.delay_samples },
        }
    }

    /// With what is left open filled in for a craft.
    pub(crate) fn for_craft(&self, linear: &Linear) -> Self {
        let mut specs = *self;
        let config = Config::thesis();
        let own_s = 3.0 * delay_s(&config, linear, self.delay_samples);
        specs.attitude.rise_s = Some(self.attitude.rise_s.unwrap_or_else(|| own_s.max(0.3)));
        specs
    }

    /// Parses and checks the text of a specifications file; `path` is for messages.
    pub fn parse(text: &str, path: &std::path::Path) -> Result<Self> {
        let refuse = |message: String| DesignError::Parse { path: path.to_owned(), message };
        let specs: Self = toml::from_str(text).map_err(|e| refuse(gains_file::toml_message(text, &e)))?;
        for (key, value, [least, most]) in specs.ranges() {
            if !(value >= least && value <= most) {
                return Err(refuse(format!("{key} is {value}: give a number from {least} to {most}")));
            }
        }
        for (key, samples) in [
            (SpecKey::DelaySamples, specs.delay_samples),
            (SpecKey::StableDelaySamples, specs.stable_delay_samples),
        ] {
            if samples > 100 {
                return Err(refuse(format!("{key} is {samples}: give at most 100")));
            }
        }
        Ok(specs)
    }

    /// Every number that a file can give, with the range that it must be in.
    fn ranges(&self) -> Vec<(SpecKey, f64, [f64; 2])> {
        use SpecField as F;
        let (a, p) = (&self.attitude, &self.position);
        let attitude = [
            (F::PhaseMargin, a.phase_margin_deg, [0.0, 90.0]),
            (F::GainMargin, a.gain_margin, [1.0, 100.0]),
            (F::Crossover, a.crossover_rad_s, [0.01, 1000.0]),
            (F::DampingOvershoot, a.damping_overshoot_percent, [0.1, 99.0]),
            (F::VelocityGainRatio, a.velocity_gain_ratio, [1.0, 100.0]),
            (F::Integral, a.integral_rad_s, [0.0, 100.0]),
            (F::Zero, a.zero_rad_s, [1e-3, 100.0]),
            (F::Prefilter, a.prefilter_rad_s, [1e-2, 300.0]),
            (F::LeastAfterPeak, a.least_after_peak, [0.0, 1.0]),
            (F::Rise, a.rise_s.unwrap_or(1.0), [1e-3, 100.0]),
            (F::Overshoot, a.overshoot_percent, [0.0, 100.0]),
        ];
        let slow = |s: &SlowSpecs| {
            [
                (F::PhaseMargin, s.phase_margin_deg, [0.0, 90.0]),
                (F::GainMargin, s.gain_margin, [1.0, 100.0]),
                (F::Overshoot, s.overshoot_percent, [0.1, 99.0]),
                (F::Rise, s.rise_s, [1e-3, 100.0]),
                (F::Prefilter, s.prefilter_rad_s, [1e-2, 300.0]),
                (F::Integral, s.integral_rad_s, [0.0, 100.0]),
            ]
        };
        let position = [
            (F::PhaseMargin, p.phase_margin_deg, [0.0, 90.0]),
            (F::GainMargin, p.gain_margin, [1.0, 100.0]),
            (F::Crossover, p.crossover_rad_s, [0.01, 100.0]),
            (F::Integral, p.integral_rad_s, [0.0, 100.0]),
            (F::RateLimit, p.rate_limit_m_s, [1e-3, 100.0]),
            (F::VelocityFilter, p.velocity_filter_rad_s, [1e-2, 300.0]),
            (F::Overshoot, p.overshoot_percent, [0.0, 100.0]),
        ];
        let of = |table: SpecTable| {
            move |(field, value, range): (F, f64, [f64; 2])| (SpecKey::Of(table, field), value, range)
        };
        let mut ranges: Vec<_> = attitude.into_iter().map(of(SpecTable::Attitude)).collect();
        ranges.extend(slow(&self.yaw).into_iter().map(of(SpecTable::Yaw)));
        ranges.extend(slow(&self.altitude).into_iter().map(of(SpecTable::Altitude)));
        ranges.extend(position.into_iter().map(of(SpecTable::Position)));
        ranges
    }
}

/// All that delays a loop at low frequencies, s: rotors, dead time, pose, half a period of the
/// hold, estimator.
pub(super) fn delay_s(config: &Config, linear: &Linear, delay_samples: usize) -> f64 {
    let VelocityEstimator { natural_frequency_rad_s, damping_ratio } = config.estimation.velocity;
    linear.motor_lag_rad_s.map_or(0.0, |lag| 1.0 / lag)
        + linear.input_delay_s
        + (delay_samples as f64 + 0.5) * config.sample_time_s
        + 2.0 * damping_ratio / natural_frequency_rad_s
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    /// Each key is written as a file has it: out of its range it is refused by that name, and
    /// inside it is taken.
    #[test]
    fn every_key_is_that_of_the_file() {
        let ranges = Specs::default().ranges();
        assert_eq!(ranges.len(), 30);
        for (key, _, [_, most]) in ranges {
            let text = format!("{key} = {most:?}");
            let read = Specs::parse(&text, Path::new("s.toml")).unwrap();
            assert!(read.ranges().iter().any(|range| range.0 == key && range.1 == most), "{key}");
            let error = Specs::parse(&format!("{key} = {:?}", 2.0 * most), Path::new("s.toml")).unwrap_err();
            let wanted = format!("s.toml: {key} is {}: give a number from", 2.0 * most);
            assert!(error.to_string().starts_with(&wanted), "{error}");
        }
        for key in [SpecKey::DelaySamples, SpecKey::StableDelaySamples] {
            let error = Specs::parse(&format!("{key} = 101"), Path::new("s.toml")).unwrap_err().to_string();
            assert_eq!(error, format!("s.toml: {key} is 101: give at most 100"));
        }
    }

    /// The thesis' craft: 1/21.5 s of rotors, half a period and two samples at 100 Hz, 2/75 s of
    /// estimator.
    #[test]
    fn the_delays_of_a_loop_add_up() {
        let linear = Linear::new(&model::Model::thesis(), &crate::plant::TrimTarget::default()).unwrap();
        let wanted = 1.0 / 21.5 + 0.025 + 2.0 / 75.0;
        assert!((delay_s(&Config::thesis(), &linear, 2) - wanted).abs() < 1e-12);
    }
}
