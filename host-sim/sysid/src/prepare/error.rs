//! Why a flight cannot be used.

/// Why a flight cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PrepareError {
    /// Too short.
    #[error(
        "has {samples} samples over {duration_s:.2} s; at least {needed_s:.2} s without gaps or missing values are needed"
    )]
    TooShort {
        /// Samples in the file.
        samples: usize,
        /// First to last time, s.
        duration_s: f64,
        /// Length without gaps that is needed, s.
        needed_s: f64,
    },
    /// The craft stands or is carried throughout.
    #[error("holds no flight that could be used: {left_out}")]
    NeverFlies {
        /// What it does instead, and when.
        left_out: String,
    },
    /// A clock that leaps, or logs of two flights in one.
    #[error(
        "has nothing between t = {before_s} s and t = {after_s} s; gaps over an hour ({longest_s} s) are refused: mend the clock of the \
         log, cut it there, or use the part on one side with --from and --to"
    )]
    Gap {
        /// Time of the sample before the gap, s.
        before_s: f64,
        /// Time of the sample behind it, s.
        after_s: f64,
        /// Longest gap that is taken, s.
        longest_s: f64,
    },
    /// A log of the bench.
    #[error(
        "motors at rest: {what} throughout, so that nothing in it flies; give a log of a flight, or the parts in which the motors turn \
         with --from and --to"
    )]
    MotorsAtRest {
        /// What says so.
        what: String,
    },
    /// No sample in the parts that were asked for.
    #[error("has no sample in the parts that are asked for; the log goes from {from_s:.2} to {to_s:.2} s")]
    NothingTaken {
        /// First time of the log, s.
        from_s: f64,
        /// Last time of the log, s.
        to_s: f64,
    },
    /// Neither rotor speeds nor a map.
    #[error(
        "has no rotor speeds (omega1..4) and the vehicle file has no motor map; give [motors] command, voltage and offset, or map = \"identify\""
    )]
    NoRotorSpeeds,
    /// A column that a formula names is not there.
    #[error(
        "has no column \"{column}\", which the effect \"{effect}\" names; log it, or name it in columns.toml beside the flight"
    )]
    NoColumn {
        /// The column.
        column: &'static str,
        /// The effect.
        effect: &'static str,
    },
    /// A user's formula has no value anywhere for long enough.
    #[error("has nothing left to use: {reason} nearly everywhere")]
    Undefined {
        /// Which formula.
        reason: String,
    },
}

#[cfg(test)]
mod tests {
    use model::Vehicle;

    use super::*;
    use crate::Prepared;
    use crate::testing::flight;

    #[test]
    fn commands_without_a_map_are_refused_with_both_ways_to_give_one() {
        let mut vehicle = Vehicle::thesis();
        (vehicle.motors.command, vehicle.motors.voltage, vehicle.motors.offset) = (None, None, None);
        let refused = Prepared::new(&flight(200, |_, _| {}), &vehicle).unwrap_err();
        assert_eq!(refused, PrepareError::NoRotorSpeeds);
        assert_eq!(
            refused.to_string(),
            "has no rotor speeds (omega1..4) and the vehicle file has no motor map; give [motors] command, \
             voltage and offset, or map = \"identify\""
        );
    }

    /// A window of 0.3 s is 31 samples; the margins are 30 on either side.
    #[test]
    fn a_flight_of_one_sample_more_than_too_short_is_taken() {
        let prepared = |samples: usize| Prepared::new(&flight(samples, |_, _| {}), &Vehicle::thesis());
        let PrepareError::TooShort { samples, needed_s, .. } = prepared(90).unwrap_err() else {
            panic!("another error")
        };
        assert_eq!(samples, 90);
        assert!((needed_s - 0.91).abs() < 1e-9);
        assert_eq!(prepared(91).unwrap().rows(), 31);
    }
}
