//! Motor order and spin: do the motors push where the vehicle file says?
//!
//! Rotor i rolls, pitches and yaws the craft with the signs of its place ([`model`]'s conventions) and its spin. For each
//! of the 24 ways of numbering four motors, the roll and pitch that the rotors would cause are correlated with the
//! measured angular accelerations. Motors are called wrongly numbered only where the numbering as given explains roll or pitch
//! badly and another one clearly explains both. Yaw is judged alone: it follows the spins.
//!
//! Rotors answer late and clocks are off a little: each hypothesis gets the best of several delays.

use flights::Mend;
use model::{Adjustments, Vehicle};
use nalgebra::{Matrix4, SMatrix, Vector3, Vector4};

use crate::filter::sum_of_products;
use crate::prepare::Prepared;

/// Delays beyond the vehicle file's lag that are tried, s.
const DELAYS_S: [f64; 9] = [-0.04, -0.02, 0.0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.12];
/// Sign of each place's roll and pitch moment.
const ROLL: [f64; 4] = [1.0, -1.0, -1.0, 1.0];
const PITCH: [f64; 4] = [1.0, 1.0, -1.0, -1.0];
/// Correlation from which motors clearly turn the craft, and under which they are in doubt.
const CLEAR: f64 = 0.65;
const IN_DOUBT: f64 = 0.5;
/// How much better another numbering has to be.
const BETTER_BY: f64 = 0.3;

/// Products of angular accelerations and rotor thrusts at one delay.
#[derive(Default, Clone, Copy)]
struct Products {
    /// Axis with motor.
    cross: SMatrix<f64, 3, 4>,
    motors: Matrix4<f64>,
    /// Squares.
    turns: Vector3<f64>,
}

impl Products {
    /// Correlation of an axis with a sum of rotor thrusts of given signs.
    fn correlation(&self, axis: usize, signs: [f64; 4]) -> f64 {
        let signs = Vector4::from(signs);
        let cross = self.cross.row(axis).transpose().dot(&signs);
        let square = signs.dot(&(self.motors * signs));
        cross / (square * self.turns[axis]).sqrt().max(f64::MIN_POSITIVE)
    }
}

/// Motors that are numbered or spin otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct MotorFault {
    /// For people: what is wrong and how to mend it.
    pub sentence: String,
    /// The order that mends it; nothing where it is the vehicle file's spin that is wrong.
    pub mend: Option<Mend>,
}

/// What is wrong if the motors of a flight are numbered or spin otherwise than `vehicle` says.
pub fn check(flight: &Prepared, vehicle: &Vehicle) -> Option<MotorFault> {
    let delays: Vec<Products> = DELAYS_S.iter().map(|d| products(flight, vehicle, *d)).collect();
    // `place[k]` is where the motor of cmd k+1 sits.
    let score = |place: [usize; 4]| -> (f64, &Products) {
        let worse = |p: &Products| {
            let roll = p.correlation(0, place.map(|i| ROLL[i]));
            let pitch = p.correlation(1, place.map(|i| PITCH[i]));
            roll.min(pitch)
        };
        let best = delays.iter().map(|p| (worse(p), p));
        best.max_by(|a, b| a.0.total_cmp(&b.0)).expect("there are delays")
    };
    let (as_given, at) = score([0, 1, 2, 3]);
    if as_given < IN_DOUBT {
        let best = orders().into_iter().map(|o| (score(o).0, o)).max_by(|a, b| a.0.total_cmp(&b.0))?;
        return (best.0 > CLEAR.max(as_given + BETTER_BY)).then(|| order_fault(best.1));
    }
    let spin = vehicle.motors.spin.map(|s| s.yaw_sign());
    let yaw = at.correlation(2, spin);
    (as_given > CLEAR && yaw < -CLEAR).then(|| MotorFault {
        sentence:
            "the motors yaw the craft opposite to [motors] spin in the vehicle file: exchange \"ccw\" and \
         \"cw\" there"
                .into(),
        mend: None,
    })
}

fn order_fault(place: [usize; 4]) -> MotorFault {
    let number = |seat: usize| 1 + place.iter().position(|p| *p == seat).unwrap_or(seat);
    let order = [0, 1, 2, 3].map(number);
    MotorFault { sentence: order_sentence(place), mend: Some(Mend::MotorOrder(order)) }
}

fn order_sentence(place: [usize; 4]) -> String {
    const NAMES: [&str; 4] = ["1 (front-left)", "2 (front-right)", "3 (rear-right)", "4 (rear-left)"];
    let of = |cmd: usize| format!("cmd{} of motor {}", cmd + 1, NAMES[place[cmd]]);
    format!(
        "the motors are in another order: judging by the roll and pitch they cause, {}, {}, {} and {}; put the columns \
         cmd1..4 (and omega1..4) in the order front-left, front-right, rear-right, rear-left",
        of(0),
        of(1),
        of(2),
        of(3)
    )
}

/// The 24 orders of four.
fn orders() -> Vec<[usize; 4]> {
    let mut all = Vec::with_capacity(24);
    for a in 0..4 {
        for b in (0..4).filter(|b| *b != a) {
            for c in (0..4).filter(|c| *c != a && *c != b) {
                all.push([a, b, c, 6 - a - b - c]);
            }
        }
    }
    all
}

