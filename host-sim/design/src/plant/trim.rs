//! The equilibrium that a model is linearised about, thesis (5.13) and (5.14).
//!
//! `J = Z' . Z'` (the derivative of the state, taken against the demanded motion) is made least
//! over roll, pitch and the four squared rotor speeds by L-BFGS of the crate argmin; the thesis
//! used MATLAB's `fmincon` on the same cost. The reached cost is part of the answer: a model that
//! cannot hover has no small one.

use std::cell::Cell;
use std::path::Path;

use argmin::core::{CostFunction, Executor, Gradient, State as _};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;
use model::{Effect, Memory, Model, Pendulum, Plant, SampleInput, frames, user_effects};
use nalgebra::Vector3;
use serde::Deserialize;

use crate::error::{DesignError, Result};

/// Names of the states in the order of (5.13).
pub const STATES: [&str; 12] = ["x_e", "y_e", "z_e", "u", "v", "w", "phi", "theta", "psi", "p", "q", "r"];
/// Units of the states.
pub const STATE_UNITS: [&str; 12] =
    ["m", "m", "m", "m/s", "m/s", "m/s", "rad", "rad", "rad", "rad/s", "rad/s", "rad/s"];
/// Names of the inputs in the order of (5.13).
pub const INPUTS: [&str; 4] = ["T_Z", "tau_phi", "tau_theta", "tau_psi"];
/// Units of the inputs.
pub const INPUT_UNITS: [&str; 4] = ["N", "rad/s^2", "rad/s^2", "rad/s^2"];

/// What the craft does at the equilibrium; the default is hover at 1 m, (5.14).
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrimTarget {
    /// Velocity over ground, inertial NED, m/s.
    pub velocity_ned_m_s: [f64; 3],
    /// Heading, rad.
    pub yaw_rad: f64,
    /// Inertial z, m, down positive.
    pub z_m: f64,
    /// Battery voltage, V; absent: the model's reference.
    pub battery_v: Option<f64>,
}

impl Default for TrimTarget {
    fn default() -> Self {
        Self { velocity_ned_m_s: [0.0; 3], yaw_rad: 0.0, z_m: -1.0, battery_v: None }
    }
}

impl TrimTarget {
    /// Reads and checks a trim file.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| DesignError::Read { path: path.to_owned(), source })?;
        let refuse = |message: String| DesignError::Parse { path: path.to_owned(), message };
        let target: Self = toml::from_str(&text).map_err(|e| refuse(gains_file::toml_message(&text, &e)))?;
        let within = |name: &str, value: f64, limit: f64| {
            if value.abs() <= limit {
                return Ok(());
            }
            Err(refuse(format!("{name} = {value}: give a number from -{limit} to {limit}")))
        };
        for value in target.velocity_ned_m_s {
            within("velocity_ned_m_s", value, 100.0)?;
        }
        within("yaw_rad", target.yaw_rad, 10.0)?;
        within("z_m", target.z_m, 1e4)?;
        within("battery_v", target.battery_v.unwrap_or(0.0), 1000.0)?;
        Ok(target)
    }
}

/// An equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct Equilibrium {
    /// State in the order of [`STATES`], SI.
    pub state: [f64; 12],
    /// Thrust (N) and rotor-borne angular accelerations (rad/s^2) in the order of [`INPUTS`].
    pub inputs: [f64; 4],
    /// Rotor speeds, rad/s.
    pub rotor_rad_s: [f64; 4],
    /// Battery voltage, V.
    pub battery_v: f64,
    /// The cost J of (5.13) that was reached, SI squared.
    pub cost: f64,
    /// Iterations of the optimiser.
    pub iterations: u64,
}

/// A model as `Z' = f(Z, rotor speeds)` in Euler angles, for differentiation.
pub(crate) struct Dynamics {
    pub(crate) plant: Plant,
    pub(crate) mass_kg: f64,
    gravity_m_s2: f64,
    pub(crate) battery_v: f64,
    /// What formulas name besides: the time, which is that of the start.
    further: model::Further,
}

impl Dynamics {
    pub(crate) fn new(model: &Model, battery_v: Option<f64>) -> Self {
        let mut further = model::NO_FURTHER;
        let columns = user_effects::columns().into_iter().zip(&mut further);
        columns.filter(|(name, _)| *name == user_effects::TIME_COLUMN).for_each(|(_, value)| *value = 0.0);
        Self {
            further,
            mass_kg: model.vehicle.mass + model.adjustments().extra_mass_kg(),
            gravity_m_s2: model.vehicle.gravity,
            battery_v: battery_v.unwrap_or(model.reference.battery_v),
            plant: Plant::new(model),
        }
    }

