//! A slung load that no sensor sees: where it must be, from where the craft went.
//!
//! The load's equation is driven by the craft's place alone (`host-sim/model/src/effects/slung_load/cable.rs`), so its swing follows from the
//! log, but for how it swung when the log began, and the tracker's noise and every gust on the load drive it too: a wide swing
//! that is followed for half a minute ends anywhere. It is therefore followed in pieces of some seconds, and how it
//! swung when a piece began is a nuisance: four numbers, offset and velocity north and east. While they are small they enter
//! linearly, so they are taken out of the residual by a small least squares of their own before anything is judged, with the
//! effect's coefficients as they are; while they are not, the swing is followed again from what was found. A prior keeps them
//! honest: a load swings by some degrees, so a load of next to no mass cannot explain an oscillation by swinging wildly.

use model::{Model, Pendulum, SlungLoad};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3, Vector4};

use crate::filter::sum_of_products;
use crate::fit::least_squares::RowColumn;
use crate::fit::pieces::Piece;
use crate::fit::residuals::Residuals;
use crate::fit::slung_load::{Carried, SWING_RAD, of_model};
use crate::fit::unloaded::{Beginning, Unloaded};
use crate::prepare::{Part, Prepared, Stretch};

/// Standard deviation of what happens to a swing in a piece beyond what the craft's way explains, rad: noise of the tracker, gusts. With
/// twice as much, the estimated beginnings swallow noise and a swing seems to be damped more than it is; with a third, they cannot follow.
const SURPRISE_RAD: f64 = 0.015;
/// Times that a piece is followed from where its swing was found to begin.
const FOLLOWED: usize = 4;
/// What is known of a load before it is followed.
#[derive(Debug, Clone, Default)]
pub struct Known {
    /// How the pieces were found to begin, to go on from.
    pub begun: Vec<Beginning>,
    /// Whether its coefficients are hardly known: then neither is how a piece begins from how the one before it ends.
    pub is_rough: bool,
}

/// What takes the beginnings of pieces out of signals at the rows.
#[derive(Debug, Clone, Default)]
struct Beginnings {
    /// [`Unloaded::free_swings`].
    free: [Vec<f64>; 2],
    /// Of each piece, the inverse of the normal equations, the same north and east.
    inverse: Vec<Matrix2<f64>>,
    /// What becomes of each by the next one.
    carries_on: Vec<Matrix2<f64>>,
}

impl Beginnings {
    /// Sums of the free swings times a signal over rows, north and east.
    fn sums<'a>(
        &self,
        dcm: &[Matrix3<f64>],
        signal: impl Iterator<Item = Vector3<f64>> + 'a,
    ) -> Matrix2<f64> {
        let mut sums = Matrix2::zeros();
        for ((dcm, signal), (a, b)) in dcm.iter().zip(signal).zip(self.free[0].iter().zip(&self.free[1])) {
            let (north, east) = (dcm.column(0).dot(&signal), dcm.column(1).dot(&signal));
            sums += Matrix2::new(a * north, a * east, b * north, b * east);
        }
        sums
    }

    /// The free swings of a beginning (offset and velocity, north and east) at rows, body.
    fn swung<'a>(
        &'a self,
        dcm: &'a [Matrix3<f64>],
        beginning: Matrix2<f64>,
    ) -> impl Iterator<Item = Vector3<f64>> + 'a {
        dcm.iter().zip(self.free[0].iter().zip(&self.free[1])).map(move |(dcm, (a, b))| {
            let north_east = beginning.tr_mul(&Vector2::new(*a, *b));
            dcm.column(0) * north_east.x + dcm.column(1) * north_east.y
        })
    }

    /// Adds the free swings of a beginning to a signal over a piece.
    fn add(&self, signal: &mut [Vec<f64>; 3], piece: &Piece, dcm: &[Matrix3<f64>], beginning: Matrix2<f64>) {
        for (row, swung) in piece.rows.clone().zip(self.swung(dcm, beginning)) {
            (0..3).for_each(|axis| signal[axis][row] += swung[axis]);
        }
    }

    /// Products of the free swings with each other over the first `rows`.
    fn products(&self, rows: usize) -> Matrix2<f64> {
        let [a, b] = self.free.each_ref().map(|free| &free[..rows]);
        let off = sum_of_products(a, b);
        Matrix2::new(sum_of_products(a, a), off, off, sum_of_products(b, b))
    }
}

