//! A flight under a model but for its load's pull: what loads are tried on.
//!
//! The pull on the craft goes with its place, and the target of the regression may be the second derivative of the same
//! log: the tracker's noise is in both, and a stiff pendulum without any load would explain it. The place is therefore
//! smoothed over 0.4 s, which leaves a swing (up to 11 rad/s) as it is, and ends where most of a derivative's noise begins.

use std::ops::Range;

use model::{Model, Pendulum};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3, Vector4};

use crate::filter::{RegressionFilter, convolve, sum_of_products};
use crate::fit::pieces::{INDEPENDENT_S, Piece, pieces};
use crate::fit::predicted::measured_less_predicted;
use crate::fit::slung_load::Carried;
use crate::prepare::{ForceTarget, Prepared, Stretch, vector};

/// Window over which what drives a load is smoothed, s: it should not share the noise of a derivative, and ends (-3 dB at
/// 26 rad/s) about where that begins.
const DRIVING_WINDOW_S: f64 = 0.4;
/// Pieces through which a load is followed at once.
const SIDE_BY_SIDE: usize = 4;

/// The swing of a load when a piece begins: north m, m/s, east m, m/s against the craft.
#[derive(Debug, Clone, Copy, Default)]
pub struct Beginning {
    /// What it is taken for.
    pub at: Vector4<f64>,
    /// What would be expected: as the piece before it ends, at rest after a gap.
    pub(crate) expected: Vector4<f64>,
}

/// A flight under a model but for its load's pull, and where that acts: what loads are tried on.
#[derive(Debug, Clone)]
pub(crate) struct Unloaded {
    pub(crate) pieces: Vec<Piece>,
    period_s: f64,
    pub(crate) stride: usize,
    pub(crate) margin: usize,
    /// Where the craft is at the samples of each stretch, smoothed, inertial m.
    places_m: Vec<Vec<Vector3<f64>>>,
    /// Specific force of everything but the cable, inertial m/s^2, where regressors are formed.
    force_ned_m_s2: Vec<Vec<Vector3<f64>>>,
    /// Inertial to body at the rows.
    pub(crate) dcm: Vec<Matrix3<f64>>,
    /// The same at the samples of each stretch, where forces are filtered in body axes.
    body_dcm: Option<Vec<Vec<Matrix3<f64>>>>,
    taps: Vec<f64>,
    /// Targets of the six rows.
    pub(crate) measured: [Vec<f64>; 6],
    /// Measured less what everything but the load's pull predicts.
    pub(crate) residual: [Vec<f64>; 6],
}

impl Unloaded {
    /// Over the rows at every `stride`th sample.
    pub(crate) fn new(flight: &Prepared, model: &Model, stride: usize) -> Self {
        let (measured, residual) = measured_less_predicted(flight, model, stride);
        let pieces = pieces(flight, stride);
        let body_dcm = body_dcm(flight, model);
        let rows = |piece: &Piece| {
            let dcm = &body_dcm[piece.stretch];
            let row = piece.samples.start + flight.margin..piece.samples.end - flight.margin;
            row.step_by(stride).map(|k| dcm[k])
        };
        let dcm = pieces.iter().flat_map(rows).collect();
        Self {
            period_s: flight.period_s,
            stride,
            margin: flight.margin,
            places_m: places_m(flight, model, &body_dcm),
            force_ned_m_s2: flight.predicted_forces_ned_m_s2(model),
            dcm,
            body_dcm: (flight.force_target == ForceTarget::Imu).then_some(body_dcm),
            taps: flight.force_taps(),
            pieces,
            measured,
            residual,
        }
    }

    /// Rows at which pieces begin and the last one ends.
    pub(crate) fn rows_of_pieces(&self) -> impl Iterator<Item = Range<usize>> {
        self.pieces.iter().map(|piece| piece.rows.clone())
    }

    /// Inertial to body at the rows.
    pub(crate) fn dcm(&self) -> &[Matrix3<f64>] {
        &self.dcm
    }

    /// The load over a piece.
    pub(crate) fn driven(&self, piece: &Piece, carried: &Carried, beginning: &Vector4<f64>) -> Vec<Pendulum> {
        let places = &self.places_m[piece.stretch][piece.samples.clone()];
        carried.load.driven(places, (*beginning).into(), self.period_s, carried.gravity_m_s2)
    }

