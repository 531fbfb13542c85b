//! Fits from what is kept of flights: of one flight, of many, and of all but one.
//!
//! Coefficients fall into groups that share no axis; each group is a least squares of its own.

use model::AXES;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use sysid::fit::least_squares::{
    AxisTriangle, Prior, Solution, Unidentifiable, short_record, solve_triangles,
};

use crate::equations::{AxisEquations, Columns, Equations, place};

/// An estimate of a coefficient, in its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Value.
    pub value: f64,
    /// Standard error.
    pub std_error: f64,
}

/// A set of coefficients that is asked for.
#[derive(Debug, Clone)]
pub struct Asked {
    /// Their places among the craft's columns, rising.
    pub parameters: Vec<usize>,
    priors: Vec<Option<Prior>>,
}

impl Asked {
    /// Some coefficients of a craft.
    pub fn new(columns: &Columns, parameters: Vec<usize>) -> Self {
        let prior = |k: &usize| {
            let own = columns.parameters[*k];
            let known = own.effect.info().coefficients[own.coefficient].prior;
            known.map(|deviation| Prior { expected: 0.0, deviation })
        };
        let priors = parameters.iter().map(prior).collect();
        Self { parameters, priors }
    }

    /// Where a column is among those asked for.
    fn local(&self, parameter: usize) -> Option<usize> {
        self.parameters.binary_search(&parameter).ok()
    }
}

/// Coefficients that hang together, by their places among those asked for, and the axes that join them.
#[derive(Debug, Clone)]
struct Group {
    members: Vec<usize>,
    axes: Vec<usize>,
}

/// What many flights give.
#[derive(Debug, Clone)]
pub struct Pooled {
    /// Of each coefficient that was asked for; nothing where the flights do not determine it.
    pub estimates: Vec<Option<Estimate>>,
    /// Root mean square of what is left of each axis, m/s^2 and rad/s^2.
    pub rms: [f64; 6],
    /// The same of each flight under the fit of all others.
    pub held_out_rms: [f64; 6],
    /// Mean square of each flight on each axis under the fit of all others.
    pub held_out_of_flights: Vec<[f64; 6]>,
}

/// Fits one flight alone; nothing for a coefficient that it does not determine.
pub fn of_one(equations: &Equations, asked: &Asked) -> Vec<Option<Estimate>> {
    let mut found = vec![None; asked.parameters.len()];
    for group in groups(&[equations], asked) {
        let Some((members, solution)) = solve_group(
            &group,
            |axis, members| (selected(&equations.axes[axis], asked, members), equations.rows),
            asked,
        ) else {
            continue;
        };
        let covariance = covariance_of_one(equations, asked, &members, &group.axes, &solution);
        for (at, &k) in members.iter().enumerate() {
            let std_error = covariance[(at, at)].max(0.0).sqrt();
            found[k] = (std_error > 0.0).then_some(Estimate { value: solution.value[at], std_error });
        }
    }
    found
}

