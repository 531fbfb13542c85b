//! Effects that can be planted into a world, by identifier and strength.
//!
//! Strength 1 is what a person would notice: about what the flights of the outside simulator beside
//! this project hide. For the small craft, sizes are scaled so that the accelerations stay alike;
//! lengths go with the craft.

use model::Vehicle;
use nalgebra::Vector3;
use rand::RngExt;
use rand_pcg::Pcg64;

use super::craft::{Craft, Load, Tether};
use super::odd::Odd;

/// An effect that is in a world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Planted {
    /// Identifier.
    pub id: &'static str,
    /// 1 is what a person would notice.
    pub strength: f64,
}

/// An identifier that no effect of the worlds has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("no effect of the simulated worlds is called {0}")]
pub struct UnknownEffect(pub String);

/// Changes a craft, or what its operator believes of it.
type Plant = fn(&mut Craft, &mut Vehicle, f64, &mut Pcg64);

/// An effect that can be planted.
pub struct Seedling {
    /// Identifier, as in commands and files where the product knows the effect.
    pub id: &'static str,
    /// One sentence.
    pub what: &'static str,
    plant: Plant,
}

const fn seedling(id: &'static str, what: &'static str, plant: Plant) -> Seedling {
    Seedling { id, what, plant }
}

/// Effects that a catalogue may name.
pub const PLANTED: &[Seedling] = &[
    seedling("quadratic-drag", "drag growing with speed squared", |c, _, s, _| {
        // 0.22 N s^2/m^2 on the F330: four fifths of its linear drag at 1 m/s.
        let size = s * 0.81 * c.drag_n_s_m[0];
        c.quadratic_drag = [size, size];
    }),
    seedling("flapping-moment", "moments from speed", |c, _, s, _| {
        c.flapping_n_s = [s * 2.7 * c.inertia_kg_m2[(1, 1)], s * 3.4 * c.inertia_kg_m2[(0, 0)]];
    }),
    seedling("rate-coupling", "forces from body rates", |c, _, s, _| {
        c.rate_coupling_n_s = [s * 0.25 * c.mass_kg, -s * 0.25 * c.mass_kg];
    }),
    seedling("ground-effect", "more thrust close to the floor", |c, _, s, _| {
        c.ground_gain = 1.6 * s;
        c.ground_offset_m = 0.2 * c.rotor_radius_m;
    }),
    seedling("translational-lift", "more thrust with airspeed", |c, _, s, _| {
        c.translational_lift_s2_m2 = 0.02 * s;
    }),
    seedling("steady-wind", "a constant wind", |c, _, s, rng| {
        let towards = rng.random_range(0.0..std::f64::consts::TAU);
        c.wind_ned_m_s = Vector3::new(towards.cos(), towards.sin(), 0.0) * (1.3 * s);
    }),
    seedling("wind-shear", "a wind that grows with height", |c, _, s, _| c.strange.shear_per_s = 1.2 * s),
    seedling("battery-voltage", "a motor map that leaves out part of the voltage", |c, vehicle, s, _| {
        c.battery.decay_v_s *= 2.25;
        c.battery.sag_v *= 1.6;
        let missing = s * c.map.voltage;
        let measured_v = c.battery.full_v - 3.0 * c.battery.sag_v;
        vehicle.motors.voltage = Some(c.map.voltage - missing);
        vehicle.motors.offset = Some(c.map.offset + missing * measured_v);
    }),
    seedling("motor-lag", "slower rotors than the vehicle file says", |c, _, s, _| {
        c.lag_rad_s *= 1.0 - 0.35 * s;
    }),
    seedling("input-delay", "dead time between command and rotor", |c, _, s, _| c.delay_s = 0.02 * s),
    seedling("attitude-offset", "a tilted tracker", |c, _, s, rng| {
        let towards = rng.random_range(0.0..std::f64::consts::TAU);
        c.tilt_rad = [0.025 * s * towards.cos(), 0.025 * s * towards.sin()];
    }),
    seedling("tracking-offset", "a tracked point off the centre of mass", |c, _, s, _| {
        let scale = c.arm_m / 0.167;
        c.lever_m = Vector3::new(0.010, 0.0, 0.054) * (s * scale);
    }),
    seedling("rotor-inertia", "yaw torque from rotor acceleration", |c, _, s, _| c.spin_up_share = s),
    seedling("product-of-inertia", "Ixz", |c, _, s, _| {
        let ixz = 0.12 * s * c.inertia_kg_m2[(0, 0)];
        c.inertia_kg_m2[(0, 2)] = -ixz;
        c.inertia_kg_m2[(2, 0)] = -ixz;
    }),
    seedling("quadratic-yaw-damping", "yaw torque growing with rate squared", |c, _, s, _| {
        c.quadratic_yaw_nm_s2 = 1.2 * s * c.inertia_kg_m2[(2, 2)];
    }),
    seedling("thrust-linear", "thrust not purely quadratic in rotor speed", |c, _, s, _| {
        let (share, hover) = (0.3 * s, c.hover_rad_s());
        c.thrust_n_s = share * c.thrust_n_s2 * hover;
        c.thrust_n_s2 *= 1.0 - share;
    }),
    seedling("tether", "a spring to a fixed point", |c, _, s, _| {
        let stiffness_n_m = 0.45 * s * c.mass_kg;
        c.tether = Some(Tether { stiffness_n_m, anchor_ned_m: Vector3::new(0.0, 0.0, -1.0) });
    }),
    seedling("slung-load", "a pendulum under the craft", |c, _, s, _| {
        let length_m = 2.4 * c.arm_m;
        c.load = Some(Load { mass_kg: 0.08 * s * c.mass_kg, length_m, damping_s: 0.3 });
    }),
    seedling("unequal-thrust", "rotors that do not give the same thrust", |c, _, s, rng| {
        // Left against right, front against back, one diagonal against the other.
        let [left, front, diagonal] = [(); 3].map(|()| {
            let size = s * rng.random_range(0.02..0.04);
            if rng.random_bool(0.5) { size } else { -size }
        });
        c.efficiency = [
            1.0 + left + front + diagonal,
            1.0 - left + front - diagonal,
            1.0 - left - front + diagonal,
            1.0 + left - front - diagonal,
        ];
        if rng.random_bool(0.5) {
            c.torque_efficiency = c.efficiency;
        }
    }),
    seedling("mass-change", "heavier than before", |c, _, s, _| c.mass_kg *= 1.0 + 0.10 * s),
    seedling("com-offset", "a centre of mass shifted sideways", |c, _, s, rng| {
        let towards = rng.random_range(0.0..std::f64::consts::TAU);
        let shift = 0.05 * s * c.arm_m;
        c.centre_m = [shift * towards.cos(), shift * towards.sin()];
        // The marker stays where it is on the frame.
        c.lever_m -= Vector3::new(c.centre_m[0], c.centre_m[1], 0.0);
    }),
    seedling("motor-efficiency", "one rotor gives less", |c, _, s, rng| {
        let rotor = rng.random_range(0..4);
        c.efficiency[rotor] = 1.0 - 0.14 * s;
        // A chipped blade takes its torque as before; a slow motor loses torque and thrust alike.
        if rng.random_bool(0.5) {
            c.torque_efficiency[rotor] = c.efficiency[rotor];
        }
    }),
    seedling("motor-torque", "a damaged propeller that lifts as before", |c, _, s, rng| {
        c.torque_efficiency[rng.random_range(0..4)] = 1.0 + 0.2 * s;
    }),
    seedling("motor-tilt", "a bent arm", |c, _, s, rng| {
        let towards = rng.random_range(0.0..std::f64::consts::TAU);
        let lean_rad = (6.0 * s).to_radians();
        c.lean_rad[rng.random_range(0..4)] = [lean_rad * towards.cos(), lean_rad * towards.sin()];
    }),
];

