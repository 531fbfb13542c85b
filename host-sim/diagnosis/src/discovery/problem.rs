//! What a model leaves of flights, made white, and what the model's own coefficients cannot take of a column.

use model::Model;
use nalgebra::{DMatrix, DVector};
use sysid::filter::compose;
use sysid::fit::least_squares::{FlightRows, RowColumn};
use sysid::fit::slow;
use sysid::fit::terms::Terms;
use sysid::prepare::{ForceTarget, Prepared};

use crate::columns::rows_about;
use crate::discovery::whitening::{NoisyRows, Whitening, behind, most_likely};

/// Part of a column of the model that others of it must leave for it to count.
const INDEPENDENT: f64 = 1e-7;

/// Flights about a model as one regression: rows of all flights below each other, made white, for each axis.
pub(crate) struct Problem<'a> {
    pub(crate) model: &'a Model,
    flights: Vec<Flight<'a>>,
    /// Rows of all flights.
    pub(crate) rows: usize,
    /// What the model leaves, for each axis, of standard deviation 1 where nothing is left but noise.
    pub(crate) residual: [DVector<f64>; 6],
    /// An orthonormal basis of what the model's own coefficients can take, in its rows of each axis.
    basis: [Basis; 6],
    /// Vectors of the basis.
    pub(crate) taken: usize,
}

/// The rows of one axis of a basis.
pub(crate) struct Basis {
    /// The vectors that differ from zero there, ...
    pub(crate) of: Vec<usize>,
    /// ... each in a column.
    pub(crate) columns: DMatrix<f64>,
}

struct Flight<'a> {
    prepared: &'a Prepared,
    starts: Vec<usize>,
    /// First of its rows among those of all.
    first: usize,
    rows: usize,
    whitening: [Whitening; 6],
    /// One over the standard deviation of what the whitening leaves.
    scale: [f64; 6],
}

/// A column over the rows of all flights, made white; nothing where it does not act.
pub(crate) type White = [Option<Vec<f64>>; 6];

