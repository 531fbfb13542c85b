//! Quantities into flights: airborne parts on one time grid.
//!
//! The grid is the times of the body rates (of the attitude where there are no rates, of the position without both) where they
//! come at 125 Hz or slower, and even steps of 10 ms where they are faster. Faster signals are averaged over a step, slower ones
//! run along cubic arcs, commands are held. Nothing is filled in across gaps.

mod parts;
mod resampling;

use flights::{Column, Flight, GAP_PERIODS, median_step};
use model::frames;
use nalgebra::Vector4;

use crate::conversion::resampling::{Grid, Kind, resampled};
use crate::recording::{Recording, Signal, Signals, Span};
use crate::sources::OwnFlight;
use crate::spans::{any_between, both, joined, within};

/// Logs faster than this are brought down to 100 Hz, the rate that flight files have.
const FASTEST_HZ: f64 = 125.0;
const STEP_S: f64 = 0.01;

/// A flight cut out of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The flight; its times start at zero.
    pub flight: Flight,
    /// First and last time on the log's clock, s.
    pub span: Span,
    /// Rows a second.
    pub rate_hz: f64,
    /// Time without rows within the span, s.
    pub lost_s: f64,
    /// What was left out within the span, and why.
    pub cuts: Vec<Cut>,
}

/// A stretch of a flight of which something was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cut {
    /// First and last moment on the log's clock, s.
    pub span: Span,
    /// Why, which says what.
    pub why: Cause,
}

/// Why something of a flight was left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cause {
    /// Rows: the log has none for more than 3.5 periods.
    Gap,
    /// Rows: the craft said that it could not write.
    Dropout,
    /// Position and velocity: the estimator was not sure of them, or they jumped.
    Position,
    /// Attitude: the same.
    Attitude,
}

/// The flights of a recording, still without names; and what was left out, a sentence each.
pub fn convert(recording: &Recording) -> (Vec<Part>, Vec<String>) {
    let mut notes = Vec::new();
    let Some(base) = base_times(&recording.signals) else {
        return (
            Vec::new(),
            vec!["neither rates nor attitude nor position: no flight can be made of it".into()],
        );
    };
    let log = [base[0], base[base.len() - 1]];
    let spans = parts::airborne(&recording.airborne, log);
    let mut made = Vec::new();
    for span in &spans {
        match part(recording, base, *span) {
            Some(part) => made.push(part),
            None => notes.push(format!(
                "{:.1} to {:.1} s: under {} s of rows, left out",
                span[0],
                span[1],
                parts::SHORTEST_S
            )),
        }
    }
    (made, notes)
}

/// The times that the grid is made of.
fn base_times(signals: &Signals) -> Option<&[f64]> {
    let candidates = [
        signals.rates.as_ref().map(|s| &s.t),
        signals.attitude.as_ref().map(|s| &s.t),
        signals.position.as_ref().map(|s| &s.t),
    ];
    candidates.into_iter().flatten().find(|t| t.len() > 1).map(Vec::as_slice)
}

fn part(recording: &Recording, base: &[f64], span: Span) -> Option<Part> {
    let own: Vec<f64> = base.iter().copied().filter(|t| (span[0]..=span[1]).contains(t)).collect();
    let (first, last) = (*own.first()?, *own.last()?);
    let own_period_s = median_step(&own);
    let even = own_period_s < 1.0 / FASTEST_HZ;
    let period_s = if even { STEP_S } else { own_period_s };
    if !(last - first >= parts::SHORTEST_S && period_s > 0.0) {
        return None;
    }
    let shortest_s = GAP_PERIODS * period_s;
    let dropouts = joined(recording.dropouts.iter().map(|dropout| at_least(*dropout, shortest_s)).collect());
    let t = if even { even_steps(&own, shortest_s) } else { own };
    let grid = Grid { t: &t, period_s, dropouts: &dropouts };
    let columns = columns(recording, &grid);
    let mut keep = rows_to_keep(&columns, &within(&t, &dropouts));
    keep_rising(&t, &mut keep);
    let kept: Vec<f64> = t.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(t, _)| *t).collect();
    let (first, last) = (*kept.first()?, *kept.last()?);
    if last - first < parts::SHORTEST_S {
        return None;
    }
    let time = kept.iter().map(|t| microseconds(t - first)).collect();
    let of_rows = |values: &[f64]| -> Vec<f64> {
        values.iter().zip(&keep).filter(|(_, keep)| **keep).map(|(value, _)| rounded(*value)).collect()
    };
    let rest = columns.into_iter().map(|(column, values)| (column, of_rows(&values)));
    let mut flight = Flight::from_columns("", std::iter::once((Column::T, time)).chain(rest));
    for (name, signal) in &recording.signals.extra {
        let values = &on_grid(signal, &grid, Kind::Smooth)[0];
        if values.iter().any(|value| value.is_finite()) {
            flight = flight.with_further(name.clone(), of_rows(values));
        }
    }
    let mut part = Part::of(flight, &kept, period_s, &dropouts);
    part.add_cuts(&recording.untrusted, Cause::Position);
    part.add_cuts(&recording.untrusted_attitude, Cause::Attitude);
    Some(part)
}

