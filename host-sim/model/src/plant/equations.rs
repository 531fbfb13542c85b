//! The plant: the equations of motion (2.1), (2.8) with a model's effects as their terms, and a fixed-step integrator.
//!
//! State: position (NED), attitude quaternion, body velocity, body rates, rotor speeds, and the pendulum of a slung load. A quaternion instead of the
//! thesis' Euler angles: the same motion, no singularity when a simulated craft tumbles, no sines in the stages.
//! Rotors are first-order lags of the commanded speed, integrated exactly over a held command; the rest is classical
//! fourth-order Runge-Kutta. No adaptive step: equal inputs give equal bits.

use nalgebra::Vector3;

use crate::effects::Adjustments;
use crate::effects::slung_load::cable::SlungLoad;
use crate::effects::weights::Weights;
use crate::lags::Lags;
use crate::memory::Memory;
use crate::model::Model;
use crate::plant::stages::{self, Moves, Part};
use crate::plant::state::{Derivative, Stage, State};
use crate::rotor_lag::{RotorLag, decayed};
use crate::sample::{Constants, Sample, SampleInput, Surroundings};
use crate::user_effects::Undefined;
use crate::vehicle::RotorMap;

/// The longest integration step of a plant whose effects are all known, s. Commands are held and rotors integrated exactly; what is left
/// changes so slowly that a fiftieth of the step moves a craft that turns by 10 rad/s by less than 10 um in half a second.
const LONGEST_STEP_S: f64 = 0.01;

/// A control period cut into integration steps, with the rotor lag's decay over a half and a whole step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Substeps {
    pub(super) count: u32,
    pub(super) step_s: f64,
    pub(super) half_decay: f64,
    pub(super) decay: f64,
}

/// Rotor speeds that are commanded for a while.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// rad/s.
    pub commanded_rad_s: [f64; 4],
    /// The while.
    pub substeps: Substeps,
}

/// What is commanded over a control period, one after the other.
pub type Holds = [Option<Hold>; 2];

/// A model made ready to integrate.
#[derive(Debug, Clone)]
pub struct Plant {
    pub(super) constants: Constants,
    pub(super) gravity_m_s2: f64,
    adjust: Adjustments,
    map: RotorMap,
    pub(super) lag_rad_s: Option<f64>,
    load: Option<SlungLoad>,
    pub(super) weights: Weights,
    /// What its formulas look back at.
    lags: Box<Lags>,
    /// What its stages have to look at.
    pub(super) shape: Shape,
}

/// What the stages of a plant have to look at: the less, the faster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Shape {
    /// The thesis' effects in still air.
    Plain,
    /// The thesis' effects, in air that moves or with thrust that is not as the square of the speed.
    Adjusted,
    /// Other linear effects, too.
    Linear,
    /// Effects of users, a load on a cable, or angular accelerations that are solved for.
    General,
}

impl Plant {
    /// The plant of a model.
    pub fn new(model: &Model) -> Self {
        let adjust = model.adjustments();
        let weights = Weights::new(model.terms.iter().map(|term| (term.effect, term.values())));
        let load = adjust.load();
        let shape = match weights.of_thesis() {
            _ if load.is_some() || !weights.are_summed_once() => Shape::General,
            true if adjust.leaves_samples_plain() => Shape::Plain,
            true => Shape::Adjusted,
            false => Shape::Linear,
        };
        Self {
            shape,
            constants: adjust.constants(&model.vehicle),
            gravity_m_s2: model.vehicle.gravity,
            map: model.vehicle.rotor_map(),
            lag_rad_s: adjust.lag_rad_s(model.vehicle.motors.lag),
            load,
            adjust,
            lags: Box::new(Lags::new(weights.users().iter().flat_map(|(user, _)| user.lags()))),
            weights,
        }
    }

    /// What the model's adjusting effects change: sensors need the tracked point and the tilt.
    pub fn adjustments(&self) -> &Adjustments {
        &self.adjust
    }

