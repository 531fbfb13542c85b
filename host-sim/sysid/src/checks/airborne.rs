//! Which parts of a log are flown: take-off, landing, a floor, a hand and a crash are no flight.
//!
//! In the air nothing carries a craft but its rotors. Their thrust, relative to what it is in most of the flight, says how the
//! craft has to accelerate; where it accelerates less downwards, something else carries it. What it is told by:
//!
//! - **little thrust**: less than half of what flight takes, and the craft does not fall: a floor, a hand, a net;
//! - **still**: it stands where it is for a second, though the thrust is too small for that, by whatever little;
//! - what stands still beside such a part, at the same height and place, stands there too: the motors ramp up, and the feet
//!   leave the floor where the craft first moves;
//! - what is as low beside a part where it stands bounces or slides there, whatever its thrust;
//! - **tumbling**: upside down shortly before such a part, or at the end of the log.
//!
//! All of it is looked at in pieces of a tenth of a second, by medians: an outlier does not count, and lift-off is found to a
//! tenth of a second. The scale of the thrust is the log's own, so neither mass nor motor map have to be right.

use flights::{Column, Flight, StandIn, median_step};
use model::Vehicle;
use report::number::fixed;

use crate::prepare::StandingGyro;
use crate::statistics::median;

/// Length of a piece, s, and least samples of one.
const PIECE_S: f64 = 0.1;
const PIECE_SAMPLES: f64 = 3.0;
/// Thrust relative to that of flight below which a craft falls visibly, and part of its weight that is carried otherwise.
/// Wind of 12 m/s from ahead, which also carries, leaves 0.7 and 0.4; brisk flights have less thrust, and fall.
const LITTLE_THRUST: f64 = 0.5;
const MUCH_CARRIED: f64 = 0.4;
/// For so many pieces in a row: rotors follow commands late, and what they do not do for a tenth of a second is no support.
const CARRIED_PIECES: usize = 3;
/// Part of the weight that is carried where a craft stands still: more than the sag of a battery takes from a command in a
/// flight (15 % of the thrust), and less than any motor's idle.
const CARRIED_STILL: f64 = 0.15;
/// Slower than this a craft stands, m/s: millimetres of noise over a fifth of a second are a tenth of it.
const STILL_M_S: f64 = 0.05;
/// What it feels then, where no position is logged, is one g within this part.
const STILL_G: f64 = 0.05;
/// And turns no faster than this, rad/s, beside the median over the log, which holds the gyro's bias.
const STILL_RAD_S: f64 = 0.2;
/// For so many pieces in a row. A hover that is held to 5 cm/s for a second has all of its thrust.
const STILL_PIECES: usize = 10;
/// A craft that still stands at the same place: higher or lower by no more than this, m, and as far to the side.
const SAME_HEIGHT_M: f64 = 0.02;
const SAME_PLACE_M: f64 = 0.05;
/// A craft that is no higher than this above where it stands soon or stood before, m, touches the floor; between two touches it hops no
/// higher than that, for so many pieces at most: a landing with full thrust bounces by some centimetres for a second or two.
const TOUCH_M: f64 = 0.04;
const BOUNCE_M: f64 = 0.15;
const BOUNCE_PIECES: usize = 20;
/// So many pieces at most without any sign that something carries: thrust equal to the weight says nothing.
const UNSURE_PIECES: usize = 10;
/// Part of the weight that is such a sign.
const ANY_CARRIED: f64 = 0.05;
/// A hop shorter than so many pieces between two parts on the floor is none.
const HOP_PIECES: usize = 10;
/// Pieces that are left out on either side of what does not fly: lift-off and impact.
const GUARD_PIECES: usize = 2;
/// Thrust that counts for its usual level, relative to what nine of ten pieces stay below: no idle, no ramp.
const FLYING_PART: f64 = 0.4;
/// Moving pieces from which on only those tell the level.
const ENOUGH_MOVING: usize = 20;
/// Cosine of the tilt beyond which a craft is upside down, and within which it is flown again.
const UPSIDE_DOWN: f64 = 0.0;
const UPRIGHT: f64 = 0.5;
/// Pieces between being upside down and lying: two seconds of falling are 20 m.
const FALL_PIECES: usize = 20;
/// Commands within this part of the range of its lower end: the motor stands.
pub(super) const STOPPED: f64 = 0.01;
/// Samples of a standing craft from which on the gyro's mean is its bias: a second at 100 Hz.
const BIAS_SAMPLES: usize = 100;

