//! The linear model about an equilibrium, thesis (5.15) and (5.16), and its channels, (5.17) to (5.22).
//!
//! `Z' = A Z + B u`, `y = C Z + D u` with C the identity and D zero, states and inputs in the order of (5.13). Inputs are
//! thrust (N, up) and angular accelerations (rad/s^2), as (5.11) makes them of squared rotor speeds; the rotors' lag is
//! kept apart, (5.23). Derivatives are central differences of fourth order on the model's own equations.
//!
//! A channel is one input to one output as poles, zeros and gain. It is made minimal in two steps that are told apart:
//! states that the input does not reach or that do not reach the output are left out, which is exact; then a pole and a
//! zero closer than a tolerance cancel, which is an approximation and is listed.
//!
//! How the printed transfer functions came about: roll and pitch are coupled through the rotors' momentum (A10,11 and
//! A11,10), so the transfer function of each has all six poles of the coupled block and five zeros, and those of the other
//! axis nearly cancel. What is left are three poles *of the coupled block*, not those of the decoupled axis. The zero of
//! (5.20), printed as 0.2149, is really 0.2211 = C_dv/m: the twelve-state transfer function has both as zeros and 0.2149
//! as a pole (heave), and a loose tolerance took the wrong one of the two away.

use control::mixer::SIGN_MATRIX;
use model::Model;
use nalgebra::{Complex, DMatrix, Matrix4, SMatrix, Vector4};

use crate::error::{DesignError, Result};
use crate::state_space::eigenvalues;
use crate::trim::{Dynamics, Equilibrium, INPUTS, STATES, TrimTarget, equilibrium};

/// A of (5.16).
pub type MatrixA = SMatrix<f64, 12, 12>;
/// B of (5.16).
pub type MatrixB = SMatrix<f64, 12, 4>;

/// Step of the differences in the states' own units (m, m/s, rad, rad/s): small against where drag begins to bend.
const STEP: f64 = 1e-4;
/// Entries below this are rounding: differences of numbers near 10 over the step.
const ROUNDING: f64 = 1e-9;

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

/// A model made linear.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    /// Where.
    pub equilibrium: Equilibrium,
    /// A of (5.15).
    pub a: MatrixA,
    /// B of (5.15).
    pub b: MatrixB,
    /// What the derivative of the inputs adds to Z' (rotor inertia), zero for most models; s.
    pub b_derivative: MatrixB,
    /// K of (5.11) at the equilibrium: inputs per squared rotor speed.
    pub effectiveness: Matrix4<f64>,
    /// First-order lag of the rotors, rad/s; absent: they follow at once, or the lag is unknown.
    pub motor_lag_rad_s: Option<f64>,
    /// Dead time between command and rotor, s.
    pub input_delay_s: f64,
}

impl Linear {
    /// Finds the equilibrium of a model and linearises about it.
    pub fn new(model: &Model, target: &TrimTarget) -> Result<Self> {
        let equilibrium = equilibrium(model, target)?;
        Self::about(model, target, equilibrium, Differences::Fine)
    }

    fn about(
        model: &Model,
        target: &TrimTarget,
        equilibrium: Equilibrium,
        of_state: Differences,
    ) -> Result<Self> {
        let dynamics = Dynamics::new(model, target.battery_v);
        let (state, rotor) = (equilibrium.state, equilibrium.rotor_rad_s);
        if rotor.iter().any(|w| !(*w > 0.0)) {
            return Err(DesignError::NoEquilibrium {
                cost: equilibrium.cost,
                worst: "w",
                hint: "a rotor stands still there",
            });
        }
        let moved = |step: &[f64; 12]| {
            let z: [f64; 12] = std::array::from_fn(|i| state[i] + step[i]);
            dynamics.derivative(&z, &rotor, &[0.0; 4])
        };
        let a = match of_state {
            Differences::Fine => differences(STEP, moved),
            Differences::Plain(step) => plain_differences(step, moved),
        };
        // Rotor speeds and accelerations in rad/s and rad/s^2 are hundreds.
        let by_speed = differences::<12, 4>(1e-2, |step| {
            let w: [f64; 4] = std::array::from_fn(|i| rotor[i] + step[i]);
            dynamics.derivative(&state, &w, &[0.0; 4])
        });
        let by_acceleration = differences::<12, 4>(1e-2, |step| dynamics.derivative(&state, &rotor, step));
        let effort_by_speed = differences::<4, 4>(1e-2, |step| {
            let w: [f64; 4] = std::array::from_fn(|i| rotor[i] + step[i]);
            dynamics.rotor_effort(&state, &w)
        });
        let effort = Matrix4::from_fn(|i, j| effort_by_speed[(i, j)]);
        let inverse = well_conditioned_inverse(&effort)?;
        let speeds = Vector4::from(rotor);
        let effectiveness = Matrix4::from_fn(|i, j| effort[(i, j)] / (2.0 * speeds[j]));
        let adjust = model.adjustments();
        Ok(Self {
            equilibrium,
            a: cleaned(a),
            b: cleaned(by_speed * inverse),
            b_derivative: cleaned(by_acceleration * inverse),
            effectiveness,
            motor_lag_rad_s: adjust.lag_rad_s(model.vehicle.motors.lag),
            input_delay_s: adjust.dead_time_s().max(0.0),
        })
    }

