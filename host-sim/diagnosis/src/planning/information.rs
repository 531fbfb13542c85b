//! What a flight reveals about a model's coefficients, before it is flown: Fisher information for coloured residuals.
//!
//! A simulated flight without noise gives the columns X of the regression, those of the model's own coefficients and
//! those of effects it does not have. What the noise does to a row of each axis, and how long it remembers it, is read off
//! simulated flights with noise ([`Colour`]). Then, with the weights W of the fit,
//!
//! ```text
//! covariance = (X'WX)^-1  X'W S W X  (X'WX)^-1,    S = covariance of the residual's samples
//! ```
//!
//! is what `identify` will report, up to what the noise does to X. X'WX and X'WSWX of several flights add up, and what is
//! known already is one more summand.
//!
//! **Seen or not.** An effect of ordinary size ([`model::Coefficient::typical`]) that a flight holds moves the estimates by
//! so many standard errors, with everything else in the model free to follow it ([`Sight`]). Where another effect is fitted
//! beside it, what is left says whether the two can be told apart.
//!
//! Deliberately absent: errors of the model itself. A residual that is larger on real flights than the sensors' noise
//! scales everything by what the model's fit recorded.

use model::{AXES, AxisError, Effect, Model, PerAxis};
use nalgebra::{DMatrix, DVector};

use crate::columns::rows_about;
use sysid::prepare::Prepared;
use sysid::residuals;

/// Memory of the noise that is looked at, s: several times the span of the longest chain of filters.
const MEMORY_S: f64 = 3.0;
/// Relative size of the smallest eigenvalue of the scaled information below which coefficients are one and the same.
const SINGULAR: f64 = 1e-13;
/// Coefficients that the weakest direction moves by more than this part are those involved.
const INVOLVED: f64 = 0.2;

/// Covariance of a residual with itself some time later, for each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Colour {
    /// At 0, 1, 2 ... samples.
    covariance: [Vec<f64>; 6],
    period_s: f64,
}

impl Colour {
    /// From flights that `model` describes but for the sensors' noise, all of one sampling period. None without flights.
    ///
    /// The lags are weighted by Parzen's window, so that no frequency comes out negative.
    pub fn of(model: &Model, flights: &[&Prepared]) -> Option<Self> {
        let period_s = flights.first()?.period_s;
        let lags = (MEMORY_S / period_s).round() as usize;
        let mut covariance: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; lags]);
        let mut rows = 0.0;
        for flight in flights {
            let all = residuals(flight, model).residual;
            rows += all[0].len() as f64;
            for (sums, residual) in covariance.iter_mut().zip(&all) {
                for (lag, sum) in sums.iter_mut().enumerate() {
                    *sum += residual.iter().zip(residual.iter().skip(lag)).map(|(a, b)| a * b).sum::<f64>();
                }
            }
        }
        for sums in &mut covariance {
            for (lag, sum) in sums.iter_mut().enumerate() {
                *sum *= parzen(lag as f64 / lags as f64) / rows;
            }
        }
        Some(Self { covariance, period_s })
    }

    /// As large as residuals that were recorded, where these are larger.
    #[must_use]
    pub fn at_least(mut self, recorded: &PerAxis<AxisError>) -> Self {
        for axis in AXES {
            let sums = &mut self.covariance[axis.index()];
            let factor = recorded[axis].rms.powi(2) / sums[0];
            if factor > 1.0 && factor.is_finite() {
                sums.iter_mut().for_each(|s| *s *= factor);
            }
        }
        self
    }

    /// Standard deviation of the residual of each axis.
    pub fn deviation(&self) -> [f64; 6] {
        self.covariance.each_ref().map(|sums| sums[0].max(0.0).sqrt())
    }
}

fn parzen(x: f64) -> f64 {
    if x < 0.5 { 1.0 - 6.0 * x * x * (1.0 - x) } else { 2.0 * (1.0 - x).max(0.0).powi(3) }
}

/// A coefficient of an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parameter {
    /// The effect.
    pub effect: Effect,
    /// Place among its coefficients.
    pub index: usize,
}

impl Parameter {
    /// What the effect says of it.
    pub fn info(&self) -> &'static model::Coefficient {
        &self.effect.info().coefficients[self.index]
    }
}

/// What flights tell about the coefficients of effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Information {
    parameters: Vec<Parameter>,
    /// X'WX.
    normal: DMatrix<f64>,
    /// X'WSWX.
    scores: DMatrix<f64>,
    /// Rows, of all axes together six times as many.
    rows: f64,
}