/// Even steps from the first time to the last, without those further than `reach_s` from any: a clock that jumps by an hour
/// costs no rows.
fn even_steps(times: &[f64], reach_s: f64) -> Vec<f64> {
    let (first, last) = (times[0], times[times.len() - 1]);
    let step_at = |t: f64| (t.clamp(first, last) - first) / STEP_S;
    let mut steps = Vec::new();
    let mut next = 0;
    for t in times {
        let from = step_at(t - reach_s).ceil() as usize;
        let to = step_at(t + reach_s).floor() as usize;
        steps.extend((from.max(next)..=to).map(|k| first + k as f64 * STEP_S));
        next = next.max(to + 1);
    }
    steps
}

/// A span of at least so many seconds about the same middle: fewer lost rows would be filled in like any that are missing.
fn at_least([from, to]: Span, shortest_s: f64) -> Span {
    let wider_s = (0.5 * (shortest_s - (to - from))).max(0.0);
    [from - wider_s, to + wider_s]
}

impl Part {
    /// The flight of rows at these times on the log's clock, s.
    fn of(flight: Flight, t: &[f64], period_s: f64, dropouts: &[Span]) -> Self {
        let steps = || t.windows(2).map(|w| [w[0], w[1]]);
        let lost_s = steps().map(|[from, to]| to - from).filter(|step| *step > 1.5 * period_s).sum::<f64>();
        let gaps = steps().filter(|[from, to]| to - from > GAP_PERIODS * period_s);
        let cuts = gaps.map(|span| {
            let is_dropout = any_between(dropouts, span[0], span[1]);
            Cut { span, why: if is_dropout { Cause::Dropout } else { Cause::Gap } }
        });
        let span = [t[0], t[t.len() - 1]];
        Self { flight, span, rate_hz: 1.0 / period_s, lost_s, cuts: cuts.collect() }
    }

    /// What of it lies in spans in order was left out.
    fn add_cuts(&mut self, spans: &[Span], why: Cause) {
        self.cuts.extend(both(spans, &[self.span]).into_iter().map(|span| Cut { span, why }));
    }

    /// A flight of quadlab's own recording: rows as they are, where they are.
    pub(crate) fn of_own(own: OwnFlight) -> Self {
        let OwnFlight { flight, start_s } = own;
        let t: Vec<f64> = flight.required(Column::T).iter().map(|t| start_s + t).collect();
        Self::of_rows(flight, &t)
    }

    /// A flight that needs no grid: its rows at these times are as they were logged.
    pub(crate) fn of_rows(flight: Flight, t: &[f64]) -> Self {
        Self::of(flight, t, median_step(t), &[])
    }
}

