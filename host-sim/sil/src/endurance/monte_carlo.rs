//! Monte Carlo: many short flights, each under conditions of its own, all of them drawn from its seed.
//!
//! A flight: a tour of the cage of its own from a place and heading of its own, by a craft that is
//! heavier or lighter, unbalanced, with unequal motors, slower rotors and a longer dead time than the
//! gains were made for, in a wind that grows with the height, from an older or a fresher battery, with
//! older poses and noisier sensors. In half of the flights one of the faults comes on top that the
//! supervisor has to survive. (Wind that changes within a flight is not among them: campaigns draw
//! gusts.)
//!
//! A crash ([`Crash`]) counts unless physics demanded it, and that is decided without the controller:
//! the drawn craft in the drawn air has no equilibrium, or one that asks a motor for more than there
//! is at the lowest voltage of that flight. Nor has a craft left the cage that is inside as its tracker
//! sees it. What a controller makes of a craft that can hover is its
//! own affair.

use std::fmt;
use std::path::Path;

use model::{Battery, Model};
use rand::RngExt;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use sha2::{Digest, Sha256};

use control::{Config, Request};
use pattern::random::{Purpose, stream};
use proto::State;

use super::crash::Crash;
use super::deviations::Deviations;
use super::drawn_flights::{End, Last, MonteCarlo};
use super::error::LongRunError;
use super::kept::Kept;
use super::memory::{Memory, resident};
use super::watched::{Crashed, Observer, impossible, until_crash};
use crate::craft::{Fault, FaultKind, NoiseModel};
use crate::flight::{FlightPlan, Row, Script, SilError};

/// How long a flight is, s: a fault after 2 to 8 s, and a landing from 1.8 m at 0.3 m/s.
const FLIGHT_S: f64 = 15.0;
/// So many are flown before their ends are counted and kept, ...
const AT_ONCE: usize = 64;
/// ... and so many by one core at a time.
const TOGETHER: usize = 32;
/// What is drawn for a flight beside its tour and its noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Conditions {
    /// Its seed.
    pub seed: u64,
    /// What is otherwise than in the model.
    pub deviations: Deviations,
    /// The battery.
    pub battery: Battery,
    /// Age of the poses, samples.
    pub delay_samples: usize,
    /// Noise, in units of the usual one.
    pub noise: f64,
    /// Where it starts, inertial NED, m, and its heading, rad.
    pub start: ([f64; 3], f64),
    /// What goes wrong.
    pub fault: Option<Fault>,
}

impl Conditions {
    /// Those of this seed.
    pub fn of(seed: u64) -> Self {
        let mut generator = stream(seed, Purpose::Conditions);
        let g = &mut generator;
        Self {
            seed,
            deviations: Deviations {
                extra_mass_kg: within(g, -0.12, 0.12),
                off_centre_m: [within(g, -0.004, 0.004), within(g, -0.004, 0.004)],
                thrust_loss: [(); 4].map(|()| within(g, -0.03, 0.05)),
                slower_rotors_s: within(g, -0.008, 0.008),
                dead_time_s: within(g, 0.0, 0.006),
                wind_m_s: [within(g, -1.0, 1.0), within(g, -1.0, 1.0)],
                shear_per_s: [within(g, -0.3, 0.3), within(g, -0.3, 0.3)],
            },
            battery: Battery {
                full_v: within(g, 11.5, 12.6),
                decay_v_per_s: within(g, 0.0, 0.02),
                hover_sag_v: within(g, 0.3, 0.7),
                hover_speed_rad_s: 635.0,
            },
            delay_samples: g.random_range(1..=2),
            noise: within(g, 0.5, 2.0),
            start: (
                [within(g, -1.5, 1.5), within(g, -0.9, 0.9), within(g, -1.7, -0.6)],
                within(g, -std::f64::consts::PI, std::f64::consts::PI),
            ),
            fault: g.random_bool(0.5).then(|| drawn_fault(g)),
        }
    }

    /// The flight.
    pub fn plan(&self, config: &Config) -> FlightPlan {
        let mut model = Model::thesis();
        self.deviations.shift(&mut model);
        let (start_m, start_yaw_rad) = self.start;
        FlightPlan {
            script: Script::tour(self.seed, FLIGHT_S),
            excitation: false,
            start_m,
            start_yaw_rad,
            delay_samples: self.delay_samples,
            noise: Some(NoiseModel::default().times(self.noise)),
            battery: self.battery,
            floor_m: Some(0.0),
            config: *config,
            faults: self.fault.into_iter().collect(),
            ..FlightPlan::identification(model, self.seed, FLIGHT_S)
        }
    }
}

fn within(generator: &mut Pcg64, low: f64, high: f64) -> f64 {
    generator.random_range(low..high)
}

