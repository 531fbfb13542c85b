//! What makes flights or their logs difficult, whatever a world hides.

use flights::{Column, Flight};
use model::MotorMapKind;
use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::Serialize;
use stories::world::{Pattern, Sensors, World, log};

/// A difficulty of flights or logs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Condition {
    /// Flights from the floor to the floor.
    FloorAtBothEnds,
    /// Each flight has a wind of its own.
    WindBetweenFlights,
    /// A wind that wanders within seconds.
    WanderingWind,
    /// A log of so many rows a second of a loop that ticks at 100 Hz.
    #[serde(rename = "log")]
    LoggedAt(u16),
    /// States of 25 Hz, interpolated to 100 Hz.
    Interpolated,
    /// Flights of 8 s.
    Short,
    /// No test stand.
    MapUnknown,
    /// No gyro: rates are differences of the attitude.
    DerivedRates,
    /// Pieces of the log are missing.
    Gaps,
    /// A large product of inertia besides what is hidden.
    ProductOfInertia,
    /// Two days with other batteries.
    TwoBatteries,
    /// No gyro in the log at all.
    NoGyro,
    /// No voltage in the log: of motors whose speed is held whatever it is, or of a craft without a
    /// test stand.
    NoVoltage,
    /// No position in the log, but an accelerometer.
    NoPosition,
    /// Rotor speeds in the log, and no commands.
    NoCommands,
    /// A pilot who flies by the noise of gyro and attitude, and shakes no motor.
    NoiseFedBack,
}

/// What a log at 25 Hz still shows: it changes as slowly as the craft moves.
const SLOW: &[&str] = &["ground-effect", "steady-wind", "tether", "quadratic-drag", "attitude-offset"];
/// What needs the rates and commands of each moment.
const QUICK: &[&str] = &[
    "flapping-moment",
    "tracking-offset",
    "rotor-inertia",
    "product-of-inertia",
    "motor-lag",
    "input-delay",
];

impl Condition {
    pub(crate) const ALL: [Self; 20] = [
        Self::FloorAtBothEnds,
        Self::WindBetweenFlights,
        Self::WanderingWind,
        Self::LoggedAt(25),
        Self::LoggedAt(50),
        Self::LoggedAt(200),
        Self::LoggedAt(400),
        Self::LoggedAt(1000),
        Self::Interpolated,
        Self::Short,
        Self::MapUnknown,
        Self::DerivedRates,
        Self::Gaps,
        Self::ProductOfInertia,
        Self::TwoBatteries,
        Self::NoGyro,
        Self::NoVoltage,
        Self::NoPosition,
        Self::NoCommands,
        Self::NoiseFedBack,
    ];

    /// For `--only` and tables.
    pub(crate) fn name(self) -> String {
        match self {
            Self::FloorAtBothEnds => "floor".into(),
            Self::WindBetweenFlights => "wind-between-flights".into(),
            Self::WanderingWind => "wandering-wind".into(),
            Self::LoggedAt(rate_hz) => format!("log-{rate_hz}-hz"),
            Self::Interpolated => "interpolated".into(),
            Self::Short => "short".into(),
            Self::MapUnknown => "map-unknown".into(),
            Self::DerivedRates => "derived-rates".into(),
            Self::Gaps => "gaps".into(),
            Self::ProductOfInertia => "large-product-of-inertia".into(),
            Self::TwoBatteries => "two-batteries".into(),
            Self::NoGyro => "no-gyro".into(),
            Self::NoVoltage => "no-voltage".into(),
            Self::NoPosition => "no-position".into(),
            Self::NoCommands => "no-commands".into(),
            Self::NoiseFedBack => "noise-fed-back".into(),
        }
    }

