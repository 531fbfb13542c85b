//! The parameters of a craft and of the air around it, and how they are drawn.

use model::{Motors, Spin, Vehicle};
use nalgebra::{Matrix3, Vector3};
use rand::{Rng, RngExt};

use super::odd::Odd;

/// Families of craft.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    /// An F330 of about 1.2 kg with 8-inch rotors and a slow lag.
    F330,
    /// 0.06 to 0.25 kg, 2.5 to 4 inch rotors at three times the speed, turning the other way round.
    Small,
    /// 2.5 to 4 kg, 13 to 15 inch rotors, slower still.
    Large,
}

impl Size {
    /// All.
    pub const ALL: [Self; 3] = [Self::F330, Self::Small, Self::Large];
    /// The two that every effect is hidden in.
    pub const MAIN: [Self; 2] = [Self::F330, Self::Small];

    /// For people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::F330 => "F330",
            Self::Small => "small",
            Self::Large => "large",
        }
    }
}

/// Rotor speed asked for by a command: `command * cmd + voltage * v + offset`, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Map {
    /// rad/s per command unit.
    pub command: f64,
    /// rad/s/V.
    pub voltage: f64,
    /// rad/s.
    pub offset: f64,
}

impl Map {
    /// Command that asks for a rotor speed.
    pub fn command_for(&self, speed_rad_s: f64, battery_v: f64) -> f64 {
        (speed_rad_s - self.voltage * battery_v - self.offset) / self.command
    }
}

/// A battery that falls with time and sags with the cube of the rotor speeds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// At rest at the start, V.
    pub full_v: f64,
    /// V/s.
    pub decay_v_s: f64,
    /// Sag of one rotor at `full_load_rad_s`, V.
    pub sag_v: f64,
    /// rad/s.
    pub full_load_rad_s: f64,
}

impl Cell {
    /// Terminal voltage, V.
    pub fn voltage_v(&self, time_s: f64, rotor_rad_s: &[f64; 4]) -> f64 {
        let load: f64 = rotor_rad_s.iter().map(|w| (w / self.full_load_rad_s).powi(3)).sum();
        self.full_v - self.decay_v_s * time_s - self.sag_v * load
    }
}

/// A spring to a fixed point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tether {
    /// N/m.
    pub stiffness_n_m: f64,
    /// NED, m.
    pub anchor_ned_m: Vector3<f64>,
}

/// A point mass on a massless link below the centre of mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// kg.
    pub mass_kg: f64,
    /// m.
    pub length_m: f64,
    /// Decay of its swing, 1/s.
    pub damping_s: f64,
}

