//! What an effect can look at: the craft, its air and its rotors at one instant.

use nalgebra::{Matrix3, Vector3};

use crate::memory::{LagId, Memory};
use crate::pendulum::Pendulum;
use crate::vehicle::Vehicle;

/// Constants of a vehicle that effects use, computed once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Constants {
    /// 1 / mass, 1/kg.
    pub(crate) per_mass: f64,
    pub(crate) beta_kg_m: f64,
    pub(crate) rotor_radius_m: f64,
    pub(crate) arm_length_m: f64,
    pub(crate) air_density_kg_m3: f64,
    pub(crate) gravity_m_s2: f64,
    /// sqrt(2) l beta of (2.7) with the sign of each rotor's roll moment (left rotors roll right), kg m^2.
    pub(crate) roll_arm_kg_m2: [f64; 4],
    /// Its counterpart in pitch (front rotors pitch up).
    pub(crate) pitch_arm_kg_m2: [f64; 4],
    /// Whether anything stands between the square of a rotor's speed and its thrust.
    pub(crate) changes_thrust: bool,
    /// Reaction torque of each rotor for its coefficient and the square of its speed, beta R_R or what it has become, kg m^2.
    pub(crate) yaw_arm_kg_m2: [f64; 4],
    pub(crate) spin: [f64; 4],
    /// Rotor hubs in the body frame: +-l/sqrt(2) along x and y, m.
    pub(crate) hub_m: [[f64; 2]; 4],
}

impl Constants {
    /// Constants of a vehicle that is heavier, whose centre of mass lies forward and right, m, of where it says, and whose rotors' reaction
    /// torques are larger by a part of themselves.
    pub(crate) fn new(
        vehicle: &Vehicle,
        extra_mass_kg: f64,
        com_offset_m: [f64; 2],
        torque_change: [f64; 4],
        changes_thrust: bool,
    ) -> Self {
        let beta = vehicle.beta_kg_m();
        let reach = vehicle.arm_length * std::f64::consts::FRAC_1_SQRT_2;
        let arm = std::f64::consts::SQRT_2 * vehicle.arm_length * beta;
        // The lever of a hub is its distance from the centre of mass: y - dy to the side, x - dx ahead.
        let [dx, dy] = com_offset_m;
        let (forward, right) = (dx / reach, dy / reach);
        Self {
            per_mass: 1.0 / (vehicle.mass + extra_mass_kg),
            beta_kg_m: beta,
            rotor_radius_m: vehicle.rotor_radius,
            arm_length_m: vehicle.arm_length,
            air_density_kg_m3: vehicle.air_density,
            gravity_m_s2: vehicle.gravity,
            roll_arm_kg_m2: [1.0 + right, right - 1.0, right - 1.0, 1.0 + right].map(|side| arm * side),
            pitch_arm_kg_m2: [1.0 - forward, 1.0 - forward, -1.0 - forward, -1.0 - forward]
                .map(|ahead| arm * ahead),
            yaw_arm_kg_m2: torque_change.map(|change| beta * vehicle.rotor_radius * (1.0 + change)),
            changes_thrust,
            spin: vehicle.motors.spin.map(|s| s.yaw_sign()),
            hub_m: vehicle.hubs_m(),
        }
    }
}

/// Numbers in the constants of a vehicle.
pub(crate) const CONSTANTS: usize = 30;

impl Constants {
    /// Its numbers one after the other.
    pub(crate) fn numbers(&self) -> [f64; CONSTANTS] {
        let mut numbers = [0.0; CONSTANTS];
        let [x, y] = [0, 1].map(|axis| self.hub_m.map(|hub| hub[axis]));
        numbers[..6].copy_from_slice(&[
            self.per_mass,
            self.beta_kg_m,
            self.rotor_radius_m,
            self.arm_length_m,
            self.air_density_kg_m3,
            self.gravity_m_s2,
        ]);
        let by_rotor = [self.roll_arm_kg_m2, self.pitch_arm_kg_m2, self.spin, x, y, self.yaw_arm_kg_m2];
        numbers[6..].copy_from_slice(by_rotor.as_flattened());
        numbers
    }

    /// Of [`Self::numbers`], which `number` gives by their places.
    #[inline(always)]
    pub(crate) fn from_numbers(number: impl Fn(usize) -> f64, changes_thrust: bool) -> Self {
        let by_rotor = |k: usize| std::array::from_fn(|rotor| number(6 + 4 * k + rotor));
        Self {
            per_mass: number(0),
            beta_kg_m: number(1),
            rotor_radius_m: number(2),
            arm_length_m: number(3),
            air_density_kg_m3: number(4),
            gravity_m_s2: number(5),
            roll_arm_kg_m2: by_rotor(0),
            pitch_arm_kg_m2: by_rotor(1),
            spin: by_rotor(2),
            yaw_arm_kg_m2: by_rotor(5),
            changes_thrust,
            hub_m: std::array::from_fn(|rotor| [number(18 + rotor), number(22 + rotor)]),
        }
    }
}

/// Most further columns of flight files that formulas can name in one program.
pub const MAX_FURTHER: usize = 8;