    /// What [`Plant::sample_of`] takes of a state with rotors on their way to `commanded_rad_s`.
    pub fn input(
        &self,
        state: &State,
        commanded_rad_s: &[f64; 4],
        around: impl Into<Surroundings>,
    ) -> SampleInput {
        self.input_at(state, &state.rotor_rad_s, commanded_rad_s, &around.into())
    }

    /// The sample of a state, measured or integrated.
    #[inline]
    pub fn sample_of<'a>(&'a self, input: &'a SampleInput) -> Sample<'a> {
        self.adjust.sample(input, &self.constants)
    }

    #[inline(always)]
    fn input_at(
        &self,
        state: &State,
        rotor: &[f64; 4],
        commanded: &[f64; 4],
        around: &Surroundings,
    ) -> SampleInput {
        let acceleration = self.lagged_acceleration_rad_s2(rotor, commanded);
        self.remembering(stages::input(&Stage::of(state), rotor, acceleration, around), &state.memory)
    }

    /// With what the formulas of the model look back at, where any does: a memory of theirs, or of a past as the present is.
    pub fn remembering(&self, input: SampleInput, memory: &Memory) -> SampleInput {
        if self.lags.is_empty() {
            return input;
        }
        let memory = self.lags.begun(memory, &self.sample_of(&input));
        SampleInput { memory: Some(memory), ..input }
    }

    /// Acceleration of rotors on their way to what is commanded.
    #[inline(always)]
    fn lagged_acceleration_rad_s2(&self, rotor: &[f64; 4], commanded: &[f64; 4]) -> [f64; 4] {
        stages::lagged_acceleration_rad_s2(self.lag_rad_s.unwrap_or(0.0), rotor, commanded)
    }

    /// The six rows of (4.3) at a sample: specific force in body axes (no gravity), m/s^2, and angular acceleration,
    /// rad/s^2.
    #[inline]
    pub fn accelerations(&self, sample: &Sample) -> [f64; 6] {
        self.with_load(self.weights.accelerations(sample), sample.input)
    }

    /// The six rows without the pull of a load, at a sample with what is looked back at. Not inlined: the stages of the thesis' model are
    /// a tenth slower beside it.
    #[inline(never)]
    fn accelerations_remembering(&self, input: &SampleInput, around: &Surroundings) -> [f64; 6] {
        if around.memory.is_none() {
            return self.weights.accelerations(&self.sample_of(input));
        }
        let input = SampleInput { memory: around.memory, ..*input };
        self.weights.accelerations(&self.sample_of(&input))
    }

    /// Accelerations of everything else with the pull of a slung load, where there is one.
    fn with_load(&self, mut a: [f64; 6], input: &SampleInput) -> [f64; 6] {
        if let Some(load) = &self.load {
            let force = Vector3::new(a[0], a[1], a[2]);
            let force = load.act(force, &input.dcm, &input.pendulum, self.constants.per_mass);
            a[..3].copy_from_slice(force.as_slice());
        }
        a
    }

    /// Rotor speeds in rad/s that motor commands ask for at a battery voltage.
    #[inline]
    pub fn commanded_rad_s(&self, command: &[f64; 4], battery_v: f64) -> [f64; 4] {
        let corrected = self.adjust.corrected_at(battery_v);
        command.map(|c| corrected(self.map.speed_rad_s(c, battery_v)))
    }

    /// The commands that ask for rotor speeds at a battery voltage.
    pub fn command_for(&self, rotor_rad_s: &[f64; 4], battery_v: f64) -> [f64; 4] {
        let beyond = self.adjust.speed_change_rad_s(battery_v);
        rotor_rad_s.map(|speed| self.map.command_for(speed - beyond, battery_v))
    }

