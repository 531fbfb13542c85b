//! All forms at once: every way to act, over hats of every variable, against what the model leaves.
//!
//! A shape on the knots of the hats is a weighted sum of their columns. With the hats' cross products, what a shape would take of
//! the residual costs a few products of numbers, so that all of them are tried on the residual and on residuals of random phases.

use nalgebra::{DMatrix, DVector};
use sysid::fit::even_hats::EvenHats;

use crate::discovery::against::Against;
use crate::discovery::form::{Factor, Form};
use crate::discovery::hats::{Bases, CrossProducts, Products, Quantities};
use crate::discovery::problem::Problem;
use crate::discovery::shapes::{Shape, Span};
use crate::discovery::variables::Variable;

/// Part of a shape's square that the model must leave.
const LEAST_LEFT: f64 = 1e-3;

/// A form and what it would take of the residual.
#[derive(Debug, Clone)]
pub(crate) struct Scored {
    pub(crate) form: Form,
    /// Numbers that are chosen for it.
    pub(crate) count: usize,
    /// Fall of the residual's squares, in variances of the noise.
    pub(crate) gain: f64,
}

impl Scored {
    /// The gain less what as many numbers cost by chance.
    pub(crate) fn worth(&self, rows: usize) -> f64 {
        self.gain - cost(self.count, rows)
    }
}

/// What fitted numbers cost (Schwarz 1978).
pub(crate) fn cost(count: usize, rows: usize) -> f64 {
    count as f64 * (rows.max(2) as f64).ln()
}

/// What was found over one variable.
pub(crate) struct Found {
    /// The best shapes of each base.
    pub(crate) best: Vec<Scored>,
    /// The greatest worth for each of the residuals of random phases.
    pub(crate) by_chance: Vec<f64>,
}

