//! Which map? Fits to parts of the run, judged on the others.

use std::collections::BTreeMap;

use super::error::MotorMapError;
use super::result::Judged;
use super::rows::{Rows, Shape, rows};
use super::run::Run;
use super::terms::Terms;

/// Length of a part of the run that is judged as one, s; and number of folds.
pub(super) const PART_S: f64 = 2.0;
const FOLDS: usize = 5;
/// Deviations by which the fall of the held-out error has to stand out, and least fall that
/// matters, percent.
const SUPPORT_DEVIATIONS: f64 = 3.0;
const SUPPORT_PERCENT: f64 = 3.0;

/// Maps of different length, each fitted to four fifths of the run and judged on the rest, all five
/// ways round.
pub(super) fn compare(run: &Run<'_>, shape: Shape, with_voltage: bool) -> Result<Vec<Judged>, MotorMapError> {
    let kinds: &[Terms] = if with_voltage { &Terms::ALL } else { &Terms::ALL[..1] };
    let mut judged: Vec<(Judged, Vec<f64>)> = Vec::new();
    for &terms in kinds {
        let by_motor: Vec<Rows> = (0..run.points.len())
            .map(|m| rows(run.craft, m, terms, &run.points[m], shape, run.middle_s))
            .collect();
        let (coefficients, fitted, parts) = held_out(run, &by_motor)
            .ok_or_else(|| MotorMapError::NotExcited { what: format!("a map of {}", terms.name()) })?;
        let count: f64 = by_motor.iter().map(|r| r.points.len() as f64).sum();
        let (fitted_rad_s, held_out_rad_s) =
            ((fitted / count).sqrt(), (parts.iter().sum::<f64>() / count).sqrt());
        let simpler = terms.against().filter(|_| with_voltage);
        let before = simpler.and_then(|s| judged.iter().find(|(j, _)| j.terms == s.name()));
        let (drop_percent, deviations) = before.map(|(_, simple)| fall(simple, &parts)).unzip();
        let supported = match (drop_percent, deviations) {
            (Some(drop), Some(deviations)) => drop > SUPPORT_PERCENT && deviations > SUPPORT_DEVIATIONS,
            _ => true,
        };
        judged.push((
            Judged {
                terms: terms.name(),
                coefficients,
                fitted_rad_s,
                held_out_rad_s,
                against: simpler.map(Terms::name),
                drop_percent,
                deviations,
                supported,
            },
            parts,
        ));
    }
    let mut judged: Vec<Judged> = judged.into_iter().map(|(j, _)| j).collect();
    // Of two maps with one term more, the better one.
    if let [_, _, product, quadratic] = judged.as_mut_slice()
        && product.supported
        && quadratic.supported
    {
        let better = product.held_out_rad_s < quadratic.held_out_rad_s;
        (product.supported, quadratic.supported) = (better, !better);
    }
    Ok(judged)
}

/// By how much the held-out squared error falls, percent, and the standard deviations by which that
/// stands out over the parts of the run.
fn fall(simple: &[f64], parts: &[f64]) -> (f64, f64) {
    let falls: Vec<f64> = simple.iter().zip(parts).map(|(a, b)| a - b).collect();
    let count = falls.len() as f64;
    let mean = falls.iter().sum::<f64>() / count;
    let spread = falls.iter().map(|f| (f - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let whole: f64 = simple.iter().sum();
    (100.0 * mean * count / whole, mean / (spread / count).sqrt().max(f64::MIN_POSITIVE))
}

/// Coefficients of a fit to everything, its squared error, and the held-out squared error of each
/// part of the run.
pub(super) fn held_out(run: &Run<'_>, by_motor: &[Rows]) -> Option<(Vec<f64>, f64, Vec<f64>)> {
    let width = by_motor.first()?.features.len();
    let mut all: Vec<(i64, Vec<f64>, f64)> = Vec::new();
    for (motor, rows) in by_motor.iter().enumerate() {
        for (i, &k) in rows.points.iter().enumerate() {
            let point = run.points[motor][k];
            let x = rows.features.iter().map(|f| f[i]).collect();
            all.push(((point.time_s / PART_S).floor() as i64, x, point.speed));
        }
    }
    let scale: Vec<f64> = (0..width)
        .map(|c| (all.iter().map(|(_, x, _)| x[c] * x[c]).sum::<f64>() / all.len() as f64).sqrt().max(1e-300))
        .collect();
    let solve = |leave_out: Option<i64>| -> Option<Vec<f64>> {
        let kept: Vec<_> = all
            .iter()
            .filter(|(part, ..)| leave_out.is_none_or(|fold| part.rem_euclid(FOLDS as i64) != fold))
            .collect();
        let x = nalgebra::DMatrix::from_fn(kept.len(), width, |r, c| kept[r].1[c] / scale[c]);
        let y = nalgebra::DVector::from_fn(kept.len(), |r, _| kept[r].2);
        let qr = x.qr();
        let right = qr.q().tr_mul(&y);
        let solved = qr.r().solve_upper_triangular(&right)?;
        Some(solved.iter().zip(&scale).map(|(v, s)| v / s).collect())
    };
    let error = |x: &[f64], y: f64, c: &[f64]| (y - x.iter().zip(c).map(|(a, b)| a * b).sum::<f64>()).powi(2);
    let whole = solve(None)?;
    let fitted = all.iter().map(|(_, x, y)| error(x, *y, &whole)).sum();
    let folds: Vec<Vec<f64>> = (0..FOLDS as i64).map(|fold| solve(Some(fold))).collect::<Option<_>>()?;
    let mut parts: BTreeMap<i64, f64> = BTreeMap::new();
    for (part, x, y) in &all {
        let fold = &folds[part.rem_euclid(FOLDS as i64) as usize];
        *parts.entry(*part).or_default() += error(x, *y, fold);
    }
    Some((whole, fitted, parts.into_values().collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_that_predicts_each_part_the_same_does_not_fall() {
        assert_eq!(fall(&[4.0, 5.0, 6.0], &[4.0, 5.0, 6.0]).0, 0.0);
    }

    /// Falls of 1, 2 and 3 of 30 in all: 20 %, and their mean of 2 has the standard error
    /// 1 / sqrt(3).
    #[test]
    fn a_fall_stands_out_by_its_students_t() {
        let (percent, deviations) = fall(&[8.0, 10.0, 12.0], &[7.0, 8.0, 9.0]);
        assert!((percent - 20.0).abs() < 1e-12, "{percent}");
        assert!((deviations - 2.0 * 3.0_f64.sqrt()).abs() < 1e-12, "{deviations}");
    }
}
