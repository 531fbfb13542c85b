//! The linear model about an equilibrium, thesis (5.15) and (5.16).
//!
//! `Z' = A Z + B u`, `y = C Z + D u` with C the identity and D zero, states and inputs in the order
//! of (5.13). Inputs are thrust (N, up) and angular accelerations (rad/s^2), as (5.11) makes them
//! of squared rotor speeds; the rotors' lag is kept apart, (5.23). Derivatives are central
//! differences of fourth order on the model's own equations.

use control::mixer::SIGN_MATRIX;
use model::Model;
use nalgebra::{Matrix4, SMatrix, Vector4};

use super::channel::{CHANNELS, Channel, ChannelId, MatrixA};
use super::trim::{Dynamics, Equilibrium, INPUTS, TrimTarget, equilibrium};
use crate::error::{DesignError, Result};

/// B of (5.16).
pub type MatrixB = SMatrix<f64, 12, 4>;

/// Step of the differences in the states' own units (m, m/s, rad, rad/s): small against where drag
/// begins to bend.
const STEP: f64 = 1e-4;
/// Entries below this are rounding: differences of numbers near 10 over the step.
const ROUNDING: f64 = 1e-9;

/// A model made linear.
#[derive(Debug, Clone, PartialEq)]
pub struct Linear {
    /// The equilibrium that it is linear about.
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

    /// The channel's input matrix for `Z' = A Z + B u + N u'`: with `x = Z - N u` the state of a
    /// proper system, its input matrix is `B + A N`. (N moves rates only, which are no outputs of a
    /// channel, so nothing is fed through.)
    pub(crate) fn proper_b(&self) -> MatrixB {
        self.b + self.a * self.b_derivative
    }

    /// A channel made minimal: poles and zeros closer than `tolerance` (relative to the pole)
    /// cancel.
    pub fn channel(&self, id: ChannelId, tolerance: f64) -> Result<Channel> {
        Channel::new(&self.a, &self.proper_b().column(id.input).into_owned(), id, tolerance)
    }

    /// All channels.
    pub fn channels(&self, tolerance: f64) -> Result<Vec<Channel>> {
        CHANNELS.iter().map(|id| self.channel(*id, tolerance)).collect()
    }
}

/// How the derivatives by the state are taken.
#[derive(Clone, Copy)]
enum Differences {
    /// Fourth order, small step.
    Fine,
    /// Second order, with a step in the states' own units.
    Plain(f64),
}

/// Linearises about hover (or `target`) by plain central differences with a step as large as given,
/// in the states' own units: a perturbation of 2 degrees turns the 9.81 of A into the 9.808 that
/// the thesis prints.
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

/// The sign matrix of (4.5) as a matrix, rows rotors.
pub(crate) fn sign_matrix() -> Matrix4<f64> {
    Matrix4::from_fn(|i, j| SIGN_MATRIX[i][j])
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;

    /// A fourth-order difference is exact for polynomials up to the fourth degree, a plain one up
    /// to the second: the third derivative, 6, adds a sixth of itself times the step squared.
    #[test]
    fn differences_are_exact_as_far_as_their_order() {
        let quartic = |x: &[f64; 1]| [x[0].powi(4) + x[0].powi(3) + 2.0 * x[0]];
        assert!((differences(0.1, quartic)[(0, 0)] - 2.0).abs() < 1e-14);
        assert!((plain_differences(0.1, quartic)[(0, 0)] - 2.01).abs() < 1e-14);
    }

    /// At rest for ever, what is remembered is what is there, and the time is that of the start.
    #[test]
    fn what_looks_back_is_linear_about_what_has_always_been() {
        let linear = |formula: &str| {
            let text = format!(
                "[[effect]]\nid = \"wake\"\nacceleration.w = \"{formula}\"\ncoefficient = [{{ name = \"k\", unit = \"1/s\", possible = \
                 [-9.0, 9.0], typical = 1.0 }}]\nconstant = [{{ name = \"memory\", unit = \"s\", value = 0.4 }}]\n"
            );
            let [user] = model::effects::draft(&text, std::path::Path::new("wake.toml")).unwrap()[..] else {
                panic!("one effect")
            };
            let mut model = Model::thesis();
            model.set(Effect::User(user), &[-0.3]);
            Linear::new(&model, &TrimTarget::default()).unwrap().a
        };
        let (now, back) = (linear("k * w"), linear("k * lag(w, memory) * cos(time / memory)"));
        assert!((now - back).amax() < 1e-9 && now.amax() > 0.3, "{now} {back}");
    }

    /// A row of zeros, or two equal rows, leave an axis without a rotor effect of its own: the
    /// error names it.
    #[test]
    fn the_axis_that_rotors_do_not_move_is_named() {
        let mut effort = sign_matrix().transpose();
        assert!(
            (well_conditioned_inverse(&effort).unwrap() * effort - Matrix4::identity()).abs().max() < 1e-15
        );
        effort.row_mut(2).fill(0.0);
        let error = well_conditioned_inverse(&effort).unwrap_err().to_string();
        assert!(error.contains("pitch") && error.contains("tau_theta"), "{error}");
        let mut twice = sign_matrix().transpose();
        let first = twice.row(0).into_owned();
        twice.row_mut(3).copy_from(&first);
        assert!(well_conditioned_inverse(&twice).unwrap_err().to_string().contains("independently"));
    }

    /// Rotor inertia acts on the derivative of the inputs: 1 / s more of yaw for each rad/s^2 of
    /// the rotors, and nothing else about the linear model changes.
    #[test]
    fn rotor_inertia_is_kept_apart_from_b() {
        let plain = Linear::new(&Model::thesis(), &TrimTarget::default()).unwrap();
        assert!(plain.b_derivative.iter().all(|x| *x == 0.0));
        let mut model = Model::thesis();
        let typical: Vec<f64> = Effect::RotorInertia.info().coefficients.iter().map(|c| c.typical).collect();
        model.set(Effect::RotorInertia, &typical);
        let with = Linear::new(&model, &TrimTarget::default()).unwrap();
        assert!(with.b_derivative.row(11).iter().any(|x| *x != 0.0), "{}", with.b_derivative);
        assert!((with.a - plain.a).abs().max() < 1e-9 && (with.b - plain.b).abs().max() < 1e-9);
    }
}
