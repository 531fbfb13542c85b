//! Same source, same bits: flights flown here, and everything that was computed in them computed
//! again on another processor.
//!
//! Each flight is closed-loop, with noise and delay, and a minute long (the one under designed
//! gains, which use what the thesis' law does not have, is shorter). Every tick's readings are kept
//! with the [`digest`](craft::digest()) of everything computed from them: motor commands, each
//! internal term of the law, faults, state and conditions. The other processor gets the same
//! readings and has to come to the same number, tick by tick.

use std::path::Path;

use control::{Config, Readings};
use craft::{Lockstep, RECORDING_MAGIC, convert, digest};
use proto::{MAX_FRAME_LEN, Message, Outcome};
use sha2::{Digest, Sha256};

use crate::craft::{Fault, FaultKind, NoiseModel};
use crate::flight::{ClosedLoop, FlightPlan, SilError, designed_config};
use crate::flight_computer::{Emulated, FlightComputer, FlightComputerError, Processor};
use crate::scenarios::{Scenario, Settings};

/// Length of a flight, s.
pub const FLIGHT_S: f64 = 60.0;

/// A flight as the law saw it.
#[derive(Debug, Clone)]
pub struct Flown {
    /// What distinguishes it.
    pub name: &'static str,
    /// What flew it.
    pub config: Config,
    /// For each tick what went in, what came out, and the digest of all between.
    pub ticks: Vec<(Readings, Outcome, u64)>,
}

/// Where the results of two processors differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Number of the first tick.
    pub tick: usize,
    /// What came out here.
    pub here: Outcome,
    /// Digest of the whole tick here, and there.
    pub digests: [u64; 2],
}

/// The autopilot in this process, keeping a record.
struct Recorder {
    lockstep: Lockstep,
    ticks: Vec<(Readings, Outcome, u64)>,
}

impl FlightComputer for Recorder {
    fn tick(&mut self, tick: u32, readings: &Readings) -> Result<Outcome, FlightComputerError> {
        let message = Message::Readings(convert::readings_message(tick, readings));
        let outcome = self.lockstep.answer(&message).ok_or(proto::Error::Malformed)?;
        self.ticks.push((*readings, outcome, digest(self.lockstep.flight())));
        Ok(outcome)
    }
}

