//! Numbers in the formulas of variables that are chosen with a form: bearings and times of lags.

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
    /// Whether it is one of a grid's.
    pub(super) fn is_on(self, grid: Grid) -> bool {
        match (self, grid) {
            (Self::BearingDeg(degrees), Grid::Rough) => degrees % ROUGH_DEG == 0.0,
            (Self::BearingDeg(_), Grid::Fine) | (Self::LagS(_), Grid::Rough) => true,
            (Self::LagS(_), Grid::Fine) => false,
        }
    }

    /// How far from another one of its kind: degrees, or steps from time to time.
    pub(super) fn apart(self, other: Self) -> Option<f64> {
        let place = |time_s: f64| LAGS_S.iter().position(|own| *own == time_s);
        match (self, other) {
            (Self::BearingDeg(own), Self::BearingDeg(other)) => {
                let turn = (own - other).abs();
                Some(turn.min(180.0 - turn))
            }
            (Self::LagS(own), Self::LagS(other)) => Some(place(own)?.abs_diff(place(other)?) as f64),
            _ => None,
        }
    }
}

impl Spelling {
    /// A quantity behind the lag.
    pub(super) fn lag(&self, of: &str) -> String {
        match self {
            Self::Between { time, from, to } => format!(
                "(lag({of}, {from}) + ({time} - {from}) * (lag({of}, {to}) - lag({of}, {from})) / ({to} - {from}))"
            ),
            Self::Constant(time) => format!("lag({of}, {time})"),
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

/// A quantity behind a lag; nothing where there is no room for another one.
pub(super) fn lag_of(quantity: &'static Quantity, time_s: f64) -> Option<LagId> {
    Lag { of: Followed::Quantity(quantity), time_s: Some(time_s) }.id()
}

/// The speed of each rotor behind a lag.
pub(super) fn lags_of_rotors(time_s: f64) -> [Option<LagId>; 4] {
    ["omega1", "omega2", "omega3", "omega4"].map(|name| lag_of(Quantity::named(name)?, time_s))
}
