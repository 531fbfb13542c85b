//! A slung load that no sensor sees: where it must be, from where the craft went.
//!
//! The load's equation is driven by the craft's place alone (`host-sim/model/src/load.rs`), so its swing follows from the
//! log, but for how it swung when the log began, and the tracker's noise and every gust on the load drive it too: a wide swing
//! that is followed for half a minute ends anywhere. It is therefore followed in pieces of some seconds ([`in_pieces`]), and how it
//! swung when a piece began is a nuisance: four numbers, offset and velocity north and east. While they are small they enter
//! linearly, so they are taken out of the residual by a small least squares of their own before anything is judged, with the
//! effect's coefficients as they are; while they are not, the swing is followed again from what was found. A prior keeps them
//! honest: a load swings by some degrees, so a load of next to no mass cannot explain an oscillation by swinging wildly.
//!
//! The pull on the craft goes with its place, and the target of the regression may be the second derivative of the same
//! log: the tracker's noise is in both, and a stiff pendulum without any load would explain it. The place is therefore
//! smoothed over 0.4 s, which leaves a swing (up to 11 rad/s) as it is, and ends where most of a derivative's noise begins.

use std::borrow::Cow;

use model::{Adjustments, Load, Model, Swing, Vehicle};
use nalgebra::{Matrix4, Vector3, Vector4};

use crate::filter::{RegressionFilter, convolve};
use crate::fit::{Residuals, residuals_at_rows, with_beginnings};
use crate::prepare::{Prepared, Stretch, vector};
use crate::rows::RowColumn;

/// Standard deviation of the swing at the beginning, rad.
const SWING_RAD: f64 = 0.15;
/// Times that a piece is followed from where its swing was found to begin.
const FOLLOWED: usize = 4;
/// A change of the beginning up to which the swing is linear in it, rad: of what a wide swing of 0.3 rad adds, it moves
/// the square by 6 parts in 1000 of gravity.
const LARGE_RAD: f64 = 0.02;
/// Share of the load in the craft's mass that is no load.
const NO_LOAD: f64 = 1e-3;
/// Time from one independent value of filtered noise to the next, s.
const INDEPENDENT_S: f64 = 0.1;

/// Part of noise, percent, that the beginnings explain at most: four numbers of the independent values of two axes in a piece.
pub(crate) const BY_CHANCE_PERCENT: f64 = 100.0 * 4.0 * INDEPENDENT_S / (2.0 * PIECE_S);

/// Window over which what drives a load is smoothed, s: it should not share the noise of a derivative, and ends (-3 dB at
/// 26 rad/s) about where that begins.
const DRIVING_WINDOW_S: f64 = 0.4;

/// Mass of the load over that of the craft.
pub(crate) fn share(model: &Model, load: &Load) -> f64 {
    load.mass_kg / (model.vehicle.mass + model.adjustments().extra_mass_kg)
}

/// Length of a piece, s: several swings of a cable of a metre, short enough for a wide swing to be followed.
const PIECE_S: f64 = 4.0;

/// The flight in pieces over which a load's swing is followed, where the model has a load: stretches that overlap by what filters
/// need at their ends, so that the rows are those of the flight, in the same order.
pub(crate) fn in_pieces<'a>(flight: &'a Prepared, model: &Model) -> Cow<'a, Prepared> {
    let stride = flight.fit_stride();
    let of_piece = ((PIECE_S / flight.period_s) as usize / stride).max(1) * stride;
    let rows = |stretch: &Stretch| stretch.time_s.len() - 2 * flight.margin;
    // The last one takes the rest.
    let count = |stretch: &Stretch| ((rows(stretch) + of_piece / 2) / of_piece).max(1);
    if model.adjustments().load.is_none() || flight.stretches.iter().all(|stretch| count(stretch) == 1) {
        return Cow::Borrowed(flight);
    }
    let cut = |stretch: &'a Stretch| {
        let count = count(stretch);
        (0..count).map(move |piece| {
            let end = if piece + 1 == count { rows(stretch) } else { (piece + 1) * of_piece };
            stretch.part(piece * of_piece..end + 2 * flight.margin)
        })
    };
    let stretches = flight.stretches.iter().flat_map(cut).collect();
    Cow::Owned(Prepared { stretches, ..flight.without_stretches() })
}

