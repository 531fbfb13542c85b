//! What an effect can look at: the craft, its air and its rotors at one instant.

use nalgebra::{Matrix3, Vector3};

use crate::{Load, Swing, Vehicle, frames};

/// What the effects of kind [`crate::Kind::Adjusting`] change. Neutral by default.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adjustments {
    /// Steady wind, inertial NED, m/s (the air's velocity over ground).
    pub wind_ned_m_s: Vector3<f64>,
    /// k of the ground effect: each rotor's thrust times 1 / (1 - k (R / 4h)^2).
    pub ground_effect_gain: f64,
    /// Height of the hubs over the floor beyond that of the centre of mass over z = 0, m.
    pub ground_effect_height_offset_m: f64,
    /// Rotor speed per volt beyond the map, rad/s/V, about `reference_voltage_v`.
    pub rotor_speed_per_volt: f64,
    /// Voltage at which the map is right, V.
    pub reference_voltage_v: f64,
    /// Tracked point beyond the vehicle file's, body FRD, m.
    pub tracked_point_m: Vector3<f64>,
    /// k of the translational lift: each rotor's thrust times 1 + k (u^2 + v^2) of the air-relative velocity, s^2/m^2.
    pub translational_lift_s2_m2: f64,
    /// Part of the thrust in proportion to the rotor speed: thrust goes with w^2 + this * w, rad/s.
    pub thrust_linear_rad_s: f64,
    /// Time constant of the rotors beyond the vehicle file's, s.
    pub motor_time_constant_s: f64,
    /// Dead time between command and rotor, s.
    pub input_delay_s: f64,
    /// Mass beyond the vehicle file's, kg.
    pub extra_mass_kg: f64,
    /// Centre of mass beyond the geometric centre, forward and right, m.
    pub com_offset_m: [f64; 2],
    /// Part of each rotor's thrust that is lost.
    pub thrust_loss: [f64; 4],
    /// A load on a cable under the craft.
    pub load: Option<Load>,
    /// Tilt of the tracked attitude against the body about x and y, rad: measured = true followed by the tilt.
    pub attitude_tilt_rad: [f64; 2],
}

impl Default for Adjustments {
    fn default() -> Self {
        Self {
            wind_ned_m_s: Vector3::zeros(),
            ground_effect_gain: 0.0,
            ground_effect_height_offset_m: 0.0,
            rotor_speed_per_volt: 0.0,
            reference_voltage_v: 0.0,
            tracked_point_m: Vector3::zeros(),
            translational_lift_s2_m2: 0.0,
            thrust_linear_rad_s: 0.0,
            motor_time_constant_s: 0.0,
            input_delay_s: 0.0,
            extra_mass_kg: 0.0,
            com_offset_m: [0.0; 2],
            thrust_loss: [0.0; 4],
            load: None,
            attitude_tilt_rad: [0.0; 2],
        }
    }
}

impl Adjustments {
    /// Rotor speed in rad/s after the voltage correction.
    pub fn corrected_speed_rad_s(&self, speed_rad_s: f64, battery_v: f64) -> f64 {
        if self.rotor_speed_per_volt == 0.0 {
            return speed_rad_s;
        }
        (speed_rad_s + self.rotor_speed_per_volt * (battery_v - self.reference_voltage_v)).max(0.0)
    }

    /// Lag of the rotors in rad/s behind the vehicle file's, absent when they follow at once.
    pub fn lag_rad_s(&self, vehicle_lag_rad_s: Option<f64>) -> Option<f64> {
        if self.motor_time_constant_s == 0.0 {
            return vehicle_lag_rad_s;
        }
        let time_constant_s = vehicle_lag_rad_s.map_or(0.0, |lag| 1.0 / lag) + self.motor_time_constant_s;
        // A tenth of a millisecond is at once for a craft of any size.
        (time_constant_s > 1e-4).then(|| 1.0 / time_constant_s)
    }

    /// Whether anything stands between the square of a rotor's speed and its thrust.
    fn changes_thrust(&self) -> bool {
        self.ground_effect_gain != 0.0
            || self.translational_lift_s2_m2 != 0.0
            || self.thrust_linear_rad_s != 0.0
            || self.thrust_loss != [0.0; 4]
    }

    /// Whether a sample is plain: see [`Sample::plain`].
    pub(crate) fn leaves_samples_plain(&self) -> bool {
        self.wind_ned_m_s == Vector3::zeros() && !self.changes_thrust() && self.load.is_none()
    }

    fn tilt(&self) -> Option<Matrix3<f64>> {
        let [x, y] = self.attitude_tilt_rad;
        (x != 0.0 || y != 0.0).then(|| frames::dcm_from_rotation_vector(Vector3::new(x, y, 0.0)))
    }

    /// The attitude a tracker reports for the body's attitude (both inertial to body).
    pub fn measured_dcm(&self, dcm: &Matrix3<f64>) -> Matrix3<f64> {
        self.tilt().map_or(*dcm, |tilt| tilt * dcm)
    }

