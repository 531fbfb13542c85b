//! The body in motion: Newton and Euler over the ground, rotor by rotor.
//!
//! The state holds what is conserved: linear momentum as the velocity over ground, and the angular
//! momentum of body and rotors together in inertial components. One step is the implicit midpoint
//! rule on R^3 x SO(3) (attitude advanced by the exponential of the midpoint's rate), so a free
//! body keeps its angular momentum to rounding and its energy without drift. Euler's gyroscopic
//! terms are never written down: they follow from turning the momentum into the body.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

use super::craft::{Craft, Strange};
use super::odd::{Past, Seen};

/// Integration step, s: 2 kHz.
pub const STEP_S: f64 = 0.0005;

/// Fixed-point rounds of the midpoint. Each gains a factor of the step times the fastest rate, here
/// under 0.01.
const ROUNDS: usize = 3;

/// The landing gear keeps the hubs this many rotor radii off the floor.
pub(super) const LANDING_GEAR: f64 = 0.6;

/// Time in which a rotor's wake follows it, s.
const WAKE_S: f64 = 0.15;

/// Time in which the air below follows a craft that sinks, s.
const SINKING_S: f64 = 0.5;
/// When a rotor that fails does so, s.
const FAILS_S: f64 = 11.0;

/// Correlation time of gusts, s.
const GUST_S: f64 = 0.5;

/// Correlation time of a wind that wanders, s.
const WANDERING_S: f64 = 4.0;

/// Where and how the craft moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Centre of mass, NED, m.
    pub position_ned_m: Vector3<f64>,
    /// Over ground, NED, m/s.
    pub velocity_ned_m_s: Vector3<f64>,
    /// Body to inertial.
    pub attitude: Rotation3<f64>,
    /// Angular momentum of body and rotors about the centre of mass, inertial components, kg m^2/s.
    pub momentum: Vector3<f64>,
    /// Rotor speeds, rad/s.
    pub rotor_rad_s: [f64; 4],
    /// Direction and turning rate of the pendulum, inertial; a load hangs along it.
    pub link: [Vector3<f64>; 2],
    /// Terminal voltage, V.
    pub battery_v: f64,
    /// What an accelerometer at the centre of mass feels, body, m/s^2: the mean over the last step.
    pub specific_force_m_s2: Vector3<f64>,
    inverse_inertia: Matrix3<f64>,
    gust_m_s: [f64; 2],
    wandering_m_s: [f64; 2],
    held_rad_s: f64,
    /// How far what bounces is below its rest, m, and how fast it falls, m/s.
    bounce: [f64; 2],
    /// Rotor speeds that the wakes belong to, rad/s.
    wake_rad_s: [f64; 4],
    /// Speed down through the air that the wake below has had time to follow, m/s.
    sunk_m_s: f64,
    /// What odd forms remember.
    past: Past,
}

/// Forces and torques at an instant.
struct Wrench {
    /// Without gravity and cable, inertial, N.
    force_ned_n: Vector3<f64>,
    /// Body, N m.
    torque_nm: Vector3<f64>,
}

/// What a wrench depends on.
struct Instant<'a> {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    attitude: &'a Matrix3<f64>,
    rate: Vector3<f64>,
    rotor: &'a [f64; 4],
    wake_rad_s: &'a [f64; 4],
    sunk_m_s: f64,
    past: &'a Past,
    time_s: f64,
}

impl Body {
    /// Level, at rest, rotors at hover speed.
    pub fn hovering(craft: &Craft, position_ned_m: Vector3<f64>) -> Self {
        let rotor_rad_s = [craft.hover_rad_s(); 4];
        let inverse_inertia = craft.inertia_kg_m2.try_inverse().unwrap_or_else(Matrix3::zeros);
        Self {
            position_ned_m,
            velocity_ned_m_s: Vector3::zeros(),
            attitude: Rotation3::identity(),
            momentum: Vector3::z() * rotor_momentum(craft, &rotor_rad_s),
            rotor_rad_s,
            link: [Vector3::z(), Vector3::zeros()],
            battery_v: craft.battery.voltage_v(0.0, &rotor_rad_s),
            specific_force_m_s2: Vector3::z() * -craft.gravity_m_s2,
            inverse_inertia,
            gust_m_s: [0.0; 2],
            wandering_m_s: [0.0; 2],
            bounce: [0.0; 2],
            wake_rad_s: rotor_rad_s,
            sunk_m_s: 0.0,
            past: Past::default(),
            held_rad_s: rotor_rad_s[0],
        }
    }