/// What no catalogue of effects has.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Strange {
    /// Standard deviation of a gusty wind on each horizontal axis, m/s.
    pub gust_m_s: f64,
    /// Standard deviation of a wind that wanders within 4 s on each horizontal axis, m/s.
    pub wandering_m_s: f64,
    /// Speed of a draught out of an opening beside the flying space, m/s.
    pub draught_m_s: f64,
    /// Drag times 1 + this * cos(2 yaw).
    pub heading_drag: f64,
    /// Amplitude of a force that comes and goes at 0.7 Hz, N.
    pub hum_n: f64,
    /// Change of speed that the first motor does not react to, rad/s.
    pub dead_band_rad_s: f64,
    /// Part of the thrust that is lost once the motors are hot.
    pub fade: f64,
    /// Pull of a ceiling 1.9 m up, at it, m/s^2.
    pub ceiling_m_s2: f64,
    /// Pull of a wall 0.8 m to the east, at it, m/s^2.
    pub wall_m_s2: f64,
    /// Part of the mass that leaks away a second, 1/s.
    pub leak_per_s: f64,
    /// Drag forward times 1 + this, backward as it was.
    pub one_sided_drag: f64,
    /// Part of the thrust that is lost at 1 m/s down, into the own wake.
    pub settling: f64,
    /// Part by which the lag is slower where a rotor gains speed.
    pub sluggish: f64,
    /// Part of the thrust beyond that of hovering that is lost.
    pub stall: f64,
    /// Speed of a wind that turns round once in 16 s, m/s.
    pub turning_wind_m_s: f64,
    /// North wind for each metre of height, 1/s.
    pub shear_per_s: f64,
    /// Share of the mass of a thing that bounces on a spring under the craft at 2.5 Hz.
    pub bungee: f64,
    /// Thrust times 1 + this for each part by which a rotor is faster than its wake, which follows
    /// in 0.15 s.
    pub inflow: f64,
    /// Forward force of the first rotor for each newton beyond its share of the weight.
    pub loose_arm: f64,
    /// A form that no search lists, and its strength.
    pub odd: Option<(Odd, f64)>,
    /// Yaw torque for each m/s of air from the side, N s.
    pub weathercock_n_s: f64,
    /// Yaw torque back to north, times the sine of the heading, N m.
    pub torsion_nm: f64,
    /// Forward force for each m/s of air from the side, N s/m.
    pub skewed_drag_n_s_m: f64,
    /// Lift over a table whose edge is 0.1 m north, m/s^2.
    pub table_m_s2: f64,
    /// Press of a column of air that falls down 0.1 m north and east, m/s^2.
    pub column_m_s2: f64,
    /// Part of its thrust that the second rotor loses 11 s after the start.
    pub failing: f64,
    /// Thrust that is lost for each m/s sunk, in a wake that takes half a second to build up, 1/s.
    pub wake_memory_per_s: f64,
    /// Pull of a magnet on the floor 0.3 m north and 0.2 m west, at 0.5 m from it, m/s^2.
    pub magnet_m_s2: f64,
    /// Press away from a fan that stands upright 0.6 m south and 0.2 m east, near it, m/s^2.
    pub fan_m_s2: f64,
    /// Most press of a whirl around the vertical 0.2 m north and 0.1 m west, 0.4 m from it, m/s^2.
    pub whirl_m_s2: f64,
}

/// A craft and its air.
#[derive(Debug, Clone, PartialEq)]
pub struct Craft {
    /// Family.
    pub size: Size,
    /// kg.
    pub mass_kg: f64,
    /// m/s^2.
    pub gravity_m_s2: f64,
    /// Centre to hub, m.
    pub arm_m: f64,
    /// m.
    pub rotor_radius_m: f64,
    /// kg/m^3.
    pub air_density_kg_m3: f64,
    /// kg m^2.
    pub inertia_kg_m2: Matrix3<f64>,
    /// Thrust over speed squared, N s^2.
    pub thrust_n_s2: f64,
    /// Thrust over speed, N s.
    pub thrust_n_s: f64,
    /// Reaction torque over speed squared, N m s^2.
    pub torque_nm_s2: f64,
    /// Part of its thrust that each rotor gives.
    pub efficiency: [f64; 4],
    /// Part of its reaction torque that each rotor gives.
    pub torque_efficiency: [f64; 4],
    /// Angles by which each rotor's axis leans forward and to the right, rad.
    pub lean_rad: [[f64; 2]; 4],
    /// Moment of inertia of one rotor, kg m^2.
    pub rotor_inertia_kg_m2: f64,
    /// Share of the torque of a changing rotor speed that the body feels: 1 in nature, 0 in the
    /// basic model.
    pub spin_up_share: f64,
    /// +1 for rotors that turn counter-clockwise seen from above.
    pub spin: [f64; 4],
    /// First-order lag of the rotors, rad/s.
    pub lag_rad_s: f64,
    /// Dead time between a command and its rotor, s.
    pub delay_s: f64,
    /// True map of the motors.
    pub map: Map,
    /// Battery.
    pub battery: Cell,
    /// Linear drag u v w, N s/m.
    pub drag_n_s_m: [f64; 3],
    /// Angular damping p q r, N m s.
    pub damping_nm_s: [f64; 3],
    /// Quadratic drag in and across the rotor plane, N s^2/m^2.
    pub quadratic_drag: [f64; 2],
    /// Quadratic damping of yaw, N m s^2.
    pub quadratic_yaw_nm_s2: f64,
    /// Pitch moment over forward speed, and minus the roll moment over side speed, N s.
    pub flapping_n_s: [f64; 2],
    /// Forward force over pitch rate and side force over roll rate, N s.
    pub rate_coupling_n_s: [f64; 2],
    /// k of the ground effect.
    pub ground_gain: f64,
    /// Height of the hubs over that of the centre of mass, m.
    pub ground_offset_m: f64,
    /// Thrust times 1 + this * (u^2 + v^2), s^2/m^2.
    pub translational_lift_s2_m2: f64,
    /// m/s, NED.
    pub wind_ned_m_s: Vector3<f64>,
    /// Spring.
    pub tether: Option<Tether>,
    /// Pendulum.
    pub load: Option<Load>,
    /// Centre of mass from the middle of the hubs, m.
    pub centre_m: [f64; 2],
    /// Tracked point from the centre of mass, body, m.
    pub lever_m: Vector3<f64>,
    /// Turn of the tracked frame against the body about x and y, rad.
    pub tilt_rad: [f64; 2],
    /// Outside every catalogue.
    pub strange: Strange,
}