/// Effects that no catalogue names.
pub const OUTSIDE: &[Seedling] = &[
    seedling("gusts", "a wind that changes within half a second", |c, _, s, _| c.strange.gust_m_s = 1.0 * s),
    seedling("draught", "a jet of air across the flying space", |c, _, s, _| c.strange.draught_m_s = 2.0 * s),
    seedling("heading-drag", "drag that depends on the heading", |c, _, s, _| {
        c.strange.heading_drag = 0.8 * s
    }),
    seedling("hum", "a force that comes and goes at 0.7 Hz", |c, _, s, _| {
        c.strange.hum_n = 0.25 * s * c.mass_kg;
    }),
    seedling("dead-band", "a motor that ignores small changes", |c, _, s, _| {
        c.strange.dead_band_rad_s = 0.025 * s * c.hover_rad_s();
    }),
    seedling("ceiling", "a pull to the ceiling", |c, _, s, _| c.strange.ceiling_m_s2 = 0.7 * s),
    seedling("wall", "a pull to a wall", |c, _, s, _| c.strange.wall_m_s2 = 0.8 * s),
    seedling("leak", "a cargo that trickles out", |c, _, s, _| c.strange.leak_per_s = 0.004 * s),
    seedling("one-sided-drag", "drag that is larger forward than backward", |c, _, s, _| {
        c.strange.one_sided_drag = 1.5 * s;
    }),
    seedling("settling", "thrust that is lost in the own wake", |c, _, s, _| c.strange.settling = 0.07 * s),
    seedling("sluggish", "rotors slower to gain speed than to lose it", |c, _, s, _| {
        c.strange.sluggish = 0.5 * s
    }),
    seedling("stall", "less thrust for more speed beyond hovering", |c, _, s, _| c.strange.stall = 0.4 * s),
    seedling("turning-wind", "a wind that turns round in 16 s", |c, _, s, _| {
        c.strange.turning_wind_m_s = 1.3 * s;
    }),
    seedling("bungee", "a thing that bounces under the craft", |c, _, s, _| c.strange.bungee = 0.05 * s),
    seedling("loose-arm", "a rotor that leans forward with its thrust", |c, _, s, _| {
        c.strange.loose_arm = 0.3 * s
    }),
    seedling("inflow", "thrust ahead of a wake that takes time to follow", |c, _, s, _| {
        c.strange.inflow = 0.6 * s
    }),
    seedling("hot-motors", "thrust that fades as the motors get hot", |c, _, s, _| c.strange.fade = 0.08 * s),
];

