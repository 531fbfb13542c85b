//! Effects of users: a name, a formula for each row it acts on, coefficients and constants with units, in a TOML file.
//!
//! ```toml
//! [[effect]]
//! id = "my-cable"
//! sentence = "A rubber cable pulls the craft towards a hook."
//! excitation = "hover at the corners of the flying space"
//! acceleration.north = "-stiffness * north / mass"
//! acceleration.east = "-stiffness * east / mass"
//! acceleration.down = "stiffness * (hook - down) / mass"
//! coefficient = [{ name = "stiffness", unit = "N/m", possible = [0.0, 100.0], typical = 1.0 }]
//! constant = [{ name = "hook", unit = "m", value = -1.0 }]
//! ```
//!
//! Rows: `u v w` (m/s^2, body) and `p q r` (rad/s^2, body) as in the equations of motion, and `north east down` (m/s^2),
//! which are turned into the body. Names in formulas are [`crate::QUANTITIES`], the effect's coefficients, and its
//! constants. Every formula must have its row's unit.
//!
//! A user's effect is then an effect like the others. Where its formulas are linear in the coefficients, it is regressed
//! directly; else it is fitted by Gauss and Newton's method from several starts: coefficients that enter linearly when the
//! others are given are solved for, the others (its *shape*) start about their typical values.
//!
//! Definitions are kept to the end of the program, [`MAX_EFFECTS`] at most: an effect can then be copied and compared as
//! those of the catalogue are. This is the one thing that the library keeps for itself.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};
use std::sync::{PoisonError, RwLock};

use serde::{Deserialize, Serialize};

use crate::dimension::Dimension;
use crate::effects::{CATALOGUE, Effect};
use crate::formula::{Entry, FUNCTIONS, Formula, Trace, dimension_of};
use crate::quantity::{QUANTITIES, Quantity};
use crate::vehicle::toml_message;
use crate::{AXES, Axis, Coefficient, EffectInfo, Kind, Question, Sample, Sink};

/// Most users' effects in one program.
pub const MAX_EFFECTS: usize = 16;
/// Largest file, bytes.
pub const MAX_FILE_BYTES: u64 = 64 * 1024;
/// Most coefficients of one effect.
pub const MAX_COEFFICIENTS: usize = 8;
const MAX_CONSTANTS: usize = 32;
/// Longest identifier or name, and longest sentence, characters.
const MAX_NAME: usize = 40;
const MAX_SENTENCE: usize = 300;
/// Most starts of a fit.
const MAX_STARTS: usize = 27;

/// One coefficient as a file gives it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CoefficientDefinition {
    /// Name in formulas and in results.
    pub name: String,
    /// Unit, coherent SI.
    pub unit: String,
    /// Smallest and largest physically possible value.
    pub possible: [f64; 2],
    /// An ordinary magnitude.
    pub typical: f64,
}

/// A number with a unit that formulas can name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ConstantDefinition {
    /// Name in formulas.
    pub name: String,
    /// Unit, coherent SI.
    pub unit: String,
    /// Value in that unit.
    pub value: f64,
}

/// An effect as a file gives it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// The word for it.
    pub id: String,
    /// One sentence for people.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sentence: Option<String>,
    /// The manoeuvre that shows it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excitation: Option<String>,
    /// Formula of each row it acts on.
    pub acceleration: BTreeMap<String, String>,
    /// Effects that look alike, each with the manoeuvre that separates the two.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub confused_with: BTreeMap<String, String>,
    /// Its coefficients, in order.
    pub coefficient: Vec<CoefficientDefinition>,
    /// Its constants.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constant: Vec<ConstantDefinition>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    effect: Vec<Definition>,
}

/// Why a user's effect was refused.
#[derive(Debug, thiserror::Error)]
pub enum UserEffectError {
    /// The file cannot be read.
    #[error("{}: cannot read the file of effects: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Far larger than any definition.
    #[error("{}: is larger than {MAX_FILE_BYTES} bytes, which no file of effects is", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// Not TOML, a field missing, unknown or of the wrong type.
    #[error("{}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The parser's message on one line.
        message: String,
    },
    /// A field that cannot be right.
    #[error("{}: effect \"{effect}\": {field}: {problem}", path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// The effect.
        effect: String,
        /// The field.
        field: String,
        /// What is wrong with it.
        problem: String,
    },
    /// More than are kept.
    #[error("{}: more than {MAX_EFFECTS} effects of users; leave out some", path.display())]
    TooMany {
        /// The file.
        path: PathBuf,
    },
}

