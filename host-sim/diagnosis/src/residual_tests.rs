//! What does the residual depend on? Each axis is tested by what a function of one measured quantity, fitted to training residuals, takes away
//! of the held-out ones: a constant, a cubic in each quantity, and the past of the axis itself.
//!
//! **The past.** A model of states and rotors says what acts now. A part that swings, sloshes or bends answers later, and so does air: the
//! residual is then what the predicted acceleration was some tenths of a second before, through a filter that nobody knows. Ljung's
//! test of the residual against past inputs (System Identification, 2nd edition, 16.6) is made by a fit: a finite impulse response of
//! the predicted acceleration, less its present value, which is a matter of the other tests. A controller that answers the noise of its gyro gives
//! moments a past, too, which is gone at low frequency ([`sysid::fit::low_frequency`]): moments must show theirs there as well.

use model::{Axis, Model};
use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

use crate::criteria::{LATE_PERCENT, PAST_PERCENT, STRUCTURE_PERCENT, STRUCTURE_SIGNIFICANCE};
use crate::dependence::Dependence;
use crate::finding::Unexplained;
use crate::held_out::Validated;
use crate::not_logged::lack_position;
use crate::significance::{block_sums, rows_of_stretches};
use sysid::fit::low_frequency::at_low_frequency;
use sysid::prepare::Prepared;
use sysid::prepare::conditions::Condition;
use sysid::statistics::Blocks;
use sysid::{Residuals, residuals};

/// Axes on which the rotors' thrust acts.
const OF_THRUST: [Axis; 3] = [Axis::W, Axis::P, Axis::Q];

/// Time between the values of the past that are looked at, s, and how many there are: almost half a second, and two values in a period
/// at 10 Hz.
const PAST_STEP_S: f64 = 0.05;
const PAST_STEPS: usize = 8;
/// Neighbouring values of the past are alike: this part of their variance is added before the normal equations are solved.
const RIDGE: f64 = 1e-4;

/// What the residual depends on.
pub(crate) struct Structure {
    /// Largest share first.
    pub(crate) unexplained: Vec<Unexplained>,
    /// Whether an axis, or those of thrust together, answer to the last half second.
    pub(crate) answers_late: bool,
}

/// What the residual of each axis depends on: fitted to training residuals, it must lower the held-out squared error by more than chance
/// and by enough to matter.
pub(crate) fn structure(rest: &Validated, train: &[&Prepared], validate: &[&Prepared]) -> Structure {
    let model = &rest.fit.model;
    let fitted: Vec<Residuals> = train.iter().map(|f| residuals(f, model)).collect();
    let mut found = structure_of(model, (train, &fitted), (validate, &rest.held_out));
    let is_of_moments = |u: &Unexplained| u.depends_on == Dependence::Past && !u.axis.is_force();
    if !found.unexplained.iter().any(is_of_moments) {
        return found;
    }
    if let Some(low) = structure_at_low_frequency(model, train, validate) {
        let is_there = |u: &Unexplained| low.unexplained.iter().any(|l| is_of_moments(l) && l.axis == u.axis);
        found.unexplained.retain(|u| !is_of_moments(u) || is_there(u));
        let is_left = found.unexplained.iter().any(|u| u.depends_on == Dependence::Past);
        found.answers_late &= is_left || low.answers_late;
    }
    found
}

/// The same at low frequency, of the model fitted there.
fn structure_at_low_frequency(
    model: &Model,
    train: &[&Prepared],
    validate: &[&Prepared],
) -> Option<Structure> {
    let through = |flights: &[&Prepared]| -> Option<Vec<Prepared>> {
        flights.iter().map(|flight| at_low_frequency(flight)).collect()
    };
    let (train, validate) = (through(train)?, through(validate)?);
    let (train, validate): (Vec<&Prepared>, Vec<&Prepared>) =
        (train.iter().collect(), validate.iter().collect());
    let fit = sysid::fit(&train, &model.vehicle, &model.effects(), Some(model)).ok()?;
    let of = |flights: &[&Prepared]| -> Vec<Residuals> {
        flights.iter().map(|f| residuals(f, &fit.model)).collect()
    };
    Some(structure_of(&fit.model, (&train, &of(&train)), (&validate, &of(&validate))))
}

