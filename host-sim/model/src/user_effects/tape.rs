//! Formulas as lists of operations: what the rows of an effect have in common is worked out once for all of them.

use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::{Hash, Hasher};
use std::num::ParseFloatError;
use std::str::FromStr;
use std::sync::Arc;

use crate::sample::Sample;
use crate::user_effects::arithmetic::Arithmetic;
use crate::user_effects::input::Input;

/// A number that remembers how it came about, in the order in which the parser evaluates it.
#[derive(Debug, Clone)]
pub(super) struct Recorded(Arc<Node>);

#[derive(Debug)]
enum Node {
    Number(f64),
    /// A name, by its place among those of its formula.
    Name(usize),
    One(Function, Recorded),
    Two(Operator, Recorded, Recorded),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Operator {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Minimum,
    Maximum,
    Angle,
}

/// A function of one number, and what formulas call it.
#[derive(Debug, Clone, Copy)]
struct Function {
    name: &'static str,
    apply: fn(f64) -> f64,
}

/// An operation on values before it in the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Operation {
    One(Function, usize),
    Two(Operator, usize, usize),
}

/// The operations of some formulas, none twice.
#[derive(Debug)]
pub(super) struct Tape {
    inputs: Vec<Input>,
    /// Follow the inputs among the values; results of operations follow these.
    numbers: Vec<f64>,
    operations: Vec<Operation>,
    /// The value of each formula.
    outputs: Vec<usize>,
}

impl PartialEq for Function {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Function {}

impl Hash for Function {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name.hash(state);
    }
}

impl Recorded {
    /// The name of that place.
    pub(super) fn name(place: usize) -> Self {
        Self(Arc::new(Node::Name(place)))
    }

    fn one(self, name: &'static str, apply: fn(f64) -> f64) -> Self {
        Self(Arc::new(Node::One(Function { name, apply }, self)))
    }

    fn two(self, operator: Operator, other: Self) -> Self {
        Self(Arc::new(Node::Two(operator, self, other)))
    }
}

impl Default for Recorded {
    fn default() -> Self {
        Self(Arc::new(Node::Number(0.0)))
    }
}

impl FromStr for Recorded {
    type Err = ParseFloatError;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(Self(Arc::new(Node::Number(text.parse()?))))
    }
}

impl Arithmetic for Recorded {
    fn add(self, other: Self) -> Self {
        self.two(Operator::Add, other)
    }
    fn subtract(self, other: Self) -> Self {
        self.two(Operator::Subtract, other)
    }
    fn multiply(self, other: Self) -> Self {
        self.two(Operator::Multiply, other)
    }
    fn divide(self, other: Self) -> Self {
        self.two(Operator::Divide, other)
    }
    fn power(self, other: Self) -> Self {
        self.two(Operator::Power, other)
    }
    fn minimum(self, other: Self) -> Self {
        self.two(Operator::Minimum, other)
    }
    fn maximum(self, other: Self) -> Self {
        self.two(Operator::Maximum, other)
    }
    fn angle(self, other: Self) -> Self {
        self.two(Operator::Angle, other)
    }
    fn root(self) -> Self {
        self.one("sqrt", Arithmetic::root)
    }
    fn absolute(self) -> Self {
        self.one("abs", Arithmetic::absolute)
    }
    fn sign(self) -> Self {
        self.one("sign", Arithmetic::sign)
    }
    fn step(self) -> Self {
        self.one("step", Arithmetic::step)
    }
    fn of_pure(self, function: &'static str, f: fn(f64) -> f64) -> Self {
        self.one(function, f)
    }
}

impl Operator {
    #[inline]
    fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Power => Arithmetic::power(a, b),
            Self::Minimum => Arithmetic::minimum(a, b),
            Self::Maximum => Arithmetic::maximum(a, b),
            Self::Angle => Arithmetic::angle(a, b),
        }
    }
}

impl Operation {
    #[inline]
    fn apply(self, values: &[f64]) -> f64 {
        match self {
            Self::One(function, a) => (function.apply)(values[a]),
            Self::Two(operator, a, b) => operator.apply(values[a], values[b]),
        }
    }
}

impl Tape {
    /// Of formulas, each with what its names mean.
    pub(super) fn new(formulas: &[(&Recorded, &[Input])]) -> Self {
        let mut writer = Writer::default();
        let outputs: Vec<Value> =
            formulas.iter().map(|(formula, inputs)| writer.write(formula, inputs)).collect();
        let Writer { inputs, numbers, operations, .. } = writer;
        let (first_number, first_result) = (inputs.len(), inputs.len() + numbers.len());
        let place = |value: Value| match value {
            Value::Input(k) => k,
            Value::Number(k) => first_number + k,
            Value::Result(k) => first_result + k,
        };
        let placed = |operation: Written| match operation {
            Written::One(function, a) => Operation::One(function, place(a)),
            Written::Two(operator, a, b) => Operation::Two(operator, place(a), place(b)),
        };
        Self {
            operations: operations.into_iter().map(placed).collect(),
            outputs: outputs.into_iter().map(place).collect(),
            inputs,
            numbers,
        }
    }

    /// The value of each formula at a sample, in order, given to `take`.
    pub(super) fn evaluate(&self, sample: &Sample, coefficients: &[f64], take: impl FnMut(usize, f64)) {
        self.run(|input| input.at(sample, coefficients), take);
    }