    /// Body rates, rad/s.
    pub fn rate_rad_s(&self, craft: &Craft) -> Vector3<f64> {
        let spin = Vector3::z() * rotor_momentum(craft, &self.rotor_rad_s);
        self.inverse_inertia * (self.attitude.inverse() * self.momentum - spin)
    }

    /// How far the lowest hub is above where its landing gear would stand on the floor, m.
    pub(super) fn lowest_hub_m(&self, craft: &Craft) -> f64 {
        let attitude = self.attitude.matrix();
        let down = |[x, y]: [f64; 2]| attitude[(2, 0)] * x + attitude[(2, 1)] * y;
        let lowest = craft.hubs_m().into_iter().map(down).fold(f64::NEG_INFINITY, f64::max);
        craft.ground_offset_m - self.position_ned_m.z - lowest - LANDING_GEAR * craft.rotor_radius_m
    }

    /// Gives the body other rates, rad/s.
    pub fn set_rate_rad_s(&mut self, craft: &Craft, rate_rad_s: Vector3<f64>) {
        let spin = Vector3::z() * rotor_momentum(craft, &self.rotor_rad_s);
        self.momentum = self.attitude * (craft.inertia_kg_m2 * rate_rad_s + spin);
    }

    /// Advances by [`STEP_S`] with held motor commands; `air` is asked for gusts.
    pub fn step(&mut self, craft: &Craft, command: &[f64; 4], time_s: f64, air: &mut impl Rng) {
        self.blow(craft, air);
        let target = self.commanded_rad_s(craft, command, time_s);
        let h = STEP_S;
        let towards = |slowing: f64, gaining: f64| -> [f64; 4] {
            std::array::from_fn(|i| {
                let decay = if target[i] > self.rotor_rad_s[i] { gaining } else { slowing };
                target[i] + (self.rotor_rad_s[i] - target[i]) * decay
            })
        };
        let half = (-0.5 * h * craft.lag_rad_s).exp();
        let slow_half = half.powf(1.0 - craft.strange.sluggish);
        let (middle, end) = (towards(half, slow_half), towards(half * half, slow_half * slow_half));
        let spin = Vector3::z() * rotor_momentum(craft, &middle);
        let spin_up = Vector3::z()
            * ((rotor_momentum(craft, &end) - rotor_momentum(craft, &self.rotor_rad_s)) / h
                * (1.0 - craft.spin_up_share));

        let mut rate = self.rate_rad_s(craft);
        let [mut acceleration, mut torque_ned, mut link_acceleration] = [Vector3::zeros(); 3];
        let mut felt = self.specific_force_m_s2;
        for _ in 0..ROUNDS {
            let attitude = self.attitude * Rotation3::new(0.5 * h * rate);
            rate =
                self.inverse_inertia * (attitude.inverse() * (self.momentum + 0.5 * h * torque_ned) - spin);
            let velocity = self.velocity_ned_m_s + 0.5 * h * acceleration;
            let instant = Instant {
                position: self.position_ned_m + 0.5 * h * velocity,
                velocity,
                attitude: attitude.matrix(),
                rate,
                rotor: &middle,
                wake_rad_s: &self.wake_rad_s,
                sunk_m_s: self.sunk_m_s,
                past: &self.past,
                time_s: time_s + 0.5 * h,
            };
            let wrench = self.wrench(craft, &instant);
            torque_ned = attitude * (wrench.torque_nm + spin_up);
            let left = 1.0 - craft.strange.leak_per_s * time_s;
            let own = wrench.force_ned_n / (left * craft.mass_kg);
            let cable;
            (cable, link_acceleration) = self.cable(craft, own, link_acceleration);
            felt = attitude.inverse() * (own + cable);
            acceleration = own + cable + Vector3::new(0.0, 0.0, craft.gravity_m_s2);
        }
        let velocity = self.velocity_ned_m_s + 0.5 * h * acceleration;
        self.bounce(craft, acceleration.z);
        self.position_ned_m += h * velocity;
        self.velocity_ned_m_s += h * acceleration;
        self.specific_force_m_s2 = felt;
        self.attitude *= Rotation3::new(h * rate);
        self.momentum += h * torque_ned;
        self.rotor_rad_s = end;
        self.stir(craft);
        let turning = self.link[1] + 0.5 * h * link_acceleration;
        self.link[0] = Rotation3::new(h * turning) * self.link[0];
        self.link[1] += h * link_acceleration;
        self.battery_v = craft.battery.voltage_v(time_s + h, &self.rotor_rad_s);
    }

