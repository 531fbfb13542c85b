//! Real logs are not synchronous: the rotor samples of a flight come early or late against its state.
//!
//! Loggers gather channels from several processors, and each flight starts them anew: rotor speeds (or motor commands)
//! and the state they cause are apart by a time of their own in every flight, 0.2 to 3 samples in flights of small
//! craft. A regression that pairs the wrong samples shrinks motor coefficients and finds lags that no motor has.
//!
//! **Estimate.** One offset a flight, by Gauss and Newton's method: the residual's derivative with respect to a shift of
//! the rotor samples is one more column, which only this flight has. Training flights are solved together with all
//! linear coefficients, which they share, and with a constant of each flight in the rotor rows; a held-out flight by itself
//! with the coefficients as they are. Yaw is sharpest where rotor speeds were measured: the torque of the
//! rotors' own acceleration turns by a quarter period what the reaction torque does, so `rotor-inertia` (and
//! `flapping-moment`, which would otherwise lean on the motors) is fitted along for the alignment alone. Where commands
//! were logged, so is the lag of the rotors (`motor-lag`): one that the model has wrong delays slow motions more than quick
//! ones, and a flight that moves in another way than the others would seem to have another clock. There, the others are fitted
//! along only where the rotation is explained with them: a controller answers late what a model lacks, as if by the clock,
//! and where much is lacking, more columns do not help.
//!
//! **Clock or physics?** A measured rotor speed acts at once: any offset is a fault of the log's clock. A command acts
//! late for physical reasons, the same in every flight of the craft (`input-delay`, `motor-lag`): only what a flight
//! differs by from the others' median is its clock's. But no craft answers before its command: where all logs have them
//! late, that is the logger's. An offset is corrected when it is beyond [`crate::fit::clock_offset::SIGNIFICANT`] standard errors
//! and [`crate::fit::clock_offset::MATTERS_SAMPLES`]; else the flight stays as it is.
//!
//! **Wandering.** A clock may also run off within a flight. Offsets of pieces of [`PIECE_S`] that differ by more than
//! their errors say are named, not corrected: there is no constant to take out.

use std::ops::ControlFlow;

use model::{Axis, Effect, Kind, Model};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::fit::clock_offset::{Offset, Reference, are_of_loggers, correct, decide, put_right};
use crate::fit::gauss_newton::{self, Linearised, Problem, Rule};
use crate::fit::least_squares::RowColumn;
use crate::fit::least_squares::{self, FlightRows, Solution, Unidentifiable};
use crate::fit::linearise::{About, residuals_at_rows};
use crate::fit::low_frequency::{Estimate, at_low_frequency, unless_contradicted};
use crate::fit::parameters::{step_end, store};
use crate::fit::residuals::errors;
use crate::fit::rotation::has_rotation;
use crate::fit::swing::Known;
use crate::prepare::{PieceOffset, Prepared};
use crate::statistics::median;

/// Length of the pieces of a flight whose offsets are compared, s.
pub const PIECE_S: f64 = 8.0;
/// Fewest pieces that say something about wandering.
const FEWEST_PIECES: usize = 3;
/// Largest p-value of "the clock does not wander".
const WANDERING_SIGNIFICANCE: f64 = 1e-4;
/// Pieces must scatter by this many samples (root mean square) for a wandering clock to matter.
const WANDERING_SAMPLES: f64 = 0.5;
/// Most steps; from no offset to three samples takes four.
const MAX_STEPS: usize = 12;
/// A step this small is the last, samples.
const CONVERGED_SAMPLES: f64 = 0.01;
/// Longest step, samples: the derivative says little about what is further away.
const LONGEST_STEP_SAMPLES: f64 = 1.5;
/// Offsets that are looked for, samples.
const FARTHEST_SAMPLES: f64 = 8.0;
/// R2 that a model must reach in roll and pitch for what all its flights are late by to be no answer to what it lacks: 0.997 where commands were
/// logged 20 ms late, and 0.35 in flights close to the floor (neuralswarm) that seem 30 ms late and fit worse if they are put right by that.
const EXPLAINED: f64 = 0.9;
/// Rows that feel the rotors: w, p, q, r.
const ROTOR_ROWS: std::ops::Range<usize> = 2..6;

