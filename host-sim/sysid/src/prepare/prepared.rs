//! From a flight as logged to even stretches of samples that a regression can use (4.2.3 to 4.2.5).
//!
//! What is done, in order:
//! 1. Gross outliers become missing values (`outliers.rs`). The log is cut into stretches without
//!    gaps; jitter is taken out by interpolation to an even grid; single missing values are
//!    bridged. What was done is counted in [`Prepared::notes`].
//! 2. Angles are unwrapped. The gyro's bias is taken out: its mean difference from the rates of the
//!    tracked attitude (the low frequencies of (4.6); the gyro keeps the rest). So is an
//!    accelerometer's, against an estimator's velocity.
//! 3. Rotor speeds: logged ones, or the motor map (4.10) at the smoothed battery voltage, then the
//!    first-order lag, exactly for commands held over a sample. The voltage is freed from noise in
//!    `battery.rs`; the causal filter of 4.2.5 would be half a second late against the load that
//!    makes the voltage sag.
//!
//! What the rows are made of is in `rows.rs`.

use std::ops::Range;

use model::Vehicle;
use nalgebra::Vector3;

use crate::filter::RegressionFilter;
use crate::prepare::battery;
use crate::prepare::biases::{StandingGyro, remove_accelerometer_bias, remove_gyro_bias};
use crate::prepare::channels::Channels;
use crate::prepare::corrections::{Alignment, Trim};
use crate::prepare::dead_reckoning::carry_velocity;
use crate::prepare::error::PrepareError;
use crate::prepare::further;
use crate::prepare::grid::{bridge, even_grid, unbroken};
use crate::prepare::outliers::Outlier;
use crate::prepare::stretch::{Stretch, smoothed};
use flights::{Column, Flight, StandIn, UNKNOWN_VOLTAGE_V, median_step};

/// Where the force rows' targets come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForceTarget {
    /// Specific force of the IMU.
    Imu,
    /// Derivative of the logged velocity.
    Velocity,
    /// Second derivative of the position.
    Position,
}

const SPECIFIC_FORCE: [Column; 3] = [Column::Ax, Column::Ay, Column::Az];
const VELOCITY: [Column; 3] = [Column::Vx, Column::Vy, Column::Vz];

impl ForceTarget {
    /// The one that needs the fewest derivatives of what the flight logged.
    fn of(flight: &Flight) -> Self {
        if flight.group(SPECIFIC_FORCE).is_some() {
            Self::Imu
        } else if flight.group(VELOCITY).is_some() {
            Self::Velocity
        } else {
            Self::Position
        }
    }

    /// Windows of the filter on either side of a row: differentiating the position twice takes two.
    const fn windows(self) -> usize {
        match self {
            ForceTarget::Position => 2,
            ForceTarget::Imu | ForceTarget::Velocity => 1,
        }
    }

    /// For people.
    pub const fn name(self) -> &'static str {
        match self {
            ForceTarget::Imu => "IMU specific force",
            ForceTarget::Velocity => "derivative of the logged velocity",
            ForceTarget::Position => "second derivative of the position",
        }
    }
}

/// A flight made ready for regression.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// File name.
    pub name: String,
    /// Sampling period, s.
    pub period_s: f64,
    /// Where the force rows' targets come from.
    pub force_target: ForceTarget,
    /// Whether positions, velocities and attitudes are an estimator's output rather than raw
    /// tracking.
    pub has_logged_velocity: bool,
    /// Whether the log says where the craft is; without, its speed is known for seconds at a time at best.
    pub has_position: bool,
    /// Whether the battery voltage was logged; without, it is a constant.
    pub has_voltage: bool,
    /// Whether the motor commands were logged; without, the rotor speeds stand in for them.
    pub has_commands: bool,
    /// Gyro bias found and taken out, rad/s.
    pub gyro_bias_rad_s: [f64; 3],
    /// Accelerometer bias along x and y found and taken out, m/s^2; zero without an accelerometer
    /// and for raw tracking.
    pub accelerometer_bias_m_s2: [f64; 2],
    /// What was mended or left out, for people.
    pub notes: Vec<String>,
    /// Values that were taken for gross outliers and replaced.
    pub outliers: Vec<Outlier>,
    /// Whether columns of the log were interpolated from a lower rate, which looks like time gained or lost.
    pub is_interpolated: bool,
    /// Whether the rates were derived from the attitude and smoothed.
    pub has_derived_rates: bool,
    /// The clock of the rotor samples against that of the state, where it was looked at.
    pub alignment: Option<Alignment>,
    /// Constant part of the targets that belongs to this flight and not to the craft; m/s^2,
    /// rad/s^2.
    pub trim: Option<Trim>,
    /// Wind of this flight beside that of the model, north, east, down, m/s; zero where none was looked for.
    pub wind_ned_m_s: Vector3<f64>,
    /// Standard deviation of the log's times about an even grid, s.
    pub jitter_s: f64,
    /// Stretches without gaps, in order.
    pub stretches: Vec<Stretch>,
    /// Smooths and differentiates signals at rows.
    pub filter: RegressionFilter,
    /// Samples at the ends of a stretch that give no rows.
    pub margin: usize,
}