/// Values of the further columns of flight files that formulas name, by their place ([`crate::user_effects::columns`]); NaN
/// where there is none.
pub type Further = [f64; MAX_FURTHER];

/// No further column.
pub const NO_FURTHER: Further = [f64::NAN; MAX_FURTHER];

/// What surrounds a craft besides its motion: what a step of the plant is given.
#[derive(Debug, Clone, Copy)]
pub struct Surroundings {
    /// Battery voltage, V.
    pub battery_v: f64,
    /// Further columns of the flight.
    pub further: Further,
    /// What is looked back at in a stage of a step; of the plant's own making.
    pub(crate) memory: Option<Memory>,
}

impl Surroundings {
    /// A battery and further columns of the flight.
    pub const fn new(battery_v: f64, further: Further) -> Self {
        Self { battery_v, further, memory: None }
    }
}

/// A battery, and no further column.
impl From<f64> for Surroundings {
    #[inline(always)]
    fn from(battery_v: f64) -> Self {
        Self::new(battery_v, NO_FURTHER)
    }
}

/// The state a [`Sample`] is made from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleInput {
    /// Centre of mass, inertial NED, m.
    pub position_ned_m: Vector3<f64>,
    /// Inertial to body (2.2).
    pub dcm: Matrix3<f64>,
    /// Velocity of the centre of mass over ground, body components, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Body rates p, q, r, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Angular acceleration, rad/s^2: what `product-of-inertia` couples. Zero where it is yet to be computed.
    pub angular_acceleration_rad_s2: Vector3<f64>,
    /// Rotor speeds, rad/s (command units for a vehicle whose map is to be identified).
    pub rotor_rad_s: [f64; 4],
    /// Rotor accelerations, rad/s^2.
    pub rotor_acceleration_rad_s2: [f64; 4],
    /// Battery voltage, V.
    pub battery_v: f64,
    /// Where a slung load hangs; still where there is none.
    pub pendulum: Pendulum,
    /// What formulas look back at, where any does.
    pub memory: Option<Memory>,
    /// Further columns of the flight that formulas name.
    pub further: Further,
}

impl SampleInput {
    /// The value of a lag; NaN where it is not remembered.
    #[inline]
    pub fn remembered(&self, lag: LagId) -> f64 {
        self.memory.as_ref().map_or(f64::NAN, |memory| memory.of(lag))
    }
}

/// Everything an effect can look at.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// The state as given.
    pub input: &'a SampleInput,
    /// Velocity relative to the air, body components, m/s.
    pub air_velocity_m_s: Vector3<f64>,
    /// Square of each rotor's speed times all that changes its thrust, rad^2/s^2.
    pub rotor_thrust_rad2_s2: [f64; 4],
    /// Square of each rotor's speed, rad^2/s^2: the reaction torque follows it.
    pub rotor_speed_squared_rad2_s2: [f64; 4],
    pub(crate) constants: &'a Constants,
}

impl<'a> Sample<'a> {
    /// Still air, and thrust that follows the square of the speed.
    #[inline(always)]
    pub(crate) fn plain(input: &'a SampleInput, constants: &'a Constants) -> Self {
        let squared = input.rotor_rad_s.map(|w| w * w);
        Self {
            air_velocity_m_s: input.velocity_m_s,
            rotor_thrust_rad2_s2: squared,
            rotor_speed_squared_rad2_s2: squared,
            constants,
            input,
        }
    }

    /// Mass of the craft, kg.
    #[inline]
    pub fn mass_kg(&self) -> f64 {
        1.0 / self.constants.per_mass
    }

    /// Specific thrust of all rotors divided by C_T, m/s^2.
    #[inline]
    pub fn thrust_m_s2(&self) -> f64 {
        self.constants.beta_kg_m * self.constants.per_mass * self.rotor_thrust_rad2_s2.iter().sum::<f64>()
    }

    /// Signed sum of the rotor speeds: + for rotors that yaw the craft right, the S = w1 - w2 + w3 - w4 of the thesis
    /// (reference section 5), rad/s.
    #[inline(always)]
    pub fn signed_rotor_sum_rad_s(&self) -> f64 {
        let (w, s) = (&self.input.rotor_rad_s, &self.constants.spin);
        s[0] * w[0] + s[1] * w[1] + s[2] * w[2] + s[3] * w[3]
    }
}

/// One rotor where it is, for effects that change its thrust.
pub(crate) struct AtRotor<'a> {
    /// Counted from 0.
    pub(crate) rotor: usize,
    pub(crate) input: &'a SampleInput,
    /// Velocity of the craft relative to the air, body components, m/s.
    pub(crate) air_velocity_m_s: Vector3<f64>,
    pub(crate) constants: &'a Constants,
}

impl AtRotor<'_> {
    /// How far its hub is below z = 0, m.
    #[inline(always)]
    pub(crate) fn hub_down_m(&self) -> f64 {
        // Third column of the direction cosine matrix: body components of "down".
        let dcm = &self.input.dcm;
        let [x, y] = self.constants.hub_m[self.rotor];
        self.input.position_ned_m.z + dcm[(0, 2)] * x + dcm[(1, 2)] * y
    }
}