/// Coefficients with the covariance that flights would give them.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// Those that the flights move at all.
    pub parameters: Vec<Parameter>,
    /// In their order.
    pub covariance: DMatrix<f64>,
    /// Those that they do not.
    pub dead: Vec<Parameter>,
}

/// Coefficients that cannot be told apart.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Alike(pub Vec<Parameter>);

/// How well an effect of ordinary size would be seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Standard errors by which it stands out: root of the noncentrality of its test.
    pub deviations: f64,
    /// Part of the squared residual of all its axes that it makes, percent.
    pub share_percent: f64,
}

impl Information {
    /// Of a flight, about `effects`; those that the model does not have are linearised where they are not there.
    pub fn of(flight: &Prepared, model: &Model, effects: &[Effect], colour: &Colour) -> Self {
        let rows = rows_about(flight, model, effects);
        let parameters: Vec<Parameter> = effects
            .iter()
            .flat_map(|&effect| {
                (0..effect.info().coefficients.len()).map(move |index| Parameter { effect, index })
            })
            .collect();
        let count = parameters.len();
        let mut information = Self {
            parameters,
            normal: DMatrix::zeros(count, count),
            scores: DMatrix::zeros(count, count),
            rows: rows.rows() as f64,
        };
        let stride = (rows.period_s / colour.period_s).round().max(1.0) as usize;
        for axis in 0..6 {
            let active: Vec<usize> = (0..count).filter(|&k| rows.columns[k][axis].is_some()).collect();
            let columns: Vec<&[f64]> =
                active.iter().map(|&k| rows.columns[k][axis].as_deref().unwrap_or(&[])).collect();
            let memory: Vec<f64> = colour.covariance[axis].iter().copied().step_by(stride).collect();
            let weight = 1.0 / memory[0].max(1e-18);
            let coloured: Vec<Vec<f64>> =
                columns.iter().map(|c| remembered(c, &memory, &rows.starts)).collect();
            for (i, &k) in active.iter().enumerate() {
                for (j, &l) in active.iter().enumerate() {
                    information.normal[(k, l)] += weight * product(columns[i], columns[j]);
                    information.scores[(k, l)] += weight * weight * product(columns[i], &coloured[j]);
                }
            }
        }
        information
    }

    /// That of several flights about the same effects.
    ///
    /// # Panics
    /// When they are about different effects: a mistake in the program.
    #[must_use]
    pub fn plus(mut self, other: &Self) -> Self {
        assert_eq!(self.parameters, other.parameters, "information about different effects");
        self.normal += &other.normal;
        self.scores += &other.scores;
        self.rows += other.rows;
        self
    }

    /// Rows of each axis.
    pub fn rows(&self) -> f64 {
        self.rows
    }

    fn indices(&self, effects: &[Effect]) -> Vec<usize> {
        (0..self.parameters.len()).filter(|&k| effects.contains(&self.parameters[k].effect)).collect()
    }