/// Pieces that a gap in the log has at most: more than anything is looked for across one, and few enough that a log of many long
/// gaps needs no more memory than its rows.
const GAP_PIECES: usize = 50;

const GRAVITY_M_S2: f64 = 9.81;

/// Why a part of a log is no flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// On a floor, in a stand: it does not move.
    Standing,
    /// Carried by something and moved: a hand, a net, a craft that bounces.
    Carried,
    /// Upside down.
    Tumbling,
}

impl Ground {
    /// The word in JSON and for people.
    pub const fn id(self) -> &'static str {
        match self {
            Self::Standing => "standing",
            Self::Carried => "carried",
            Self::Tumbling => "tumbling",
        }
    }
}

/// A part of a log that is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeftOut {
    /// First time left out, s.
    pub from_s: f64,
    /// Last time left out, s.
    pub to_s: f64,
    /// What the craft does there, mostly.
    pub why: Ground,
}

/// The flown parts of a log.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Airborne {
    /// Which rows are flown.
    pub flown: Vec<bool>,
    /// Parts that are not, in order.
    pub left_out: Vec<LeftOut>,
    /// The gyro's bias, where the craft stands for long enough.
    pub gyro: Option<StandingGyro>,
}

/// What is left out, for people; nothing where nothing is.
pub fn sentence(left_out: &[LeftOut]) -> Option<String> {
    let part = |p: &LeftOut| format!("{} to {} s ({})", fixed(p.from_s, 2), fixed(p.to_s, 2), p.why.id());
    let parts: Vec<String> = left_out.iter().map(part).collect();
    (!parts.is_empty()).then(|| {
        format!(
            "the craft is not airborne throughout; only the airborne parts are used; left out: {} (to use other parts, give \
             --from and --to, or a file FLIGHT.use.toml beside the flight)",
            parts.join(", ")
        )
    })
}

/// Finds what is flown of a log.
pub fn airborne(flight: &Flight, vehicle: &Vehicle) -> Airborne {
    let log = Pieces::of(flight, vehicle);
    let carried = log.carried();
    let mut why: Vec<Option<Ground>> = vec![None; log.count()];
    mark_runs(&mut why, CARRIED_PIECES, Ground::Carried, |k| {
        log.thrust[k] < LITTLE_THRUST && carried[k] > MUCH_CARRIED
    });
    mark_runs(&mut why, STILL_PIECES, Ground::Standing, |k| log.stands(k) && carried[k] > CARRIED_STILL);
    if why.iter().all(Option::is_none) {
        return Airborne { flown: vec![true; flight.len()], ..Airborne::default() };
    }
    log.grow(&mut why, &carried);
    if log.felt_g.is_none() {
        log.grow_along_floor(&mut why);
    }
    close_hops(&mut why);
    log.mark_tumbling(&mut why);
    let gyro = log.standing_gyro(flight, &why);
    guard(&mut why);
    let flown: Vec<bool> = log.piece_of.iter().map(|&k| why[k].is_none()).collect();
    Airborne { left_out: left_out(flight.required(Column::T), &log.piece_of, &why), flown, gyro }
}

/// Piece of each row.
fn pieces_of_rows(t: &[f64], length_s: f64) -> Vec<usize> {
    let mut skipped = 0;
    let mut last = 0;
    let piece = |time: &f64| {
        let elapsed = ((time - t[0]) / length_s) as usize;
        skipped += (elapsed - skipped).saturating_sub(last + GAP_PIECES);
        last = elapsed - skipped;
        last
    };
    t.iter().map(piece).collect()
}

/// A log in pieces of a tenth of a second.
struct Pieces {
    /// Piece of each row.
    piece_of: Vec<usize>,
    length_s: f64,
    position_m: [Vec<f64>; 3],
    /// Cosine of the tilt.
    upright: Vec<f64>,
    /// Size of the rates about their medians, rad/s.
    turning_rad_s: Vec<f64>,
    /// Thrust relative to what flight takes.
    thrust: Vec<f64>,
    /// What the accelerometer feels along the thrust, in g, where no position is logged.
    felt_g: Option<Vec<f64>>,
}

