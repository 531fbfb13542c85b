//! Samples at which a user's formula has no finite value: left out before anything is fitted or judged.
//!
//! A logarithm of a height that is negative for a moment would spread through the filters into every row near it. A flight is
//! cut there as at a gap, so the rows that such a sample touches are missing from every fit and every error alike, with the
//! effect and without it.

use std::ops::Range;

use model::{Effect, Kind, Model, Plant, SampleInput, user_effects};

use crate::prepare::{Part, PrepareError, Prepared, Stretch};

impl Prepared {
    /// Leaves out the samples at which a formula of `effects` (those of users among them) has no finite value, at the
    /// coefficients of `model` or, where it does not have the effect, at ordinary ones. Says so in [`Self::notes`].
    ///
    /// # Errors
    /// When nothing is left, or the flight lacks a column that a formula names.
    pub fn leave_out_undefined(&mut self, model: &Model, effects: &[Effect]) -> Result<(), PrepareError> {
        self.check_columns(effects)?;
        let asked: Vec<Asked> = effects.iter().filter_map(|effect| Asked::new(model, *effect)).collect();
        if asked.is_empty() {
            return Ok(());
        }
        let plant = Plant::new(model);
        let shortest = self.filter.shortest_stretch(self.margin);
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

    /// Refuses a flight without a column that a formula of `effects` names.
    fn check_columns(&self, effects: &[Effect]) -> Result<(), PrepareError> {
        let places = user_effects::columns();
        for effect in effects {
            let Effect::User(user) = effect else { continue };
            for column in user.columns_named() {
                let is_it = |place: &usize| places[*place] == column;
                let is_there = |stretch: &Stretch| stretch.further_places.iter().any(is_it);
                if !self.stretches.iter().all(is_there) {
                    return Err(PrepareError::NoColumn { column, effect: user.info().id });
                }
            }
        }
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

    fn reason(&self, plant: &Plant, input: &SampleInput) -> Option<String> {
        let sample = plant.sample_of(input);
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
    let lags = asked.iter().flat_map(|asked| asked.user.lags());
    let states = flight.remembering_states(stretch, &model.vehicle, plant, lags);
    let mut bad = vec![false; states.len()];
    let mut ask = |k: usize, input: &SampleInput| {
        if let Some(found) = asked.iter().find_map(|a| a.reason(plant, input)) {
            bad[k] = true;
            reason.get_or_insert(found);
        }
    };
    for k in 0..states.len() {
        ask(k, &states.at(k));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{prepared, truth};

    /// A formula that takes the root of the height.
    fn root(name: &str) -> Effect {
        let path = tempfile::NamedTempFile::new().unwrap();
        let text = format!(
            "[[effect]]\nid = \"{name}\"\nacceleration.u = \"k * sqrt(height)\"\n\
             coefficient = [{{ name = \"k\", unit = \"m^0.5/s^2\", possible = [-1.0, 1.0], typical = 0.1 }}]\n"
        );
        std::fs::write(path.path(), text).unwrap();
        model::effects::read(path.path()).unwrap()[0]
    }

    /// Climbs a metre a second from so far below zero.
    fn climbing(from_m: f64) -> Prepared {
        prepared(600, |t, row| row.position_ned_m[2] = -(t - from_m))
    }

    #[test]
    fn ranges_without_a_bad_sample_leave_out_the_bad_ones_and_no_other() {
        let ranges = |bad: &[bool]| {
            unbroken(bad).filter(|r| !r.is_empty()).map(|r| (r.start, r.end)).collect::<Vec<_>>()
        };
        let (x, o) = (true, false);
        assert_eq!(ranges(&[o, o, x, o, x, x, o]), [(0, 2), (3, 4), (6, 7)]);
        assert_eq!(ranges(&[x, o]), [(1, 2)]);
        assert_eq!(ranges(&[o, o]), [(0, 2)]);
        assert!(ranges(&[x, x]).is_empty() && ranges(&[]).is_empty());
    }

    #[test]
    fn effects_of_the_catalogue_leave_a_flight_as_it_is() {
        let mut flight = climbing(2.0);
        let all: Vec<Effect> = Effect::basic().collect();
        flight.leave_out_undefined(&truth(), &all).unwrap();
        assert_eq!((flight.stretches.len(), flight.rows(), flight.notes.len()), (1, 540, 0));
    }

    /// Below zero for the first 200 samples: the root is real from 2.00 s on, where 400 samples and
    /// 340 rows are left.
    #[test]
    fn samples_below_the_ground_are_left_out_of_what_takes_the_root_of_the_height() {
        let effect = root("root-half");
        let mut flight = climbing(1.995);
        flight.leave_out_undefined(&truth(), &[effect]).unwrap();
        assert_eq!((flight.stretches.len(), flight.rows()), (1, 600 - 201 - 60));
        assert!((flight.stretches[0].time_s[0] - 2.01).abs() < 1e-9);
        assert!(
            flight.notes[0].starts_with("201 samples left out, in or beside which "),
            "{:?}",
            flight.notes
        );
    }

    #[test]
    fn a_flight_below_the_ground_is_refused_and_stays_whole() {
        let effect = root("root-none");
        let mut flight = climbing(10.0);
        let refused = flight.leave_out_undefined(&truth(), &[effect]).unwrap_err();
        assert!(matches!(refused, PrepareError::Undefined { .. }));
        assert!(refused.to_string().starts_with("has nothing left to use: "), "{refused}");
        assert_eq!(flight.rows(), 540);
    }
}
