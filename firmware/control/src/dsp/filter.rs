//! First- and second-order digital filters and their design by the matched Z-transform.
//!
//! The thesis designs every filter in s and converts it with MATLAB's `c2d(..., 'matched')`. The
//! rule: each pole and zero `r` goes to `exp(r Ts)`; a strictly proper filter keeps one zero at
//! infinity (one sample of delay) and its other zeros at infinity go to `z = -1`; the gain is made
//! equal at one real frequency, `s = 0`, or where a pole or zero lies there the first free of
//! `0.1/Ts, 0.2/Ts, ...`. A filter with a zero at the origin is therefore matched at `s = 0.1/Ts`
//! and measures slow rates a few per cent too large (6.5 % for the 75 rad/s estimator at 100 Hz);
//! [`GainRule::Slope`] mends that.
//!
//! Design functions are generic over [`Real`]: fly with f64 designs rounded once to f32
//! ([`FirstOrder::rounded`]). A filter is an immutable set of coefficients; its memory is a
//! separate `Copy` state. Both run in direct form II transposed, `y = b0 x + s1; s1' = b1 x - a1
//! y + s2; s2' = b2 x - a2 y`.
//!
//! Not here: filters of higher order, and estimation of frequency responses (the tests do that).

use core::ops::{Add, Div, Mul, Neg, Sub};

use serde::{Deserialize, Serialize};

/// Where the gain of a filter with a zero at the origin is matched.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GainRule {
    /// As MATLAB's `c2d(..., 'matched')`: equal gain at the real frequency `s = 0.1/Ts`.
    Matlab,
    /// Equal slope at DC, so that a derivative filter measures slow rates exactly.
    Slope,
}

/// The numbers that filters are designed with: f32 or f64, functions from libm.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;
    /// Square root of the machine epsilon: roots nearer than this to a point lie on it.
    const NEAR: Self;
    /// The nearest number of this type.
    fn from_f64(value: f64) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
}

impl Real for f64 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const NEAR: Self = 1.490_116_119_384_765_6e-8;
    fn from_f64(value: f64) -> Self {
        value
    }
    fn exp(self) -> Self {
        libm::exp(self)
    }
    fn cos(self) -> Self {
        libm::cos(self)
    }
    fn sqrt(self) -> Self {
        libm::sqrt(self)
    }
}

impl Real for f32 {
    const ZERO: Self = 0.0;
    const ONE: Self = 1.0;
    const NEAR: Self = 3.452_669_8e-4;
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    fn exp(self) -> Self {
        libm::expf(self)
    }
    fn cos(self) -> Self {
        libm::cosf(self)
    }
    fn sqrt(self) -> Self {
        libm::sqrtf(self)
    }
}

/// `y = b0 x + s; s' = b1 x - a1 y`: `(b0 z + b1) / (z + a1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstOrder<R = f32> {
    /// Weight of the newest input.
    pub b0: R,
    /// Weight of the input before.
    pub b1: R,
    /// Minus the pole.
    pub a1: R,
}

/// Memory of a [`FirstOrder`] filter; the default is rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FirstOrderState<R = f32> {
    s1: R,
}

/// `(b0 z^2 + b1 z + b2) / (z^2 + a1 z + a2)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondOrder<R = f32> {
    /// Weight of the newest input.
    pub b0: R,
    /// Weight of the input before.
    pub b1: R,
    /// Weight of the input before that.
    pub b2: R,
    /// Minus the sum of the poles.
    pub a1: R,
    /// Product of the poles.
    pub a2: R,
}

/// Memory of a [`SecondOrder`] filter; the default is rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SecondOrderState<R = f32> {
    s1: R,
    s2: R,
}

impl<R: Real> FirstOrder<R> {
    /// Passes its input on unchanged.
    pub const PASS: Self = Self { b0: R::ONE, b1: R::ZERO, a1: R::ZERO };

    /// `a / (s + a)`, corner `a` in rad/s, period in s.
    pub fn low_pass(corner_rad_s: R, period_s: R) -> Self {
        Analogue { zeros: Roots::None, poles: Roots::One(-corner_rad_s), gain: corner_rad_s }
            .matched(period_s, GainRule::Matlab)
            .first_order()
    }