    /// Integration steps that a period needs: more of them change a flight no more than the single precision of the law does. Effects of
    /// users may be stiffer than those that are known here, and get four times as many.
    pub fn enough_substeps(&self, period_s: f64) -> u32 {
        let longest_s = if self.shape == Shape::General { LONGEST_STEP_S / 4.0 } else { LONGEST_STEP_S };
        // A period that is a whole number of them but for rounding.
        (period_s / longest_s - 1e-9).ceil().max(1.0) as u32
    }

    /// Cuts `period_s` into `count` integration steps.
    pub fn substeps(&self, period_s: f64, count: u32) -> Substeps {
        let step_s = period_s / f64::from(count);
        let decay_over = |time_s: f64| self.lag_rad_s.map_or(0.0, |lag| RotorLag::new(lag).decay(time_s));
        Substeps { count, step_s, half_decay: decay_over(0.5 * step_s), decay: decay_over(step_s) }
    }

    /// Advances `state` over the period of `substeps` with a held rotor speed command.
    pub fn step(
        &self,
        state: &mut State,
        commanded_rad_s: &[f64; 4],
        around: impl Into<Surroundings>,
        substeps: &Substeps,
    ) {
        let around = around.into();
        for _ in 0..substeps.count {
            self.lagged_step(state, commanded_rad_s, &around, substeps);
        }
    }

    /// Advances `state` by one step of `step_s` with rotor speeds that are known at its start and end (logged, or
    /// computed beforehand) and run straight in between. The state's own rotor speeds follow.
    pub fn step_between(
        &self,
        state: &mut State,
        start: &[f64; 4],
        end: &[f64; 4],
        around: impl Into<Surroundings>,
        step_s: f64,
    ) {
        let mean = std::array::from_fn(|i| 0.5 * (start[i] + end[i]));
        self.step_through(state, [start, &mean, end], around, step_s);
    }

    /// As [`Plant::step_between`], with the mean of the rotor speeds over the step, which on the way of a lag is not that of its ends.
    pub fn step_through(
        &self,
        state: &mut State,
        [start, mean, end]: [&[f64; 4]; 3],
        around: impl Into<Surroundings>,
        step_s: f64,
    ) {
        // Simpson's rule, which the step amounts to, gives the mean back.
        let middle = std::array::from_fn(|i| 0.25 * (6.0 * mean[i] - start[i] - end[i]));
        let slope = std::array::from_fn(|i| (end[i] - start[i]) / step_s);
        self.integrate(state, [start, &middle, end], |_| slope, &around.into(), step_s);
    }

    /// The formula of a user's effect that has no finite value in the step that starts at `state`, if one has none: why the
    /// state after it is not finite.
    pub fn undefined_in_step(
        &self,
        state: &State,
        commanded_rad_s: &[f64; 4],
        around: impl Into<Surroundings>,
        substeps: &Substeps,
    ) -> Option<Undefined> {
        let around = &around.into();
        let mut state = *state;
        for _ in 0..substeps.count {
            // A stage that fails shows in the stage before it: formulas are asked where Runge and Kutta ask them.
            let rotor = state.rotor_rad_s;
            let h = substeps.step_s;
            let start = Stage::of(&state);
            let mut stage = start;
            for part in [0.5, 0.5, 1.0, 0.0] {
                let acceleration = self.lagged_acceleration_rad_s2(&rotor, commanded_rad_s);
                let input = stages::input(&stage, &rotor, acceleration, around);
                let input = self.remembering(input, &state.memory);
                if let Some(undefined) = self.undefined(&self.sample_of(&input)) {
                    return Some(undefined);
                }
                let around = Surroundings { memory: input.memory, ..*around };
                let k = self.derivative(&stage, &rotor, acceleration, &around);
                stage = start.moved(&k, part * h);
            }
            self.lagged_step(&mut state, commanded_rad_s, around, substeps);
        }
        None
    }

    /// What the formulas of the model look back at.
    pub fn lags(&self) -> &Lags {
        &self.lags
    }

    /// Whether the model has effects of users.
    pub fn has_user_effects(&self) -> bool {
        !self.weights.users().is_empty()
    }

