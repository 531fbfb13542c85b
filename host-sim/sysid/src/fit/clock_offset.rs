//! Is an offset between the clocks of a flight one of its log, or does the craft answer late?

use crate::fit::low_frequency::Estimate;
use crate::prepare::{Alignment, Prepared};
use crate::statistics::median;

/// Standard errors beyond which an offset is one.
pub const SIGNIFICANT: f64 = 4.0;
/// Offsets under this many samples are left alone.
pub const MATTERS_SAMPLES: f64 = 0.2;
/// Commands that all logs have later than this are late by their logger, s: no craft answers before its command. Controllers that answer
/// the noise of their gyro move the offsets of all flights by some milliseconds.
const LATE_IN_ALL_S: f64 = 0.01;

/// What an offset is counted from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reference {
    /// The dead time that flights of commands showed when the model was fitted, s ([`model::FitRecord::rotor_delay_s`]);
    /// without one, or with one that matters and is not yet in the model, commands are left alone.
    Model(Option<f64>),
    /// The median of the flights themselves: what has come about in all of them is physics.
    Flights,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Offset {
    pub(crate) late_s: f64,
    pub(crate) variance_s2: f64,
    /// Covariance with the other flights' offsets: part of an error that they all have, and that says nothing of how they differ.
    pub(crate) shared_s2: f64,
}

impl Offset {
    /// Before anything was found.
    pub(crate) const UNKNOWN: Self = Self { late_s: 0.0, variance_s2: f64::INFINITY, shared_s2: 0.0 };

    pub(crate) fn estimate(&self) -> Estimate {
        Estimate { value: self.late_s, variance: self.variance_s2 }
    }

    /// Variance of what is the flight's own. One that is much sharper than the others shares more with them than it has.
    fn own_variance_s2(&self) -> f64 {
        (self.variance_s2 - self.shared_s2).max(0.0)
    }
}

/// Writes into each flight what is to be corrected.
pub(crate) fn decide(flights: &mut [&mut Prepared], offsets: &[Offset], reference: Reference) {
    let shared = Shared::of(flights, offsets);
    let common_s = match reference {
        Reference::Model(delay) => delay,
        Reference::Flights => shared.late_s,
    };
    for (flight, offset) in flights.iter_mut().zip(offsets) {
        let measured = flight.has_rotor_speeds();
        let (from_s, variance) = match (measured, common_s) {
            (true, _) => (0.0, offset.variance_s2),
            (false, Some(common)) => (common, offset.own_variance_s2() + shared.variance_s2),
            (false, None) => (offset.late_s, offset.variance_s2),
        };
        let late_s = offset.late_s - from_s;
        let std_error_s = variance.sqrt();
        // Coefficients that were fitted with a dead time unsettled judge no clock.
        let settled = measured
            || reference == Reference::Flights
            || common_s.is_some_and(|common| common.abs() < MATTERS_SAMPLES * flight.period_s);
        let corrected = settled && stands_out(late_s, std_error_s, flight.period_s);
        flight.alignment = std_error_s.is_finite().then(|| Alignment {
            late_s,
            std_error_s,
            corrected,
            wandering: Vec::new(),
        });
    }
}

fn stands_out(late_s: f64, std_error_s: f64, period_s: f64) -> bool {
    late_s.abs() > MATTERS_SAMPLES * period_s && late_s.abs() > SIGNIFICANT * std_error_s
}

/// What the offsets of flights whose commands were logged have in common.
struct Shared {
    /// Their median, s.
    late_s: Option<f64>,
    /// Variance of it, s^2.
    variance_s2: f64,
}

impl Shared {
    fn of(flights: &[&mut Prepared], offsets: &[Offset]) -> Self {
        let known = flights.iter().zip(offsets);
        let known = known.filter(|(f, o)| !f.has_rotor_speeds() && o.variance_s2.is_finite());
        let (mut late_s, own): (Vec<f64>, Vec<f64>) =
            known.map(|(_, o)| (o.late_s, o.own_variance_s2())).unzip();
        let count = own.len().max(1) as f64;
        // The median of n normal deviates varies by pi / 2n of their variance.
        let variance_s2 = own.iter().sum::<f64>() / count * std::f64::consts::FRAC_PI_2 / count;
        Self { late_s: median(&mut late_s), variance_s2 }
    }
}