impl Pieces {
    fn of(flight: &Flight, vehicle: &Vehicle) -> Self {
        use Column::*;
        let t = flight.required(T);
        let length_s = PIECE_S.max(PIECE_SAMPLES * median_step(t));
        let piece_of = pieces_of_rows(t, length_s);
        let medians = |values: &[f64]| by_piece(&piece_of, values, |piece| median(piece).unwrap_or(f64::NAN));
        let [phi, theta] = [Phi, Theta].map(|c| flight.required(c));
        let upright: Vec<f64> = phi.iter().zip(theta).map(|(phi, theta)| phi.cos() * theta.cos()).collect();
        let rates = [P, Q, R].map(|c| {
            let values = flight.required(c);
            let usual = median(&mut finite(values)).unwrap_or(0.0);
            medians(&values.iter().map(|rate| (rate - usual).abs()).collect::<Vec<f64>>())
        });
        let turning_rad_s =
            (0..rates[0].len()).map(|k| rates.iter().map(|r| r[k] * r[k]).sum::<f64>().sqrt()).collect();
        let mut log = Self {
            length_s,
            position_m: [X, Y, Z].map(|c| medians(flight.required(c))),
            upright: medians(&upright),
            turning_rad_s,
            thrust: by_piece(&piece_of, &squares_of_speeds(flight, vehicle), |piece| {
                piece.iter().sum::<f64>() / piece.len() as f64
            }),
            felt_g: (flight.stand_ins().contains(&StandIn::NoPosition))
                .then(|| medians(flight.required(Az)).iter().map(|az| -az / GRAVITY_M_S2).collect()),
            piece_of,
        };
        log.scale_thrust();
        log
    }

    fn count(&self) -> usize {
        self.thrust.len()
    }

    /// Speed at a piece, m/s; not a number beside missing ones.
    fn speed_m_s(&self, k: usize) -> f64 {
        let (before, after) = (k.saturating_sub(1), (k + 1).min(self.count() - 1));
        let time_s = (after - before).max(1) as f64 * self.length_s;
        self.position_m.iter().map(|p| ((p[after] - p[before]) / time_s).powi(2)).sum::<f64>().sqrt()
    }

    fn stands(&self, k: usize) -> bool {
        let feels_still = self.felt_g.as_ref().is_none_or(|felt| (felt[k] - 1.0).abs() < STILL_G);
        self.speed_m_s(k) < STILL_M_S && self.turning_rad_s[k] < STILL_RAD_S && feels_still
    }

    /// Makes the thrust one where the craft flies: its median over what moves, without idle.
    fn scale_thrust(&mut self) {
        let mut all = finite(&self.thrust);
        all.sort_unstable_by(f64::total_cmp);
        let Some(&high) = all.get(all.len() * 9 / 10) else { return };
        let flies = |k: &usize| self.thrust[*k] > FLYING_PART * high;
        let flying: Vec<usize> = (0..self.count()).filter(flies).collect();
        let moving: Vec<f64> = flying.iter().filter(|&&k| !self.stands(k)).map(|&k| self.thrust[k]).collect();
        let mut counted = if moving.len() >= ENOUGH_MOVING {
            moving
        } else {
            flying.iter().map(|&k| self.thrust[k]).collect()
        };
        let mut usual = median(&mut counted).filter(|usual| *usual > 0.0).unwrap_or(f64::NAN);
        if let Some(felt) = &self.felt_g {
            // What is felt in flight is the thrust, however briskly it is flown.
            let ratio = flying.iter().map(|&k| self.thrust[k] / felt[k]).filter(|ratio| *ratio > 0.0);
            usual = median(&mut ratio.collect::<Vec<f64>>()).unwrap_or(usual);
        }
        self.thrust.iter_mut().for_each(|thrust| *thrust /= usual);
    }

    /// Part of the weight that neither the thrust nor falling accounts for, at each piece. Without a position, what is felt beyond
    /// the thrust.
    fn carried(&self) -> Vec<f64> {
        if let Some(felt) = &self.felt_g {
            return felt.iter().zip(&self.thrust).map(|(felt, thrust)| felt - thrust).collect();
        }
        let z = &self.position_m[2];
        (0..self.count())
            .map(|k| {
                let middle = k.clamp(1, (self.count().max(3)) - 2);
                let bent = match (z.get(middle - 1), z.get(middle), z.get(middle + 1)) {
                    (Some(before), Some(here), Some(after)) => before - 2.0 * here + after,
                    _ => 0.0,
                };
                let falling = bent / self.length_s.powi(2) / GRAVITY_M_S2;
                1.0 - self.thrust[k] * self.upright[k] - falling
            })
            .collect()
    }

