//! Formulas of users: text to something that can be checked and evaluated.
//!
//! Parsing and evaluation are `exmex`'s. What stands before it is a strict scanner: it refuses what people read in two ways
//! and the library in one (`-u^2`, which it takes as `(-u)^2`; `a^b^c`; `a/-b`), bounds length and depth, and says what
//! is wrong and what is known in one line.
//!
//! The same text is parsed twice. Over `f64` it is evaluated; over [`Traced`] numbers it says which unit its value has
//! and how the effect's coefficients enter it: a formula is linear when its derivatives with respect to them do not
//! depend on them and it vanishes with them. That is read off its structure (sums of linear terms, linear times free,
//! linear over free), never off numbers, so a formula called linear is linear.
//!
//! Deliberately absent: comparisons, branches, user functions, state.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::str::FromStr;

use exmex::{BinOp, Express as _, FlatEx, MakeOperators, MatchLiteral, Operator};

use crate::dimension::Dimension;

/// Longest formula or unit, bytes.
pub(crate) const MAX_LENGTH: usize = 500;
/// Deepest nesting of brackets.
pub(crate) const MAX_DEPTH: usize = 20;

/// What both kinds of numbers can do.
trait Arithmetic: Clone + Debug + Default + FromStr {
    fn add(self, other: Self) -> Self;
    fn subtract(self, other: Self) -> Self;
    fn multiply(self, other: Self) -> Self;
    fn divide(self, other: Self) -> Self;
    fn power(self, other: Self) -> Self;
    fn minimum(self, other: Self) -> Self;
    fn maximum(self, other: Self) -> Self;
    fn angle(self, other: Self) -> Self;
    fn root(self) -> Self;
    fn absolute(self) -> Self;
    fn sign(self) -> Self;
    fn of_pure(self, function: &'static str, f: fn(f64) -> f64) -> Self;
}

/// Functions of one argument. Those from `sin` on take pure numbers only.
pub(crate) const FUNCTIONS: [&str; 13] =
    ["sqrt", "abs", "sign", "sin", "cos", "tan", "asin", "acos", "atan", "tanh", "exp", "ln", "log10"];
/// Functions of two arguments, and the operators that they become.
const OF_TWO: [(&str, &str); 3] = [("min", "&"), ("max", "|"), ("atan2", "@")];

fn operators<T: Arithmetic>() -> Vec<Operator<'static, T>> {
    let binary = |text, priority, is_commutative, apply| {
        Operator::make_bin(text, BinOp { apply, prio: priority, is_commutative })
    };
    vec![
        binary("+", 0, true, T::add),
        binary("-", 1, false, T::subtract),
        binary("*", 2, true, T::multiply),
        binary("/", 3, false, T::divide),
        binary("^", 4, false, T::power),
        binary("&", 5, true, T::minimum),
        binary("|", 5, true, T::maximum),
        binary("@", 5, false, T::angle),
        Operator::make_unary("sqrt", T::root),
        Operator::make_unary("abs", T::absolute),
        Operator::make_unary("sign", T::sign),
        Operator::make_unary("sin", |x| x.of_pure("sin", f64::sin)),
        Operator::make_unary("cos", |x| x.of_pure("cos", f64::cos)),
        Operator::make_unary("tan", |x| x.of_pure("tan", f64::tan)),
        Operator::make_unary("asin", |x| x.of_pure("asin", f64::asin)),
        Operator::make_unary("acos", |x| x.of_pure("acos", f64::acos)),
        Operator::make_unary("atan", |x| x.of_pure("atan", f64::atan)),
        Operator::make_unary("tanh", |x| x.of_pure("tanh", f64::tanh)),
        Operator::make_unary("exp", |x| x.of_pure("exp", f64::exp)),
        Operator::make_unary("ln", |x| x.of_pure("ln", f64::ln)),
        Operator::make_unary("log10", |x| x.of_pure("log10", f64::log10)),
    ]
}

#[derive(Clone, Debug)]
struct Operators<T>(PhantomData<T>);