/// Aligns flights to fit on, together: the linear effects of `model` and everything its linear coefficients are fitted
/// with, its adjusting effects as they are, but for the lag of rotors whose commands were logged. Flights that do not
/// determine the model are left alone: the fit says why.
///
/// Returns the model that such commands of other flights are aligned to ([`align_to`]): fitted with the lag that these show.
pub fn align(flights: &mut [&mut Prepared], model: &Model) -> Option<Model> {
    if !has_rotation(model) {
        leave_alone(flights);
        return None;
    }
    let linear: Vec<Effect> =
        model.effects().into_iter().filter(|e| e.info().kind != Kind::Adjusting).collect();
    let measured = flights.iter().all(|f| f.has_rotor_speeds());
    let with = |beside: Vec<Effect>| -> Vec<Effect> {
        let new: Vec<Effect> = beside.into_iter().filter(|e| !linear.contains(e)).collect();
        linear.iter().copied().chain(new).collect()
    };
    let sets = [with(fitted_beside(measured)), with(least_beside(measured)), linear.clone()];
    let found = |flights: &mut [&mut Prepared], sets: &[Vec<Effect>]| {
        sets.iter().find_map(|set| offsets_together(flights, model, set).ok())
    };
    // Moments that the model lacks are fitted beside the commands where they explain the rotation: else, they would explain anything.
    let beside = found(flights, &sets[..1])
        .filter(|(_, fitted)| measured || explains_rotation(flights.iter().map(|f| &**f), fitted));
    let first = usize::from(beside.is_none());
    let all = beside.or_else(|| found(flights, &sets[1..]));
    let low: Option<Vec<Prepared>> = flights.iter().map(|flight| of_commands(flight)).collect();
    let low = low.and_then(|mut low| found(&mut low.iter_mut().collect::<Vec<_>>(), &sets[first..]));
    let Some((offsets, fitted)) =
        unless_contradicted(all, low, |(offsets, _)| offsets.iter().map(|o| Some(o.estimate())).collect())
    else {
        leave_alone(flights);
        return None;
    };
    correct(flights, &offsets);
    let of_loggers =
        are_of_loggers(flights, &offsets) && explains_rotation(flights.iter().map(|f| &**f), &fitted);
    if !of_loggers {
        decide(flights, &offsets, Reference::Flights);
    }
    flights.iter_mut().for_each(|flight| name_wandering(flight, &fitted));
    (!measured).then_some(fitted)
}

/// Whether a model explains the roll and pitch of flights, as they are aligned. A controller answers what the model lacks, and where that is
/// much, the commands seem to come late, in all flights alike.
fn explains_rotation<'a>(flights: impl Iterator<Item = &'a Prepared>, model: &Model) -> bool {
    let left: Vec<_> = flights.map(|f| residuals_at_rows(f, model, f.fit_stride())).collect();
    let errors = errors(&left);
    [Axis::P, Axis::Q].into_iter().all(|axis| errors[axis].r2 > EXPLAINED)
}

/// The rows at low frequency of a flight whose commands were logged: in all rows, a controller that answers the noise of its gyro looks like a
/// delay of another size in every flight.
fn of_commands(flight: &Prepared) -> Option<Prepared> {
    (!flight.has_rotor_speeds()).then(|| at_low_frequency(flight)).flatten()
}

/// The offset of a flight under a model's coefficients.
fn offset_of(flight: &Prepared, model: &Model) -> Option<Offset> {
    let of = |mut flight: Prepared| offset_alone(&mut flight, model).ok();
    let low = of_commands(flight).and_then(of);
    unless_contradicted(of(flight.clone()), low, |offset| vec![Some(offset.estimate())])
}

/// Without rotation there is nothing sharp to see an offset by.
fn leave_alone(flights: &mut [&mut Prepared]) {
    flights.iter_mut().for_each(|flight| flight.alignment = None);
}

/// Aligns flights to a model whose coefficients stay as they are.
pub fn align_to(model: &Model, flights: &mut [&mut Prepared], reference: Reference) {
    if !has_rotation(model) {
        return leave_alone(flights);
    }
    let offsets: Vec<Option<Offset>> = flights.iter().map(|flight| offset_of(flight, model)).collect();
    let found: Vec<Offset> = offsets.iter().map(|o| o.unwrap_or(Offset::UNKNOWN)).collect();
    decide(flights, &found, reference);
    flights.iter_mut().for_each(|flight| name_wandering(flight, model));
}