/// The plans of the flights: between them both laws, both modes, excitation, gyro fusion,
/// saturation both ways, thrust raised with the tilt, and a failsafe to its end.
fn plans(seed: u64) -> Result<[(&'static str, FlightPlan); 4], SilError> {
    let excited = FlightPlan::identification(model::Model::thesis(), seed, FLIGHT_S);
    let noise = Some(NoiseModel::default());
    let pattern = Scenario::Pattern.plan(&Settings { noise, seed: seed + 1, ..Settings::default() });
    let mut failing = FlightPlan { duration_s: FLIGHT_S, ..pattern };
    // Poses are late for a moment, and much later the motors become too weak to carry the craft: it
    // lands, at full throttle.
    failing.faults = vec![
        Fault { kind: FaultKind::PoseSilent, from_s: 20.0, for_s: 0.1 },
        Fault { kind: FaultKind::MotorsWeak(310.0), from_s: 45.0, for_s: 1e6 },
    ];
    let hand_tuned = FlightPlan {
        config: Config::thesis_hand_tuned(),
        delay_samples: 1,
        seed: seed + 2,
        clock_us: u32::MAX - 30_000_000,
        faults: Vec::new(),
        ..failing.clone()
    };
    let config = Some(designed_config()?);
    let rolled = Scenario::Roll30.plan(&Settings { config, noise, seed: seed + 3, ..Settings::default() });
    Ok([
        ("tour with excitation and gyro fusion", excited),
        ("pattern with late poses, then weak motors and a landing", failing),
        ("pattern under the hand-tuned law, across a wrap of the clock", hand_tuned),
        ("roll of 30 degrees under designed gains, attitude before thrust", rolled),
    ])
}

/// Flies all flights here.
///
/// # Errors
/// A plan that cannot be flown.
pub fn fly_all(seed: u64) -> Result<Vec<Flown>, SilError> {
    plans(seed)?.into_iter().map(|(name, plan)| fly(name, &plan)).collect()
}

fn fly(name: &'static str, plan: &FlightPlan) -> Result<Flown, SilError> {
    let mut recorder = Recorder { lockstep: Lockstep::new(&plan.config)?, ticks: Vec::new() };
    let mut closed_loop = ClosedLoop::new(plan, &mut recorder)?;
    let ticks = (plan.duration_s / plan.config.sample_time_s).round() as u32;
    for _ in 0..=ticks {
        closed_loop.step()?;
    }
    Ok(Flown { name, config: plan.config, ticks: recorder.ticks })
}

impl Flown {
    /// SHA-256 of all digests, hexadecimal: one number for all bits of the flight.
    pub fn sha256(&self) -> String {
        let mut hash = Sha256::new();
        self.ticks.iter().for_each(|(_, _, digest)| hash.update(digest.to_le_bytes()));
        hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// Ticks with a motor command at an end of its range.
    pub fn saturated_ticks(&self) -> usize {
        let [low, high] = self.config.command_range.map(|end| end as f32);
        let at_end = |pwm: &f32| *pwm <= low || *pwm >= high;
        self.ticks.iter().filter(|(_, outcome, _)| outcome.output.pwm.iter().any(at_end)).count()
    }

    /// All readings, as the lockstep programs take them.
    fn recording(&self) -> Result<Vec<u8>, proto::Error> {
        let mut bytes = RECORDING_MAGIC.to_vec();
        for (tick, (readings, _, _)) in self.ticks.iter().enumerate() {
            let message = Message::Readings(convert::readings_message(tick as u32, readings));
            let mut frame = [0; MAX_FRAME_LEN];
            let frame = proto::encode(&message, &mut frame)?;
            bytes.extend((frame.len() as u16).to_le_bytes());
            bytes.extend(frame);
        }
        Ok(bytes)
    }

    /// Computes it again on `processor`, by its lockstep program, with `config`; where does it
    /// differ first?
    ///
    /// # Errors
    /// What goes wrong on the way.
    pub fn replay(
        &self,
        processor: Processor,
        program: &Path,
        config: &Config,
    ) -> Result<Option<Difference>, FlightComputerError> {
        let found = Emulated::replay(processor, program, config, &self.recording()?, self.ticks.len())?;
        let pairs = self.ticks.iter().zip(found).enumerate();
        let mut differences = pairs.filter(|(_, ((_, _, here), there))| here != there);
        Ok(differences.next().map(|(tick, ((_, outcome, here), there))| Difference {
            tick,
            here: *outcome,
            digests: [*here, there],
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control::gains::Saturation;
    use proto::State;

    /// The flights are what they are said to be; otherwise equal bits would prove less.
    #[test]
    fn the_flights_go_through_saturation_and_failsafes() {
        let flown = fly_all(1).unwrap();
        let states = |flown: &Flown| {
            let mut states: Vec<State> = flown.ticks.iter().map(|(_, o, _)| o.supervision.state).collect();
            states.dedup();
            states
        };
        let [excited, failing, hand_tuned, rolled] = &flown[..] else { panic!("four flights") };
        assert!(flown[..3].iter().all(|flown| flown.ticks.len() == 6001));
        assert_eq!(states(excited), [State::Flying]);
        let went = states(failing);
        assert!(went.starts_with(&[State::Flying, State::Hold, State::Flying, State::Land]), "{went:?}");
        assert!(failing.saturated_ticks() > 100, "{}", failing.saturated_ticks());
        assert_eq!(states(hand_tuned), [State::Flying]);
        let first_us = hand_tuned.ticks[0].0.time_us;
        assert!(hand_tuned.ticks.iter().any(|(readings, _, _)| readings.time_us < first_us), "no wrap");
        assert_eq!(states(rolled), [State::Flying]);
        assert_eq!(rolled.config.saturation, Saturation::AttitudeFirst);
        assert!(
            rolled.config.tilt_compensation && rolled.saturated_ticks() > 100,
            "{}",
            rolled.saturated_ticks()
        );
    }

    #[test]
    fn equal_seeds_give_equal_bits_and_others_do_not() {
        let hash = |seed| fly_all(seed).unwrap().iter().map(Flown::sha256).collect::<Vec<_>>();
        assert_eq!(hash(1), hash(1));
        assert_ne!(hash(1), hash(2));
    }
}
