//! Flights of a simulator that shares no equation with the product's plant.
//!
//! A method that is tested on data made by its own model can only pass ("inverse crime"). The
//! worlds here are written from mechanics, not from the model's regressors: rotor-by-rotor forces
//! at the hubs, the full inertia tensor, the angular momentum of body and rotors together, a
//! Lie-group midpoint integrator, a pilot and sensors of their own. From `model` they take the
//! vehicle file's format and nothing else; [`World::truth`] says the same physics in the model's
//! terms, where it can be said there.
//!
//! - [`World::new`] draws a craft from a seed, [`World::with`] plants an effect into it by its
//!   identifier, scaled by a strength (1 is what a pilot would notice on the F330).
//! - [`World::fly`] flies one of five patterns and returns the flight as its sensors saw it.
//!
//! Conventions as everywhere: SI, NED, FRD, rotors 1 front-left, 2 front-right, 3 rear-right, 4
//! rear-left. Equal seeds give equal bits. Deliberately absent: motor currents, structure,
//! a floor that craft slide or bounce on.

mod body;
mod craft;
mod floor;
pub mod log;
mod odd;
mod pilot;
mod planted;
mod sensors;
mod truth;

use std::path::Path;

use flights::Flight;
use model::Vehicle;
use rand::SeedableRng;
use rand_pcg::Pcg64;

pub use body::{Body, STEP_S};
pub use craft::{Craft, Size};
pub use odd::Odd;
pub use pilot::{Pattern, Style};
pub use planted::{FORMS, ODD, OUTSIDE, PLANTED, Planted, UnknownEffect, changes};
pub use sensors::Sensors;
pub use truth::True;

use floor::{Ends, Standing};
use pilot::{PILOT_PERIOD_S, Pilot};
use sensors::Recorder;

/// A craft in its air, and what its operator knows of it.
#[derive(Debug, Clone)]
pub struct World {
    /// What is true.
    pub craft: Craft,
    /// What the operator wrote into the vehicle file.
    pub vehicle: Vehicle,
    /// Effects planted, in order.
    pub planted: Vec<Planted>,
    /// How it is flown.
    pub style: Style,
    /// How long it stands on the floor before and after a flight, s; 0: flights begin and end in the air.
    pub standing_s: f64,
    /// The craft before anything was planted: what its pilot was tuned on.
    designed: Craft,
    seed: u64,
}

/// The craft left the space it was meant to fly in, or touched the floor.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the craft was lost in flight {pattern} of seed {seed} after {time_s:.2} s")]
pub struct Lost {
    /// The pattern.
    pub pattern: Pattern,
    /// Seed of the world.
    pub seed: u64,
    /// When, s.
    pub time_s: f64,
}

/// Crafts drawn for a trial before it is given up.
const DRAWS: u64 = 5;

/// Seeds of a trial: a craft that its pilot cannot keep is no answer of the product, and the next one is drawn.
pub fn draws(seed: u64) -> impl Iterator<Item = u64> {
    (0..DRAWS).map(move |draw| seed + draw * 1_000_000)
}

impl World {
    /// A calm world: a craft of `size` drawn from `seed`.
    pub fn new(size: Size, seed: u64) -> Self {
        let craft = Craft::draw(size, &mut stream(seed, Purpose::Craft));
        let vehicle = craft.vehicle();
        Self {
            designed: craft.clone(),
            craft,
            vehicle,
            planted: Vec::new(),
            style: Style::Usual,
            standing_s: 0.0,
            seed,
        }
    }

    /// This world flown in another style.
    pub fn flown(self, style: Style) -> Self {
        Self { style, ..self }
    }

    /// This world with flights from the floor to the floor, which stand on it for `standing_s` at either end.
    pub fn standing(self, standing_s: f64) -> Self {
        Self { standing_s, ..self }
    }

    /// This world with speed controllers that hold each rotor's speed whatever the voltage, as its operator knows.
    pub fn governed(mut self) -> Self {
        for craft in [&mut self.craft, &mut self.designed] {
            craft.map.offset += craft.map.voltage * craft.hover_v();
            craft.map.voltage = 0.0;
        }
        self.vehicle = self.craft.vehicle();
        self
    }

    /// Plants an effect of [`PLANTED`], [`OUTSIDE`] or [`FORMS`].
    pub fn with(mut self, id: &str, strength: f64) -> Result<Self, UnknownEffect> {
        let seed = stream(self.seed, Purpose::Planted(self.planted.len() as u64));
        let effect = planted::plant(id, strength, &mut self.craft, &mut self.vehicle, seed)?;
        self.planted.push(Planted { id: effect, strength });
        Ok(self)
    }

