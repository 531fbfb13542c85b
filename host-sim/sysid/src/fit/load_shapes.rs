//! A slung load's shapes: what a cable of a given length and damping would explain.
//!
//! The search over shapes (`starts.rs`) asks this a hundred times, so all that a shape does not change is formed once for each
//! flight: what the model without the load leaves, its linear columns, and their products. A load of no mass pulls in
//! proportion to its mass, so a shape costs the swing, one filtered column, and products of it with the rest.
//!
//! How each piece begins is taken out of the columns c and the residual (`swing.rs`) without forming them anew: with the free
//! swings F of a piece and its normal equations N = F'F + K,
//!
//! ```text
//! (c - F N^-1 F'c)'(d - F N^-1 F'd),    axis by axis, from F'c, F'd, F'F and c'd of each axis
//! ```
//!
//! Each axis keeps its own products, because each is weighted by its own noise.

use model::{Effect, Model};
use nalgebra::{DMatrix, DVector, Matrix4, Matrix4xX};

use crate::filter::sum_of_products;
use crate::fit::least_squares::RowColumn;
use crate::fit::parameters::step_end;
use crate::fit::shapes::{End, Shapes};
use crate::fit::slung_load::{Carried, SWING_RAD, of_model};
use crate::fit::unloaded::Unloaded;
use crate::prepare::Prepared;

/// Share of a slung load in the craft's mass that is ordinary: with no mass yet, the swing at the beginning is taken out as that of
/// such a one.
const ORDINARY_SHARE: f64 = 0.05;
/// A pivot this small against its column's square means that columns repeat each other.
const COLLINEAR: f64 = 1e-12;

/// Flights on which loads are tried.
pub(crate) struct LoadShapes {
    /// The effect that hangs them: mass, length of the cable, damping.
    effect: Effect,
    model: Model,
    flights: Vec<Flight>,
    /// Columns, the load's mass last.
    count: usize,
}

/// A column of the regression on one of the force axes.
struct Entry {
    column: usize,
    axis: usize,
    values: Vec<f64>,
    /// Times how much of north and east is in the axis.
    north_east: [Vec<f64>; 2],
}

/// What a shape does not change.
struct Flight {
    unloaded: Unloaded,
    /// How much of north and east is in each axis at the rows.
    north_east: [[Vec<f64>; 2]; 3],
    /// Products of these, of each axis: north north, north east, east east.
    squares: [[Vec<f64>; 3]; 3],
    /// Linear columns, then the residual, on the axes where they are.
    entries: Vec<Entry>,
    /// Their products on each axis; nothing in the load's row and column.
    products: [DMatrix<f64>; 3],
}

impl LoadShapes {
    /// For a model with the linear coefficients of a fit without the load.
    pub(crate) fn new(flights: &[&Prepared], model: &Model, linear: &[Effect], effect: Effect) -> Self {
        let stride = |flight: &&Prepared| flight.fit_stride();
        let columns: Vec<_> =
            flights.iter().map(|flight| flight.columns(linear, model, stride(flight), None)).collect();
        let acts = |k: &usize| columns.iter().any(|all| all[*k][..3].iter().any(Option::is_some));
        let acting: Vec<usize> = (0..columns.first().map_or(0, Vec::len)).filter(acts).collect();
        let count = acting.len() + 1;
        let prepare = |(flight, columns): (&&Prepared, Vec<RowColumn>)| {
            let unloaded = Unloaded::new(flight, model, stride(flight));
            let of_columns = acting.iter().enumerate().flat_map(|(place, &k)| {
                let on_axes = columns[k][..3].iter().enumerate();
                on_axes.filter_map(move |(axis, values)| Some((place, axis, values.clone()?)))
            });
            let residual = (0..3).map(|axis| (count, axis, unloaded.residual[axis].clone()));
            let all: Vec<_> = of_columns.chain(residual).collect();
            Flight::new(unloaded, all, count)
        };
        Self {
            effect,
            model: model.clone(),
            flights: flights.iter().zip(columns).map(prepare).collect(),
            count,
        }
    }

    /// Products of the columns and the residual on each axis, the beginnings of pieces taken out.
    fn products(&self, carried: &Carried) -> [DMatrix<f64>; 3] {
        let width = self.count + 1;
        let mut sums = std::array::from_fn(|_| DMatrix::zeros(width, width));
        for flight in &self.flights {
            flight.add_products(carried, self.count - 1, &mut sums);
        }
        sums
    }
}

impl Shapes for LoadShapes {
    fn solve(&mut self, shape: &[f64]) -> Option<End> {
        let mut values = vec![0.0, shape[1], shape[2]];
        self.model.set(self.effect, &values);
        let mut carried = of_model(&self.model)?;
        carried.share = ORDINARY_SHARE;
        let products = self.products(&carried);
        let rows: usize = self.flights.iter().map(|flight| flight.unloaded.dcm().len()).sum();
        let (solution, sigma) = weighted(&products, rows)?;
        let score = sigma.iter().map(|s| s.ln()).sum::<f64>();
        let square = |axis: &DMatrix<f64>| axis[(self.count, self.count)] / rows as f64;
        let without = products.iter().map(|axis| 0.5 * square(axis).ln()).sum();
        values[0] = step_end(0.0, solution[self.count - 1], &self.effect.info().coefficients[0]);
        (score.is_finite() && values.iter().all(|v| v.is_finite())).then_some(End { score, without, values })
    }
}