impl Prepared {
    /// Prepares a flight of `vehicle`. Errors are a sentence for people; the caller names the file.
    pub fn new(flight: &Flight, vehicle: &Vehicle) -> Result<Self, PrepareError> {
        Self::with_standing(flight, vehicle, None)
    }

    /// Prepares a flight of a craft whose gyro was seen standing as well.
    pub(crate) fn with_standing(
        flight: &Flight,
        vehicle: &Vehicle,
        standing: Option<StandingGyro>,
    ) -> Result<Self, PrepareError> {
        let t = flight.required(Column::T);
        let period_s = rounded_period(median_step(t));
        let filter = RegressionFilter::new(period_s);
        let force_target = ForceTarget::of(flight);
        let has_logged_velocity = flight.group(VELOCITY).is_some();
        let margin = force_target.windows() * filter.half();
        let mut notes = Vec::new();
        let mut channels = Channels::new(flight, force_target == ForceTarget::Imu, has_logged_velocity);
        channels.take_out_spikes(t, period_s);
        note_spikes(channels.outliers.len(), &mut notes);
        let outliers = channels.outliers.clone();
        if channels.rotor.is_none() && !vehicle.can_map_commands() {
            return Err(PrepareError::NoRotorSpeeds);
        }
        let (mut stretches, jitter_s) = even_stretches(channels, t, period_s, &filter, margin, &mut notes)?;
        further::put(&mut stretches, flight, t);
        let lacks = |what: StandIn| flight.stand_ins().contains(&what);
        let has_voltage = !lacks(StandIn::ConstantVoltage);
        steady_voltage(&mut stretches, has_voltage, vehicle, period_s);
        let gyro_bias_rad_s = remove_gyro_bias(&mut stretches, &filter, standing, &mut notes);
        let accelerometer_bias_m_s2 = if has_logged_velocity {
            remove_accelerometer_bias(&mut stretches, &filter, vehicle.gravity)
        } else {
            [0.0; 2]
        };
        let has_position = !flight.stand_ins().iter().any(|what| what.hides_speed());
        if !has_position && !has_logged_velocity {
            carry_velocity(&mut stretches, !lacks(StandIn::NoPosition), vehicle.gravity, period_s);
        }
        notes.dedup();
        Ok(Self {
            name: flight.name.clone(),
            period_s,
            force_target,
            has_logged_velocity,
            has_position,
            has_voltage,
            has_commands: !lacks(StandIn::RotorSpeeds),
            gyro_bias_rad_s,
            accelerometer_bias_m_s2,
            notes,
            outliers,
            is_interpolated: false,
            has_derived_rates: false,
            alignment: None,
            trim: None,
            wind_ned_m_s: Vector3::zeros(),
            jitter_s,
            stretches,
            filter,
            margin,
        })
    }

    /// The same flight with rows through another window of the filter, s, which leaves out what is quicker. Stretches that it does not fit in are
    /// left out; nothing where none is long enough.
    pub fn through_window(&self, window_s: f64) -> Option<Self> {
        let filter = RegressionFilter::with_window(self.period_s, window_s);
        let margin = self.force_target.windows() * filter.half();
        let shortest = filter.shortest_stretch(margin);
        let is_long = |stretch: &&Stretch| stretch.time_s.len() >= shortest;
        let stretches: Vec<Stretch> = self.stretches.iter().filter(is_long).cloned().collect();
        (!stretches.is_empty()).then(|| Self { stretches, filter, margin, ..self.without_stretches() })
    }

    /// All but the samples.
    pub fn without_stretches(&self) -> Self {
        Self {
            name: self.name.clone(),
            notes: self.notes.clone(),
            outliers: self.outliers.clone(),
            alignment: self.alignment.clone(),
            stretches: Vec::new(),
            filter: self.filter.clone(),
            ..*self
        }
    }

    /// Rows the flight gives.
    pub fn rows(&self) -> usize {
        self.stretches.iter().map(|s| s.time_s.len() - 2 * self.margin).sum()
    }

