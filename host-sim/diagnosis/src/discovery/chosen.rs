//! Numbers in the formulas of variables that are chosen with a form: bearings and times of lags.

use std::f64::consts::FRAC_1_SQRT_2;

use model::{Followed, Lag, LagId, Quantity};

/// Times of lags, s.
pub(super) const LAGS_S: [f64; 10] = [0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2];
/// That over which every form is tried.
pub(super) const SEARCHED_LAG_S: f64 = LAGS_S[6];
/// That over which every form of each rotor's own speed is tried.
pub(super) const SEARCHED_OWN_LAG_S: f64 = LAGS_S[3];

/// Directions in the room that every form is tried over, degrees from north to east. North and east are variables of their own.
pub(super) const OBLIQUE_DEG: [f64; 4] = [30.0, 60.0, 120.0, 150.0];
/// Steps between directions that the best forms over one of them are tried over besides, degrees.
const ROUGH_DEG: f64 = 5.0;
pub(super) const FINE_DEG: usize = 1;

/// Which numbers are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Grid {
    /// Far apart.
    Rough,
    /// What lies between them.
    Fine,
}

/// A number in the formula of a variable that is chosen with the form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Chosen {
    /// A horizontal direction: its angle from north to east, degrees.
    BearingDeg(f64),
    /// Time of a lag, s.
    LagS(f64),
    /// Time of each of two lags in a row, s; in no grid.
    TwoLagsS(f64),
}

/// How a formula names that number.
#[derive(Debug, Clone)]
pub(crate) enum Spelling {
    /// There is none, or it is a plain number.
    Plain,
    /// The constant that is the time of a lag.
    Constant(String),
    /// The coefficient that is a bearing, rad.
    Bearing(String),
    /// The coefficient that is the time of a lag, between those of two constants or a little beyond: a lag is taken for straight from one
    /// to the other.
    Between { time: String, from: String, to: String },
}

impl Chosen {
    /// Two lags in a row that are much like one: the ages of what is remembered have the same standard deviation.
    pub(super) fn in_two(self) -> Option<Self> {
        match self {
            Self::LagS(time_s) => Some(Self::TwoLagsS(FRAC_1_SQRT_2 * time_s)),
            _ => None,
        }
    }

    /// Time of a lag, or of each of two, s.
    pub(super) const fn time_s(self) -> Option<f64> {
        match self {
            Self::BearingDeg(_) => None,
            Self::LagS(time_s) | Self::TwoLagsS(time_s) => Some(time_s),
        }
    }

    /// Whether it is one of a grid's.
    pub(super) fn is_on(self, grid: Grid) -> bool {
        match (self, grid) {
            (Self::BearingDeg(degrees), Grid::Rough) => degrees % ROUGH_DEG == 0.0,
            (Self::BearingDeg(_), Grid::Fine) | (Self::LagS(_), Grid::Rough) => true,
            (Self::LagS(_), Grid::Fine) | (Self::TwoLagsS(_), _) => false,
        }
    }

    /// How far from another one of its kind: degrees, or the logarithm of the lags' ratio.
    pub(super) fn apart(self, other: Self) -> Option<f64> {
        match (self, other) {
            (Self::BearingDeg(own), Self::BearingDeg(other)) => {
                let turn = (own - other).abs();
                Some(turn.min(180.0 - turn))
            }
            _ => Some((self.time_s()? / other.time_s()?).ln().abs()),
        }
    }
}

impl Spelling {
    /// A quantity behind the lag, or behind two in a row.
    pub(super) fn lag(&self, of: &str, twice: bool) -> String {
        let behind = |time: &str| match twice {
            false => format!("lag({of}, {time})"),
            true => format!("lag(lag({of}, {time}), {time})"),
        };
        match self {
            Self::Between { time, from, to } => {
                let (first, last) = (behind(from), behind(to));
                format!("({first} + ({time} - {from}) * ({last} - {first}) / ({to} - {from}))")
            }
            Self::Constant(time) => behind(time),
            Self::Plain | Self::Bearing(_) => of.to_owned(),
        }
    }
}

/// North and east parts of a direction, as formulas have them.
pub(super) fn direction(degrees: f64) -> [f64; 2] {
    let (east, north) = degrees.to_radians().sin_cos();
    [north, east].map(|part| (1e4 * part).round() / 1e4)
}

/// The place along a direction as formulas spell it.
pub(super) fn along([north, east]: [f64; 2]) -> String {
    let joint = if north < 0.0 { "-" } else { "+" };
    format!("({east} * east {joint} {} * north)", north.abs())
}

/// Digits of a time of a lag in a formula.
const DIGITS: i32 = 4;

/// To as many digits as formulas have of a time.
pub(crate) fn rounded(time_s: f64) -> f64 {
    let scale = 10_f64.powi(DIGITS - 1 - time_s.abs().log10().floor() as i32);
    (time_s * scale).round() / scale
}

/// A quantity behind a lag, or two; nothing where there is no room for another one.
pub(super) fn lag_of(quantity: &'static Quantity, chosen: Chosen) -> Option<LagId> {
    let behind = |of: Followed, time_s: f64| Lag { of, time_s: Some(time_s) }.id();
    match chosen {
        Chosen::BearingDeg(_) => None,
        Chosen::LagS(time_s) => behind(Followed::Quantity(quantity), time_s),
        Chosen::TwoLagsS(time_s) => {
            behind(Followed::Lag(behind(Followed::Quantity(quantity), time_s)?), time_s)
        }
    }
}

/// The speed of each rotor behind a lag.
pub(super) fn lags_of_rotors(time_s: f64) -> [Option<LagId>; 4] {
    ["omega1", "omega2", "omega3", "omega4"].map(|name| lag_of(Quantity::named(name)?, Chosen::LagS(time_s)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_four_digits() {
        assert_eq!([0.412_345, 1.234_56, 0.05].map(rounded), [0.4123, 1.235, 0.05]);
    }
}