/// Fits many flights together.
pub fn of_many(flights: &[&Equations], asked: &Asked) -> Pooled {
    let mut pooled = Pooled {
        estimates: vec![None; asked.parameters.len()],
        rms: [f64::NAN; 6],
        held_out_rms: [f64::NAN; 6],
        held_out_of_flights: vec![[f64::NAN; 6]; flights.len()],
    };
    for group in groups(flights, asked) {
        // A flight without rows on an axis of the group says nothing of what the axes have in common.
        let has_rows =
            |flight: &Equations| group.axes.iter().all(|axis| !flight.axes[*axis].triangle.is_empty());
        let told: Vec<usize> = (0..flights.len()).filter(|k| has_rows(flights[*k])).collect();
        let flights: Vec<&Equations> = told.iter().map(|k| flights[*k]).collect();
        let rows: usize = flights.iter().map(|flight| flight.rows).sum();
        let merged = |axis: usize, members: &[usize]| {
            let mut all = empty(members, true);
            for flight in &flights {
                all.absorb(&selected_full(&flight.axes[axis], asked, members));
            }
            (all, rows)
        };
        let Some((members, solution)) = solve_group(&group, merged, asked) else { continue };
        let joint = Joint { asked, members: &members, axes: &group.axes, solution: &solution };
        for (at, variance) in joint.variances(&flights).into_iter().enumerate() {
            let (value, std_error) = (solution.value[at], variance.max(0.0).sqrt());
            pooled.estimates[members[at]] = (std_error > 0.0).then_some(Estimate { value, std_error });
        }
        let left = joint.left_out(&flights);
        for &axis in &group.axes {
            pooled.rms[axis] = solution.sigma[axis];
            let sum: f64 = flights.iter().zip(&left).map(|(f, left)| left[axis] * f.rows as f64).sum();
            pooled.held_out_rms[axis] = (sum / rows.max(1) as f64).sqrt();
            told.iter().zip(&left).for_each(|(k, left)| pooled.held_out_of_flights[*k][axis] = left[axis]);
        }
    }
    pooled
}

/// The coefficients asked for in groups that share no axis.
fn groups(flights: &[&Equations], asked: &Asked) -> Vec<Group> {
    let mut acts = vec![[false; 6]; asked.parameters.len()];
    for flight in flights {
        for (axis, equations) in flight.axes.iter().enumerate() {
            for own in equations.parameters.iter().filter_map(|k| asked.local(*k)) {
                acts[own][axis] = true;
            }
        }
    }
    let mut groups: Vec<Group> = Vec::new();
    for (member, acts) in acts.iter().enumerate() {
        let mut joined = Group { members: vec![member], axes: (0..6).filter(|axis| acts[*axis]).collect() };
        if joined.axes.is_empty() {
            continue;
        }
        let (same, rest): (Vec<Group>, Vec<Group>) =
            groups.into_iter().partition(|group| group.axes.iter().any(|axis| joined.axes.contains(axis)));
        groups = rest;
        for group in same {
            joined.members.extend(group.members);
            joined.axes.extend(group.axes);
        }
        joined.members.sort_unstable();
        joined.axes.sort_unstable();
        joined.axes.dedup();
        groups.push(joined);
    }
    groups
}

/// Solves a group without the coefficients that nothing excites. With those that are left.
fn solve_group(
    group: &Group,
    triangle: impl Fn(usize, &[usize]) -> (AxisTriangle, usize),
    asked: &Asked,
) -> Option<(Vec<usize>, Solution)> {
    let mut members = group.members.clone();
    loop {
        let mut rows = 0;
        let triangles = std::array::from_fn(|axis| {
            if !group.axes.contains(&axis) {
                return empty(&[], false);
            }
            let (triangle, count) = triangle(axis, &members);
            rows = count;
            triangle
        });
        let priors: Vec<Option<Prior>> = members.iter().map(|k| asked.priors[*k]).collect();
        match solve_triangles(&triangles, rows, &priors) {
            Ok(solution) => return Some((members, solution)),
            Err(Unidentifiable::NotExcited(k)) if members.len() > 1 => {
                members.remove(k);
            }
            Err(_) => return None,
        }
    }
}

/// No rows of these coefficients.
fn empty(members: &[usize], square: bool) -> AxisTriangle {
    let width = members.len() + 1;
    let parameters = (0..members.len()).collect();
    AxisTriangle { parameters, triangle: DMatrix::zeros(if square { width } else { 0 }, width) }
}

/// The rows of a flight on an axis, over the members that act there: numbered among the members.
fn selected(equations: &AxisEquations, asked: &Asked, members: &[usize]) -> AxisTriangle {
    let all = selected_full(equations, asked, members);
    let acts = |k: &usize| equations.parameters.binary_search(&asked.parameters[members[*k]]).is_ok();
    let parameters: Vec<usize> = (0..members.len()).filter(acts).collect();
    let columns: Vec<usize> = parameters.iter().copied().chain([members.len()]).collect();
    AxisTriangle { triangle: all.triangle.select_columns(&columns), parameters }
}