/// The load over a whole stretch, as its pieces follow it.
pub(crate) fn followed(flight: &Prepared, stretch: &Stretch, model: &Model) -> Vec<Swing> {
    let adjust = model.adjustments();
    let Some(load) = adjust.load else { return Vec::new() };
    let alone = Prepared { stretches: vec![stretch.clone()], ..flight.without_stretches() };
    let pieces = in_pieces(&alone, model);
    let begun = residuals_at_rows(&pieces, model, pieces.fit_stride()).begun;
    let mut swings = Vec::with_capacity(stretch.time_s.len());
    for (index, piece) in pieces.stretches.iter().enumerate() {
        let beginning = begun.get(index).copied().unwrap_or_default();
        let own = driven(&pieces, piece, &model.vehicle, &adjust, &load, &beginning);
        // What the one before it had last belongs to this one's middle.
        swings.truncate(swings.len().saturating_sub(flight.margin));
        let known = if index == 0 { 0 } else { flight.margin };
        swings.extend_from_slice(&own[known..]);
    }
    swings
}

/// The swing of a load when a piece begins: north m, m/s, east m, m/s against the craft.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Beginning {
    /// What it is taken for.
    pub(crate) at: Vector4<f64>,
    /// What would be expected: as the piece before it ends, at rest after a gap.
    pub(crate) expected: Vector4<f64>,
}

/// The load over a stretch.
pub(crate) fn driven(
    flight: &Prepared,
    stretch: &Stretch,
    vehicle: &Vehicle,
    adjust: &Adjustments,
    load: &Load,
    beginning: &Beginning,
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
    load.driven(&places, beginning.at.into(), flight.period_s, vehicle.gravity)
}

/// The two free swings, in place of the load's direction north and east.
pub(crate) fn free(load: &Load, samples: usize, period_s: f64, gravity_m_s2: f64) -> Vec<Swing> {
    let carry = |[offset, velocity]: [f64; 2]| Swing {
        direction: Vector3::new(offset, velocity, 0.0),
        turning_rad_s: Vector3::zeros(),
    };
    load.free(samples, period_s, gravity_m_s2).into_iter().map(carry).collect()
}

/// The load of a model whose swing matters: what it adds goes with its share.
pub(crate) fn carried(model: &Model) -> Option<Load> {
    model.adjustments().load.filter(|load| share(model, load).abs() > NO_LOAD)
}

/// Takes out of a residual what is left to say of the load's swing at the beginning of each piece, `begun` being what it was
/// formed with, and of columns that stand beside it in a fit what it would explain of them. Hands over what was said: the
/// change of each beginning.
pub(crate) fn take_out_beginnings(
    flight: &Prepared,
    model: &Model,
    stride: usize,
    begun: &[Beginning],
    residual: &mut [Vec<f64>; 6],
    beside: &mut [RowColumn],
) -> Vec<Vector4<f64>> {
    match carried(model) {
        Some(load) => take_out(flight, model, (&load, share(model, &load)), stride, begun, residual, beside),
        None => Vec::new(),
    }
}

/// The same for a load of a given share.
pub(crate) fn take_out(
    flight: &Prepared,
    model: &Model,
    (load, share): (&Load, f64),
    stride: usize,
    begun: &[Beginning],
    residual: &mut [Vec<f64>; 6],
    beside: &mut [RowColumn],
) -> Vec<Vector4<f64>> {
    let columns = flight.free_swings(model, load, share, stride);
    let acts = |column: &&mut RowColumn| column[..3].iter().any(Option::is_some);
    let mut beside: Vec<&mut RowColumn> = beside.iter_mut().filter(acts).collect();
    for axis in beside.iter_mut().flat_map(|column| &mut column[..3]) {
        axis.get_or_insert_with(|| vec![0.0; residual[0].len()]);
    }
    let starts = flight.starts_of_rows(stride);
    let variances = usual(model, load).map(|d| d * d);
    let mut changes = Vec::with_capacity(starts.len());
    for (i, &start) in starts.iter().enumerate() {
        let rows = start..starts.get(i + 1).copied().unwrap_or(residual[0].len());
        let squares: f64 = residual[..2].iter().flat_map(|r| &r[rows.clone()]).map(|e| e * e).sum();
        let mean_square = squares / (2.0 * rows.len() as f64).max(1.0);
        // Neighbouring rows repeat each other's noise.
        let noise = mean_square * (INDEPENDENT_S / (flight.period_s * stride as f64)).max(1.0);
        let known = variances.map(|v| noise / v);
        let mut normal = Matrix4::from_diagonal(&known);
        let free: [Vec<Vector4<f64>>; 3] = std::array::from_fn(|axis| {
            let value = |p: usize, k: usize| columns[p][axis].as_ref().map_or(0.0, |column| column[k]);
            rows.clone().map(|k| Vector4::from_fn(|p, _| value(p, k))).collect()
        });
        for row in free.iter().flatten() {
            normal += row * row.transpose();
        }
        let Some(cholesky) = normal.cholesky() else {
            changes.push(Vector4::zeros());
            continue;
        };
        let take_out = |signal: [&mut [f64]; 3], expected: Vector4<f64>| {
            let mut right = known.component_mul(&expected);
            for (free, signal) in free.iter().zip(&signal) {
                right += free.iter().zip(signal.iter()).map(|(f, s)| f * *s).sum::<Vector4<f64>>();
            }
            let beginning = cholesky.solve(&right);
            for (free, signal) in free.iter().zip(signal) {
                free.iter().zip(signal).for_each(|(f, s)| *s -= f.dot(&beginning));
            }
            beginning
        };
        let [u, v, w, ..] = residual;
        let expected = begun.get(i).map_or_else(Vector4::zeros, |begun| begun.expected - begun.at);
        changes.push(take_out([&mut u[rows.clone()], &mut v[rows.clone()], &mut w[rows.clone()]], expected));
        for column in &mut beside {
            if let [Some(u), Some(v), Some(w), ..] = &mut **column {
                let signal = [&mut u[rows.clone()], &mut v[rows.clone()], &mut w[rows.clone()]];
                take_out(signal, Vector4::zeros());
            }
        }
    }
    changes
}