/// A row of a formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Row {
    Body(Axis),
    /// North, east or down.
    Inertial(usize),
}

const INERTIAL: [&str; 3] = ["north", "east", "down"];

impl Row {
    fn parse(name: &str) -> Option<Self> {
        let body = AXES.into_iter().find(|axis| axis.name() == name).map(Row::Body);
        body.or_else(|| INERTIAL.iter().position(|row| *row == name).map(Row::Inertial))
    }

    const fn unit(self) -> &'static str {
        match self {
            Row::Body(axis) => axis.unit(),
            Row::Inertial(_) => "m/s^2",
        }
    }

    fn acts_on(self, axis: Axis) -> bool {
        match self {
            Row::Body(own) => own == axis,
            Row::Inertial(_) => axis.is_force(),
        }
    }
}

/// Where a name's value comes from.
#[derive(Debug, Clone, Copy)]
enum Input {
    Quantity(&'static Quantity),
    Coefficient(usize),
    Constant(f64),
}

#[derive(Debug)]
struct RowFormula {
    row: Row,
    formula: Formula,
    inputs: Vec<Input>,
}

impl RowFormula {
    fn value(&self, sample: &Sample, coefficients: &[f64]) -> f64 {
        let mut values = [0.0; MAX_NAMES];
        for (value, input) in values.iter_mut().zip(&self.inputs) {
            *value = match input {
                Input::Quantity(quantity) => (quantity.value)(sample),
                Input::Coefficient(k) => coefficients.get(*k).copied().unwrap_or(0.0),
                Input::Constant(value) => *value,
            };
        }
        self.formula.value(&values[..self.inputs.len()])
    }

    fn names(&self, coefficient: usize) -> bool {
        self.inputs.iter().any(|input| matches!(input, Input::Coefficient(k) if *k == coefficient))
    }
}

/// Most different names in one formula.
const MAX_NAMES: usize = 24;

/// A checked definition.
#[derive(Debug)]
pub struct UserEffect {
    definition: Definition,
    formulas: Vec<RowFormula>,
    /// Whether every formula is linear in the coefficients and vanishes with them.
    is_linear: bool,
    /// Coefficients that have to be given so that the rest enters linearly.
    is_shape: Vec<bool>,
}

/// A user's effect that has been read; copied and compared like those of the catalogue.
#[derive(Clone, Copy)]
pub struct User(&'static Interned);

#[derive(Debug)]
struct Interned {
    info: EffectInfo,
    effect: UserEffect,
}

impl PartialEq for User {
    fn eq(&self, other: &Self) -> bool {
        self.0.info.id == other.0.info.id
    }
}

impl Eq for User {}

impl Hash for User {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.info.id.hash(state);
    }
}

impl PartialOrd for User {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for User {
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.info.id.cmp(other.0.info.id)
    }
}

impl fmt::Debug for User {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.0.info.id)
    }
}

/// A formula without a finite value.
#[derive(Debug, Clone, PartialEq)]
pub struct Undefined {
    /// The effect.
    pub effect: Effect,
    /// The row of its formula.
    pub row: String,
    /// The formula.
    pub formula: String,
}

impl fmt::Display for Undefined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { effect, row, formula } = self;
        write!(f, "effect \"{effect}\": acceleration.{row} = \"{formula}\" is not a finite number")
    }
}