    /// Of a model that has what carries and turns it, and no states beside those of (5.13).
    fn that_hover(model: &Model, target: &TrimTarget) -> Result<Self> {
        for (effect, channel) in [(Effect::Thrust, "altitude"), (Effect::RotorMoments, "roll, pitch and yaw")]
        {
            if !model.has(effect) {
                return Err(DesignError::MissingEffect { effect: effect.id(), channel });
            }
        }
        if let Some(load) = model.effects().into_iter().find(|effect| effect.info().special.hangs_load) {
            return Err(DesignError::Swinging { effect: load.id() });
        }
        Ok(Self::new(model, target.battery_v))
    }

    /// Specific force and angular acceleration, the six rows of (4.3). What formulas look back at has always been as it is.
    fn accelerations(&self, z: &[f64; 12], rotor: &[f64; 4], rotor_acceleration: &[f64; 4]) -> [f64; 6] {
        let euler = Vector3::new(z[6], z[7], z[8]);
        let input = SampleInput {
            position_ned_m: Vector3::new(z[0], z[1], z[2]),
            dcm: frames::dcm_from_euler(euler),
            velocity_m_s: Vector3::new(z[3], z[4], z[5]),
            rate_rad_s: Vector3::new(z[9], z[10], z[11]),
            angular_acceleration_rad_s2: Vector3::zeros(),
            rotor_rad_s: *rotor,
            rotor_acceleration_rad_s2: *rotor_acceleration,
            battery_v: self.battery_v,
            pendulum: Pendulum::default(),
            memory: None,
            further: self.further,
        };
        let input = self.plant.remembering(input, &Memory::default());
        self.plant.accelerations(&self.plant.sample_of(&input))
    }

    /// The derivative of the state, (2.8) with the resolutions of its misprints.
    pub(crate) fn derivative(
        &self,
        z: &[f64; 12],
        rotor: &[f64; 4],
        rotor_acceleration: &[f64; 4],
    ) -> [f64; 12] {
        let a = self.accelerations(z, rotor, rotor_acceleration);
        let euler = Vector3::new(z[6], z[7], z[8]);
        let (velocity, rate) = (Vector3::new(z[3], z[4], z[5]), Vector3::new(z[9], z[10], z[11]));
        let dcm = frames::dcm_from_euler(euler);
        let position = dcm.tr_mul(&velocity);
        let velocity =
            Vector3::new(a[0], a[1], a[2]) + dcm.column(2) * self.gravity_m_s2 - rate.cross(&velocity);
        let euler = frames::euler_rates_from_body(euler, rate);
        [
            position.x, position.y, position.z, velocity.x, velocity.y, velocity.z, euler.x, euler.y,
            euler.z, a[3], a[4], a[5],
        ]
    }

    /// What the rotors do: thrust in N (up) and angular accelerations in rad/s^2, the left side of
    /// (5.11).
    pub(crate) fn rotor_effort(&self, z: &[f64; 12], rotor: &[f64; 4]) -> [f64; 4] {
        let (on, off) =
            (self.accelerations(z, rotor, &[0.0; 4]), self.accelerations(z, &[0.0; 4], &[0.0; 4]));
        [-self.mass_kg * (on[2] - off[2]), on[3] - off[3], on[4] - off[4], on[5] - off[5]]
    }
}

/// Roll, pitch and squared rotor speeds (over that of an even hover) are searched.
struct Search<'a> {
    dynamics: &'a Dynamics,
    target: TrimTarget,
    hover_rad2_s2: f64,
    /// Costs and slopes asked for.
    evaluations: Cell<u32>,
}

/// Where there is no equilibrium, a line search may not end. Where there is one, thousands of
/// evaluations find it.
const MOST_EVALUATIONS: u32 = 50_000;

impl<'a> Search<'a> {
    fn new(dynamics: &'a Dynamics, target: TrimTarget, hover_rad2_s2: f64) -> Self {
        Self { dynamics, target, hover_rad2_s2, evaluations: Cell::new(0) }
    }

    /// About rotors that carry the weight evenly.
    fn from_hover(dynamics: &'a Dynamics, target: TrimTarget) -> Result<Self> {
        let level = Self::new(dynamics, target, 1.0).state(&[0.0; 6]);
        // Thrust of one (rad/s)^2 at each rotor, found where it is large against drag.
        let per_square = dynamics.rotor_effort(&level, &[1000.0; 4])[0] / 1e6;
        if !(per_square > 0.0) {
            return Err(DesignError::Uncontrollable { channel: "z", input: "T_Z", output: "w" });
        }
        Ok(Self::new(dynamics, target, dynamics.mass_kg * dynamics.gravity_m_s2 / per_square))
    }

