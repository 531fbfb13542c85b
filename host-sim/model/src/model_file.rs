//! The model file: vehicle, effects, coefficients with units and errors, what was fitted on what, and how the model came
//! to be.
//!
//! Format `quadlab-model`, TOML. Version 2 has the correlations of the coefficients; a model without them is written as
//! version 1. Numbers are written with the shortest digits that read back to the same bits, so a model round-trips exactly.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use crate::effect::Estimate;
use crate::effects::{self, Effect};
use crate::fit_record::{FitRecord, HistoryEntry, ReferenceValues};
use crate::model::{Correlation, Model, Term};
use crate::rotor_quantity::RotorQuantity;
use crate::user_effects::{Definition, TIME_COLUMN, UserEffectError};
use crate::vehicle::{Vehicle, VehicleError, toml_message, too_long};

const FORMAT: &str = "quadlab-model";
/// The newest version; older ones lack fields that are optional.
const VERSION: u32 = 2;
/// What a model without correlations is written as.
const WITHOUT_CORRELATION: u32 = 1;

/// Why a model file was refused.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file cannot be read.
    #[error("{}: cannot read the model file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not TOML, a field missing, unknown or of the wrong type.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The parser's message on one line.
        message: String,
    },
    /// Not a model file, or one of another version.
    #[error("{}: format \"{format}\" version {version} is not read by this program; it reads \"{FORMAT}\" up to version {VERSION}", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Format found.
        format: String,
        /// Version found.
        version: u32,
    },
    /// An effect this program does not know.
    #[error("{}: unknown effect \"{effect}\"; known are {known}", path.display())]
    UnknownEffect {
        /// The file.
        path: PathBuf,
        /// Its name in the file.
        effect: String,
        /// Those known.
        known: String,
    },
    /// The coefficients of an effect are not those it has.
    #[error("{}: effect \"{effect}\" has the coefficients {expected}, the file gives {found}", path.display())]
    Coefficients {
        /// The file.
        path: PathBuf,
        /// The effect.
        effect: String,
        /// Those it has.
        expected: String,
        /// Those given.
        found: String,
    },
    /// Moments of inertia that are given, and of no rigid body.
    #[error(
        "{}: effect \"inertia-coupling\": {ratio} = {value} is impossible: it must lie between -1 and 1, as no moment of inertia \
         exceeds the sum of the other two; give the measured moments", path.display()
    )]
    NoBody {
        /// The file.
        path: PathBuf,
        /// The ratio of moments.
        ratio: &'static str,
        /// Its value.
        value: f64,
    },
    /// The vehicle in the model is impossible.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// An effect that looks at a column of flights, where there is none.
    #[error(
        "{}: effect \"{effect}\" names the column \"{column}\" of flight files, which a simulated craft or one at rest does not have; \
         take a model without this effect", path.display()
    )]
    NoColumn {
        /// The file.
        path: PathBuf,
        /// The effect.
        effect: Effect,
        /// The column.
        column: &'static str,
    },
    /// An effect that looks back, where there is no past.
    #[error(
        "{}: effect \"{effect}\" looks back with lag(...) or integral(...), and a craft at rest has no past; take a model without this effect",
        path.display()
    )]
    LooksBack {
        /// The file.
        path: PathBuf,
        /// The effect.
        effect: Effect,
    },
    /// The definition of a user's effect in the model cannot be right.
    #[error(transparent)]
    UserEffect(#[from] UserEffectError),
}