    /// The formula of a user's effect that has no finite value at a sample, if one has none.
    pub fn undefined(&self, sample: &Sample) -> Option<Undefined> {
        self.weights.users().iter().find_map(|(user, coefficients)| user.undefined(sample, coefficients))
    }

    fn lagged_step(
        &self,
        state: &mut State,
        commanded: &[f64; 4],
        around: &Surroundings,
        substeps: &Substeps,
    ) {
        let start = state.rotor_rad_s;
        let towards =
            |decay: f64| -> [f64; 4] { std::array::from_fn(|i| decayed(start[i], commanded[i], decay)) };
        let (middle, end) = (towards(substeps.half_decay), towards(substeps.decay));
        let slope = |rotor: &[f64; 4]| self.lagged_acceleration_rad_s2(rotor, commanded);
        self.integrate(state, [&start, &middle, &end], slope, around, substeps.step_s);
    }

    /// One Runge-Kutta step with the rotor speeds at its start, middle and end.
    #[inline]
    fn integrate(
        &self,
        state: &mut State,
        rotor: [&[f64; 4]; 3],
        rotor_acceleration: impl Fn(&[f64; 4]) -> [f64; 4],
        around: &Surroundings,
        step_s: f64,
    ) {
        match self.shape {
            Shape::Plain => {
                self.straight_step::<true, false>(state, rotor, rotor_acceleration, around, step_s)
            }
            Shape::Adjusted => {
                self.straight_step::<true, true>(state, rotor, rotor_acceleration, around, step_s);
            }
            _ if self.lags.is_empty() => {
                self.general_step(state, rotor, rotor_acceleration, [around; 3], step_s);
            }
            _ => self.step_with_memory(state, rotor, rotor_acceleration, around, step_s),
        }
    }

    /// A step with lags, which are slow beside it: its stages see them as if what they follow stayed, and at its end they have followed
    /// what went straight from its start to its end.
    #[inline(never)]
    fn step_with_memory(
        &self,
        state: &mut State,
        rotor: [&[f64; 4]; 3],
        rotor_acceleration: impl Fn(&[f64; 4]) -> [f64; 4],
        around: &Surroundings,
        step_s: f64,
    ) {
        let input = |state: &State, rotor: &[f64; 4]| {
            stages::input(&Stage::of(state), rotor, rotor_acceleration(rotor), around)
        };
        let start = input(state, rotor[0]);
        let before = self.sample_of(&start);
        let began = self.lags.begun(&state.memory, &before);
        let held = |time_s: f64| self.lags.after(&began, [&before, &before], time_s);
        let [first, middle, end] = [began, held(0.5 * step_s), held(step_s)]
            .map(|memory| Surroundings { memory: Some(memory), ..*around });
        self.general_step(state, rotor, &rotor_acceleration, [&first, &middle, &end], step_s);
        let after = input(state, rotor[2]);
        state.memory = self.lags.after(&began, [&before, &self.sample_of(&after)], step_s);
    }

    /// A step of a plant whose stages need no branch.
    #[inline(always)]
    fn straight_step<const OF_THESIS: bool, const ADJUSTED: bool>(
        &self,
        state: &mut State,
        rotor: [&[f64; 4]; 3],
        rotor_acceleration: impl Fn(&[f64; 4]) -> [f64; 4],
        around: &Surroundings,
        step_s: f64,
    ) {
        let moves = Straight::<OF_THESIS, ADJUSTED, _> { plant: self, rotor, rotor_acceleration, around };
        let end = stages::runge_kutta_4(&Stage::of(state), step_s, &moves);
        end.put_into::<false>(state);
        state.rotor_rad_s = *rotor[2];
    }