/// A piece followed from a beginning.
struct Tried {
    begun: Beginning,
    swings: Vec<Pendulum>,
    pull: [Vec<f64>; 3],
    inverse: Matrix2<f64>,
    /// By what the beginning should change; offset and velocity, north and east.
    change: Matrix2<f64>,
    /// Sum of squares with it.
    left: f64,
}

/// A flight whose load has been followed through its pieces.
#[derive(Debug, Clone)]
pub(crate) struct Followed {
    unloaded: Unloaded,
    carried: Carried,
    /// How the load begins each piece.
    pub(crate) begun: Vec<Beginning>,
    is_rough: bool,
    /// Of each piece.
    swings: Vec<Vec<Pendulum>>,
    /// For each part of a force along the cable that moves the load, body m/s^2.
    pull: [Vec<f64>; 3],
    /// Measured less predicted, but for the beginnings.
    residual: [Vec<f64>; 6],
    /// What is left to say of the beginnings.
    changes: Vec<Matrix2<f64>>,
    /// How each piece ends, but for that.
    ends: Vec<Matrix2<f64>>,
    beginnings: Beginnings,
}

impl Followed {
    /// Follows the load of a model through a flight, each piece from where the one before it ends.
    pub(crate) fn new(unloaded: Unloaded, carried: Carried, known: &Known) -> Self {
        let count = unloaded.pieces.len();
        let mut followed = Self {
            begun: Vec::with_capacity(count),
            is_rough: known.is_rough,
            swings: Vec::with_capacity(count),
            pull: std::array::from_fn(|_| Vec::with_capacity(unloaded.dcm.len())),
            residual: unloaded.residual.clone(),
            changes: Vec::with_capacity(count),
            ends: Vec::with_capacity(count),
            beginnings: Beginnings {
                free: unloaded.free_swings(&carried),
                inverse: Vec::with_capacity(count),
                carries_on: unloaded
                    .pieces
                    .iter()
                    .map(|piece| unloaded.carries_on(piece, &carried))
                    .collect(),
            },
            unloaded,
            carried,
        };
        let mut expected = Vector4::zeros();
        for index in 0..count {
            let piece = followed.unloaded.pieces[index].clone();
            if piece.samples.start == 0 {
                expected = Vector4::zeros();
            }
            let at = known.begun.get(index).map_or(expected, |known| known.at);
            followed.begin(&piece, Beginning { at, expected });
            let swung =
                followed.ends[index] + followed.beginnings.carries_on[index] * followed.changes[index];
            expected = Vector4::from_column_slice(swung.as_slice());
        }
        followed
    }

    /// The beginning of a piece, from a first guess on.
    fn begin(&mut self, piece: &Piece, first: Beginning) {
        let mut best = self.tried(piece, first);
        for _ in 0..FOLLOWED {
            let change = Vector4::from_column_slice(best.change.as_slice());
            if !self.carried.is_large(&change) {
                break;
            }
            let next = self.tried(piece, Beginning { at: best.begun.at + change, ..best.begun });
            // A swing far beyond the linear may be followed to somewhere worse.
            if !(next.left < best.left) {
                break;
            }
            best = next;
        }
        let part = self.carried.part();
        for ((residual, all), pull) in self.residual.iter_mut().zip(&mut self.pull).zip(best.pull) {
            residual[piece.rows.clone()].iter_mut().zip(&pull).for_each(|(r, p)| *r -= part * p);
            all.extend(pull);
        }
        self.begun.push(best.begun);
        self.ends.push(self.unloaded.end(piece, &self.carried, &best.swings));
        self.swings.push(best.swings);
        self.changes.push(best.change);
        self.beginnings.inverse.push(best.inverse);
    }