/// Tries all shapes of one variable with all bases.
pub(crate) fn over_variable(
    problem: &Problem<'_>,
    against: &Against,
    (bases, quantities): (&[Bases<'_>], &Quantities),
    (variables, variable): (&[Variable], usize),
    (span, knot_count): (Span, usize),
) -> Found {
    let mut by_chance = vec![f64::NEG_INFINITY; against.residuals - 1];
    let hats = EvenHats { ends: [span.low, span.high], count: knot_count };
    let (shapes, values) = over(span.shapes(), hats);
    let mut best = Vec::new();
    for bases in bases {
        let Some((taking, products)) =
            CrossProducts::new((problem, against), bases, (quantities, variable), hats)
        else {
            continue;
        };
        for (place, base) in taking.iter().enumerate() {
            let amplitudes = base.channel.amplitudes();
            let products = Independent::new(products.of(place, against), against, amplitudes);
            let mut scored: Vec<Scored> = Vec::new();
            for (shape, gains) in shapes.iter().zip(products.gains(&values)) {
                let Some(gains) = gains else { continue };
                let mut form = base.clone();
                form.factors.push(Factor { variable, shape: *shape });
                let count = form.count(variables);
                let numbers = cost(count, problem.rows);
                for (most, gain) in by_chance.iter_mut().zip(gains.iter().skip(1)) {
                    *most = most.max(gain - numbers);
                }
                scored.push(Scored { form, count, gain: gains[0] });
            }
            best.extend(best_of_each_family(scored, problem.rows));
        }
    }
    Found { best, by_chance }
}

/// Shapes that have values on all the knots of hats, and these values, a column for each.
fn over(shapes: Vec<Shape>, hats: EvenHats) -> (Vec<Shape>, DMatrix<f64>) {
    let column = |shape: &Shape| DVector::from_fn(hats.count, |k, _| shape.at(hats.knot(k)));
    let finite = shapes.into_iter().map(|shape| (shape, column(&shape)));
    let (shapes, columns): (Vec<Shape>, Vec<DVector<f64>>) =
        finite.filter(|(_, values)| values.iter().all(|value| value.is_finite())).unzip();
    let values = DMatrix::from_fn(hats.count, columns.len(), |row, k| columns[k][row]);
    (shapes, values)
}

/// The best two families, each by its best shape.
fn best_of_each_family(mut scored: Vec<Scored>, rows: usize) -> Vec<Scored> {
    scored.sort_by(|one, other| other.worth(rows).total_cmp(&one.worth(rows)));
    let family = |scored: &Scored| scored.form.factors.last().map(|factor| factor.shape.family);
    let mut kept: Vec<Scored> = Vec::new();
    for one in scored {
        if kept.len() < 2 && !kept.iter().any(|other| family(other) == family(&one)) {
            kept.push(one);
        }
    }
    kept
}

/// Cross products of the hats of one base.
struct Independent {
    /// Of the hats with each other, what the model takes left out.
    gram: DMatrix<f64>,
    /// With nothing left out.
    whole: DMatrix<f64>,
    /// With the residuals.
    with_residual: DMatrix<f64>,
    amplitudes: usize,
}

impl Independent {
    fn new(products: Products, against: &Against, amplitudes: usize) -> Self {
        let Products { gram: whole, against: with } = products;
        let absorbed = with.columns(0, against.taken);
        let gram = &whole - absorbed * absorbed.transpose();
        let with_residual = with.columns(against.taken, against.residuals).into_owned();
        Self { gram, whole, with_residual, amplitudes }
    }

    /// What each shape takes of each residual; nothing where the model takes the shape itself. Shapes are columns of values on the knots.
    fn gains(&self, shapes: &DMatrix<f64>) -> Vec<Option<DVector<f64>>> {
        let (d, hats) = (self.amplitudes, shapes.nrows());
        // Of shapes with themselves, one way to act with another.
        let squares = |of: &DMatrix<f64>, row: usize, column: usize| -> Vec<f64> {
            let with = of.view((row * hats, column * hats), (hats, hats)) * shapes;
            shapes.column_iter().zip(with.column_iter()).map(|(shape, with)| shape.dot(&with)).collect()
        };
        let pairs = |k: usize| (k / d, k % d);
        let left: Vec<Vec<f64>> =
            (0..d * d).map(pairs).map(|(row, column)| squares(&self.gram, row, column)).collect();
        let whole: Vec<Vec<f64>> = (0..d).map(|k| squares(&self.whole, k, k)).collect();
        let right: Vec<DMatrix<f64>> =
            (0..d).map(|k| self.with_residual.rows(k * hats, hats).tr_mul(shapes)).collect();
        let is_left = |shape: usize, k: usize| {
            left[k * d + k][shape].partial_cmp(&(LEAST_LEFT * whole[k][shape]))
                == Some(std::cmp::Ordering::Greater)
        };
        let gains_of = |shape: usize| {
            if !(0..d).all(|k| is_left(shape, k)) {
                return None;
            }
            let square = DMatrix::from_fn(d, d, |row, column| left[row * d + column][shape]);
            let right = DMatrix::from_fn(d, self.with_residual.ncols(), |k, of| right[k][(of, shape)]);
            let solved = square.cholesky()?.solve(&right);
            Some(DVector::from_fn(right.ncols(), |k, _| right.column(k).dot(&solved.column(k))))
        };
        (0..shapes.ncols()).map(gains_of).collect()
    }
}

#[cfg(test)]
mod tests {
    use model::Axis;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::discovery::channels::Channel;
    use crate::discovery::shapes::Family;

    fn beside(one: &DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
        DMatrix::from_columns(&one.column_iter().chain(other.column_iter()).collect::<Vec<_>>())
    }

    /// Two ways to act, three shapes on four knots, and a model of two columns, one of which is the last shape acting the second way. By
    /// how much squares fall with a shape is what a fit by singular values says: no product of hats is in that.
    #[test]
    fn a_shape_gains_what_a_fit_beside_the_model_takes() {
        const SEED: u64 = 5;
        let mut rng = Pcg64Mcg::seed_from_u64(SEED);
        let mut random = |rows, columns| DMatrix::from_fn(rows, columns, |_, _| rng.random::<f64>() - 0.5);
        let (hats, shapes, mut own) = (random(60, 2 * 4), random(4, 3), random(60, 2));
        let acting = |shape: usize| {
            DMatrix::from_columns(&[0, 4].map(|first| hats.columns(first, 4) * shapes.column(shape)))
        };
        own.set_column(0, &acting(2).column(1));
        let model = own.qr().q();
        let residuals = random(60, 2);
        let residuals = &residuals - &model * model.tr_mul(&residuals);
        let against = Against {
            axes: std::array::from_fn(|_| DMatrix::zeros(2, 60)),
            of_basis: std::array::from_fn(|_| Vec::new()),
            taken: 2,
            residuals: 2,
        };
        let products =
            Products { gram: hats.tr_mul(&hats), against: hats.tr_mul(&beside(&model, &residuals)) };
        let gains = Independent::new(products, &against, 2).gains(&shapes);
        assert!(gains[2].is_none(), "seed {SEED}: the model has it");
        for (shape, gains) in gains.iter().take(2).enumerate() {
            let columns = beside(&model, &acting(shape));
            let fitted = &columns * columns.clone().svd(true, true).solve(&residuals, 1e-12).unwrap();
            for (k, gain) in gains.as_ref().unwrap().iter().enumerate() {
                let left = residuals.column(k) - fitted.column(k);
                let expected = residuals.column(k).norm_squared() - left.norm_squared();
                assert!((gain - expected).abs() < 1e-10, "seed {SEED}: {gain}, {expected}");
            }
        }
    }

    /// Of 1000 rows, a number costs ln 1000 = 6.907755: three that gain 60 are worth less than one that gains 50.
    #[test]
    fn the_best_shapes_of_the_two_best_families_are_kept() {
        let scored = |family, count, gain| {
            let shape = Shape { family, parameters: [0.5; 2] };
            let factors = vec![Factor { variable: 0, shape }];
            Scored { form: Form { channel: Channel::Body(Axis::W), factors }, count, gain }
        };
        let all = vec![
            scored(Family::Bump, 3, 59.0),
            scored(Family::Bump, 3, 60.0),
            scored(Family::Cube, 1, 45.0),
            scored(Family::Square, 1, 50.0),
        ];
        assert!((all[1].worth(1000) - 39.276_734).abs() < 1e-6);
        let kept = best_of_each_family(all, 1000);
        assert_eq!(kept.iter().map(|one| one.gain).collect::<Vec<_>>(), [50.0, 60.0]);
    }
}