    /// A step of any plant.
    fn general_step(
        &self,
        state: &mut State,
        rotor: [&[f64; 4]; 3],
        rotor_acceleration: impl Fn(&[f64; 4]) -> [f64; 4],
        around: [&Surroundings; 3],
        step_s: f64,
    ) {
        let moves = General { plant: self, rotor, rotor_acceleration, around };
        let end = stages::runge_kutta_4(&Stage::of(state), step_s, &moves);
        end.put_into::<true>(state);
        state.rotor_rad_s = *rotor[2];
    }

    /// Of any plant.
    #[inline]
    fn derivative(
        &self,
        state: &Stage,
        rotor: &[f64; 4],
        rotor_acceleration_rad_s2: [f64; 4],
        around: &Surroundings,
    ) -> Derivative {
        let input = stages::input(state, rotor, rotor_acceleration_rad_s2, around);
        let a = self.accelerations_remembering(&input, around);
        let Some(load) = &self.load else {
            return stages::derivative(state, &input.dcm, &a, self.gravity_m_s2);
        };
        let force_ned_m_s2 = input.dcm.tr_mul(&Vector3::new(a[0], a[1], a[2]));
        let pendulum = load.derivative(&state.pendulum, force_ned_m_s2, self.gravity_m_s2);
        let with_load = self.with_load(a, &input);
        Derivative { pendulum, ..stages::derivative(state, &input.dcm, &with_load, self.gravity_m_s2) }
    }
}

/// A step whose stages need no branch.
struct Straight<'a, const OF_THESIS: bool, const ADJUSTED: bool, F> {
    plant: &'a Plant,
    rotor: [&'a [f64; 4]; 3],
    rotor_acceleration: F,
    around: &'a Surroundings,
}

impl<const OF_THESIS: bool, const ADJUSTED: bool, F: Fn(&[f64; 4]) -> [f64; 4]> Moves
    for Straight<'_, OF_THESIS, ADJUSTED, F>
{
    #[inline(always)]
    fn derivative(&self, stage: &Stage, part: Part) -> Derivative {
        let (plant, rotor) = (self.plant, self.rotor[part as usize]);
        let input = stages::input(stage, rotor, (self.rotor_acceleration)(rotor), self.around);
        let sample = plant.adjust.straight_sample::<ADJUSTED>(&input, &plant.constants);
        let a = plant.weights.straight_accelerations::<OF_THESIS>(&sample);
        stages::derivative(stage, &input.dcm, &a, plant.gravity_m_s2)
    }
}

/// A step of any plant.
struct General<'a, F> {
    plant: &'a Plant,
    rotor: [&'a [f64; 4]; 3],
    rotor_acceleration: F,
    around: [&'a Surroundings; 3],
}

impl<F: Fn(&[f64; 4]) -> [f64; 4]> Moves for General<'_, F> {
    #[inline(always)]
    fn derivative(&self, stage: &Stage, part: Part) -> Derivative {
        let rotor = self.rotor[part as usize];
        self.plant.derivative(stage, rotor, (self.rotor_acceleration)(rotor), self.around[part as usize])
    }
}

#[cfg(test)]
mod tests {
    //! A free body keeps its energy and its angular momentum; each check has a twin with a term off that must fail.

    use super::*;
    use crate::effects::Effect;
    use crate::frames;
    use crate::plant::DelayLine;
    use crate::vehicle::Vehicle;

    /// Principal moments of inertia of the test body, kg m^2. They differ, so that the Euler terms matter.
    const INERTIA: [f64; 3] = [0.012, 0.016, 0.025];

    /// No air and no rotors: only the Euler terms, and gravity as asked.
    fn free_body(gravity_m_s2: f64, euler_terms: bool) -> Plant {
        let mut model = Model::new(Vehicle::thesis());
        let [x, y, z] = INERTIA;
        let ratios = [(y - z) / x, (z - x) / y, (x - y) / z];
        if euler_terms {
            model.set(Effect::InertiaCoupling, &ratios);
        }
        let mut plant = Plant::new(&model);
        plant.gravity_m_s2 = gravity_m_s2;
        plant
    }

