//! Measured quantities at one instant: what formulas of users can name, and what effects act through.

use crate::rotor_quantity::RotorQuantity;
use crate::sample::Sample;

/// A measured quantity.
#[derive(Debug)]
pub struct Quantity {
    /// Name in formulas.
    pub name: &'static str,
    /// Unit, where rotor speeds are real rad/s. That of a model's quantity is [`Self::unit_for`] its rotors.
    pub unit: &'static str,
    /// Unit where commands stand in for rotor speeds, if another: "cmd" is that of a command.
    pub unit_in_commands: Option<&'static str>,
    /// What it is, for people.
    pub meaning: &'static str,
    value: fn(&Sample) -> f64,
}

impl Quantity {
    /// The quantity of this name, of [`QUANTITIES`] or [`COMBINATIONS`].
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().chain(COMBINATIONS).find(|quantity| quantity.name == name)
    }

    /// With a [`Quantity::unit_in_commands`].
    const fn in_commands(self, unit: &'static str) -> Self {
        Self { unit_in_commands: Some(unit), ..self }
    }

    /// Its unit in a model with such rotors ([`crate::Model::rotor_quantity`]).
    pub fn unit_for(&self, rotors: RotorQuantity) -> &'static str {
        rotors.choose(self.unit, self.unit_in_commands)
    }

    /// Its value at a sample.
    pub fn at(&self, sample: &Sample) -> f64 {
        (self.value)(sample)
    }
}

const fn quantity(
    name: &'static str,
    unit: &'static str,
    meaning: &'static str,
    value: fn(&Sample) -> f64,
) -> Quantity {
    Quantity { name, unit, unit_in_commands: None, meaning, value }
}

/// Those that formulas can name.
///
/// Velocities u, v, w are those through the air, as every aerodynamic effect sees them: over ground where the model has no
/// wind. Rotor speeds are commands where a vehicle's motor map is to be identified.
pub const QUANTITIES: &[Quantity] = &[
    quantity("u", "m/s", "forward velocity through the air, body", |s| s.air_velocity_m_s.x),
    quantity("v", "m/s", "rightward velocity through the air, body", |s| s.air_velocity_m_s.y),
    quantity("w", "m/s", "downward velocity through the air, body", |s| s.air_velocity_m_s.z),
    quantity("speed", "m/s", "speed through the air", |s| s.air_velocity_m_s.norm()),
    quantity("north_speed", "m/s", "velocity north over ground", |s| over_ground(s, 0)),
    quantity("east_speed", "m/s", "velocity east over ground", |s| over_ground(s, 1)),
    quantity("down_speed", "m/s", "velocity down over ground", |s| over_ground(s, 2)),
    quantity("p", "rad/s", "roll rate", |s| s.input.rate_rad_s.x),
    quantity("q", "rad/s", "pitch rate", |s| s.input.rate_rad_s.y),
    quantity("r", "rad/s", "yaw rate", |s| s.input.rate_rad_s.z),
    quantity("north", "m", "position north", |s| s.input.position_ned_m.x),
    quantity("east", "m", "position east", |s| s.input.position_ned_m.y),
    quantity("down", "m", "position down", |s| s.input.position_ned_m.z),
    quantity("height", "m", "height over z = 0, -down", |s| -s.input.position_ned_m.z),
    quantity("phi", "rad", "roll angle", |s| s.input.dcm[(1, 2)].atan2(s.input.dcm[(2, 2)])),
    quantity("theta", "rad", "pitch angle", |s| -s.input.dcm[(0, 2)].clamp(-1.0, 1.0).asin()),
    quantity("psi", "rad", "yaw angle, -pi to pi", |s| s.input.dcm[(0, 1)].atan2(s.input.dcm[(0, 0)])),
    quantity("thrust", "m/s^2", "specific thrust of all rotors divided by C_T", |s| s.thrust_m_s2())
        .in_commands("m cmd^2"),
    quantity("omega1", "rad/s", "speed of rotor 1, front left", |s| s.input.rotor_rad_s[0])
        .in_commands("cmd"),
    quantity("omega2", "rad/s", "speed of rotor 2, front right", |s| s.input.rotor_rad_s[1])
        .in_commands("cmd"),
    quantity("omega3", "rad/s", "speed of rotor 3, rear right", |s| s.input.rotor_rad_s[2])
        .in_commands("cmd"),
    quantity("omega4", "rad/s", "speed of rotor 4, rear left", |s| s.input.rotor_rad_s[3]).in_commands("cmd"),
    quantity("domega1", "rad/s^2", "acceleration of rotor 1", |s| s.input.rotor_acceleration_rad_s2[0])
        .in_commands("cmd/s"),
    quantity("domega2", "rad/s^2", "acceleration of rotor 2", |s| s.input.rotor_acceleration_rad_s2[1])
        .in_commands("cmd/s"),
    quantity("domega3", "rad/s^2", "acceleration of rotor 3", |s| s.input.rotor_acceleration_rad_s2[2])
        .in_commands("cmd/s"),
    quantity("domega4", "rad/s^2", "acceleration of rotor 4", |s| s.input.rotor_acceleration_rad_s2[3])
        .in_commands("cmd/s"),
    quantity("power", "W", "shaft power of all rotors divided by their torque coefficient", |s| {
        let beta_m2 = s.constants.beta_kg_m * s.constants.rotor_radius_m;
        beta_m2 * s.input.rotor_rad_s.iter().map(|speed| speed.abs().powi(3)).sum::<f64>()
    })
    .in_commands("kg m^2 cmd^3"),
    quantity("vbat", "V", "battery voltage", |s| s.input.battery_v),
    quantity("mass", "kg", "mass of the craft", |s| s.mass_kg()),
    quantity("gravity", "m/s^2", "acceleration of free fall", |s| s.constants.gravity_m_s2),
    quantity("arm_length", "m", "centre to motor", |s| s.constants.arm_length_m),
    quantity("rotor_radius", "m", "radius of a rotor", |s| s.constants.rotor_radius_m),
    quantity("air_density", "kg/m^3", "density of the air", |s| s.constants.air_density_kg_m3),
    quantity("pi", "1", "half a turn", |_| std::f64::consts::PI),
];