impl Flight {
    fn new(unloaded: Unloaded, columns: Vec<(usize, usize, Vec<f64>)>, count: usize) -> Self {
        let direction =
            |axis, towards| unloaded.dcm().iter().map(|dcm| dcm[(axis, towards)]).collect::<Vec<f64>>();
        let north_east: [[Vec<f64>; 2]; 3] =
            std::array::from_fn(|axis| std::array::from_fn(|towards| direction(axis, towards)));
        let squares = north_east.each_ref().map(|[n, e]| [product(n, n), product(n, e), product(e, e)]);
        let entry = |(column, axis, values): (usize, usize, Vec<f64>)| {
            let north_east = north_east[axis].each_ref().map(|towards| product(&values, towards));
            Entry { column, axis, values, north_east }
        };
        let entries: Vec<Entry> = columns.into_iter().map(entry).collect();
        let mut products: [DMatrix<f64>; 3] = std::array::from_fn(|_| DMatrix::zeros(count + 1, count + 1));
        for a in &entries {
            for b in entries.iter().filter(|b| b.axis == a.axis) {
                products[a.axis][(a.column, b.column)] += sum_of_products(&a.values, &b.values);
            }
        }
        Self { unloaded, north_east, squares, entries, products }
    }

    /// Adds the products with the load's pull in column `load`.
    fn add_products(&self, carried: &Carried, load: usize, sums: &mut [DMatrix<f64>; 3]) {
        let width = sums[0].ncols();
        let free = self.unloaded.free_swings(carried);
        let pull = self.unloaded.pull_from(carried, &[]).0;
        let per_mass = carried.part_per_kg();
        let mut axes = pull.into_iter().enumerate().map(|(axis, mut values)| {
            values.iter_mut().for_each(|value| *value *= per_mass);
            let north_east = self.north_east[axis].each_ref().map(|towards| product(&values, towards));
            Entry { column: load, axis, values, north_east }
        });
        let [Some(u), Some(v), Some(w)] = [axes.next(), axes.next(), axes.next()] else { return };
        let pull = [u, v, w];
        for (axis, sum) in sums.iter_mut().enumerate() {
            *sum += &self.products[axis];
            let own = &pull[axis].values;
            sum[(load, load)] += sum_of_products(own, own);
            for entry in self.entries.iter().filter(|entry| entry.axis == axis) {
                let with = sum_of_products(own, &entry.values);
                sum[(load, entry.column)] += with;
                sum[(entry.column, load)] += with;
            }
        }
        for rows in self.unloaded.rows_of_pieces() {
            let free = free.each_ref().map(|free| &free[..rows.len()]);
            let pairs = [product(free[0], free[0]), product(free[0], free[1]), product(free[1], free[1])];
            let mut with_columns: [Matrix4xX<f64>; 3] = std::array::from_fn(|_| Matrix4xX::zeros(width));
            let mut sideways = 0.0;
            for entry in self.entries.iter().chain(&pull) {
                for (towards, values) in entry.north_east.iter().enumerate() {
                    for (solution, free) in free.iter().enumerate() {
                        with_columns[entry.axis][(2 * towards + solution, entry.column)] +=
                            sum_of_products(&values[rows.clone()], free);
                    }
                }
                if entry.column == width - 1 && entry.axis < 2 {
                    let values = &entry.values[rows.clone()];
                    sideways += sum_of_products(values, values);
                }
            }
            let own: [Matrix4<f64>; 3] = self.squares.each_ref().map(|squares| {
                Matrix4::from_fn(|r, c| {
                    let towards = r / 2 + c / 2;
                    sum_of_products(&squares[towards][rows.clone()], &pairs[r % 2 + c % 2])
                })
            });
            let known = self.unloaded.known(sideways, rows.len(), carried, SWING_RAD);
            let known = Matrix4::from_diagonal(&[known.x, known.y, known.x, known.y].into());
            let Some(inverse) = (own[0] + own[1] + own[2] + known).try_inverse() else { continue };
            let explained = inverse * (&with_columns[0] + &with_columns[1] + &with_columns[2]);
            for ((sum, with_columns), own) in sums.iter_mut().zip(&with_columns).zip(own) {
                let cross = with_columns.tr_mul(&explained);
                *sum += explained.tr_mul(&(own * &explained)) - &cross - cross.transpose();
            }
        }
    }
}

/// Element by element.
fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// Least squares from the products of columns and residual on three axes, each weighted by what noise is left on it: the coefficients and
/// the standard deviations of what is left. As `least_squares.rs` does it from rows.
fn weighted(products: &[DMatrix<f64>; 3], rows: usize) -> Option<(DVector<f64>, [f64; 3])> {
    let count = products[0].ncols() - 1;
    let mut sigma = [1.0; 3];
    let mut value = solved(products, &sigma)?;
    for _ in 0..2 {
        for (sigma, axis) in sigma.iter_mut().zip(products) {
            let with_target = DVector::from_fn(count + 1, |k, _| if k < count { -value[k] } else { 1.0 });
            let square = with_target.dot(&(axis * &with_target));
            *sigma = (square.max(0.0) / rows.max(1) as f64).sqrt().max(1e-9);
        }
        value = solved(products, &sigma)?;
    }
    Some((value, sigma))
}