    /// A piece from a beginning, and what is left to say of that: a small least squares, with what is expected as known as its
    /// standard deviations say.
    fn tried(&self, piece: &Piece, begun: Beginning) -> Tried {
        let Self { unloaded, carried, beginnings, .. } = self;
        let swings = unloaded.driven(piece, carried, &begun.at);
        let pull = unloaded.pull(piece, carried, &swings);
        let part = carried.part();
        let left = |i: usize| {
            let axis = |a: usize| unloaded.residual[a][piece.rows.start + i] - part * pull[a][i];
            Vector3::new(axis(0), axis(1), axis(2))
        };
        let residual: Vec<Vector3<f64>> = (0..piece.rows.len()).map(left).collect();
        let sideways: f64 = residual.iter().map(|e| e.xy().norm_squared()).sum();
        let angle_rad = if piece.goes_on() && !self.is_rough { SURPRISE_RAD } else { SWING_RAD };
        let known = unloaded.known(sideways, piece.rows.len(), carried, angle_rad);
        let products = beginnings.products(piece.rows.len());
        let sums = beginnings.sums(&unloaded.dcm[piece.rows.clone()], residual.iter().copied());
        let inverse = (products + Matrix2::from_diagonal(&known)).try_inverse().unwrap_or_default();
        let surprise = begun.expected - begun.at;
        let expected = Matrix2::from_column_slice(surprise.as_slice());
        let change = inverse * (sums + Matrix2::from_diagonal(&known) * expected);
        let explained = 2.0 * change.dot(&sums) - change.dot(&(products * change));
        let square: f64 = residual.iter().map(Vector3::norm_squared).sum();
        Tried { begun, swings, pull, inverse, change, left: square - explained }
    }

    /// What is left of the flight, the beginnings taken out.
    pub(crate) fn residuals(&self) -> Residuals {
        let mut residual = self.residual.clone();
        for (piece, change) in self.unloaded.pieces.iter().zip(&self.changes) {
            let dcm = &self.unloaded.dcm[piece.rows.clone()];
            for (row, swung) in piece.rows.clone().zip(self.beginnings.swung(dcm, *change)) {
                (0..3).for_each(|axis| residual[axis][row] -= swung[axis]);
            }
        }
        Residuals { measured: self.unloaded.measured.clone(), residual }
    }

    /// Takes out of a column what the beginnings would explain of it. What they say of one piece carries on to the next, whose beginning is
    /// expected accordingly.
    pub(crate) fn take_out(&self, column: &mut RowColumn) {
        self.take_out_with(column, &[]);
    }

    /// The same for a coefficient on which it depends how the pieces end, by `ends`.
    fn take_out_with(&self, column: &mut RowColumn, ends: &[Matrix2<f64>]) {
        if column[..3].iter().all(Option::is_none) {
            return;
        }
        let rows = self.unloaded.dcm.len();
        let [Some(u), Some(v), Some(w)] =
            [0, 1, 2].map(|axis| column[axis].take().or_else(|| Some(vec![0.0; rows])))
        else {
            return;
        };
        let mut signal = [u, v, w];
        let Beginnings { inverse, carries_on, .. } = &self.beginnings;
        let mut shift = Matrix2::zeros();
        for (index, piece) in self.unloaded.pieces.iter().enumerate() {
            if !piece.goes_on() {
                shift = Matrix2::zeros();
            }
            let dcm = &self.unloaded.dcm[piece.rows.clone()];
            self.beginnings.add(&mut signal, piece, dcm, shift);
            let at_rows =
                piece.rows.clone().map(|row| Vector3::from([0, 1, 2].map(|axis| signal[axis][row])));
            let explains = inverse[index] * self.beginnings.sums(dcm, at_rows);
            self.beginnings.add(&mut signal, piece, dcm, -explains);
            shift = carries_on[index] * (shift - explains) + ends.get(index).copied().unwrap_or_default();
        }
        column.iter_mut().zip(signal).for_each(|(column, signal)| *column = Some(signal));
    }