    /// `s / (s + a)`, corner `a` in rad/s, period in s.
    pub fn high_pass(corner_rad_s: R, period_s: R, rule: GainRule) -> Self {
        Analogue { zeros: Roots::One(R::ZERO), poles: Roots::One(-corner_rad_s), gain: R::ONE }
            .matched(period_s, rule)
            .first_order()
    }

    /// `a s / (s + a)`: a derivative up to the corner `a` in rad/s; period in s.
    pub fn derivative(corner_rad_s: R, period_s: R, rule: GainRule) -> Self {
        Analogue { zeros: Roots::One(R::ZERO), poles: Roots::One(-corner_rad_s), gain: corner_rad_s }
            .matched(period_s, rule)
            .first_order()
    }

    /// `(s/zero + 1) / (s/pole + 1)`, thesis (5.9); zero and pole in rad/s, period in s.
    pub fn lag(zero_rad_s: R, pole_rad_s: R, period_s: R) -> Self {
        Analogue {
            zeros: Roots::One(-zero_rad_s),
            poles: Roots::One(-pole_rad_s),
            gain: pole_rad_s / zero_rad_s,
        }
        .matched(period_s, GainRule::Matlab)
        .first_order()
    }

    /// `g / (z - (1 - g))`: smoothing with the share `g` of the newest sample, one sample late.
    pub fn smoothing(gain: R) -> Self {
        Self { b0: R::ZERO, b1: gain, a1: gain - R::ONE }
    }

    /// What is left of a signal after this filter: `1 - H(z)`.
    pub fn complement(&self) -> Self {
        Self { b0: R::ONE - self.b0, b1: self.a1 - self.b1, a1: self.a1 }
    }

    /// One sample.
    #[inline]
    pub fn step(&self, state: &mut FirstOrderState<R>, x: R) -> R {
        let y = self.b0 * x + state.s1;
        state.s1 = self.b1 * x - self.a1 * y;
        y
    }

    /// The memory after a constant input `x` without beginning.
    pub fn steady(&self, x: R) -> FirstOrderState<R> {
        let y = x * self.dc_gain();
        FirstOrderState { s1: self.b1 * x - self.a1 * y }
    }

    /// Gain for constant inputs.
    pub fn dc_gain(&self) -> R {
        (self.b0 + self.b1) / (R::ONE + self.a1)
    }
}

impl<R: Real> FirstOrderState<R> {
    /// What a filter with `b0 = 0` (every low-pass here) will give next.
    #[inline]
    pub(crate) fn next_output(&self) -> R {
        self.s1
    }

    /// Adds another memory: the state of the sum of both inputs.
    pub(crate) fn add(&mut self, other: Self) {
        self.s1 = self.s1 + other.s1;
    }
}

impl FirstOrder<f64> {
    /// The coefficients to fly with.
    pub fn rounded(&self) -> FirstOrder {
        FirstOrder { b0: self.b0 as f32, b1: self.b1 as f32, a1: self.a1 as f32 }
    }
}

impl<R: Real> SecondOrder<R> {
    /// `w^2 s / (s^2 + 2 zeta w s + w^2)`, thesis (5.5): natural frequency `w` in rad/s, damping
    /// ratio `zeta`, period in s. With `zeta = 1` the pole is repeated.
    pub fn velocity_estimator(
        natural_frequency_rad_s: R,
        damping_ratio: R,
        period_s: R,
        rule: GainRule,
    ) -> Self {
        let (w, zeta) = (natural_frequency_rad_s, damping_ratio);
        let poles = if zeta < R::ONE {
            Roots::Pair { re: -(zeta * w), im: w * (R::ONE - zeta * zeta).sqrt() }
        } else {
            let spread = w * (zeta * zeta - R::ONE).sqrt();
            Roots::Two(-(zeta * w) + spread, -(zeta * w) - spread)
        };
        Analogue { zeros: Roots::One(R::ZERO), poles, gain: w * w }.matched(period_s, rule)
    }

    /// One sample.
    #[inline]
    pub fn step(&self, state: &mut SecondOrderState<R>, x: R) -> R {
        let y = self.b0 * x + state.s1;
        state.s1 = self.b1 * x - self.a1 * y + state.s2;
        state.s2 = self.b2 * x - self.a2 * y;
        y
    }

    /// The memory after a constant input `x` without beginning.
    pub fn steady(&self, x: R) -> SecondOrderState<R> {
        let y = x * self.dc_gain();
        let s2 = self.b2 * x - self.a2 * y;
        SecondOrderState { s1: s2 + self.b1 * x - self.a1 * y, s2 }
    }