    /// What a fit of `effects` would know.
    ///
    /// # Errors
    /// Coefficients that the flights move in one and the same way.
    pub fn expected(&self, effects: &[Effect]) -> Result<Expected, Alike> {
        let (live, dead): (Vec<usize>, Vec<usize>) =
            self.indices(effects).into_iter().partition(|&k| self.normal[(k, k)] > 0.0);
        let pick =
            |from: &DMatrix<f64>| DMatrix::from_fn(live.len(), live.len(), |r, c| from[(live[r], live[c])]);
        let (mut normal, mut scores) = (pick(&self.normal), pick(&self.scores));
        for (i, &k) in live.iter().enumerate() {
            // What qualifies another coefficient is known a little before any flight.
            if let Some(deviation) = self.parameters[k].info().prior {
                normal[(i, i)] += 1.0 / (deviation * deviation);
                scores[(i, i)] += 1.0 / (deviation * deviation);
            }
        }
        let scale = DVector::from_fn(live.len(), |i, _| 1.0 / normal[(i, i)].sqrt());
        let scaled = DMatrix::from_fn(live.len(), live.len(), |r, c| normal[(r, c)] * scale[r] * scale[c]);
        let eigen = scaled.symmetric_eigen();
        let parameters = |indices: &[usize]| indices.iter().map(|&k| self.parameters[k]).collect::<Vec<_>>();
        if !live.is_empty() {
            let weakest = eigen.eigenvalues.imin();
            if !(eigen.eigenvalues[weakest] > SINGULAR * eigen.eigenvalues.max()) {
                let direction = eigen.eigenvectors.column(weakest);
                let involved: Vec<usize> =
                    (0..live.len()).filter(|&i| direction[i].abs() > INVOLVED).map(|i| live[i]).collect();
                return Err(Alike(parameters(&involved)));
            }
        }
        let vectors = DMatrix::from_diagonal(&scale) * &eigen.eigenvectors;
        let inverse =
            &vectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| 1.0 / v)) * vectors.transpose();
        let covariance = &inverse * scores * &inverse;
        Ok(Expected { parameters: parameters(&live), covariance, dead: parameters(&dead) })
    }

    /// How well `effect` of a size would be seen by a fit of it beside `own` and the `beside` effects; `size` gives a
    /// coefficient's. Nothing where the flights do not move it, or move it like the others.
    pub fn sight(
        &self,
        effect: Effect,
        own: &[Effect],
        beside: &[Effect],
        size: impl Fn(Parameter) -> f64,
    ) -> Option<Sight> {
        let mut effects: Vec<Effect> = own.iter().chain(beside).copied().filter(|e| *e != effect).collect();
        effects.push(effect);
        let expected = self.expected(&effects).ok()?;
        let places: Vec<usize> = (0..expected.parameters.len())
            .filter(|&k| {
                let p = expected.parameters[k];
                // What only qualifies another coefficient is not what is looked for.
                p.effect == effect && p.info().prior.is_none()
            })
            .collect();
        if places.is_empty() {
            return None;
        }
        let block =
            DMatrix::from_fn(places.len(), places.len(), |r, c| expected.covariance[(places[r], places[c])]);
        let precision = block.try_inverse()?;
        // Whatever the signs of its coefficients: the mean over all.
        let noncentrality: f64 = places
            .iter()
            .enumerate()
            .map(|(i, &k)| size(expected.parameters[k]).powi(2) * precision[(i, i)])
            .sum();
        let square: f64 = self
            .indices(&[effect])
            .into_iter()
            .filter(|&k| self.parameters[k].info().prior.is_none())
            .map(|k| size(self.parameters[k]).powi(2) * self.left(k, own))
            .sum();
        let axes = effect.info().axes.len().max(1) as f64;
        Some(Sight {
            deviations: noncentrality.max(0.0).sqrt(),
            share_percent: 100.0 * square / (square + axes * self.rows),
        })
    }

    /// Square of a column that the model's own columns leave.
    fn left(&self, column: usize, own: &[Effect]) -> f64 {
        let own: Vec<usize> = self
            .indices(own)
            .into_iter()
            .filter(|&k| {
                k != column
                    && self.normal[(k, k)] > 0.0
                    && self.parameters[k].effect != self.parameters[column].effect
            })
            .collect();
        let whole = self.normal[(column, column)];
        let scale = |k: usize| 1.0 / self.normal[(k, k)].sqrt();
        let a = DMatrix::from_fn(own.len(), own.len(), |r, c| {
            let ridge = if r == c { 1e-12 } else { 0.0 };
            self.normal[(own[r], own[c])] * scale(own[r]) * scale(own[c]) + ridge
        });
        let b = DVector::from_fn(own.len(), |r, _| self.normal[(own[r], column)] * scale(own[r]));
        match a.cholesky() {
            Some(factor) => (whole - b.dot(&factor.solve(&b))).max(0.0),
            None => whole,
        }
    }
}

impl Expected {
    /// Standard error of a coefficient.
    pub fn std_error(&self, parameter: Parameter) -> Option<f64> {
        let k = self.parameters.iter().position(|p| *p == parameter)?;
        Some(self.covariance[(k, k)].max(0.0).sqrt())
    }

    /// With what a model's file says of its coefficients already: their errors and, where the file has them, correlations.
    #[must_use]
    pub fn knowing(mut self, model: &Model) -> Self {
        let of_model: Vec<Parameter> = model
            .terms
            .iter()
            .flat_map(|t| (0..t.coefficients.len()).map(|index| Parameter { effect: t.effect, index }))
            .collect();
        let all = model.covariance();
        let known: Vec<(usize, usize)> = self
            .parameters
            .iter()
            .enumerate()
            .filter_map(|(here, p)| Some((here, of_model.iter().position(|m| m == p)?)))
            .filter(|(_, there)| all[(*there, *there)] > 0.0)
            .collect();
        let block = DMatrix::from_fn(known.len(), known.len(), |r, c| all[(known[r].1, known[c].1)]);
        if let (Some(before), Some(mut precision)) = (precision(&block), precision(&self.covariance)) {
            for (i, (r, _)) in known.iter().enumerate() {
                for (j, (c, _)) in known.iter().enumerate() {
                    precision[(*r, *c)] += before[(i, j)];
                }
            }
            if let Some(covariance) = self::precision(&precision) {
                self.covariance = covariance;
            }
        }
        self
    }
}