/// One of the faults that the supervisor has to survive, with the craft in one piece.
pub fn drawn_fault(g: &mut Pcg64) -> Fault {
    /// To the end of the flight.
    const ALWAYS_S: f64 = 1e6;
    let from_s = within(g, 2.0, 8.0);
    let single = |value: f64| value as f32;
    let (kind, for_s) = match g.random_range(0..12) {
        0 => (FaultKind::LinkSilent, within(g, 0.1, 8.0)),
        1 => (FaultKind::LinkGarbage, within(g, 0.1, 8.0)),
        2 => (FaultKind::PoseSilent, within(g, 0.02, 0.6)),
        3 => (FaultKind::PoseFrozen, within(g, 0.02, 0.6)),
        4 => (FaultKind::PoseShifted([(); 3].map(|()| single(within(g, -0.2, 0.2)))), ALWAYS_S),
        5 => (FaultKind::ImuMissing, within(g, 0.01, 0.15)),
        6 => (FaultKind::ImuBiased(single(within(g, -0.15, 0.15))), ALWAYS_S),
        7 => (FaultKind::VoltageLower(single(within(g, 0.0, 2.0))), ALWAYS_S),
        8 => (FaultKind::MotorsWeak(single(within(g, 0.0, 100.0))), ALWAYS_S),
        9 => (FaultKind::ClockOff(g.random_range(0..u32::MAX)), ALWAYS_S),
        10 => (FaultKind::LoopStalled, within(g, 0.01, 0.06)),
        _ => (FaultKind::Asks(Request::Land), 0.01),
    };
    Fault { kind, from_s, for_s }
}

impl MonteCarlo {
    /// What its flight of this seed meets.
    pub fn conditions(&self, seed: u64) -> Conditions {
        let drawn = Conditions::of(seed);
        Conditions { delay_samples: self.delay_samples.unwrap_or(drawn.delay_samples), ..drawn }
    }
}

/// Flies those of these seeds; how each ended, and the last of its state for comparing runs bit by bit.
fn fly(seeds: &[u64], survey: &MonteCarlo) -> Result<Vec<(End, Last)>, SilError> {
    let plan = |seed: &u64| survey.conditions(*seed).plan(&survey.config);
    let plans: Vec<FlightPlan> = seeds.iter().map(plan).collect();
    let last = vec![([0; 16], State::Flying); plans.len()];
    until_crash(&plans.iter().collect::<Vec<_>>(), &mut Ends { plans: &plans, last }).into_iter().collect()
}

/// Looks how flights end.
struct Ends<'a> {
    plans: &'a [FlightPlan],
    /// The last of each, and who had it then.
    last: Vec<(Last, State)>,
}

impl Observer for Ends<'_> {
    type Made = (End, Last);

    fn tick(&mut self, number: usize, row: &Row) {
        let (last, state) = &mut self.last[number];
        *state = row.supervision.state;
        let position_m = row.truth.position_m;
        let words = [position_m[0], position_m[1], position_m[2], row.truth.rate_rad_s[0]];
        last.as_chunks_mut().0.iter_mut().zip(words).for_each(|(bytes, word)| *bytes = word.to_le_bytes());
    }

    fn end(&mut self, number: usize, crash: Crashed) -> (End, Last) {
        let (last, state) = self.last[number];
        let end = match (crash, state) {
            (Some((crash, at_s)), _) => impossible(&self.plans[number])
                .map_or(End::Crashed(crash, at_s), |why| End::Impossible(why.to_string())),
            (None, State::Flying) => End::Flying,
            (None, _) => End::Supervised,
        };
        (end, last)
    }
}

/// What came of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// What was flown.
    pub plan: MonteCarlo,
    /// Simulated time, s; a crash ends its flight.
    pub simulated_s: f64,
    /// Flights that ended in the pilot's hands, and in the supervisor's.
    pub flying: u64,
    /// See [`End::Supervised`].
    pub supervised: u64,
    /// Crashes that physics demanded: seed and reason.
    pub impossible: Vec<(u64, String)>,
    /// All others: seed, how, and after how many s.
    pub crashes: Vec<(u64, Crash, f64)>,
    /// SHA-256 over the last states of all flights: equal runs, equal bits.
    pub sha256: String,
    /// Memory after half of the flights that were flown now, and after the last whole batch of them.
    pub memory: Memory,
}

impl Survey {
    /// No crash but those of physics, and the memory did not grow.
    pub fn holds(&self) -> bool {
        self.crashes.is_empty() && self.memory.is_flat()
    }
}