    /// Gain for constant inputs.
    pub fn dc_gain(&self) -> R {
        (self.b0 + self.b1 + self.b2) / (R::ONE + self.a1 + self.a2)
    }

    /// This filter as a first-order one, if its second-order terms are zero.
    fn first_order(&self) -> FirstOrder<R> {
        FirstOrder { b0: self.b0, b1: self.b1, a1: self.a1 }
    }
}

impl<R: Real> SecondOrderState<R> {
    /// Adds another memory: the state of the sum of both inputs.
    pub(crate) fn add(&mut self, other: Self) {
        self.s1 = self.s1 + other.s1;
        self.s2 = self.s2 + other.s2;
    }
}

impl SecondOrder<f64> {
    /// The coefficients to fly with.
    pub fn rounded(&self) -> SecondOrder {
        SecondOrder {
            b0: self.b0 as f32,
            b1: self.b1 as f32,
            b2: self.b2 as f32,
            a1: self.a1 as f32,
            a2: self.a2 as f32,
        }
    }
}

/// Up to two roots of a real polynomial.
#[derive(Debug, Clone, Copy)]
enum Roots<R> {
    None,
    One(R),
    Two(R, R),
    /// `re + j im` and its conjugate.
    Pair {
        re: R,
        im: R,
    },
}

impl<R: Real> Roots<R> {
    fn count(self) -> usize {
        match self {
            Self::None => 0,
            Self::One(_) => 1,
            Self::Two(..) | Self::Pair { .. } => 2,
        }
    }

    /// The monic polynomial with these roots, evaluated at the real point `x`.
    fn at(self, x: R) -> R {
        match self {
            Self::None => R::ONE,
            Self::One(a) => x - a,
            Self::Two(a, b) => (x - a) * (x - b),
            Self::Pair { re, im } => (x - re) * (x - re) + im * im,
        }
    }

    /// Does a root lie on the real point `x`?
    fn has(self, x: R) -> bool {
        let near = |root: R| {
            let distance = x - root;
            distance < R::NEAR && -distance < R::NEAR
        };
        match self {
            Self::None => false,
            Self::One(a) => near(a),
            Self::Two(a, b) => near(a) || near(b),
            Self::Pair { re, im } => near(re) && im < R::NEAR && -im < R::NEAR,
        }
    }

    /// `r -> exp(r Ts)`.
    fn to_z(self, period: R) -> Self {
        match self {
            Self::None => Self::None,
            Self::One(a) => Self::One((a * period).exp()),
            Self::Two(a, b) => Self::Two((a * period).exp(), (b * period).exp()),
            Self::Pair { re, im } => {
                let (radius, cosine) = ((re * period).exp(), (im * period).cos());
                let re = radius * cosine;
                // |z|^2 = re^2 + im^2, and only im^2 is ever used.
                Self::Pair { re, im: (radius * radius - re * re).max_zero().sqrt() }
            }
        }
    }

    /// The monic polynomial's lower coefficients `[c1, c2]` of `z^n + c1 z^(n-1) + c2 z^(n-2)`.
    fn lower_coefficients(self) -> [R; 2] {
        match self {
            Self::None => [R::ZERO, R::ZERO],
            Self::One(a) => [-a, R::ZERO],
            Self::Two(a, b) => [-(a + b), a * b],
            Self::Pair { re, im } => [-(re + re), re * re + im * im],
        }
    }
}

/// Rounding guard for the square of an imaginary part.
trait MaxZero {
    fn max_zero(self) -> Self;
}

impl<R: Real> MaxZero for R {
    fn max_zero(self) -> Self {
        if self < R::ZERO { R::ZERO } else { self }
    }
}

/// `gain * prod(s - zeros) / prod(s - poles)`, proper, one or two poles, at most one zero.
struct Analogue<R> {
    zeros: Roots<R>,
    poles: Roots<R>,
    gain: R,
}