impl<T: Arithmetic> MakeOperators<T> for Operators<T> {
    fn make<'a>() -> Vec<Operator<'a, T>> {
        operators()
    }
}

/// Numbers with a decimal point and an exponent, as the scanner lets them through.
#[derive(Clone, Debug)]
struct Number;

impl MatchLiteral for Number {
    fn is_literal(text: &str) -> Option<&str> {
        match number_length(text) {
            0 => None,
            length => Some(&text[..length]),
        }
    }
}

/// Bytes of the number that a text begins with; 0 if it does not.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let whole = digits(0);
    if whole == 0 {
        return 0;
    }
    let mut end = whole;
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

impl Arithmetic for f64 {
    fn add(self, other: Self) -> Self {
        self + other
    }
    fn subtract(self, other: Self) -> Self {
        self - other
    }
    fn multiply(self, other: Self) -> Self {
        self * other
    }
    fn divide(self, other: Self) -> Self {
        self / other
    }
    fn power(self, other: Self) -> Self {
        // Small whole powers by multiplication: exact, and quick where they are evaluated at every sample.
        if other == 2.0 { self * self } else { self.powf(other) }
    }
    fn minimum(self, other: Self) -> Self {
        // Not `f64::min`, which would hide a NaN.
        if self.is_nan() || self < other { self } else { other }
    }
    fn maximum(self, other: Self) -> Self {
        if self.is_nan() || self > other { self } else { other }
    }
    fn angle(self, other: Self) -> Self {
        self.atan2(other)
    }
    fn root(self) -> Self {
        self.sqrt()
    }
    fn absolute(self) -> Self {
        self.abs()
    }
    fn sign(self) -> Self {
        if self == 0.0 { 0.0 } else { self.signum() }
    }
    fn of_pure(self, _: &'static str, f: fn(f64) -> f64) -> Self {
        f(self)
    }
}

/// How coefficients enter a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Entry {
    /// Not at all.
    Free,
    /// A sum of coefficients times what is free of them.
    Linear,
    /// Such a sum and something free.
    Affine,
    /// In another way.
    Other,
}

/// A number with its unit, how coefficients enter it, and its value where that is known beforehand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Trace {
    pub(crate) dimension: Dimension,
    pub(crate) entry: Entry,
    pub(crate) value: Option<f64>,
}

/// A traced number, or what is wrong with it.
#[derive(Debug, Clone)]
struct Traced(Result<Trace, String>);

impl Default for Traced {
    fn default() -> Self {
        Self(Ok(Trace { dimension: Dimension::NONE, entry: Entry::Free, value: Some(0.0) }))
    }
}

impl FromStr for Traced {
    type Err = std::num::ParseFloatError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let value = Some(text.parse()?);
        Ok(Self(Ok(Trace { dimension: Dimension::NONE, entry: Entry::Free, value })))
    }
}

impl Trace {
    /// A zero has any unit.
    fn is_zero(&self) -> bool {
        self.value == Some(0.0) && self.dimension.is(Dimension::NONE)
    }

    fn known(&self, other: &Self, f: fn(f64, f64) -> f64) -> Option<f64> {
        Some(f(self.value?, other.value?))
    }
}

impl Traced {
    fn with(self, other: Self, f: impl FnOnce(Trace, Trace) -> Result<Trace, String>) -> Self {
        // The first mistake is the one to tell.
        Self(self.0.and_then(|a| other.0.and_then(|b| f(a, b))))
    }

    /// Values of one unit.
    fn alike(
        self,
        other: Self,
        what: &str,
        f: fn(f64, f64) -> f64,
        entry: fn(Entry, Entry) -> Entry,
    ) -> Self {
        self.with(other, |a, b| {
            let dimension = match (a.is_zero(), b.is_zero()) {
                (true, _) => b.dimension,
                (_, true) => a.dimension,
                _ if a.dimension.is(b.dimension) => a.dimension,
                _ => {
                    return Err(format!(
                        "{what} {} and {}, which must have the same unit",
                        a.dimension, b.dimension
                    ));
                }
            };
            let entry = match (a.is_zero(), b.is_zero()) {
                (true, _) => b.entry,
                (_, true) => a.entry,
                _ => entry(a.entry, b.entry),
            };
            Ok(Trace { dimension, entry, value: a.known(&b, f) })
        })
    }
}