/// Flies them all, on all cores; the answer does not depend on how many there are. With a file, the ends of flights are kept in it, and
/// those that are there are not flown again.
///
/// # Errors
/// Memory that cannot be measured, a file that cannot be used; the plans themselves can all be flown.
pub fn survey(plan: &MonteCarlo, file: Option<&Path>) -> Result<Survey, LongRunError> {
    let mut kept = file.map(|path| Kept::open(path, plan)).transpose()?;
    let known = kept.as_ref().map_or(0, Kept::known);
    let mut digest = Sha256::new();
    let mut survey = Survey {
        plan: *plan,
        simulated_s: 0.0,
        flying: 0,
        supervised: 0,
        impossible: Vec::new(),
        crashes: Vec::new(),
        sha256: String::new(),
        memory: Memory { half: 0, end: 0 },
    };
    // What judges a crash is loaded before the first is counted: it is no growth.
    let _ = impossible(&Conditions::of(plan.seed).plan(&plan.config));
    for first in (0..plan.flights).step_by(AT_ONCE) {
        let next = plan.flights.min(first + AT_ONCE as u64);
        let seeds: Vec<u64> = (first..next).map(|k| plan.seed.wrapping_add(k)).collect();
        let end = |places: &[u64]| {
            let known = |place: &u64| kept.as_ref().and_then(|kept| kept.end(*place));
            let new: Vec<u64> = places.iter().filter(|place| known(place).is_none()).copied().collect();
            let seeds: Vec<u64> = new.iter().map(|place| plan.seed.wrapping_add(*place)).collect();
            let mut flown = fly(&seeds, plan)?.into_iter();
            Ok(places.iter().filter_map(|place| known(place).or_else(|| flown.next())).collect::<Vec<_>>())
        };
        let places: Vec<u64> = (first..next).collect();
        let ends: Vec<Vec<(End, Last)>> =
            places.par_chunks(TOGETHER).map(end).collect::<Result<_, SilError>>()?;
        let ends = ends.concat();
        if let Some(kept) = &mut kept {
            kept.add(first, &seeds, &ends)?;
        }
        for (seed, (end, last)) in seeds.into_iter().zip(ends) {
            digest.update(last);
            survey.count(seed, end);
        }
        // A shorter batch at the end leaves more of what it freed with the process than the others do: that is no growth.
        if next - first == AT_ONCE as u64 || survey.memory.end == 0 {
            survey.memory.end = resident()?;
        }
        let flown_of = |place: u64| place.saturating_sub(known);
        if flown_of(next) * 2 >= flown_of(plan.flights) && survey.memory.half == 0 {
            survey.memory.half = survey.memory.end;
        }
    }
    survey.sha256 = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Ok(survey)
}

impl Survey {
    fn count(&mut self, seed: u64, end: End) {
        self.simulated_s += FLIGHT_S;
        match end {
            End::Flying => self.flying += 1,
            End::Supervised => self.supervised += 1,
            End::Impossible(why) => self.impossible.push((seed, why)),
            End::Crashed(crash, at_s) => {
                self.simulated_s += at_s - FLIGHT_S;
                self.crashes.push((seed, crash, at_s));
            }
        }
    }
}

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.write(f, "")
    }
}

impl Survey {
    /// What is said of it; each crash with the command that flies it again, with these options beside its seed.
    pub fn text(&self, options: &str) -> String {
        let mut text = String::new();
        // A string takes all that is written.
        let _ = self.write(&mut text, options);
        text
    }