impl User {
    /// What it says of itself.
    pub const fn info(self) -> &'static EffectInfo {
        &self.0.info
    }

    /// As it was defined.
    pub fn definition(self) -> &'static Definition {
        &self.0.effect.definition
    }

    /// Its columns, where it is linear.
    pub(crate) fn columns(self, sample: &Sample, sink: &mut impl Sink) {
        let info = self.info();
        if info.kind == Kind::Adjusting {
            return;
        }
        for k in 0..info.coefficients.len() {
            let mut unit = [0.0; MAX_COEFFICIENTS];
            unit[k] = 1.0;
            let mut sum = [0.0; 6];
            self.0.effect.add(sample, &unit, |f| f.names(k), &mut sum);
            for axis in AXES {
                if self.0.effect.formulas.iter().any(|f| f.names(k) && f.row.acts_on(axis)) {
                    sink.add(axis, k, sum[axis.index()]);
                }
            }
        }
    }

    /// Adds its accelerations to the six rows.
    pub(crate) fn add_accelerations(self, sample: &Sample, coefficients: &[f64], sum: &mut [f64; 6]) {
        self.0.effect.add(sample, coefficients, |_| true, sum);
    }

    /// The first of its formulas that has no finite value at a sample.
    pub fn undefined(self, sample: &Sample, coefficients: &[f64]) -> Option<Undefined> {
        let wrong = self.0.effect.formulas.iter().find(|f| !f.value(sample, coefficients).is_finite())?;
        let row = match wrong.row {
            Row::Body(axis) => axis.name(),
            Row::Inertial(k) => INERTIAL[k],
        };
        let formula = self.definition().acceleration.get(row).cloned().unwrap_or_default();
        Some(Undefined { effect: Effect::User(self), row: row.into(), formula })
    }

    /// Starts of a fit: values of the coefficients that make its shape, none for those that least squares give. Nothing
    /// for an effect that is linear.
    pub(crate) fn starts(self) -> Vec<Vec<Option<f64>>> {
        let UserEffect { definition, is_shape, .. } = &self.0.effect;
        if self.info().kind != Kind::Adjusting {
            return Vec::new();
        }
        let shapes = is_shape.iter().filter(|shape| **shape).count();
        let mut starts = vec![Vec::new()];
        for (coefficient, is_shape) in definition.coefficient.iter().zip(is_shape) {
            let [low, high] = coefficient.possible;
            let mut values = vec![coefficient.typical];
            // Several of each, unless that makes too many together.
            if 3_usize.pow(shapes as u32) <= MAX_STARTS {
                let sizes = if low < 0.0 { [-1.0, 0.1] } else { [0.3, 3.0] };
                values.extend(sizes.map(|size| size * coefficient.typical));
            }
            values.retain(|value| *value >= low && *value <= high);
            if values.is_empty() {
                values.push(0.5 * (low + high));
            }
            let values = if *is_shape { values.into_iter().map(Some).collect() } else { vec![None] };
            starts = starts
                .into_iter()
                .flat_map(|start: Vec<Option<f64>>| {
                    values.iter().map(move |value| start.iter().copied().chain([*value]).collect())
                })
                .collect();
        }
        starts
    }
}

impl UserEffect {
    fn add(
        &self,
        sample: &Sample,
        coefficients: &[f64],
        which: impl Fn(&RowFormula) -> bool,
        sum: &mut [f64; 6],
    ) {
        let mut inertial = nalgebra::Vector3::zeros();
        let mut any_inertial = false;
        for formula in self.formulas.iter().filter(|f| which(f)) {
            let value = formula.value(sample, coefficients);
            match formula.row {
                Row::Body(axis) => sum[axis.index()] += value,
                Row::Inertial(k) => {
                    inertial[k] += value;
                    any_inertial = true;
                }
            }
        }
        if any_inertial {
            let body = sample.input.dcm * inertial;
            sum.iter_mut().zip(body.iter()).for_each(|(s, b)| *s += b);
        }
    }
}

/// Reads a file of effects and makes them known to [`Effect::from_id`], [`Effect::candidates`] and the rest.
///
/// # Errors
/// A file that cannot be read, a definition that cannot be right, or one whose identifier already means something else.
pub fn read(path: &Path) -> Result<Vec<Effect>, UserEffectError> {
    let refuse = |source| UserEffectError::Read { path: path.to_owned(), source };
    let size = std::fs::metadata(path).map_err(refuse)?.len();
    if size > MAX_FILE_BYTES {
        return Err(UserEffectError::TooLarge { path: path.to_owned() });
    }
    let text = std::fs::read_to_string(path).map_err(refuse)?;
    parse(&text, path)?.into_iter().map(|effect| keep(effect, path)).collect()
}

/// Parses and checks the text of a file of effects without making them known; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, path: &Path) -> Result<Vec<UserEffect>, UserEffectError> {
    if text.len() as u64 > MAX_FILE_BYTES {
        return Err(UserEffectError::TooLarge { path: path.to_owned() });
    }
    let file: File = toml::from_str(text).map_err(|error| UserEffectError::Parse {
        path: path.to_owned(),
        message: toml_message(text, &error),
    })?;
    if file.effect.len() > MAX_EFFECTS {
        return Err(UserEffectError::TooMany { path: path.to_owned() });
    }
    file.effect.into_iter().map(|definition| UserEffect::check(definition, path)).collect()
}

/// Checks a definition and makes it known; `path` is for messages.
pub(crate) fn define(definition: Definition, path: &Path) -> Result<Effect, UserEffectError> {
    keep(UserEffect::check(definition, path)?, path)
}