#[derive(Serialize, Deserialize)]
struct Header {
    format: String,
    version: u32,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    format: String,
    version: u32,
    reference: ReferenceValues,
    vehicle: Vehicle,
    /// Of the users' effects among `effects`.
    #[serde(rename = "definition", default, skip_serializing_if = "Vec::is_empty")]
    definitions: Vec<Definition>,
    #[serde(rename = "effect", default)]
    effects: Vec<EffectEntry>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    fit: Option<FitRecord>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    history: Vec<HistoryEntry>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    correlation: Option<Correlation>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct EffectEntry {
    id: String,
    #[serde(rename = "coefficient")]
    coefficients: Vec<CoefficientEntry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CoefficientEntry {
    name: String,
    value: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    std_error: Option<f64>,
    unit: String,
}

impl Model {
    /// The thesis' identified model (tables 4.2 to 4.12), with C_T unrounded as reference section 1 finds it behind
    /// the printed K^-1.
    pub fn thesis() -> Self {
        // Each simulated flight begins with it.
        static THESIS: LazyLock<Model> = LazyLock::new(|| {
            let text = include_str!("../vehicles/f330-model.toml");
            let model = Model::parse(text, Path::new("f330-model.toml"));
            model.expect("the model file in the source tree is tested")
        });
        THESIS.clone()
    }

    /// Reads and checks a model file.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| ModelError::Read { path: path.to_owned(), source })?;
        Self::parse(&text, path)
    }

    /// Reads a model file to fly it without a log: a simulation has no further columns of flight files but the time.
    pub fn read_to_simulate(path: &Path) -> Result<Self, ModelError> {
        Self::read_without_columns(path, &[TIME_COLUMN])
    }

    /// Reads a model file to linearise it: an equilibrium has no further columns, nor a time.
    pub fn read_to_linearize(path: &Path) -> Result<Self, ModelError> {
        let model = Self::read_without_columns(path, &[])?;
        match model.effects().into_iter().find(|effect| !effect.lags().is_empty()) {
            Some(effect) => Err(ModelError::LooksBack { path: path.to_owned(), effect }),
            None => Ok(model),
        }
    }

    fn read_without_columns(path: &Path, but: &[&str]) -> Result<Self, ModelError> {
        let model = Self::read(path)?;
        for effect in model.effects() {
            let Effect::User(user) = effect else { continue };
            if let Some(column) = user.columns_named().into_iter().find(|column| !but.contains(column)) {
                return Err(ModelError::NoColumn { path: path.to_owned(), effect, column });
            }
        }
        Ok(model)
    }

    /// Parses and checks the text of a model file; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ModelError> {
        if let Some(message) = too_long(text, "a model file") {
            return Err(ModelError::Parse { path: path.to_owned(), message });
        }
        let parse_error = |error: toml::de::Error| ModelError::Parse {
            path: path.to_owned(),
            message: toml_message(text, &error),
        };
        // The version first: a later version may have fields that this one does not know.
        let header: Header = toml::from_str(text).map_err(parse_error)?;
        if header.format != FORMAT || !(1..=VERSION).contains(&header.version) {
            return Err(ModelError::Version {
                path: path.to_owned(),
                format: header.format,
                version: header.version,
            });
        }
        let file: ModelFile = toml::from_str(text).map_err(parse_error)?;
        file.vehicle.check(path)?;
        for definition in file.definitions {
            effects::define(definition, path)?;
        }
        let terms: Vec<Term> =
            file.effects.into_iter().map(|entry| read_effect(entry, path)).collect::<Result<_, _>>()?;
        if let Some(reason) = file.correlation.as_ref().and_then(|c| c.mistake(&terms)) {
            return Err(ModelError::Parse {
                path: path.to_owned(),
                message: format!("[correlation]: {reason}"),
            });
        }
        Ok(Self {
            vehicle: file.vehicle,
            terms,
            reference: file.reference,
            fit: file.fit,
            history: file.history,
            correlation: file.correlation,
        })
    }

    /// The text of the model file.
    pub fn to_toml(&self) -> String {
        let file = ModelFile {
            format: FORMAT.into(),
            version: if self.correlation.is_some() { VERSION } else { WITHOUT_CORRELATION },
            reference: self.reference,
            vehicle: self.vehicle.clone(),
            definitions: self.terms.iter().filter_map(|term| definition_of(term.effect)).collect(),
            effects: self.terms.iter().map(|term| write_effect(term, self.rotor_quantity())).collect(),
            fit: self.fit.clone(),
            history: self.history.clone(),
            correlation: self.correlation.clone(),
        };
        toml::to_string(&file).expect("numbers, strings and tables are always TOML")
    }
}

fn read_effect(entry: EffectEntry, path: &Path) -> Result<Term, ModelError> {
    let Some(effect) = Effect::from_id(&entry.id) else {
        let known: Vec<&str> = Effect::all().map(|e| e.id()).collect();
        return Err(ModelError::UnknownEffect {
            path: path.into(),
            effect: entry.id,
            known: known.join(", "),
        });
    };
    let expected: Vec<&str> = effect.info().coefficients.iter().map(|c| c.name).collect();
    let found: Vec<&str> = entry.coefficients.iter().map(|c| c.name.as_str()).collect();
    if expected != found || entry.coefficients.iter().any(|c| !c.value.is_finite()) {
        return Err(ModelError::Coefficients {
            path: path.into(),
            effect: entry.id.clone(),
            expected: expected.join(", "),
            found: if expected == found { "a value that is not finite".into() } else { found.join(", ") },
        });
    }
    let coefficients: Vec<Estimate> =
        entry.coefficients.iter().map(|c| Estimate { value: c.value, std_error: c.std_error }).collect();
    if effect == Effect::InertiaCoupling {
        check_body(&coefficients, path)?;
    }
    Ok(Term { effect, coefficients })
}