fn sum_of(a: Entry, b: Entry) -> Entry {
    match (a, b) {
        _ if a == b => a,
        (Entry::Other, _) | (_, Entry::Other) => Entry::Other,
        _ => Entry::Affine,
    }
}

fn unless_free(a: Entry, b: Entry) -> Entry {
    if a == Entry::Free && b == Entry::Free { Entry::Free } else { Entry::Other }
}

impl Arithmetic for Traced {
    fn add(self, other: Self) -> Self {
        self.alike(other, "adds", |a, b| a + b, sum_of)
    }
    fn subtract(self, other: Self) -> Self {
        self.alike(other, "takes the difference of", |a, b| a - b, sum_of)
    }
    fn multiply(self, other: Self) -> Self {
        self.with(other, |a, b| {
            let entry = match (a.entry, b.entry) {
                (Entry::Free, entry) | (entry, Entry::Free) => entry,
                _ => Entry::Other,
            };
            Ok(Trace { dimension: a.dimension.times(b.dimension), entry, value: a.known(&b, |a, b| a * b) })
        })
    }
    fn divide(self, other: Self) -> Self {
        self.with(other, |a, b| {
            let entry = if b.entry == Entry::Free { a.entry } else { Entry::Other };
            Ok(Trace { dimension: a.dimension.over(b.dimension), entry, value: a.known(&b, |a, b| a / b) })
        })
    }
    fn power(self, other: Self) -> Self {
        self.with(other, |a, b| {
            if !b.dimension.is(Dimension::NONE) {
                return Err(format!("has an exponent in {}, which must be a pure number", b.dimension));
            }
            let dimension = match b.value {
                Some(power) => a.dimension.to_the(power),
                None if a.dimension.is(Dimension::NONE) => Dimension::NONE,
                None => {
                    return Err(format!("raises {} to a power that is not a fixed number", a.dimension));
                }
            };
            let entry = if b.value == Some(1.0) { a.entry } else { unless_free(a.entry, b.entry) };
            Ok(Trace { dimension, entry, value: a.known(&b, f64::powf) })
        })
    }
    fn minimum(self, other: Self) -> Self {
        self.alike(other, "takes the minimum of", f64::min, unless_free)
    }
    fn maximum(self, other: Self) -> Self {
        self.alike(other, "takes the maximum of", f64::max, unless_free)
    }
    fn angle(self, other: Self) -> Self {
        let angle = self.alike(other, "takes atan2 of", f64::atan2, unless_free);
        Self(angle.0.map(|a| Trace { dimension: Dimension::NONE, ..a }))
    }
    fn root(self) -> Self {
        Self(self.0.map(|a| Trace {
            dimension: a.dimension.to_the(0.5),
            entry: unless_free(a.entry, Entry::Free),
            value: a.value.map(f64::sqrt),
        }))
    }
    fn absolute(self) -> Self {
        Self(self.0.map(|a| Trace {
            entry: unless_free(a.entry, Entry::Free),
            value: a.value.map(f64::abs),
            ..a
        }))
    }
    fn sign(self) -> Self {
        Self(self.0.map(|a| Trace {
            dimension: Dimension::NONE,
            entry: unless_free(a.entry, Entry::Free),
            value: a.value.map(Arithmetic::sign),
        }))
    }
    fn of_pure(self, function: &'static str, f: fn(f64) -> f64) -> Self {
        Self(self.0.and_then(|a| {
            if !a.dimension.is(Dimension::NONE) {
                return Err(format!(
                    "takes {function} of {}, which must be a pure number: divide it by a constant with that unit (a bare \
                     number in it has none)",
                    a.dimension
                ));
            }
            Ok(Trace { entry: unless_free(a.entry, Entry::Free), value: a.value.map(f), ..a })
        }))
    }
}