    /// What a load pulls the craft with at the rows of a piece, for each part of a force along the cable that moves it, body m/s^2.
    pub(crate) fn pull(&self, piece: &Piece, carried: &Carried, swings: &[Pendulum]) -> [Vec<f64>; 3] {
        let length_m = carried.load.cable_length_m;
        let forces = &self.force_ned_m_s2[piece.stretch][piece.samples.start..];
        let along = |swing: &Pendulum, force: &Vector3<f64>| {
            let n = swing.direction;
            n * (length_m * swing.turning_rad_s.norm_squared() - n.dot(force))
        };
        let mut signal: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(swings.len()));
        let mut push = |pull: Vector3<f64>| signal.iter_mut().zip(pull.iter()).for_each(|(s, p)| s.push(*p));
        match &self.body_dcm {
            Some(dcm) => {
                let dcm = &dcm[piece.stretch][piece.samples.start..];
                swings.iter().zip(forces).zip(dcm).for_each(|((s, f), dcm)| push(dcm * along(s, f)));
            }
            None => {
                let between = swings.windows(2).map(|pair| pair[0].middle(&pair[1]));
                between.zip(forces).for_each(|(s, f)| push(along(&s, f)));
            }
        }
        let mut pull: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(piece.rows.len()));
        for (i, dcm) in self.dcm[piece.rows.clone()].iter().enumerate() {
            let first = self.margin + i * self.stride - self.taps.len() / 2;
            let filtered = signal.each_ref().map(|s| sum_of_products(&s[first..], &self.taps));
            let filtered = Vector3::from(filtered);
            let body = if self.body_dcm.is_some() { filtered } else { dcm * filtered };
            pull.iter_mut().zip(body.iter()).for_each(|(pull, b)| pull.push(*b));
        }
        pull
    }

    /// What a load pulls with from given beginnings of the pieces (hanging still, where there are none), for each part of a force along
    /// the cable that moves it, body m/s^2.
    pub(crate) fn pull_from(
        &self,
        carried: &Carried,
        begun: &[Beginning],
    ) -> ([Vec<f64>; 3], Vec<Matrix2<f64>>) {
        let mut all: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(self.dcm.len()));
        let mut ends = Vec::with_capacity(self.pieces.len());
        for (group, pieces) in self.pieces.chunks(SIDE_BY_SIDE).enumerate() {
            let swings = self.driven_side_by_side(pieces, carried, begun.get(group * SIDE_BY_SIDE..));
            for (piece, swings) in pieces.iter().zip(&swings) {
                let of_piece = self.pull(piece, carried, swings);
                all.iter_mut().zip(of_piece).for_each(|(all, pull)| all.extend(pull));
                ends.push(self.end(piece, carried, swings));
            }
        }
        (all, ends)
    }

    /// The load over some pieces, at most [`SIDE_BY_SIDE`].
    fn driven_side_by_side(
        &self,
        pieces: &[Piece],
        carried: &Carried,
        begun: Option<&[Beginning]>,
    ) -> [Vec<Pendulum>; SIDE_BY_SIDE] {
        let ways = std::array::from_fn(|k| {
            let at = begun.and_then(|begun| begun.get(k)).map_or_else(Vector4::zeros, |begun| begun.at);
            let places = pieces.get(k).map_or(&[][..], |p| &self.places_m[p.stretch][p.samples.clone()]);
            (places, at.into())
        });
        carried.load.driven_side_by_side(ways, self.period_s, carried.gravity_m_s2)
    }

    /// How a load swings where the next piece begins: offset m and velocity m/s, north and east.
    pub(crate) fn end(&self, piece: &Piece, carried: &Carried, swings: &[Pendulum]) -> Matrix2<f64> {
        swings.get(piece.samples.len() - 2 * self.margin).map_or_else(Matrix2::zeros, |swing| {
            let offset_m = carried.load.cable_length_m * swing.direction;
            let velocity_m_s = carried.load.cable_length_m * swing.turning_rad_s.cross(&swing.direction);
            Matrix2::new(offset_m.x, offset_m.y, velocity_m_s.x, velocity_m_s.y)
        })
    }

    /// What becomes of a small swing by the beginning of the next piece.
    pub(crate) fn carries_on(&self, piece: &Piece, carried: &Carried) -> Matrix2<f64> {
        let time_s = self.period_s * (piece.samples.len() - 2 * self.margin) as f64;
        carried.load.free_motion(time_s, carried.gravity_m_s2)
    }

    /// What a load's free swing adds at the rows of a piece in the direction in which it swings, from an offset of 1 m and from 1 m/s,
    /// m/s^2: the same in all pieces, but for their length.
    pub(crate) fn free_swings(&self, carried: &Carried) -> [Vec<f64>; 2] {
        let Carried { load, share, gravity_m_s2, .. } = carried;
        let longest = self.pieces.iter().max_by_key(|piece| piece.rows.len());
        let (samples, rows) = longest.map_or((0, 0), |piece| (piece.samples.len(), piece.rows.len()));
        let pull = share * load.stiffness_rad2_s2(*gravity_m_s2);
        let offsets = load.free(samples, self.period_s, *gravity_m_s2);
        std::array::from_fn(|solution| {
            let at: Vec<f64> = offsets.iter().map(|offset_m| pull * offset_m[solution]).collect();
            let between = || at.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
            let signal = if self.body_dcm.is_some() { at.clone() } else { between() };
            let first = |row: usize| self.margin + row * self.stride - self.taps.len() / 2;
            (0..rows).map(|row| sum_of_products(&signal[first(row)..], &self.taps)).collect()
        })
    }

    /// What is known of the beginning of a piece before its rows are looked at: the variance of the noise over those of offset and
    /// velocity. The noise is what is left on the two sideways axes, `squares` in all.
    pub(crate) fn known(&self, squares: f64, rows: usize, carried: &Carried, angle_rad: f64) -> Vector2<f64> {
        let mean_square = squares / (2.0 * rows as f64).max(1.0);
        // Neighbouring rows repeat each other's noise.
        let noise = mean_square * (INDEPENDENT_S / (self.period_s * self.stride as f64)).max(1.0);
        carried.usual(angle_rad).map(|deviation| noise / (deviation * deviation))
    }
}