    /// The air around the craft follows it.
    fn stir(&mut self, craft: &Craft) {
        let wakes = self.wake_rad_s.iter_mut().zip(self.rotor_rad_s);
        wakes.for_each(|(wake, rotor)| *wake += STEP_S / WAKE_S * (rotor - *wake));
        let sinking = (self.attitude.inverse() * self.velocity_ned_m_s).z;
        self.sunk_m_s += STEP_S / SINKING_S * (sinking - self.sunk_m_s);
        if craft.strange.odd.is_some() {
            let air_ned = self.velocity_ned_m_s - craft.wind_ned_m_s;
            let hover_rad_s = craft.hover_rad_s();
            let power = self.rotor_rad_s.iter().map(|speed| 0.25 * (speed / hover_rad_s).powi(3)).sum();
            self.past.step(STEP_S, &(self.attitude.inverse() * air_ned), power);
        }
    }

    /// A mass on a spring under the craft, which accelerates downward by so much.
    fn bounce(&mut self, craft: &Craft, down_m_s2: f64) {
        if craft.strange.bungee != 0.0 {
            let [below, falling] = self.bounce;
            // At rest it hangs where the spring carries its weight.
            self.bounce[1] = falling - STEP_S * (bungee_m_s2(below, falling) + down_m_s2);
            self.bounce[0] = below + STEP_S * self.bounce[1];
        }
    }

    /// A gust is a first-order process with a fixed spread.
    fn blow(&mut self, craft: &Craft, air: &mut impl Rng) {
        let winds = [
            (&mut self.gust_m_s, craft.strange.gust_m_s, GUST_S),
            (&mut self.wandering_m_s, craft.strange.wandering_m_s, WANDERING_S),
        ];
        for (wind, spread, time_s) in winds.into_iter().filter(|(_, spread, _)| *spread > 0.0) {
            let keep = (-STEP_S / time_s).exp();
            let push = spread * (1.0 - keep * keep).sqrt();
            for axis in wind {
                let kick: f64 = air.sample(StandardNormal);
                *axis = keep * *axis + push * kick;
            }
        }
    }

    fn commanded_rad_s(&mut self, craft: &Craft, command: &[f64; 4], time_s: f64) -> [f64; 4] {
        let battery_v = craft.battery.voltage_v(time_s, &self.rotor_rad_s);
        let map = &craft.map;
        let mut speeds = command.map(|c| (map.command * c + map.voltage * battery_v + map.offset).max(0.0));
        let band = craft.strange.dead_band_rad_s;
        if band > 0.0 {
            if (speeds[0] - self.held_rad_s).abs() > band {
                self.held_rad_s = speeds[0];
            }
            speeds[0] = self.held_rad_s;
        }
        speeds
    }