/// Compares the offsets of the pieces of a flight under a model's coefficients and notes them if the clock wanders.
pub fn name_wandering(flight: &mut Prepared, model: &Model) {
    let of = |flight: &Prepared| piece_offsets(flight, model).ok();
    let low = of_commands(flight).and_then(|low| of(&low));
    let estimates =
        |pieces: &Vec<Option<PieceOffset>>| pieces.iter().map(|p| p.as_ref().map(estimate)).collect();
    let pieces = unless_contradicted(of(flight), low, estimates).unwrap_or_default();
    let pieces: Vec<PieceOffset> = pieces.into_iter().flatten().collect();
    let period_s = flight.period_s;
    let Some(alignment) = &mut flight.alignment else { return };
    let weight: f64 = pieces.iter().map(|p| p.std_error_s.powi(-2)).sum();
    let mean = pieces.iter().map(|p| p.late_s * p.std_error_s.powi(-2)).sum::<f64>() / weight;
    let squares = |scale: fn(&PieceOffset) -> f64| -> f64 {
        pieces.iter().map(|p| (p.late_s - mean).powi(2) / scale(p)).sum()
    };
    let count = pieces.len() as f64;
    let Ok(distribution) = ChiSquared::new(count - 1.0) else { return };
    let beyond_errors = distribution.sf(squares(|p| p.std_error_s.powi(2))) < WANDERING_SIGNIFICANCE;
    let scatter = (squares(|_| 1.0) / count).sqrt();
    if pieces.len() >= FEWEST_PIECES && beyond_errors && scatter > WANDERING_SAMPLES * period_s {
        alignment.wandering = pieces;
    }
}

fn estimate(piece: &PieceOffset) -> Estimate {
    Estimate { value: piece.late_s, variance: piece.std_error_s.powi(2) }
}

/// Offset of each piece of a flight; nothing for those in which nothing shows it.
fn piece_offsets(flight: &Prepared, model: &Model) -> Result<Vec<Option<PieceOffset>>, Unidentifiable> {
    let stride = flight.fit_stride();
    let [shift, constants] = own_columns(flight, model);
    let rows = shift.iter().flatten().flatten().map(Vec::len).next().unwrap_or(0);
    let length = (PIECE_S / (flight.period_s * stride as f64)).round().max(1.0) as usize;
    let count = rows / length;
    if count < FEWEST_PIECES {
        return Ok(Vec::new());
    }
    let piece = |index: usize| -> RowColumn {
        let own = |column: &Vec<f64>| -> Vec<f64> {
            let inside = |row: usize| (row / length).min(count - 1) == index;
            column.iter().enumerate().map(|(row, c)| if inside(row) { *c } else { 0.0 }).collect()
        };
        std::array::from_fn(|axis| shift[0][axis].as_ref().map(own))
    };
    let left = residuals_at_rows(flight, model, stride).residual;
    let rows = flight.rows_of_fit(left, (0..count).map(piece).chain(constants).collect());
    let width = rows.columns.len();
    let solution = least_squares::solve(&[rows], &vec![None; width])?;
    let corrected_s = flight.rotor_late_s();
    let known = (0..count).map(|k| PieceOffset {
        time_s: (k as f64 + 0.5) * PIECE_S,
        late_s: corrected_s - solution.value[k],
        std_error_s: solution.covariance[(k, k)].sqrt(),
    });
    let shows = |piece: &PieceOffset| piece.std_error_s < FARTHEST_SAMPLES * flight.period_s;
    Ok(known.map(|piece| Some(piece).filter(shows)).collect())
}

/// Median dead time of flights of commands under a model's coefficients, beyond its effects', s: what [`Reference::Model`]
/// takes. Nothing where rotor speeds were measured.
pub fn common_delay_s(model: &Model, flights: &[&Prepared]) -> Option<f64> {
    if !has_rotation(model) {
        return None;
    }
    let commanded = flights.iter().filter(|f| !f.has_rotor_speeds());
    let mut found: Vec<f64> = commanded
        .filter_map(|flight| Some(offset_of(flight, model)?.late_s - flight.rotor_late_s()))
        .collect();
    median(&mut found)
}

/// Sets the offset under which the next residual is formed.
fn try_offset(flight: &mut Prepared, late_s: f64) {
    put_right(flight, late_s, 0.0);
}