impl<'a> Problem<'a> {
    pub(crate) fn new(prepared: &[&'a Prepared], model: &'a Model) -> Self {
        let about = all_rows_about(prepared, model);
        let noise = noise_of(prepared, &about);
        Self::amid(&noise, (prepared, about), model)
    }

    /// The same where a model with more in it tells what of the residual is noise.
    pub(crate) fn amid_noise_of(better: &Model, prepared: &[&'a Prepared], model: &'a Model) -> Self {
        let noise = noise_of(prepared, &all_rows_about(prepared, better));
        Self::amid(&noise, (prepared, all_rows_about(prepared, model)), model)
    }

    fn amid(
        white: &[(Vec<Whitening>, f64); 6],
        (prepared, about): (&[&'a Prepared], Vec<FlightRows>),
        model: &'a Model,
    ) -> Self {
        let mut flights: Vec<Flight<'a>> = Vec::new();
        let mut rows = 0;
        for (index, (prepared, about)) in prepared.iter().zip(&about).enumerate() {
            flights.push(Flight {
                prepared,
                starts: about.starts.clone(),
                first: rows,
                rows: about.rows(),
                whitening: std::array::from_fn(|axis| white[axis].0[index].clone()),
                scale: std::array::from_fn(|axis| 1.0 / white[axis].1),
            });
            rows += about.rows();
        }
        let mut problem = Self {
            model,
            flights,
            rows,
            residual: std::array::from_fn(|_| DVector::zeros(rows)),
            basis: std::array::from_fn(|_| Basis { of: Vec::new(), columns: DMatrix::zeros(rows, 0) }),
            taken: 0,
        };
        let targets: Vec<RowColumn> = about.iter().map(|rows| rows.targets.clone().map(Some)).collect();
        let mut residual = problem.white(&targets);
        let count = about.first().map_or(0, |rows| rows.columns.len());
        let columns: Vec<White> = (0..count)
            .map(|k| {
                let of: Vec<RowColumn> = about.iter().map(|rows| rows.columns[k].clone()).collect();
                problem.white(&of)
            })
            .collect();
        (problem.basis, problem.taken) = basis(&columns, rows);
        problem.take_out(&mut residual);
        problem.residual = residual.map(|axis| DVector::from_vec(axis.unwrap_or_else(|| vec![0.0; rows])));
        problem
    }

    /// What terms contribute, made white; a column for each parameter.
    pub(crate) fn columns(&self, terms: &impl Terms) -> Vec<White> {
        let by_flight = self
            .flights
            .iter()
            .map(|flight| {
                let mut columns = flight.prepared.columns_of_terms(terms, self.model);
                if slow::is_taken(flight.prepared) {
                    let stride = flight.prepared.fit_stride();
                    columns.iter_mut().for_each(|c| slow::take_from_column(flight.prepared, stride, c));
                }
                columns
            })
            .collect();
        self.white_columns(by_flight)
    }

    /// Columns of each flight, made white.
    pub(crate) fn white_columns(&self, by_flight: Vec<Vec<RowColumn>>) -> Vec<White> {
        let count = by_flight.first().map_or(0, Vec::len);
        let mut by_flight: Vec<std::vec::IntoIter<RowColumn>> =
            by_flight.into_iter().map(Vec::into_iter).collect();
        (0..count)
            .map(|_| {
                let of: Vec<RowColumn> =
                    by_flight.iter_mut().map(|columns| columns.next().unwrap_or_default()).collect();
                self.white(&of)
            })
            .collect()
    }

    /// The flights.
    pub(crate) fn prepared(&self) -> impl Iterator<Item = &'a Prepared> {
        self.flights.iter().map(|flight| flight.prepared)
    }

    /// Makes values side by side white, rows of a flight from its row `first` on, behind `past` rows before these.
    pub(crate) fn whiten_rows(
        &self,
        (flight, axis): (usize, usize),
        rows: (&mut [f32], usize),
        (past, first): (usize, usize),
    ) {
        let flight = &self.flights[flight];
        flight.whitening[axis].apply_to_rows(rows, (past, first), &flight.starts, flight.scale[axis]);
    }

    /// A column of each flight, made white, over the rows of all.
    fn white(&self, of_flights: &[RowColumn]) -> White {
        std::array::from_fn(|axis| {
            if of_flights.iter().all(|column| column[axis].is_none()) {
                return None;
            }
            let mut all = Vec::with_capacity(self.rows);
            for (flight, column) in self.flights.iter().zip(of_flights) {
                match &column[axis] {
                    Some(values) => {
                        let white = flight.whitening[axis].apply(values, &flight.starts);
                        all.extend(white.into_iter().map(|value| value * flight.scale[axis]));
                    }
                    None => all.extend(std::iter::repeat_n(0.0, flight.rows)),
                }
            }
            Some(all)
        })
    }

    /// Takes out of a column what the model's own coefficients can take.
    pub(crate) fn take_out(&self, column: &mut White) {
        self.take_out_absorbed(column, &self.absorbed(column));
    }

    /// How much of each vector of the basis there is in a column.
    pub(crate) fn absorbed(&self, column: &White) -> DVector<f64> {
        let mut absorbed = DVector::zeros(self.taken);
        for (basis, values) in self.basis.iter().zip(column) {
            let Some(values) = values else { continue };
            let own = basis.columns.tr_mul(&nalgebra::DVectorView::from_slice(values, values.len()));
            basis.of.iter().zip(own.iter()).for_each(|(k, part)| absorbed[*k] += part);
        }
        absorbed
    }

    /// Takes so much of each vector of the basis out of a column.
    pub(crate) fn take_out_absorbed(&self, column: &mut White, absorbed: &DVector<f64>) {
        for (basis, values) in self.basis.iter().zip(column.iter_mut()) {
            let own = DVector::from_iterator(basis.of.len(), basis.of.iter().map(|k| absorbed[*k]));
            if own.amax() == 0.0 {
                continue;
            }
            let taken = &basis.columns * own;
            let values = values.get_or_insert_with(|| vec![0.0; self.rows]);
            values.iter_mut().zip(taken.iter()).for_each(|(value, taken)| *value -= taken);
        }
    }

    /// The basis of an axis.
    pub(crate) const fn basis(&self, axis: usize) -> &Basis {
        &self.basis[axis]
    }

    /// Rows of each flight among those of all.
    pub(crate) fn ranges(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.flights.iter().map(|flight| flight.first..flight.first + flight.rows)
    }
}

/// The rows of flights about a model.
fn all_rows_about(prepared: &[&Prepared], model: &Model) -> Vec<FlightRows> {
    let own = model.effects();
    prepared.iter().map(|flight| rows_about(flight, model, &own)).collect()
}

/// What makes the rows of each axis white in each flight, and the standard deviation of what that leaves.
fn noise_of(prepared: &[&Prepared], about: &[FlightRows]) -> [(Vec<Whitening>, f64); 6] {
    let noises: Vec<[Noise; 2]> = prepared.iter().map(|flight| Noise::of(flight)).collect();
    std::array::from_fn(|axis| {
        let kind = usize::from(axis >= 3);
        let noisy: Vec<NoisyRows<'_>> = about
            .iter()
            .zip(&noises)
            .map(|(about, noise)| NoisyRows {
                signal: &about.targets[axis],
                starts: &about.starts,
                sensor: &noise[kind].sensor,
                acceleration: &noise[kind].acceleration,
            })
            .collect();
        most_likely(&noisy)
    })
}

/// Autocovariances of noise at the rows of a flight's axes of one kind.
struct Noise {
    sensor: Vec<f64>,
    acceleration: Vec<f64>,
}

impl Noise {
    /// Of forces and of moments.
    fn of(flight: &Prepared) -> [Self; 2] {
        let (filter, stride) = (&flight.filter, flight.fit_stride());
        let slope = &filter.derivative;
        let twice = || compose(slope, slope);
        let (force_sensor, force_acceleration) = match flight.force_target {
            ForceTarget::Imu => (filter.smooth.clone(), filter.smooth.clone()),
            ForceTarget::Velocity => (slope.clone(), filter.between.clone()),
            ForceTarget::Position => (twice(), compose(&filter.between, &filter.matched)),
        };
        let noise = |sensor: &[f64], acceleration: &[f64]| Self {
            sensor: behind(sensor, stride),
            acceleration: behind(acceleration, stride),
        };
        [noise(&force_sensor, &force_acceleration), noise(slope, &filter.between)]
    }
}

/// An orthonormal basis of columns over the rows of all axes, those that others repeat left out.
fn basis(columns: &[White], rows: usize) -> ([Basis; 6], usize) {
    let mut found: Vec<DVector<f64>> = Vec::new();
    for column in columns {
        let mut vector = DVector::zeros(6 * rows);
        for (axis, values) in column.iter().enumerate() {
            if let Some(values) = values {
                vector.rows_mut(axis * rows, rows).copy_from_slice(values);
            }
        }
        let whole = vector.norm();
        // Twice is enough (Giraud, Langou and Rozloznik 2005).
        for _ in 0..2 {
            for other in &found {
                let part = other.dot(&vector);
                vector.axpy(-part, other, 1.0);
            }
        }
        let left = vector.norm();
        if left > INDEPENDENT * whole && left > 0.0 {
            found.push(vector / left);
        }
    }
    let of_axis = |axis: usize| {
        let rows_of = |k: usize| found[k].rows(axis * rows, rows);
        let of: Vec<usize> = (0..found.len()).filter(|k| rows_of(*k).amax() > 0.0).collect();
        let columns = DMatrix::from_fn(rows, of.len(), |row, k| found[of[k]][axis * rows + row]);
        Basis { of, columns }
    };
    (std::array::from_fn(of_axis), found.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::discovery::channels::Channel;
    use crate::discovery::form::FormedOnce;
    use crate::testing::{ORDINARY, prepared, truth};

    fn square(white: &White) -> f64 {
        white.iter().flatten().flatten().map(|value| value * value).sum()
    }

    /// Of noise behind filters that differentiate it, neighbouring rows are alike by 0.6 and more. White ones are by chance, 1 / sqrt(rows)
    /// for one axis. On the axes of forces, behind two derivatives of the position, some of the colour is left: a third of it here.
    #[test]
    fn what_the_true_model_leaves_is_made_white_and_of_unit_variance() {
        let model = truth();
        let flights = prepared(&model, 30..33, 12.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let problem = Problem::new(&flights, &model);
        let neighbours = |rows: &[f64]| {
            let squares: f64 = rows.iter().map(|row| row * row).sum();
            rows.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / squares
        };
        let raw = all_rows_about(&flights, &model);
        for (axis, white) in problem.residual.iter().enumerate() {
            let (before, after) = (neighbours(&raw[0].targets[axis]), neighbours(white.as_slice()));
            let most = if axis < 3 { 0.5 * before } else { 4.0 / (problem.rows as f64).sqrt() };
            assert!(before > 0.5 && after.abs() < most, "{axis}: {before}, then {after}");
            // The model's own coefficients, some of which act on each axis, take a thousandth each.
            let variance = white.norm_squared() / problem.rows as f64;
            assert!((0.98..=1.0).contains(&variance), "{axis}: {variance}");
        }
    }

    /// The thrust is one of the model's effects, a force along north is none. By Pythagoras, what is absorbed and what is left make up the
    /// whole of a column.
    #[test]
    fn what_the_model_takes_of_a_column_is_taken_out_and_nothing_else() {
        let model = truth();
        let flights = prepared(&model, 30..31, 6.0, &ORDINARY);
        let flights: Vec<&Prepared> = flights.iter().collect();
        let problem = Problem::new(&flights, &model);
        let columns = problem.columns(&FormedOnce(vec![Channel::Thrust, Channel::Earth(0)]));
        let [thrust, north] = &columns[..] else { panic!("two ways to act") };
        let left = |column: &White| {
            let mut left = column.clone();
            problem.take_out(&mut left);
            left
        };
        assert!(square(&left(thrust)) < 1e-18 * square(thrust));
        let of_north = left(north);
        let (whole, rest) = (square(north), square(&of_north));
        assert!(rest > 0.01 * whole && rest < 0.99 * whole, "{rest} of {whole}");
        let absorbed = problem.absorbed(north).norm_squared();
        assert!((absorbed + rest - whole).abs() < 1e-9 * whole, "{absorbed} + {rest}, {whole}");
        assert!((square(&left(&of_north)) - rest).abs() < 1e-9 * rest);
    }

    /// (3, 4) along u becomes (0.6, 0.8); its double is a repetition. Of a column that is (1, 0) along u and (0, 1) about p, (0.64, -0.48)
    /// and (0, 1) are left, of the square 1.64.
    #[test]
    fn the_basis_is_orthonormal_and_leaves_repetitions_out() {
        let column = |u: [f64; 2], p: Option<[f64; 2]>| {
            let mut column = White::default();
            (column[0], column[3]) = (Some(u.into()), p.map(Into::into));
            column
        };
        let columns =
            [column([3.0, 4.0], None), column([6.0, 8.0], None), column([1.0, 0.0], Some([0.0, 1.0]))];
        let (basis, taken) = basis(&columns, 2);
        assert_eq!((taken, &basis[0].of[..], &basis[3].of[..]), (2, &[0, 1][..], &[1][..]));
        let norm = 1.64_f64.sqrt();
        let expected = DMatrix::from_columns(&[
            DVector::from_vec(vec![0.6, 0.8]),
            DVector::from_vec(vec![0.64 / norm, -0.48 / norm]),
        ]);
        assert!((&basis[0].columns - expected).amax() < 1e-12, "{}", basis[0].columns);
        assert!((&basis[3].columns - DMatrix::from_vec(2, 1, vec![0.0, 1.0 / norm])).amax() < 1e-12);
        assert!([1, 2, 4, 5].iter().all(|axis| basis[*axis].of.is_empty()));
    }
}
