//! Has the offset of an accelerometer changed, or does a force push the craft that was not there before?
//!
//! What an accelerometer tells along the body all the time is taken out of a flight as its offset, and a rotor that leans pushes the craft that
//! way too. Against the tracker's body axes ([`tracker_mount`](crate::tracker_mount)) the two differ: an offset looks like a turn of them, and a
//! force does not, for it moves the craft that the tracker sees.

use model::{ConstantForceRecord, FitRecord, Model};
use report::number::fixed;
use sysid::Prepared;
use sysid::checks::accelerometer_offset::{self, ConstantForce};

use crate::motor_answers::mean_and_deviation;
use crate::tracker_mount::{each_axis, mean_error, mounts};

/// Standard deviations between flights from which on it is another one.
const DEVIATIONS: f64 = 6.0;
/// Least deviation between flights: an accelerometer's offset changes by so much from day to day, m/s^2.
const LEAST_M_S2: f64 = 0.015;
/// Largest part of a change that the tracker may see as a turn.
const OFFSET_PART: f64 = 0.25;
/// Fewest flights of a model that tell a deviation.
const FEWEST: usize = 4;

/// What the accelerometer told in the flights of a model; nothing where these do not tell.
pub(crate) fn record(flights: &[&Prepared]) -> Option<ConstantForceRecord> {
    let all = forces(flights);
    if all.len() < FEWEST {
        return None;
    }
    let along = each_axis(&all, |of| of.value_m_s2, mean_and_deviation);
    Some(ConstantForceRecord { force_m_s2: along.map(|of| of.0), force_deviation_m_s2: along.map(|of| of.1) })
}

fn forces(flights: &[&Prepared]) -> Vec<ConstantForce> {
    flights.iter().filter_map(|flight| accelerometer_offset::constant_force(flight)).collect()
}

/// The part of what was taken out of new flights as an offset that is a force, along x and y of the body, m/s^2; zero where there is none, or
/// the model's flights do not tell.
pub(crate) fn taken_for_offset(model: &Model, flights: &[&Prepared]) -> [f64; 2] {
    force(model, flights).unwrap_or([0.0; 2])
}

fn force(model: &Model, flights: &[&Prepared]) -> Option<[f64; 2]> {
    let fit: &FitRecord = model.fit.as_ref()?;
    let (was, was_mounted) = fit.constant_force.zip(fit.tracker_mount)?;
    let (forces, mounts) = (forces(flights), mounts(model, flights));
    if forces.is_empty() || mounts.is_empty() {
        return None;
    }
    let now_m_s2 = each_axis(&forces, |of| of.value_m_s2, mean_and_deviation).map(|of| of.0);
    let error_m_s2 = each_axis(&forces, |of| of.error_m_s2, mean_error);
    let now_tilt_rad = each_axis(&mounts, |of| of.tilt_rad, mean_and_deviation).map(|of| of.0);
    let turned_rad = [0, 1].map(|k| now_tilt_rad[k] - was_mounted.tilt_rad[k]);
    let changed_m_s2 = [0, 1].map(|k| {
        let usual_m_s2 = was.force_deviation_m_s2[k].max(LEAST_M_S2).hypot(error_m_s2[k]);
        (now_m_s2[k] - was.force_m_s2[k], DEVIATIONS * usual_m_s2)
    });
    beside_offset(changed_m_s2, turned_rad, model.vehicle.gravity)
}

/// What of a change is no offset: changes, each with that from which on it counts, and by how much the tracked body axes have turned. An offset of
/// `b` turns them by b_y / g about x and by -b_x / g about y.
fn beside_offset(changed_m_s2: [(f64, f64); 2], turned_rad: [f64; 2], gravity_m_s2: f64) -> Option<[f64; 2]> {
    let offset_m_s2 = [-gravity_m_s2 * turned_rad[1], gravity_m_s2 * turned_rad[0]];
    let [x, y] = changed_m_s2.map(|of| of.0);
    let counts = changed_m_s2.iter().any(|(change, least)| change.abs() > *least);
    let is_force = offset_m_s2[0].hypot(offset_m_s2[1]) < OFFSET_PART * x.hypot(y);
    (counts && is_force).then(|| [x - offset_m_s2[0], y - offset_m_s2[1]])
}

