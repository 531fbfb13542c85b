//! Plants of several craft that are integrated side by side, a craft in each lane of the vector registers.
//!
//! Nothing of the motion is defined here: a lane does what [`Plant::step`] does, from the same functions, and gives its bits. Its loop
//! over the lanes has no branch and no call, so that the compiler makes vector instructions of it; which ones is decided where it runs.
//! There is no fused multiply-add in either.

use nalgebra::{Vector3, Vector4};

use crate::effects::Adjustments;
use crate::effects::weights::WeightsAbreast;
use crate::pendulum::Pendulum;
use crate::plant::equations::{Hold, Holds, Plant, Shape};
use crate::plant::stages::{self, Moves, Part};
use crate::plant::state::{Derivative, Stage, State};
use crate::rotor_lag::decayed;
use crate::sample::{CONSTANTS, Constants, Surroundings};

/// Craft side by side: numbers of the widest vector registers, or of several narrower ones.
pub const LANES: usize = 8;

/// A number of each craft.
type Lane = [f64; LANES];

/// Several craft, each with a plant of its own.
#[derive(Debug, Clone)]
pub struct Abreast {
    parameters: Box<Parameters>,
    motion: Box<Motion>,
    drive: Box<Drive>,
    holds: [Holds; LANES],
    shape: Shape,
    /// Whether some craft has an effect that takes long.
    slow: bool,
}

/// What does not change in flight.
#[derive(Debug, Clone)]
struct Parameters {
    weights: WeightsAbreast<LANES>,
    constants: [Lane; CONSTANTS],
    gravity_m_s2: Lane,
    lag_rad_s: Lane,
}

/// The states.
#[derive(Debug, Clone, Default)]
#[repr(align(64))]
struct Motion {
    position_ned_m: [Lane; 3],
    attitude: [Lane; 4],
    velocity_m_s: [Lane; 3],
    rate_rad_s: [Lane; 3],
    rotor_rad_s: [Lane; 4],
}

/// A step of each craft; none where it takes no time.
#[derive(Debug, Clone, Default)]
#[repr(align(64))]
struct Drive {
    commanded_rad_s: [Lane; 4],
    half_decay: Lane,
    decay: Lane,
    step_s: Lane,
}

impl Default for Abreast {
    fn default() -> Self {
        Self::new()
    }
}

impl Abreast {
    /// Nobody in any lane.
    pub fn new() -> Self {
        let parameters = Parameters {
            weights: WeightsAbreast::new(),
            constants: [[0.0; LANES]; CONSTANTS],
            gravity_m_s2: [0.0; LANES],
            lag_rad_s: [0.0; LANES],
        };
        let (motion, drive) = (Box::default(), Box::default());
        let (holds, shape) = ([[None; 2]; LANES], Shape::Plain);
        Self { parameters: Box::new(parameters), motion, drive, holds, shape, slow: false }
    }

    /// Gives a lane to a craft with this plant, in the place of whoever had it. Whether it can be flown there: not with formulas of
    /// users, a load on a cable, or accelerations that are solved for.
    pub fn enter(&mut self, lane: usize, plant: &Plant) -> bool {
        if plant.shape == Shape::General {
            return false;
        }
        self.shape = self.shape.max(plant.shape);
        self.slow |= plant.weights.have_slow();
        let parameters = &mut *self.parameters;
        parameters.weights.set(lane, &plant.weights);
        put(&mut parameters.constants, lane, &plant.constants.numbers());
        parameters.gravity_m_s2[lane] = plant.gravity_m_s2;
        parameters.lag_rad_s[lane] = plant.lag_rad_s.unwrap_or(0.0);
        self.holds[lane] = [None; 2];
        true
    }

    /// Where a craft is, and what it is commanded in the next [`Self::advance`].
    #[inline]
    pub fn put(&mut self, lane: usize, state: &State, holds: &Holds) {
        let motion = &mut *self.motion;
        put(&mut motion.position_ned_m, lane, state.position_ned_m.as_ref());
        put(&mut motion.attitude, lane, state.attitude.as_ref());
        put(&mut motion.velocity_m_s, lane, state.velocity_m_s.as_ref());
        put(&mut motion.rate_rad_s, lane, state.rate_rad_s.as_ref());
        put(&mut motion.rotor_rad_s, lane, &state.rotor_rad_s);
        self.holds[lane] = *holds;
    }

    /// Where it is now; its load and its memory are none of this.
    #[inline]
    pub fn take(&self, lane: usize, state: &mut State) {
        let motion = &*self.motion;
        state.position_ned_m = Vector3::from(got(&motion.position_ned_m, lane));
        state.attitude = Vector4::from(got(&motion.attitude, lane));
        state.velocity_m_s = Vector3::from(got(&motion.velocity_m_s, lane));
        state.rate_rad_s = Vector3::from(got(&motion.rate_rad_s, lane));
        state.rotor_rad_s = got(&motion.rotor_rad_s, lane);
    }

    /// Advances each craft by what it is commanded, and leaves it without a command.
    pub fn advance(&mut self) {
        let step: fn(&Parameters, &Drive, &mut Motion) = match (self.shape, self.slow) {
            (Shape::Plain, _) => plain,
            (Shape::Adjusted, false) => adjusted,
            (Shape::Adjusted, true) => adjusted_slowly,
            (Shape::Linear | Shape::General, false) => linear,
            (Shape::Linear | Shape::General, true) => linear_slowly,
        };
        for number in 0.. {
            let mut any = false;
            for lane in 0..LANES {
                any |= self.begin(lane, number);
            }
            if !any {
                break;
            }
            step(&self.parameters, &self.drive, &mut self.motion);
        }
        self.holds = [[None; 2]; LANES];
    }

