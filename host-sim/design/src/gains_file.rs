//! The gains file: a [`control::Config`] in TOML, with a `[provenance]` table that says which craft it is for and how it
//! came to be. What flies is the configuration; the provenance is for people and for refusing it on another craft.

use std::path::Path;

use control::Config;
use control::gains::Law;
use model::Model;
use serde::{Deserialize, Serialize};

use crate::error::{DesignError, Result};
use crate::linear::Linear;
use crate::loops::law_effect;

/// Where gains come from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the vehicle they are for, as in its vehicle file.
    pub vehicle: String,
    /// How they came to be, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// SHA-256 of the model file they were designed on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model_sha256: Option<String>,
    /// What was asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub specs: Option<toml::Table>,
    /// What was reached: margins of each loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margins: Option<toml::Table>,
}

/// A gains file.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// What flies.
    pub config: Config,
    /// Where it comes from, if the file says so.
    pub provenance: Option<Provenance>,
}

const PROVENANCE: &str = "provenance";

impl Gains {
    /// Reads and checks a gains file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| DesignError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Parses and checks the text of a gains file; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self> {
        let refuse = |message: String| DesignError::Parse { path: path.to_owned(), message };
        let mut table: toml::Table =
            toml::from_str(text).map_err(|e| refuse(crate::toml_message(text, &e)))?;
        let provenance = table
            .remove(PROVENANCE)
            .map(Provenance::deserialize)
            .transpose()
            .map_err(|e| refuse(format!("[provenance]: {}", e.message().replace('\n', " "))))?;
        // Parsed from the text again where it can be, so that errors carry a line.
        let config = match provenance {
            None => toml::from_str(text).map_err(|e| refuse(crate::toml_message(text, &e)))?,
            Some(_) => Config::deserialize(table).map_err(|e| refuse(e.message().replace('\n', " ")))?,
        };
        config.check().map_err(|e| refuse(e.to_string()))?;
        Ok(Self { config, provenance })
    }

    /// The text of the gains file.
    pub fn to_toml(&self) -> String {
        let mut text = toml::to_string(&self.config).expect("numbers and tables are always TOML");
        if let Some(provenance) = &self.provenance {
            let mut table = toml::Table::new();
            let value = toml::Value::try_from(provenance).expect("strings and tables are always TOML");
            table.insert(PROVENANCE.into(), value);
            text.push('\n');
            text.push_str(&toml::to_string(&table).expect("strings and tables are always TOML"));
        }
        text
    }

    /// Refuses gains that belong to another craft than the model's: by name where the file gives one, and by what the
    /// law's mixing and hover do on the model. `path` is for messages.
    pub fn fit(&self, model: &Model, linear: &Linear, path: &Path) -> Result<()> {
        let refuse = |reason: String| Err(DesignError::OtherVehicle { path: path.to_owned(), reason });
        let name = &model.vehicle.name;
        if let Some(provenance) = &self.provenance
            && provenance.vehicle != *name
        {
            return refuse(format!("they are for \"{}\", the model is of \"{name}\"", provenance.vehicle));
        }
        let range = model.vehicle.motors.command_range;
        if self.config.command_range != range {
            return refuse(format!(
                "command_range is {:?}, the vehicle's is {range:?}",
                self.config.command_range
            ));
        }
        let Law::ModelBased(law) = &self.config.law else { return Ok(()) };
        let thrust_n = linear.equilibrium.inputs[0];
        if !(law.hover_thrust_n / thrust_n - 1.0).abs().le(&HOVER_TOLERANCE) {
            return refuse(format!(
                "hover_thrust_n is {:.4} N, the model hovers at {thrust_n:.4} N",
                law.hover_thrust_n
            ));
        }
        let effect = law_effect(model, linear, &self.config, linear.equilibrium.battery_v)?;
        for (axis, what) in ["thrust", "roll", "pitch", "yaw"].into_iter().enumerate() {
            let share = effect[(axis, axis)];
            if !(share > LEAST_EFFECT && share < MOST_EFFECT) {
                return refuse(format!(
                    "1 of the law's {what} comes out as {share:.3} on this model's rotors; make the mixing and the motor map from this model"
                ));
            }
        }
        Ok(())
    }
}

/// Hover thrust may be off by a battery or a payload.
const HOVER_TOLERANCE: f64 = 0.3;
/// A gain error beyond these is not an error of identification but another craft.
const LEAST_EFFECT: f64 = 0.5;
/// See [`LEAST_EFFECT`].
const MOST_EFFECT: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trim::TrimTarget;

    const THESIS: &str = include_str!("../../model/vehicles/f330-gains.toml");

    fn parse(text: &str) -> Result<Gains> {
        Gains::parse(text, Path::new("g.toml"))
    }

    #[test]
    fn the_file_in_the_tree_is_the_thesis_configuration() {
        assert_eq!(parse(THESIS).unwrap().config, Config::thesis());
    }

    #[test]
    fn a_gains_file_round_trips_exactly() {
        let provenance = Provenance {
            vehicle: "a \"craft\"".into(),
            source: "design".into(),
            model_sha256: Some("00ff".into()),
            specs: Some(toml::toml! { phase_margin_deg = 45.0 }),
            margins: None,
        };
        for provenance in [None, Some(provenance)] {
            for config in [Config::thesis(), Config::thesis_hand_tuned()] {
                let gains = Gains { config, provenance: provenance.clone() };
                let text = gains.to_toml();
                assert_eq!(parse(&text).unwrap(), gains, "{text}");
            }
        }
    }

    #[test]
    fn mistakes_are_named() {
        for (from, to, expected) in [
            ("kp = 100.0", "kpp = 100.0", "kpp"),
            ("kp = 100.0", "kp = nan", "kp is NaN"),
            ("sample_time_s = 0.01", "sample_time_s = 0.0", "sample_time_s"),
            ("vehicle = ", "vehicel = ", "vehicel"),
        ] {
            assert!(THESIS.contains(from), "{from}");
            let error = parse(&THESIS.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.starts_with("g.toml: ") && error.contains(expected), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    #[test]
    fn gains_of_another_craft_are_refused_with_the_reason() {
        let gains = parse(THESIS).unwrap();
        let check = |edit: &dyn Fn(&mut Model, &mut Gains)| {
            let (mut model, mut gains) = (Model::thesis(), gains.clone());
            edit(&mut model, &mut gains);
            let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
            gains.fit(&model, &linear, Path::new("g.toml"))
        };
        assert!(check(&|_, _| {}).is_ok());
        let reason = |edit: &dyn Fn(&mut Model, &mut Gains)| check(edit).unwrap_err().to_string();
        assert!(reason(&|m, _| m.vehicle.name = "other".into()).contains("\"other\""));
        assert!(reason(&|_, g| g.config.command_range = [0.0, 1.0]).contains("command_range"));
        assert!(reason(&|m, _| m.vehicle.mass = 2.0).contains("hover_thrust_n"));
        let yaw_gone = |m: &mut Model, _: &mut Gains| {
            let mut term = m.term(model::Effect::RotorMoments).unwrap().clone();
            term.coefficients[8..].iter_mut().for_each(|c| c.value *= 0.3);
            let values: Vec<f64> = term.coefficients.iter().map(|c| c.value).collect();
            m.set(model::Effect::RotorMoments, &values);
        };
        assert!(reason(&yaw_gone).contains("1 of the law's yaw comes out as 0.300"));
    }
}