static KNOWN: RwLock<Vec<User>> = RwLock::new(Vec::new());

/// The users' effects that have been read.
pub(crate) fn all() -> Vec<User> {
    KNOWN.read().unwrap_or_else(PoisonError::into_inner).clone()
}

fn keep(effect: UserEffect, path: &Path) -> Result<Effect, UserEffectError> {
    let mut known = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
    let id = effect.definition.id.as_str();
    if let Some(same) = known.iter().find(|user| user.info().id == id) {
        if *same.definition() == effect.definition {
            return Ok(Effect::User(*same));
        }
        return Err(UserEffectError::Field {
            path: path.to_owned(),
            effect: id.to_owned(),
            field: "id".into(),
            problem: "is already defined in another way; give one of the two another id".into(),
        });
    }
    if known.len() >= MAX_EFFECTS {
        return Err(UserEffectError::TooMany { path: path.to_owned() });
    }
    let info = effect.info();
    let user = User(Box::leak(Box::new(Interned { info, effect })));
    known.push(user);
    Ok(Effect::User(user))
}

fn forever(text: &str) -> &'static str {
    Box::leak(text.to_owned().into_boxed_str())
}

/// A field and what is wrong with it.
type Problem = (String, String);

impl UserEffect {
    /// Its identifier.
    pub fn id(&self) -> &str {
        &self.definition.id
    }

    /// Whether every formula is linear in the coefficients.
    pub fn is_linear(&self) -> bool {
        self.is_linear
    }

    fn check(definition: Definition, path: &Path) -> Result<Self, UserEffectError> {
        let id: String = definition.id.chars().take(MAX_NAME).collect();
        Self::checked(definition).map_err(|(field, problem)| UserEffectError::Field {
            path: path.to_owned(),
            effect: id,
            field,
            problem,
        })
    }

    fn checked(definition: Definition) -> Result<Self, Problem> {
        check_words(&definition)?;
        let coefficients = check_coefficients(&definition)?;
        let constants = check_constants(&definition)?;
        if definition.acceleration.is_empty() {
            return Err(("acceleration".into(), format!("has no row; rows are {}", rows_known())));
        }
        let names = Names { definition: &definition, coefficients: &coefficients, constants: &constants };
        let mut formulas = Vec::new();
        for (row, text) in &definition.acceleration {
            let field = format!("acceleration.{row}");
            formulas.push(names.formula(row, text).map_err(|problem| (field, problem))?);
        }
        for (k, coefficient) in definition.coefficient.iter().enumerate() {
            if !formulas.iter().any(|f| f.names(k)) {
                return Err((format!("coefficient {}", coefficient.name), "is in no formula".into()));
            }
        }
        let (is_linear, is_shape) = names.shapes(&formulas);
        Ok(Self { formulas, is_linear, is_shape, definition })
    }

    /// What it says of itself, for the rest of the program.
    fn info(&self) -> EffectInfo {
        let definition = &self.definition;
        let acts = |axis: &Axis| self.formulas.iter().any(|f| f.row.acts_on(*axis));
        let coefficients: Vec<Coefficient> = definition
            .coefficient
            .iter()
            .zip(&self.is_shape)
            .map(|(c, is_shape)| Coefficient {
                name: forever(&c.name),
                unit: forever(&c.unit),
                possible: (c.possible[0], c.possible[1]),
                typical: c.typical,
                // A shape only means something together with the rest: zero is no hypothesis about it. What is known of it is
                // hardly more than what is possible.
                prior: is_shape.then(|| 3.0 * c.possible[0].abs().max(c.possible[1].abs())),
            })
            .collect();
        let sentence = definition.sentence.clone().unwrap_or_else(|| "Defined by the user.".into());
        let excitation = definition.excitation.clone().unwrap_or_else(|| self.excitation());
        let confused: Vec<(&str, &str)> =
            definition.confused_with.iter().map(|(id, how)| (forever(id), forever(how))).collect();
        EffectInfo {
            id: forever(&definition.id),
            sentence: forever(&sentence),
            kind: if self.is_linear() { Kind::Linear } else { Kind::Adjusting },
            question: if self.is_linear() { Question::Both } else { Question::Structure },
            axes: Vec::leak(AXES.into_iter().filter(acts).collect()),
            coefficients: Vec::leak(coefficients),
            excitation: forever(&excitation),
            confused_with: Vec::leak(confused),
        }
    }