/// Refuses moments of inertia of which one is larger than the sum of the other two. An estimate may be off by its error, so that one out
/// there is a model that was fitted badly, which is told where it is fitted; a value without an error is given.
fn check_body(ratios: &[Estimate], path: &Path) -> Result<(), ModelError> {
    for (ratio, estimate) in Effect::InertiaCoupling.info().coefficients.iter().zip(ratios) {
        let (least, most) = ratio.possible;
        if estimate.std_error.is_none() && !(least..=most).contains(&estimate.value) {
            return Err(ModelError::NoBody { path: path.into(), ratio: ratio.name, value: estimate.value });
        }
    }
    Ok(())
}

fn definition_of(effect: Effect) -> Option<Definition> {
    match effect {
        Effect::User(user) => Some(user.definition().clone()),
        _ => None,
    }
}

fn write_effect(term: &Term, rotors: RotorQuantity) -> EffectEntry {
    let info = term.effect.info();
    let coefficients =
        info.coefficients.iter().zip(&term.coefficients).map(|(c, estimate)| CoefficientEntry {
            name: c.name.into(),
            value: estimate.value,
            std_error: estimate.std_error,
            unit: c.unit_for(rotors).into(),
        });
    EffectEntry { id: info.id.into(), coefficients: coefficients.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::PerAxis;
    use crate::fit_record::{
        AxisError, BalanceRecord, BalanceRow, ChangeScatter, ConstantForceRecord, FlightRecord, FlightRole,
        MotorAnswer, OpenLoopSums, RefinementRecord, TrackerMountRecord,
    };
    use crate::model::coefficient_names;
    use crate::verdict::{Group, NotIdentified, PerGroup, Verdict};
    use nalgebra::DMatrix;

    #[test]
    fn a_model_round_trips_exactly() {
        let mut model = Model::thesis();
        model.set(Effect::GroundEffect, &[1.0 / 3.0, 0.01]);
        model.terms[0].coefficients[0].std_error = Some(0.1 + 0.2);
        model.reference.battery_v = 11.7 / 7.0;
        model.fit = Some(FitRecord {
            flights: vec![FlightRecord {
                name: "A \"quoted\" # name.csv".into(),
                sha256: "00ff".into(),
                role: FlightRole::Train,
                samples: 12,
                wind_m_s: Some([4.5, -0.25]),
            }],
            train: PerAxis::from_fn(|a| AxisError {
                sse: 1e-300 * a.index() as f64,
                rms: 0.1,
                r2: -3.0,
                samples: 9,
            }),
            held_out: PerAxis::default(),
            scatter: vec![ChangeScatter {
                effect: "mass-change".into(),
                coefficient: "extra_mass".into(),
                deviation: 0.01,
                mean: Some(0.1),
            }],
            flown_speed_m_s: Some(2.0 / 3.0),
            balance: Some(BalanceRecord {
                flights: 4,
                battery_v: 11.0 / 3.0,
                lift: BalanceRow {
                    mean: 0.1 / 7.0,
                    covariance: [1e-9, -1e-12, 0.0],
                    ..BalanceRow::default()
                },
                roll: BalanceRow { slope: -1.0 / 3.0, ..BalanceRow::default() },
                pitch: BalanceRow { between: 0.2 / 3.0, ..BalanceRow::default() },
                yaw: BalanceRow { within: 1e-300, ..BalanceRow::default() },
            }),
            motor_answers: vec![
                MotorAnswer {
                    speed_ratio: 0.99,
                    speed_ratio_deviation: 0.004,
                    time_constant_s: Some(0.047),
                    time_constant_deviation_s: Some(0.001),
                },
                MotorAnswer { speed_ratio: 1.01, speed_ratio_deviation: 0.0, ..MotorAnswer::default() },
            ],
            tracker_mount: Some(TrackerMountRecord {
                tilt_rad: [0.1 / 3.0, -0.01],
                tilt_deviation_rad: [0.001, 0.002 / 3.0],
                lever_m: Some([0.03, -0.02, 1.0 / 30.0]),
                lever_deviation_m: None,
            }),
            constant_force: Some(ConstantForceRecord {
                force_m_s2: [0.2 / 3.0, -0.03],
                force_deviation_m_s2: [0.001, 0.01 / 3.0],
            }),
            rotor_delay_s: Some(0.1 / 3.0),
            rotation_refused: vec!["C2_q = -3".into()],
            not_identified: vec![
                NotIdentified::of_group(Group::Rotation, "C2_q = -3".into(), "fly \"more\""),
                NotIdentified::of_axis(crate::axis::Axis::W, "R2 = -0.1".into(), "climb"),
            ],
            verdicts: Some(PerGroup {
                translation: Verdict::MissingEffect,
                rotation: Verdict::NotIdentified,
            }),
            refinement: Some(RefinementRecord {
                rows: "moments".into(),
                kept: true,
                reason: "it falls".into(),
                before: OpenLoopSums { position_m: 1.0 / 7.0, ..OpenLoopSums::default() },
                after: OpenLoopSums::default(),
            }),
        });
        model.history.push(HistoryEntry {
            effect: "ground-effect".into(),
            supported: true,
            sse_before: PerAxis::from_fn(|_| std::f64::consts::PI),
            sse_after: PerAxis::default(),
        });
        let text = model.to_toml();
        assert_eq!(Model::parse(&text, Path::new("m.toml")).unwrap(), model);
        assert_eq!(Model::parse(&text, Path::new("m.toml")).unwrap().to_toml(), text);
    }

    /// Only a model without a map says whether rotor speeds were logged, and only where they were.
    #[test]
    fn units_are_those_of_the_rotor_quantity() {
        let mut model = Model::thesis();
        model.set(Effect::ThrustLinear, &[40.0]);
        let with_map = model.to_toml();
        assert!(
            with_map.contains("\"rad/s\"") && !with_map.contains("cmd\"") && !with_map.contains("logged")
        );
        let motors = &mut model.vehicle.motors;
        (motors.command, motors.voltage, motors.offset) = (None, None, None);
        motors.map = Some(crate::vehicle::MotorMapKind::Identify);
        let in_commands = model.to_toml();
        assert!(in_commands.contains("unit = \"1/(s^2 cmd^2)\"") && !in_commands.contains("\"rad/s\""));
        assert!(in_commands.contains("unit = \"cmd\"") && !in_commands.contains("logged"), "{in_commands}");
        assert_eq!(Model::parse(&in_commands, Path::new("m.toml")).unwrap(), model);
        model.reference.rotor_speeds_logged = true;
        let logged = model.to_toml();
        assert!(logged.contains("\"rad/s\"") && !logged.contains("cmd\""), "{logged}");
        assert_eq!(Model::parse(&logged, Path::new("m.toml")).unwrap(), model);
    }

    /// Three of the thesis' coefficients with a covariance made by hand, two of them moved again later.
    #[test]
    fn covariances_are_kept_and_round_trip() {
        let mut model = Model::thesis();
        let count = model.covariance().nrows();
        assert_eq!(model.covariance(), DMatrix::zeros(count, count), "printed coefficients have no errors");
        assert!(model.to_toml().contains("version = 1"));
        let given = DMatrix::from_row_slice(3, 3, &[4.0, 1.0, -0.6, 1.0, 0.25, 0.0, -0.6, 0.0, 0.09]);
        model.set_covariance(&[2, 0, 5], &given);
        let errors: Vec<_> = model.terms.iter().flat_map(|t| &t.coefficients).map(|c| c.std_error).collect();
        assert_eq!((errors[2], errors[0], errors[5], errors[1]), (Some(2.0), Some(0.5), Some(0.3), None));
        let kept = model.covariance();
        // Correlations are quotients and products of roots: a few roundings.
        let near = |place: (usize, usize), value: f64| {
            assert!(
                (kept[place] - value).abs() < 1e-15 && kept[place] == kept[(place.1, place.0)],
                "{place:?}"
            );
        };
        for (place, value) in [((2, 2), 4.0), ((2, 0), 1.0), ((5, 2), -0.6), ((5, 0), 0.0), ((5, 5), 0.09)] {
            near(place, value);
        }
        assert_eq!(kept.iter().filter(|x| **x != 0.0).count(), 7);

        let text = model.to_toml();
        assert!(text.contains("version = 2") && text.contains("[correlation]"), "{text}");
        let read = Model::parse(&text, Path::new("m.toml")).unwrap();
        assert_eq!((read.to_toml(), &read), (text.clone(), &model));
        assert_eq!(read.covariance(), kept);

        model.set_covariance(&[0, 1], &DMatrix::from_row_slice(2, 2, &[1.0, 0.5, 0.5, 1.0]));
        let moved = model.covariance();
        assert_eq!(
            (moved[(0, 1)], moved[(0, 2)], moved[(2, 2)], moved[(5, 2)]),
            (0.5, 0.0, 4.0, kept[(5, 2)])
        );
        // Without an effect the rest keeps its correlations.
        let first = model.terms.remove(0);
        let left = first.coefficients.len();
        assert_eq!(model.covariance(), moved.view_range(left.., left..).into_owned());

        let name = |k: usize| coefficient_names(&read.terms)[k].clone();
        for (from, to, expected) in [
            (name(5), "thrust.C_X".to_owned(), "no coefficient \"thrust.C_X\""),
            (name(5), name(0), "is there twice"),
            ("[correlation]".into(), "[correlation]\nunits = 1".into(), "units"),
            ("rows = [[], ".into(), "rows = [[1.0], ".into(), "need rows of 0 to 2 numbers"),
        ] {
            let table = text.find("[correlation]").unwrap();
            let edited = format!("{}{}", &text[..table], text[table..].replacen(&from, &to, 1));
            assert_ne!(edited, text, "{from}");
            let error = Model::parse(&edited, Path::new("m.toml")).unwrap_err().to_string();
            assert!(error.contains(expected) && error.lines().count() == 1, "{error}");
        }
    }

    /// Files from before alignment and refinement have fewer fields in their fit.
    #[test]
    fn a_fit_record_without_the_newer_fields_is_read() {
        let mut model = Model::thesis();
        model.fit = Some(FitRecord::default());
        let text = model.to_toml();
        let newer = [
            "rotor_delay_s",
            "rotation_refused",
            "refinement",
            "scatter",
            "not_identified",
            "verdicts",
            "balance",
            "flown_speed",
        ];
        for newer in newer {
            assert!(!text.contains(newer), "{text}");
        }
        assert_eq!(Model::parse(&text, Path::new("m.toml")).unwrap(), model);
    }

    #[test]
    fn other_versions_effects_and_coefficients_are_clear_errors() {
        let text = Model::thesis().to_toml();
        for (from, to, expected) in [
            ("version = 1", "version = 3", "version 3 is not read"),
            ("quadlab-model", "other", "format \"other\""),
            ("id = \"thrust\"", "id = \"thurst\"", "unknown effect \"thurst\""),
            ("name = \"C_T\"", "name = \"C_X\"", "has the coefficients C_T, the file gives C_X"),
            ("mass = 1.214", "mass = 0.0", "mass = 0 is impossible"),
        ] {
            assert!(text.contains(from), "{from}");
            let error =
                Model::parse(&text.replacen(from, to, 1), Path::new("m.toml")).unwrap_err().to_string();
            assert!(error.contains(expected) && error.starts_with("m.toml: "), "{error}");
            assert_eq!(error.lines().count(), 1, "{error}");
        }
    }

    /// Of a body with moments 1, 2 and 3 the ratios are -1, 1 and -1/3: a flat plate, which is just possible.
    #[test]
    fn given_moments_of_inertia_are_those_of_a_body() {
        let with = |value: f64, std_error: Option<f64>| {
            let mut model = Model::thesis();
            model.set(Effect::InertiaCoupling, &[-1.0, 1.0, -1.0 / 3.0]);
            let term = model.terms.iter_mut().find(|term| term.effect == Effect::InertiaCoupling).unwrap();
            term.coefficients[1] = Estimate { value, std_error };
            Model::parse(&model.to_toml(), Path::new("m.toml"))
        };
        for (value, std_error) in [(1.0, None), (-1.0, None), (1.2, Some(0.3))] {
            assert!(with(value, std_error).is_ok(), "{value}");
        }
        for value in [1.001, -1.3, 1e9] {
            let error = with(value, None).unwrap_err().to_string();
            assert!(error.starts_with("m.toml: effect \"inertia-coupling\": (Izz-Ixx)/Iyy = "), "{error}");
            assert!(error.contains("is impossible") && error.lines().count() == 1, "{error}");
        }
    }

    #[test]
    fn thesis_model_has_the_whole_basic_model() {
        let model = Model::thesis();
        for effect in Effect::basic() {
            assert!(model.has(effect), "{effect}");
        }
        assert!(model.has(Effect::FlappingMoment) && model.has(Effect::RateCoupling));
    }
}
