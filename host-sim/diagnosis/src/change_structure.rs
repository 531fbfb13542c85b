//! What new flights show that neither the model nor a change of it accounts for.
//!
//! The flights of the model set the scale: their residual has structure, too, and that was lived with. An axis of new flights is
//! off where its residual is far above theirs: all the time (**level**), or again and again for a few tenths of a second
//! (**bursts**: under another craft, past a fan, over a step of the floor). Once is an accident and tells nothing of the
//! craft: a hand that lets go, a gust through a door.
//!
//! On axes that are off, the residual is searched for dependence on the measured quantities, as in a diagnosis
//! (`residual_tests.rs`): fitted to every other new flight, tested on the others, and both ways round.

use model::{Axis, Model};
use sysid::prepare::Prepared;
use sysid::{Residuals, has_rotation, residuals, statistics};

use crate::criteria::STRUCTURE_PERCENT;
use crate::dependence::Dependence;
use crate::finding::Unexplained;
use crate::noise;
use crate::residual_tests::structure_of;

/// Length of a window, s: what lasts shorter is blurred by the filters anyway.
const WINDOW_S: f64 = 0.3;
/// Windows further apart than this belong to separate bursts, s: longer than a craft takes to answer.
const APART_S: f64 = 1.0;
/// Mean squared residual of the median window over that of the model's own flights from which on an axis is off: twice their
/// error, half of the time. Flights of one craft on one day differ by less than half of that.
const LEVEL: f64 = 4.0;
/// The same of a window that is a burst: five times their root mean square, for the whole of it. Normal residuals have none in
/// a million windows.
const BURST: f64 = 25.0;
/// Fewest bursts that recur.
const BURSTS: usize = 3;

/// Structure of new flights, largest share first: nothing where they are as the model's own, or where the model does not say how
/// those were.
pub(crate) fn structure_left(model: &Model, flights: &[&Prepared]) -> Vec<Unexplained> {
    let left: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, model)).collect();
    let axes = model::AXES.into_iter().filter(|axis| axis.is_force() || has_rotation(model));
    let off: Vec<Off> = axes.filter_map(|axis| Off::of(model, axis, flights, &left)).collect();
    if off.is_empty() {
        return Vec::new();
    }
    let mut found = dependences(model, flights, &left);
    found.retain(|unexplained| off.iter().any(|off| off.axis == unexplained.axis));
    found.extend(off.iter().map(|off| off.unexplained(flights, &left)));
    found.sort_by(|a, b| b.share_percent.total_cmp(&a.share_percent));
    found
}

/// An axis whose residual is far above that of the model's own flights.
struct Off {
    axis: Axis,
    /// Share of its squared error above what is usual, percent.
    share_percent: f64,
    in_bursts: bool,
}

impl Off {
    fn of(model: &Model, axis: Axis, flights: &[&Prepared], left: &[Residuals]) -> Option<Self> {
        let fit = model.fit.as_ref()?;
        let usual = fit.held_out[axis].rms.max(fit.train[axis].rms).powi(2);
        if !(usual > 0.0) {
            return None;
        }
        let windows: Vec<Vec<f64>> = flights
            .iter()
            .zip(left)
            .map(|(flight, r)| mean_squares(flight, &r.residual[axis.index()]))
            .collect();
        let all: f64 = windows.iter().flatten().sum();
        let count = windows.iter().map(Vec::len).sum::<usize>() as f64;
        let is_burst = |square: &f64| *square > BURST * usual;
        let in_bursts: f64 = windows.iter().flatten().filter(|square| is_burst(square)).sum();
        let burst_percent = 100.0 * in_bursts / all;
        let bursts: usize = windows.iter().map(|windows| separate(windows, is_burst)).sum();
        let level = statistics::median(&mut windows.concat())? / usual;
        if level > LEVEL {
            let share_percent = 100.0 * (1.0 - count * usual / all).max(0.0);
            return Some(Self { axis, share_percent, in_bursts: false });
        }
        let recurs = bursts >= BURSTS && burst_percent > STRUCTURE_PERCENT;
        recurs.then_some(Self { axis, share_percent: burst_percent, in_bursts: true })
    }

    fn unexplained(&self, flights: &[&Prepared], left: &[Residuals]) -> Unexplained {
        let depends_on = if self.in_bursts {
            Dependence::Bursts
        } else {
            noise::strongest_frequency(flights, left, self.axis.index())
        };
        // Beyond all that noise does.
        Unexplained { axis: self.axis, depends_on, share_percent: self.share_percent, p_value: 0.0 }
    }
}

/// Mean squares of the windows of a flight, not across gaps.
fn mean_squares(flight: &Prepared, residual: &[f64]) -> Vec<f64> {
    let length = (WINDOW_S / flight.period_s).round().max(1.0) as usize;
    let squares: Vec<f64> = residual.iter().map(|e| e * e / length as f64).collect();
    statistics::block_sums(&squares, &flight.row_starts(), length)
}