    /// Effects that can be hidden under it: what its flights can still show, and what the condition
    /// is not itself.
    pub(crate) fn hideable(self) -> Vec<&'static str> {
        let (slow, quick) = (SLOW.iter().copied(), QUICK.iter().copied());
        match self {
            Self::LoggedAt(..50) | Self::Interpolated => slow.collect(),
            Self::LoggedAt(..100) | Self::DerivedRates => {
                slow.chain(["flapping-moment", "tracking-offset"]).collect()
            }
            // Against winds that change, a constant one is no effect of its own, and a tilted
            // tracker pushes like one.
            Self::WindBetweenFlights | Self::WanderingWind => {
                slow.chain(quick).filter(|id| !["steady-wind", "attitude-offset"].contains(id)).collect()
            }
            Self::ProductOfInertia => slow.chain(quick).filter(|id| *id != "product-of-inertia").collect(),
            // What is measured at the rotors hides nothing of what comes before them.
            Self::NoCommands => {
                slow.chain(quick).filter(|id| !["motor-lag", "input-delay"].contains(id)).collect()
            }
            _ => slow.chain(quick).collect(),
        }
    }

    /// The effects that this condition is, where the catalogue has or may come to have them. Commands
    /// that stand in for rotor speeds leave out what voltage and offset do to the speed.
    pub(crate) const fn own_effects(self) -> &'static [&'static str] {
        match self {
            Self::WindBetweenFlights => &["steady-wind"],
            Self::WanderingWind => &["gusts"],
            Self::ProductOfInertia => &["product-of-inertia"],
            Self::TwoBatteries => &["battery-voltage"],
            Self::MapUnknown => &["battery-voltage", "thrust-linear"],
            _ => &[],
        }
    }

    /// Whether *adequate* is wrong with nothing else hidden: the condition is an effect that lasts.
    pub(crate) fn is_missing_itself(self) -> bool {
        self == Self::ProductOfInertia
    }

    /// Whether a refusal names this difficulty.
    pub(crate) fn is_named_in(self, refusal: &str) -> bool {
        let words: &[&str] = match self {
            Self::FloorAtBothEnds => &["floor", "airborne", "standing"],
            Self::WindBetweenFlights | Self::WanderingWind => &["wind", "gust"],
            Self::LoggedAt(..100) => &["under-sampled", "sampled too slowly", "Hz"],
            Self::LoggedAt(_) => &["Hz"],
            Self::Interpolated => &["interpolat"],
            Self::Short => &["short", "too few"],
            Self::MapUnknown => &["map"],
            Self::DerivedRates => &["derived", "rates"],
            Self::Gaps => &["gap", "missing"],
            Self::ProductOfInertia => &["inertia", "sign"],
            Self::TwoBatteries => &["batter", "voltage"],
            Self::NoGyro => &["gyro", "rates"],
            Self::NoVoltage => &["vbat", "voltage"],
            Self::NoPosition => &["position"],
            Self::NoCommands => &["command"],
            Self::NoiseFedBack => &["noise"],
        };
        words.iter().any(|word| refusal.contains(word))
    }

    /// Length of a flight that is usually so long, s.
    pub(crate) fn duration_s(self, usual_s: f64) -> f64 {
        if self == Self::Short { 8.0 } else { usual_s }
    }

    /// The world before anything is planted into it.
    pub(crate) fn bare(self, mut world: World, seed: u64) -> World {
        match self {
            Self::NoVoltage if is_governed(seed) => world.governed(),
            Self::FloorAtBothEnds => world.standing(3.0),
            Self::WanderingWind => {
                world.craft.strange.wandering_m_s = 1.0;
                world
            }
            Self::ProductOfInertia => {
                let ixz = 0.28 * world.craft.inertia_kg_m2[(0, 0)];
                world.craft.inertia_kg_m2[(0, 2)] = -ixz;
                world.craft.inertia_kg_m2[(2, 0)] = -ixz;
                world
            }
            _ => world,
        }
    }

    /// The world with all that is planted: what its operator knows of it.
    pub(crate) fn known(self, mut world: World, seed: u64) -> World {
        if self == Self::MapUnknown || self == Self::NoVoltage && !is_governed(seed) {
            let motors = &mut world.vehicle.motors;
            motors.map = Some(MotorMapKind::Identify);
            (motors.command, motors.voltage, motors.offset) = (None, None, None);
        }
        world
    }

    /// The world and its sensors in one flight.
    pub(crate) fn in_flight(
        self,
        mut world: World,
        mut sensors: Sensors,
        pattern: Pattern,
        seed: u64,
    ) -> (World, Sensors) {
        let mut rng = Pcg64::seed_from_u64(own_seed(seed, pattern));
        match self {
            Self::WindBetweenFlights => {
                let (towards, speed) =
                    (rng.random_range(0.0..std::f64::consts::TAU), rng.random_range(0.5..2.0));
                world.craft.wind_ned_m_s = Vector3::new(towards.cos(), towards.sin(), 0.0) * speed;
            }
            Self::LoggedAt(rate_hz) => sensors.rate_hz = f64::from(rate_hz),
            Self::NoPosition => sensors.accelerometer = true,
            Self::NoCommands => sensors.tachometers = true,
            Self::NoiseFedBack => sensors.are_flown_by = true,
            // The second day, of which there are flights to fit on and to judge by.
            Self::TwoBatteries if matches!(pattern, Pattern::B | Pattern::E) => {
                let battery = &mut world.craft.battery;
                battery.sag_v *= 1.8;
                battery.full_v *= 0.97;
                sensors.voltmeter_v = 0.01 * battery.full_v;
            }
            _ => {}
        }
        (world, sensors)
    }

    /// The log of a flight.
    pub(crate) fn logged(self, flight: Flight, pattern: Pattern, seed: u64) -> Flight {
        match self {
            Self::Interpolated => log::interpolated(&flight, 4),
            Self::DerivedRates => log::with_derived_rates(&flight),
            Self::Gaps => log::with_gaps(&flight, own_seed(seed, pattern)),
            _ => match self.not_logged() {
                [] => flight,
                lost => log::without(&flight, lost),
            },
        }
    }

    /// Columns that the logs do not have.
    const fn not_logged(self) -> &'static [Column] {
        use Column::*;
        match self {
            Self::NoGyro => &[P, Q, R],
            Self::NoVoltage => &[Vbat],
            Self::NoPosition => &[X, Y, Z],
            Self::NoCommands => &[Cmd1, Cmd2, Cmd3, Cmd4],
            _ => &[],
        }
    }
}

