//! A load on a cable under the craft, as far as it swings a little.
//!
//! With the load's place `eta` and the craft's `x` over ground (north and east), cable length L and load mass m_l:
//!
//! - the load: `eta'' = -w^2 (eta - x) - 2 zeta w (eta' - x')` with `w^2 = g / L`. Driven by where the craft is, the load's own
//!   mass does not enter: that of a light load is the same. (Left to itself, a craft of mass m gives way, and the two swing
//!   against each other at `sqrt(g / L (1 + m_l / m))`.)
//! - the craft: `+ m_l w^2 (eta - x)` sideways, and below it the load's weight and inertia, so that the vertical specific
//!   force of everything else is divided by `1 + m_l / m`.
//!
//! The damping is that of the air on the load: it does not act back on the craft. Deliberately absent: wide swings, a slack
//! cable, a cable that hangs from elsewhere than the centre of mass.

use nalgebra::{Matrix2, Matrix3, Matrix4, Vector2, Vector3};

/// A load on a cable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// kg.
    pub mass_kg: f64,
    /// m.
    pub cable_length_m: f64,
    /// zeta.
    pub damping_ratio: f64,
}

/// Where a load is and how it moves, north and east, relative to the craft. Zero: it hangs still below it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Swing {
    /// eta - x, m.
    pub offset_m: [f64; 2],
    /// eta' - x', m/s.
    pub velocity_m_s: [f64; 2],
}

/// Shortest cable, m: a search may ask for none.
const SHORTEST_M: f64 = 0.01;

impl Load {
    /// w^2 = g / L, rad^2/s^2.
    pub fn stiffness_rad2_s2(&self, gravity_m_s2: f64) -> f64 {
        gravity_m_s2 / self.cable_length_m.max(SHORTEST_M)
    }

    /// 2 zeta w, 1/s.
    fn damping_per_s(&self, gravity_m_s2: f64) -> f64 {
        2.0 * self.damping_ratio * self.stiffness_rad2_s2(gravity_m_s2).sqrt()
    }

    /// The swing's derivative with the craft's acceleration over ground, north and east, m/s^2.
    pub(crate) fn derivative(&self, swing: &Swing, acceleration_m_s2: [f64; 2], gravity_m_s2: f64) -> Swing {
        let (stiffness, damping) = (self.stiffness_rad2_s2(gravity_m_s2), self.damping_per_s(gravity_m_s2));
        Swing {
            offset_m: swing.velocity_m_s,
            velocity_m_s: std::array::from_fn(|i| {
                -stiffness * swing.offset_m[i] - damping * swing.velocity_m_s[i] - acceleration_m_s2[i]
            }),
        }
    }

    /// What the craft's specific force becomes, body, m/s^2.
    pub(crate) fn act(
        &self,
        force_m_s2: Vector3<f64>,
        dcm: &Matrix3<f64>,
        offset_m: [f64; 2],
        per_mass: f64,
        gravity_m_s2: f64,
    ) -> Vector3<f64> {
        let share = self.mass_kg * per_mass;
        let mut ned = dcm.tr_mul(&force_m_s2);
        ned.z /= 1.0 + share;
        let pull = share * self.stiffness_rad2_s2(gravity_m_s2);
        ned.x += pull * offset_m[0];
        ned.y += pull * offset_m[1];
        dcm * ned
    }

    /// The swings under a craft at places given every `period_s`, from a load that moves with it at first. Exact for a craft
    /// that goes straight in between.
    ///
    /// With `q = eta' - 2 zeta w x`, the load's equation needs the craft's place only, no derivative of it.
    pub fn driven(&self, places_m: &[[f64; 2]], period_s: f64, gravity_m_s2: f64) -> Vec<Swing> {
        let Some(first) = places_m.first() else { return Vec::new() };
        let damping = self.damping_per_s(gravity_m_s2);
        let motion = self.motion(period_s, gravity_m_s2);
        let slope = |k: usize, reach: usize, axis: usize| {
            let (from, to) = (k.saturating_sub(reach), (k + reach).min(places_m.len() - 1));
            (places_m[to][axis] - places_m[from][axis]) / ((to - from).max(1) as f64 * period_s)
        };
        // A tenth of a second tells a velocity from the tracker's noise.
        let reach = (0.05 / period_s).round().max(1.0) as usize;
        let mut state: [Vector2<f64>; 2] =
            std::array::from_fn(|i| Vector2::new(first[i], slope(0, reach, i) - damping * first[i]));
        let mut swings = Vec::with_capacity(places_m.len());
        for (k, place) in places_m.iter().enumerate() {
            swings.push(Swing {
                offset_m: std::array::from_fn(|i| state[i].x - place[i]),
                velocity_m_s: std::array::from_fn(|i| {
                    state[i].y + damping * place[i] - slope(k, reach, i)
                }),
            });
            let Some(next) = places_m.get(k + 1) else { break };
            for (i, state) in state.iter_mut().enumerate() {
                *state = motion.free * *state + motion.place * place[i] + motion.way * (next[i] - place[i]);
            }
        }
        swings
    }

    /// Offsets of a load under a craft that stays where it is, from an offset of 1 m and from a velocity of 1 m/s, m.
    pub fn free(&self, samples: usize, period_s: f64, gravity_m_s2: f64) -> Vec<[f64; 2]> {
        let motion = self.motion(period_s, gravity_m_s2).free;
        let mut state = Matrix2::identity();
        std::iter::repeat_with(|| {
            let now = state;
            state = motion * state;
            [now[(0, 0)], now[(0, 1)]]
        })
        .take(samples)
        .collect()
    }