    fn count(&self) -> std::result::Result<(), argmin::core::Error> {
        self.evaluations.set(self.evaluations.get() + 1);
        if self.evaluations.get() > MOST_EVALUATIONS {
            return Err(argmin::core::Error::msg("no equilibrium near"));
        }
        Ok(())
    }

    fn state(&self, x: &[f64]) -> [f64; 12] {
        let euler = Vector3::new(x[0], x[1], self.target.yaw_rad);
        let body = frames::dcm_from_euler(euler) * Vector3::from(self.target.velocity_ned_m_s);
        let mut z = [0.0; 12];
        z[2] = self.target.z_m;
        z[3..6].copy_from_slice(body.as_slice());
        z[6..9].copy_from_slice(euler.as_slice());
        z
    }

    fn rotor(&self, x: &[f64]) -> [f64; 4] {
        std::array::from_fn(|i| (x[2 + i].max(0.0) * self.hover_rad2_s2).sqrt())
    }

    /// The derivative of the state beyond the demanded motion.
    fn rest(&self, x: &[f64]) -> [f64; 12] {
        let mut rest = self.dynamics.derivative(&self.state(x), &self.rotor(x), &[0.0; 4]);
        for (rest, wanted) in rest.iter_mut().zip(self.target.velocity_ned_m_s) {
            *rest -= wanted;
        }
        rest
    }
}

impl CostFunction for Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    fn cost(&self, x: &Self::Param) -> std::result::Result<f64, argmin::core::Error> {
        self.count()?;
        Ok(self.rest(x).iter().map(|r| r * r).sum())
    }
}

impl Gradient for Search<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;
    fn gradient(&self, x: &Self::Param) -> std::result::Result<Vec<f64>, argmin::core::Error> {
        self.count()?;
        let rest = self.rest(x);
        let slope = |i: usize| {
            // The cube root of the rounding error balances it against the third derivative.
            let h = 6e-6;
            let (mut more, mut less) = (x.clone(), x.clone());
            (more[i], less[i]) = (x[i] + h, x[i] - h);
            let (more, less) = (self.rest(&more), self.rest(&less));
            (0..12).map(|k| 2.0 * rest[k] * (more[k] - less[k]) / (2.0 * h)).sum()
        };
        Ok((0..x.len()).map(slope).collect())
    }
}

/// J below which a craft is at rest: accelerations of a micrometre per second squared.
const AT_REST: f64 = 1e-12;
/// J beyond which nothing is gained: the square of the rounding error of accelerations near 100.
const ENOUGH: f64 = 1e-24;

/// Finds the equilibrium of a model.
///
/// # Errors
/// A model without thrust or rotor moments, or without an equilibrium.
pub fn equilibrium(model: &Model, target: &TrimTarget) -> Result<Equilibrium> {
    let dynamics = &Dynamics::that_hover(model, target)?;
    let search = Search::from_hover(dynamics, *target)?;
    let (mut best, mut cost, iterations) = least_cost(&search)?;
    // The search may go round: of equal angles, those within half a turn.
    best[..2].iter_mut().for_each(|angle| *angle = frames::within_half_turn(*angle));
    if !cost.is_finite() {
        cost = search.cost(&best).unwrap_or(f64::INFINITY);
    }
    if !(cost <= AT_REST) {
        let rest = search.rest(&best);
        let worst = (0..12).max_by(|&i, &j| rest[i].abs().total_cmp(&rest[j].abs())).unwrap_or(0);
        return Err(DesignError::NoEquilibrium {
            cost,
            worst: STATES[worst],
            hint: "the motion asked for may need more tilt or thrust than the craft has, or a coefficient has the wrong sign",
        });
    }
    let (state, rotor_rad_s) = (search.state(&best), search.rotor(&best));
    Ok(Equilibrium {
        inputs: dynamics.rotor_effort(&state, &rotor_rad_s),
        state,
        rotor_rad_s,
        battery_v: dynamics.battery_v,
        cost,
        iterations,
    })
}