    /// Adds what stands at the same place beside a part that does not fly.
    fn grow(&self, why: &mut [Option<Ground>], carried: &[f64]) {
        let cores: Vec<usize> = (0..why.len()).filter(|&k| why[k].is_some()).collect();
        for core in cores {
            for ahead in [true, false] {
                let mut unsure = 0;
                let mut k = core;
                while let Some(next) = if ahead { Some(k + 1) } else { k.checked_sub(1) }
                    && next < why.len()
                    && why[next].is_none()
                    && self.speed_m_s(next) < 2.0 * STILL_M_S
                    && self.same_place(core, next)
                {
                    unsure += usize::from(carried[next] < ANY_CARRIED);
                    if unsure > UNSURE_PIECES {
                        break;
                    }
                    why[next] = Some(Ground::Standing);
                    k = next;
                }
            }
        }
    }

    /// Adds what is as low beside a part where the craft stands: it touches the floor again and again, though its thrust carries it.
    fn grow_along_floor(&self, why: &mut [Option<Ground>]) {
        let stands = |k: usize, why: &[Option<Ground>]| why[k] == Some(Ground::Standing);
        let cores: Vec<usize> = (0..why.len()).filter(|&k| stands(k, why)).collect();
        let height_m = |k: usize| -self.position_m[2][k];
        for core in cores {
            for ahead in [true, false] {
                let beside = (1..=BOUNCE_PIECES)
                    .map_while(|by| if ahead { Some(core + by) } else { core.checked_sub(by) })
                    .take_while(|&k| k < why.len() && why[k].is_none());
                let low: Vec<usize> =
                    beside.take_while(|&k| height_m(k) - height_m(core) < BOUNCE_M).collect();
                let touches = |k: &usize| height_m(*k) - height_m(core) < TOUCH_M;
                let until = low.iter().rposition(touches).map_or(0, |last| last + 1);
                low[..until].iter().for_each(|&k| why[k] = Some(Ground::Standing));
            }
        }
    }

    fn same_place(&self, a: usize, b: usize) -> bool {
        let [x, y, z] = self.position_m.each_ref().map(|p| p[b] - p[a]);
        z.abs() < SAME_HEIGHT_M && x.hypot(y) < SAME_PLACE_M
    }

    /// Adds what is upside down before a part that does not fly, or before the end, from where it was last upright.
    fn mark_tumbling(&self, why: &mut [Option<Ground>]) {
        let ends: Vec<usize> = (1..=why.len())
            .filter(|&k| why[k - 1].is_none() && (k == why.len() || why[k].is_some()))
            .collect();
        for end in ends {
            let near = end.saturating_sub(FALL_PIECES)..end;
            let Some(over) = near.clone().find(|&k| self.upright[k] < UPSIDE_DOWN) else { continue };
            let flown_again = (over..end).any(|k| self.upright[k] > UPRIGHT);
            if !flown_again {
                let from = (0..over).rev().find(|&k| self.upright[k] > UPRIGHT).map_or(0, |k| k + 1);
                why[from..end].fill(Some(Ground::Tumbling));
            }
        }
    }

    /// Mean rates of what stands, its ends aside, where it stands for long enough.
    fn standing_gyro(&self, flight: &Flight, why: &[Option<Ground>]) -> Option<StandingGyro> {
        let stands = |k: usize| {
            why[k].is_some()
                && self.turning_rad_s[k] < STILL_RAD_S
                && (k.saturating_sub(GUARD_PIECES)..(k + GUARD_PIECES + 1).min(why.len()))
                    .all(|k| why[k].is_some() && self.speed_m_s(k) < STILL_M_S)
        };
        let still: Vec<bool> = (0..why.len()).map(stands).collect();
        let mut gyro = StandingGyro { mean_rad_s: [0.0; 3], std_error_rad_s: [0.0; 3] };
        for (i, column) in [Column::P, Column::Q, Column::R].into_iter().enumerate() {
            let rates = flight.required(column).iter().zip(&self.piece_of);
            let rates: Vec<f64> =
                rates.filter(|(rate, k)| rate.is_finite() && still[**k]).map(|(rate, _)| *rate).collect();
            let n = rates.len() as f64;
            if rates.len() < BIAS_SAMPLES {
                return None;
            }
            let mean = rates.iter().sum::<f64>() / n;
            let variance = rates.iter().map(|rate| (rate - mean).powi(2)).sum::<f64>() / (n - 1.0);
            gyro.mean_rad_s[i] = mean;
            gyro.std_error_rad_s[i] = (variance / n).sqrt();
        }
        Some(gyro)
    }
}