/// Offsets of flights that share the coefficients of `effects`.
fn offsets_together(
    flights: &mut [&mut Prepared],
    model: &Model,
    effects: &[Effect],
) -> Result<(Vec<Offset>, Model), Unidentifiable> {
    let mut model = model.clone();
    let is_adjusting = |effect: &Effect| effect.info().kind == Kind::Adjusting;
    let (adjusting, linear): (Vec<Effect>, Vec<Effect>) = effects.iter().partition(|e| is_adjusting(e));
    join(&mut model, &adjusting);
    for flight in flights.iter_mut() {
        flight.alignment = None;
    }
    // Coefficients to begin with: without them nothing follows from a shift.
    let plain: Vec<FlightRows> = flights.iter().map(|f| rows(f, &model, &linear, Vec::new())).collect();
    let start = least_squares::solve(&plain, &vec![None; count_of(&linear)])?;
    store(&mut model, &linear, start.value.as_slice());
    let offsets = vec![Offset::UNKNOWN; flights.len()];
    let mut problem = Together { flights, model, linear, adjusting, offsets };
    // The best there is where they do not settle: their errors say how good that is.
    gauss_newton::solve(&mut problem, Rule::of_steps(MAX_STEPS))?;
    Ok((problem.offsets, problem.model))
}

fn count_of(effects: &[Effect]) -> usize {
    effects.iter().map(|effect| effect.info().coefficients.len()).sum()
}

/// Effects that the model does not have join it, at zero.
fn join(model: &mut Model, effects: &[Effect]) {
    for effect in effects {
        if !model.has(*effect) {
            model.set(*effect, &vec![0.0; effect.info().coefficients.len()]);
        }
    }
}

/// Flights whose offsets are looked for with coefficients that they share.
struct Together<'a, 'b> {
    flights: &'a mut [&'b mut Prepared],
    model: Model,
    /// What they share, by columns of its own ...
    linear: Vec<Effect>,
    /// ... and by steps of its coefficients.
    adjusting: Vec<Effect>,
    offsets: Vec<Offset>,
}

impl Together<'_, '_> {
    /// Adds steps to the coefficients of the adjusting effects. Whether all are small.
    fn adjust(&mut self, steps: &[f64]) -> bool {
        let period_s = self.flights.first().map_or(0.0, |flight| flight.period_s);
        let longest_s = LONGEST_STEP_SAMPLES * period_s;
        let mut steps = steps.iter();
        let mut are_small = true;
        for effect in &self.adjusting {
            let term = self.model.terms.iter_mut().find(|term| term.effect == *effect);
            let coefficients = term.into_iter().flat_map(|term| &mut term.coefficients);
            for ((coefficient, info), step) in coefficients.zip(effect.info().coefficients).zip(&mut steps) {
                let step = step.clamp(-longest_s, longest_s);
                are_small &= step.abs() < CONVERGED_SAMPLES * period_s;
                coefficient.value = step_end(coefficient.value, step, info);
            }
        }
        are_small
    }

    /// What a flight's error has in common with those of the others, s^2.
    fn shared_s2(&self, solution: &Solution, first: usize, flight: usize) -> f64 {
        let others = self.flights.len().saturating_sub(1).max(1) as f64;
        let with = |other: usize| solution.covariance[(first + flight, first + other)];
        (0..self.flights.len()).filter(|other| *other != flight).map(with).sum::<f64>() / others
    }
}

impl Problem for Together<'_, '_> {
    type End = ();
    type Error = Unidentifiable;

    fn linearise(&mut self) -> Result<Linearised, Unidentifiable> {
        let count = self.flights.len();
        let shifted = self.flights.iter().enumerate().map(|(i, flight)| {
            let [mut timing, constants] = columns_of(flight, &self.model, &self.adjusting);
            let shift = timing.split_off(count_of(&self.adjusting));
            let place = |own: Vec<RowColumn>| -> Vec<RowColumn> {
                let width = own.len();
                let mut all = vec![RowColumn::default(); width * count];
                all.splice(i * width..(i + 1) * width, own);
                all
            };
            rows(flight, &self.model, &self.linear, [timing, place(shift), place(constants)].concat())
        });
        Ok(Linearised::without_priors(shifted.collect()))
    }