/// Where the cost is least, the cost there, and the iterations that it took.
fn least_cost(search: &Search) -> Result<(Vec<f64>, f64, u64)> {
    let (mut best, mut cost, mut iterations) = (EVEN.to_vec(), f64::INFINITY, 0);
    // A line search ends where rounding hides the slope; starting again from there gains the last
    // digits.
    for _ in 0..6 {
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), 6)
            .with_tolerance_grad(0.0)
            .and_then(|solver| solver.with_tolerance_cost(0.0))
            .map_err(|e| DesignError::Optimiser(e.to_string()))?;
        let run = Executor::new(Search::new(search.dynamics, search.target, search.hover_rad2_s2), solver)
            .configure(|state| state.param(best.clone()).max_iters(200).target_cost(ENOUGH))
            .run();
        let Ok(result) = run else { break };
        iterations += result.state().get_iter();
        let reached = result.state().get_best_cost();
        let Some(x) = result.state().get_best_param() else { break };
        if reached < cost {
            (best, cost) = (x.clone(), reached);
        }
        if cost <= ENOUGH {
            break;
        }
    }
    Ok((best, cost, iterations))
}

/// The rotor speeds of an equilibrium near level hover with even rotors, rad/s: what [`equilibrium`] finds there, sooner and as exactly as
/// a craft is at rest. Nothing where there is none so near, which does not say that there is none.
pub fn hover_nearby(model: &Model, target: &TrimTarget) -> Option<[f64; 4]> {
    /// How far from level is near, rad, and how far squared speeds are from even, as a share: there both searches find the same. Farther
    /// away, where a rotor all but stands, that of [`equilibrium`] can end without an answer.
    const NEAR: [f64; 2] = [0.5, 0.3];
    let dynamics = Dynamics::that_hover(model, target).ok()?;
    let search = Search::from_hover(&dynamics, *target).ok()?;
    let lean = search.newton(&EVEN)?;
    let is_near = (0..6).all(|k| (lean[k] - EVEN[k]).abs() < NEAR[usize::from(k > 1)]);
    is_near.then(|| search.rotor(&lean))
}

/// Equilibria of a craft that slides faster and faster, each found from the one before: six
/// accelerations are to vanish by roll, pitch and four rotors, so Newton's method does, and where
/// it does not there is none nearby.
pub(crate) struct Slide {
    dynamics: Dynamics,
    hover_rad2_s2: f64,
}

/// Roll, pitch and squared rotor speeds over that of an even hover.
pub(crate) type Lean = [f64; 6];
/// Level, with even rotors.
const EVEN: Lean = [0.0, 0.0, 1.0, 1.0, 1.0, 1.0];

impl Slide {
    /// From hover at a battery voltage; the lean there too.
    pub(crate) fn new(model: &Model, battery_v: f64) -> Result<(Self, Lean)> {
        let hover = equilibrium(model, &TrimTarget { battery_v: Some(battery_v), ..TrimTarget::default() })?;
        let hover_rad2_s2 = hover.rotor_rad_s.iter().map(|w| w * w).sum::<f64>() / 4.0;
        let rotor = hover.rotor_rad_s.map(|w| w * w / hover_rad2_s2);
        let lean = [hover.state[6], hover.state[7], rotor[0], rotor[1], rotor[2], rotor[3]];
        Ok((Self { dynamics: Dynamics::new(model, Some(battery_v)), hover_rad2_s2 }, lean))
    }

    /// The lean and the rotor speeds, rad/s, of a slide at this velocity over ground, m/s, next to
    /// another.
    pub(crate) fn at(&self, velocity_ned_m_s: [f64; 3], near: &Lean) -> Option<(Lean, [f64; 4])> {
        let target = TrimTarget { velocity_ned_m_s, ..TrimTarget::default() };
        let search = Search::new(&self.dynamics, target, self.hover_rad2_s2);
        let lean = search.newton(near)?;
        Some((lean, search.rotor(&lean)))
    }
}