    /// The true values of coefficients in the model's terms.
    pub fn truth(&self) -> Vec<True> {
        truth::of(&self.craft, &self.vehicle, &self.planted)
    }

    /// Flies `pattern` for `duration_s`, not counting what a flight from floor to floor has before and after. `round` tells repeated flights of one pattern apart.
    pub fn fly(
        &self,
        pattern: Pattern,
        duration_s: f64,
        sensors: &Sensors,
        round: u64,
    ) -> Result<Flight, Lost> {
        let purpose = |kind: u64| Purpose::Flight { kind, pattern: pattern as u64, round };
        let mut pilot = Pilot::new(
            &self.designed,
            &self.craft,
            (pattern, self.style),
            &mut stream(self.seed, purpose(0)),
        );
        if sensors.are_flown_by {
            pilot = pilot.unshaken();
        }
        let mut standing = None;
        if self.standing_s > 0.0 {
            let ends = Ends::new(&self.craft, duration_s);
            pilot = pilot.between(ends);
            standing = Some(Standing::new(ends, self.standing_s));
        }
        let start = pilot.start();
        let (mut body, duration_s) = match &standing {
            Some(standing) => (standing.body(&self.craft, start), standing.total_s()),
            None => (Body::hovering(&self.craft, start), duration_s),
        };
        let mut recorder = Recorder::new(&self.craft, sensors, duration_s, stream(self.seed, purpose(1)));
        let mut air = stream(self.seed, purpose(2));
        let steps_per_tick = (PILOT_PERIOD_S / STEP_S).round() as usize;
        let ticks = (duration_s / PILOT_PERIOD_S).round() as usize;
        let mut commands: Vec<[f64; 4]> = Vec::with_capacity(ticks);
        for tick in 0..ticks {
            let time_s = tick as f64 * PILOT_PERIOD_S;
            let felt = recorder.felt();
            let mut fly = |pattern_s| pilot.command(pattern_s, &body, &self.craft.battery, &felt);
            commands.push(match &mut standing {
                Some(standing) => standing.command(time_s, &self.craft, fly),
                None => fly(time_s),
            });
            let is_low = standing.as_ref().is_some_and(|standing| standing.is_low(time_s));
            if !is_low && !pilot.is_content(&body, &self.craft) {
                return Err(Lost { pattern, seed: self.seed, time_s });
            }
            for step in 0..steps_per_tick {
                let now_s = time_s + step as f64 * STEP_S;
                recorder.observe(now_s, &body, &self.craft, &commands[tick]);
                // Half a step keeps the comparison of times clear of rounding.
                let age = ((now_s + 0.5 * STEP_S - self.craft.delay_s) / PILOT_PERIOD_S).floor();
                body.step(&self.craft, &commands[(age.max(0.0) as usize).min(tick)], now_s, &mut air);
                if let Some(standing) = &mut standing {
                    standing.hold(&self.craft, &mut body);
                }
            }
        }
        Ok(recorder.flight(pattern.name()))
    }

    /// Writes `vehicle.toml` and the flights as `NAME.csv` into a folder, in the contract's
    /// formats.
    pub fn write(&self, folder: &Path, flights: &[&Flight]) -> std::io::Result<()> {
        std::fs::create_dir_all(folder)?;
        let vehicle = toml::to_string(&self.vehicle).map_err(std::io::Error::other)?;
        report::write_atomic(folder.join("vehicle.toml"), vehicle).map_err(std::io::Error::other)?;
        for flight in flights {
            let path = folder.join(format!("{}.csv", flight.name));
            report::write_atomic(path, flight.to_csv()).map_err(std::io::Error::other)?;
        }
        Ok(())
    }
}

/// What random numbers are for: each purpose has its own stream, so that more noise does not change
/// the craft.
#[derive(Debug, Clone, Copy)]
enum Purpose {
    Craft,
    Planted(u64),
    Flight { kind: u64, pattern: u64, round: u64 },
}

/// The stream of a seed for one purpose.
fn stream(seed: u64, purpose: Purpose) -> Pcg64 {
    let number = match purpose {
        Purpose::Craft => 0,
        Purpose::Planted(place) => 1 + place,
        Purpose::Flight { kind, pattern, round } => 1000 + kind + 10 * pattern + 1000 * round,
    };
    // Odd multipliers keep neighbouring seeds and purposes apart; the generator mixes the rest.
    Pcg64::seed_from_u64(
        seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).wrapping_add(number.wrapping_mul(0xD1B5_4A32_D192_ED03)),
    )
}