/// A formula ready to be checked and evaluated.
#[derive(Debug, Clone)]
pub(crate) struct Formula {
    traced: FlatEx<Traced, Operators<Traced>, Number>,
    plain: FlatEx<f64, Operators<f64>, Number>,
    names: Vec<String>,
}

impl Formula {
    /// Parses a formula; whether a name is known is the caller's to check.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        Self::parse_with(text, Juxtaposed::Refused)
    }

    fn parse_with(text: &str, juxtaposed: Juxtaposed) -> Result<Self, String> {
        let clear = Scanner::new(text, juxtaposed).run()?;
        // What the scanner lets through, the library takes; its own words are kept for whatever is left.
        let cannot = |error: exmex::ExError| format!("cannot be read: {error}").replace('\n', " ");
        let plain = FlatEx::parse(&clear).map_err(cannot)?;
        let names = plain.var_names().to_vec();
        Ok(Self { traced: FlatEx::parse(&clear).map_err(cannot)?, names, plain })
    }

    /// The names in it, in the order in which values are given.
    pub(crate) fn names(&self) -> &[String] {
        &self.names
    }

    /// Unit, and how coefficients enter, from what is known of the names.
    pub(crate) fn trace(&self, of: impl Fn(&str) -> Trace) -> Result<Trace, String> {
        let inputs: Vec<Traced> = self.names.iter().map(|name| Traced(Ok(of(name)))).collect();
        self.traced.eval(&inputs).map_err(|error| error.to_string())?.0
    }

    /// The value from values of the names; NaN where it has none.
    pub(crate) fn value(&self, inputs: &[f64]) -> f64 {
        self.plain.eval(inputs).unwrap_or(f64::NAN)
    }
}

/// The dimension of a unit such as "N s/m" or "1/(kg m^2)".
pub(crate) fn dimension_of(unit: &str) -> Result<Dimension, String> {
    let formula = Formula::parse_with(unit, Juxtaposed::Multiplied)?;
    if let Some(name) = formula.names().iter().find(|name| Dimension::of_unit(name).is_none()) {
        let known = Dimension::known_units();
        return Err(format!("unknown unit \"{name}\"; known are {known} (coherent SI, so no mm or ms)"));
    }
    let trace = formula.trace(|name| Trace {
        dimension: Dimension::of_unit(name).unwrap_or(Dimension::NONE),
        entry: Entry::Free,
        // So that any other number shows.
        value: Some(1.0),
    })?;
    if trace.value.is_some_and(|value| value != 1.0) {
        return Err("is a number; a unit without dimension is \"1\"".into());
    }
    Ok(trace.dimension)
}

/// What two operands side by side mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Juxtaposed {
    Refused,
    Multiplied,
}

/// What an open bracket belongs to.
#[derive(Debug, Clone, Copy)]
struct Level {
    /// The operator of a function of two arguments, until its comma has been seen.
    of_two: Option<&'static str>,
    awaits_comma: bool,
    /// A power has been taken since the last other operator.
    in_power: bool,
    /// A quotient has been taken since the last sum.
    in_quotient: bool,
}

impl Level {
    const PLAIN: Self = Self { of_two: None, awaits_comma: false, in_power: false, in_quotient: false };
}

/// Turns a formula into a text that can be read in one way only: names in braces, functions of two arguments as operators,
/// the sign of a term as a factor.
struct Scanner<'a> {
    text: &'a str,
    at: usize,
    clear: String,
    levels: Vec<Level>,
    /// Whether an operand has just ended.
    after_operand: bool,
    /// Whether an operator has just been read.
    after_operator: bool,
    juxtaposed: Juxtaposed,
}

impl<'a> Scanner<'a> {
    fn new(text: &'a str, juxtaposed: Juxtaposed) -> Self {
        Self {
            text,
            at: 0,
            clear: String::new(),
            levels: vec![Level::PLAIN],
            after_operand: false,
            after_operator: false,
            juxtaposed,
        }
    }