    /// The channel's input matrix for `Z' = A Z + B u + N u'`: with `x = Z - N u` the state of a proper system, its input
    /// matrix is `B + A N`. (N moves rates only, which are no outputs of a channel, so nothing is fed through.)
    pub(crate) fn proper_b(&self) -> MatrixB {
        self.b + self.a * self.b_derivative
    }

    /// A channel made minimal: poles and zeros closer than `tolerance` (relative to the pole) cancel.
    pub fn channel(&self, id: ChannelId, tolerance: f64) -> Result<Channel> {
        Channel::new(&self.a, &self.proper_b().column(id.input).into_owned(), id, tolerance)
    }

    /// All channels.
    pub fn channels(&self, tolerance: f64) -> Result<Vec<Channel>> {
        CHANNELS.iter().map(|id| self.channel(*id, tolerance)).collect()
    }
}

/// Relative distance below which a pole and a zero cancel: above the tenths of a per cent by which the other axis' poles
/// and zeros differ (reference section 1), below the 2.9 % between two different drags of the thesis' craft.
pub const CANCEL_TOLERANCE: f64 = 0.01;

/// How the derivatives by the state are taken.
#[derive(Clone, Copy)]
enum Differences {
    /// Fourth order, small step.
    Fine,
    /// Second order, with a step in the states' own units.
    Plain(f64),
}

/// Linearises about hover (or `target`) by plain central differences with a step as large as given, in the states' own
/// units: a perturbation of 2 degrees turns the 9.81 of A into the 9.808 that the thesis prints.
pub fn with_perturbation(model: &Model, target: &TrimTarget, step: f64) -> Result<Linear> {
    Linear::about(model, target, equilibrium(model, target)?, Differences::Plain(step))
}

fn plain_differences<const ROWS: usize, const COLUMNS: usize>(
    step: f64,
    f: impl Fn(&[f64; COLUMNS]) -> [f64; ROWS],
) -> SMatrix<f64, ROWS, COLUMNS> {
    let at = |column: usize, by: f64| f(&std::array::from_fn(|i| if i == column { by } else { 0.0 }));
    SMatrix::from_fn(|row, column| (at(column, step)[row] - at(column, -step)[row]) / (2.0 * step))
}

/// Central differences of fourth order.
fn differences<const ROWS: usize, const COLUMNS: usize>(
    step: f64,
    f: impl Fn(&[f64; COLUMNS]) -> [f64; ROWS],
) -> SMatrix<f64, ROWS, COLUMNS> {
    let mut slopes = SMatrix::zeros();
    for column in 0..COLUMNS {
        let at = |steps: f64| {
            let mut moved = [0.0; COLUMNS];
            moved[column] = steps * step;
            f(&moved)
        };
        let (far_less, less, more, far_more) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
        for row in 0..ROWS {
            slopes[(row, column)] =
                (8.0 * (more[row] - less[row]) - (far_more[row] - far_less[row])) / (12.0 * step);
        }
    }
    slopes
}

fn cleaned<const ROWS: usize, const COLUMNS: usize>(
    matrix: SMatrix<f64, ROWS, COLUMNS>,
) -> SMatrix<f64, ROWS, COLUMNS> {
    matrix.map(|x| if x.abs() < ROUNDING { 0.0 } else { x })
}

/// The inverse of a matrix of rotor effects, or which axis the rotors do not move.
fn well_conditioned_inverse(effort: &Matrix4<f64>) -> Result<Matrix4<f64>> {
    const OUTPUTS: [(&str, &str); 4] = [("z", "w"), ("roll", "p"), ("pitch", "q"), ("yaw", "r")];
    let mut scaled = *effort;
    for (k, mut row) in scaled.row_iter_mut().enumerate() {
        let length = row.norm();
        if !(length > 1e-9) {
            let (channel, output) = OUTPUTS[k];
            return Err(DesignError::Uncontrollable { channel, input: INPUTS[k], output });
        }
        row /= length;
    }
    if scaled.determinant().abs() < 1e-9 {
        return Err(DesignError::Uncontrollable {
            channel: "yaw",
            input: "four rotors",
            output: "thrust and the three axes independently",
        });
    }
    effort.try_inverse().ok_or(DesignError::Numerics("the inverse of K (5.11)"))
}

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
    /// Which.
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

/// Coefficients of the monic polynomial with these roots (complex ones in pairs), descending powers.
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

/// States of the axis that a channel belongs to: what its output is made of where no other axis takes part.
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
/// With r the relative degree and m = c A^(r-1) b the first Markov parameter that is not zero, the feedback that holds the
/// output at zero makes the null space of c, cA, ... cA^(r-1) invariant under A - b c A^r / m; the zeros are the
/// eigenvalues there. No pencil, no polynomial, and no false zeros near infinity.
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
                // A real pole does not cancel one of a pair: the other would be left without its conjugate.
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

/// The sign matrix of (4.5) as a matrix, rows rotors.
pub(crate) fn sign_matrix() -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| SIGN_MATRIX[i][j])
}
