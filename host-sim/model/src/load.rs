//! A load on a cable under the craft: a pendulum whose pivot flies.
//!
//! With the unit vector n from the craft to the load (inertial), its turning rate w, cable length L, load mass m_l, craft mass
//! m, and f the specific force of everything else on the craft:
//!
//! - the load: `n' = w x n`, `w' = -(n x f) / L - 2 zeta w0 w` with `w0^2 = g / L`. Gravity pulls both alike and drops out.
//! - the cable's pull on the craft, per mass: `n (m_l / (m + m_l)) (L |w|^2 - n.f)`. Sideways this is the swing, below the
//!   craft it is the load's weight and inertia: hanging still, the vertical specific force is divided by `1 + m_l / m`.
//!
//! For small swings the load's place eta and the craft's x obey `eta'' = -w0^2 (eta - x) - 2 zeta w0 (eta' - x')`, and the craft
//! feels `m_l w0^2 (eta - x)`. Driven by where the craft is, the load's own mass does not enter, so `w0^2 = g / L` whatever
//! it weighs; left to itself, a craft gives way, and the two swing against each other at `sqrt(g / L (1 + m_l / m))`.
//!
//! The damping is that of the air on the load: it does not act back on the craft. Deliberately absent: a slack cable, one
//! that hangs from elsewhere than the centre of mass, the load's own turning.

use nalgebra::{Matrix2, Matrix3, Vector3};

/// A load on a cable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// kg.
    pub mass_kg: f64,
    /// m.
    pub cable_length_m: f64,
    /// zeta, of small swings.
    pub damping_ratio: f64,
}

/// Where a load hangs and how it swings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    /// Unit vector from the craft to the load, inertial NED.
    pub direction: Vector3<f64>,
    /// Its turning rate, inertial NED, rad/s.
    pub turning_rad_s: Vector3<f64>,
}

/// It hangs still.
impl Default for Swing {
    fn default() -> Self {
        Self { direction: Vector3::new(0.0, 0.0, 1.0), turning_rad_s: Vector3::zeros() }
    }
}

/// Shortest cable, m: a search may ask for none.
const SHORTEST_M: f64 = 0.01;
/// Widest swing at a beginning, part of the cable's length: one beyond it is a fit's wrong step.
const WIDEST: f64 = 0.9;

impl Load {
    fn length_m(&self) -> f64 {
        self.cable_length_m.max(SHORTEST_M)
    }

    /// w0^2 = g / L, rad^2/s^2.
    pub fn stiffness_rad2_s2(&self, gravity_m_s2: f64) -> f64 {
        gravity_m_s2 / self.length_m()
    }

    /// 2 zeta w0, 1/s.
    fn damping_per_s(&self, gravity_m_s2: f64) -> f64 {
        2.0 * self.damping_ratio * self.stiffness_rad2_s2(gravity_m_s2).sqrt()
    }

    /// The swing's derivative under the specific force of everything but the cable, inertial, m/s^2.
    pub(crate) fn derivative(&self, swing: &Swing, force_ned_m_s2: Vector3<f64>, gravity_m_s2: f64) -> Swing {
        let Swing { direction: n, turning_rad_s: w } = swing;
        Swing {
            direction: w.cross(n),
            turning_rad_s: -n.cross(&force_ned_m_s2) / self.length_m() - w * self.damping_per_s(gravity_m_s2),
        }
    }

    /// What a specific force of everything but the cable becomes, both body, m/s^2.
    pub(crate) fn act(
        &self,
        force_m_s2: Vector3<f64>,
        dcm: &Matrix3<f64>,
        swing: &Swing,
        per_mass: f64,
    ) -> Vector3<f64> {
        let share = self.mass_kg * per_mass;
        let n = dcm * swing.direction;
        let centripetal_m_s2 = self.length_m() * swing.turning_rad_s.norm_squared();
        force_m_s2 + n * (share / (1.0 + share) * (centripetal_m_s2 - n.dot(&force_m_s2)))
    }