    fn run(mut self) -> Result<String, String> {
        if self.text.len() > MAX_LENGTH {
            return Err(format!("is {} bytes long, at most {MAX_LENGTH} are read", self.text.len()));
        }
        while let Some(next) = self.text[self.at..].chars().next() {
            match next {
                ' ' | '\t' | '\n' | '\r' => self.at += 1,
                '0'..='9' => self.number()?,
                'a'..='z' | 'A'..='Z' | '_' => self.name()?,
                '(' => {
                    self.operand("(")?;
                    self.open(Level::PLAIN)?;
                    self.at += 1;
                }
                ')' => self.close()?,
                ',' => self.comma()?,
                '+' | '-' | '*' | '/' | '^' => self.operator(next)?,
                other => return Err(format!("the character {other:?} is not part of a formula")),
            }
        }
        if self.levels.len() > 1 {
            return Err("a bracket is not closed".into());
        }
        if !self.after_operand {
            return Err(if self.clear.is_empty() { "is empty".into() } else { "ends in an operator".into() });
        }
        Ok(self.clear)
    }

    fn level(&mut self) -> &mut Level {
        if self.levels.is_empty() {
            self.levels.push(Level::PLAIN);
        }
        let last = self.levels.len() - 1;
        &mut self.levels[last]
    }

    /// An operand begins with `what`.
    fn operand(&mut self, what: &str) -> Result<(), String> {
        if self.after_operand {
            if self.juxtaposed == Juxtaposed::Refused {
                return Err(format!("an operator is missing before \"{what}\""));
            }
            if self.level().in_quotient {
                return Err(format!("what follows \"/\" is unclear at \"{what}\"; write 1/(a b) or a*b/c"));
            }
            self.level().in_power = false;
            self.clear.push('*');
        }
        Ok(())
    }

    fn ended(&mut self) {
        (self.after_operand, self.after_operator) = (true, false);
    }

    fn number(&mut self) -> Result<(), String> {
        let rest = &self.text[self.at..];
        let number = &rest[..number_length(rest)];
        self.operand(number)?;
        if !number.parse::<f64>().is_ok_and(f64::is_finite) {
            return Err(format!("the number {number} is too large"));
        }
        self.clear.push_str(number);
        self.at += number.len();
        self.ended();
        Ok(())
    }

    fn name(&mut self) -> Result<(), String> {
        let rest = &self.text[self.at..];
        let length = rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count();
        let name = &rest[..length];
        let is_call = rest[length..].trim_start().starts_with('(');
        self.operand(name)?;
        let of_two = OF_TWO.iter().find(|(known, _)| *known == name);
        let of_one = FUNCTIONS.contains(&name);
        match (of_two, of_one, is_call && self.juxtaposed == Juxtaposed::Refused) {
            (Some((_, operator)), _, true) => {
                self.skip_call(length);
                self.clear.push('(');
                self.open(Level { of_two: Some(*operator), awaits_comma: true, ..Level::PLAIN })
            }
            (None, true, true) => {
                self.skip_call(length);
                self.clear.push_str(name);
                self.open(Level::PLAIN)
            }
            (None, false, true) => {
                let two = OF_TWO.map(|(name, _)| name);
                Err(format!(
                    "\"{name}\" is not a function; known are {}, {}",
                    FUNCTIONS.join(", "),
                    two.join(", ")
                ))
            }
            (Some(_), _, false) | (_, true, false) if self.juxtaposed == Juxtaposed::Refused => {
                Err(format!("{name} is a function; write {name}(...)"))
            }
            _ => {
                self.clear.push('{');
                self.clear.push_str(name);
                self.clear.push('}');
                self.at += length;
                self.ended();
                Ok(())
            }
        }
    }

    /// Past a function's name and its bracket.
    fn skip_call(&mut self, length: usize) {
        let rest = &self.text[self.at + length..];
        self.at += length + rest.find('(').unwrap_or(0) + 1;
    }