    /// Whether it has a constant wind of its own.
    pub fn has_own_wind(&self) -> bool {
        self.wind_ned_m_s != Vector3::zeros()
    }

    /// Whether it has a wind that wanders.
    pub fn has_gusts(&self) -> bool {
        self.stretches.iter().any(|s| s.gust_ned_m_s.is_some())
    }

    /// Whether rotor speeds were measured, rather than computed from commands.
    pub fn has_rotor_speeds(&self) -> bool {
        self.stretches.iter().any(|s| s.logged_rotor_rad_s.is_some())
    }

    /// By how much the rotor samples (measured speeds or commands) come late against the state, s,
    /// where it is corrected.
    pub fn rotor_late_s(&self) -> f64 {
        self.alignment.as_ref().map_or(0.0, Alignment::corrected_s)
    }

    /// Mean battery voltage, V.
    pub fn mean_battery_v(&self) -> f64 {
        let (sum, count) = self
            .stretches
            .iter()
            .fold((0.0, 0), |(sum, n), s| (sum + s.battery_v.iter().sum::<f64>(), n + s.battery_v.len()));
        sum / count as f64
    }

    /// Rows at which stretches begin: neighbours across these are not neighbours in time.
    pub fn row_starts(&self) -> Vec<usize> {
        self.starts_of_rows(1)
    }

    /// Signals without their high frequencies; as they are at the ends, where the window does not
    /// fit.
    pub fn smooth(&self, signals: &[Vec<f64>; 3]) -> [Vec<f64>; 3] {
        signals.each_ref().map(|signal| smoothed(signal, &self.filter.smooth))
    }
}

/// Smooths the battery voltage, or makes it the constant that it stands for where it was not logged.
fn steady_voltage(stretches: &mut [Stretch], was_logged: bool, vehicle: &Vehicle, period_s: f64) {
    if was_logged {
        battery::steady(stretches, vehicle, period_s);
    } else {
        // Interpolation rounds, and whatever varies is tested.
        stretches.iter_mut().for_each(|stretch| stretch.battery_v.fill(UNKNOWN_VOLTAGE_V));
    }
}

fn note_spikes(spikes: usize, notes: &mut Vec<String>) {
    if spikes > 0 {
        let plural = if spikes == 1 { "" } else { "s" };
        notes.push(format!("{spikes} outlier{plural} removed"));
    }
}

/// Stretches without gaps that are long enough to give rows, on even grids; and the standard
/// deviation of the log's times about them, s.
fn even_stretches(
    mut channels: Channels,
    t: &[f64],
    period_s: f64,
    filter: &RegressionFilter,
    margin: usize,
    notes: &mut Vec<String>,
) -> Result<(Vec<Stretch>, f64), PrepareError> {
    let shortest = filter.shortest_stretch(margin);
    let measured = channels.measured();
    let bridged = bridge(t, &mut channels.columns, period_s);
    if bridged > 0 {
        notes.push(format!("{bridged} single missing values bridged"));
    }
    let columns = &channels.columns;
    let (mut stretches, mut dropped, mut jitter_s) = (Vec::new(), 0, 0.0);
    for range in unbroken(t, columns, period_s) {
        if range.len() < shortest {
            dropped += range.len();
            continue;
        }
        let even = even_grid(t, columns, &measured, range.clone(), period_s, notes);
        jitter_s = f64::max(jitter_s, even.jitter_s);
        let mut stretch = channels.stretch(even, period_s, filter);
        stretch.outliers = channels.outliers.iter().filter_map(|o| in_stretch(o, &range, &stretch)).collect();
        stretches.push(stretch);
    }
    if dropped > 0 {
        let shortest_s = shortest as f64 * period_s;
        notes.push(format!("{dropped} samples in stretches under {shortest_s:.1} s left out"));
    }
    if stretches.is_empty() {
        let duration_s = t.last().unwrap_or(&0.0) - t.first().unwrap_or(&0.0);
        let needed_s = shortest as f64 * period_s;
        return Err(PrepareError::TooShort { samples: t.len(), duration_s, needed_s });
    }
    Ok((stretches, jitter_s))
}

/// An outlier of the log's rows as that of the sample next to it in time.
fn in_stretch(outlier: &Outlier, rows: &Range<usize>, stretch: &Stretch) -> Option<Outlier> {
    let after = stretch.time_s.partition_point(|t| *t < outlier.t_s).min(stretch.time_s.len() - 1);
    let before = after.saturating_sub(1);
    let nearer = (stretch.time_s[after] - outlier.t_s) < (outlier.t_s - stretch.time_s[before]);
    rows.contains(&outlier.row).then_some(Outlier { row: if nearer { after } else { before }, ..*outlier })
}