/// A row outside of dropouts is kept that has the first of what there is of rates, attitude, position, and motors: gaps are gaps in time.
fn rows_to_keep(columns: &[(Column, Vec<f64>)], lost: &[bool]) -> Vec<bool> {
    let needed = |names: &[Column]| columns.iter().find(|(column, _)| names.contains(column)).map(|(_, v)| v);
    let state = needed(&[Column::P]).or_else(|| needed(&[Column::Phi])).or_else(|| needed(&[Column::X]));
    let motor = needed(&[Column::Cmd1, Column::Omega1]);
    let there = |values: Option<&Vec<f64>>, row: usize| values.is_none_or(|values| values[row].is_finite());
    lost.iter().enumerate().map(|(row, lost)| !lost && there(state, row) && there(motor, row)).collect()
}

/// Times are written in microseconds: of rows that are closer, the first is kept.
fn keep_rising(t: &[f64], keep: &mut [bool]) {
    let Some(first) = t.iter().zip(keep.iter()).find_map(|(t, keep)| keep.then_some(*t)) else { return };
    let mut last = f64::NEG_INFINITY;
    for (t, keep) in t.iter().zip(keep).filter(|(_, keep)| **keep) {
        let time = microseconds(t - first);
        *keep = time > last;
        last = last.max(time);
    }
}

fn columns(recording: &Recording, grid: &Grid<'_>) -> Vec<(Column, Vec<f64>)> {
    use Column::*;
    let signals = &recording.signals;
    let mut all = Vec::new();
    let mut add = |names: &[Column], values: Vec<Vec<f64>>| all.extend(names.iter().copied().zip(values));
    let outside = |spans: &[Span], mut values: Vec<Vec<f64>>| {
        for (row, _) in within(grid.t, spans).iter().enumerate().filter(|(_, inside)| **inside) {
            values.iter_mut().for_each(|column| column[row] = f64::NAN);
        }
        values
    };
    let trusted = |values| outside(&recording.untrusted, values);
    if let Some(position) = &signals.position {
        add(&[X, Y, Z], trusted(on_grid(position, grid, Kind::Smooth)));
    }
    if let Some(attitude) = &signals.attitude {
        let angles = euler(&on_grid(attitude, grid, Kind::Smooth));
        add(&[Phi, Theta, Psi], outside(&recording.untrusted_attitude, angles));
    }
    if let Some(rates) = &signals.rates {
        add(&[P, Q, R], on_grid(rates, grid, Kind::Smooth));
    }
    if let Some(commands) = &signals.commands {
        add(&[Cmd1, Cmd2, Cmd3, Cmd4], on_grid(commands, grid, Kind::Held));
    }
    if let Some(voltage) = &signals.voltage {
        add(&[Vbat], on_grid(voltage, grid, Kind::Slow));
    }
    if let Some(speeds) = &signals.rotor_speed
        && is_fast_enough(speeds, grid)
    {
        add(&[Omega1, Omega2, Omega3, Omega4], on_grid(speeds, grid, Kind::Smooth));
    }
    if let Some(force) = &signals.specific_force {
        add(&[Ax, Ay, Az], on_grid(force, grid, Kind::Smooth));
    }
    if let Some(velocity) = &signals.velocity {
        add(&[Vx, Vy, Vz], trusted(on_grid(velocity, grid, Kind::Smooth)));
    }
    // A column without a value was not logged.
    all.retain(|(_, values)| values.iter().any(|value| value.is_finite()));
    all
}

/// Rotor speeds that come at less than half of the rows would stand in for what they do not show.
fn is_fast_enough(speeds: &Signal<4>, grid: &Grid<'_>) -> bool {
    median_step(&speeds.t) < 2.0 * grid.period_s
}

fn on_grid<const N: usize>(signal: &Signal<N>, grid: &Grid<'_>, kind: Kind) -> Vec<Vec<f64>> {
    signal.values.iter().map(|values| resampled(&signal.t, values, grid, kind)).collect()
}

/// Euler angles of quaternions whose components were resampled one by one.
fn euler(quaternion: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut angles = vec![Vec::new(); 3];
    let [w, x, y, z] = quaternion else { return angles };
    for (((w, x), y), z) in w.iter().zip(x).zip(y).zip(z) {
        let q = Vector4::new(*w, *x, *y, *z);
        let euler = frames::euler_from_quaternion(&q.normalize());
        angles.iter_mut().zip(euler.iter()).for_each(|(angle, value)| angle.push(*value));
    }
    angles
}

