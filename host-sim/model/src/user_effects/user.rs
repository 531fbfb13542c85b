//! Users' effects that have been read: kept to the end of the program.
//!
//! A definition that was kept once is found again and costs nothing more; another one with the same identifier is another
//! effect. Which of them an identifier means is [`Registry::known`]: a model that has one keeps it, whatever the identifier
//! comes to mean later.

use std::cmp::Ordering;
use std::fmt;
use std::hash::{Hash, Hasher};
use std::path::Path;
use std::sync::{PoisonError, RwLock, RwLockWriteGuard};

use crate::axis::{AXES, Axis};
use crate::effect::{EffectInfo, Kind, Sink};
use crate::memory::LagId;
use crate::sample::Sample;
use crate::user_effects::check::Known;
use crate::user_effects::definition::{
    Definition, File, MAX_COEFFICIENTS, MAX_DEFINITIONS, MAX_EFFECTS, MAX_FILE_BYTES, MAX_OWN_DEFINITIONS,
    MAX_STARTS, UserEffectError,
};
use crate::user_effects::effect::UserEffect;
use crate::user_effects::row::{INERTIAL, Row};
use crate::vehicle::toml_message;

/// A user's effect that has been read; copied and compared like those of the catalogue. Two are the same where their
/// definitions are.
#[derive(Clone, Copy)]
pub struct User(&'static Interned);

#[derive(Debug)]
struct Interned {
    info: EffectInfo,
    effect: UserEffect,
    /// Its place among all definitions that were kept: no two have the same.
    place: usize,
}

impl PartialEq for User {
    fn eq(&self, other: &Self) -> bool {
        self.0.place == other.0.place
    }
}

impl Eq for User {}

impl Hash for User {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.place.hash(state);
    }
}

impl PartialOrd for User {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for User {
    fn cmp(&self, other: &Self) -> Ordering {
        (self.0.info.id, self.0.place).cmp(&(other.0.info.id, other.0.place))
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
    pub effect: User,
    /// The row of its formula.
    pub row: String,
    /// The formula.
    pub formula: String,
}

impl fmt::Display for Undefined {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { effect, row, formula } = self;
        write!(f, "effect \"{effect:?}\": acceleration.{row} = \"{formula}\" is not a finite number")
    }
}

impl User {
    /// What it says of itself.
    pub const fn info(self) -> &'static EffectInfo {
        &self.0.info
    }