    /// Begins a step of a craft, by its number in the period; whether there is one.
    fn begin(&mut self, lane: usize, number: u32) -> bool {
        let [first, second] = &self.holds[lane];
        let of_first = first.map_or(0, |hold| hold.substeps.count);
        let hold = if number < of_first { first } else { second };
        let begun = if number < of_first { 0 } else { of_first };
        let Some(Hold { commanded_rad_s, substeps }) =
            hold.filter(|hold| number < begun + hold.substeps.count)
        else {
            self.drive.step_s[lane] = 0.0;
            return false;
        };
        if number == begun {
            let drive = &mut *self.drive;
            put(&mut drive.commanded_rad_s, lane, &commanded_rad_s);
            drive.half_decay[lane] = substeps.half_decay;
            drive.decay[lane] = substeps.decay;
            drive.step_s[lane] = substeps.step_s;
        }
        true
    }
}

#[inline(always)]
fn put<const N: usize>(rows: &mut [Lane; N], lane: usize, values: &[f64; N]) {
    for (row, value) in rows.iter_mut().zip(values) {
        row[lane] = *value;
    }
}

#[inline(always)]
fn got<const N: usize>(rows: &[Lane; N], lane: usize) -> [f64; N] {
    std::array::from_fn(|k| rows[k][lane])
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn plain(parameters: &Parameters, drive: &Drive, motion: &mut Motion) {
    step::<true, false, false>(parameters, drive, motion);
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn adjusted(parameters: &Parameters, drive: &Drive, motion: &mut Motion) {
    step::<true, true, false>(parameters, drive, motion);
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn adjusted_slowly(parameters: &Parameters, drive: &Drive, motion: &mut Motion) {
    step::<true, true, true>(parameters, drive, motion);
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn linear(parameters: &Parameters, drive: &Drive, motion: &mut Motion) {
    step::<false, true, false>(parameters, drive, motion);
}

#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
fn linear_slowly(parameters: &Parameters, drive: &Drive, motion: &mut Motion) {
    step::<false, true, true>(parameters, drive, motion);
}

/// A step in every lane.
#[inline(always)]
fn step<const OF_THESIS: bool, const ADJUSTED: bool, const SLOW: bool>(
    parameters: &Parameters,
    drive: &Drive,
    motion: &mut Motion,
) {
    for lane in 0..LANES {
        let start = Stage {
            position_ned_m: Vector3::from(got(&motion.position_ned_m, lane)),
            attitude: Vector4::from(got(&motion.attitude, lane)),
            velocity_m_s: Vector3::from(got(&motion.velocity_m_s, lane)),
            rate_rad_s: Vector3::from(got(&motion.rate_rad_s, lane)),
            pendulum: Pendulum::default(),
        };
        let (rotor, commanded) = (got(&motion.rotor_rad_s, lane), got(&drive.commanded_rad_s, lane));
        let towards =
            |decay: f64| -> [f64; 4] { std::array::from_fn(|i| decayed(rotor[i], commanded[i], decay)) };
        let rotor_rad_s = [rotor, towards(drive.half_decay[lane]), towards(drive.decay[lane])];
        let moves = InLane::<OF_THESIS, ADJUSTED> {
            parameters,
            lane,
            constants: Constants::from_numbers(|k| parameters.constants[k][lane], ADJUSTED),
            adjust: Adjustments::in_flight(|place| parameters.weights.of::<SLOW>(place, lane)),
            rotor_rad_s,
            commanded_rad_s: commanded,
        };
        let step_s = drive.step_s[lane];
        let after = stages::runge_kutta_4(&start, step_s, &moves);
        // A craft that does not step stays as it is to the bit.
        let goes = step_s > 0.0;
        let put3 = |rows: &mut [Lane; 3], before: Vector3<f64>, after: Vector3<f64>| {
            (0..3).for_each(|k| rows[k][lane] = if goes { after[k] } else { before[k] });
        };
        put3(&mut motion.position_ned_m, start.position_ned_m, after.position_ned_m);
        put3(&mut motion.velocity_m_s, start.velocity_m_s, after.velocity_m_s);
        put3(&mut motion.rate_rad_s, start.rate_rad_s, after.rate_rad_s);
        for k in 0..4 {
            motion.attitude[k][lane] = if goes { after.attitude[k] } else { start.attitude[k] };
            motion.rotor_rad_s[k][lane] = if goes { rotor_rad_s[2][k] } else { rotor[k] };
        }
    }
}

/// The craft of a lane over a step.
struct InLane<'a, const OF_THESIS: bool, const ADJUSTED: bool> {
    parameters: &'a Parameters,
    lane: usize,
    constants: Constants,
    adjust: Adjustments,
    /// At its start, in its middle and at its end.
    rotor_rad_s: [[f64; 4]; 3],
    commanded_rad_s: [f64; 4],
}

impl<const OF_THESIS: bool, const ADJUSTED: bool> Moves for InLane<'_, OF_THESIS, ADJUSTED> {
    #[inline(always)]
    fn derivative(&self, stage: &Stage, part: Part) -> Derivative {
        let Self { parameters, lane, .. } = *self;
        let rotor = &self.rotor_rad_s[part as usize];
        let lag_rad_s = parameters.lag_rad_s[lane];
        let acceleration = stages::lagged_acceleration_rad_s2(lag_rad_s, rotor, &self.commanded_rad_s);
        let input = stages::input(stage, rotor, acceleration, &Surroundings::from(0.0));
        let sample = self.adjust.straight_sample::<ADJUSTED>(&input, &self.constants);
        let a = parameters.weights.straight_accelerations::<OF_THESIS>(&sample, lane);
        stages::derivative(stage, &input.dcm, &a, parameters.gravity_m_s2[lane])
    }
}