/// Combinations of them that effects act through and figures are drawn over. Formulas spell them out.
pub const COMBINATIONS: &[Quantity] = &[
    quantity("horizontal_speed", "m/s", "forward and rightward speed through the air", |s| {
        s.air_velocity_m_s.x.hypot(s.air_velocity_m_s.y)
    }),
    quantity("rotor_speed", "rad/s", "mean speed of the rotors", |s| mean(&s.input.rotor_rad_s))
        .in_commands("cmd"),
    quantity("rotor_acceleration", "rad/s^2", "mean acceleration of the rotors", |s| {
        mean(&s.input.rotor_acceleration_rad_s2)
    })
    .in_commands("cmd/s"),
    quantity(
        "roll_rotor_acceleration",
        "rad/s^2",
        "acceleration of the left rotors less that of the right ones",
        |s| signed(&s.input.rotor_acceleration_rad_s2, &[1.0, -1.0, -1.0, 1.0]),
    )
    .in_commands("cmd/s"),
    quantity(
        "pitch_rotor_acceleration",
        "rad/s^2",
        "acceleration of the front rotors less that of the rear ones",
        |s| signed(&s.input.rotor_acceleration_rad_s2, &[1.0, 1.0, -1.0, -1.0]),
    )
    .in_commands("cmd/s"),
    quantity(
        "yaw_rotor_acceleration",
        "rad/s^2",
        "acceleration of the rotors that yaw right less that of the others",
        |s| signed(&s.input.rotor_acceleration_rad_s2, &s.constants.spin),
    )
    .in_commands("cmd/s"),
    quantity("roll_moment", "Nm", "roll moment of the rotors divided by their coefficients", |s| {
        signed(&s.rotor_thrust_rad2_s2, &s.constants.roll_arm_kg_m2)
    })
    .in_commands("kg m^2 cmd^2"),
    quantity("pitch_moment", "Nm", "pitch moment of the rotors divided by their coefficients", |s| {
        signed(&s.rotor_thrust_rad2_s2, &s.constants.pitch_arm_kg_m2)
    })
    .in_commands("kg m^2 cmd^2"),
    quantity("yaw_moment", "Nm", "yaw moment of the rotors divided by their coefficients", |s| {
        let turning =
            std::array::from_fn(|k| s.constants.yaw_arm_kg_m2[k] * s.rotor_speed_squared_rad2_s2[k]);
        signed(&turning, &s.constants.spin)
    })
    .in_commands("kg m^2 cmd^2"),
    quantity("roll_acceleration", "rad/s^2", "roll acceleration", |s| s.input.angular_acceleration_rad_s2.x),
    quantity("pitch_acceleration", "rad/s^2", "pitch acceleration", |s| {
        s.input.angular_acceleration_rad_s2.y
    }),
    quantity("yaw_acceleration", "rad/s^2", "yaw acceleration", |s| s.input.angular_acceleration_rad_s2.z),
    quantity("pq", "rad^2/s^2", "roll rate times pitch rate", |s| {
        s.input.rate_rad_s.x * s.input.rate_rad_s.y
    }),
    quantity("pr", "rad^2/s^2", "roll rate times yaw rate", |s| s.input.rate_rad_s.x * s.input.rate_rad_s.z),
    quantity("qr", "rad^2/s^2", "pitch rate times yaw rate", |s| s.input.rate_rad_s.y * s.input.rate_rad_s.z),
];

fn mean(of_rotors: &[f64; 4]) -> f64 {
    0.25 * of_rotors.iter().sum::<f64>()
}

fn signed(of_rotors: &[f64; 4], weights: &[f64; 4]) -> f64 {
    of_rotors.iter().zip(weights).map(|(value, weight)| value * weight).sum()
}

fn over_ground(sample: &Sample, axis: usize) -> f64 {
    sample.input.dcm.column(axis).dot(&sample.input.velocity_m_s)
}