    fn unidentifiable(&self, why: Unidentifiable) -> Unidentifiable {
        why
    }

    fn step(&mut self, _: Linearised, solution: Solution) -> Result<ControlFlow<()>, Unidentifiable> {
        let (linear, adjusting) = (count_of(&self.linear), count_of(&self.adjusting));
        let first = linear + adjusting;
        store(&mut self.model, &self.linear, &solution.value.as_slice()[..linear]);
        let mut is_settled = self.adjust(&solution.value.as_slice()[linear..first]);
        for i in 0..self.flights.len() {
            let (at, shared_s2) = (first + i, self.shared_s2(&solution, first, i));
            let (flight, offset) = (&mut self.flights[i], &mut self.offsets[i]);
            // A later rotor is a log whose samples come earlier.
            let step = limited(-solution.value[at], offset.late_s, flight.period_s);
            is_settled &= step.abs() < CONVERGED_SAMPLES * flight.period_s;
            let variance_s2 = solution.covariance[(at, at)];
            *offset = Offset { late_s: offset.late_s + step, variance_s2, shared_s2 };
            try_offset(flight, offset.late_s);
        }
        Ok(if is_settled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }
}

/// Effects that pass for an offset of the clocks where they are left out; the lag of the rotors only where commands were logged.
fn fitted_beside(measured: bool) -> Vec<Effect> {
    let is_one = |effect: &Effect| {
        let special = &effect.info().special;
        special.aligned_with && !(special.of_actuators && measured)
    };
    let all: Vec<Effect> = Effect::all().filter(is_one).collect();
    // The last of the catalogue first: the order of columns decides how sums are rounded.
    all.into_iter().rev().collect()
}

/// Those of them that are fitted in any case: of rotors whose speeds were measured all, of commands the lag.
fn least_beside(measured: bool) -> Vec<Effect> {
    let mut all = fitted_beside(measured);
    all.retain(|effect| effect.info().special.of_actuators != measured);
    all
}

fn limited(step_s: f64, late_s: f64, period_s: f64) -> f64 {
    let longest = LONGEST_STEP_SAMPLES * period_s;
    let farthest = FARTHEST_SAMPLES * period_s;
    (late_s + step_s.clamp(-longest, longest)).clamp(-farthest, farthest) - late_s
}

/// The offset of a flight under a model whose coefficients stay, constants of the flight aside.
fn offset_alone(flight: &mut Prepared, model: &Model) -> Result<Offset, Unidentifiable> {
    let measured = flight.has_rotor_speeds();
    let is_missing = |effect: &Effect| !model.has(*effect) && effect.info().kind != Kind::Adjusting;
    let along: Vec<Effect> = fitted_beside(measured).into_iter().filter(is_missing).collect();
    if !along.is_empty()
        && let Ok((offset, fitted)) = settle_alone(flight, model, &along)
        && (measured || explains_rotation(std::iter::once(&*flight), &fitted))
    {
        return Ok(offset);
    }
    settle_alone(flight, model, &[]).map(|(offset, _)| offset)
}

fn settle_alone(
    flight: &mut Prepared,
    model: &Model,
    along: &[Effect],
) -> Result<(Offset, Model), Unidentifiable> {
    let mut model = model.clone();
    join(&mut model, along);
    let mut problem = Alone { flight, model, along, offset: Offset::UNKNOWN };
    gauss_newton::solve(&mut problem, Rule::of_steps(MAX_STEPS))?;
    try_offset(problem.flight, problem.offset.late_s);
    Ok((problem.offset, problem.model))
}

/// A flight whose offset is looked for under a model's coefficients, with those of a few effects.
struct Alone<'a> {
    flight: &'a mut Prepared,
    model: Model,
    along: &'a [Effect],
    offset: Offset,
}