/// Standard deviations of a beginning.
fn usual(model: &Model, load: &Load) -> Vector4<f64> {
    let offset_m = SWING_RAD * load.cable_length_m;
    let velocity_m_s = offset_m * load.stiffness_rad2_s2(model.vehicle.gravity).sqrt();
    Vector4::new(offset_m, velocity_m_s, offset_m, velocity_m_s)
}

/// Whether a change of a beginning is too large for what enters linearly.
fn is_large(model: &Model, load: &Load, change: &Vector4<f64>) -> bool {
    change.component_div(&usual(model, load)).amax() > LARGE_RAD / SWING_RAD
}

/// Residuals of a flight in pieces under a model with a load, each piece from where the one before it ends; `known` are beginnings
/// from elsewhere to go on from.
pub(crate) fn follow(
    flight: &Prepared,
    (model, load): (&Model, &Load),
    stride: usize,
    known: &[Beginning],
) -> Residuals {
    let mut all = Residuals::default();
    let mut goes_on: Option<(f64, Vector4<f64>)> = None;
    for (i, piece) in flight.stretches.iter().enumerate() {
        let alone = Prepared { stretches: vec![piece.clone()], ..flight.without_stretches() };
        let same_time = |time_s: f64| (time_s - piece.time_s[0]).abs() < 0.5 * flight.period_s;
        let expected =
            goes_on.filter(|(time_s, _)| same_time(*time_s)).map_or_else(Vector4::zeros, |(_, at)| at);
        let at = known.get(i).map_or(expected, |known| known.at);
        let (begun, one) = begin(&alone, (model, load), stride, Beginning { at, expected });
        all.append(one);
        let swings = driven(&alone, piece, &model.vehicle, &model.adjustments(), load, &begun);
        let next = piece.time_s.len() - 2 * flight.margin;
        goes_on = swings.get(next).map(|swing| {
            let offset_m = load.cable_length_m * swing.direction;
            let velocity_m_s = load.cable_length_m * swing.turning_rad_s.cross(&swing.direction);
            let at = Vector4::new(offset_m.x, velocity_m_s.x, offset_m.y, velocity_m_s.y);
            (piece.time_s[next], at)
        });
    }
    all
}

/// The beginning of a flight of one piece, from a first guess on, and its residuals.
fn begin(
    alone: &Prepared,
    (model, load): (&Model, &Load),
    stride: usize,
    first: Beginning,
) -> (Beginning, Residuals) {
    let evaluate = |begun: Beginning| {
        let mut residuals = with_beginnings(alone, model, stride, &[begun]);
        let residual = &mut residuals.residual;
        let change = take_out_beginnings(alone, model, stride, &[begun], residual, &mut []).first().copied();
        let left: f64 = residual[..3].iter().flatten().map(|e| e * e).sum();
        (left, begun, change.unwrap_or_default(), residuals)
    };
    let mut best = evaluate(first);
    for _ in 0..FOLLOWED {
        let (left, begun, change, _) = &best;
        if !is_large(model, load, change) {
            break;
        }
        let next = evaluate(Beginning { at: begun.at + change, ..*begun });
        // A swing far beyond the linear may be followed to somewhere worse.
        if !(next.0 < *left) {
            break;
        }
        best = next;
    }
    (best.1, best.3)
}