/// Inertial to body at the samples of each stretch.
pub(crate) fn body_dcm(flight: &Prepared, model: &Model) -> Vec<Vec<Matrix3<f64>>> {
    let untilt = model.adjustments().untilt();
    let of = |stretch: &Stretch| stretch.dcm.iter().map(|tracked| untilt.body(tracked)).collect();
    flight.stretches.iter().map(of).collect()
}

/// Where the craft is at the samples of each stretch, smoothed, inertial m.
pub(crate) fn places_m(
    flight: &Prepared,
    model: &Model,
    body_dcm: &[Vec<Matrix3<f64>>],
) -> Vec<Vec<Vector3<f64>>> {
    let lever_m = Vector3::from(model.vehicle.tracked_point) + model.adjustments().tracked_point_m();
    let of = |(stretch, dcm): (&Stretch, &Vec<Matrix3<f64>>)| places(flight, stretch, dcm, &lever_m);
    flight.stretches.iter().zip(body_dcm).map(of).collect()
}

/// Where the craft is, smoothed.
fn places(
    flight: &Prepared,
    stretch: &Stretch,
    dcm: &[Matrix3<f64>],
    lever_m: &Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let taps = RegressionFilter::smoothing_taps(flight.period_s, DRIVING_WINDOW_S);
    let smooth = |signal: &[f64]| convolve(signal, &taps, |k| signal[k]);
    let has_lever = *lever_m != Vector3::zeros();
    let smoothed: [Vec<f64>; 3] = std::array::from_fn(|axis| {
        let tracked = &stretch.position_ned_m[axis];
        if !has_lever {
            return smooth(tracked);
        }
        let arm = |(tracked, dcm): (&f64, &Matrix3<f64>)| tracked - dcm.column(axis).dot(lever_m);
        smooth(&tracked.iter().zip(dcm).map(arm).collect::<Vec<_>>())
    });
    (0..dcm.len()).map(|k| vector(&smoothed, k)).collect()
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::fit::slung_load::of_model;
    use crate::testing::{prepared, truth};

    fn hover() -> (Model, Prepared, Carried) {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.2, 1.0, 0.1]);
        let flight = prepared(1000, |_, row| row.position_ned_m = [1.0, 2.0, -3.0]);
        let carried = of_model(&model).unwrap();
        (model, flight, carried)
    }

    #[test]
    fn a_small_swing_under_a_hovering_craft_goes_on_as_the_free_motion_says() {
        let (model, flight, carried) = hover();
        let unloaded = Unloaded::new(&flight, &model, 3);
        let piece = unloaded.pieces[0].clone();
        // 1 cm and -2 cm/s north, 2 cm/s east.
        let begun = Matrix2::new(0.01, 0.0, -0.02, 0.02);
        let swings = unloaded.driven(&piece, &carried, &Vector4::new(0.01, -0.02, 0.0, 0.02));
        assert_eq!(swings.len(), piece.samples.len());
        let end = unloaded.end(&piece, &carried, &swings);
        let expected = unloaded.carries_on(&piece, &carried) * begun;
        // The velocity at the end is that between the samples before and after.
        assert!((end - expected).norm() < 0.03 * expected.norm(), "{end} {expected}");
        assert!(expected.norm() > 2e-3, "a swing that has died out tells nothing");
    }

    /// Hanging still it pulls straight down with the weight of what is above it.
    #[test]
    fn a_load_that_hangs_still_pulls_down_by_what_carries_it() {
        let (model, flight, carried) = hover();
        let unloaded = Unloaded::new(&flight, &model, 3);
        let (pull, ends) = unloaded.pull_from(&carried, &[]);
        assert!(ends.iter().all(|end| end.norm() < 1e-9));
        let lift_m_s2 = -unloaded.force_ned_m_s2[0][500].z;
        assert!(lift_m_s2 > 5.0);
        let [u, v, w] = pull;
        assert_eq!(w.len(), unloaded.dcm().len());
        assert!(u.iter().chain(&v).all(|pull| pull.abs() < 1e-9));
        assert!(w.iter().all(|pull| (pull / lift_m_s2 - 1.0).abs() < 1e-6), "{} {lift_m_s2}", w[0]);
    }

    #[test]
    fn a_free_swing_of_a_metre_pulls_at_first_by_its_share_of_its_stiffness() {
        let (model, flight, carried) = hover();
        let unloaded = Unloaded::new(&flight, &model, 3);
        let [offset, velocity] = unloaded.free_swings(&carried);
        let longest = unloaded.rows_of_pieces().map(|rows| rows.len()).max().unwrap();
        assert_eq!((offset.len(), velocity.len()), (longest, longest));
        // The first row is a margin of 0.3 s after the beginning.
        let at_row = carried.share * 9.81 * carried.load.free_motion(0.3, 9.81);
        // The filter of a twice differentiated position takes little of 3 rad/s.
        assert!((offset[0] / at_row[(0, 0)] - 1.0).abs() < 0.02, "{} {at_row}", offset[0]);
        assert!((velocity[0] / at_row[(0, 1)] - 1.0).abs() < 0.02, "{} {at_row}", velocity[0]);
    }

    /// Squares of 8 on two axes over 100 rows are a variance of 0.04; rows 0.03 s apart repeat each
    /// other's noise 10/3 times.
    #[test]
    fn what_is_known_of_a_beginning_is_the_noise_over_its_variance() {
        let (model, flight, carried) = hover();
        let unloaded = Unloaded::new(&flight, &model, 3);
        let known = unloaded.known(8.0, 100, &carried, 0.1);
        let noise = 0.04 * 10.0 / 3.0;
        assert!((known.x - noise / 0.01).abs() < 1e-9, "{known}");
        assert!((known.y - noise / (0.01 * 9.81)).abs() < 1e-9, "{known}");
        assert_eq!(unloaded.known(0.0, 0, &carried, 0.1), Vector2::zeros());
    }

    #[test]
    fn a_load_is_driven_by_the_centre_and_not_by_the_tracked_point() {
        let flight = prepared(300, |_, row| {
            row.position_ned_m = [1.0, 2.0, -3.0];
            row.euler_rad = [0.0, 0.0, std::f64::consts::FRAC_PI_2];
        });
        let stretch = &flight.stretches[0];
        let all = places(&flight, stretch, &stretch.dcm, &Vector3::new(0.1, 0.0, 0.05));
        // Ahead is east.
        assert!((all[150] - Vector3::new(1.0, 1.9, -3.05)).norm() < 1e-9, "{}", all[150]);
        let all = places(&flight, stretch, &stretch.dcm, &Vector3::zeros());
        assert!((all[150] - Vector3::new(1.0, 2.0, -3.0)).norm() < 1e-9);
    }
}
