//! From when on has something changed?
//!
//! A motor that fails half way, a string that tears, a load that is picked up: before it the flights show nothing of the
//! change, after it all of it. Windows of the flights are held against a step at each place between them, and against no step:
//! a change that was there from the first second. Flights differ by constants of their own, which a step must stand out from.

use crate::criteria::TIE;
use crate::finding::Since;

/// A window of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Share {
    /// Middle of the window, in the flight's own time, s.
    pub(crate) time_s: f64,
    /// How much of the change the window shows: 0 of nothing, 1 of a change of the size that was found.
    pub(crate) share: f64,
    /// How much the window tells of that: the inverse of its variance, but for a factor that all windows share. A marker in another
    /// place shows while the craft turns; before the first turn, a window tells next to nothing.
    pub(crate) weight: f64,
}

/// Windows before and after a beginning, without which it is a single outlier; and the least that tell anything.
const SHORTEST: usize = 2;
/// 95 % point of chi squared with one degree of freedom: how much worse a moment may be and still be a likely one.
const LIKELY: f64 = 3.841;

/// Part of the change that windows before its beginning may show: with more of it, it was there already, and grew.
const THERE_ALREADY: f64 = 1.0 / 3.0;

/// When the change began that flights in order show; nothing where it may have been there from the first second, however strong.
/// `between` is how much the share differs between flights of an unchanged craft.
pub(crate) fn since(flights: &[(String, Vec<Share>)], between: f64) -> Option<Since> {
    let places: Vec<(usize, f64)> = flights
        .iter()
        .enumerate()
        .flat_map(|(flight, (_, windows))| windows.iter().map(move |window| (flight, window.time_s)))
        .collect();
    let count = places.len();
    if count < 2 * SHORTEST {
        return None;
    }
    let within = noise(flights)?;
    let whitened = Whitened::new(flights, between / within);
    let worse = |from: usize| whitened.left(from) / (within * within);
    let throughout = worse(0);
    let moments: Vec<(usize, f64)> = (SHORTEST..=count - SHORTEST).map(|from| (from, worse(from))).collect();
    let (from, best) = moments.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1))?;
    // Each of the places had its chance.
    if throughout - best < 2.0 * (TIE + (count as f64).ln()) {
        return None;
    }
    let windows: Vec<Share> = flights.iter().flat_map(|(_, windows)| windows).copied().collect();
    let mean = |windows: &[Share]| {
        let weight: f64 = windows.iter().map(|window| window.weight).sum();
        windows.iter().map(|window| window.weight * window.share).sum::<f64>() / weight
    };
    if mean(&windows[..from]) > THERE_ALREADY * mean(&windows[from..]) {
        return None;
    }
    let likely: Vec<usize> =
        moments.iter().filter(|(_, left)| left - best < LIKELY).map(|(k, _)| *k).collect();
    let flight = places[from].0;
    let moment = |k: usize| moment(&places, k);
    let own: Vec<f64> = flights[flight].1.iter().map(|window| window.time_s).collect();
    let (first, last) = (likely[0], likely[likely.len() - 1]);
    let begins = places.iter().position(|(own, _)| *own == flight).unwrap_or(0);
    Some(Since {
        flight: flights[flight].0.clone(),
        before_flight: first <= begins,
        t_s: moment(from),
        t_low_s: if places[first].0 == flight { moment(first - 1).min(moment(from)) } else { own[0] },
        t_high_s: if places[last].0 == flight {
            moment(last + 1).max(moment(from))
        } else {
            own[own.len() - 1]
        },
    })
}

/// Half way between a window and the one before it, where that is of the same flight.
fn moment(places: &[(usize, f64)], k: usize) -> f64 {
    let k = k.min(places.len() - 1);
    let (flight, time_s) = places[k];
    match k.checked_sub(1).map(|before| places[before]) {
        Some((same, before_s)) if same == flight => 0.5 * (before_s + time_s),
        _ => time_s,
    }
}

/// Standard deviation of a window of weight one, from the differences of neighbours: a step between two of them is one of many.
fn noise(flights: &[(String, Vec<Share>)]) -> Option<f64> {
    let mut differences: Vec<f64> = flights
        .iter()
        .flat_map(|(_, windows)| windows.windows(2))
        .map(|pair| {
            let variance = 1.0 / pair[0].weight + 1.0 / pair[1].weight;
            (pair[1].share - pair[0].share).abs() / variance.sqrt()
        })
        .collect();
    // The median of |x| is 0.6745 of a normal deviation.
    let usual = sysid::statistics::median(&mut differences)? / 0.6745;
    (usual > 0.0).then_some(usual)
}