/// A period within 0.1 % of a whole number of tenths of a millisecond is that number: clocks tick
/// evenly.
fn rounded_period(period_s: f64) -> f64 {
    let rounded = (period_s * 1e4).round() / 1e4;
    if (rounded - period_s).abs() < 1e-3 * period_s { rounded } else { period_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A craft at rest for `count` samples at 100 Hz, with these columns besides.
    fn resting(count: usize, more: &[Column]) -> Flight {
        use Column::*;
        let required = [X, Y, Z, Phi, Theta, Psi, P, Q, R, Cmd1, Cmd2, Cmd3, Cmd4, Vbat];
        let value = |column| match column {
            Cmd1 | Cmd2 | Cmd3 | Cmd4 => 1500.0,
            Vbat => 11.5,
            Az => -9.81,
            _ => 0.0,
        };
        let t = (0..count).map(|k| 0.01 * k as f64).collect();
        let others = required.iter().chain(more).map(|&column| (column, vec![value(column); count]));
        Flight::from_columns("resting", std::iter::once((T, t)).chain(others))
    }

    /// The same, of which half a second is missing after 500 samples.
    fn resting_with_gap(count: usize) -> Flight {
        let mut flight = resting(count, &[]);
        let mut t = flight.required(Column::T).to_vec();
        t[500..].iter_mut().for_each(|t| *t += 0.5);
        flight.replace(Column::T, t);
        flight
    }

    fn prepared(flight: &Flight) -> Prepared {
        Prepared::new(flight, &Vehicle::thesis()).unwrap()
    }

    #[test]
    fn a_clock_that_ticks_evenly_has_a_round_period() {
        assert_eq!(rounded_period(0.010_000_4), 0.01);
        // 1/120 s is no whole number of tenths of a millisecond.
        assert_eq!(rounded_period(1.0 / 120.0), 1.0 / 120.0);
    }

    #[test]
    fn forces_come_from_what_needs_the_fewest_derivatives() {
        let target = |more: &[Column]| prepared(&resting(500, more)).force_target;
        assert_eq!(target(&[]), ForceTarget::Position);
        assert_eq!(target(&VELOCITY), ForceTarget::Velocity);
        assert_eq!(target(&[SPECIFIC_FORCE, VELOCITY].concat()), ForceTarget::Imu);
    }

    #[test]
    fn a_position_costs_twice_the_rows_of_a_velocity_at_the_ends() {
        let (position, velocity) = (prepared(&resting(500, &[])), prepared(&resting(500, &VELOCITY)));
        assert_eq!(position.margin, 2 * velocity.margin);
        assert_eq!(position.rows(), 500 - 2 * position.margin);
        assert_eq!(velocity.rows(), 500 - 2 * velocity.margin);
    }

    /// A window of 1 s reaches 50 samples to either side, twice for a position.
    #[test]
    fn another_window_leaves_out_what_it_does_not_fit_in() {
        let prepared = prepared(&resting_with_gap(800));
        let slow = prepared.through_window(1.0).unwrap();
        assert_eq!((slow.filter.smooth.len(), slow.margin), (101, 100));
        assert_eq!((prepared.stretches.len(), slow.stretches.len()), (2, 1));
        assert_eq!(slow.rows(), 500 - 2 * 100);
        assert!(prepared.through_window(10.0).is_none());
        let again = slow.through_window(RegressionFilter::WINDOW_S).unwrap();
        assert_eq!((again.filter, again.margin), (prepared.filter, prepared.margin));
    }

    #[test]
    fn a_gap_in_time_begins_a_new_stretch() {
        let lengths: Vec<usize> =
            prepared(&resting_with_gap(800)).stretches.iter().map(|s| s.time_s.len()).collect();
        assert_eq!(lengths, [500, 300]);
    }

    #[test]
    fn a_stretch_that_gives_no_row_is_left_out_and_noted() {
        let prepared = prepared(&resting_with_gap(520));
        assert_eq!(prepared.stretches.len(), 1);
        assert!(prepared.notes.iter().any(|note| note.starts_with("20 samples in stretches under ")));
    }

    #[test]
    fn a_flight_that_is_too_short_says_how_long_it_is() {
        let error = Prepared::new(&resting(21, &[]), &Vehicle::thesis()).unwrap_err();
        assert!(error.to_string().starts_with("has 21 samples over 0.20 s; at least "), "{error}");
    }
}