impl Problem for Alone<'_> {
    type End = ();
    type Error = Unidentifiable;

    fn linearise(&mut self) -> Result<Linearised, Unidentifiable> {
        try_offset(self.flight, self.offset.late_s);
        let stride = self.flight.fit_stride();
        let [mut columns, constants] = own_columns(self.flight, &self.model);
        columns.extend(constants);
        columns.extend(self.flight.columns(self.along, &self.model, stride, None));
        let left = residuals_at_rows(self.flight, &self.model, stride).residual;
        Ok(Linearised::without_priors(vec![self.flight.rows_of_fit(left, columns)]))
    }

    fn unidentifiable(&self, why: Unidentifiable) -> Unidentifiable {
        why
    }

    fn step(&mut self, at: Linearised, solution: Solution) -> Result<ControlFlow<()>, Unidentifiable> {
        let free = count_of(self.along);
        let terms = self.along.iter().filter_map(|effect| self.model.term(*effect));
        let own: Vec<f64> = terms
            .flat_map(|term| term.coefficients.iter().map(|c| c.value))
            .zip(solution.value.iter().skip(at.priors.len() - free))
            .map(|(now, step)| now + step)
            .collect();
        store(&mut self.model, self.along, &own);
        let step = limited(-solution.value[0], self.offset.late_s, self.flight.period_s);
        let variance_s2 = solution.covariance[(0, 0)];
        self.offset = Offset { late_s: self.offset.late_s + step, variance_s2, shared_s2: 0.0 };
        let is_settled = step.abs() < CONVERGED_SAMPLES * self.flight.period_s;
        Ok(if is_settled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }
}

/// Columns of a flight alone: what a later rotor does, and a constant in each row that feels the rotors.
fn own_columns(flight: &Prepared, model: &Model) -> [Vec<RowColumn>; 2] {
    columns_of(flight, model, &[])
}

/// The same, after those of effects that all flights share.
fn columns_of(flight: &Prepared, model: &Model, adjusting: &[Effect]) -> [Vec<RowColumn>; 2] {
    let stride = flight.fit_stride();
    let timing = [adjusting, &[Effect::InputDelay]].concat();
    let timing = About::new(flight, model, (&[], &timing), stride, &Known::default()).columns;
    // Rotors that never change speed leave the shift without a column.
    let count = flight.row_samples_of_conditions().len();
    let constants = ROTOR_ROWS
        .map(|axis| {
            let mut column = RowColumn::default();
            column[axis] = Some(vec![1.0; count]);
            column
        })
        .collect();
    [timing, constants]
}

/// Rows of a flight with the columns of `effects` and more.
fn rows(flight: &Prepared, model: &Model, effects: &[Effect], more: Vec<RowColumn>) -> FlightRows {
    let stride = flight.fit_stride();
    let mut columns = flight.columns(effects, model, stride, None);
    columns.extend(more);
    flight.rows_of_fit(flight.targets(&model.vehicle, &model.adjustments(), stride), columns)
}

#[cfg(test)]
mod tests {
    use flights::{Column, Flight};

    use super::*;
    use crate::testing::{FED_BACK, NONE, fly, truth};

    const OMEGAS: [Column; 4] = [Column::Omega1, Column::Omega2, Column::Omega3, Column::Omega4];

    /// A flight of the true model that logs the rotor speeds which its commands lead to, through the
    /// map and the lag, `late` samples after they were.
    fn with_rotor_speeds(seed: u64, late: usize) -> Prepared {
        let model = truth();
        let mut flight = fly(&model, seed, 12.0, &NONE);
        let map = model.vehicle.rotor_map();
        let decay = (-model.vehicle.motors.lag.unwrap() * 0.01).exp();
        let battery = flight.required(Column::Vbat).to_vec();
        for (command, omega) in
            [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4].into_iter().zip(OMEGAS)
        {
            let mut now = f64::NAN;
            let mut speeds: Vec<f64> = Vec::new();
            for (command, volts) in flight.required(command).iter().zip(&battery) {
                let target = map.command * command + map.voltage * volts + map.offset;
                now = if now.is_nan() { target } else { now };
                speeds.push(now);
                now = target + (now - target) * decay;
            }
            speeds.rotate_right(late);
            (0..late).for_each(|k| speeds[k] = speeds[late]);
            flight.replace(omega, speeds);
        }
        prepared(&flight)
    }

    fn prepared(flight: &Flight) -> Prepared {
        Prepared::new(flight, &truth().vehicle).unwrap()
    }

    #[test]
    fn samples_that_come_two_rows_late_are_found_and_those_in_time_stay() {
        for (late, expected_s) in [(0, 0.0), (2, 0.02)] {
            let mut flight = with_rotor_speeds(7, late);
            align_to(&truth(), &mut [&mut flight], Reference::Model(None));
            let found = flight.alignment.as_ref().expect("an alignment");
            assert!((found.late_s - expected_s).abs() < 0.002, "{late} rows: {} s", found.late_s);
            assert_eq!(found.corrected, late > 0);
            assert!(found.wandering.is_empty());
        }
    }