    fn run(&self, input: impl Fn(&Input) -> f64, mut take: impl FnMut(usize, f64)) {
        thread_local! {
            /// Kept from one evaluation to the next: there is one for each sample.
            static VALUES: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
        }
        let (first_number, first_result) = (self.inputs.len(), self.inputs.len() + self.numbers.len());
        let count = first_result + self.operations.len();
        VALUES.with_borrow_mut(|values| {
            if values.len() < count {
                values.resize(count, 0.0);
            }
            let values = &mut values[..count];
            values.iter_mut().zip(&self.inputs).for_each(|(value, own)| *value = input(own));
            values[first_number..first_result].copy_from_slice(&self.numbers);
            for (k, operation) in self.operations.iter().enumerate() {
                values[first_result + k] = operation.apply(values);
            }
            self.outputs.iter().enumerate().for_each(|(k, place)| take(k, values[*place]));
        });
    }
}

/// Where a value stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Value {
    Input(usize),
    Number(usize),
    Result(usize),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Written {
    One(Function, Value),
    Two(Operator, Value, Value),
}

/// Writes each value once.
#[derive(Default)]
struct Writer {
    inputs: Vec<Input>,
    numbers: Vec<f64>,
    operations: Vec<Written>,
    places: HashMap<Written, usize>,
}

impl Writer {
    fn write(&mut self, formula: &Recorded, inputs: &[Input]) -> Value {
        match &*formula.0 {
            Node::Number(number) => self.number(*number),
            Node::Name(place) => match inputs[*place] {
                Input::Constant(number) => self.number(number),
                input => self.input(input),
            },
            Node::One(function, a) => {
                let a = self.write(a, inputs);
                match a {
                    Value::Number(k) => self.number((function.apply)(self.numbers[k])),
                    _ => self.operation(Written::One(*function, a)),
                }
            }
            Node::Two(operator, a, b) => {
                let (a, b) = (self.write(a, inputs), self.write(b, inputs));
                match (a, b) {
                    (Value::Number(a), Value::Number(b)) => {
                        self.number(operator.apply(self.numbers[a], self.numbers[b]))
                    }
                    _ => self.operation(Written::Two(*operator, a, b)),
                }
            }
        }
    }

    fn number(&mut self, number: f64) -> Value {
        let known = self.numbers.iter().position(|own| own.to_bits() == number.to_bits());
        Value::Number(known.unwrap_or_else(|| {
            self.numbers.push(number);
            self.numbers.len() - 1
        }))
    }

    fn input(&mut self, input: Input) -> Value {
        let known = self.inputs.iter().position(|own| own.is_same(&input));
        Value::Input(known.unwrap_or_else(|| {
            self.inputs.push(input);
            self.inputs.len() - 1
        }))
    }

    fn operation(&mut self, operation: Written) -> Value {
        let next = self.operations.len();
        let place = *self.places.entry(operation).or_insert(next);
        if place == next {
            self.operations.push(operation);
        }
        Value::Result(place)
    }
}

/// The value of a formula whose names are given.
#[cfg(test)]
pub(super) fn value_of(formula: &Recorded, inputs: &[f64]) -> f64 {
    let places: Vec<Input> = (0..inputs.len()).map(Input::Coefficient).collect();
    let mut found = f64::NAN;
    let given = |input: &Input| match input {
        Input::Coefficient(k) => inputs[*k],
        _ => f64::NAN,
    };
    Tape::new(&[(formula, &places)]).run(given, |_, value| found = value);
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::user_effects::formula::Formula;

    /// Two rows that share `exp(-(x / a))`, and a number that is known beforehand.
    #[test]
    fn what_rows_have_in_common_is_worked_out_once() {
        let rows = ["k * exp(-(x / a)) * 2 * 3", "5 - k * exp(-(x / a))"];
        let formulas = rows.map(|text| Formula::parse(text).unwrap());
        // Each formula has its names in an order of its own.
        let inputs = formulas.each_ref().map(|formula| {
            let of = |name: &String| match name.as_str() {
                "k" => Input::Coefficient(0),
                "a" => Input::Constant(0.5),
                _ => Input::Coefficient(1),
            };
            formula.names().iter().map(of).collect::<Vec<Input>>()
        });
        let both: Vec<(&Recorded, &[Input])> =
            formulas.iter().zip(&inputs).map(|(formula, inputs)| (formula.recorded(), &inputs[..])).collect();
        let tape = Tape::new(&both);
        let alone: usize = both.iter().map(|one| Tape::new(&[*one]).operations.len()).sum();
        assert!(tape.operations.len() < alone, "{} of {alone}", tape.operations.len());
        assert_eq!(tape.inputs.len(), 2);
        let (k, x) = (1.25, 0.75);
        let mut found = [f64::NAN; 2];
        let given = |input: &Input| if matches!(input, Input::Coefficient(0)) { k } else { x };
        tape.run(given, |row, value| found[row] = value);
        let common = k * (-(x / 0.5_f64)).exp();
        assert!((found[0] - 6.0 * common).abs() < 1e-15 && (found[1] - (5.0 - common)).abs() < 1e-15);
    }
}
