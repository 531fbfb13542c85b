//! A slung load that no sensor sees: where it must be, from where the craft went.
//!
//! The load's equation is driven by the craft's place alone (`host-sim/model/src/load.rs`), so its swing follows from the
//! log, but for how it swung when the log (or a stretch of it without gaps) began. That is a nuisance: four numbers a
//! stretch, offset and velocity north and east. They enter linearly, so they are taken out of the residual by a small least
//! squares of their own before anything is judged, with the effect's coefficients as they are. A prior keeps them honest: a
//! load swings by some degrees, so a load of next to no mass cannot explain an oscillation by swinging wildly.
//!
//! The pull on the craft goes with its place, and the target of the regression may be the second derivative of the same
//! log: the tracker's noise is in both, and a stiff pendulum without any load would explain it. The place is therefore
//! smoothed over 0.4 s, which leaves a swing (up to 11 rad/s) as it is, and ends where most of a derivative's noise begins.

use model::{Adjustments, Load, Model, Swing, Vehicle};
use nalgebra::{Matrix4, Vector3, Vector4};

use crate::filter::{RegressionFilter, convolve};
use crate::prepare::{Prepared, Stretch, vector};
use crate::rows::RowColumn;

/// Standard deviation of the swing at the beginning, rad.
const SWING_RAD: f64 = 0.15;
/// Share of the load in the craft's mass that is no load.
const NO_LOAD: f64 = 1e-3;
/// Time from one independent value of filtered noise to the next, s.
const INDEPENDENT_S: f64 = 0.1;

/// Window over which what drives a load is smoothed, s: it should not share the noise of a derivative, and ends (-3 dB at
/// 26 rad/s) about where that begins.
const DRIVING_WINDOW_S: f64 = 0.4;

/// Mass of the load over that of the craft.
pub(crate) fn share(model: &Model, load: &Load) -> f64 {
    load.mass_kg / (model.vehicle.mass + model.adjustments().extra_mass_kg)
}

/// The load over a stretch, moving with the craft at first.
pub(crate) fn driven(
    flight: &Prepared,
    stretch: &Stretch,
    vehicle: &Vehicle,
    adjust: &Adjustments,
    load: &Load,
) -> Vec<Swing> {
    let lever_m = Vector3::from(vehicle.tracked_point) + adjust.tracked_point_m;
    let place = |k: usize| {
        let tracked = vector(&stretch.position_ned_m, k);
        tracked - adjust.true_dcm(&stretch.dcm[k]).tr_mul(&lever_m)
    };
    let raw: Vec<Vector3<f64>> = (0..stretch.time_s.len()).map(place).collect();
    let taps = RegressionFilter::smoothing_taps(flight.period_s, DRIVING_WINDOW_S);
    let smooth: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let signal: Vec<f64> = raw.iter().map(|place| place[axis]).collect();
        convolve(&signal, &taps, |k| signal[k])
    });
    let places: Vec<Vector3<f64>> = (0..raw.len()).map(|k| vector(&smooth, k)).collect();
    load.driven(&places, flight.period_s, vehicle.gravity)
}

/// The two free swings, in place of the load's direction north and east.
pub(crate) fn free(load: &Load, samples: usize, period_s: f64, gravity_m_s2: f64) -> Vec<Swing> {
    let carry = |[offset, velocity]: [f64; 2]| Swing {
        direction: Vector3::new(offset, velocity, 0.0),
        turning_rad_s: Vector3::zeros(),
    };
    load.free(samples, period_s, gravity_m_s2).into_iter().map(carry).collect()
}

/// Takes out of a residual what the load's swing at the beginning of each stretch explains, and of columns that stand beside
/// it in a fit what it would explain of them.
pub(crate) fn take_out_beginnings(
    flight: &Prepared,
    model: &Model,
    stride: usize,
    residual: &mut [Vec<f64>; 6],
    beside: &mut [RowColumn],
) {
    // What the beginning adds goes with the square of the share: a search that starts from none need not ask.
    let Some(load) = model.adjustments().load.filter(|load| share(model, load).abs() > NO_LOAD) else {
        return;
    };
    let columns = flight.free_swings(model, &load, stride);
    let acts = |column: &&mut RowColumn| column[..3].iter().any(Option::is_some);
    let mut beside: Vec<&mut RowColumn> = beside.iter_mut().filter(acts).collect();
    for axis in beside.iter_mut().flat_map(|column| &mut column[..3]) {
        axis.get_or_insert_with(|| vec![0.0; residual[0].len()]);
    }
    let starts = flight.starts_of_rows(stride);
    let offset_m = SWING_RAD * load.cable_length_m;
    let velocity_m_s = offset_m * load.stiffness_rad2_s2(model.vehicle.gravity).sqrt();
    let variances = Vector4::new(offset_m, velocity_m_s, offset_m, velocity_m_s).map(|d| d * d);
    for (i, &start) in starts.iter().enumerate() {
        let rows = start..starts.get(i + 1).copied().unwrap_or(residual[0].len());
        let squares: f64 = residual[..2].iter().flat_map(|r| &r[rows.clone()]).map(|e| e * e).sum();
        let mean_square = squares / (2.0 * rows.len() as f64).max(1.0);
        // Neighbouring rows repeat each other's noise.
        let noise = mean_square * (INDEPENDENT_S / (flight.period_s * stride as f64)).max(1.0);
        let mut normal = Matrix4::from_diagonal(&variances.map(|v| noise / v));
        let free: [Vec<Vector4<f64>>; 3] = std::array::from_fn(|axis| {
            let value = |p: usize, k: usize| columns[p][axis].as_ref().map_or(0.0, |column| column[k]);
            rows.clone().map(|k| Vector4::from_fn(|p, _| value(p, k))).collect()
        });
        for row in free.iter().flatten() {
            normal += row * row.transpose();
        }
        let Some(cholesky) = normal.cholesky() else { continue };
        let take_out = |signal: [&mut [f64]; 3]| {
            let mut right = Vector4::zeros();
            for (free, signal) in free.iter().zip(&signal) {
                right += free.iter().zip(signal.iter()).map(|(f, s)| f * *s).sum::<Vector4<f64>>();
            }
            let beginning = cholesky.solve(&right);
            for (free, signal) in free.iter().zip(signal) {
                free.iter().zip(signal).for_each(|(f, s)| *s -= f.dot(&beginning));
            }
        };
        let [u, v, w, ..] = residual;
        take_out([&mut u[rows.clone()], &mut v[rows.clone()], &mut w[rows.clone()]]);
        for column in &mut beside {
            if let [Some(u), Some(v), Some(w), ..] = &mut **column {
                take_out([&mut u[rows.clone()], &mut v[rows.clone()], &mut w[rows.clone()]]);
            }
        }
    }
}