    fn tumbling() -> State {
        let mut state = State::at_rest(Vector3::new(0.0, 0.0, -10.0), [0.0; 4]);
        state.velocity_m_s = Vector3::new(1.0, -0.5, 0.3);
        state.rate_rad_s = Vector3::new(2.0, 0.7, -1.1);
        state
    }

    fn angular_momentum(state: &State) -> Vector3<f64> {
        let body = state.rate_rad_s.component_mul(&Vector3::from(INERTIA));
        frames::dcm_from_quaternion(&state.attitude).tr_mul(&body)
    }

    fn energy(state: &State, gravity_m_s2: f64) -> f64 {
        let mass = Vehicle::thesis().mass;
        let turning = state.rate_rad_s.component_mul(&state.rate_rad_s).dot(&Vector3::from(INERTIA));
        0.5 * mass * state.velocity_m_s.norm_squared() + 0.5 * turning
            - mass * gravity_m_s2 * state.position_ned_m.z
    }

    fn after_10_s(plant: &Plant) -> State {
        let mut state = tumbling();
        let substeps = plant.substeps(0.01, 10);
        for _ in 0..1000 {
            plant.step(&mut state, &[0.0; 4], 11.1, &substeps);
        }
        state
    }

    #[test]
    fn free_body_keeps_angular_momentum_for_10_s() {
        let before = angular_momentum(&tumbling());
        let drift =
            |euler| (angular_momentum(&after_10_s(&free_body(9.81, euler))) - before).norm() / before.norm();
        assert!(drift(true) < 1e-9, "{}", drift(true));
        assert!(drift(false) > 1e-3, "without the Euler terms it must drift: {}", drift(false));
    }

    #[test]
    fn falling_body_keeps_energy_for_10_s() {
        let before = energy(&tumbling(), 9.81);
        let drift = |euler| (energy(&after_10_s(&free_body(9.81, euler)), 9.81) / before - 1.0).abs();
        assert!(drift(true) < 1e-9, "{}", drift(true));
        // The twin: gravity that does no work over ground (0 in the plant, 9.81 in the balance).
        let twin = (energy(&after_10_s(&free_body(0.0, true)), 9.81) / before - 1.0).abs();
        assert!(twin > 1e-3, "{twin}");
    }

    #[test]
    fn energy_of_rotation_needs_the_euler_terms_to_agree_with_each_other() {
        let turning = |s: &State| s.rate_rad_s.component_mul(&s.rate_rad_s).dot(&Vector3::from(INERTIA));
        let before = turning(&tumbling());
        assert!((turning(&after_10_s(&free_body(9.81, true))) / before - 1.0).abs() < 1e-9);
        let mut model = Model::new(Vehicle::thesis());
        // The thesis' three ratios do not belong to one inertia tensor (reference section 1): energy is not kept.
        model.set(Effect::InertiaCoupling, &[-0.1410, 0.7610, 0.0834]);
        let wrong = turning(&after_10_s(&Plant::new(&model))) / before - 1.0;
        assert!(wrong.abs() > 1e-3, "{wrong}");
    }

    #[test]
    fn a_falling_body_follows_the_parabola() {
        let plant = free_body(9.81, true);
        let end = after_10_s(&plant);
        let expected = Vector3::new(10.0, -5.0, -10.0 + 3.0 + 0.5 * 9.81 * 100.0);
        assert!((end.position_ned_m - expected).norm() < 1e-9, "{}", end.position_ned_m);
    }

    #[test]
    fn rotors_follow_the_closed_form_of_a_first_order_lag() {
        let plant = Plant::new(&Model::thesis());
        let mut state = State::at_rest(Vector3::zeros(), [600.0; 4]);
        let commanded = [700.0, 500.0, 600.0, 0.0];
        plant.step(&mut state, &commanded, 11.1, &plant.substeps(0.1, 10));
        for (rotor, target) in state.rotor_rad_s.iter().zip(commanded) {
            let exact = target + (600.0 - target) * (-21.5_f64 * 0.1).exp();
            assert!((rotor - exact).abs() < 1e-9);
        }
    }