/// Whether the speed of the motors is held whatever the voltage, under the condition that it is not
/// logged: with every other pair of seeds.
const fn is_governed(seed: u64) -> bool {
    seed % 4 < 2
}

/// A stream of chance for a flight's condition, apart from those of the world.
fn own_seed(seed: u64, pattern: Pattern) -> u64 {
    seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ (0xC0DD + pattern as u64)
}

#[cfg(test)]
mod tests {
    use stories::world::{Size, changes};

    use super::*;
    use crate::plan::catalogue;

    const NAMES: [&str; 2] = ["floor", "log-25-hz"];

    #[test]
    fn names_differ_and_what_is_hidden_is_in_the_catalogue() {
        let names: std::collections::BTreeSet<String> = Condition::ALL.iter().map(|c| c.name()).collect();
        assert_eq!(names.len(), Condition::ALL.len());
        assert!(NAMES.iter().all(|name| names.contains(*name)));
        for condition in Condition::ALL {
            let hideable = condition.hideable();
            assert!(hideable.len() >= 5, "{condition:?}");
            assert!(hideable.iter().all(|id| catalogue().contains(&(id, true))), "{hideable:?}");
            assert!(!hideable.iter().any(|id| changes().any(|change| change == *id)));
            assert!(condition.own_effects().iter().all(|own| !hideable.contains(own)), "{condition:?}");
        }
    }

    #[test]
    fn each_flight_has_a_wind_of_its_own_and_equal_seeds_have_equal_winds() {
        let wind = |pattern, seed| {
            let world = World::new(Size::F330, 1);
            let (world, _) =
                Condition::WindBetweenFlights.in_flight(world, Sensors::default(), pattern, seed);
            world.craft.wind_ned_m_s
        };
        for pattern in [Pattern::A, Pattern::B, Pattern::C] {
            assert!((0.5..=2.0).contains(&wind(pattern, 4).norm()));
        }
        assert_eq!(wind(Pattern::A, 4), wind(Pattern::A, 4));
        assert!((wind(Pattern::A, 4) - wind(Pattern::B, 4)).norm() > 0.01);
        assert!((wind(Pattern::A, 4) - wind(Pattern::A, 5)).norm() > 0.01);
    }

    #[test]
    fn only_the_second_days_battery_is_another() {
        let voltage = |pattern| {
            let (world, sensors) =
                Condition::TwoBatteries.in_flight(World::new(Size::F330, 1), Sensors::default(), pattern, 1);
            (world.craft.battery.sag_v, sensors.voltmeter_v)
        };
        assert_eq!(voltage(Pattern::A), voltage(Pattern::D));
        assert_eq!(voltage(Pattern::B), voltage(Pattern::E));
        assert!(voltage(Pattern::B).0 > 1.5 * voltage(Pattern::A).0 && voltage(Pattern::B).1 > 0.05);
    }

    #[test]
    fn a_vehicle_without_a_test_stand_is_a_good_vehicle_file() {
        let world = Condition::MapUnknown.known(World::new(Size::Small, 3), 3);
        world.vehicle.check(std::path::Path::new("vehicle.toml")).expect("a map to be identified is allowed");
        assert_eq!(world.vehicle.motors.command, None);
    }

    #[test]
    fn the_large_product_of_inertia_leaves_a_body_that_exists() {
        let world = Condition::ProductOfInertia.bare(World::new(Size::F330, 3), 3);
        let inertia = world.craft.inertia_kg_m2;
        assert!((inertia[(0, 2)] / inertia[(0, 0)] + 0.28).abs() < 1e-12);
        let moments = inertia.symmetric_eigenvalues();
        // No moment is larger than the other two together, or some mass would be negative.
        assert!(moments.min() > 0.0 && moments.max() < moments.sum() - moments.max());
    }
}