/// Windows without what is common to a flight, as far as that is chance.
struct Whitened<'a> {
    flights: &'a [(String, Vec<Share>)],
    ratio: f64,
}

impl<'a> Whitened<'a> {
    fn new(flights: &'a [(String, Vec<Share>)], ratio: f64) -> Self {
        Self { flights, ratio }
    }

    /// Squares that a change from the `from`th window on leaves, of a size that fits best.
    fn left(&self, from: usize) -> f64 {
        let (mut yy, mut xy, mut xx, mut first) = (0.0, 0.0, 0.0, 0);
        for (_, windows) in self.flights {
            let weight: f64 = windows.iter().map(|window| window.weight).sum();
            let part = self.ratio * self.ratio / (1.0 + weight * self.ratio * self.ratio);
            let (mut sum_x, mut sum_y) = (0.0, 0.0);
            for (k, window) in windows.iter().enumerate() {
                let x = f64::from(u8::from(first + k >= from));
                let (y, w) = (window.share, window.weight);
                (yy, xy, xx) = (yy + w * y * y, xy + w * x * y, xx + w * x);
                (sum_x, sum_y) = (sum_x + w * x, sum_y + w * y);
            }
            yy -= part * sum_y * sum_y;
            xy -= part * sum_x * sum_y;
            xx -= part * sum_x * sum_x;
            first += windows.len();
        }
        if xx > 0.0 { yy - xy * xy / xx } else { yy }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    /// Flights of `lengths` windows with noise of 0.2 and constants of their own; `shown` says how much of the change there is.
    fn flights(
        lengths: &[usize],
        own: f64,
        shown: impl Fn(usize, usize) -> f64,
    ) -> Vec<(String, Vec<Share>)> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let mut noise = |size: f64| size * 12_f64.sqrt() * (rng.random::<f64>() - 0.5);
        let flight = |(index, length): (usize, &usize)| {
            let constant = noise(own);
            let window = |k: usize| {
                let share = shown(index, k) + constant + noise(0.2);
                Share { time_s: 0.5 + k as f64, share, weight: 1.0 }
            };
            (format!("{index}.csv"), (0..*length).map(window).collect())
        };
        lengths.iter().enumerate().map(flight).collect()
    }

    #[test]
    fn a_change_in_the_middle_of_a_flight_is_found_to_a_window_or_two() {
        let all = flights(&[20, 20, 20], 0.1, |flight, k| {
            f64::from(u8::from(flight == 2 || flight == 1 && k >= 12))
        });
        let since = since(&all, 0.1).unwrap();
        assert_eq!(since.flight, "1.csv");
        assert!((since.t_s - 12.0).abs() <= 1.0 && !since.before_flight, "{since:?}");
        assert!(
            since.t_low_s <= 12.0 && since.t_high_s >= 12.0 && since.t_high_s - since.t_low_s < 6.0,
            "{since:?}"
        );
    }

    #[test]
    fn a_change_between_two_flights_begins_with_the_second() {
        let all = flights(&[20, 20, 20], 0.05, |flight, _| f64::from(u8::from(flight >= 1)));
        let since = since(&all, 0.05).unwrap();
        assert_eq!((since.flight.as_str(), since.t_s, since.before_flight), ("1.csv", 0.5, true));
    }

    #[test]
    fn what_was_there_all_the_while_and_what_flights_differ_by_anyway_has_no_beginning() {
        assert_eq!(since(&flights(&[20, 20, 20], 0.1, |_, _| 1.0), 0.1), None);
        assert_eq!(since(&flights(&[6; 8], 1.0, |_, _| 0.5), 1.0), None);
        let grows = |_: usize, k: usize| if k < 8 { 0.6 } else { 1.1 };
        assert_eq!(since(&flights(&[40], 0.1, grows), 0.0), None);
        let comes = |_: usize, k: usize| if k < 8 { 0.1 } else { 1.1 };
        assert!(since(&flights(&[40], 0.1, comes), 0.0).is_some());
        assert_eq!(since(&[], 0.1), None);
        assert_eq!(since(&flights(&[3], 0.1, |_, k| k as f64), 0.1), None);
    }
    /// Two windows of a flight show nothing of the change, and tell nothing: they are a hundred times as uncertain as the rest. As
    /// certain as the rest, they would be a beginning.
    #[test]
    fn windows_that_tell_nothing_make_no_beginning() {
        let with = |weight: f64| {
            let mut all = flights(&[20, 20, 20], 0.1, |_, _| 1.0);
            for window in &mut all[0].1[..2] {
                (window.share, window.weight) = (-1.0, weight);
            }
            since(&all, 0.1)
        };
        assert_eq!(with(1e-4), None);
        assert!(with(1.0).is_some());
    }
}