    fn write(&self, f: &mut impl fmt::Write, options: &str) -> fmt::Result {
        /// As many are told of one by one.
        const TOLD: usize = 20;
        let Self { plan, flying, supervised, impossible, crashes, .. } = self;
        writeln!(f, "{} flights, {:.1} h simulated", plan.flights, self.simulated_s / 3600.0)?;
        writeln!(f, "  {flying} flown as commanded to the end, {supervised} in the supervisor's hands")?;
        writeln!(f, "  {} that physics did not allow", impossible.len())?;
        for (seed, why) in impossible.iter().take(TOLD) {
            writeln!(f, "    seed {seed}: {why}")?;
        }
        writeln!(f, "  {} crashes", crashes.len())?;
        for (seed, crash, at_s) in crashes.iter().take(TOLD) {
            writeln!(f, "    seed {seed}: {crash:?} after {at_s:.2} s")?;
            writeln!(f, "      again: cargo xtask sil --monte-carlo 1 --seed {seed}{options}")?;
        }
        writeln!(f, "last states sha256 {}", self.sha256)?;
        writeln!(f, "memory: {}", self.memory)?;
        if let (1, Some((seed, ..))) = (plan.flights, crashes.first()) {
            writeln!(f, "{:#?}", plan.conditions(*seed))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::watched::fly_watched;
    use super::*;
    use crate::flight::designed_config;

    /// As many as a second allows; `cargo xtask test --nightly` flies 100,000.
    #[test]
    fn a_few_hundred_flights_end_without_a_crash_and_repeat_bit_by_bit() {
        let plan =
            MonteCarlo { flights: 300, config: designed_config().unwrap(), seed: 77, delay_samples: None };
        let found = survey(&plan, None).unwrap();
        assert!(found.crashes.is_empty(), "{found}");
        assert!(found.flying > 150 && found.supervised > 30, "faults are among them: {found}");
        let again = survey(&plan, None).unwrap();
        assert_eq!((&again.sha256, again.flying), (&found.sha256, found.flying));
        let other = survey(&MonteCarlo { seed: 78, ..plan }, None).unwrap();
        assert_ne!(other.sha256, found.sha256);
    }

    /// Its tracker comes to see it 0.19 m too high, so that a pass low over the floor ends on it, for two seconds. With integrators
    /// that wound up there it tipped over by 64 degrees as it was told to climb, and flew into the wall.
    #[test]
    fn a_craft_that_stood_on_the_floor_climbs_again() {
        let plan = Conditions::of(75314).plan(&designed_config().unwrap());
        let made = fly_watched(&[&plan], |_, watched| {
            let upright = watched.recording.rows.iter().map(|row| row.truth.upright()).fold(1.0, f64::min);
            let height_m = |row: &Row| -f64::from(row.truth.position_m[2]);
            let heights_m: Vec<f64> = watched.recording.rows.iter().map(height_m).collect();
            ((watched.crash, upright, heights_m), watched.recording.rows)
        });
        let (crash, upright, heights_m) = made[0].as_ref().unwrap();
        assert_eq!(*crash, None);
        // It stands for a second and more, and climbs again.
        let (before, after) = heights_m.split_at(700);
        assert!(before.iter().filter(|m| **m < 1e-3).count() > 100);
        assert!(after.iter().any(|m| *m > 0.5), "{:?}", after.iter().copied().fold(0.0, f64::max));
        // What it gathers until it is known to stand, and what it is told to tilt: 35 degrees were measured.
        assert!(*upright > 45_f64.to_radians().cos(), "{:.1} degrees", upright.acos().to_degrees());
    }

    /// A crash names its seed and the command that flies it again; the conditions are those of the
    /// seed alone.
    #[test]
    fn a_crash_is_told_with_its_seed() {
        let mut config = designed_config().unwrap();
        if let control::gains::Law::ModelBased(law) = &mut config.law {
            law.loops.pitch.kp *= 8.0;
        }
        let plan = MonteCarlo { flights: 3, config, seed: 40, delay_samples: None };
        let found = survey(&plan, None).unwrap();
        assert!(!found.holds() && found.crashes.len() == 3, "{found}");
        let text = found.text(" --gains wild.toml");
        assert!(text.contains("cargo xtask sil --monte-carlo 1 --seed 41 --gains wild.toml\n"), "{text}");
        assert_eq!(Conditions::of(41), Conditions::of(41));
        assert_ne!(Conditions::of(41), Conditions::of(42));
    }

    /// One age of the poses for all, whatever is drawn; where it is the drawn one, the flight is the same.
    #[test]
    fn the_delay_that_is_asked_for_is_flown() {
        let plan =
            MonteCarlo { flights: 1, config: designed_config().unwrap(), seed: 5, delay_samples: None };
        let last = |delay_samples| survey(&MonteCarlo { delay_samples, ..plan }, None).unwrap().sha256;
        let drawn = Conditions::of(plan.seed).delay_samples;
        assert_eq!(last(Some(drawn)), last(None));
        assert_ne!(last(Some(3 - drawn)), last(None));
        assert_eq!(MonteCarlo { delay_samples: Some(7), ..plan }.conditions(5).delay_samples, 7);
    }

    /// With 1.3 kg too much it weighs 24.7 N: its rotors would have to turn at 913 rad/s, which takes
    /// 2073 us at 11 V. As it is, the craft hovers.
    #[test]
    fn physics_is_what_no_motor_can_do() {
        let config = designed_config().unwrap();
        let drawn = Conditions::of(1);
        let deviations = Deviations { extra_mass_kg: 0.0, ..drawn.deviations };
        let light = Conditions { deviations, fault: None, ..drawn };
        assert_eq!(impossible(&light.plan(&config)), None);
        let heavy = Conditions { deviations: Deviations { extra_mass_kg: 1.3, ..deviations }, ..light };
        let why = impossible(&heavy.plan(&config));
        assert!(why.as_ref().is_some_and(|why| why.to_string().contains("of 2000")), "{why:?}");
    }
}
