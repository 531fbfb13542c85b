//! The channels of the linear model, (5.17) to (5.22).
//!
//! A channel is one input to one output as poles, zeros and gain. It is made minimal in two steps:
//! states that the input does not reach or that do not reach the output are left out, which is
//! exact; then a pole and a zero closer than a tolerance cancel, which is an approximation and is
//! listed.
//!
//! Where the printed transfer functions come from: roll and pitch are coupled through the rotors'
//! momentum (A10,11 and A11,10), so the transfer function of each has all six poles of the coupled
//! block and five zeros, and those of the other axis nearly cancel. What is left are three poles
//! *of the coupled block*, not those of the decoupled axis. The zero of (5.20), printed as 0.2149,
//! is really 0.2211 = C_dv/m: the twelve-state transfer function has both as zeros and 0.2149 as a
//! pole (heave), and a loose tolerance took the wrong one of the two away.

use nalgebra::{Complex, DMatrix, SMatrix};

use super::state_space::eigenvalues;
use super::trim::{INPUTS, STATES};
use crate::error::{DesignError, Result};

/// A of (5.16).
pub type MatrixA = SMatrix<f64, 12, 12>;

/// A channel's place in the linear model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChannelId {
    /// Name of the loop around it.
    pub name: &'static str,
    /// Index of the input.
    pub input: usize,
    /// Index of the state that is its output.
    pub output: usize,
}

/// The channels of (5.17) to (5.22).
pub const CHANNELS: [ChannelId; 6] = [
    ChannelId { name: "roll", input: 1, output: 6 },
    ChannelId { name: "pitch", input: 2, output: 7 },
    ChannelId { name: "yaw", input: 3, output: 8 },
    ChannelId { name: "z", input: 0, output: 2 },
    ChannelId { name: "x", input: 2, output: 0 },
    ChannelId { name: "y", input: 1, output: 1 },
];

/// Relative distance below which a pole and a zero cancel: above the tenths of a per cent by which
/// the other axis' poles and zeros differ (reference section 1), below the 2.9 % between two
/// different drags of the thesis' craft.
pub const CANCEL_TOLERANCE: f64 = 0.01;

/// A pole and a zero that were taken for one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cancelled {
    /// The pole, rad/s.
    pub pole: Complex<f64>,
    /// The zero, rad/s.
    pub zero: Complex<f64>,
}

impl Cancelled {
    /// How far apart they were, relative to the pole.
    pub fn distance(&self) -> f64 {
        distance(self.pole, self.zero)
    }
}

/// One input to one output: `gain prod(s - zero) / prod(s - pole)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Its place in the linear model.
    pub id: ChannelId,
    /// Poles, rad/s.
    pub poles: Vec<Complex<f64>>,
    /// Zeros, rad/s.
    pub zeros: Vec<Complex<f64>>,
    /// Ratio of the leading coefficients.
    pub gain: f64,
    /// States that take part; the others were left out without error.
    pub states: Vec<&'static str>,
    /// Pairs that were cancelled, nearest first.
    pub cancelled: Vec<Cancelled>,
}

impl Channel {
    pub(crate) fn new(a: &MatrixA, b: &SMatrix<f64, 12, 1>, id: ChannelId, tolerance: f64) -> Result<Self> {
        let kept = connected(a, b, id);
        if kept.is_empty() {
            return Err(DesignError::Uncontrollable {
                channel: id.name,
                input: INPUTS[id.input],
                output: STATES[id.output],
            });
        }
        let a = DMatrix::from_fn(kept.len(), kept.len(), |i, j| a[(kept[i], kept[j])]);
        let b = DMatrix::from_fn(kept.len(), 1, |i, _| b[kept[i]]);
        let c = DMatrix::from_fn(1, kept.len(), |_, j| f64::from(kept[j] == id.output));
        let (zeros, gain) = zeros_and_gain(&a, &b, &c).ok_or(DesignError::Uncontrollable {
            channel: id.name,
            input: INPUTS[id.input],
            output: STATES[id.output],
        })?;
        let (poles, zeros) = (eigenvalues(&a)?, zeros?);
        let (poles, zeros, cancelled) = cancel(poles, zeros, tolerance);
        Ok(Self {
            id,
            poles: sorted(poles),
            zeros: sorted(zeros),
            gain,
            states: kept.iter().map(|&i| STATES[i]).collect(),
            cancelled,
        })
    }