    fn wrench(&self, craft: &Craft, now: &Instant<'_>) -> Wrench {
        let air_ned = now.velocity - self.wind(craft, now);
        let air = now.attitude.tr_mul(&air_ned);
        let (thrusts_n, torques_nm) = rotors(craft, now, &air);
        let mut torque = Vector3::zeros();
        let mut pull_n = Vector3::zeros();
        for (rotor, [x, y]) in craft.hubs_m().into_iter().enumerate() {
            let [forward, right] = craft.lean_rad[rotor].map(f64::sin);
            // The rotor's axis, along which its thrust pulls and about which its torque turns.
            let up = Vector3::new(forward, right, -(1.0 - forward * forward - right * right).sqrt());
            let pull = thrusts_n[rotor] * up;
            torque += Vector3::new(x, y, 0.0).cross(&pull) - torques_nm[rotor] * up;
            pull_n += pull;
        }
        torque -= now.rate.component_mul(&Vector3::from(craft.damping_nm_s));
        torque.z -= craft.quadratic_yaw_nm_s2 * now.rate.z.abs() * now.rate.z;
        let [pitching, rolling] = craft.flapping_n_s;
        torque.x -= rolling * air.y;
        torque.y += pitching * air.x;

        let mut force = self.drag(craft, now, &air);
        force += pull_n;
        torque.z += craft.strange.weathercock_n_s * air.y;
        torque.z -= craft.strange.torsion_nm * now.attitude[(1, 0)].atan2(now.attitude[(0, 0)]).sin();
        force.x += craft.strange.skewed_drag_n_s_m * air.y;
        force.z += craft.mass_kg * craft.strange.wake_memory_per_s * now.sunk_m_s;
        force.x += craft.strange.loose_arm * (thrusts_n[0] - 0.25 * craft.mass_kg * craft.gravity_m_s2);
        force.x += craft.rate_coupling_n_s[0] * now.rate.y;
        force.y += craft.rate_coupling_n_s[1] * now.rate.x;
        let mut force_ned = now.attitude * force;
        if let Some(tether) = craft.tether {
            force_ned += tether.stiffness_n_m * (tether.anchor_ned_m - now.position);
        }
        let hum = craft.strange.hum_n * (std::f64::consts::TAU * 0.7 * now.time_s).sin();
        force_ned += Vector3::new(0.8 * hum, 0.6 * hum, 0.0);
        let strange = &craft.strange;
        let close = |distance_m: f64| (-distance_m / 0.25).exp().min(2.0);
        force_ned.z -= craft.mass_kg * strange.ceiling_m_s2 * close(1.9 + now.position.z);
        force_ned.y += craft.mass_kg * strange.wall_m_s2 * close(0.8 - now.position.y);
        let over_table = 0.5 * (1.0 + ((now.position.x - 0.1) / 0.03).tanh());
        let [x, y] = [now.position.x - 0.1, now.position.y - 0.1];
        let in_column = (-(x * x + y * y) / (2.0 * 0.45 * 0.45)).exp();
        force_ned.z -= craft.mass_kg * (strange.table_m_s2 * over_table - strange.column_m_s2 * in_column);
        force_ned += craft.mass_kg * about_centers_m_s2(strange, &now.position);
        force_ned.z += strange.bungee * craft.mass_kg * bungee_m_s2(self.bounce[0], self.bounce[1]);
        if let Some((odd, strength)) = strange.odd {
            let Instant { attitude, position, rate, past, time_s, .. } = *now;
            let seen =
                Seen { position_ned_m: &position, air_m_s: &air, rate_rad_s: &rate, attitude, time_s, past };
            let push = odd.push(strength, &seen);
            force_ned += craft.mass_kg * push.force_m_s2;
            torque += craft.inertia_kg_m2 * push.turn_rad_s2;
        }
        Wrench { force_ned_n: force_ned, torque_nm: torque }
    }

    fn drag(&self, craft: &Craft, now: &Instant<'_>, air: &Vector3<f64>) -> Vector3<f64> {
        let mut drag = Vector3::from(craft.drag_n_s_m);
        if craft.strange.heading_drag != 0.0 {
            let yaw = now.attitude[(1, 0)].atan2(now.attitude[(0, 0)]);
            drag *= 1.0 + craft.strange.heading_drag * (2.0 * yaw).cos();
        }
        if air.x > 0.0 {
            drag.x *= 1.0 + craft.strange.one_sided_drag;
        }
        let [plane, axial] = craft.quadratic_drag;
        drag += air.norm() * Vector3::new(plane, plane, axial);
        -drag.component_mul(air)
    }

    fn wind(&self, craft: &Craft, now: &Instant<'_>) -> Vector3<f64> {
        let mut wind = craft.wind_ned_m_s;
        wind.x += self.gust_m_s[0] + self.wandering_m_s[0];
        wind.y += self.gust_m_s[1] + self.wandering_m_s[1];
        wind.x += craft.strange.shear_per_s * -now.position.z;
        wind.x += craft.strange.odd.map_or(0.0, |(odd, strength)| odd.wind_m_s(strength, -now.position.z));
        if craft.strange.turning_wind_m_s != 0.0 {
            let (sine, cosine) = (std::f64::consts::TAU * now.time_s / 16.0).sin_cos();
            wind += craft.strange.turning_wind_m_s * Vector3::new(cosine, sine, 0.0);
        }
        if craft.strange.draught_m_s != 0.0 {
            // A jet along north-east out of an opening, half a metre wide.
            let across = 0.6 * now.position.x - 0.8 * now.position.y - 0.3;
            let speed = craft.strange.draught_m_s * (-across * across / (2.0 * 0.35 * 0.35)).exp();
            wind += speed * Vector3::new(0.8, 0.6, 0.0);
        }
        wind
    }

    /// The cable's pull on the craft, m/s^2, and the turning acceleration of the link.
    ///
    /// The load swings freely: l n'' is its acceleration less the craft's, and n.n'' = -|n'|^2
    /// gives the tension.
    fn cable(
        &self,
        craft: &Craft,
        own: Vector3<f64>,
        turning_up: Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let Some(load) = craft.load else { return (Vector3::zeros(), Vector3::zeros()) };
        let turning = self.link[1] + 0.5 * STEP_S * turning_up;
        let n = Rotation3::new(0.5 * STEP_S * turning) * self.link[0];
        let centripetal = load.length_m * turning.norm_squared();
        let tension_n = (centripetal - n.dot(&own)) / (1.0 / load.mass_kg + 1.0 / craft.mass_kg);
        let spin_up = -n.cross(&own) / load.length_m - load.damping_s * turning;
        (n * (tension_n / craft.mass_kg), spin_up)
    }
}

