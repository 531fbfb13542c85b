//! A slung load that no sensor sees: where it must be, from where the craft went.
//!
//! The load's equation is driven by the craft's place alone (`host-sim/model/src/effects/slung_load/cable.rs`), so its swing follows from the
//! log, but for how it swung when the log began, and the tracker's noise and every gust on the load drive it too: a wide swing
//! that is followed for half a minute ends anywhere. It is therefore followed in pieces of some seconds, and how it
//! swung when a piece began is a nuisance: four numbers, offset and velocity north and east. While they are small they enter
//! linearly, so they are taken out of the residual by a small least squares of their own before anything is judged, with the
//! effect's coefficients as they are; while they are not, the swing is followed again from what was found. A prior keeps them
//! honest: a load swings by some degrees, so a load of next to no mass cannot explain an oscillation by swinging wildly.
//!
//! The pull on the craft goes with its place, and the target of the regression may be the second derivative of the same
//! log: the tracker's noise is in both, and a stiff pendulum without any load would explain it. The place is therefore
//! smoothed over 0.4 s, which leaves a swing (up to 11 rad/s) as it is, and ends where most of a derivative's noise begins.

use std::ops::Range;

use model::{Model, Pendulum, SlungLoad};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3, Vector4};

use crate::filter::{RegressionFilter, convolve, sum_of_products};
use crate::fit::Residuals;
use crate::fit::linearise::measured_less_predicted;
use crate::fit::rows::{Part, RowColumn};
use crate::prepare::{ForceTarget, Prepared, Stretch, vector};

/// Standard deviation of the swing at the beginning, rad.
pub const SWING_RAD: f64 = 0.15;
/// Standard deviation of what happens to a swing in a piece beyond what the craft's way explains, rad: noise of the tracker, gusts. With
/// twice as much, the estimated beginnings swallow noise and a swing seems to be damped more than it is; with a third, they cannot follow.
const SURPRISE_RAD: f64 = 0.015;
/// Times that a piece is followed from where its swing was found to begin.
const FOLLOWED: usize = 4;
/// A change of the beginning up to which the swing is linear in it, rad: of what a wide swing of 0.3 rad adds, it moves
/// the square by 6 parts in 1000 of gravity.
const LARGE_RAD: f64 = 0.02;
/// Time from one independent value of filtered noise to the next, s.
const INDEPENDENT_S: f64 = 0.1;

/// Part of noise, percent, that the beginnings explain at most: four numbers of the independent values of two axes in a piece.
pub const BY_CHANCE_PERCENT: f64 = 100.0 * 4.0 * INDEPENDENT_S / (2.0 * PIECE_S);

/// Window over which what drives a load is smoothed, s: it should not share the noise of a derivative, and ends (-3 dB at
/// 26 rad/s) about where that begins.
const DRIVING_WINDOW_S: f64 = 0.4;

/// Length of a piece, s: several swings of a cable of a metre, short enough for a wide swing to be followed.
const PIECE_S: f64 = 4.0;

/// The load of a model.
#[derive(Debug, Clone, Copy)]
pub struct Carried {
    /// The load.
    pub load: SlungLoad,
    /// Its mass over the craft's.
    pub share: f64,
    craft_kg: f64,
    gravity_m_s2: f64,
}

impl Carried {
    /// The part of a force along the cable that moves the load.
    pub fn part(&self) -> f64 {
        self.share / (1.0 + self.share)
    }

    /// zeta w0, by which a swing decays.
    fn decay_per_s(&self) -> f64 {
        self.load.damping_ratio * self.load.stiffness_rad2_s2(self.gravity_m_s2).sqrt()
    }

    /// What [`Self::part`] grows by with the mass where there is none yet, 1/kg.
    pub fn part_per_kg(&self) -> f64 {
        1.0 / self.craft_kg
    }

