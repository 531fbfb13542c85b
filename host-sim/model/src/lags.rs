//! What a craft or its air remembers: quantities behind first-order lags, and their integrals, as formulas of users name them.
//!
//! A lag of time T follows x by m' = (x - m) / T: the mean of the past weighted by exp(-age / T). A lag of a lag is a second-order one.
//! An integral has m' = x, from 0 where the craft begins to fly: energy used is that of power.
//! What a formula looks back at is part of the state of a craft ([`crate::State`]): it is integrated with the rest, and taken from what
//! was measured where a flight is regressed.

use std::sync::{PoisonError, RwLock};

use crate::memory::{LagId, MAX_LAGS, Memory};
use crate::quantity::Quantity;
use crate::sample::Sample;

/// Most lags in one program.
const MAX_KNOWN: usize = 10_000;
/// Shortest and longest time of a lag, s: less than a sample is none, and more than a flight a constant.
pub const LAG_TIMES_S: [f64; 2] = [0.01, 60.0];

/// What a lag follows.
#[derive(Debug, Clone, Copy)]
pub enum Followed {
    /// A measured quantity.
    Quantity(&'static Quantity),
    /// A further column of the flights, by its place in a sample.
    Further(usize),
    /// Another lag.
    Lag(LagId),
}

/// A quantity behind a first-order lag, or its integral.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lag {
    /// What it follows.
    pub of: Followed,
    /// Its time, s; nothing of an integral over the flight.
    pub time_s: Option<f64>,
}

static KNOWN: RwLock<Vec<Lag>> = RwLock::new(Vec::new());

impl PartialEq for Followed {
    fn eq(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Quantity(own), Self::Quantity(other)) => own.name == other.name,
            (Self::Further(own), Self::Further(other)) => own == other,
            (Self::Lag(own), Self::Lag(other)) => own == other,
            _ => false,
        }
    }
}

impl Lag {
    /// What it is known by; nothing where there are too many. It is kept to the end of the program.
    pub fn id(self) -> Option<LagId> {
        let mut known = KNOWN.write().unwrap_or_else(PoisonError::into_inner);
        if let Some(place) = known.iter().position(|own| *own == self) {
            return u16::try_from(place).ok().map(LagId);
        }
        let place = u16::try_from(known.len()).ok().filter(|_| known.len() < MAX_KNOWN)?;
        known.push(self);
        Some(LagId(place))
    }
}

impl LagId {
    /// The lag that it stands for.
    fn lag(self) -> Lag {
        KNOWN.read().unwrap_or_else(PoisonError::into_inner)[usize::from(self.0)]
    }

    /// The measured quantity behind it, if it is one.
    pub fn quantity(self) -> Option<&'static Quantity> {
        match self.lag().of {
            Followed::Quantity(quantity) => Some(quantity),
            Followed::Further(_) => None,
            Followed::Lag(inner) => inner.quantity(),
        }
    }
}

/// The lags that formulas look back at, each after that which it follows.
#[derive(Debug, Clone, Default)]
pub struct Lags {
    all: Vec<(LagId, Lag)>,
}

impl Lags {
    /// Lags with those that they follow. Beyond [`MAX_LAGS`] they have no value.
    pub fn new(ids: impl IntoIterator<Item = LagId>) -> Self {
        let mut lags = Self::default();
        ids.into_iter().for_each(|id| lags.put(id));
        lags.all.truncate(MAX_LAGS);
        lags
    }