/// Further ones, for the question what the unknown looks like.
pub const FORMS: &[Seedling] = &[
    seedling("weathercock", "air from the side turns the craft about its yaw axis", |c, _, s, _| {
        c.strange.weathercock_n_s = 0.5 * s * c.inertia_kg_m2[(2, 2)];
    }),
    seedling("torsion", "a cable that turns the craft back to north", |c, _, s, _| {
        c.strange.torsion_nm = 0.8 * s * c.inertia_kg_m2[(2, 2)];
    }),
    seedling("skewed-drag", "air from the side pushes the craft forward", |c, _, s, _| {
        c.strange.skewed_drag_n_s_m = 0.55 * s * c.drag_n_s_m[0];
    }),
    seedling("table", "more lift over a table", |c, _, s, _| c.strange.table_m_s2 = 0.3 * s),
    seedling("column", "a column of falling air", |c, _, s, _| c.strange.column_m_s2 = 0.7 * s),
    seedling("failing", "a rotor that loses thrust in flight", |c, _, s, _| c.strange.failing = 0.08 * s),
    seedling("wake-memory", "thrust that is lost some time after sinking", |c, _, s, _| {
        c.strange.wake_memory_per_s = 0.5 * s;
    }),
    seedling("magnet", "a magnet on the floor", |c, _, s, _| c.strange.magnet_m_s2 = 0.8 * s),
    seedling("fan", "air that spreads from a fan", |c, _, s, _| c.strange.fan_m_s2 = 0.8 * s),
    seedling("whirl", "air that turns in the room", |c, _, s, _| c.strange.whirl_m_s2 = 0.5 * s),
];