    /// Standard deviations of a swing of `angle_rad`: offset m, velocity m/s.
    fn usual(&self, angle_rad: f64) -> Vector2<f64> {
        let offset_m = angle_rad * self.load.cable_length_m;
        Vector2::new(offset_m, offset_m * self.load.stiffness_rad2_s2(self.gravity_m_s2).sqrt())
    }

    /// Whether a change of a beginning is too large for what enters linearly.
    fn is_large(&self, change: &Vector4<f64>) -> bool {
        let usual = self.usual(SWING_RAD);
        change.component_div(&Vector4::new(usual.x, usual.y, usual.x, usual.y)).amax() > LARGE_RAD / SWING_RAD
    }
}

/// The load of a model, if it has one.
pub fn of_model(model: &Model) -> Option<Carried> {
    let adjust = model.adjustments();
    adjust.load().map(|load| {
        let craft_kg = model.vehicle.mass + adjust.extra_mass_kg();
        Carried { load, share: load.mass_kg / craft_kg, craft_kg, gravity_m_s2: model.vehicle.gravity }
    })
}

/// A model with nothing on the cable.
pub fn without_load(model: &Model) -> Model {
    let mut model = model.clone();
    model.terms.retain(|term| !term.effect.info().special.hangs_load);
    model
}

/// The swing of a load when a piece begins: north m, m/s, east m, m/s against the craft.
#[derive(Debug, Clone, Copy, Default)]
pub struct Beginning {
    /// What it is taken for.
    pub at: Vector4<f64>,
    /// What would be expected: as the piece before it ends, at rest after a gap.
    expected: Vector4<f64>,
}

/// What is known of a load before it is followed.
#[derive(Debug, Clone, Default)]
pub struct Known {
    /// How the pieces were found to begin, to go on from.
    /// How the load begins each piece.
    /// How the load begins each piece.
    pub begun: Vec<Beginning>,
    /// Whether its coefficients are hardly known: then neither is how a piece begins from how the one before it ends.
    pub is_rough: bool,
}

/// A piece of a flight, over which a load's swing is followed from one beginning.
#[derive(Debug, Clone)]
struct Piece {
    stretch: usize,
    /// Samples of the stretch: those of neighbours overlap by what filters need at their ends.
    samples: Range<usize>,
    /// Rows of the flight.
    rows: Range<usize>,
}

impl Piece {
    /// Whether there is one before it.
    fn goes_on(&self) -> bool {
        self.samples.start > 0
    }
}

/// The flight in pieces; their rows are those of the flight, in the same order.
fn pieces(flight: &Prepared, stride: usize) -> Vec<Piece> {
    let fit_stride = flight.fit_stride();
    let of_piece = ((PIECE_S / flight.period_s) as usize / fit_stride).max(1) * fit_stride;
    let mut all: Vec<Piece> = Vec::new();
    for (stretch, samples) in flight.stretches.iter().map(|stretch| stretch.time_s.len()).enumerate() {
        let places = samples - 2 * flight.margin;
        // The last one takes the rest.
        let count = ((places + of_piece / 2) / of_piece).max(1);
        for piece in 0..count {
            let (from, to) =
                (piece * of_piece, if piece + 1 == count { places } else { (piece + 1) * of_piece });
            let row = all.last().map_or(0, |last| last.rows.end);
            let rows = row..row + (to - from).div_ceil(stride);
            all.push(Piece { stretch, samples: from..to + 2 * flight.margin, rows });
        }
    }
    all
}

/// Rows of a flight in blocks that know little of each other's swing: up to twice as long as a swing remembers, 1 / (zeta w0), two of a
/// stretch at least.
pub fn blocks(flight: &Prepared, carried: &Carried, stride: usize) -> Vec<Range<usize>> {
    let memory_s = 1.0 / carried.decay_per_s();
    let pieces = pieces(flight, stride);
    let of_stretches = pieces.chunk_by(|a, b| a.stretch == b.stretch);
    let blocks = of_stretches.flat_map(|of_stretch| {
        let seconds = PIECE_S * of_stretch.len() as f64;
        // A swing that is not damped remembers all.
        let count = if memory_s > 0.0 { (seconds / (2.0 * memory_s)).ceil() as usize } else { 0 };
        of_stretch.chunks(of_stretch.len().div_ceil(count.clamp(2, of_stretch.len().max(2))))
    });
    blocks.map(|block| block[0].rows.start..block[block.len() - 1].rows.end).collect()
}