    fn excitation(&self) -> String {
        let mut names: Vec<&str> = Vec::new();
        for input in self.formulas.iter().flat_map(|f| &f.inputs) {
            match input {
                Input::Quantity(quantity) if !names.contains(&quantity.name) => names.push(quantity.name),
                _ => {}
            }
        }
        format!("fly so that {} vary", names.join(", "))
    }
}

fn rows_known() -> String {
    let axes = AXES.map(Axis::name).join(", ");
    format!("{axes} (body), {} (inertial)", INERTIAL.join(", "))
}

fn check_words(definition: &Definition) -> Result<(), Problem> {
    let id = &definition.id;
    let good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if !(id.starts_with(|c: char| c.is_ascii_lowercase()) && id.chars().all(good) && id.len() <= MAX_NAME) {
        let expected = format!("is a word of a to z, digits and -, at most {MAX_NAME} long");
        return Err(("id".into(), expected));
    }
    if CATALOGUE.iter().any(|effect| effect.id() == id) {
        return Err(("id".into(), "is an effect of the catalogue; choose another word".into()));
    }
    let sentences = [("sentence", &definition.sentence), ("excitation", &definition.excitation)];
    let sentences = sentences.into_iter().filter_map(|(field, text)| Some((field, text.as_ref()?)));
    let confused = definition.confused_with.values().map(|how| ("confused_with", how));
    for (field, text) in sentences.chain(confused) {
        let one_line = !text.chars().any(char::is_control);
        if text.trim().is_empty() || text.chars().count() > MAX_SENTENCE || !one_line {
            return Err((field.into(), format!("is one line of at most {MAX_SENTENCE} characters")));
        }
    }
    if definition.confused_with.len() > CATALOGUE.len() {
        return Err(("confused_with".into(), "names more effects than there are".into()));
    }
    for other in definition.confused_with.keys() {
        if Effect::from_id(other).is_none() {
            let known: Vec<&str> = CATALOGUE.iter().map(|e| e.id()).collect();
            let problem = format!("unknown effect \"{other}\"; known are {}", known.join(", "));
            return Err(("confused_with".into(), problem));
        }
    }
    Ok(())
}

fn check_name(field: &str, name: &str, taken: &[&str]) -> Result<(), Problem> {
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let refuse = |problem: String| Err((field.to_owned(), problem));
    if !(name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(word))
        || name.len() > MAX_NAME
    {
        return refuse(format!("a name is a word of letters, digits and _, at most {MAX_NAME} long"));
    }
    if FUNCTIONS.contains(&name) || ["min", "max", "atan2"].contains(&name) {
        return refuse("is a function's name; choose another".into());
    }
    if let Some(quantity) = QUANTITIES.iter().find(|q| q.name == name) {
        return refuse(format!("is the {}; choose another name", quantity.meaning));
    }
    if taken.contains(&name) {
        return refuse("the name is given twice".into());
    }
    Ok(())
}

fn check_coefficients(definition: &Definition) -> Result<Vec<Dimension>, Problem> {
    let all = &definition.coefficient;
    if all.is_empty() || all.len() > MAX_COEFFICIENTS {
        return Err((
            "coefficient".into(),
            format!("has {}, 1 to {MAX_COEFFICIENTS} are possible", all.len()),
        ));
    }
    let mut dimensions = Vec::new();
    for (k, c) in all.iter().enumerate() {
        let taken: Vec<&str> = all[..k].iter().map(|c| c.name.as_str()).collect();
        let short: String = c.name.chars().take(MAX_NAME).collect();
        let field = format!("coefficient {short:?}");
        check_name(&field, &c.name, &taken)?;
        let [low, high] = c.possible;
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err((format!("{field}: possible"), "is [smallest, largest]".into()));
        }
        if !(c.typical > 0.0 && c.typical.is_finite()) {
            return Err((format!("{field}: typical"), "is an ordinary magnitude, above 0".into()));
        }
        dimensions.push(dimension_of(&c.unit).map_err(|problem| (format!("{field}: unit"), problem))?);
    }
    Ok(dimensions)
}

fn check_constants(definition: &Definition) -> Result<Vec<Dimension>, Problem> {
    let all = &definition.constant;
    if all.len() > MAX_CONSTANTS {
        return Err(("constant".into(), format!("has {}, at most {MAX_CONSTANTS} are possible", all.len())));
    }
    let mut dimensions = Vec::new();
    for (k, c) in all.iter().enumerate() {
        let before = all[..k].iter().map(|c| c.name.as_str());
        let taken: Vec<&str> = definition.coefficient.iter().map(|c| c.name.as_str()).chain(before).collect();
        let short: String = c.name.chars().take(MAX_NAME).collect();
        let field = format!("constant {short:?}");
        check_name(&field, &c.name, &taken)?;
        if !c.value.is_finite() {
            return Err((format!("{field}: value"), "is not finite".into()));
        }
        dimensions.push(dimension_of(&c.unit).map_err(|problem| (format!("{field}: unit"), problem))?);
    }
    Ok(dimensions)
}

