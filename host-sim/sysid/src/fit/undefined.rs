//! Samples at which a user's formula has no finite value: left out before anything is fitted or judged.
//!
//! A logarithm of a height that is negative for a moment would spread through the filters into every row near it. A flight is
//! cut there as at a gap, so the rows that such a sample touches are missing from every fit and every error alike, with the
//! effect and without it.

use std::ops::Range;

use model::{Effect, Kind, Model, Plant, SampleInput};

use crate::prepare::{Part, PrepareError, Prepared, Stretch};

impl Prepared {
    /// Leaves out the samples at which a formula of `effects` (those of users among them) has no finite value, at the
    /// coefficients of `model` or, where it does not have the effect, at ordinary ones. Says so in [`Self::notes`].
    ///
    /// # Errors
    /// When nothing is left.
    pub fn leave_out_undefined(&mut self, model: &Model, effects: &[Effect]) -> Result<(), PrepareError> {
        let asked: Vec<Asked> = effects.iter().filter_map(|effect| Asked::new(model, *effect)).collect();
        if asked.is_empty() {
            return Ok(());
        }
        let plant = Plant::new(model);
        let shortest = 2 * self.margin + self.filter.smooth.len();
        let before = self.rows();
        let mut whole = Vec::new();
        let mut kept = Vec::new();
        let mut reason = None;
        for stretch in std::mem::take(&mut self.stretches) {
            let bad = undefined_samples(self, &stretch, &plant, model, &asked, &mut reason);
            if !bad.contains(&true) {
                kept.push(stretch);
                continue;
            }
            kept.extend(unbroken(&bad).filter(|r| r.len() >= shortest).map(|range| stretch.part(range)));
            whole.push(stretch);
        }
        self.stretches = kept;
        let Some(reason) = reason else { return Ok(()) };
        if self.stretches.is_empty() {
            self.stretches = whole;
            return Err(PrepareError::Undefined { reason });
        }
        let lost = before - self.rows();
        self.notes.push(format!("{lost} samples left out, in or beside which {reason}"));
        Ok(())
    }
}

/// A user's effect and the coefficients to ask it with.
struct Asked {
    user: model::user_effects::User,
    coefficients: Vec<Vec<f64>>,
}

impl Asked {
    fn new(model: &Model, effect: Effect) -> Option<Self> {
        let Effect::User(user) = effect else { return None };
        if let Some(term) = model.term(effect) {
            return Some(Self {
                user,
                coefficients: vec![term.coefficients.iter().map(|c| c.value).collect()],
            });
        }
        let info = user.info();
        let typical = |k: usize| info.coefficients[k].typical;
        let coefficients = match info.kind {
            Kind::Adjusting => {
                let starts = effect.starts();
                let filled = |start: Vec<Option<f64>>| {
                    start.into_iter().enumerate().map(|(k, value)| value.unwrap_or(typical(k))).collect()
                };
                starts.into_iter().map(filled).collect()
            }
            _ => vec![(0..info.coefficients.len()).map(typical).collect()],
        };
        Some(Self { user, coefficients })
    }

    fn reason(&self, plant: &Plant, input: SampleInput) -> Option<String> {
        let sample = plant.sample_of(&input);
        let undefined = self.coefficients.iter().find_map(|c| self.user.undefined(&sample, c));
        undefined.map(|undefined| undefined.to_string())
    }
}

/// Whether each sample, or what lies between it and the one before, is one that a formula has no value for.
fn undefined_samples(
    flight: &Prepared,
    stretch: &Stretch,
    plant: &Plant,
    model: &Model,
    asked: &[Asked],
    reason: &mut Option<String>,
) -> Vec<bool> {
    let states = flight.states(stretch, &model.vehicle, plant.adjustments());
    let mut bad = vec![false; states.len()];
    let mut ask = |k: usize, input: SampleInput| {
        if let Some(found) = asked.iter().find_map(|a| a.reason(plant, input)) {
            bad[k] = true;
            reason.get_or_insert(found);
        }
    };
    for k in 0..states.len() {
        ask(k, states.at(k));
    }
    let mut k = 0;
    states.for_each_between(&Part::whole(stretch), |input| {
        k += 1;
        ask(k, input);
    });
    bad
}

/// Ranges without a bad sample.
fn unbroken(bad: &[bool]) -> impl Iterator<Item = Range<usize>> {
    let mut start = 0;
    bad.split(|b| *b).map(move |part| {
        let range = start..start + part.len();
        start += part.len() + 1;
        range
    })
}