    /// Exact over a period: the exponential of the equations with a place that moves on a straight line.
    fn motion(&self, period_s: f64, gravity_m_s2: f64) -> Motion {
        let (stiffness, damping) = (self.stiffness_rad2_s2(gravity_m_s2), self.damping_per_s(gravity_m_s2));
        let h = period_s;
        #[rustfmt::skip]
        let rates = Matrix4::new(
            0.0,            h,            damping * h,                           0.0,
            -stiffness * h, -damping * h, (stiffness - damping * damping) * h,   0.0,
            0.0,            0.0,          0.0,                                   1.0,
            0.0,            0.0,          0.0,                                   0.0,
        );
        let all = rates.exp();
        Motion {
            free: all.fixed_view::<2, 2>(0, 0).into_owned(),
            place: all.fixed_view::<2, 1>(0, 2).into_owned(),
            way: all.fixed_view::<2, 1>(0, 3).into_owned(),
        }
    }
}

/// The load's place and q after a period, from those before, the craft's place, and how far it goes.
struct Motion {
    free: Matrix2<f64>,
    place: Vector2<f64>,
    way: Vector2<f64>,
}

impl Swing {
    /// The swing after `time_s` at a rate.
    pub(crate) fn moved(&self, rate: &Self, time_s: f64) -> Self {
        let after = |a: [f64; 2], b: [f64; 2]| std::array::from_fn(|i| a[i] + time_s * b[i]);
        Self {
            offset_m: after(self.offset_m, rate.offset_m),
            velocity_m_s: after(self.velocity_m_s, rate.velocity_m_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Effect, Model, Plant, State, Vehicle};

    const LOAD: Load = Load { mass_kg: 0.2, cable_length_m: 0.5, damping_ratio: 0.0 };
    const GRAVITY_M_S2: f64 = 9.81;

    /// A craft that does nothing but carry the load.
    fn flown(start: Swing, velocity_m_s: Vector3<f64>, time_s: f64) -> State {
        let mut model = Model::new(Vehicle::thesis());
        model.set(Effect::SlungLoad, &[LOAD.mass_kg, LOAD.cable_length_m, 0.0]);
        let plant = Plant::new(&model);
        let mut state = State::at_rest(Vector3::zeros(), [0.0; 4]);
        (state.swing, state.velocity_m_s) = (start, velocity_m_s);
        let steps = 400;
        let substeps = plant.substeps(time_s / f64::from(steps), 1);
        for _ in 0..steps {
            plant.step(&mut state, &[0.0; 4], 11.1, &substeps);
        }
        state
    }

    #[test]
    fn craft_and_load_keep_their_momentum_and_swing_against_each_other() {
        let start = Swing { offset_m: [0.03, -0.02], velocity_m_s: [0.1, 0.0] };
        let mass = Vehicle::thesis().mass;
        let momentum = |s: &State| -> [f64; 2] {
            std::array::from_fn(|i| {
                mass * s.velocity_m_s[i] + LOAD.mass_kg * (s.velocity_m_s[i] + s.swing.velocity_m_s[i])
            })
        };
        let share = LOAD.mass_kg / mass;
        let frequency = (GRAVITY_M_S2 / LOAD.cable_length_m * (1.0 + share)).sqrt();
        let period_s = std::f64::consts::TAU / frequency;
        let end = flown(start, Vector3::new(0.5, -0.2, 0.0), period_s);
        let before = momentum(&State { swing: start, velocity_m_s: Vector3::new(0.5, -0.2, 0.0), ..end });
        for i in 0..2 {
            // Fourth order: (step 3 ms times 5 rad/s)^4 per step.
            assert!((momentum(&end)[i] - before[i]).abs() < 1e-9, "{i}");
            assert!((end.swing.offset_m[i] - start.offset_m[i]).abs() < 1e-7, "{:?}", end.swing);
        }
        // Half a period later it is on the other side; a load of another mass would not be.
        let half = flown(start, Vector3::zeros(), 0.5 * period_s);
        assert!((half.swing.offset_m[1] + start.offset_m[1]).abs() < 1e-7, "{:?}", half.swing);
        // What falls with its load falls as everything.
        assert!((half.velocity_m_s.z - GRAVITY_M_S2 * 0.5 * period_s).abs() < 1e-9);
    }

    #[test]
    fn a_driven_load_follows_the_closed_form() {
        // The craft swings by a cm at 3 rad/s: the load by 1 / (1 - (3 / w)^2) of that, and the free swing that makes it
        // start with the craft.
        let (amplitude, drive) = (0.01, 3.0_f64);
        let w = LOAD.stiffness_rad2_s2(GRAVITY_M_S2).sqrt();
        let gain = 1.0 / (1.0 - (drive / w).powi(2));
        let period_s = 0.002;
        let time = |k: usize| period_s * k as f64;
        let places: Vec<[f64; 2]> = (0..3000).map(|k| [amplitude * (drive * time(k)).sin(), 0.3]).collect();
        let swings = LOAD.driven(&places, period_s, GRAVITY_M_S2);
        for k in (0..3000).step_by(50) {
            let t = time(k);
            let load = amplitude * (gain * (drive * t).sin() + (1.0 - gain) * drive / w * (w * t).sin());
            // Straight lines between samples, and a velocity at the start from a tenth of a second: 0.1 % of the swing.
            assert!((swings[k].offset_m[0] - (load - places[k][0])).abs() < 2e-5, "{k}");
            assert!(swings[k].offset_m[1].abs() < 1e-12);
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