/// What stands for the thrust: squares of rotor speeds as logged or by the map, else of commands. Zero where all motors
/// stand.
fn squares_of_speeds(flight: &Flight, vehicle: &Vehicle) -> Vec<f64> {
    use Column::*;
    let commands = [Cmd1, Cmd2, Cmd3, Cmd4].map(|c| flight.required(c));
    let logged = flight.group([Omega1, Omega2, Omega3, Omega4]);
    let battery = flight.required(Vbat);
    let map = (vehicle.has_rotor_map() && logged.is_none()).then(|| vehicle.rotor_map());
    let [low, high] = vehicle.motors.command_range;
    let stopped = low + STOPPED * (high - low);
    (0..flight.len())
        .map(|k| {
            let speed = |motor: usize| match (&logged, &map) {
                (Some(speeds), _) => speeds[motor][k],
                _ if commands[motor][k] <= stopped => 0.0,
                (_, Some(map)) => {
                    (map.command * commands[motor][k] + map.voltage * battery[k] + map.offset).max(0.0)
                }
                _ => commands[motor][k],
            };
            (0..4).map(|motor| speed(motor).powi(2)).sum()
        })
        .collect()
}

fn finite(values: &[f64]) -> Vec<f64> {
    values.iter().copied().filter(|value| value.is_finite()).collect()
}

/// One number for each piece, of its finite values; not a number where there are none.
fn by_piece(piece_of: &[usize], values: &[f64], number: impl Fn(&mut [f64]) -> f64) -> Vec<f64> {
    let count = piece_of.last().map_or(0, |last| last + 1);
    let mut pieces: Vec<Vec<f64>> = vec![Vec::new(); count];
    for (&piece, value) in piece_of.iter().zip(values) {
        if value.is_finite() {
            pieces[piece].push(*value);
        }
    }
    pieces.iter_mut().map(|piece| if piece.is_empty() { f64::NAN } else { number(piece) }).collect()
}

/// Marks runs of at least so many pieces for which something holds.
fn mark_runs(why: &mut [Option<Ground>], least: usize, ground: Ground, holds: impl Fn(usize) -> bool) {
    let mut start = 0;
    for k in 0..=why.len() {
        if k < why.len() && holds(k) {
            continue;
        }
        if k - start >= least {
            why[start..k].fill(Some(ground));
        }
        start = k + 1;
    }
}

/// Leaves out short hops, between parts that do not fly and at the ends of the log.
fn close_hops(why: &mut [Option<Ground>]) {
    let mut start = 0;
    for k in 0..=why.len() {
        if k < why.len() && why[k].is_none() {
            continue;
        }
        if k - start < HOP_PIECES {
            why[start..k].fill(Some(Ground::Carried));
        }
        start = k + 1;
    }
}

/// Widens what does not fly on either side.
fn guard(why: &mut [Option<Ground>]) {
    let as_found = why.to_vec();
    for (k, found) in as_found.iter().enumerate().filter(|(_, found)| found.is_some()) {
        let last = why.len() - 1;
        for near in &mut why[k.saturating_sub(GUARD_PIECES)..=(k + GUARD_PIECES).min(last)] {
            *near = near.or(*found);
        }
    }
}