/// How many times windows of a kind appear after none for a while.
fn separate(windows: &[f64], is_one: impl Fn(&f64) -> bool) -> usize {
    let apart = (APART_S / WINDOW_S).ceil() as usize;
    let ones = windows.iter().enumerate().filter(|(_, square)| is_one(square)).map(|(k, _)| k);
    let (count, _) = ones.fold((0, None::<usize>), |(count, last), k| {
        (count + usize::from(last.is_none_or(|last| k - last > apart)), Some(k))
    });
    count
}

/// What the residual depends on, fitted to every other flight and tested on the rest, and both ways round.
fn dependences(model: &Model, flights: &[&Prepared], left: &[Residuals]) -> Vec<Unexplained> {
    let every_other = |odd: usize| {
        let of_half = |k: &usize| k % 2 == odd;
        let chosen: Vec<usize> = (0..flights.len()).filter(of_half).collect();
        let flights: Vec<&Prepared> = chosen.iter().map(|&k| flights[k]).collect();
        let left: Vec<Residuals> = chosen.iter().map(|&k| left[k].clone()).collect();
        (flights, left)
    };
    let [(a, of_a), (b, of_b)] = [every_other(0), every_other(1)];
    if b.is_empty() {
        return Vec::new();
    }
    let one_way = structure_of(model, (&a, &of_a), (&b, &of_b)).unexplained;
    let other_way = structure_of(model, (&b, &of_b), (&a, &of_a)).unexplained;
    let both = one_way.into_iter().filter_map(|one| {
        let same = |other: &&Unexplained| other.axis == one.axis && other.depends_on == one.depends_on;
        let other = other_way.iter().find(same)?;
        Some(Unexplained {
            share_percent: 0.5 * (one.share_percent + other.share_percent),
            p_value: one.p_value.max(other.p_value),
            ..one
        })
    });
    both.collect()
}

#[cfg(test)]
mod tests {
    use model::{AxisError, FitRecord, PerAxis};

    use super::*;
    use crate::testing::{ORDINARY, prepared, truth};

    /// The true model, its own flights' errors those of its residuals on such flights.
    fn fitted() -> Model {
        let mut model = truth();
        let flights = prepared(&model, 50..52, 8.0, &ORDINARY);
        let left: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, &model)).collect();
        let errors: PerAxis<AxisError> = sysid::errors(&left);
        model.fit = Some(FitRecord { held_out: errors, ..FitRecord::default() });
        model
    }

    /// Residuals of flights of the model with `push` m/s^2 down from each of `times` s on, for 0.3 s.
    fn pushed(flights: &[Prepared], times: &[f64], push: f64) -> Vec<Residuals> {
        let model = truth();
        let mut all: Vec<Residuals> = flights.iter().map(|flight| residuals(flight, &model)).collect();
        for (flight, left) in flights.iter().zip(&mut all) {
            for time in times {
                let first = (time / flight.period_s) as usize;
                left.residual[Axis::W.index()][first..first + 30].iter_mut().for_each(|e| *e += push);
            }
        }
        all
    }

    fn off(times: &[f64], push: f64) -> Option<Off> {
        let flights = prepared(&truth(), 60..62, 8.0, &ORDINARY);
        let left = pushed(&flights, times, push);
        Off::of(&fitted(), Axis::W, &flights.iter().collect::<Vec<_>>(), &left)
    }

    #[test]
    fn flights_as_the_models_own_show_nothing_more() {
        let flights = prepared(&truth(), 60..62, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        assert_eq!(structure_left(&fitted(), &flights), []);
        assert_eq!(
            structure_left(&truth(), &flights),
            [],
            "a model without a fit says nothing of usual errors"
        );
    }

    /// Three tenths of a second in four and a half: the median window is as ever.
    #[test]
    fn bursts_that_recur_are_seen_and_a_single_one_in_each_of_two_flights_is_not() {
        let usual = fitted().fit.unwrap().held_out.w.rms;
        let seen = off(&[0.9, 3.9], 15.0 * usual).expect("four bursts");
        assert!(seen.in_bursts && seen.share_percent > 50.0, "{}", seen.share_percent);
        assert!(off(&[0.9], 15.0 * usual).is_none(), "one in each of two flights");
        assert!(off(&[0.9, 3.9], 2.0 * usual).is_none(), "no more than usual");
    }

    #[test]
    fn windows_that_follow_each_other_are_one_burst() {
        let squares = |ones: &[usize]| {
            let mut windows = vec![0.0; 40];
            ones.iter().for_each(|&k| windows[k] = 1.0);
            separate(&windows, |square| *square > 0.5)
        };
        assert_eq!(squares(&[]), 0);
        assert_eq!(squares(&[3, 4, 5, 8]), 1, "four windows are 1.2 s, from begin to begin 0.9 s");
        assert_eq!(squares(&[3, 8, 30]), 3);
    }

    #[test]
    fn an_unmodelled_pull_towards_a_point_is_named_by_the_place() {
        let mut world = truth();
        world.set(model::Effect::Tether, &[3.0, 0.0, 0.0, 0.0]);
        let flights = prepared(&world, 60..64, 8.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let found = structure_left(&fitted(), &flights);
        let height = |u: &&Unexplained| u.axis == Axis::W && u.depends_on == Dependence::Quantity("height");
        assert!(found.iter().any(|u| height(&u)), "{found:?}");
    }
}