    fn open(&mut self, level: Level) -> Result<(), String> {
        if self.levels.len() > MAX_DEPTH {
            return Err(format!("brackets are nested deeper than {MAX_DEPTH}"));
        }
        self.clear.push('(');
        self.levels.push(level);
        (self.after_operand, self.after_operator) = (false, false);
        Ok(())
    }

    fn close(&mut self) -> Result<(), String> {
        if self.levels.len() == 1 {
            return Err("a bracket is closed that was not opened".into());
        }
        if !self.after_operand {
            return Err("nothing stands before \")\"".into());
        }
        let level = self.levels.pop().unwrap_or(Level::PLAIN);
        if level.awaits_comma {
            return Err("a function of two arguments has only one".into());
        }
        self.clear.push_str(if level.of_two.is_some() { "))" } else { ")" });
        self.at += 1;
        self.ended();
        Ok(())
    }

    fn comma(&mut self) -> Result<(), String> {
        let level = *self.level();
        let Some(operator) = level.of_two.filter(|_| level.awaits_comma) else {
            return Err("a comma stands outside a function of two arguments".into());
        };
        if !self.after_operand {
            return Err("nothing stands before \",\"".into());
        }
        *self.level() = Level { of_two: Some(operator), ..Level::PLAIN };
        self.clear.push_str(&format!("){operator}("));
        self.at += 1;
        (self.after_operand, self.after_operator) = (false, false);
        Ok(())
    }