/// Puts a force back that was taken out of a flight as an offset, and says so in its notes.
pub(crate) fn put_back(flight: &mut Prepared, force_m_s2: [f64; 2]) {
    if force_m_s2 != [0.0; 2] && accelerometer_offset::put_back(flight, force_m_s2) {
        let [x, y] = force_m_s2.map(|of| fixed(of, 2));
        flight.notes.push(format!(
            "a new constant force of {x} m/s^2 forward and {y} m/s^2 right is no accelerometer bias: the tracker shows it too"
        ));
    }
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};
    use model::{Effect, frames};
    use nalgebra::Vector3;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::testing::{NONE, fly, truth};
    use crate::workflow::{FlightSets, FlightsOfOneKind, Reading, Silent, changed};
    use crate::{Change, Diagnosis, Options};

    const POSITION: [Column; 3] = [Column::X, Column::Y, Column::Z];
    const ATTITUDE: [Column; 3] = [Column::Phi, Column::Theta, Column::Psi];

    /// A flight with an accelerometer that is off by so much: what moves the tracked point, along the body, and ordinary noise.
    fn flown(model: &Model, seed: u64, offset_m_s2: [f64; 2]) -> Flight {
        let mut flight = fly(model, seed, 40.0, &NONE);
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut noise = |size: f64| size * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
        let [position, attitude] =
            [POSITION, ATTITUDE].map(|group| group.map(|column| flight.required(column).to_vec()));
        let count = position[0].len();
        let felt: Vec<[f64; 3]> = (0..count)
            .map(|row| {
                let k = row.clamp(1, count - 2);
                let at = |k: usize| Vector3::from(position.each_ref().map(|axis| axis[k]));
                let acceleration = (at(k + 1) - 2.0 * at(k) + at(k - 1)) / (0.01 * 0.01);
                let angles = attitude.each_ref().map(|axis| axis[k]);
                let force =
                    frames::dcm_from_euler(angles.into()) * (acceleration - Vector3::new(0.0, 0.0, 9.81));
                let told = force + Vector3::new(offset_m_s2[0], offset_m_s2[1], 0.0);
                std::array::from_fn(|axis| told[axis] + noise(0.05))
            })
            .collect();
        for (axis, column) in [Column::Ax, Column::Ay, Column::Az].into_iter().enumerate() {
            flight.replace(column, felt.iter().map(|felt| felt[axis]).collect());
        }
        for (columns, size) in [(POSITION, 2.5e-4), (ATTITUDE, 7e-4)] {
            for column in columns {
                let noisy = flight.required(column).iter().map(|value| value + noise(size)).collect();
                flight.replace(column, noisy);
            }
        }
        flight
    }

    /// What has changed in two flights of `craft`, since the flights of `truth` with an offset of its own.
    fn said_of(craft: &Model, offset_m_s2: [f64; 2]) -> (Diagnosis, Vec<String>) {
        let before = [1, 2, 3, 4].map(|seed| flown(&truth(), seed, [0.05, -0.03]));
        let (train, held_out) = before.split_at(3);
        let vehicle = &craft.vehicle;
        let sets = FlightSets::from_flights(train, held_out, vehicle, Reading::default(), &Silent).unwrap();
        let effects = truth().effects();
        let mut model = sysid::fit(&sets.train(), vehicle, &effects, None).unwrap().model;
        model.fit = Some(sets.record(&model, Vec::new()));
        sets.record_for_changes(&mut model);
        let new = [5, 6].map(|seed| flown(craft, seed, offset_m_s2));
        let mut new = FlightsOfOneKind::from_flights(&new, vehicle, Reading::default(), &Silent).unwrap();
        let said = changed(&model, &[], &mut new, &Options::default(), &Silent).unwrap();
        (said, new.prepared()[0].notes.clone())
    }

    /// Motor 3 (rear right) leans by 5 deg to the front right, across its arm; at a quarter of the thrust, that is 0.15 m/s^2 along each axis,
    /// and this motor ends up with more than a quarter.
    #[test]
    fn a_bent_arm_is_named_although_its_push_was_taken_for_an_offset() {
        let mut bent = truth();
        let thrust = bent.term(Effect::Thrust).unwrap().values()[0];
        let push = 5.0_f64.to_radians().tan() * thrust * std::f64::consts::FRAC_1_SQRT_2;
        let change = Change { effect: Effect::MotorTilt, motor: Some(3) };
        let mut coefficients = vec![0.0; Effect::MotorTilt.info().coefficients.len()];
        let [x_m, y_m] = bent.vehicle.hubs_m()[2];
        let yaw_inertia_kg_m2 = 0.024;
        let turn = (x_m - y_m) * push / (bent.vehicle.rotor_radius * yaw_inertia_kg_m2);
        for (place, value) in change.coefficients().into_iter().zip([push, push, turn]) {
            coefficients[place] = value;
        }
        bent.set(Effect::MotorTilt, &coefficients);
        let (said, notes) = said_of(&bent, [0.05, -0.03]);
        assert_eq!(said.effects[0].effect, Effect::MotorTilt, "{}", said.summary);
        assert!(
            said.summary.contains("motor 3 (rear right) is tilted by 5.0 deg toward the front right"),
            "{}",
            said.summary
        );
        assert!(
            notes.iter().any(|note| note.contains("a new constant force of 0.17 m/s^2 forward")),
            "{notes:?}"
        );
    }

    /// Another sensor, and another wind.
    #[test]
    fn what_pushes_nobody_along_the_body_stays_an_offset() {
        let mut windy = truth();
        windy.set(Effect::SteadyWind, &[2.0, -2.5]);
        let cases = [(truth(), [0.25, -0.13], None), (windy, [0.05, -0.03], Some(Effect::SteadyWind))];
        for (craft, offset_m_s2, changed) in cases {
            let (said, notes) = said_of(&craft, offset_m_s2);
            assert_eq!(said.best(), changed, "{}", said.summary);
            assert!(!notes.iter().any(|note| note.contains("constant force")), "{notes:?}");
        }
    }

    #[test]
    fn a_force_is_what_the_tracker_does_not_see_as_a_turn() {
        let changed = [(0.2, 0.09), (-0.1, 0.09)];
        assert_eq!(beside_offset(changed, [0.0; 2], 10.0), Some([0.2, -0.1]));
        let beside = beside_offset(changed, [0.002, -0.003], 10.0).unwrap();
        assert!((beside[0] - 0.17).abs() < 1e-12 && (beside[1] + 0.12).abs() < 1e-12, "{beside:?}");
        // An accelerometer that was turned or has another offset, by -0.1 m/s^2 to the right and 0.2 forward.
        assert_eq!(beside_offset(changed, [-0.01, -0.02], 10.0), None);
        assert_eq!(beside_offset([(0.05, 0.09), (0.08, 0.09)], [0.0; 2], 10.0), None);
    }
}
