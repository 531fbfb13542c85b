//! Formulas as lists of operations: what the rows of an effect have in common is worked out once for all of them.

use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::{Hash, Hasher};
use std::num::ParseFloatError;
use std::str::FromStr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

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

/// Lists whose last values are kept: those of a model's effects.
const MOST_KEPT: usize = 8;

/// The place of the last bit of [`Depends`].
const LAST_BIT: usize = Depends::BITS as usize - 1;

/// The next list's number.
static NEXT: AtomicUsize = AtomicUsize::new(0);

/// Inputs that something depends on: a bit for each, the last one for all that have none of their own.
type Depends = u64;

/// The operations of some formulas, none twice.
#[derive(Debug)]
pub(super) struct Tape {
    /// No other has this one.
    id: usize,
    inputs: Vec<Input>,
    /// The inputs that are coefficients and have a bit of their own.
    coefficients: Depends,
    /// What each operation depends on.
    depends: Vec<Depends>,
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
        let operations: Vec<Operation> = operations.into_iter().map(placed).collect();
        Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            coefficients: coefficients(&inputs),
            depends: depends(&operations, inputs.len(), first_result),
            outputs: outputs.into_iter().map(place).collect(),
            operations,
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
            /// Kept from one evaluation to the next: there are some for each sample, of each effect in turn.
            static KEPT: RefCell<Vec<Kept>> = const { RefCell::new(Vec::new()) };
        }
        KEPT.with_borrow_mut(|kept| {
            let values = Kept::of(kept, self).evaluated(self, input);
            self.outputs.iter().enumerate().for_each(|(k, place)| take(k, values[*place]));
        });
    }

    const fn first_result(&self) -> usize {
        self.inputs.len() + self.numbers.len()
    }
}

/// The last evaluation at a sample. A fit asks for the same sample again with one coefficient a little further, on which few operations
/// depend.
struct Kept {
    /// The number of the list whose values they are.
    id: usize,
    /// Whether there are no values yet.
    is_new: bool,
    values: Vec<f64>,
    /// With coefficients as asked for last.
    moved: Vec<f64>,
}

impl Kept {
    /// What is kept of a list, in the place of that of the oldest where there is much.
    fn of<'a>(all: &'a mut Vec<Self>, tape: &Tape) -> &'a mut Self {
        let known = all.iter().position(|kept| kept.id == tape.id);
        let place = known.unwrap_or_else(|| {
            if all.len() == MOST_KEPT {
                all.remove(0);
            }
            all.push(Self::new(tape));
            all.len() - 1
        });
        &mut all[place]
    }

    fn new(tape: &Tape) -> Self {
        let mut values = vec![0.0; tape.inputs.len()];
        values.extend(&tape.numbers);
        values.resize(tape.first_result() + tape.operations.len(), 0.0);
        Self { id: tape.id, is_new: true, moved: values.clone(), values }
    }

    /// All values of a list.
    fn evaluated(&mut self, tape: &Tape, input: impl Fn(&Input) -> f64) -> &[f64] {
        let mut changed: Depends = 0;
        for (k, own) in tape.inputs.iter().enumerate() {
            let value = input(own);
            if value.to_bits() != self.values[k].to_bits() {
                changed |= bit(k);
            }
            self.moved[k] = value;
        }
        let first_result = tape.first_result();
        if self.is_new || changed & !tape.coefficients != 0 {
            self.is_new = false;
            self.values[..tape.inputs.len()].copy_from_slice(&self.moved[..tape.inputs.len()]);
            for (k, operation) in tape.operations.iter().enumerate() {
                self.values[first_result + k] = operation.apply(&self.values);
            }
            return &self.values;
        }
        self.moved[first_result..].copy_from_slice(&self.values[first_result..]);
        for (k, depends) in tape.depends.iter().enumerate() {
            if depends & changed != 0 {
                self.moved[first_result + k] = tape.operations[k].apply(&self.moved);
            }
        }
        &self.moved
    }
}

/// The bit of an input.
fn bit(input: usize) -> Depends {
    1 << input.min(LAST_BIT)
}

fn coefficients(inputs: &[Input]) -> Depends {
    let own = inputs.iter().enumerate().take(LAST_BIT);
    own.filter(|(_, input)| matches!(input, Input::Coefficient(_))).fold(0, |all, (k, _)| all | bit(k))
}

/// What operations depend on, of so many inputs; the first result has that place among the values.
fn depends(operations: &[Operation], inputs: usize, first_result: usize) -> Vec<Depends> {
    let mut all: Vec<Depends> = Vec::with_capacity(operations.len());
    for operation in operations {
        let of = |place: usize| match place {
            input if input < inputs => bit(input),
            number if number < first_result => 0,
            result => all[result - first_result],
        };
        all.push(match *operation {
            Operation::One(_, a) => of(a),
            Operation::Two(_, a, b) => of(a) | of(b),
        });
    }
    all
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

    /// Whatever was asked before, also of another list: more inputs than there are bits among them.
    #[test]
    fn what_is_kept_from_the_last_evaluation_changes_no_value() {
        let wide =
            (0..70).map(|k| format!("x{k} * exp(-x{}^2)", (k + 1) % 70)).collect::<Vec<_>>().join(" + ");
        let formulas = ["a * tanh((x - b) / c) + exp(-x)", &wide].map(|text| Formula::parse(text).unwrap());
        let value = |formula: &Formula, inputs: &[f64]| value_of(formula.recorded(), inputs);
        let tapes = formulas.each_ref().map(|formula| {
            let of = |name: &String| match name.as_str() {
                "x" => Input::Further(crate::user_effects::columns::FurtherColumn { name: "x", place: 0 }),
                _ => Input::Coefficient(0),
            };
            // Each name an input of its own.
            let inputs = formula.names().iter().enumerate().map(|(k, name)| match of(name) {
                Input::Coefficient(_) => Input::Coefficient(k),
                other => other,
            });
            Tape::new(&[(formula.recorded(), &inputs.collect::<Vec<_>>())])
        });
        let mut state = 7_u64;
        let mut inputs = formulas.each_ref().map(|formula| vec![0.5; formula.names().len()]);
        for step in 0..2000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let which = usize::from(step % 7 == 0);
            let places = inputs[which].len();
            inputs[which][(state >> 40) as usize % places] = ((state >> 20) % 1000) as f64 / 500.0 - 1.0;
            let values = &inputs[which];
            let mut found = f64::NAN;
            let given = |input: &Input| match input {
                Input::Coefficient(k) => values[*k],
                _ => values[formulas[which].names().iter().position(|name| name == "x").unwrap()],
            };
            tapes[which].run(given, |_, value| found = value);
            let expected = value(&formulas[which], values);
            assert_eq!(found.to_bits(), expected.to_bits(), "step {step}: {found} {expected}");
        }
    }
}