impl<R: Real> Analogue<R> {
    /// The matched Z-transform (see the head of this file).
    fn matched(&self, period: R, rule: GainRule) -> SecondOrder<R> {
        let poles = self.poles.to_z(period);
        // Of the zeros at infinity one stays there; of the filters in this crate none has another
        // one.
        let zeros = self.zeros.to_z(period);
        let gain = match rule {
            GainRule::Slope if self.zeros.has(R::ZERO) => {
                // H(z) / ((z - 1) / Ts) at z = 1 equals H(s) / s at s = 0; the zero at the origin
                // cancels on both sides.
                self.gain / self.poles.at(R::ZERO) / period * poles.at(R::ONE)
            }
            _ => {
                let s = self.match_point(period);
                let z = (s * period).exp();
                self.gain * self.zeros.at(s) / self.poles.at(s) * poles.at(z) / zeros.at(z)
            }
        };
        let [a1, a2] = poles.lower_coefficients();
        let [c1, _] = zeros.lower_coefficients();
        let (b0, b1, b2) = match poles.count() - zeros.count() {
            0 => (gain, gain * c1, R::ZERO),
            1 if zeros.count() == 0 => (R::ZERO, gain, R::ZERO),
            _ => (R::ZERO, gain, gain * c1),
        };
        SecondOrder { b0, b1, b2, a1, a2 }
    }