/// The same of any residuals of a model: fitted to those of `train`, tested on those of `validate`.
pub(crate) fn structure_of(
    model: &Model,
    (train, fitted): (&[&Prepared], &[Residuals]),
    (validate, tested): (&[&Prepared], &[Residuals]),
) -> Structure {
    let (known, held_out) = (conditions(model, train), conditions(model, validate));
    let quantities = known.first().map_or(0, Vec::len);
    let tests = ((quantities + 1) * 6) as f64;
    let mut found = Vec::new();
    let (mut late, mut late_percent, mut is_late) = (Blocks::default(), 0.0, false);
    // A drag that nobody knows answers late, too.
    let is_known = |axis: &Axis| !axis.is_force() || !lack_position(&[train, validate].concat());
    let of_thrust: Vec<Axis> = OF_THRUST.into_iter().filter(is_known).collect();
    for axis in model::AXES {
        let held = Held::new(axis, validate, tested);
        let training = || fitted.iter().flat_map(|r| r.residual[axis.index()].iter().copied());
        let constant = training().sum::<f64>() / training().count().max(1) as f64;
        // A constant is a dependence on nothing measured; the quantities are tested by what they add to it.
        found.extend(held.tested(Dependence::Constant, &|_, _| constant, 0.0, tests));
        for index in 0..quantities {
            let points = known.iter().zip(fitted).flat_map(|(c, r)| {
                c[index].values.iter().copied().zip(r.residual[axis.index()].iter().copied())
            });
            if let Some(cubic) = Cubic::fit(points) {
                let explain = |f: usize, k: usize| cubic.at(held_out[f][index].values[k]);
                found.extend(held.tested(
                    Dependence::Quantity(known[0][index].name),
                    &explain,
                    constant,
                    tests,
                ));
            }
        }
        if let Some(past) = Past::fit(axis, train, fitted, constant) {
            let (blocks, gain) = held.gained_by(&past, constant);
            let share_percent = held.share_percent(gain, constant);
            let alone =
                held.depends_on(Dependence::Past, share_percent, PAST_PERCENT, 6.0 * blocks.p_value());
            is_late |= alone.is_some() && is_known(&axis);
            found.extend(alone);
            if of_thrust.contains(&axis) {
                late_percent += share_percent / of_thrust.len() as f64;
                late.extend_by(&blocks, 1.0 / held.total.max(f64::MIN_POSITIVE));
            }
        }
    }
    found.sort_by(|a, b| b.share_percent.total_cmp(&a.share_percent));
    is_late |= late_percent > LATE_PERCENT && late.p_value() < STRUCTURE_SIGNIFICANCE;
    Structure { unexplained: found, answers_late: is_late }
}

fn conditions(model: &Model, flights: &[&Prepared]) -> Vec<Vec<Condition>> {
    let adjust = model.adjustments();
    flights.iter().map(|f| f.conditions(&model.vehicle, &adjust).all()).collect()
}

/// The held-out residuals of an axis.
struct Held<'a> {
    axis: Axis,
    flights: &'a [&'a Prepared],
    residuals: &'a [Residuals],
    /// Its squared error.
    total: f64,
}

