//! What formulas can do with numbers: operators and functions, for plain numbers and for traced ones alike.

use std::fmt::Debug;
use std::marker::PhantomData;
use std::str::FromStr;

use exmex::{BinOp, MakeOperators, Operator};

/// What both kinds of numbers can do.
pub(super) trait Arithmetic: Clone + Debug + Default + FromStr {
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
    fn step(self) -> Self;
    fn of_pure(self, function: &'static str, f: fn(f64) -> f64) -> Self;
}

/// Functions of one argument. Those from `sin` on take pure numbers only.
pub(super) const FUNCTIONS: [&str; 14] = [
    "sqrt", "abs", "sign", "step", "sin", "cos", "tan", "asin", "acos", "atan", "tanh", "exp", "ln", "log10",
];
fn operators<T: Arithmetic>() -> Vec<Operator<'static, T>> {
    // Of commutative operators the library takes two numbers side by side first, and with the second operator the function that stands
    // around all: sin(a * 2 * 3) would be a * sin(2 * 3).
    let binary = |text, priority, apply| {
        Operator::make_bin(text, BinOp { apply, prio: priority, is_commutative: false })
    };
    vec![
        binary("+", 0, T::add),
        binary("-", 1, T::subtract),
        binary("*", 2, T::multiply),
        binary("/", 3, T::divide),
        binary("^", 4, T::power),
        binary("&", 5, T::minimum),
        binary("|", 5, T::maximum),
        binary("@", 5, T::angle),
        Operator::make_unary("sqrt", T::root),
        Operator::make_unary("abs", T::absolute),
        Operator::make_unary("sign", T::sign),
        Operator::make_unary("step", T::step),
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
pub(super) struct Operators<T>(PhantomData<T>);

impl<T: Arithmetic> MakeOperators<T> for Operators<T> {
    fn make<'a>() -> Vec<Operator<'a, T>> {
        operators()
    }
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
    fn step(self) -> Self {
        match self {
            x if x.is_nan() => x,
            x if x >= 0.0 => 1.0,
            _ => 0.0,
        }
    }
    fn of_pure(self, _: &'static str, f: fn(f64) -> f64) -> Self {
        f(self)
    }
}