/// A flight under a model but for its load's pull, and where that acts: what loads are tried on.
#[derive(Debug, Clone)]
pub struct Unloaded {
    pieces: Vec<Piece>,
    period_s: f64,
    stride: usize,
    margin: usize,
    /// Where the craft is at the samples of each stretch, smoothed, inertial m.
    places_m: Vec<Vec<Vector3<f64>>>,
    /// Specific force of everything but the cable, inertial m/s^2, where regressors are formed.
    force_ned_m_s2: Vec<Vec<Vector3<f64>>>,
    /// Inertial to body at the rows.
    dcm: Vec<Matrix3<f64>>,
    /// The same at the samples of each stretch, where forces are filtered in body axes.
    body_dcm: Option<Vec<Vec<Matrix3<f64>>>>,
    taps: Vec<f64>,
    /// Targets of the six rows.
    pub measured: [Vec<f64>; 6],
    /// Measured less what everything but the load's pull predicts.
    pub residual: [Vec<f64>; 6],
}

impl Unloaded {
    /// Over the rows at every `stride`th sample.
    pub fn new(flight: &Prepared, model: &Model, stride: usize) -> Self {
        let adjust = model.adjustments();
        let (measured, residual) = measured_less_predicted(flight, model, stride);
        let pieces = pieces(flight, stride);
        let dcms = |stretch: &Stretch| -> Vec<Matrix3<f64>> {
            let states = flight.states(stretch, &model.vehicle, &adjust);
            (0..states.len()).map(|k| states.dcm(k)).collect()
        };
        let body_dcm: Vec<Vec<Matrix3<f64>>> = flight.stretches.iter().map(dcms).collect();
        let rows = |piece: &Piece| {
            let dcm = &body_dcm[piece.stretch];
            let row = piece.samples.start + flight.margin..piece.samples.end - flight.margin;
            row.step_by(stride).map(|k| dcm[k])
        };
        let dcm = pieces.iter().flat_map(rows).collect();
        let lever_m = Vector3::from(model.vehicle.tracked_point) + adjust.tracked_point_m();
        let places = |(stretch, dcm): (&Stretch, &Vec<Matrix3<f64>>)| places(flight, stretch, dcm, &lever_m);
        Self {
            period_s: flight.period_s,
            stride,
            margin: flight.margin,
            places_m: flight.stretches.iter().zip(&body_dcm).map(places).collect(),
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
    pub fn rows_of_pieces(&self) -> impl Iterator<Item = Range<usize>> {
        self.pieces.iter().map(|piece| piece.rows.clone())
    }

    /// Inertial to body at the rows.
    pub fn dcm(&self) -> &[Matrix3<f64>] {
        &self.dcm
    }

    /// The load over a piece.
    fn driven(&self, piece: &Piece, carried: &Carried, beginning: &Vector4<f64>) -> Vec<Pendulum> {
        let places = &self.places_m[piece.stretch][piece.samples.clone()];
        carried.load.driven(places, (*beginning).into(), self.period_s, carried.gravity_m_s2)
    }

    /// What a load pulls the craft with at the rows of a piece, for each part of a force along the cable that moves it, body m/s^2.
    fn pull(&self, piece: &Piece, carried: &Carried, swings: &[Pendulum]) -> [Vec<f64>; 3] {
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
    pub fn pull_from(&self, carried: &Carried, begun: &[Beginning]) -> ([Vec<f64>; 3], Vec<Matrix2<f64>>) {
        let mut all: [Vec<f64>; 3] = std::array::from_fn(|_| Vec::with_capacity(self.dcm.len()));
        let mut ends = Vec::with_capacity(self.pieces.len());
        for (index, piece) in self.pieces.iter().enumerate() {
            let at = begun.get(index).map_or_else(Vector4::zeros, |begun| begun.at);
            let swings = self.driven(piece, carried, &at);
            let of_piece = self.pull(piece, carried, &swings);
            all.iter_mut().zip(of_piece).for_each(|(all, pull)| all.extend(pull));
            ends.push(self.end(piece, carried, &swings));
        }
        (all, ends)
    }

    /// How a load swings where the next piece begins: offset m and velocity m/s, north and east.
    fn end(&self, piece: &Piece, carried: &Carried, swings: &[Pendulum]) -> Matrix2<f64> {
        swings.get(piece.samples.len() - 2 * self.margin).map_or_else(Matrix2::zeros, |swing| {
            let offset_m = carried.load.cable_length_m * swing.direction;
            let velocity_m_s = carried.load.cable_length_m * swing.turning_rad_s.cross(&swing.direction);
            Matrix2::new(offset_m.x, offset_m.y, velocity_m_s.x, velocity_m_s.y)
        })
    }

    /// What becomes of a small swing by the beginning of the next piece.
    fn carries_on(&self, piece: &Piece, carried: &Carried) -> Matrix2<f64> {
        let time_s = self.period_s * (piece.samples.len() - 2 * self.margin) as f64;
        carried.load.free_motion(time_s, carried.gravity_m_s2)
    }

    /// What a load's free swing adds at the rows of a piece in the direction in which it swings, from an offset of 1 m and from 1 m/s,
    /// m/s^2: the same in all pieces, but for their length.
    pub fn free_swings(&self, carried: &Carried) -> [Vec<f64>; 2] {
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
    pub fn known(&self, squares: f64, rows: usize, carried: &Carried, angle_rad: f64) -> Vector2<f64> {
        let mean_square = squares / (2.0 * rows as f64).max(1.0);
        // Neighbouring rows repeat each other's noise.
        let noise = mean_square * (INDEPENDENT_S / (self.period_s * self.stride as f64)).max(1.0);
        carried.usual(angle_rad).map(|deviation| noise / (deviation * deviation))
    }
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
pub struct Followed {
    unloaded: Unloaded,
    carried: Carried,
    /// How the load begins each piece.
    pub begun: Vec<Beginning>,
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
    pub fn new(unloaded: Unloaded, carried: Carried, known: &Known) -> Self {
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
    pub fn residuals(&self) -> Residuals {
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
    pub fn take_out(&self, column: &mut RowColumn) {
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
    pub fn parts(&self, flight: &Prepared) -> Vec<Vec<Part>> {
        let mut parts: Vec<Vec<Part>> = flight.stretches.iter().map(|_| Vec::new()).collect();
        for (piece, swings) in self.unloaded.pieces.iter().zip(&self.swings) {
            parts[piece.stretch].push(Part { samples: piece.samples.clone(), swings: swings.clone() });
        }
        parts
    }

    /// Minus the derivative of the residual where only the load is another one, by `step` of one of its coefficients; beginnings as they
    /// are.
    pub fn slope_of_load(&self, ahead: &Carried, step: f64) -> RowColumn {
        let (pull, ends) = self.unloaded.pull_from(ahead, &self.begun);
        let (part, here) = (ahead.part(), self.carried.part());
        let mut column = RowColumn::default();
        for (axis, (ahead, own)) in pull.iter().zip(&self.pull).enumerate() {
            column[axis] = Some(ahead.iter().zip(own).map(|(a, h)| (part * a - here * h) / step).collect());
        }
        self.take_out_with(&mut column, &self.slopes_of_ends(&ends, step));
        column
    }

    /// The same where another coefficient of the model is, by `step`.
    pub fn slope(&self, flight: &Prepared, ahead: &Model, step: f64) -> RowColumn {
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
pub fn followed(flight: &Prepared, stretch: &Stretch, model: &Model) -> Vec<Pendulum> {
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