/// Inverse of a symmetric matrix whose diagonal may span many orders of magnitude; none if it is not positive definite.
fn precision(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = |k: usize| 1.0 / matrix[(k, k)].sqrt();
    let n = matrix.nrows();
    let scaled = DMatrix::from_fn(n, n, |r, c| matrix[(r, c)] * scale(r) * scale(c));
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, n, |r, c| inverse[(r, c)] * scale(r) * scale(c)))
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// S x: each row of the result is what the noise remembers of the column around it, within stretches.
fn remembered(column: &[f64], memory: &[f64], starts: &[usize]) -> Vec<f64> {
    let mut result = vec![0.0; column.len()];
    for (i, &start) in starts.iter().enumerate() {
        let end = starts.get(i + 1).copied().unwrap_or(column.len());
        let part = &column[start..end];
        for (k, to) in result[start..end].iter_mut().enumerate() {
            let back = &part[k.saturating_sub(memory.len() - 1)..=k];
            let ahead = &part[k + 1..part.len().min(k + memory.len())];
            *to = back.iter().rev().zip(memory).map(|(x, m)| x * m).sum::<f64>()
                + ahead.iter().zip(&memory[1..]).map(|(x, m)| x * m).sum::<f64>();
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With noise without memory the covariance is the textbook's: (X'WX)^-1.
    #[test]
    fn white_noise_gives_the_textbook_covariance() {
        let parameters: Vec<Parameter> =
            (0..2).map(|index| Parameter { effect: Effect::LinearDrag, index }).collect();
        let normal = DMatrix::from_row_slice(2, 2, &[4.0, 1.0, 1.0, 2.0]);
        let information =
            Information { parameters, scores: normal.clone(), normal: normal.clone(), rows: 9.0 };
        let expected = information.expected(&[Effect::LinearDrag]).unwrap();
        assert!((expected.covariance - normal.try_inverse().unwrap()).norm() < 1e-12);
    }

    /// Two independent measurements of the same thing: their precisions add.
    #[test]
    fn what_is_known_adds_to_what_is_found() {
        let mut model = Model::thesis();
        for (k, error) in [0.3, 0.4, 0.5].into_iter().enumerate() {
            let term = model.terms.iter_mut().find(|t| t.effect == Effect::LinearDrag).unwrap();
            term.coefficients[k].std_error = Some(error);
        }
        let parameters: Vec<Parameter> =
            (0..3).map(|index| Parameter { effect: Effect::LinearDrag, index }).collect();
        let covariance = DMatrix::from_diagonal(&DVector::from_vec(vec![0.16, 1e6, 0.25]));
        let found = Expected { parameters: parameters.clone(), covariance, dead: Vec::new() }.knowing(&model);
        for (parameter, expected) in parameters.into_iter().zip([0.24, 0.4, 0.5_f64 / 2_f64.sqrt()]) {
            assert!((found.std_error(parameter).unwrap() - expected).abs() < 1e-6, "{parameter:?}");
        }
    }

    #[test]
    fn columns_that_repeat_each_other_are_named_and_dead_ones_left_out() {
        let parameters: Vec<Parameter> =
            (0..3).map(|index| Parameter { effect: Effect::LinearDrag, index }).collect();
        let alike = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
        let information = Information { parameters, scores: alike.clone(), normal: alike, rows: 9.0 };
        let Alike(named) = information.expected(&[Effect::LinearDrag]).unwrap_err();
        assert_eq!(named.iter().map(|p| p.index).collect::<Vec<_>>(), [0, 1]);
    }

    /// Toeplitz matrix times vector, by the definition; stretches do not see each other.
    #[test]
    fn noise_remembers_within_stretches() {
        let column: Vec<f64> = (0..20).map(|k| f64::from(k * k % 7)).collect();
        let memory = [3.0, -1.0, 0.5];
        let found = remembered(&column, &memory, &[0, 8]);
        for (r, value) in found.iter().enumerate() {
            let same = |c: &usize| (*c < 8) == (r < 8);
            let expected: f64 =
                (0..20).filter(same).map(|c| memory.get(r.abs_diff(c)).unwrap_or(&0.0) * column[c]).sum();
            assert!((value - expected).abs() < 1e-12, "{r}");
        }
    }
}