impl Search<'_> {
    /// The equilibrium next to a lean by Newton's method: six accelerations are to vanish by roll, pitch and four rotors.
    fn newton(&self, near: &Lean) -> Option<Lean> {
        const ROUNDS: usize = 30;
        let accelerations = |x: &Lean| -> nalgebra::SVector<f64, 6> {
            let rest = self.rest(x);
            nalgebra::SVector::from_fn(|i, _| rest[[3, 4, 5, 9, 10, 11][i]])
        };
        let mut lean = *near;
        for _ in 0..ROUNDS {
            let rest = accelerations(&lean);
            if rest.norm_squared() <= AT_REST {
                return Some(lean);
            }
            let mut slopes = nalgebra::SMatrix::<f64, 6, 6>::zeros();
            for k in 0..6 {
                let moved = |by: f64| {
                    accelerations(&std::array::from_fn(|i| lean[i] + if i == k { by } else { 0.0 }))
                };
                slopes.set_column(k, &((moved(1e-6) - moved(-1e-6)) / 2e-6));
            }
            let step = slopes.lu().solve(&rest)?;
            lean = std::array::from_fn(|i| lean[i] - step[i]);
            // Beyond a right angle, or with rotors that would have to pull, nothing flies.
            if !(lean[0].abs() < 1.5 && lean[1].abs() < 1.5 && lean[2..].iter().all(|w| *w > 0.0)) {
                return None;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (5.14): 1.214 kg at 9.81 m/s^2. Reference section 1, "Hover per motor", tables with C_T =
    /// 0.018033: the squares of its speeds for C_T = 0.0180 scale the thrust column only, so the
    /// speeds of the printed K^-1 are near.
    #[test]
    fn the_thesis_hover() {
        let e = equilibrium(&Model::thesis(), &TrimTarget::default()).unwrap();
        assert!(e.cost < 1e-20, "{}", e.cost);
        assert!((e.inputs[0] - 1.214 * 9.81).abs() < 1e-9, "{:?}", e.inputs);
        assert!(e.inputs[1..].iter().all(|tau| tau.abs() < 1e-9), "{:?}", e.inputs);
        assert_eq!(e.state[2], -1.0);
        assert!(e.state.iter().enumerate().all(|(i, z)| i == 2 || z.abs() < 1e-9), "{:?}", e.state);
        for (got, want) in e.rotor_rad_s.iter().zip([611.4090, 634.3527, 633.6577, 657.8632]) {
            // The printed K^-1 has 4 to 5 digits.
            assert!((got / want - 1.0).abs() < 5e-5, "{got} {want}");
        }
    }

    /// In wind a hovering craft leans; at rest in still air relative to the wind the sideways force
    /// balances the drag: tan of the pitch is drag over weight, from the force balance along the
    /// inertial axes.
    #[test]
    fn wind_is_leant_against() {
        let mut model = Model::thesis();
        model.set(Effect::SteadyWind, &[2.0, 0.0]);
        let e = equilibrium(&model, &TrimTarget::default()).unwrap();
        assert!(e.cost < 1e-20);
        // Wind from behind (towards north): the craft leans back, nose up, and drag -C_du (u - 2)
        // is balanced.
        let theta = e.state[7];
        let forward = 0.2520 * 2.0 * theta.cos().powi(2) + 0.2609 * 2.0 * theta.sin().powi(2);
        assert!(theta > 0.0 && (e.inputs[0] * theta.sin() - forward).abs() < 1e-6, "{theta} {forward}");
    }

    /// The swing of a load is a state of its own, which the twelve of (5.13) do not have.
    #[test]
    fn a_craft_with_a_swinging_load_is_refused() {
        let mut model = Model::thesis();
        model.set(Effect::SlungLoad, &[0.05, 0.4, 0.05]);
        let error = equilibrium(&model, &TrimTarget::default()).unwrap_err().to_string();
        assert!(error.contains("slung-load") && error.contains("mass-change"), "{error}");
    }

    /// A craft that leans against wind with a load on one side; half of one rotor's thrust gone is no hover near even rotors.
    #[test]
    fn what_is_found_nearby_is_the_equilibrium() {
        let mut model = Model::thesis();
        model.set(Effect::SteadyWind, &[2.0, -1.0]);
        model.set(Effect::ComOffset, &[0.004, -0.002]);
        let target = TrimTarget { battery_v: Some(10.9), ..TrimTarget::default() };
        let rotor_rad_s = equilibrium(&model, &target).unwrap().rotor_rad_s;
        for (one, near) in rotor_rad_s.into_iter().zip(hover_nearby(&model, &target).unwrap()) {
            assert!((one / near - 1.0).abs() < 1e-6, "{one} {near}");
        }
        model.set(Effect::MotorEfficiency, &[0.5, 0.0, 0.0, 0.0]);
        assert_eq!(hover_nearby(&model, &target), None);
    }

    #[test]
    fn what_cannot_hover_says_why() {
        let mut model = Model::thesis();
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        let error = equilibrium(&model, &TrimTarget::default()).unwrap_err().to_string();
        assert!(error.contains("rotor-moments"), "{error}");
        let mut model = Model::thesis();
        // All four rotors yaw the same way: nothing holds the heading but the damping.
        model.set(Effect::RotorMoments, &[0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.6, 0.3, 0.3, 0.3, 0.3]);
        let error = equilibrium(&model, &TrimTarget::default()).unwrap_err().to_string();
        assert!(error.contains("no equilibrium") && error.contains("J of (5.13)"), "{error}");
    }
}