    /// The channel by itself: as if the other axes stood still.
    pub(crate) fn alone(a: &MatrixA, b: &SMatrix<f64, 12, 1>, id: ChannelId, tolerance: f64) -> Result<Self> {
        let own = |i: &usize| own_states(id).contains(i);
        let a = MatrixA::from_fn(|i, j| if own(&i) && own(&j) { a[(i, j)] } else { 0.0 });
        let b = SMatrix::<f64, 12, 1>::from_fn(|i, _| if own(&i) { b[i] } else { 0.0 });
        Self::new(&a, &b, id, tolerance)
    }

    /// Numerator, descending powers of s.
    pub fn numerator(&self) -> Vec<f64> {
        polynomial(&self.zeros).into_iter().map(|x| x * self.gain).collect()
    }

    /// Denominator, descending powers of s, monic.
    pub fn denominator(&self) -> Vec<f64> {
        polynomial(&self.poles)
    }
}

/// Coefficients of the monic polynomial with these roots (complex ones in pairs), descending
/// powers.
pub(crate) fn polynomial(roots: &[Complex<f64>]) -> Vec<f64> {
    let mut coefficients = vec![Complex::new(1.0, 0.0)];
    for root in roots {
        coefficients.push(Complex::new(0.0, 0.0));
        for k in (1..coefficients.len()).rev() {
            let before = coefficients[k - 1];
            coefficients[k] -= before * root;
        }
    }
    coefficients.iter().map(|c| c.re).collect()
}

/// States of the axis that a channel belongs to: what its output is made of where no other axis
/// takes part.
fn own_states(id: ChannelId) -> &'static [usize] {
    match id.name {
        "roll" | "y" => &[1, 4, 6, 9],
        "pitch" | "x" => &[0, 3, 7, 10],
        "yaw" => &[8, 11],
        _ => &[2, 5],
    }
}

/// States on a path from the input to the output, in order.
fn connected(a: &MatrixA, b: &SMatrix<f64, 12, 1>, id: ChannelId) -> Vec<usize> {
    let closure = |start: &dyn Fn(usize) -> bool, next: &dyn Fn(usize, usize) -> bool| {
        let mut reached: [bool; 12] = std::array::from_fn(start);
        for _ in 0..12 {
            for i in 0..12 {
                reached[i] |= (0..12).any(|j| reached[j] && next(j, i));
            }
        }
        reached
    };
    let forward = closure(&|i| b[i] != 0.0, &|from, to| a[(to, from)] != 0.0);
    let backward = closure(&|i| i == id.output, &|from, to| a[(from, to)] != 0.0);
    (0..12).filter(|&i| forward[i] && backward[i]).collect()
}

/// Zeros and leading gain of a strictly proper single-input single-output system.
///
/// With r the relative degree and m = c A^(r-1) b the first Markov parameter that is not zero, the
/// feedback that holds the output at zero makes the null space of c, cA, ... cA^(r-1) invariant
/// under A - b c A^r / m; the zeros are the eigenvalues there. No pencil, no polynomial, and no
/// false zeros near infinity.
fn zeros_and_gain(
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    c: &DMatrix<f64>,
) -> Option<(Result<Vec<Complex<f64>>>, f64)> {
    let order = a.nrows();
    let mut observed = DMatrix::zeros(order, order);
    let mut row = c.clone();
    for degree in 1..=order {
        observed.row_mut(degree - 1).copy_from(&row.row(0));
        let markov = (&row * b)[0];
        let scale = row.norm() * b.norm();
        let next = &row * a;
        if markov.abs() > 1e-9 * scale {
            let hold = a - b * &next / markov;
            let basis = observed.svd(false, true).v_t?.transpose();
            let null = basis.columns(degree, order - degree).into_owned();
            return Some((eigenvalues(&(null.transpose() * hold * null)), markov));
        }
        row = next;
    }
    None
}

fn distance(pole: Complex<f64>, zero: Complex<f64>) -> f64 {
    (pole - zero).norm() / pole.norm().max(1e-6)
}

type Roots = Vec<Complex<f64>>;