    /// The body's attitude behind a tracked one (both inertial to body).
    pub fn true_dcm(&self, measured: &Matrix3<f64>) -> Matrix3<f64> {
        self.tilt().map_or(*measured, |tilt| tilt.transpose() * measured)
    }
}

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
    /// The same for pitch (front rotors pitch up).
    pub(crate) pitch_arm_kg_m2: [f64; 4],
    changes_thrust: bool,
    pub(crate) spin: [f64; 4],
    /// Rotor hubs in the body frame: +-l/sqrt(2) along x and y, m.
    pub(crate) hub_m: [[f64; 2]; 4],
}

impl Constants {
    pub(crate) fn new(vehicle: &Vehicle, adjust: &Adjustments) -> Self {
        let beta = vehicle.beta_kg_m();
        let reach = vehicle.arm_length * std::f64::consts::FRAC_1_SQRT_2;
        let arm = std::f64::consts::SQRT_2 * vehicle.arm_length * beta;
        // The lever of a hub is its distance from the centre of mass: y - dy to the side, x - dx ahead.
        let [dx, dy] = adjust.com_offset_m;
        let (forward, right) = (dx / reach, dy / reach);
        Self {
            per_mass: 1.0 / (vehicle.mass + adjust.extra_mass_kg),
            beta_kg_m: beta,
            rotor_radius_m: vehicle.rotor_radius,
            arm_length_m: vehicle.arm_length,
            air_density_kg_m3: vehicle.air_density,
            gravity_m_s2: vehicle.gravity,
            roll_arm_kg_m2: [1.0 + right, right - 1.0, right - 1.0, 1.0 + right].map(|side| arm * side),
            pitch_arm_kg_m2: [1.0 - forward, 1.0 - forward, -1.0 - forward, -1.0 - forward]
                .map(|ahead| arm * ahead),
            changes_thrust: adjust.changes_thrust(),
            spin: vehicle.motors.spin.map(|s| s.yaw_sign()),
            hub_m: [[reach, -reach], [reach, reach], [-reach, reach], [-reach, -reach]],
        }
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
    pub swing: Swing,
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

    #[inline(always)]
    pub(crate) fn with_constants(
        input: &'a SampleInput,
        constants: &'a Constants,
        adjust: &Adjustments,
    ) -> Self {
        let mut sample = Self::plain(input, constants);
        if adjust.wind_ned_m_s != Vector3::zeros() {
            sample.air_velocity_m_s -= input.dcm * adjust.wind_ned_m_s;
        }
        if constants.changes_thrust {
            // Third column of the direction cosine matrix: body components of "down".
            let down = [input.dcm[(0, 2)], input.dcm[(1, 2)]];
            let (u, v) = (sample.air_velocity_m_s.x, sample.air_velocity_m_s.y);
            sample.rotor_thrust_rad2_s2 = changed_thrust(
                input.rotor_rad_s,
                input.position_ned_m.z,
                down,
                u * u + v * v,
                constants,
                adjust,
            );
        }
        sample
    }

    /// Signed sum of the rotor speeds: + for rotors that yaw the craft right, the S = w1 - w2 + w3 - w4 of the thesis
    /// (reference section 5), rad/s.
    pub fn signed_rotor_sum_rad_s(&self) -> f64 {
        let (w, s) = (&self.input.rotor_rad_s, &self.constants.spin);
        s[0] * w[0] + s[1] * w[1] + s[2] * w[2] + s[3] * w[3]
    }
}

/// What stands in for the square of each rotor's speed in its thrust, rad^2/s^2: the part linear in the speed, what is
/// lost, translational lift, and Cheeseman and Bennett's ground effect 1 / (1 - k (R / 4h)^2) with each hub's own height
/// over the floor at z = 0; `z_m` is the centre of mass, `down` the body components along x and y of "down".
///
/// Out of line and fed by value: most plants have none of this, and their integration stays in registers.
#[inline(never)]
fn changed_thrust(
    speed_rad_s: [f64; 4],
    z_m: f64,
    down: [f64; 2],
    airspeed_squared_m2_s2: f64,
    constants: &Constants,
    adjust: &Adjustments,
) -> [f64; 4] {
    let lift = 1.0 + adjust.translational_lift_s2_m2 * airspeed_squared_m2_s2;
    std::array::from_fn(|rotor| {
        let w = speed_rad_s[rotor];
        let [x, y] = constants.hub_m[rotor];
        let hub_down_m = z_m + down[0] * x + down[1] * y;
        // Cheeseman and Bennett give the formula for heights over half a radius; lower, a craft is on its landing gear.
        let height_m =
            (adjust.ground_effect_height_offset_m - hub_down_m).max(0.5 * constants.rotor_radius_m);
        let ratio = 0.25 * constants.rotor_radius_m / height_m;
        let ground = 1.0 / (1.0 - adjust.ground_effect_gain * ratio * ratio).max(0.2);
        (w * w + adjust.thrust_linear_rad_s * w) * (1.0 - adjust.thrust_loss[rotor]) * lift * ground
    })
}