/// The same with a column of zeros for a member that does not act there.
fn selected_full(equations: &AxisEquations, asked: &Asked, members: &[usize]) -> AxisTriangle {
    let height = equations.parameters.len() + 1;
    let mut triangle = DMatrix::zeros(height, members.len() + 1);
    let mut copy = |from: usize, to: usize| {
        let first = place(0, from);
        let column = &equations.triangle[first..=first + from];
        triangle.column_mut(to).rows_mut(0, from + 1).copy_from_slice(column);
    };
    for (to, member) in members.iter().enumerate() {
        if let Ok(from) = equations.parameters.binary_search(&asked.parameters[*member]) {
            copy(from, to);
        }
    }
    if !equations.triangle.is_empty() {
        copy(height - 1, members.len());
    }
    AxisTriangle { parameters: (0..members.len()).collect(), triangle }
}

/// Adds the covariance of a flight's scores on an axis, times `factor`, to that of the members.
fn add_scores(
    meat: &mut DMatrix<f64>,
    equations: &AxisEquations,
    asked: &Asked,
    members: &[usize],
    factor: f64,
) {
    let at = |member: &usize| equations.parameters.binary_search(&asked.parameters[*member]).ok();
    let places: Vec<Option<usize>> = members.iter().map(at).collect();
    for (c, column) in places.iter().enumerate() {
        for (r, row) in places.iter().enumerate() {
            let (Some(row), Some(column)) = (*row, *column) else { continue };
            meat[(r, c)] += factor * equations.scores[place(row.min(column), row.max(column))];
        }
    }
}

/// What a jitter of the times does to the scores of the members, over the axes.
fn timing_of(
    equations: &Equations,
    asked: &Asked,
    members: &[usize],
    axes: &[usize],
    sigma: &[f64; 6],
) -> DVector<f64> {
    let mut common = DVector::zeros(members.len());
    for &axis in axes {
        let own = &equations.axes[axis];
        for (at, member) in members.iter().enumerate() {
            let place = own.parameters.binary_search(&asked.parameters[*member]);
            if let Some(timing) = place.ok().and_then(|place| own.timing.get(place)) {
                common[at] += timing / (sigma[axis] * sigma[axis]);
            }
        }
    }
    common
}

fn covariance_of_one(
    equations: &Equations,
    asked: &Asked,
    members: &[usize],
    axes: &[usize],
    solution: &Solution,
) -> DMatrix<f64> {
    let mut meat = DMatrix::zeros(members.len(), members.len());
    for &axis in axes {
        let (own, sigma) = (&equations.axes[axis], solution.sigma[axis]);
        // What another set of effects leaves has the colour of what the reference's left, in proportion.
        add_scores(&mut meat, own, asked, members, 1.0 / (sigma * own.sigma).max(1e-18).powi(2));
    }
    add_priors(&mut meat, asked, members);
    let common = timing_of(equations, asked, members, axes, &solution.sigma);
    meat.ger(1.0, &common, &common, 1.0);
    let short = short_record(equations.record_s);
    &solution.covariance * meat * solution.covariance.transpose() * (short * short)
}

fn add_priors(meat: &mut DMatrix<f64>, asked: &Asked, members: &[usize]) {
    for (at, member) in members.iter().enumerate() {
        meat[(at, at)] += asked.priors[*member].map_or(0.0, |p| 1.0 / (p.deviation * p.deviation));
    }
}

/// A group as all flights give it.
struct Joint<'a> {
    asked: &'a Asked,
    members: &'a [usize],
    axes: &'a [usize],
    solution: &'a Solution,
}

