//! Motor commands from the torques and the thrust that PX4's mixer was asked for.

use nalgebra::Matrix4;

use crate::log::{Log, Table};

use super::rows::Rows;
use super::topics::topic;

/// A rotor as PX4's parameters have it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rotor {
    /// To the front, m.
    pub(super) x: f64,
    /// To the right, m.
    pub(super) y: f64,
    /// Thrust at full command.
    pub(super) thrust: f64,
    /// Torque over thrust; positive turns counter-clockwise.
    pub(super) torque_ratio: f64,
}

/// PX4's mixer: the inverse of what the rotors do, scaled as `ControlAllocationPseudoInverse` does.
pub(super) struct Mixer {
    /// A row each motor of PX4; columns roll, pitch, yaw, downward thrust.
    matrix: Matrix4<f64>,
}

impl Mixer {
    /// The mixer for upright rotors; none where they cannot turn the craft about all axes.
    pub(super) fn of(rotors: &[Rotor; 4]) -> Option<Self> {
        let effect = Matrix4::from_columns(&rotors.map(|rotor| {
            let Rotor { x, y, thrust, torque_ratio } = rotor;
            nalgebra::Vector4::new(-y, x, torque_ratio, -1.0) * thrust
        }));
        let mut matrix = effect.try_inverse()?;
        let spread = |column: usize| {
            // Where the firmware counts a motor as turning the craft about an axis.
            let turning = matrix.column(column).iter().filter(|part| part.abs() > 1e-3).count();
            if turning > 0 {
                (matrix.column(column).norm_squared() / (turning as f64 / 2.0)).sqrt()
            } else {
                1.0
            }
        };
        let level = spread(0).max(spread(1));
        let scales = [level, level, matrix.column(2).max(), matrix.column(3).abs().mean()];
        if !scales.iter().all(|scale| scale.is_finite() && *scale > 0.0) {
            return None;
        }
        for (mut column, scale) in matrix.column_iter_mut().zip(scales) {
            column /= scale;
        }
        Some(Self { matrix })
    }

    /// Commands of PX4's motors for torques and downward thrust, in 0..1.
    fn commands(&self, control: [f64; 4]) -> [f64; 4] {
        (self.matrix * nalgebra::Vector4::from(control)).map(|command| command.clamp(0.0, 1.0)).into()
    }
}

/// Commands of PX4's motors that were rebuilt.
pub(super) struct Rebuilt {
    pub(super) t: Vec<f64>,
    pub(super) commands: [Vec<f64>; 4],
    /// Least correlation of a motor's rebuilt with its logged commands.
    pub(super) correlation: f64,
    /// Root mean square of their differences.
    pub(super) error: f64,
    /// Samples that both have.
    pub(super) compared: usize,
}

/// Rebuilds commands at the times of the asked torques; `motors` are rows and commands of
/// `actuator_motors`.
/// None where torques and thrust are not logged at least twice as often.
pub(super) fn rebuild(log: &Log, mixer: &Mixer, motors: (&Rows, &[Vec<f64>; 4])) -> Option<Rebuilt> {
    let (rows, logged) = motors;
    let (us, controls) =
        asked(topic(log, "vehicle_torque_setpoint")?, topic(log, "vehicle_thrust_setpoint")?)?;
    if us.len() < 2 * rows.us.len() {
        return None;
    }
    let mut rebuilt: [Vec<f64>; 4] = [const { Vec::new() }; 4];
    let mut pairs: [Vec<(f64, f64)>; 4] = [const { Vec::new() }; 4];
    for (us, control) in us.iter().zip(controls) {
        let commands = mixer.commands(control);
        let place = rows.us.binary_search(us);
        // What was written last before: a motor that is off stays off until the next row.
        let row = place.unwrap_or_else(|next| next.saturating_sub(1));
        for motor in 0..4 {
            let was = logged[motor].get(row).copied().unwrap_or(f64::NAN);
            rebuilt[motor].push(match place {
                Ok(_) => was,
                Err(_) if was.is_finite() => commands[motor],
                Err(_) => f64::NAN,
            });
            if place.is_ok() && was.is_finite() {
                pairs[motor].push((commands[motor], was));
            }
        }
    }
    let compared = pairs.iter().map(Vec::len).min().unwrap_or(0);
    let correlations = pairs.iter().map(|pairs| correlation(pairs));
    let squares = pairs.iter().flatten().map(|(rebuilt, logged)| (rebuilt - logged).powi(2)).sum::<f64>();
    Some(Rebuilt {
        t: us.iter().map(|&us| us as f64 * 1e-6).collect(),
        commands: rebuilt,
        correlation: correlations.fold(1.0, f64::min),
        error: (squares / (4 * compared.max(1)) as f64).sqrt(),
        compared,
    })
}

/// Times at which both torques and thrust were asked for, and what was asked.
fn asked(torques: &Table, thrusts: &Table) -> Option<(Vec<i64>, Vec<[f64; 4]>)> {
    let (torque_rows, thrust_rows) = (Rows::of(torques, &mut Vec::new()), Rows::of(thrusts, &mut Vec::new()));
    let [roll, pitch, yaw] = torque_rows.columns(torques, ["xyz[0]", "xyz[1]", "xyz[2]"])?;
    let [down] = thrust_rows.columns(thrusts, ["xyz[2]"])?;
    let mut asked = (Vec::new(), Vec::new());
    for (row, us) in torque_rows.us.iter().enumerate() {
        let Ok(thrust_row) = thrust_rows.us.binary_search(us) else { continue };
        let control = [roll[row], pitch[row], yaw[row], down[thrust_row]];
        if control.iter().all(|value| value.is_finite()) {
            asked.0.push(*us);
            asked.1.push(control);
        }
    }
    Some(asked)
}

/// Correlation of pairs; 0 where one side stands still.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let count = pairs.len().max(1) as f64;
    let mean_a = pairs.iter().map(|(a, _)| a).sum::<f64>() / count;
    let mean_b = pairs.iter().map(|(_, b)| b).sum::<f64>() / count;
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (a, b) in pairs {
        let (a, b) = (a - mean_a, b - mean_b);
        aa += a * a;
        bb += b * b;
        ab += a * b;
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}