    /// The samples of each stretch in pieces, with the load's swing.
    pub(crate) fn parts(&self, flight: &Prepared) -> Vec<Vec<Part>> {
        let mut parts: Vec<Vec<Part>> = flight.stretches.iter().map(|_| Vec::new()).collect();
        for (piece, swings) in self.unloaded.pieces.iter().zip(&self.swings) {
            parts[piece.stretch].push(Part { samples: piece.samples.clone(), swings: swings.clone() });
        }
        parts
    }

    /// Minus the derivative of the residual where only the load is another one, by `step` of one of its coefficients; beginnings as they
    /// are.
    pub(crate) fn slope_of_load(&self, ahead: &Carried, step: f64) -> RowColumn {
        let (part, here) = (ahead.part(), self.carried.part());
        let slope = |ahead: &[Vec<f64>; 3]| -> RowColumn {
            let mut column = RowColumn::default();
            for (axis, (ahead, own)) in ahead.iter().zip(&self.pull).enumerate() {
                column[axis] =
                    Some(ahead.iter().zip(own).map(|(a, h)| (part * a - here * h) / step).collect());
            }
            column
        };
        // Whatever it weighs, a load that the craft's way drives swings the same.
        let swings_alike =
            SlungLoad { mass_kg: self.carried.load.mass_kg, ..ahead.load } == self.carried.load;
        if swings_alike {
            let mut column = slope(&self.pull);
            self.take_out(&mut column);
            return column;
        }
        let (pull, ends) = self.unloaded.pull_from(ahead, &self.begun);
        let mut column = slope(&pull);
        self.take_out_with(&mut column, &self.slopes_of_ends(&ends, step));
        column
    }

    /// The same where another coefficient of the model is, by `step`.
    pub(crate) fn slope(&self, flight: &Prepared, ahead: &Model, step: f64) -> RowColumn {
        let unloaded = Unloaded::new(flight, ahead, self.unloaded.stride);
        let carried = of_model(ahead).unwrap_or(self.carried);
        let (pull, ends) = unloaded.pull_from(&carried, &self.begun);
        let part = carried.part();
        let mut column: RowColumn = std::array::from_fn(|axis| {
            let pull = pull.get(axis);
            let at = |row: usize| unloaded.residual[axis][row] - pull.map_or(0.0, |pull| part * pull[row]);
            let here = &self.residual[axis];
            let slope: Vec<f64> =
                here.iter().enumerate().map(|(row, here)| (here - at(row)) / step).collect();
            slope.iter().any(|d| *d != 0.0).then_some(slope)
        });
        self.take_out_with(&mut column, &self.slopes_of_ends(&ends, step));
        column
    }

    fn slopes_of_ends(&self, ahead: &[Matrix2<f64>], step: f64) -> Vec<Matrix2<f64>> {
        ahead.iter().zip(&self.ends).map(|(ahead, own)| (ahead - own) / step).collect()
    }
}