impl<'a> Held<'a> {
    fn new(axis: Axis, flights: &'a [&'a Prepared], residuals: &'a [Residuals]) -> Self {
        let total = residuals.iter().flat_map(|r| &r.residual[axis.index()]).map(|e| e * e).sum();
        Self { axis, flights, residuals, total }
    }

    /// Share of a gain over the constant `before`, percent. Where the flights held out have another constant, taking it away can
    /// gain more than their error: then the share is that of the error with it.
    fn share_percent(&self, gain: f64, before: f64) -> f64 {
        let errors = self.residuals.iter().flat_map(|r| &r.residual[self.axis.index()]);
        let all = errors.map(|e| (e - before).powi(2)).sum::<f64>().max(self.total);
        if all > 0.0 { 100.0 * gain / all } else { 0.0 }
    }

    /// What takes away more than a least share, and more than chance does.
    fn depends_on(
        &self,
        depends_on: Dependence,
        share_percent: f64,
        least_percent: f64,
        p_value: f64,
    ) -> Option<Unexplained> {
        let p_value = p_value.min(1.0);
        (share_percent > least_percent && p_value < STRUCTURE_SIGNIFICANCE).then_some(Unexplained {
            axis: self.axis,
            depends_on,
            share_percent,
            p_value,
        })
    }

    /// By what `explain`, of a flight and a row, is better than the constant `before`, one of so many `tests`.
    fn tested(
        &self,
        depends_on: Dependence,
        explain: &dyn Fn(usize, usize) -> f64,
        before: f64,
        tests: f64,
    ) -> Option<Unexplained> {
        let (mut blocks, mut total) = (Blocks::default(), 0.0);
        for (f, (flight, r)) in self.flights.iter().zip(self.residuals).enumerate() {
            let residual = &r.residual[self.axis.index()];
            let explained: Vec<f64> = (0..residual.len()).map(|k| explain(f, k)).collect();
            let fall = |(e, x): (&f64, &f64)| (e - before).powi(2) - (e - x).powi(2);
            let by_noise = |(e, x): (&f64, &f64)| 2.0 * (e - x) * (x - before);
            let gain: Vec<f64> = residual.iter().zip(&explained).map(fall).collect();
            let noise: Vec<f64> = residual.iter().zip(&explained).map(by_noise).collect();
            total += gain.iter().sum::<f64>();
            blocks.gain.extend(block_sums(flight, &gain));
            blocks.chance.extend(block_sums(flight, &noise));
        }
        let p_value = tests * blocks.p_value();
        self.depends_on(depends_on, self.share_percent(total, before), STRUCTURE_PERCENT, p_value)
    }

    /// What the past explains beyond the constant `before`: its gain by blocks, and in all.
    fn gained_by(&self, past: &Past, before: f64) -> (Blocks, f64) {
        let (mut blocks, mut total) = (Blocks::default(), 0.0);
        for (flight, r) in self.flights.iter().zip(self.residuals) {
            let residual = &r.residual[self.axis.index()];
            let explained = past.over(flight, r);
            let by_noise = |(e, d): (&f64, &f64)| 2.0 * (e - before - d) * d;
            let noise: Vec<f64> = residual.iter().zip(&explained).map(by_noise).collect();
            let gain: Vec<f64> = noise.iter().zip(&explained).map(|(noise, d)| noise + d * d).collect();
            blocks.gain.extend(block_sums(flight, &gain));
            blocks.chance.extend(block_sums(flight, &noise));
            total += gain.iter().sum::<f64>();
        }
        (blocks, total)
    }
}

/// A finite impulse response of what an axis was predicted to do, less its present value.
struct Past {
    axis: Axis,
    response: DVector<f64>,
}

impl Past {
    /// Of training residuals less `constant`. None where nothing moves.
    fn fit(axis: Axis, flights: &[&Prepared], residuals: &[Residuals], constant: f64) -> Option<Self> {
        let (mut normal, mut right) =
            (DMatrix::<f64>::zeros(PAST_STEPS, PAST_STEPS), DVector::<f64>::zeros(PAST_STEPS));
        for (flight, r) in flights.iter().zip(residuals) {
            let residual = &r.residual[axis.index()];
            for_each_past(axis, flight, r, |k, past| {
                normal.ger(1.0, past, past, 1.0);
                right.axpy(residual[k] - constant, past, 1.0);
            });
        }
        let scale = normal.trace() / PAST_STEPS as f64;
        for k in 0..PAST_STEPS {
            normal[(k, k)] += RIDGE * scale;
        }
        let response = normal.cholesky()?.solve(&right);
        Some(Self { axis, response })
    }