    fn put(&mut self, id: LagId) {
        if self.all.iter().any(|(own, _)| *own == id) {
            return;
        }
        let lag = id.lag();
        if let Followed::Lag(inner) = lag.of {
            self.put(inner);
        }
        self.all.push((id, lag));
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// The lags.
    pub fn ids(&self) -> impl Iterator<Item = LagId> {
        self.all.iter().map(|(id, _)| *id)
    }

    /// A memory that is one of these lags; where it is of nothing yet, what is remembered after a past as in a sample.
    pub(crate) fn begun(&self, memory: &Memory, sample: &Sample) -> Memory {
        let is_begun = self.all.iter().zip(memory.lags).all(|((id, _), own)| id.0 == own);
        if is_begun { *memory } else { self.settled(sample) }
    }

    /// Whether one of them is an integral, which knows all of its flight.
    pub fn any_integral(&self) -> bool {
        self.all.iter().any(|(_, lag)| lag.time_s.is_none())
    }

    /// What is remembered where it has always been as in a sample, and a flight begins.
    pub fn settled(&self, sample: &Sample) -> Memory {
        let mut memory = Memory::default();
        for (place, (id, lag)) in self.all.iter().enumerate() {
            let value = followed(lag.of, sample, &memory);
            memory.lags[place] = id.0;
            memory.values[place] = if lag.time_s.is_some() { value } else { 0.0 };
        }
        memory
    }

    /// What is remembered where a flight goes on after a gap: integrals go straight across it, and for all else it begins anew.
    pub fn resumed(&self, memory: &Memory, [before, after]: [&Sample; 2], gap_s: f64) -> Memory {
        let across = self.after(memory, [before, after], gap_s);
        let mut anew = self.settled(after);
        for (place, (_, lag)) in self.all.iter().enumerate() {
            if lag.time_s.is_none() {
                anew.values[place] = across.values[place];
            }
        }
        anew
    }

    /// What is remembered `time_s` after a memory, where what is followed runs straight from one sample to the other.
    pub fn after(&self, memory: &Memory, [before, after]: [&Sample; 2], time_s: f64) -> Memory {
        let mut next = *memory;
        for (place, (_, lag)) in self.all.iter().enumerate() {
            let (from, to) = (followed(lag.of, before, memory), followed(lag.of, after, &next));
            let own = memory.values[place];
            next.values[place] = lag.time_s.map_or_else(
                || own + 0.5 * time_s * (from + to),
                |lag_s| {
                    let keep = (-time_s / lag_s).exp();
                    // A lag follows a ramp at a distance of its time times the slope.
                    let behind = (to - from) / time_s * lag_s * (1.0 - keep);
                    to - behind + (own - from) * keep
                },
            );
        }
        next
    }
}

#[inline]
fn followed(of: Followed, sample: &Sample, memory: &Memory) -> f64 {
    match of {
        Followed::Quantity(quantity) => quantity.at(sample),
        Followed::Further(place) => sample.input.further[place],
        Followed::Lag(id) => memory.of(id),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{Model, Plant, State};

    fn lag(of: Followed, time_s: f64) -> LagId {
        Lag { of, time_s: Some(time_s) }.id().unwrap()
    }

    /// Of x = 3 t + 1 over 2 s from t = 1 s.
    #[test]
    fn an_integral_begins_with_its_flight() {
        let down = Quantity::named("down").unwrap();
        let own = Lag { of: Followed::Quantity(down), time_s: None }.id().unwrap();
        let (plant, lags) = (Plant::new(&Model::thesis()), Lags::new([own]));
        assert!(lags.any_integral() && !Lags::new([lag(Followed::Quantity(down), 0.5)]).any_integral());
        let input = |time_s: f64| {
            plant.input(
                &State::at_rest(Vector3::new(0.0, 0.0, 3.0 * time_s + 1.0), [0.0; 4]),
                &[0.0; 4],
                11.0,
            )
        };
        let mut memory = lags.settled(&plant.sample_of(&input(1.0)));
        for k in 0..200 {
            let ends = [k, k + 1].map(|k| input(1.0 + 0.01 * f64::from(k)));
            let samples = ends.each_ref().map(|end| plant.sample_of(end));
            memory = lags.after(&memory, [&samples[0], &samples[1]], 0.01);
        }
        assert!((memory.of(own) - 14.0).abs() < 1e-9, "{}", memory.of(own));
    }

    /// Of the height of a craft that climbs 2 m/s from 0 m: T of it behind once settled, and x = v (t - T (1 - exp(-t / T))).
    #[test]
    fn a_lag_of_a_ramp_is_its_time_behind_and_a_second_one_twice_that() {
        let height = Quantity::named("height").unwrap();
        let first = lag(Followed::Quantity(height), 0.5);
        let second = lag(Followed::Lag(first), 0.5);
        let (plant, lags) = (Plant::new(&Model::thesis()), Lags::new([second]));
        assert_eq!(lags.ids().count(), 2);
        let at = |time_s: f64| State::at_rest(Vector3::new(0.0, 0.0, -2.0 * time_s), [0.0; 4]);
        let input = |time_s: f64| plant.input(&at(time_s), &[0.0; 4], 11.0);
        let mut memory = lags.settled(&plant.sample_of(&input(0.0)));
        let step_s = 0.01;
        for k in 0..1000 {
            let ends = [k, k + 1].map(|k| input(step_s * f64::from(k)));
            let samples = ends.each_ref().map(|end| plant.sample_of(end));
            memory = lags.after(&memory, [&samples[0], &samples[1]], step_s);
            let t = step_s * f64::from(k + 1);
            let expected = 2.0 * (t - 0.5 * (1.0 - (-t / 0.5).exp()));
            assert!((memory.of(first) - expected).abs() < 1e-9, "{t}");
        }
        assert!((memory.of(second) - 2.0 * (10.0 - 1.0)).abs() < 1e-3);
    }

    #[test]
    fn the_same_lag_is_known_by_the_same_name_and_what_is_not_remembered_has_no_value() {
        let w = Quantity::named("w").unwrap();
        let [one, same, other] = [0.3, 0.3, 0.4].map(|time_s| lag(Followed::Quantity(w), time_s));
        assert!(one == same && one != other);
        assert!(Memory::default().of(one).is_nan());
    }
}