    /// The swings under a craft at places given every `period_s` (inertial, m). `beginning` is where the load is against the
    /// craft at first and how fast it moves there: north m, m/s, east m, m/s.
    ///
    /// Verlet's method with the cable as a constraint (Ryckaert, Ciccotti and Berendsen 1977): it needs the craft's places
    /// only, no derivative of them. Damping acts on the mean of the velocities before and after, and gravity is a little
    /// less than it is, so that a small swing takes its time to the last digit.
    pub fn driven(
        &self,
        places_m: &[Vector3<f64>],
        beginning: [f64; 4],
        period_s: f64,
        gravity_m_s2: f64,
    ) -> Vec<Swing> {
        let (h, length) = (period_s, self.length_m());
        let phase = self.stiffness_rad2_s2(gravity_m_s2).sqrt() * h;
        let fall = Vector3::new(0.0, 0.0, 2.0 * (1.0 - phase.cos()) * length);
        let damping = 0.5 * self.damping_per_s(gravity_m_s2) * h;
        let [north, north_m_s, east, east_m_s] = beginning;
        // The cable before and now; the craft went on as it goes on over a twentieth of a second.
        let mut before = self.hanging_at(north - h * north_m_s, east - h * east_m_s);
        let mut now = self.hanging_at(north, east);
        let reach = ((0.05 / h).round() as usize).clamp(1, places_m.len().saturating_sub(1).max(1));
        let mut way = places_m.get(reach).map_or_else(Vector3::zeros, |p| (p - places_m[0]) / reach as f64);
        let mut cables = Vec::with_capacity(places_m.len());
        for k in 0..places_m.len() {
            cables.push(now);
            let Some(next_place) = places_m.get(k + 1) else { break };
            let next_way = next_place - places_m[k];
            // The load less the craft's next place, if the cable let it go.
            let pushed = (now - before) * (1.0 - damping) + way - next_way + fall;
            let free = now + pushed / (1.0 + damping);
            let next = on_cable(free, now, length);
            (before, now, way) = (now, next, next_way);
        }
        let turning = |k: usize| {
            let (from, to) = (k.saturating_sub(1), (k + 1).min(cables.len() - 1));
            let rate = (cables[to] - cables[from]) / ((to - from).max(1) as f64 * h);
            cables[k].cross(&rate) / (length * length)
        };
        let swing = |k: usize| Swing { direction: cables[k] / length, turning_rad_s: turning(k) };
        (0..cables.len()).map(swing).collect()
    }

    /// The cable to a load that hangs so far north and east of the craft, m.
    fn hanging_at(&self, north: f64, east: f64) -> Vector3<f64> {
        let widest = WIDEST * self.length_m();
        let aside = Vector3::new(north, east, 0.0).cap_magnitude(widest);
        let down = (self.length_m().powi(2) - aside.norm_squared()).sqrt();
        Vector3::new(aside.x, aside.y, down)
    }

    /// What offset and velocity of a load that swings a little under a craft that stays where it is become after a time.
    pub fn free_motion(&self, time_s: f64, gravity_m_s2: f64) -> Matrix2<f64> {
        let (stiffness, damping) = (self.stiffness_rad2_s2(gravity_m_s2), self.damping_per_s(gravity_m_s2));
        (Matrix2::new(0.0, 1.0, -stiffness, -damping) * time_s).exp()
    }

    /// Offsets of a load that swings a little under a craft that stays where it is, from an offset of 1 m and from a
    /// velocity of 1 m/s, m.
    pub fn free(&self, samples: usize, period_s: f64, gravity_m_s2: f64) -> Vec<[f64; 2]> {
        let motion = self.free_motion(period_s, gravity_m_s2);
        let mut state = Matrix2::identity();
        std::iter::repeat_with(|| {
            let now = state;
            state = motion * state;
            [now[(0, 0)], now[(0, 1)]]
        })
        .take(samples)
        .collect()
    }
}

/// Where a load ends that would be at `free`, drawn back along the cable as it was: the nearer place at the cable's length.
fn on_cable(free: Vector3<f64>, cable: Vector3<f64>, length_m: f64) -> Vector3<f64> {
    let (square, along) = (length_m * length_m, free.dot(&cable));
    let inside = along * along - square * (free.norm_squared() - square);
    if inside >= 0.0 && along > 0.0 {
        return free + cable * ((inside.sqrt() - along) / square);
    }
    // Further than a cable's length in one sample: no craft flies so, but a log may jump.
    match free.try_normalize(0.0) {
        Some(direction) => direction * length_m,
        None => cable,
    }
}

impl Swing {
    /// The swing after `time_s` at a rate.
    #[inline]
    pub(crate) fn moved(&self, rate: &Self, time_s: f64) -> Self {
        Self {
            direction: self.direction + time_s * rate.direction,
            turning_rad_s: self.turning_rad_s + time_s * rate.turning_rad_s,
        }
    }

    /// With a direction of length 1 again.
    pub(crate) fn normalized(&self) -> Self {
        Self { direction: self.direction / self.direction.norm(), ..*self }
    }