impl Joint<'_> {
    /// Variance of each member: by the noise within flights, or by how flights differ where that is more.
    fn variances(&self, flights: &[&Equations]) -> Vec<f64> {
        let Self { asked, members, axes, solution } = *self;
        let size = members.len();
        let (mut within, mut between) = (DMatrix::zeros(size, size), DMatrix::zeros(size, size));
        let mut common = DVector::zeros(size);
        for flight in flights {
            let mut score = DVector::zeros(size);
            for &axis in axes {
                let own = &flight.axes[axis];
                let weight = 1.0 / (solution.sigma[axis] * solution.sigma[axis]);
                let rows = selected_full(own, asked, members).triangle;
                let left = self.left(&rows, &solution.value);
                score += weight * rows.columns(0, size).tr_mul(&left);
                let ratio = left.norm_squared() / flight.rows.max(1) as f64 / own.sigma.max(1e-9).powi(2);
                add_scores(&mut within, own, asked, members, ratio * weight * weight);
            }
            between.ger(1.0, &score, &score, 1.0);
            common += timing_of(flight, asked, members, axes, &solution.sigma);
        }
        add_priors(&mut within, asked, members);
        within.ger(1.0, &common, &common, 1.0);
        let short = short_record(flights.iter().map(|flight| flight.record_s).sum());
        let count = flights.len() as f64;
        let bread = &solution.covariance;
        let within = bread * within * bread.transpose() * (short * short);
        let between = bread * between * bread.transpose() * (count / (count - 1.0).max(1.0));
        (0..size).map(|k| within[(k, k)].max(if count > 1.0 { between[(k, k)] } else { 0.0 })).collect()
    }

    /// What values of the members leave of a flight's rows.
    fn left(&self, rows: &DMatrix<f64>, value: &DVector<f64>) -> DVector<f64> {
        rows.column(self.members.len()) - rows.columns(0, self.members.len()) * value
    }

    /// Mean square of each flight on each axis under the fit of all others; the axes' weights stay.
    fn left_out(&self, flights: &[&Equations]) -> Vec<[f64; 6]> {
        let Self { asked, members, axes, solution } = *self;
        let size = members.len();
        let normal = |flight: &Equations| {
            let (mut a, mut b) = (DMatrix::zeros(size, size), DVector::zeros(size));
            for &axis in axes {
                let weight = 1.0 / (solution.sigma[axis] * solution.sigma[axis]);
                let rows = selected_full(&flight.axes[axis], asked, members).triangle;
                let x = rows.columns(0, size);
                a += weight * x.tr_mul(&x);
                b += weight * x.tr_mul(&rows.column(size));
            }
            (a, b)
        };
        let of_each: Vec<_> = flights.par_iter().map(|flight| normal(flight)).collect();
        let mut all = of_each
            .iter()
            .fold((DMatrix::zeros(size, size), DVector::zeros(size)), |(a, b), (own_a, own_b)| {
                (a + own_a, b + own_b)
            });
        add_priors(&mut all.0, asked, members);
        let of_flight = |(flight, (a, b)): (&&Equations, &(DMatrix<f64>, DVector<f64>))| {
            let (rest, right) = (&all.0 - a, &all.1 - b);
            let scale = rest.diagonal().map(|d| if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 });
            let scaled = DMatrix::from_fn(size, size, |r, c| rest[(r, c)] * scale[r] * scale[c]);
            let value =
                scaled.cholesky().map(|c| c.solve(&right.component_mul(&scale)).component_mul(&scale));
            let mut squares = [f64::NAN; 6];
            for &axis in axes {
                let rows = selected_full(&flight.axes[axis], asked, members).triangle;
                squares[axis] = value.as_ref().map_or(f64::NAN, |value| {
                    self.left(&rows, value).norm_squared() / flight.rows.max(1) as f64
                });
            }
            squares
        };
        flights.par_iter().zip(&of_each).map(of_flight).collect()
    }
}

/// Names of the axes.
pub(crate) fn axis_names() -> [&'static str; 6] {
    AXES.map(|axis| axis.name())
}