/// The load over a whole stretch, as its pieces follow it.
pub(crate) fn followed(flight: &Prepared, stretch: &Stretch, model: &Model) -> Vec<Pendulum> {
    let Some(carried) = of_model(model) else { return Vec::new() };
    let alone = Prepared { stretches: vec![stretch.clone()], ..flight.without_stretches() };
    let followed =
        Followed::new(Unloaded::new(&alone, model, alone.fit_stride()), carried, &Known::default());
    let mut swings = Vec::with_capacity(stretch.time_s.len());
    for (index, own) in followed.swings.iter().enumerate() {
        // What the one before it had last belongs to this one's middle.
        swings.truncate(swings.len().saturating_sub(flight.margin));
        let known = if index == 0 { 0 } else { flight.margin };
        swings.extend_from_slice(&own[known..]);
    }
    swings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::linearise::residuals;
    use crate::testing::{NONE, fly, truth};
    use model::Effect;

    fn loaded() -> Model {
        let mut model = truth();
        model.set(Effect::SlungLoad, &[0.12, 0.6, 0.05]);
        model
    }

    fn flown(model: &Model) -> Prepared {
        Prepared::new(&fly(model, 4, 12.0, &NONE), &model.vehicle).unwrap()
    }

    #[test]
    fn a_load_that_is_followed_leaves_less_than_none_and_than_another_cable() {
        let model = loaded();
        let flight = flown(&model);
        let left = |model: &Model| -> f64 {
            let residual = residuals(&flight, model).residual;
            residual[..3].iter().flatten().map(|e| e * e).sum()
        };
        let mut longer = model.clone();
        longer.set(Effect::SlungLoad, &[0.12, 1.5, 0.05]);
        let right = left(&model);
        assert!(right < 0.05 * left(&truth()), "{right} of {}", left(&truth()));
        assert!(right < 0.3 * left(&longer), "{right} of {}", left(&longer));
    }

    #[test]
    fn the_cable_has_a_direction_at_every_sample_and_none_without_a_load() {
        let model = loaded();
        let flight = flown(&model);
        let swings = followed(&flight, &flight.stretches[0], &model);
        assert_eq!(swings.len(), flight.stretches[0].time_s.len());
        for swing in &swings {
            assert!((swing.direction.norm() - 1.0).abs() < 1e-6 && swing.direction.z > 0.5);
        }
        assert!(followed(&flight, &flight.stretches[0], &truth()).is_empty());
    }

    /// Free swings 1, 2 and 0, 1 at two rows of a level craft; the signal is 3 north at the second
    /// row.
    #[test]
    fn sums_and_products_of_the_free_swings_are_over_the_rows() {
        let beginnings = Beginnings { free: [vec![1.0, 2.0], vec![0.0, 1.0]], ..Beginnings::default() };
        assert_eq!(beginnings.products(2), Matrix2::new(5.0, 2.0, 2.0, 1.0));
        assert_eq!(beginnings.products(1), Matrix2::new(1.0, 0.0, 0.0, 0.0));
        let level = [Matrix3::identity(); 2];
        let signal = [Vector3::zeros(), Vector3::new(3.0, 0.0, 7.0)];
        let sums = beginnings.sums(&level, signal.into_iter());
        assert_eq!(sums, Matrix2::new(6.0, 0.0, 3.0, 0.0));
    }

    #[test]
    fn a_free_swing_lies_in_the_horizontal_plane_whatever_the_attitude() {
        let beginnings = Beginnings { free: [vec![1.0, 2.0], vec![0.0, 1.0]], ..Beginnings::default() };
        let dcm = [model::frames::dcm_from_euler(Vector3::new(0.3, -0.2, 1.0)); 2];
        // Offset 1 m north and 2 m east, velocity 3 m/s north.
        let begun = Matrix2::new(1.0, 2.0, 3.0, 0.0);
        let inertial: Vec<Vector3<f64>> =
            beginnings.swung(&dcm, begun).zip(&dcm).map(|(body, dcm)| dcm.tr_mul(&body)).collect();
        assert!((inertial[0] - Vector3::new(1.0, 2.0, 0.0)).norm() < 1e-12);
        assert!((inertial[1] - Vector3::new(5.0, 4.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn what_the_beginnings_explain_is_taken_out_of_a_column_once() {
        let model = loaded();
        let flight = flown(&model);
        let carried = of_model(&model).unwrap();
        let rough = Known { is_rough: true, ..Known::default() };
        let followed = Followed::new(Unloaded::new(&flight, &model, 3), carried, &rough);
        let mut column = RowColumn::default();
        column[3] = Some(vec![1.0; followed.unloaded.dcm.len()]);
        let before = column.clone();
        followed.take_out(&mut column);
        assert_eq!(column, before, "a column of moments has no swing in it");
        let square = |column: &RowColumn| column[..3].iter().flatten().flatten().map(|v| v * v).sum::<f64>();
        let mut free: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; followed.unloaded.dcm.len()]);
        let piece = &followed.unloaded.pieces[0];
        let dcm = &followed.unloaded.dcm[piece.rows.clone()];
        followed.beginnings.add(&mut free, piece, dcm, Matrix2::new(0.1, 0.0, 0.0, 0.2));
        let mut column = RowColumn::default();
        column.iter_mut().zip(free).for_each(|(column, free)| *column = Some(free));
        let swung = square(&column);
        followed.take_out(&mut column);
        assert!(square(&column) < 0.05 * swung, "{} of {swung}", square(&column));
    }
}