fn microseconds(time_s: f64) -> f64 {
    (time_s * 1e6).round() / 1e6
}

/// Nine digits: more than any sensor tells, and a file of half the size.
fn rounded(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10_f64.powf(8.0 - value.abs().log10().floor());
    if scale.is_finite() { (value * scale).round() / scale } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signal<const N: usize>(rate_hz: f64, seconds: f64, value: impl Fn(f64) -> [f64; N]) -> Signal<N> {
        let t: Vec<f64> = (0..(rate_hz * seconds) as usize).map(|k| 100.0 + k as f64 / rate_hz).collect();
        let values = std::array::from_fn(|i| t.iter().map(|t| value(*t)[i]).collect());
        Signal { source: "test".into(), t, values }
    }

    fn recording(rate_hz: f64) -> Recording {
        let signals = Signals {
            position: Some(signal(10.0, 20.0, |t| [t, 0.0, -1.0])),
            attitude: Some(signal(20.0, 20.0, |_| [1.0, 0.0, 0.0, 0.0])),
            rates: Some(signal(rate_hz, 20.0, |_| [0.1, 0.2, 0.3])),
            commands: Some(signal(10.0, 20.0, |_| [0.5; 4])),
            rotor_speed: Some(signal(4.0, 20.0, |_| [500.0; 4])),
            ..Signals::default()
        };
        Recording { signals, ..Recording::default() }
    }

    #[test]
    fn rates_at_a_hundred_hertz_or_less_keep_their_times_and_faster_ones_come_down() {
        for (logged_hz, rate_hz) in
            [(50.0, 50.0), (100.0, 100.0), (120.0, 120.0), (250.0, 100.0), (1000.0, 100.0)]
        {
            let (parts, notes) = convert(&recording(logged_hz));
            assert_eq!((parts.len(), notes.len()), (1, 0));
            assert!((parts[0].rate_hz - rate_hz).abs() < 1e-6, "{logged_hz}: {}", parts[0].rate_hz);
            assert_eq!(parts[0].flight.column(Column::P).unwrap()[10], 0.1);
            let [x, t] = [Column::X, Column::T].map(|column| parts[0].flight.column(column).unwrap()[400]);
            assert!((x - t - parts[0].span[0]).abs() < 1e-6, "{x} at {t} s after {}", parts[0].span[0]);
        }
    }

    /// As a clock that jumps, or a damaged time.
    #[test]
    fn an_hour_without_rows_costs_no_rows() {
        let mut jumping = recording(1000.0);
        let later = |t: &mut f64| *t += if *t > 110.0 { 3600.0 } else { 0.0 };
        let Signals { rates, commands, .. } = &mut jumping.signals;
        rates.iter_mut().flat_map(|signal| &mut signal.t).for_each(later);
        commands.iter_mut().flat_map(|signal| &mut signal.t).for_each(later);
        let own = &jumping.signals.rates.as_ref().unwrap().t;
        let steps = even_steps(own, GAP_PERIODS * STEP_S);
        assert!((1990..2020).contains(&steps.len()), "{}", steps.len());
        assert!(steps.windows(2).all(|pair| pair[0] < pair[1]));
        let (parts, _) = convert(&jumping);
        assert!((parts[0].lost_s - 3600.0).abs() < 0.2, "{}", parts[0].lost_s);
        assert_eq!(parts[0].cuts.len(), 1);
        let [rows, without] = [&parts, &convert(&recording(1000.0)).0].map(|parts| parts[0].flight.len());
        assert!(rows <= without && without - rows < 15, "{rows}, {without} without the jump");
    }

    /// Stamps in nanoseconds can be closer than the microseconds of a flight file.
    #[test]
    fn times_rise_in_microseconds() {
        let mut close = recording(50.0);
        let rates = close.signals.rates.as_mut().unwrap();
        rates.t[500] = rates.t[499] + 1e-7;
        let (parts, _) = convert(&close);
        let t = parts[0].flight.column(Column::T).unwrap();
        assert_eq!(t.len(), 999);
        assert!(t.windows(2).all(|pair| pair[0] < pair[1]));
    }

    /// Four values a second do not say how fast a rotor turned between them.
    #[test]
    fn slow_rotor_speeds_do_not_stand_in_for_fast_ones() {
        let (parts, _) = convert(&recording(50.0));
        assert_eq!(parts[0].flight.column(Column::Omega1), None);
    }

    #[test]
    fn each_part_in_the_air_is_a_flight_and_a_hop_is_none() {
        let airborne = vec![[102.0, 108.0], [110.0, 110.5], [112.0, 119.0]];
        let (parts, notes) = convert(&Recording { airborne, ..recording(100.0) });
        assert_eq!(parts.len(), 2);
        assert_eq!(parts[1].span[0], 112.0);
        assert_eq!(notes, ["110.0 to 110.5 s: under 2 s of rows, left out"]);
        assert_eq!(parts[1].flight.column(Column::T).unwrap()[0], 0.0);
    }

    #[test]
    fn what_the_estimator_was_not_sure_of_is_missing() {
        let untrusted = vec![[104.0, 104.1]];
        let (parts, _) = convert(&Recording { untrusted, ..recording(100.0) });
        let x = parts[0].flight.column(Column::X).unwrap();
        let missing = x[..1900].iter().filter(|x| x.is_nan()).count();
        assert_eq!(missing, 11);
        assert!(parts[0].flight.column(Column::P).unwrap().iter().all(|p| p.is_finite()));
    }

    /// 20 ms are less than a gap at 100 Hz: they are cut as one all the same, and said.
    #[test]
    fn a_dropout_is_cut_out_however_short_it_is() {
        let dropouts = vec![[104.003, 104.023], [110.0, 111.0], [300.0, 301.0]];
        for rate_hz in [50.0, 100.0, 1000.0] {
            let (parts, _) = convert(&Recording { dropouts: dropouts.clone(), ..recording(rate_hz) });
            let [part] = &parts[..] else { panic!("{} parts", parts.len()) };
            let t: Vec<f64> = part.flight.required(Column::T).iter().map(|t| t + part.span[0]).collect();
            for dropout in &dropouts {
                assert!(!t.iter().any(|t| (dropout[0]..=dropout[1]).contains(t)), "{rate_hz}: {dropout:?}");
            }
            let [short, long] = &part.cuts[..] else { panic!("{rate_hz}: {:?}", part.cuts) };
            assert!(short.why == Cause::Dropout && long.why == Cause::Dropout);
            assert!(short.span[1] - short.span[0] > GAP_PERIODS / part.rate_hz, "{short:?}");
            assert!(
                (short.span[0] - 104.0).abs() < 0.05 && (long.span[1] - 111.0).abs() < 0.03,
                "{:?}",
                part.cuts
            );
            let cut_s: f64 = part.cuts.iter().map(|cut| cut.span[1] - cut.span[0]).sum();
            assert!((part.lost_s - cut_s).abs() < 1e-9);
        }
    }

    #[test]
    fn an_attitude_that_jumps_is_missing_and_the_rates_are_not() {
        let untrusted_attitude = vec![[104.0, 104.1]];
        let (parts, _) = convert(&Recording { untrusted_attitude, ..recording(100.0) });
        let missing = |column| parts[0].flight.column(column).unwrap().iter().filter(|v| v.is_nan()).count();
        // The last rows of the slower attitude have no neighbour to run on to.
        assert_eq!(
            parts[0].flight.column(Column::Phi).unwrap()[..1900].iter().filter(|v| v.is_nan()).count(),
            11
        );
        assert_eq!((missing(Column::P), missing(Column::Cmd1)), (0, 0));
        assert_eq!(parts[0].cuts, [Cut { span: [104.0, 104.1], why: Cause::Attitude }]);
    }

    #[test]
    fn nine_digits_are_kept_of_any_size() {
        assert_eq!(rounded(123.456_789_123_4), 123.456_789);
        assert_eq!(rounded(-0.000_012_345_678_912_3), -0.000_012_345_678_9);
        assert_eq!((rounded(0.0), rounded(5.0)), (0.0, 5.0));
    }
}