    #[test]
    fn a_delay_line_shifts_the_response_by_the_dead_time() {
        let mut model = Model::thesis();
        model.set(Effect::InputDelay, &[0.025]);
        let plant = Plant::new(&model);
        let mut line = DelayLine::new(&plant, 0.01, 4, plant.command_for(&[600.0; 4], 11.1));
        let mut state = State::at_rest(Vector3::zeros(), [600.0; 4]);
        let command = plant.command_for(&[700.0; 4], 11.1);
        for _ in 0..10 {
            line.step(&plant, &mut state, &command, &11.1.into());
        }
        let exact = 700.0 - 100.0 * (-21.5_f64 * (0.1 - 0.025)).exp();
        assert!((state.rotor_rad_s[0] - exact).abs() < 1e-9, "{} {exact}", state.rotor_rad_s[0]);
    }

    #[test]
    fn a_product_of_inertia_keeps_the_angular_momentum_of_its_tensor() {
        // Ixz = 0.001 kg m^2 in the tensor [[Ix 0 -Ixz] [0 Iy 0] [-Ixz 0 Iz]].
        let ([x, y, z], xz) = (INERTIA, 0.001);
        let tensor = nalgebra::Matrix3::new(x, 0.0, -xz, 0.0, y, 0.0, -xz, 0.0, z);
        let drift = |terms: &[f64; 3]| {
            let mut model = Model::new(Vehicle::thesis());
            model.set(Effect::InertiaCoupling, &[(y - z) / x, (z - x) / y, (x - y) / z]);
            model.set(Effect::ProductOfInertia, terms);
            let end = after_10_s(&Plant::new(&model));
            let momentum =
                |s: &State| frames::dcm_from_quaternion(&s.attitude).tr_mul(&(tensor * s.rate_rad_s));
            (momentum(&end) - momentum(&tumbling())).norm() / momentum(&tumbling()).norm()
        };
        assert!(drift(&[xz / x, xz / y, xz / z]) < 1e-9, "{}", drift(&[xz / x, xz / y, xz / z]));
        assert!(drift(&[xz / x, 0.0, xz / z]) > 1e-3);
    }

    #[test]
    fn thesis_plant_hovers_at_the_reference_rotor_speeds() {
        // Reference section 1, hover with the printed K^-1.
        let plant = Plant::new(&Model::thesis());
        let rotor = [611.4090, 634.3527, 633.6577, 657.8632];
        let state = State::at_rest(Vector3::new(0.0, 0.0, -1.0), rotor);
        let a = plant.accelerations(&plant.sample_of(&plant.input(&state, &rotor, 11.1)));
        assert!((a[2] + 9.81).abs() < 1e-4, "{a:?}");
        // Torques vanish to the four digits K^-1 is printed with.
        assert!(a[3].abs() < 2e-2 && a[4].abs() < 2e-2 && a[5].abs() < 2e-2, "{a:?}");
    }

    #[test]
    fn halving_the_step_changes_a_manoeuvre_as_fourth_order_does() {
        let plant = Plant::new(&Model::thesis());
        let fly = |count| {
            let mut state = State::at_rest(Vector3::new(0.0, 0.0, -1.0), [635.0; 4]);
            for k in 0..100 {
                let d = 20.0 * (0.2 * f64::from(k)).sin();
                plant.step(
                    &mut state,
                    &[635.0 + d, 635.0 - d, 633.0, 640.0],
                    11.1,
                    &plant.substeps(0.01, count),
                );
            }
            state
        };
        let fine = fly(16);
        let error = |count| (fly(count).rate_rad_s - fine.rate_rad_s).norm();
        let order = (error(1) / error(2)).log2();
        assert!(order > 3.5, "order {order}, errors {} {}", error(1), error(2));
    }
}