    /// Halfway to another one.
    pub fn middle(&self, other: &Self) -> Self {
        Self {
            direction: 0.5 * (self.direction + other.direction),
            turning_rad_s: 0.5 * (self.turning_rad_s + other.turning_rad_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Effect, Model, Plant, State, Vehicle};

    const LOAD: Load = Load { mass_kg: 0.2, cable_length_m: 0.5, damping_ratio: 0.0 };
    const GRAVITY_M_S2: f64 = 9.81;

    /// A craft that hovers on a thrust along its own z and carries the load.
    fn flown(start: Swing, velocity_m_s: Vector3<f64>, time_s: f64) -> State {
        let vehicle = Vehicle::thesis();
        let mut model = Model::new(vehicle.clone());
        let speed = 600.0;
        // Four rotors carry craft and load.
        let carried = (vehicle.mass + LOAD.mass_kg) * vehicle.gravity;
        model.set(Effect::Thrust, &[carried / (vehicle.beta_kg_m() * 4.0 * speed * speed)]);
        model.set(Effect::SlungLoad, &[LOAD.mass_kg, LOAD.cable_length_m, 0.0]);
        let plant = Plant::new(&model);
        let mut state = State::at_rest(Vector3::zeros(), [speed; 4]);
        (state.swing, state.velocity_m_s) = (start, velocity_m_s);
        let steps = 400;
        let substeps = plant.substeps(time_s / f64::from(steps), 1);
        for _ in 0..steps {
            plant.step(&mut state, &[speed; 4], 11.1, &substeps);
        }
        state
    }

    fn swing(angle_rad: f64, turning_rad_s: Vector3<f64>) -> Swing {
        Swing { direction: Vector3::new(angle_rad.sin(), 0.0, angle_rad.cos()), turning_rad_s }
    }

    #[test]
    fn craft_and_load_keep_their_momentum_however_wide_they_swing() {
        let mass = Vehicle::thesis().mass;
        let momentum = |s: &State, load_kg: f64| {
            let load = s.swing.turning_rad_s.cross(&s.swing.direction) * LOAD.cable_length_m;
            mass * s.velocity_m_s + load_kg * (s.velocity_m_s + load)
        };
        let start = swing(0.6, Vector3::new(0.5, 2.0, 0.0).cross(&swing(0.6, Vector3::zeros()).direction));
        let velocity = Vector3::new(0.5, -0.2, 0.0);
        let end = flown(start, velocity, 1.0);
        let before = State { swing: start, velocity_m_s: velocity, ..end };
        let drift = |load_kg: f64| (momentum(&end, load_kg) - momentum(&before, load_kg)).norm();
        // Fourth order with steps of 2.5 ms at some rad/s, and thrust that balances both weights.
        assert!(drift(LOAD.mass_kg) < 1e-7, "{}", drift(LOAD.mass_kg));
        assert!(drift(0.0) > 1e-2, "without the load's part the craft's own momentum changes");
        assert!((end.swing.direction.norm() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn they_swing_against_each_other_faster_than_the_load_would_by_itself() {
        let share = LOAD.mass_kg / Vehicle::thesis().mass;
        let frequency = (GRAVITY_M_S2 / LOAD.cable_length_m * (1.0 + share)).sqrt();
        let half_period_s = std::f64::consts::PI / frequency;
        let start = swing(0.01, Vector3::zeros());
        let end = flown(start, Vector3::zeros(), half_period_s);
        // A swing of 0.01 rad is 1e-5 / 16 slower than a small one: nothing to first order at its turning point.
        assert!((end.swing.direction.x + start.direction.x).abs() < 1e-7, "{:?}", end.swing);
        // Alone it would not be back yet.
        assert!((share * 0.01).abs() > 1e-4);
    }

    #[test]
    fn a_driven_load_follows_the_closed_form() {
        // The craft swings by 1 mm at 3 rad/s: the load by 1 / (1 - (3 / w)^2) of that, and the free swing that makes it
        // start with the craft.
        let (amplitude, drive) = (0.001, 3.0_f64);
        let w = LOAD.stiffness_rad2_s2(GRAVITY_M_S2).sqrt();
        let gain = 1.0 / (1.0 - (drive / w).powi(2));
        let period_s = 0.002;
        let time = |k: usize| period_s * k as f64;
        let place = |k: usize| Vector3::new(amplitude * (drive * time(k)).sin(), 0.3, -1.0);
        let swings = LOAD.driven(&(0..3000).map(place).collect::<Vec<_>>(), [0.0; 4], period_s, GRAVITY_M_S2);
        for k in (0..3000).step_by(50) {
            let t = time(k);
            let load = amplitude * (gain * (drive * t).sin() + (1.0 - gain) * drive / w * (w * t).sin());
            let offset_m = LOAD.cable_length_m * swings[k].direction;
            // The velocity at the start is the mean of 0.05 s: 0.4 % of 3 mm/s low, over 4.4 rad/s.
            assert!((offset_m.x - (load - place(k).x)).abs() < 4e-6, "{k}");
            assert!(offset_m.y.abs() < 1e-12);
        }
    }

    /// The log's way and the plant's way to the same swing, wide and with the craft climbing.
    #[test]
    fn a_load_driven_by_places_swings_as_in_the_plant() {
        let mut model = Model::thesis();
        model.set(Effect::SlungLoad, &[0.1, 0.4, 0.05]);
        let load = Load { mass_kg: 0.1, cable_length_m: 0.4, damping_ratio: 0.05 };
        let plant = Plant::new(&model);
        // The thesis' craft hovers at these (reference section 1), faster by the load's weight.
        let hover = [611.4090, 634.3527, 633.6577, 657.8632].map(|w: f64| w * (1.0 + 0.1_f64 / 1.214).sqrt());
        let mut state = State::at_rest(Vector3::new(0.0, 0.0, -1.0), hover);
        let substeps = plant.substeps(0.002, 2);
        let (mut places, mut flown) = (Vec::new(), Vec::new());
        for k in 0..500 {
            places.push(state.position_ned_m);
            flown.push(state.swing);
            let t = 0.002 * f64::from(k);
            let (lift, tilt) = (15.0 * (4.0 * t).sin(), 3.0 * (4.0 * t).cos());
            let shares = [lift + tilt, lift + tilt, lift - tilt, lift - tilt];
            let commanded = std::array::from_fn(|i| hover[i] + shares[i]);
            plant.step(&mut state, &commanded, 11.1, &substeps);
        }
        let widest = flown.iter().map(|s| s.direction.xy().norm()).fold(0.0, f64::max);
        assert!((0.05..1.0).contains(&widest), "{widest}");
        let swings = load.driven(&places, [0.0; 4], 0.002, model.vehicle.gravity);
        let off = |(a, b): (&Swing, &Swing)| (a.direction - b.direction).norm();
        let worst = swings.iter().zip(&flown).map(off).fold(0.0, f64::max);
        // Second order in the sample of 2 ms, and a velocity at the start from a twentieth of a second.
        assert!(worst < 0.003 * widest, "{worst} of {widest}");
    }

    /// A load that is let go under a craft at rest swings as the free solutions say, to the cube of the angle.
    #[test]
    fn a_load_begins_where_it_is_told() {
        let load = Load { damping_ratio: 0.04, ..LOAD };
        let (period_s, begun) = (0.01, [0.02, -0.05, -0.01, 0.08]);
        let swings = load.driven(&vec![Vector3::zeros(); 300], begun, period_s, GRAVITY_M_S2);
        let free = load.free(300, period_s, GRAVITY_M_S2);
        for (k, (swing, [offset, velocity])) in swings.iter().zip(free).enumerate() {
            let found = load.cable_length_m * swing.direction;
            let expected = [offset * begun[0] + velocity * begun[1], offset * begun[2] + velocity * begun[3]];
            // First order at the first step of the two, 1 % of a swing of 25 mm.
            assert!((found.x - expected[0]).abs() < 6e-4 && (found.y - expected[1]).abs() < 6e-4, "{k}");
        }
    }

    #[test]
    fn free_swings_are_damped_cosines_and_sines() {
        let load = Load { damping_ratio: 0.1, ..LOAD };
        let w = load.stiffness_rad2_s2(GRAVITY_M_S2).sqrt();
        let damped = w * (1.0 - 0.01_f64).sqrt();
        for (k, [offset, velocity]) in load.free(500, 0.01, GRAVITY_M_S2).into_iter().enumerate() {
            let t = 0.01 * k as f64;
            let decay = (-0.1 * w * t).exp();
            let cosine = decay * ((damped * t).cos() + 0.1 * w / damped * (damped * t).sin());
            assert!((offset - cosine).abs() < 1e-12, "{k}");
            assert!((velocity - decay * (damped * t).sin() / damped).abs() < 1e-12, "{k}");
        }
    }
}