    /// A controller that answers the noise of its gyro makes delays of another size in each flight, which are no clock's. A log of commands that
    /// does begin two samples late is seen through them.
    #[test]
    fn commands_that_answer_the_noise_of_the_gyro_are_as_late_as_their_log() {
        println!("seeds 50 to 55");
        let mut flights: Vec<Flight> = (50..56).map(|seed| fly(&truth(), seed, 40.0, &FED_BACK)).collect();
        for column in [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4] {
            let mut commands = flights[5].required(column).to_vec();
            commands.rotate_right(2);
            (0..2).for_each(|k| commands[k] = commands[2]);
            flights[5].replace(column, commands);
        }
        let mut flights: Vec<Prepared> = flights.iter().map(prepared).collect();
        let mut all: Vec<&mut Prepared> = flights.iter_mut().collect();
        let in_all_rows = offsets_together(&mut all, &truth(), &truth().effects()).unwrap().0;
        let is_early = |offset: &Offset| offset.late_s < -3.0 * offset.variance_s2.sqrt();
        assert!(in_all_rows[..5].iter().all(is_early), "{in_all_rows:?}");
        align(&mut all, &truth());
        for (flight, late_s) in flights.iter().zip([0.0, 0.0, 0.0, 0.0, 0.0, 0.02]) {
            let alignment = flight.alignment.as_ref().unwrap();
            assert!((alignment.late_s - late_s).abs() < 0.0025, "{}: {alignment:?}", flight.name);
            assert_eq!(alignment.corrected, late_s > 0.0, "{}: {alignment:?}", flight.name);
        }
    }

    /// Where a craft flaps and the model does not, the controller answers that moment late: it must not pass for the clock's.
    #[test]
    fn commands_late_in_all_logs_are_found_beside_a_moment_that_the_model_lacks() {
        println!("seeds 60 to 62");
        let mut craft = truth();
        craft.set(Effect::FlappingMoment, &[-3.78, 2.75]);
        let mut flights: Vec<Flight> = (60..63).map(|seed| fly(&craft, seed, 12.0, &NONE)).collect();
        for flight in &mut flights {
            for column in [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4] {
                let mut commands = flight.required(column).to_vec();
                commands.rotate_right(2);
                (0..2).for_each(|k| commands[k] = commands[2]);
                flight.replace(column, commands);
            }
        }
        let mut flights: Vec<Prepared> = flights.iter().map(prepared).collect();
        let mut basic = truth();
        basic.terms.retain(|term| Effect::basic().any(|effect| effect == term.effect));
        align(&mut flights.iter_mut().collect::<Vec<_>>(), &basic);
        for flight in &flights {
            let alignment = flight.alignment.as_ref().unwrap();
            assert!((alignment.corrected_s() - 0.02).abs() < 0.004, "{}: {alignment:?}", flight.name);
        }
    }

    #[test]
    fn rotors_that_never_change_speed_leave_the_clock_alone() {
        let mut flight = fly(&truth(), 7, 8.0, &NONE);
        let rows = flight.required(Column::T).len();
        OMEGAS.into_iter().for_each(|omega| flight.replace(omega, vec![700.0; rows]));
        let mut flight = prepared(&flight);
        align_to(&truth(), &mut [&mut flight], Reference::Model(None));
        assert_eq!(flight.alignment, None);
        align(&mut [&mut flight], &truth());
        assert_eq!(flight.alignment, None);
    }

    #[test]
    fn a_model_without_rotation_aligns_nothing() {
        let mut flight = with_rotor_speeds(7, 2);
        let mut model = truth();
        model.terms.retain(|term| term.effect != Effect::RotorMoments);
        align_to(&model, &mut [&mut flight], Reference::Model(None));
        assert_eq!(flight.alignment, None);
    }

    #[test]
    fn steps_stay_short_and_near() {
        let period_s = 0.01;
        assert_eq!(limited(0.004, 0.0, period_s), 0.004);
        assert_eq!(limited(1.0, 0.0, period_s), 0.015);
        assert!((limited(0.015, 0.075, period_s) - 0.005).abs() < 1e-12);
    }
}