    /// The first of 0, 0.1/Ts, 0.2/Ts, ... where there is neither a pole nor a zero.
    fn match_point(&self, period: R) -> R {
        let step = R::from_f64(0.1) / period;
        let mut s = R::ZERO;
        while self.zeros.has(s) || self.poles.has(s) {
            s = s + step;
        }
        s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Complex;

    const TS: f64 = 0.01;
    const RULE: GainRule = GainRule::Matlab;

    fn j(w: f64) -> Complex<f64> {
        Complex::new(0.0, w)
    }

    /// exp(s) for complex s.
    fn exp(s: Complex<f64>) -> Complex<f64> {
        Complex::new(libm::cos(s.im), libm::sin(s.im)) * libm::exp(s.re)
    }

    fn norm(c: Complex<f64>) -> f64 {
        libm::hypot(c.re, c.im)
    }

    /// H at `z = exp(j w Ts)`.
    fn response(f: &SecondOrder<f64>, w: f64, ts: f64) -> Complex<f64> {
        let z1 = exp(-j(w) * ts);
        (f.b0 + (f.b1 + f.b2 * z1) * z1) / (1.0 + (f.a1 + f.a2 * z1) * z1)
    }

    fn wide(f: FirstOrder<f64>) -> SecondOrder<f64> {
        SecondOrder { b0: f.b0, b1: f.b1, b2: 0.0, a1: f.a1, a2: 0.0 }
    }

    fn assert_close(got: f64, want: f64, relative: f64, what: &str) {
        assert!(
            (got - want).abs() <= relative * want.abs().max(1e-30),
            "{what}: got {got:.15}, want {want:.15}"
        );
    }

    type Entry = (&'static str, SecondOrder<f64>, SecondOrder<f32>, [f64; 5]);

    /// Independently computed coefficients (numpy, reference table of matched-Z filters): name,
    /// double design, single design, `[b0, b1, b2, a1, a2]`. They are given to about 13 digits.
    fn table() -> Vec<Entry> {
        macro_rules! first {
            ($name:literal, $design:ident($($arg:expr),*) $(, $rule:expr)?; $b0:expr, $b1:expr, $a1:expr) => {{
                let d = FirstOrder::<f64>::$design($($arg,)* TS $(, $rule)?);
                let s = FirstOrder::<f32>::$design($($arg as f32,)* TS as f32 $(, $rule)?);
                let s = SecondOrder { b0: s.b0, b1: s.b1, b2: 0.0, a1: s.a1, a2: 0.0 };
                ($name, wide(d), s, [$b0, $b1, 0.0, $a1, 0.0])
            }};
        }
        let estimator = |name, w: f64, zeta: f64, rule, b: f64, a1, a2| {
            let d = SecondOrder::velocity_estimator(w, zeta, TS, rule);
            let s = SecondOrder::velocity_estimator(w as f32, zeta as f32, TS as f32, rule);
            (name, d, s, [0.0, b, -b, a1, a2])
        };
        let slope = GainRule::Slope;
        vec![
            estimator("crit150", 75.0, 1.0, RULE, 29.64339514471, -0.94473310548203, 0.22313016014843),
            estimator("printed75", 75.0, 0.5, RULE, 39.975840171939, -1.094679681474, 0.47236655274101),
            estimator("crit100", 50.0, 1.0, RULE, 16.41785896722, -1.2130613194253, 0.36787944117144),
            estimator("crit150 slope", 75.0, 1.0, slope, 27.83970546664, -0.94473310548203, 0.22313016014843),
            estimator(
                "printed75 slope",
                75.0,
                0.5,
                slope,
                37.768687126703,
                -1.094679681474,
                0.47236655274101,
            ),
            estimator("crit100 slope", 50.0, 1.0, slope, 15.481812174618, -1.2130613194253, 0.36787944117144),
            first!("lag roll", lag(0.6, 0.2149); 0.35885651173821, -0.35670981918552, -0.9978533074473),
            first!("lag pitch", lag(0.6, 0.2076); 0.34667906062538, -0.34460521402297, -0.99792615339759),
            first!("low 5", low_pass(5.0); 0.0, 0.048770575499286, -0.95122942450071),
            first!("low 2", low_pass(2.0); 0.0, 0.019801326693245, -0.98019867330676),
            first!("low 4", low_pass(4.0); 0.0, 0.039210560847677, -0.96078943915232),
            first!("motor", low_pass(21.5); 0.0, 0.19345855982267, -0.80654144017733),
            first!("derivative", derivative(10.0), RULE; 9.5241870901798, -9.5241870901798, -0.90483741803596),
            first!("derivative slope", derivative(10.0), slope; 9.516258196404, -9.516258196404, -0.90483741803596),
            first!("high", high_pass(5.0), RULE; 0.97581788065662, -0.97581788065662, -0.95122942450071),
            first!("high slope", high_pass(5.0), slope; 0.97541150998572, -0.97541150998572, -0.95122942450071),
        ]
    }

    /// 1e-12 relative in double: the table itself is rounded to 14 digits. The single-precision
    /// design loses digits where `1 - exp(-a Ts)` cancels (6e-8 against 0.002 in the lag canceller,
    /// twice); rounding the double design keeps 6e-8.
    #[test]
    fn coefficients_are_those_of_the_reference_table() {
        for (name, double, single, want) in table() {
            let got = [double.b0, double.b1, double.b2, double.a1, double.a2];
            let flown = double.rounded();
            let flown = [flown.b0, flown.b1, flown.b2, flown.a1, flown.a2];
            let single = [single.b0, single.b1, single.b2, single.a1, single.a2];
            for k in 0..5 {
                assert_close(got[k], want[k], 1e-12, name);
                assert_close(f64::from(flown[k]), want[k], 1e-6, name);
                let scale = want[k].abs().max(want[1].abs());
                assert!(
                    (f64::from(single[k]) - want[k]).abs() <= 1e-4 * scale,
                    "{name} designed in f32: {k}"
                );
            }
        }
    }

    #[test]
    fn poles_and_zeros_are_exponentials_of_the_analogue_ones() {
        for ts in [0.001, 0.0025, 0.01, 0.02] {
            let lag = FirstOrder::<f64>::lag(0.6, 0.2149, ts);
            assert_close(-lag.a1, libm::exp(-0.2149 * ts), 1e-15, "lag pole");
            assert_close(-lag.b1 / lag.b0, libm::exp(-0.6 * ts), 1e-15, "lag zero");
            let crit = SecondOrder::<f64>::velocity_estimator(75.0, 1.0, ts, RULE);
            let pole = libm::exp(-75.0 * ts);
            assert_close(crit.a1, -2.0 * pole, 1e-15, "repeated pole");
            assert_close(crit.a2, pole * pole, 1e-15, "repeated pole");
            assert_eq!(crit.b1, -crit.b2, "zero exactly at z = 1");
            let under = SecondOrder::<f64>::velocity_estimator(75.0, 0.5, ts, RULE);
            let p = exp(Complex::new(-37.5, 37.5 * libm::sqrt(3.0)) * ts);
            // Rounding: the imaginary part is got back from a square root.
            assert_close(under.a1, -2.0 * p.re, 1e-13, "complex pole");
            assert_close(under.a2, p.norm_sqr(), 1e-13, "complex pole");
            let over = SecondOrder::<f64>::velocity_estimator(75.0, 1.25, ts, RULE);
            // s^2 + 187.5 s + 5625 = (s + 37.5)(s + 150)
            assert_close(over.a1, -(libm::exp(-37.5 * ts) + libm::exp(-150.0 * ts)), 1e-14, "real poles");
        }
    }

    #[test]
    fn constant_inputs() {
        for ts in [0.001, 0.01, 0.02] {
            for f in [
                FirstOrder::<f64>::low_pass(5.0, ts),
                FirstOrder::lag(0.6, 0.2149, ts),
                FirstOrder::smoothing(0.02),
            ] {
                // 1e-12: sums of numbers near 1 divided by as little as 2e-4.
                assert_close(f.dc_gain(), 1.0, 1e-12, "dc gain");
            }
            assert_eq!(FirstOrder::<f64>::derivative(10.0, ts, RULE).dc_gain(), 0.0);
            assert_eq!(SecondOrder::<f64>::velocity_estimator(75.0, 1.0, ts, RULE).dc_gain(), 0.0);
        }
    }

    /// A sampled filter cannot follow the analogue one up to half the rate; it must do so well
    /// below its poles, and the error must fall in proportion to the period (the matched rule drops
    /// a zero at infinity: half a sample of delay more).
    #[test]
    fn frequency_response_tends_to_the_analogue_formula() {
        let low = |s: Complex<f64>| 5.0 / (s + 5.0);
        let derivative = |s: Complex<f64>| 10.0 * s / (s + 10.0);
        let lag = |s: Complex<f64>| (s / 0.6 + 1.0) / (s / 0.2149 + 1.0);
        let estimator = |zeta: f64| move |s: Complex<f64>| 5625.0 * s / (s * s + 150.0 * zeta * s + 5625.0);
        let slope = GainRule::Slope;
        type Case<'a> =
            (&'a str, Box<dyn Fn(f64) -> SecondOrder<f64>>, Box<dyn Fn(Complex<f64>) -> Complex<f64>>);
        let cases: Vec<Case> = vec![
            ("low", Box::new(|ts| wide(FirstOrder::low_pass(5.0, ts))), Box::new(low)),
            (
                "derivative",
                Box::new(move |ts| wide(FirstOrder::derivative(10.0, ts, slope))),
                Box::new(derivative),
            ),
            ("lag", Box::new(|ts| wide(FirstOrder::lag(0.6, 0.2149, ts))), Box::new(lag)),
            (
                "crit",
                Box::new(move |ts| SecondOrder::velocity_estimator(75.0, 1.0, ts, slope)),
                Box::new(estimator(1.0)),
            ),
            (
                "under",
                Box::new(move |ts| SecondOrder::velocity_estimator(75.0, 0.5, ts, slope)),
                Box::new(estimator(0.5)),
            ),
        ];
        for (name, make, exact) in &cases {
            let error = |ts: f64| {
                (1..=40)
                    .map(|k| f64::from(k) * 0.5)
                    .map(|w| norm(response(&make(ts), w, ts) / exact(j(w)) - 1.0))
                    .fold(0.0, f64::max)
            };
            let (coarse, fine) = (error(0.01), error(0.001));
            // At 20 rad/s half a sample is 0.1 rad of phase, a whole one 0.2 rad; the gain adds a
            // few per cent.
            assert!(coarse < 0.25, "{name}: {coarse}");
            assert!(
                fine < 0.15 * coarse,
                "{name}: error {coarse} must fall ten times with the period, is {fine}"
            );
        }
    }

    /// The sampled filter's own response is known exactly: the zero-pole-gain form at `z`, up to
    /// half the sampling rate.
    #[test]
    fn frequency_response_is_the_zero_pole_form_up_to_half_the_rate() {
        let p = libm::exp(-0.75);
        let f = SecondOrder::<f64>::velocity_estimator(75.0, 1.0, TS, RULE);
        for k in 1..=314 {
            let w = f64::from(k);
            let z = exp(j(w) * TS);
            let z0 = libm::exp(0.1);
            let unscaled = |z: Complex<f64>| (z - 1.0) / ((z - p) * (z - p));
            let h0 = 5625.0 * 10.0 / (85.0 * 85.0);
            let want = unscaled(z) / unscaled(Complex::new(z0, 0.0)) * h0;
            assert!(norm(response(&f, w, TS) - want) < 1e-10 * norm(want), "{w} rad/s");
        }
    }

    #[test]
    fn step_responses_are_the_closed_forms() {
        let low = FirstOrder::<f64>::low_pass(5.0, TS);
        let lag = FirstOrder::<f64>::lag(0.6, 0.2149, TS);
        let derivative = FirstOrder::<f64>::derivative(10.0, TS, RULE);
        let estimator = SecondOrder::<f64>::velocity_estimator(75.0, 1.0, TS, RULE);
        let (mut s1, mut s2, mut s3, mut s4) = Default::default();
        for k in 0..1000 {
            let t = f64::from(k) * TS;
            assert!((low.step(&mut s1, 1.0) - (1.0 - libm::exp(-5.0 * t))).abs() < 1e-12, "low at {t}");
            let want = 1.0 + (lag.b0 - 1.0) * libm::exp(-0.2149 * t);
            assert!((lag.step(&mut s2, 1.0) - want).abs() < 1e-11, "lag at {t}");
            let want = derivative.b0 * libm::exp(-10.0 * t);
            assert!((derivative.step(&mut s3, 1.0) - want).abs() < 1e-11, "derivative at {t}");
            // (z - 1)/(z - p)^2 times z/(z - 1) is z/(z - p)^2, whose sequence is k p^(k-1).
            let want = estimator.b1 * f64::from(k) * libm::exp(-75.0 * (t - TS));
            assert!((estimator.step(&mut s4, 1.0) - want).abs() < 1e-10, "estimator at {t}");
        }
    }

    #[test]
    fn ramp_is_measured_as_its_slope() {
        for (rule, want) in [(GainRule::Slope, 1.0), (GainRule::Matlab, 1.064788)] {
            let f = SecondOrder::<f64>::velocity_estimator(75.0, 1.0, TS, rule);
            let mut s = SecondOrderState::default();
            let rate = (0..200).map(|k| f.step(&mut s, f64::from(k) * TS)).last().unwrap();
            // 1.064788 is the printed ratio of the two rules, six decimals.
            assert_close(rate, want, 1e-6, "slope");
        }
    }

    #[test]
    fn steady_memory_gives_the_steady_output_at_once() {
        let low = FirstOrder::<f64>::low_pass(2.0, TS).rounded();
        let mut s = low.steady(-1.0);
        let lag = FirstOrder::<f64>::lag(0.6, 0.2149, TS).rounded();
        let mut l = lag.steady(3.0);
        let est = SecondOrder::<f64>::velocity_estimator(75.0, 1.0, TS, RULE).rounded();
        let mut e = est.steady(-1.0);
        for _ in 0..10_000 {
            // f32: the output settles where rounding stops it, at most half a unit over 1 - pole =
            // 0.0198 off.
            assert!((low.step(&mut s, -1.0) + 1.0).abs() < 3e-6);
            assert!((lag.step(&mut l, 3.0) - 3.0).abs() < 3.0 * 6e-8 / 0.002_146 * 2.0);
            // Exactly: the state holds b2 x and b1 x + b2 x = 0.
            assert_eq!(est.step(&mut e, -1.0), 0.0);
        }
    }

    #[test]
    fn adding_a_steady_memory_moves_the_past_by_a_constant() {
        let est = SecondOrder::<f64>::velocity_estimator(75.0, 1.0, TS, RULE);
        let turn = 2.0 * core::f64::consts::PI;
        let (mut plain, mut moved) = (est.steady(0.0), est.steady(0.0));
        for k in 0..50 {
            let x = f64::from(k) * 0.02;
            let want = est.step(&mut plain, x);
            if k == 25 {
                moved.add(est.steady(-turn));
            }
            let got = est.step(&mut moved, if k >= 25 { x - turn } else { x });
            assert!((got - want).abs() < 1e-10, "{k}: {got} {want}");
        }
    }

    #[test]
    fn complement_restores_the_signal() {
        let low = FirstOrder::<f64>::low_pass(5.0, TS);
        let high = low.complement();
        let (mut a, mut b) = Default::default();
        for k in 0..500 {
            let x = libm::sin(f64::from(k * k) * 0.01);
            assert!((low.step(&mut a, x) + high.step(&mut b, x) - x).abs() < 1e-12);
        }
        // The matched pair misses at half the rate, by the printed amount.
        let pair = FirstOrder::<f64>::high_pass(5.0, TS, RULE);
        let w = core::f64::consts::PI / TS;
        let sum = response(&wide(low), w, TS) + response(&wide(pair), w, TS);
        assert_close(sum.re, 0.9752, 1e-4, "sum at the Nyquist frequency");
    }

    #[test]
    fn pass_changes_nothing() {
        let mut s = FirstOrderState::default();
        for x in [1.0_f32, -2.5, 1e-30, 3e7] {
            assert_eq!(FirstOrder::PASS.step(&mut s, x), x);
        }
    }
}