fn products(flight: &Prepared, vehicle: &Vehicle, delay_s: f64) -> Products {
    let mut sum = Products::default();
    let half = flight.filter.half();
    let shift = (delay_s / flight.period_s).round() as isize;
    let stride = ((0.03 / flight.period_s).round() as usize).max(1);
    let mut rows: Vec<(Vector3<f64>, Vector4<f64>)> = Vec::new();
    for stretch in &flight.stretches {
        let squares = stretch
            .rotors(vehicle, &Adjustments::default(), flight.period_s, flight.rotor_late_s())
            .map(|r| r.mean_rad_s.iter().map(|w| w * w).collect::<Vec<f64>>());
        for k in (half..stretch.time_s.len().saturating_sub(half + 1)).step_by(stride) {
            let start = k as isize - half as isize - shift;
            if start < 0 || start as usize + flight.filter.between.len() > squares[0].len() {
                continue;
            }
            let turns = stretch
                .rate_rad_s
                .each_ref()
                .map(|r| sum_of_products(&r[k - half..], &flight.filter.derivative));
            let thrusts =
                squares.each_ref().map(|s| sum_of_products(&s[start as usize..], &flight.filter.between));
            rows.push((turns.into(), thrusts.into()));
        }
    }
    let count = rows.len().max(1) as f64;
    let mean_turn = rows.iter().map(|(turn, _)| turn).sum::<Vector3<f64>>() / count;
    let mean_thrust = rows.iter().map(|(_, thrust)| thrust).sum::<Vector4<f64>>() / count;
    for (turn, thrust) in &rows {
        let (a, b) = (turn - mean_turn, thrust - mean_thrust);
        sum.cross += a * b.transpose();
        sum.motors += b * b.transpose();
        sum.turns += a.component_mul(&a);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checks::channels::COMMANDS;
    use crate::testing::{NONE, fly, truth};

    /// A flight whose column cmd k+1 is that of the motor at `place[k]`.
    fn numbered(place: [usize; 4]) -> Prepared {
        let model = truth();
        let mut flight = fly(&model, 3, 20.0, &NONE);
        let commands = COMMANDS.map(|c| flight.required(c).to_vec());
        for (column, from) in COMMANDS.into_iter().zip(place) {
            flight.replace(column, commands[from].clone());
        }
        Prepared::new(&flight, &model.vehicle).unwrap()
    }

    #[test]
    fn the_24_orders_of_four_motors_are_all_different() {
        let orders = orders();
        assert_eq!(orders.len(), 24);
        for (k, order) in orders.iter().enumerate() {
            let mut sorted = *order;
            sorted.sort_unstable();
            assert_eq!(sorted, [0, 1, 2, 3]);
            assert!(!orders[..k].contains(order), "{order:?}");
        }
    }

    #[test]
    fn motors_as_the_vehicle_file_says_are_no_fault() {
        assert_eq!(check(&numbered([0, 1, 2, 3]), &truth().vehicle), None);
    }

    #[test]
    fn another_numbering_is_found_and_named() {
        for place in [[1, 0, 3, 2], [3, 0, 1, 2], [2, 1, 0, 3]] {
            let sentence = check(&numbered(place), &truth().vehicle);
            assert_eq!(sentence, Some(order_fault(place)), "{place:?}");
        }
    }

    #[test]
    fn the_sentence_says_which_motor_every_command_drives() {
        assert_eq!(
            order_sentence([3, 0, 1, 2]),
            "the motors are in another order: judging by the roll and pitch they cause, cmd1 of motor 4 \
             (rear-left), cmd2 of motor 1 (front-left), cmd3 of motor 2 (front-right) and cmd4 of motor 3 \
             (rear-right); put the columns cmd1..4 (and omega1..4) in the order front-left, front-right, \
             rear-right, rear-left"
        );
    }

    #[test]
    fn rotors_that_turn_the_other_way_are_told_from_the_yaw() {
        let mut vehicle = truth().vehicle;
        let spin = &mut vehicle.motors.spin;
        spin.rotate_left(1);
        assert_eq!(
            check(&numbered([0, 1, 2, 3]), &vehicle).unwrap().sentence,
            "the motors yaw the craft opposite to [motors] spin in the vehicle file: \
             exchange \"ccw\" and \"cw\" there"
        );
    }

    /// Two rows, thrusts (1, 0, 0, 0) and (0, 1, 0, 0), that roll the craft by 3 and -4.
    #[test]
    fn the_correlation_of_products_is_that_of_the_rows() {
        let mut products = Products::default();
        for (turn, motor) in [(3.0, 0), (-4.0, 1)] {
            let mut thrust = Vector4::zeros();
            thrust[motor] = 1.0;
            products.cross += Vector3::new(turn, 0.0, 0.0) * thrust.transpose();
            products.motors += thrust * thrust.transpose();
            products.turns.x += turn * turn;
        }
        // (3, -4) with (1, -1) over sqrt(25 * 2), with (1, 1) over the same.
        assert!((products.correlation(0, ROLL) - 7.0 / 50.0_f64.sqrt()).abs() < 1e-12);
        assert!((products.correlation(0, PITCH) + 1.0 / 50.0_f64.sqrt()).abs() < 1e-12);
        assert_eq!(Products::default().correlation(0, ROLL), 0.0);
    }
}