/// What formulas of one effect can name.
struct Names<'a> {
    definition: &'a Definition,
    coefficients: &'a [Dimension],
    constants: &'a [Dimension],
}

impl Names<'_> {
    fn formula(&self, row: &str, text: &str) -> Result<RowFormula, String> {
        let row = Row::parse(row).ok_or_else(|| format!("unknown row; rows are {}", rows_known()))?;
        let formula = Formula::parse(text)?;
        if formula.names().len() > MAX_NAMES {
            return Err(format!(
                "has {} different names, at most {MAX_NAMES} are possible",
                formula.names().len()
            ));
        }
        let inputs = formula.names().iter().map(|name| self.input(name)).collect::<Result<Vec<_>, _>>()?;
        if !inputs.iter().any(|input| matches!(input, Input::Coefficient(_))) {
            return Err("names none of the effect's coefficients: there is nothing to identify".into());
        }
        let trace = formula.trace(|name| self.trace(name, &|_| Entry::Free))?;
        let expected = dimension_of(row.unit())?;
        if !trace.dimension.is(expected) {
            return Err(format!("has the unit {}, the row needs {}", trace.dimension, row.unit()));
        }
        Ok(RowFormula { row, formula, inputs })
    }

    fn input(&self, name: &str) -> Result<Input, String> {
        let Definition { coefficient, constant, .. } = self.definition;
        if let Some(k) = coefficient.iter().position(|c| c.name == name) {
            return Ok(Input::Coefficient(k));
        }
        if let Some(constant) = constant.iter().find(|c| c.name == name) {
            return Ok(Input::Constant(constant.value));
        }
        if let Some(quantity) = QUANTITIES.iter().find(|q| q.name == name) {
            return Ok(Input::Quantity(quantity));
        }
        let own = coefficient.iter().map(|c| c.name.as_str()).chain(constant.iter().map(|c| c.name.as_str()));
        let known: Vec<&str> = own.chain(QUANTITIES.iter().map(|q| q.name)).collect();
        let short: String = name.chars().take(MAX_NAME).collect();
        Err(format!("unknown name \"{short}\"; known are {}", known.join(", ")))
    }

    fn trace(&self, name: &str, entry: &dyn Fn(usize) -> Entry) -> Trace {
        let Definition { coefficient, constant, .. } = self.definition;
        if let Some(k) = coefficient.iter().position(|c| c.name == name) {
            return Trace { dimension: self.coefficients[k], entry: entry(k), value: None };
        }
        if let Some(k) = constant.iter().position(|c| c.name == name) {
            return Trace {
                dimension: self.constants[k],
                entry: Entry::Free,
                value: Some(constant[k].value),
            };
        }
        let unit = QUANTITIES.iter().find(|q| q.name == name).map_or("1", |q| q.unit);
        let dimension = dimension_of(unit).unwrap_or(Dimension::NONE);
        Trace { dimension, entry: Entry::Free, value: None }
    }

    /// Whether all coefficients enter linearly, and which have to be given so that the rest does: those that do not by
    /// themselves, then, where coefficients multiply each other, one after the other until they no longer do.
    fn shapes(&self, formulas: &[RowFormula]) -> (bool, Vec<bool>) {
        let enter = |given: &[bool], ways: &[Entry]| {
            formulas.iter().all(|f| {
                let entry = |k: usize| if given[k] { Entry::Free } else { Entry::Linear };
                f.formula.trace(|name| self.trace(name, &entry)).is_ok_and(|t| ways.contains(&t.entry))
            })
        };
        let at_most_linearly = [Entry::Free, Entry::Linear, Entry::Affine];
        let count = self.coefficients.len();
        let alone = |k: usize| (0..count).map(|other| other != k).collect::<Vec<bool>>();
        let mut given: Vec<bool> = (0..count).map(|k| !enter(&alone(k), &at_most_linearly)).collect();
        for k in (0..count).rev() {
            if enter(&given, &at_most_linearly) {
                break;
            }
            given[k] = true;
        }
        (enter(&vec![false; count], &[Entry::Linear]), given)
    }
}