/// Cancels the nearest pairs first, a complex pair together with its conjugate.
fn cancel(mut poles: Roots, mut zeros: Roots, tolerance: f64) -> (Roots, Roots, Vec<Cancelled>) {
    let mut cancelled = Vec::new();
    loop {
        let mut nearest: Option<(f64, usize, usize)> = None;
        for (i, pole) in poles.iter().enumerate() {
            for (j, zero) in zeros.iter().enumerate() {
                // A real pole does not cancel one of a pair: the other would be left without its
                // conjugate.
                let alike = (pole.im == 0.0) == (zero.im == 0.0);
                let apart = distance(*pole, *zero);
                if alike && apart <= tolerance && nearest.is_none_or(|(best, ..)| apart < best) {
                    nearest = Some((apart, i, j));
                }
            }
        }
        let Some((_, i, j)) = nearest else { break };
        let pair = Cancelled { pole: poles.swap_remove(i), zero: zeros.swap_remove(j) };
        cancelled.push(pair);
        if pair.pole.im != 0.0 {
            let take = |roots: &mut Roots, root: Complex<f64>| {
                let twin = root.conj();
                let nearest = |x: &&usize| (roots[**x] - twin).norm();
                let all: Vec<usize> = (0..roots.len()).collect();
                let at = all.iter().min_by(|x, y| nearest(x).total_cmp(&nearest(y)));
                at.copied().map(|at| roots.swap_remove(at))
            };
            if let (Some(pole), Some(zero)) = (take(&mut poles, pair.pole), take(&mut zeros, pair.zero)) {
                cancelled.push(Cancelled { pole, zero });
            }
        }
    }
    (poles, zeros, cancelled)
}

/// From left to right, the positive imaginary part of a pair first.
fn sorted(mut roots: Roots) -> Roots {
    roots.sort_by(|a, b| a.re.total_cmp(&b.re).then(b.im.total_cmp(&a.im)));
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    const J: Complex<f64> = Complex::new(0.0, 1.0);

    fn real(x: f64) -> Complex<f64> {
        Complex::new(x, 0.0)
    }

    /// (s + 1)(s^2 + 2 s + 5) = s^3 + 3 s^2 + 7 s + 5.
    #[test]
    fn a_polynomial_has_its_roots() {
        let coefficients = polynomial(&[real(-1.0), -1.0 + 2.0 * J, -1.0 - 2.0 * J]);
        assert_eq!(coefficients, [1.0, 3.0, 7.0, 5.0]);
    }

    /// 3 (s + 2) / (s^3 + 4 s^2 + 5 s + 6) in canonical form: gain 3, zero -2, and no false zeros
    /// near infinity.
    #[test]
    fn zeros_and_gain_are_those_of_the_fraction() {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, -6.0, -5.0, -4.0]);
        let b = DMatrix::from_row_slice(3, 1, &[0.0, 0.0, 1.0]);
        let c = DMatrix::from_row_slice(1, 3, &[6.0, 3.0, 0.0]);
        let (zeros, gain) = zeros_and_gain(&a, &b, &c).unwrap();
        let zeros = zeros.unwrap();
        assert!((gain - 3.0).abs() < 1e-14 && zeros.len() == 1, "{zeros:?}");
        assert!((zeros[0] + 2.0).norm() < 1e-12, "{zeros:?}");
        assert!(zeros_and_gain(&a, &DMatrix::zeros(3, 1), &c).is_none());
    }

    /// A pair goes with its conjugate; a real zero beside a complex pole stays; nothing cancels
    /// beyond the tolerance.
    #[test]
    fn what_cancels_is_near_and_alike() {
        let pole = -1.0 + 3.0 * J;
        let (poles, zeros) = (vec![pole, pole.conj(), real(-4.0)], vec![pole * 1.001, (pole * 1.001).conj()]);
        let (left, none, cancelled) = cancel(poles.clone(), zeros.clone(), 0.01);
        assert_eq!((left, none.len(), cancelled.len()), (vec![real(-4.0)], 0, 2));
        assert!((cancelled[0].distance() - 0.001).abs() < 1e-12);
        assert_eq!(cancel(poles, zeros, 1e-4).0.len(), 3);
        assert!(cancel(vec![real(-1.0)], vec![-1.0 + 1e-3 * J], 0.01).2.is_empty());
    }
}