/// Thrust of each rotor, N, and its reaction torque about z, N m.
fn rotors(craft: &Craft, now: &Instant<'_>, air: &Vector3<f64>) -> ([f64; 4], [f64; 4]) {
    let lift = 1.0 + craft.translational_lift_s2_m2 * (air.x * air.x + air.y * air.y);
    let warm = 1.0 - craft.strange.fade * (1.0 - (-now.time_s / 12.0).exp());
    let lost = craft.strange.odd.map_or(0.0, |(odd, strength)| odd.lost(strength, air, now.past));
    let warm = warm - lost;
    let hubs = craft.hubs_m();
    let mut torques = [0.0; 4];
    let thrusts = std::array::from_fn(|i| {
        let w = now.rotor[i];
        torques[i] = craft.spin[i] * craft.torque_efficiency[i] * craft.torque_nm_s2 * w * w;
        let still = craft.thrust_n_s2 * w * w + craft.thrust_n_s * w;
        let share_n = 0.25 * craft.mass_kg * craft.gravity_m_s2;
        let still = still - craft.strange.stall * (still - share_n).max(0.0);
        let sinking = air.z.clamp(0.0, 1.0);
        let ahead = w / now.wake_rad_s[i].max(1.0) - 1.0;
        let own_wake =
            (1.0 - craft.strange.settling * sinking * sinking) * (1.0 + craft.strange.inflow * ahead);
        let failed = if i == 1 && now.time_s > FAILS_S { craft.strange.failing } else { 0.0 };
        let thrust = craft.efficiency[i] * (1.0 - failed) * still * lift * warm * own_wake;
        if craft.ground_gain == 0.0 {
            return thrust;
        }
        let [x, y] = hubs[i];
        let down = now.position.z + now.attitude[(2, 0)] * x + now.attitude[(2, 1)] * y;
        let height = (craft.ground_offset_m - down).max(LANDING_GEAR * craft.rotor_radius_m);
        let ratio = craft.rotor_radius_m / (4.0 * height);
        thrust / (1.0 - craft.ground_gain * ratio * ratio)
    });
    (thrusts, torques)
}

/// What pulls towards a point, presses away from an axis, and turns around one.
fn about_centers_m_s2(strange: &Strange, position: &Vector3<f64>) -> Vector3<f64> {
    let to_magnet = Vector3::new(0.3, -0.2, 0.0) - position;
    let pull = strange.magnet_m_s2 * (0.6 / (to_magnet.norm() + 0.1)).powi(2).min(3.0);
    let from_fan = Vector3::new(position.x + 0.6, position.y - 0.2, 0.0);
    let press = strange.fan_m_s2 * (-from_fan.norm() / 0.6).exp();
    let arm = Vector3::new(position.x - 0.2, position.y + 0.1, 0.0);
    let round = arm.norm() / 0.4;
    let turn = strange.whirl_m_s2 * round * (0.5 * (1.0 - round * round)).exp();
    let whirl = turn * Vector3::new(-arm.y, arm.x, 0.0).try_normalize(1e-9).unwrap_or_default();
    pull * to_magnet.try_normalize(1e-9).unwrap_or_default()
        + press * from_fan.try_normalize(1e-9).unwrap_or_default()
        + whirl
}

/// Pull of the spring of what bounces under the craft beyond its weight, for each kilogram of it,
/// m/s^2: 2.5 Hz, a tenth of critical damping.
fn bungee_m_s2(below_m: f64, falling_m_s: f64) -> f64 {
    const NATURAL_RAD_S: f64 = std::f64::consts::TAU * 2.5;
    NATURAL_RAD_S * NATURAL_RAD_S * below_m + 0.2 * NATURAL_RAD_S * falling_m_s
}

/// Angular momentum of the rotors along z of the body (down): a counter-clockwise one, seen from
/// above, points up.
fn rotor_momentum(craft: &Craft, rotor_rad_s: &[f64; 4]) -> f64 {
    let signed: f64 = craft.spin.iter().zip(rotor_rad_s).map(|(s, w)| s * w).sum();
    -craft.rotor_inertia_kg_m2 * signed
}