impl Craft {
    /// A craft of `size`, its parameters scattered as those of real ones are.
    pub fn draw(size: Size, rng: &mut impl Rng) -> Self {
        match size {
            Size::F330 => Self::f330(rng),
            Size::Small => Self::small(rng),
            Size::Large => Self::large(rng),
        }
    }

    fn f330(rng: &mut impl Rng) -> Self {
        let mut about = |value: f64, spread: f64| value * (1.0 + spread * rng.random_range(-1.0..1.0));
        Self {
            size: Size::F330,
            mass_kg: about(1.214, 0.10),
            gravity_m_s2: 9.81,
            arm_m: about(0.167, 0.06),
            rotor_radius_m: 0.1016,
            air_density_kg_m3: 1.225,
            inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(
                about(0.0140, 0.12),
                about(0.0150, 0.12),
                about(0.0240, 0.12),
            )),
            thrust_n_s2: about(7.4e-6, 0.12),
            thrust_n_s: 0.0,
            torque_nm_s2: about(2.65e-7, 0.12),
            rotor_inertia_kg_m2: about(3.6e-5, 0.15),
            spin_up_share: 0.0,
            spin: [1.0, -1.0, 1.0, -1.0],
            lag_rad_s: 21.5,
            delay_s: 0.0,
            map: Map { command: 0.785, voltage: 44.65, offset: -1205.1 },
            battery: Cell {
                full_v: about(12.0, 0.035),
                decay_v_s: 0.008,
                sag_v: 0.12,
                full_load_rad_s: 650.0,
            },
            drag_n_s_m: [about(0.27, 0.12), about(0.27, 0.12), about(0.29, 0.12)],
            damping_nm_s: [about(0.010, 0.15), about(0.010, 0.15), about(0.0125, 0.15)],
            ..Self::calm()
        }
    }

    /// The F330 grown: thrust coefficients with the fourth power of the rotors' size, moments of
    /// inertia with mass and length squared, drag with area, damping with area and length squared.
    fn large(rng: &mut impl Rng) -> Self {
        let mut about = |value: f64, spread: f64| value * (1.0 + spread * rng.random_range(-1.0..1.0));
        let (mass_kg, arm_m, rotor_radius_m) = (about(3.2, 0.2), about(0.29, 0.1), about(0.178, 0.07));
        let (heavier, longer) = (mass_kg / 1.214, arm_m / 0.167);
        let inertia = heavier * longer * longer;
        let blades = (rotor_radius_m / 0.1016_f64).powi(4);
        let area = longer * longer;
        let map = Map { command: 0.42, voltage: 12.0, offset: -640.0 };
        Self {
            size: Size::Large,
            mass_kg,
            arm_m,
            rotor_radius_m,
            inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(
                about(0.0140 * inertia, 0.12),
                about(0.0150 * inertia, 0.12),
                about(0.0240 * inertia, 0.12),
            )),
            thrust_n_s2: about(7.4e-6 * blades, 0.12),
            torque_nm_s2: about(2.65e-7 * blades * rotor_radius_m / 0.1016, 0.12),
            rotor_inertia_kg_m2: about(3.6e-5 * blades, 0.15),
            spin_up_share: 0.0,
            spin: [1.0, -1.0, 1.0, -1.0],
            lag_rad_s: 17.0,
            map,
            battery: Cell { full_v: about(24.0, 0.03), decay_v_s: 0.014, sag_v: 0.2, full_load_rad_s: 330.0 },
            drag_n_s_m: [0.27, 0.27, 0.29].map(|d| about(d * area, 0.12)),
            damping_nm_s: [0.010, 0.010, 0.0125].map(|d| about(d * area * area, 0.15)),
            ..Self::calm()
        }
    }

    /// Mass over two octaves; lengths as its cube root, speeds so that the thrust coefficient stays
    /// near the F330's.
    fn small(rng: &mut impl Rng) -> Self {
        let mass_kg = 0.06 * (0.25_f64 / 0.06).powf(rng.random_range(0.0..1.0));
        let mut about = |value: f64, spread: f64| value * (1.0 + spread * rng.random_range(-1.0..1.0));
        let scale = (mass_kg / 0.12).cbrt();
        let arm_m = about(0.065 * scale, 0.06);
        let rotor_radius_m = about(0.034 * scale, 0.06);
        let air_density_kg_m3 = 1.2;
        let area_m2 = std::f64::consts::PI * rotor_radius_m * rotor_radius_m;
        let thrust_n_s2 = about(0.019, 0.12) * air_density_kg_m3 * area_m2 * rotor_radius_m * rotor_radius_m;
        let hover_rad_s = (0.25 * mass_kg * 9.81 / thrust_n_s2).sqrt();
        let body = mass_kg * arm_m * arm_m;
        let inertia =
            Vector3::new(about(0.42 * body, 0.12), about(0.45 * body, 0.12), about(0.72 * body, 0.12));
        Self {
            size: Size::Small,
            mass_kg,
            gravity_m_s2: 9.81,
            arm_m,
            rotor_radius_m,
            air_density_kg_m3,
            inertia_kg_m2: Matrix3::from_diagonal(&inertia),
            thrust_n_s2,
            thrust_n_s: 0.0,
            torque_nm_s2: thrust_n_s2 * about(0.33 * rotor_radius_m, 0.12),
            rotor_inertia_kg_m2: inertia.x * about(0.002, 0.15),
            spin_up_share: 0.0,
            spin: [-1.0, 1.0, -1.0, 1.0],
            lag_rad_s: about(38.0, 0.15),
            delay_s: 0.0,
            // Normalised commands; hover at about 0.55 with two cells at 7.6 V.
            map: Map {
                command: 1.1 * hover_rad_s,
                voltage: 0.07 * hover_rad_s,
                offset: hover_rad_s * (1.0 - 1.1 * 0.55 - 0.07 * 7.6),
            },
            battery: Cell {
                full_v: about(8.0, 0.03),
                decay_v_s: 0.006,
                sag_v: 0.08,
                full_load_rad_s: hover_rad_s,
            },
            drag_n_s_m: [
                about(0.30 * mass_kg, 0.15),
                about(0.30 * mass_kg, 0.15),
                about(0.33 * mass_kg, 0.15),
            ],
            damping_nm_s: [
                about(0.9 * inertia.x, 0.2),
                about(0.9 * inertia.y, 0.2),
                about(0.7 * inertia.z, 0.2),
            ],
            ..Self::calm()
        }
    }

    /// Nothing but neutral values: every craft names its own for those that matter.
    fn calm() -> Self {
        Self {
            size: Size::F330,
            mass_kg: 1.0,
            gravity_m_s2: 9.81,
            arm_m: 0.1,
            rotor_radius_m: 0.1,
            air_density_kg_m3: 1.225,
            inertia_kg_m2: Matrix3::identity(),
            thrust_n_s2: 0.0,
            thrust_n_s: 0.0,
            torque_nm_s2: 0.0,
            efficiency: [1.0; 4],
            torque_efficiency: [1.0; 4],
            lean_rad: [[0.0; 2]; 4],
            rotor_inertia_kg_m2: 0.0,
            spin_up_share: 0.0,
            spin: [1.0, -1.0, 1.0, -1.0],
            lag_rad_s: 20.0,
            delay_s: 0.0,
            map: Map { command: 1.0, voltage: 0.0, offset: 0.0 },
            battery: Cell { full_v: 12.0, decay_v_s: 0.0, sag_v: 0.0, full_load_rad_s: 1.0 },
            drag_n_s_m: [0.0; 3],
            damping_nm_s: [0.0; 3],
            quadratic_drag: [0.0; 2],
            quadratic_yaw_nm_s2: 0.0,
            flapping_n_s: [0.0; 2],
            rate_coupling_n_s: [0.0; 2],
            ground_gain: 0.0,
            ground_offset_m: 0.0,
            translational_lift_s2_m2: 0.0,
            wind_ned_m_s: Vector3::zeros(),
            tether: None,
            load: None,
            centre_m: [0.0; 2],
            lever_m: Vector3::zeros(),
            tilt_rad: [0.0; 2],
            strange: Strange::default(),
        }
    }

    /// Hubs from the centre of mass along x and y of the body, m.
    pub fn hubs_m(&self) -> [[f64; 2]; 4] {
        let a = self.arm_m * std::f64::consts::FRAC_1_SQRT_2;
        let [x, y] = self.centre_m;
        [[a, -a], [a, a], [-a, a], [-a, -a]].map(|[hx, hy]| [hx - x, hy - y])
    }

    /// Speed at which four such rotors carry the craft and its load, rad/s.
    pub fn hover_rad_s(&self) -> f64 {
        let carried_kg = self.mass_kg + self.load.map_or(0.0, |load| load.mass_kg);
        let each_n = 0.25 * carried_kg * self.gravity_m_s2;
        let (a, b) = (self.thrust_n_s2, self.thrust_n_s);
        (-b + (b * b + 4.0 * a * each_n).sqrt()) / (2.0 * a)
    }

    /// Voltage in hover at the start, V.
    pub fn hover_v(&self) -> f64 {
        self.battery.voltage_v(0.0, &[self.hover_rad_s(); 4])
    }

    /// Smallest and largest command.
    pub const fn command_range(&self) -> [f64; 2] {
        match self.size {
            Size::F330 | Size::Large => [1050.0, 1990.0],
            Size::Small => [0.0, 1.0],
        }
    }

    /// The vehicle file of an operator who measured everything right.
    pub fn vehicle(&self) -> Vehicle {
        let spin = self.spin.map(|s| if s > 0.0 { Spin::Ccw } else { Spin::Cw });
        let (name, unit) = match self.size {
            Size::F330 => ("F330-like", "us"),
            Size::Small => ("small", "normalised"),
            Size::Large => ("large", "us"),
        };
        Vehicle {
            unmeasured: Vec::new(),
            name: name.into(),
            mass: self.mass_kg,
            arm_length: self.arm_m,
            rotor_radius: self.rotor_radius_m,
            air_density: self.air_density_kg_m3,
            gravity: self.gravity_m_s2,
            tracked_point: [0.0; 3],
            motors: Motors {
                spin,
                command_unit: unit.into(),
                command_range: self.command_range(),
                map: None,
                command: Some(self.map.command),
                voltage: Some(self.map.voltage),
                offset: Some(self.map.offset),
                lag: Some(self.lag_rad_s),
                log_order: None,
            },
            battery: model::Pack::default(),
            columns: model::LogColumns::new(),
            frames: model::LogFrames::default(),
        }
    }
}