    /// What is explained at each row of a flight.
    fn over(&self, flight: &Prepared, residuals: &Residuals) -> Vec<f64> {
        let mut explained = vec![0.0; residuals.residual[self.axis.index()].len()];
        for_each_past(self.axis, flight, residuals, |k, past| explained[k] = self.response.dot(past));
        explained
    }
}

/// Hands over each row that has a past, with the predicted accelerations then, each less that at the row.
fn for_each_past(
    axis: Axis,
    flight: &Prepared,
    residuals: &Residuals,
    mut take: impl FnMut(usize, &DVector<f64>),
) {
    let (measured, residual) = (&residuals.measured[axis.index()], &residuals.residual[axis.index()]);
    let predicted = |k: usize| measured[k] - residual[k];
    let step = (PAST_STEP_S / flight.period_s).round().max(1.0) as usize;
    let mut past = DVector::zeros(PAST_STEPS);
    for rows in rows_of_stretches(flight) {
        for k in rows.start + PAST_STEPS * step..rows.end {
            let now = predicted(k);
            past.iter_mut().enumerate().for_each(|(j, p)| *p = predicted(k - (j + 1) * step) - now);
            take(k, &past);
        }
    }
}

/// A cubic in a standardised quantity, held constant beyond the range it was fitted on.
struct Cubic {
    mean: f64,
    scale: f64,
    range: (f64, f64),
    coefficients: Vector4<f64>,
}

impl Cubic {
    fn fit(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let n = points.clone().count() as f64;
        let mean = points.clone().map(|(x, _)| x).sum::<f64>() / n;
        let scale = (points.clone().map(|(x, _)| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
        if !(scale > 0.0) {
            return None;
        }
        let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        for (x, e) in points {
            let s = (x - mean) / scale;
            range = (range.0.min(s), range.1.max(s));
            let row = Vector4::new(1.0, s, s * s, s * s * s);
            normal += row * row.transpose();
            right += e * row;
        }
        let coefficients = normal.cholesky()?.solve(&right);
        Some(Self { mean, scale, range, coefficients })
    }

    fn at(&self, x: f64) -> f64 {
        let s = ((x - self.mean) / self.scale).clamp(self.range.0, self.range.1);
        let c = &self.coefficients;
        c[0] + s * (c[1] + s * (c[2] + s * c[3]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Held-out residuals of 3, where training left -1: going by 3 instead of -1 gains 16 of each sample, whose square is 9.
    #[test]
    fn no_share_is_more_than_all() {
        let mut rest = Residuals::default();
        rest.residual[Axis::W.index()] = vec![3.0; 50];
        let residuals = [rest];
        let held = Held::new(Axis::W, &[], &residuals);
        assert!((held.share_percent(50.0 * 16.0, -1.0) - 100.0).abs() < 1e-9);
        assert!((held.share_percent(50.0 * 4.5, 0.0) - 50.0).abs() < 1e-9);
    }

    /// A cubic is found exactly; beyond what was seen, it stays at its last value.
    #[test]
    fn a_cubic_is_fitted_exactly_and_held_beyond_its_range() {
        let of = |x: f64| 2.0 - x + 0.5 * x * x - 0.1 * x * x * x;
        let points: Vec<(f64, f64)> = (0..50).map(|k| f64::from(k) / 10.0).map(|x| (x, of(x))).collect();
        let cubic = Cubic::fit(points.iter().copied()).unwrap();
        for (x, expected) in [(0.0, of(0.0)), (2.34, of(2.34)), (9.0, of(4.9)), (-3.0, of(0.0))] {
            assert!((cubic.at(x) - expected).abs() < 1e-9, "{x}: {}", cubic.at(x));
        }
        assert!(Cubic::fit([(1.0, 2.0), (1.0, 3.0)].into_iter()).is_none(), "nothing moved");
    }
}