/// The parts that are left out, with their times.
fn left_out(t: &[f64], piece_of: &[usize], why: &[Option<Ground>]) -> Vec<LeftOut> {
    let mut parts: Vec<LeftOut> = Vec::new();
    let mut first = 0;
    let is_out = |row: usize| why[piece_of[row]].is_some();
    for row in 1..=t.len() {
        if row < t.len() && is_out(row) == is_out(first) {
            continue;
        }
        if is_out(first) {
            let inside = &why[piece_of[first]..=piece_of[row - 1]];
            let count = |ground| inside.iter().filter(|w| **w == Some(ground)).count();
            let why = if count(Ground::Tumbling) > 0 {
                Ground::Tumbling
            } else if count(Ground::Standing) >= count(Ground::Carried) {
                Ground::Standing
            } else {
                Ground::Carried
            };
            parts.push(LeftOut { from_s: t[first], to_s: t[row - 1], why });
        }
        first = row;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_gap_is_a_few_pieces_and_a_short_one_as_many_as_it_lasts() {
        assert_eq!(pieces_of_rows(&[5.0, 5.75, 6.25, 26.25, 26.75], 0.5), [0, 1, 2, 42, 43]);
        assert_eq!(pieces_of_rows(&[0.0, 0.75, 3600.0, 3600.75, 1e9], 0.5), [0, 1, 51, 52, 102]);
    }
    use crate::testing::{Row, flight, truth};

    /// Ten seconds of waves in the air, between two parts of another kind: `ground` says what a sample of them is, from the
    /// time before lift-off, or after touch-down, s.
    fn flown_between(before_s: f64, after_s: f64, ground: impl Fn(f64, &mut Row)) -> Flight {
        let total = ((before_s + 10.0 + after_s) * 100.0).round() as usize;
        flight(total, |t, row| {
            let noise = (7919.0 * t).sin();
            let air = t - before_s;
            row.time_s = air.clamp(0.0, 10.0);
            let bent = row.wave().z;
            row.time_s = t;
            // Thrust that bends the path as it is bent: squares of commands, by the thesis' map.
            let speed = 600.0 * ((9.81 - bent) / 9.81).sqrt();
            let map = truth().vehicle.rotor_map();
            row.command = [map.command_for(speed, row.battery_v); 4];
            row.euler_rad = [0.0; 3];
            row.rate_rad_s = [0.01 + 0.01 * noise, -0.02 - 0.01 * noise, 0.005];
            if !(0.0..=10.0).contains(&air) {
                ground(if air < 0.0 { -air } else { air - 10.0 }, row);
                row.position_ned_m[2] += 0.0005 * noise;
            } else {
                row.rate_rad_s[0] += (3.0 * t).sin();
            }
        })
    }

    fn of(flight: &Flight) -> Airborne {
        airborne(flight, &truth().vehicle)
    }

    fn times(found: &Airborne) -> Vec<(f64, f64, Ground)> {
        found.left_out.iter().map(|p| (p.from_s, p.to_s, p.why)).collect()
    }

    /// Motors that stand for two seconds, then ramp up in one; and down again.
    fn ramps(to_air_s: f64, row: &mut Row) {
        let thrust = 1.0 - to_air_s.min(1.0);
        let map = truth().vehicle.rotor_map();
        row.command = [map.command_for(600.0 * thrust.sqrt(), row.battery_v).max(1050.0); 4];
    }

    #[test]
    fn a_flight_that_is_flown_from_end_to_end_keeps_every_sample() {
        let found = of(&flown_between(0.0, 0.0, |_, _| {}));
        assert_eq!(found.left_out, []);
        assert!(found.flown.iter().all(|flown| *flown) && found.gyro.is_none());
        assert_eq!(sentence(&found.left_out), None);
    }

    #[test]
    fn a_hover_on_the_spot_is_no_standing() {
        let found = of(&flight(1000, |t, row| row.position_ned_m[2] = -1.0 + 0.001 * (5.0 * t).sin()));
        assert_eq!(found.left_out, []);
    }

    #[test]
    fn seconds_on_the_floor_are_left_out_with_the_ramps_of_the_motors() {
        let found = of(&flown_between(3.0, 2.5, ramps));
        let [(from, lift_off, first), (touch_down, to, last)] = times(&found)[..] else {
            panic!("{:?}", found.left_out)
        };
        assert_eq!((from, first, last), (0.0, Ground::Standing, Ground::Standing));
        // Found to a piece, and two more are left out.
        assert!((2.99..3.4).contains(&lift_off), "{lift_off}");
        assert!((12.6..13.01).contains(&touch_down) && to > 15.4, "{touch_down} {to}");
        let flown = found.flown.iter().filter(|flown| **flown).count();
        assert!((920..1000).contains(&flown), "{flown}");
        let said = sentence(&found.left_out).unwrap();
        assert!(said.contains("left out: 0.00 to 3.") && said.contains(" s (standing), 12."), "{said}");
    }

    #[test]
    fn what_stands_says_the_gyros_bias() {
        let gyro = of(&flown_between(3.0, 0.0, ramps)).gyro.unwrap();
        for (mean, bias) in gyro.mean_rad_s.iter().zip([0.01, -0.02, 0.005]) {
            assert!((mean - bias).abs() < 1e-3, "{mean} {bias}");
        }
        assert!(gyro.std_error_rad_s[0] < 1e-3);
    }

    /// Idle at three quarters of the command of a hover: the thrust of the command alone is 0.56 of the weight.
    #[test]
    fn a_fast_idle_of_motors_without_a_map_is_standing() {
        let mut vehicle = truth().vehicle;
        vehicle.motors.map = Some(model::MotorMapKind::Identify);
        (vehicle.motors.command, vehicle.motors.voltage, vehicle.motors.offset) = (None, None, None);
        let idle = flown_between(3.0, 0.0, |_, row| row.command = [1200.0; 4]);
        let found = airborne(&idle, &vehicle);
        assert_eq!(found.left_out.len(), 1, "{:?}", found.left_out);
        assert!((2.9..3.4).contains(&found.left_out[0].to_s));
    }

    #[test]
    fn a_craft_that_is_carried_about_is_not_flown() {
        let found = of(&flown_between(4.0, 0.0, |to_air_s, row| {
            row.command = [1050.0; 4];
            row.position_ned_m[0] += 0.5 * to_air_s;
            row.position_ned_m[2] += 0.3 * (2.0 * to_air_s).sin();
        }));
        assert_eq!(found.left_out.len(), 1, "{:?}", found.left_out);
        assert_eq!((found.left_out[0].from_s, found.left_out[0].why), (0.0, Ground::Carried));
        assert!((3.9..4.4).contains(&found.left_out[0].to_s) && found.gyro.is_none());
    }

    /// Motors off in the air for half a second: nothing carries it.
    #[test]
    fn a_fall_with_motors_off_is_flown() {
        let found = of(&flight(1000, |t, row| {
            let fallen_s = (t - 5.0).clamp(0.0, 0.5);
            row.position_ned_m = [t.sin(), 0.0, -3.0 + 4.905 * fallen_s * fallen_s];
            if t > 5.5 {
                row.position_ned_m[2] += 4.905 * (t - 5.5);
            }
            if (5.0..5.5).contains(&t) {
                row.command = [1050.0; 4];
            }
        }));
        assert_eq!(found.left_out, []);
    }

    #[test]
    fn a_crash_is_left_out_from_where_the_craft_was_last_upright() {
        let found = of(&flown_between(0.0, 5.0, |down_s, row| {
            row.euler_rad[0] = (4.0 * down_s).min(3.0);
            row.position_ned_m[2] += (4.905 * down_s * down_s).min(4.9);
            row.command = [1050.0; 4];
        }));
        let [(from, to, why)] = times(&found)[..] else { panic!("{:?}", found.left_out) };
        assert_eq!(why, Ground::Tumbling);
        assert!((9.7..10.4).contains(&from) && to > 14.9, "{from} {to}");
    }

    /// It touches the floor, hops 7 cm with the thrust of a hover for one and a half seconds, and stands. The wave is as low for half a
    /// second before.
    #[test]
    fn a_landing_that_bounces_ends_the_flight_with_the_first_touch() {
        let bounces = |after_s: f64, row: &mut Row| {
            let map = truth().vehicle.rotor_map();
            if after_s < 1.5 {
                row.position_ned_m[2] -= 0.07 * (std::f64::consts::PI * after_s / 1.5).sin();
                row.command = [map.command_for(600.0, row.battery_v); 4];
                row.rate_rad_s[0] += (3.0 * after_s).sin();
            } else {
                ramps(after_s - 1.5, row);
            }
        };
        let found = times(&of(&flown_between(0.0, 5.0, bounces)));
        assert!(
            matches!(found[..], [(from_s, to_s, Ground::Standing)] if (9.0..10.3).contains(&from_s) && to_s > 14.9),
            "{found:?}"
        );
    }

    #[test]
    fn a_hop_between_two_landings_is_none() {
        let mut why = vec![None; 40];
        why[5..15].fill(Some(Ground::Standing));
        why[20..40].fill(Some(Ground::Standing));
        close_hops(&mut why);
        assert!(why.iter().all(Option::is_some));
        let mut long = vec![None; 40];
        long[0..15].fill(Some(Ground::Standing));
        long[30..40].fill(Some(Ground::Standing));
        let before = long.clone();
        close_hops(&mut long);
        assert_eq!(long, before);
    }
}