/// Those that no search lists as they are.
pub const ODD: &[Seedling] = &[
    seedling("dead-zone", "air from the side that pushes beyond a speed", |c, _, s, _| {
        c.strange.odd = Some((Odd::DeadZone, s))
    }),
    seedling("square-root-drag", "drag forward with the root of the speed", |c, _, s, _| {
        c.strange.odd = Some((Odd::SquareRoot, s))
    }),
    seedling("ribs", "ribs on the floor that lift or do not", |c, _, s, _| {
        c.strange.odd = Some((Odd::Ribs, s))
    }),
    seedling("bounded-pitching", "a pitching moment of speed that ends at a bound", |c, _, s, _| {
        c.strange.odd = Some((Odd::Bounded, s))
    }),
    seedling("antenna", "an antenna that swings and turns the craft", |c, _, s, _| {
        c.strange.odd = Some((Odd::Antenna, s))
    }),
    seedling("two-lags", "thrust that is lost behind two lags of sinking", |c, _, s, _| {
        c.strange.odd = Some((Odd::TwoLags, s))
    }),
    seedling("gusty-side", "a push by as much as air from the side is ahead of its mean", |c, _, s, _| {
        c.strange.odd = Some((Odd::Ahead, s))
    }),
    seedling("two-walls", "pulls to two walls", |c, _, s, _| c.strange.odd = Some((Odd::TwoWalls, s))),
    seedling("wall-and-weathercock", "a wall, and air from the side that turns the craft", |c, _, s, _| {
        c.strange.odd = Some((Odd::WallAndWeathercock, s))
    }),
    seedling("ceiling-and-door", "a ceiling, and a door that opens for a while", |c, _, s, _| {
        c.strange.odd = Some((Odd::CeilingAndDoor, s))
    }),
    seedling("shear-layer", "wind from a height on", |c, _, s, _| c.strange.odd = Some((Odd::ShearLayer, s))),
    seedling("floor-damping", "damping close to the floor", |c, _, s, _| {
        c.strange.odd = Some((Odd::FloorDamping, s))
    }),
    seedling("lorentz", "a jet with wide skirts", |c, _, s, _| c.strange.odd = Some((Odd::Lorentz, s))),
    seedling("climb", "thrust that is lost in a climb", |c, _, s, _| c.strange.odd = Some((Odd::Climb, s))),
    seedling("slanting-plane", "a push above a slanting plane", |c, _, s, _| {
        c.strange.odd = Some((Odd::SlantingPlane, s))
    }),
    seedling("tired", "thrust that is lost with the energy used", |c, _, s, _| {
        c.strange.odd = Some((Odd::Tired, s))
    }),
];

/// Effects that happen to a craft whose model was good: flown before and after.
pub fn changes() -> impl Iterator<Item = &'static str> {
    ["mass-change", "com-offset", "motor-efficiency", "motor-torque", "motor-tilt"].into_iter()
}

pub(super) fn plant(
    id: &str,
    strength: f64,
    craft: &mut Craft,
    vehicle: &mut Vehicle,
    mut rng: Pcg64,
) -> Result<&'static str, UnknownEffect> {
    let known = PLANTED.iter().chain(OUTSIDE).chain(FORMS).chain(ODD).find(|seedling| seedling.id == id);
    let seedling = known.ok_or_else(|| UnknownEffect(id.to_owned()))?;
    (seedling.plant)(craft, vehicle, strength, &mut rng);
    Ok(seedling.id)
}