/// Whether the offsets of several flights of commands are those of a logger and none of the craft: all have the commands late, and all alike.
/// Moments or forces that the model lacks look late, too, but in each flight by another time.
pub(crate) fn are_of_loggers(flights: &[&mut Prepared], offsets: &[Offset]) -> bool {
    let Shared { late_s: Some(common_s), variance_s2 } = Shared::of(flights, offsets) else { return false };
    let is_one = |(flight, offset): (&&mut Prepared, &Offset)| {
        let own_s = (offset.own_variance_s2() + variance_s2).sqrt();
        !flight.has_rotor_speeds()
            && offset.late_s > LATE_IN_ALL_S
            && offset.late_s > SIGNIFICANT * offset.variance_s2.sqrt()
            && !stands_out(offset.late_s - common_s, own_s, flight.period_s)
    };
    flights.len() > 1 && flights.iter().zip(offsets).all(is_one)
}

/// Puts right by all of the offsets, what they have in common too.
pub(crate) fn correct(flights: &mut [&mut Prepared], offsets: &[Offset]) {
    for (flight, offset) in flights.iter_mut().zip(offsets) {
        put_right(flight, offset.late_s, offset.variance_s2.sqrt());
    }
}

/// Brings the rotor samples of a flight forward by what they come late.
pub(crate) fn put_right(flight: &mut Prepared, late_s: f64, std_error_s: f64) {
    flight.alignment = Some(Alignment { late_s, std_error_s, corrected: true, wandering: Vec::new() });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    fn flown() -> [Prepared; 3] {
        [7, 8, 9].map(|seed| Prepared::new(&fly(&truth(), seed, 8.0, &NONE), &truth().vehicle).unwrap())
    }

    /// A lag that is not known moves all offsets alike: what two flights differ by is as sharp as without that.
    #[test]
    fn an_error_that_all_offsets_share_says_nothing_of_their_differences() {
        let mut flights = flown();
        let mut std_error_s = |shared_s2: f64, variance_s2: f64| {
            let offsets = [0.0, 0.0, 0.01].map(|late_s| Offset { late_s, variance_s2, shared_s2 });
            let mut all: Vec<&mut Prepared> = flights.iter_mut().collect();
            decide(&mut all, &offsets, Reference::Flights);
            let alignment = all[2].alignment.as_ref().unwrap();
            assert!((alignment.late_s - 0.01).abs() < 1e-12);
            (alignment.std_error_s, alignment.corrected)
        };
        let (alone, corrected) = std_error_s(0.0, 1e-6);
        assert!(corrected && (alone - 1e-3 * (1.0 + std::f64::consts::PI / 6.0).sqrt()).abs() < 1e-12);
        assert!((std_error_s(1e-4, 1.01e-4).0 / alone - 1.0).abs() < 1e-9);
        assert!(!std_error_s(0.0, 1.01e-4).1);
        // Rounding, or one offset that is much sharper than those it is compared with.
        assert_eq!(std_error_s(2e-6, 1e-6).0, 0.0);
    }

    /// A craft may answer all commands 20 ms late. It answers none of them 20 ms early: then its log has them late.
    #[test]
    fn commands_that_all_logs_have_late_are_put_right_and_dead_time_is_not() {
        for (late_s, std_error_s, of_loggers) in [
            ([-0.02; 3], 0.001, false),
            ([0.02, 0.021, 0.019], 0.001, true),
            ([0.02; 3], 0.006, false),
            ([0.008; 3], 0.001, false),
            // No logger's, or the logger's and something else.
            ([0.02, 0.03, 0.02], 0.001, false),
        ] {
            let mut flights = flown();
            let offsets = late_s.map(|late_s| Offset {
                late_s,
                variance_s2: std_error_s * std_error_s,
                shared_s2: 0.0,
            });
            let mut all: Vec<&mut Prepared> = flights.iter_mut().collect();
            assert_eq!(are_of_loggers(&all, &offsets), of_loggers, "{late_s:?} +- {std_error_s}");
            assert!(!are_of_loggers(&all[..1], &offsets[..1]));
            correct(&mut all, &offsets);
            let corrected_s =
                flights.each_ref().map(|flight| flight.alignment.as_ref().unwrap().corrected_s());
            assert_eq!(corrected_s, late_s);
        }
    }
}