    fn operator(&mut self, operator: char) -> Result<(), String> {
        if !self.after_operand {
            if self.after_operator {
                return Err(format!(
                    "two operators in a row at \"{operator}\"; put a negative number in brackets"
                ));
            }
            if operator != '-' {
                return Err(format!("nothing stands before \"{operator}\""));
            }
            // The library would bind the sign closer than a power.
            self.clear.push_str("(0-1)*");
            self.at += 1;
            self.after_operator = true;
            return Ok(());
        }
        let level = self.level();
        if operator == '^' && level.in_power {
            return Err("a^b^c is unclear; write (a^b)^c or a^(b^c)".into());
        }
        level.in_power = operator == '^';
        level.in_quotient = match operator {
            '/' => true,
            '^' => level.in_quotient,
            _ => false,
        };
        self.clear.push(operator);
        self.at += 1;
        (self.after_operand, self.after_operator) = (false, true);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn value(text: &str) -> f64 {
        let formula = Formula::parse(text).unwrap_or_else(|why| panic!("{text}: {why}"));
        // a, b, c, ... are 1, 2, 3, ...
        let inputs: Vec<f64> =
            formula.names().iter().map(|n| f64::from(n.as_bytes()[0] - b'a' + 1)).collect();
        formula.value(&inputs)
    }

    #[test]
    fn formulas_mean_what_people_mean() {
        for (text, expected) in [
            ("-b^2", -4.0),
            ("-b^2*c", -12.0),
            ("c - -1", f64::NAN),
            ("c - (-1)", 4.0),
            ("2 - 3 + 4", 3.0),
            ("2 / 4 * 8", 4.0),
            ("8 / 4 / 2", 1.0),
            ("2 * 3 ^ 2", 18.0),
            ("1.5e-1 * 1E1", 1.5),
            ("max(a, min(b, c))", 2.0),
            ("min(max(a - 5, -c), b*1)*2", -6.0),
            ("sqrt(c^2 + d^2)", 5.0),
            ("atan2(a, 0 - a) * 4", 3.0 * std::f64::consts::PI),
            ("abs(-c) + sign(-c) * exp(0) + ln(1)", 2.0),
            ("minimum + maxim + sinx", 13.0 + 13.0 + 19.0),
            ("2^(-1)", 0.5),
            ("(2^3)^2", 64.0),
        ] {
            if expected.is_nan() {
                assert!(Formula::parse(text).is_err(), "{text}");
            } else {
                assert!((value(text) - expected).abs() < 1e-12, "{text} is {}", value(text));
            }
        }
    }

    #[test]
    fn what_is_unclear_or_wrong_is_refused_in_one_line() {
        for (text, expected) in [
            ("", "is empty"),
            ("a +", "ends in an operator"),
            ("a b", "operator is missing before \"b\""),
            ("2a", "operator is missing"),
            ("a^b^c", "unclear"),
            ("a / -b", "two operators in a row"),
            ("(a", "not closed"),
            ("a)", "not opened"),
            ("()", "nothing stands before"),
            ("sin a", "write sin(...)"),
            ("f(a)", "\"f\" is not a function; known are sqrt"),
            ("max(a)", "has only one"),
            ("max(a, b, c)", "comma"),
            ("sin(a, b)", "comma"),
            ("a # b", "character '#'"),
            ("{a}", "character '{'"),
            ("\u{3c0}", "character"),
            ("1e999", "too large"),
            ("a ** b", "two operators"),
            ("* a", "nothing stands before"),
            (".5", "character '.'"),
        ] {
            let why = Formula::parse(text).map(|_| ()).unwrap_err();
            assert!(why.contains(expected), "{text}: {why}");
            assert_eq!(why.lines().count(), 1, "{why}");
        }
    }

    #[test]
    fn deep_and_long_text_is_refused_at_once() {
        let deep = format!("{}a{}", "(".repeat(100_000), ")".repeat(100_000));
        let long = "a+".repeat(500_000) + "a";
        for text in [deep.as_str(), &long, &deep[..MAX_LENGTH], &"-".repeat(MAX_LENGTH), &"max(".repeat(100)]
        {
            let started = std::time::Instant::now();
            assert!(Formula::parse(text).is_err());
            assert!(started.elapsed().as_millis() < 50, "{:?}", started.elapsed());
        }
    }

    #[test]
    fn units_of_the_catalogue_are_read() {
        for effect in crate::effects::CATALOGUE {
            for c in effect.info().coefficients {
                dimension_of(c.unit).unwrap_or_else(|why| panic!("{effect} {}: {} {why}", c.name, c.unit));
            }
        }
        for quantity in crate::QUANTITIES {
            dimension_of(quantity.unit).unwrap();
        }
        for (unit, expected) in
            [("N s/m", "kg/s"), ("1/(kg m^2)", "1/(kg m^2)"), ("rad/s/V", "1/(V s)"), ("kg*m^2", "kg m^2")]
        {
            assert_eq!(dimension_of(unit).unwrap().to_string(), expected);
        }
        for (unit, expected) in [
            ("mm", "unknown unit \"mm\""),
            ("1/kg m", "unclear"),
            ("2 m", "is a number"),
            ("m +", "operator"),
        ] {
            let why = dimension_of(unit).unwrap_err();
            assert!(why.contains(expected), "{unit}: {why}");
        }
    }

    /// A formula as a tree, its text with as few brackets as the rules ask for, and its value.
    #[derive(Debug, Clone)]
    enum Tree {
        Number(u32),
        Name(u8),
        Negative(Box<Tree>),
        Two(char, Box<Tree>, Box<Tree>),
        Call(&'static str, Box<Tree>),
        CallTwo(&'static str, Box<Tree>, Box<Tree>),
    }

    impl Tree {
        fn text(&self) -> String {
            let strength = |c: char| "+-*/^".find(c).map_or(9, |p| [1, 1, 2, 2, 3][p]);
            let side = |tree: &Tree, at_least: usize| match tree {
                Tree::Two(c, ..) if strength(*c) < at_least => format!("({})", tree.text()),
                Tree::Negative(_) => format!("({})", tree.text()),
                _ => tree.text(),
            };
            match self {
                Tree::Number(n) => format!("{}", f64::from(*n) / 8.0),
                Tree::Name(k) => char::from(b'a' + k).to_string(),
                Tree::Negative(a) => format!("-{}", side(a, 2)),
                Tree::Two('^', a, b) => format!("{}^{}", side(a, 4), side(b, 4)),
                Tree::Two(c, a, b) => format!("{}{c}{}", side(a, strength(*c)), side(b, strength(*c) + 1)),
                Tree::Call(f, a) => format!("{f}({})", a.text()),
                Tree::CallTwo(f, a, b) => format!("{f}({}, {})", a.text(), b.text()),
            }
        }

        fn value(&self) -> f64 {
            match self {
                Tree::Number(n) => f64::from(*n) / 8.0,
                Tree::Name(k) => f64::from(*k) + 1.0,
                Tree::Negative(a) => -a.value(),
                Tree::Two('+', a, b) => a.value() + b.value(),
                Tree::Two('-', a, b) => a.value() - b.value(),
                Tree::Two('*', a, b) => a.value() * b.value(),
                Tree::Two('/', a, b) => a.value() / b.value(),
                Tree::Two(_, a, b) => a.value().powf(b.value()),
                Tree::Call("sin", a) => a.value().sin(),
                Tree::Call(_, a) => a.value().abs(),
                // Unlike the standard library's, ours do not hide what is not a number.
                Tree::CallTwo(_, a, b) if a.value().is_nan() || b.value().is_nan() => f64::NAN,
                Tree::CallTwo("min", a, b) => a.value().min(b.value()),
                Tree::CallTwo(_, a, b) => a.value().max(b.value()),
            }
        }
    }

    fn trees() -> impl Strategy<Value = Tree> {
        let leaf = prop_oneof![(1_u32..40).prop_map(Tree::Number), (0_u8..5).prop_map(Tree::Name)];
        leaf.prop_recursive(4, 24, 2, |inner| {
            let pair = (inner.clone(), inner.clone());
            prop_oneof![
                (prop::sample::select(vec!['+', '-', '*', '/', '^']), pair.clone())
                    .prop_map(|(c, (a, b))| Tree::Two(c, a.into(), b.into())),
                inner.clone().prop_map(|a| Tree::Negative(a.into())),
                (prop::sample::select(vec!["sin", "abs"]), inner).prop_map(|(f, a)| Tree::Call(f, a.into())),
                (prop::sample::select(vec!["min", "max"]), pair).prop_map(|(f, (a, b))| Tree::CallTwo(
                    f,
                    a.into(),
                    b.into()
                )),
            ]
        })
    }

    proptest! {
        #[test]
        fn a_formula_has_the_value_of_its_tree(tree in trees()) {
            let text = tree.text();
            prop_assume!(text.len() <= MAX_LENGTH);
            let (found, expected) = (value(&text), tree.value());
            // Products and quotients may be taken in another order: some roundings of each of 24 operations.
            let near = (found - expected).abs() <= 1e-9 * expected.abs().max(1.0);
            // What is not finite or huge (powers of powers) amplifies roundings without bound.
            prop_assert!(near || !(expected.abs() < 1e6), "{text} is {found}, not {expected}");
        }

        #[test]
        fn any_text_is_parsed_or_refused(text in "\\PC{0,60}") {
            let _ = Formula::parse(&text);
            let _ = dimension_of(&text);
        }

        #[test]
        fn any_mixture_of_tokens_is_parsed_or_refused(
            tokens in prop::collection::vec(
                prop::sample::select(vec![
                    "a", "b", "1", "2.5e3", "+", "-", "*", "/", "^", "(", ")", ",", "sin(", "max(", "atan2(", " ",
                ]),
                0..40,
            )
        ) {
            let text = tokens.concat();
            if let Ok(formula) = Formula::parse(&text) {
                let inputs = vec![1.5; formula.names().len()];
                let _ = formula.value(&inputs);
                let known = |_: &str| Trace { dimension: Dimension::NONE, entry: Entry::Linear, value: None };
                // Pure numbers everywhere: whatever is parsed has a unit.
                prop_assert!(formula.trace(known).is_ok(), "{text}");
            }
        }
    }
}