    /// Names of the measured quantities in its formulas.
    pub(crate) fn quantities(self) -> Vec<&'static str> {
        self.0.effect.quantities()
    }

    /// Names of the further columns of flight files in its formulas.
    pub fn columns_named(self) -> Vec<&'static str> {
        self.0.effect.columns()
    }

    /// What its formulas look back at.
    pub fn lags(self) -> Vec<LagId> {
        self.0.effect.lags()
    }

    /// Makes it what its identifier means, in place of another definition where there is one.
    ///
    /// # Errors
    /// When there are too many; `path` is for the message.
    pub fn make_known(self, path: &Path) -> Result<(), UserEffectError> {
        registry().make_known(self, path)
    }

    /// Its identifier means nothing from now on. Models that have the effect keep it.
    pub fn forget(self) {
        registry().known.retain(|own| *own != self);
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
            self.0.effect.add_naming(k, sample, &unit, &mut sum);
            for axis in AXES {
                if self.0.effect.formulas.iter().any(|f| f.names(k) && f.row.acts_on(axis)) {
                    sink.add(axis, k, sum[axis.index()]);
                }
            }
        }
    }

    /// Adds its accelerations to the six rows.
    pub(crate) fn add_accelerations(self, sample: &Sample, coefficients: &[f64], sum: &mut [f64; 6]) {
        self.0.effect.add(sample, coefficients, sum);
    }

    /// The rows that it acts on, whatever the sample.
    pub fn axes(self) -> Vec<Axis> {
        self.0.effect.axes()
    }

    /// What it adds to the six rows with these coefficients: m/s^2 and rad/s^2.
    pub fn accelerations(self, sample: &Sample, coefficients: &[f64]) -> [f64; 6] {
        let mut sum = [0.0; 6];
        self.add_accelerations(sample, coefficients, &mut sum);
        sum
    }

    /// The first of its formulas that has no finite value at a sample.
    pub fn undefined(self, sample: &Sample, coefficients: &[f64]) -> Option<Undefined> {
        let wrong = self.0.effect.formulas.iter().find(|f| !f.value(sample, coefficients).is_finite())?;
        let row = match wrong.row {
            Row::Body(axis) => axis.name(),
            Row::Inertial(k) => INERTIAL[k],
        };
        let formula = self.definition().acceleration.get(row).cloned().unwrap_or_default();
        Some(Undefined { effect: self, row: row.into(), formula })
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

/// Reads a file of effects and makes them known; `catalogue` has the identifiers that they cannot have.
pub(crate) fn read(path: &Path, catalogue: &[&str]) -> Result<Vec<User>, UserEffectError> {
    let refuse = |source| UserEffectError::Read { path: path.to_owned(), source };
    let size = std::fs::metadata(path).map_err(refuse)?.len();
    if size > MAX_FILE_BYTES {
        return Err(UserEffectError::TooLarge { path: path.to_owned() });
    }
    let text = std::fs::read_to_string(path).map_err(refuse)?;
    parse(&text, path, catalogue)?.into_iter().map(|effect| know(effect, path)).collect()
}

/// Parses and checks the text of a file of effects without keeping them.
pub(crate) fn parse(text: &str, path: &Path, catalogue: &[&str]) -> Result<Vec<UserEffect>, UserEffectError> {
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
    let known = known_beside(catalogue);
    file.effect.into_iter().map(|definition| UserEffect::check(definition, path, &known)).collect()
}

/// Parses and checks the text of a file of effects and keeps them, without making them known by their identifiers.
pub(crate) fn draft(text: &str, path: &Path, catalogue: &[&str]) -> Result<Vec<User>, UserEffectError> {
    parse(text, path, catalogue)?.into_iter().map(|effect| registry().keep(effect, path)).collect()
}

/// Checks a definition of the program's own making and keeps it, without making it known.
pub(crate) fn draft_one(
    definition: Definition,
    path: &Path,
    catalogue: &[&str],
) -> Result<User, UserEffectError> {
    let effect = UserEffect::check(definition, path, &known_beside(catalogue))?;
    registry().keep_own(effect, path)
}

/// Checks a definition of a model file and makes it known. What it is confused with may be defined in a file that is not here.
pub(crate) fn define(
    definition: Definition,
    path: &Path,
    catalogue: &[&str],
) -> Result<User, UserEffectError> {
    let named: Vec<String> = definition.confused_with.keys().cloned().collect();
    let known = Known { catalogue, users: named.iter().map(String::as_str).collect() };
    know(UserEffect::check(definition, path, &known)?, path)
}

fn known_beside<'a>(catalogue: &'a [&'a str]) -> Known<'a> {
    Known { catalogue, users: all().iter().map(|user| user.info().id).collect() }
}

/// Users' effects of this program.
struct Registry {
    /// All definitions that were kept. They are never given back, so that an effect can be copied: some kilobytes each, and
    /// no more than [`MAX_DEFINITIONS`] of users and [`MAX_OWN_DEFINITIONS`] of the program's own.
    kept: Vec<User>,
    /// How many of them the program made itself.
    own: usize,
    /// What identifiers mean.
    known: Vec<User>,
}

static REGISTRY: RwLock<Registry> = RwLock::new(Registry { kept: Vec::new(), own: 0, known: Vec::new() });

fn registry() -> RwLockWriteGuard<'static, Registry> {
    REGISTRY.write().unwrap_or_else(PoisonError::into_inner)
}

/// The users' effects that have been read.
pub(crate) fn all() -> Vec<User> {
    REGISTRY.read().unwrap_or_else(PoisonError::into_inner).known.clone()
}

impl Registry {
    fn keep(&mut self, effect: UserEffect, path: &Path) -> Result<User, UserEffectError> {
        let is_full = self.kept.len() - self.own >= MAX_DEFINITIONS;
        self.put(effect, is_full, path)
    }

    /// Keeps one of the program's own making.
    fn keep_own(&mut self, effect: UserEffect, path: &Path) -> Result<User, UserEffectError> {
        let before = self.kept.len();
        let user = self.put(effect, self.own >= MAX_OWN_DEFINITIONS, path)?;
        self.own += self.kept.len() - before;
        Ok(user)
    }

    fn put(&mut self, effect: UserEffect, is_full: bool, path: &Path) -> Result<User, UserEffectError> {
        if let Some(same) = self.kept.iter().find(|user| *user.definition() == effect.definition) {
            return Ok(*same);
        }
        if is_full {
            return Err(UserEffectError::TooManyChanges { path: path.to_owned() });
        }
        let info = effect.info();
        let user = User(Box::leak(Box::new(Interned { info, effect, place: self.kept.len() })));
        self.kept.push(user);
        Ok(user)
    }

    fn make_known(&mut self, user: User, path: &Path) -> Result<(), UserEffectError> {
        match self.known.iter().position(|own| own.info().id == user.info().id) {
            Some(place) => self.known[place] = user,
            None if self.known.len() >= MAX_EFFECTS => {
                return Err(UserEffectError::TooMany { path: path.to_owned() });
            }
            None => self.known.push(user),
        }
        Ok(())
    }
}

/// Keeps an effect and makes it known, where its identifier does not mean another one.
fn know(effect: UserEffect, path: &Path) -> Result<User, UserEffectError> {
    let mut registry = registry();
    let user = registry.keep(effect, path)?;
    let id = user.info().id;
    if registry.known.iter().any(|own| own.info().id == id && *own != user) {
        return Err(UserEffectError::Field {
            path: path.to_owned(),
            effect: id.to_owned(),
            field: "id".into(),
            problem: "is already defined in another way; give one of the two another id".into(),
        });
    }
    registry.make_known(user, path)?;
    Ok(user)
}