fn solved(products: &[DMatrix<f64>; 3], sigma: &[f64; 3]) -> Option<DVector<f64>> {
    let count = products[0].ncols() - 1;
    let sum = |r: usize, c: usize| -> f64 {
        products.iter().zip(sigma).map(|(axis, sigma)| axis[(r, c)] / (sigma * sigma)).sum()
    };
    let scale: Vec<f64> = (0..count).map(|k| sum(k, k).sqrt()).collect();
    if scale.iter().any(|s| !(*s > 0.0) || !s.is_finite()) {
        return None;
    }
    let normal = DMatrix::from_fn(count, count, |r, c| sum(r, c) / (scale[r] * scale[c]));
    let factor = normal.cholesky()?;
    if factor.l_dirty().diagonal().iter().any(|pivot| !(pivot * pivot > COLLINEAR)) {
        return None;
    }
    let right = DVector::from_fn(count, |r, _| sum(r, count) / scale[r]);
    let scaled = factor.solve(&right);
    Some(DVector::from_fn(count, |r, _| scaled[r] / scale[r]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{NONE, fly, truth};

    /// Products of columns a, b and a target on one axis.
    fn products(a: &[f64], b: &[f64], target: &[f64]) -> DMatrix<f64> {
        let all = [a, b, target];
        DMatrix::from_fn(3, 3, |r, c| all[r].iter().zip(all[c]).map(|(x, y)| x * y).sum())
    }

    #[test]
    fn the_least_squares_of_the_products_are_those_of_the_rows() {
        // The target is 2 a - 3 b on every axis, and an offset of 0.1 beside both on the last.
        let (a, b) = ([1.0, 2.0, 0.0, -1.0], [0.0, 1.0, 1.0, 2.0]);
        let target: Vec<f64> = a.iter().zip(&b).map(|(a, b)| 2.0 * a - 3.0 * b).collect();
        let exact = products(&a, &b, &target);
        let (value, sigma) = weighted(&[exact.clone(), exact.clone(), exact], 4).unwrap();
        assert!((value[0] - 2.0).abs() < 1e-9 && (value[1] + 3.0).abs() < 1e-9, "{value}");
        assert!(sigma.iter().all(|s| *s < 1e-6));
    }

    /// Two axes say that the one coefficient is 1, with noise of 0.1, and one that it is 2, with
    /// noise of 1.
    #[test]
    fn an_axis_counts_by_the_noise_that_is_left_on_it() {
        let axis = |value: f64, noise: f64| {
            let column: Vec<f64> = (0..200).map(|_| 1.0).collect();
            let target: Vec<f64> =
                (0..200).map(|k| value + if k % 2 == 0 { noise } else { -noise }).collect();
            let all = [&column, &target];
            DMatrix::from_fn(2, 2, |r, c| all[r].iter().zip(all[c]).map(|(x, y)| x * y).sum())
        };
        let (value, sigma) = weighted(&[axis(1.0, 0.1), axis(1.0, 0.1), axis(2.0, 1.0)], 200).unwrap();
        assert!(value[0] > 1.0 && value[0] < 1.05, "{value}");
        assert!(sigma[2] > 5.0 * sigma[0], "{sigma:?}");
    }

    #[test]
    fn columns_that_repeat_each_other_or_are_not_there_have_no_solution() {
        let a = [1.0, 2.0, 3.0];
        let repeated = products(&a, &a.map(|v| 2.0 * v), &a);
        let none = products(&a, &[0.0; 3], &a);
        for axis in [repeated, none] {
            assert!(weighted(&[axis.clone(), axis.clone(), axis], 3).is_none());
        }
    }

    #[test]
    fn a_load_is_seen_by_the_cable_it_hangs_on_and_nothing_by_any() {
        let bare = truth();
        let mut loaded = bare.clone();
        loaded.set(Effect::SlungLoad, &[0.12, 0.6, 0.05]);
        let linear: Vec<Effect> = Effect::basic().collect();
        let mass_at = |flown: &Model, length: f64| {
            let flight = Prepared::new(&fly(flown, 4, 12.0, &NONE), &flown.vehicle).unwrap();
            let end = LoadShapes::new(&[&flight], &bare, &linear, Effect::SlungLoad)
                .solve(&[0.0, length, 0.05])
                .unwrap();
            (end.values[0], end.without - end.score)
        };
        let (mass_kg, explained) = mass_at(&loaded, 0.6);
        assert!((mass_kg - 0.12).abs() < 0.03 && explained > 0.5, "{mass_kg} kg explain {explained}");
        assert!(mass_at(&loaded, 2.5).1 < explained);
        assert!(mass_at(&bare, 0.6).0.abs() < 0.01);
    }
}
