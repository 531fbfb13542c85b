//! Exhaustive best-subset search: which few effects together account for the error on flights held out?
//!
//! Going by one effect at a time misses two that hide each other, and names the effect that does a little of the work of
//! both. Here every set of up to a few candidates is solved and scored. A set costs a Cholesky factor of its own
//! columns' cross products and six quadratic forms, because everything that touches rows was done once: the candidates'
//! columns, with the model's own columns projected out of them, are reduced to their cross products on the training
//! flights and, for each axis, on the flights held out.
//!
//! A set is scored by the logarithm of its held-out likelihood ratio to the empty set, in effectively independent
//! rows, less a penalty for each coefficient. Deliberately absent: stepwise search and shrinkage; with some twenty candidates all
//! sets of three are 1350.

use std::convert::Infallible;
use std::ops::Range;

use nalgebra::{Cholesky, DMatrix, DVector};

/// A pivot this small against its column's square means that the set repeats itself: refused.
const COLLINEAR: f64 = 1e-8;

/// Sets between one report of progress and the next: well under a tenth of a second.
const TOLD_EVERY: usize = 100;

/// Candidates reduced to their cross products. The last row and column of each matrix belong to the residual.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Columns of each candidate.
    pub groups: Vec<Range<usize>>,
    /// On the training flights, all axes together, each weighted by its noise.
    pub train: DMatrix<f64>,
    /// On the held-out flights, for each axis.
    pub held_out: [DMatrix<f64>; 6],
    /// Effectively independent held-out rows of each axis.
    pub effective_rows: [f64; 6],
    /// Smallest and largest admissible value of each column's coefficient.
    pub admissible: Vec<(f64, f64)>,
}

/// A set of candidates, solved.
#[derive(Debug, Clone, PartialEq)]
pub struct Subset {
    /// Indices of the candidates.
    pub members: Vec<usize>,
    /// Coefficients, those of the first member first.
    pub values: Vec<f64>,
    /// Logarithm of the held-out likelihood ratio to the empty set, less the penalty.
    pub score: f64,
    /// Held-out sum of squares of each axis.
    pub sse: [f64; 6],
}

impl Problem {
    /// Columns of a set, in its order.
    pub fn columns(&self, members: &[usize]) -> Vec<usize> {
        members.iter().flat_map(|&m| self.groups[m].clone()).collect()
    }

    /// Held-out sum of squares of each axis without any candidate.
    pub fn sse_before(&self) -> [f64; 6] {
        self.held_out.each_ref().map(|cross| cross[(cross.nrows() - 1, cross.ncols() - 1)])
    }

    /// The cross products of a set's columns, scaled to a unit diagonal, factored; with the scales. Nothing where columns repeat
    /// each other or are dead.
    fn factor(&self, columns: &[usize]) -> Option<(Cholesky<f64, nalgebra::Dyn>, Vec<f64>)> {
        let scale: Vec<f64> = columns.iter().map(|&c| self.train[(c, c)].sqrt()).collect();
        if scale.iter().any(|s| !(*s > 0.0) || !s.is_finite()) {
            return None;
        }
        let k = columns.len();
        let cross =
            DMatrix::from_fn(k, k, |r, c| self.train[(columns[r], columns[c])] / (scale[r] * scale[c]));
        let factor = cross.cholesky()?;
        let pivots = factor.l_dirty().diagonal();
        pivots.iter().all(|p| p * p > COLLINEAR).then_some((factor, scale))
    }

    /// Least squares on the training flights for the columns of a set.
    pub fn solve(&self, columns: &[usize]) -> Option<DVector<f64>> {
        let residual = self.train.ncols() - 1;
        let (factor, scale) = self.factor(columns)?;
        let right = DVector::from_fn(columns.len(), |r, _| self.train[(columns[r], residual)] / scale[r]);
        let scaled = factor.solve(&right);
        Some(DVector::from_fn(columns.len(), |r, _| scaled[r] / scale[r]))
    }

    /// Inverse of the cross products of a set's columns.
    pub fn inverse(&self, columns: &[usize]) -> Option<DMatrix<f64>> {
        let (factor, scale) = self.factor(columns)?;
        let inverse = factor.inverse();
        Some(DMatrix::from_fn(columns.len(), columns.len(), |r, c| inverse[(r, c)] / (scale[r] * scale[c])))
    }

    /// Solves and scores one set; nothing where it is collinear or needs an inadmissible coefficient.
    pub fn score(&self, members: &[usize], penalty: f64) -> Option<Subset> {
        let columns = self.columns(members);
        let values = self.solve(&columns)?;
        let possible = columns.iter().zip(values.iter()).all(|(&c, v)| {
            let (low, high) = self.admissible[c];
            (low..=high).contains(v)
        });
        possible.then(|| {
            let before = self.sse_before();
            let sse = self.held_out.each_ref().map(|cross| sum_of_squares(cross, &columns, &values));
            let ratio: f64 = (0..6)
                .filter(|&axis| before[axis] > 0.0 && sse[axis] > 0.0)
                .map(|axis| 0.5 * self.effective_rows[axis] * (before[axis] / sse[axis]).ln())
                .sum();
            let score = ratio - penalty * columns.len() as f64;
            Subset { members: members.to_vec(), values: values.as_slice().to_vec(), score, sse }
        })
    }

    /// Every set of one to `most` candidates, solved and scored, best first; ties keep the order of the candidates. Sets that
    /// score no better than one of their own parts, or than nothing, are left out.
    pub fn search(&self, most: usize, penalty: f64) -> Vec<Subset> {
        let found: Result<_, Infallible> = self.search_told(most, penalty, |_, _| Ok(()));
        found.unwrap_or_else(|never| match never {})
    }

    /// [`Self::search`], which hands over now and then how many sets have been scored and how many there are, and stops at
    /// an error.
    pub(crate) fn search_told<E>(
        &self,
        most: usize,
        penalty: f64,
        mut tell: impl FnMut(usize, usize) -> Result<(), E>,
    ) -> Result<Vec<Subset>, E> {
        let most = most.min(self.groups.len());
        let all: usize = (1..=most).map(|size| sets_of(self.groups.len(), size)).sum();
        let mut done = 0;
        let mut kept: Vec<Subset> = Vec::new();
        for size in 1..=most {
            let smaller = kept.len();
            for_each_set(self.groups.len(), size, |members| {
                if done % TOLD_EVERY == 0 {
                    tell(done, all)?;
                }
                done += 1;
                let Some(subset) = self.score(members, penalty) else { return Ok(()) };
                let part = |known: &Subset| known.members.iter().all(|m| members.contains(m));
                let better = |known: &Subset| known.score >= subset.score && part(known);
                if subset.score > 0.0 && !kept[..smaller].iter().any(better) {
                    kept.push(subset);
                }
                Ok(())
            })?;
        }
        kept.sort_by(|a, b| b.score.total_cmp(&a.score));
        Ok(kept)
    }
}

/// How many sets of `size` of `count` there are.
fn sets_of(count: usize, size: usize) -> usize {
    (0..size).fold(1, |sets, k| sets * (count - k) / (k + 1))
}

/// |e - X v|^2 from cross products.
fn sum_of_squares(cross: &DMatrix<f64>, columns: &[usize], values: &DVector<f64>) -> f64 {
    let residual = cross.ncols() - 1;
    let mut sum = cross[(residual, residual)];
    for (&r, a) in columns.iter().zip(values.iter()) {
        let mut row = -2.0 * cross[(r, residual)];
        for (&c, b) in columns.iter().zip(values.iter()) {
            row += cross[(r, c)] * b;
        }
        sum += a * row;
    }
    sum
}

/// Hands over every set of `size` of `count` indices in lexicographic order.
fn for_each_set<E>(
    count: usize,
    size: usize,
    mut take: impl FnMut(&[usize]) -> Result<(), E>,
) -> Result<(), E> {
    let mut set: Vec<usize> = (0..size).collect();
    loop {
        take(&set)?;
        // The last index that can still move on.
        let Some(place) = (0..size).rev().find(|&k| set[k] + size - k < count) else {
            return Ok(());
        };
        set[place] += 1;
        for k in place + 1..size {
            set[k] = set[k - 1] + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    const ROWS: usize = 400;

    /// Columns and targets of every axis, training rows first, then as many held-out ones.
    struct Rows {
        columns: [DMatrix<f64>; 6],
        residual: [DVector<f64>; 6],
    }

    /// `count` random columns, neighbours alike; the residual is made of the columns in `truth` and noise.
    fn rows(seed: u64, count: usize, truth: &[(usize, f64)]) -> Rows {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut random = || 2.0 * rng.random::<f64>() - 1.0;
        let columns: [DMatrix<f64>; 6] = std::array::from_fn(|_| {
            let mut x = DMatrix::from_fn(2 * ROWS, count, |_, _| random());
            for c in 1..count {
                let before = x.column(c - 1).into_owned();
                x.column_mut(c).axpy(0.6, &before, 0.8);
            }
            x
        });
        let residual = std::array::from_fn(|axis| {
            let mut y = DVector::from_fn(2 * ROWS, |_, _| 0.5 * random());
            truth.iter().for_each(|&(c, v)| y.axpy(v, &columns[axis].column(c), 1.0));
            y
        });
        Rows { columns, residual }
    }

    impl Rows {
        fn cross(&self, axis: usize, from: usize) -> DMatrix<f64> {
            let x = self.columns[axis].rows(from, ROWS);
            let mut all = DMatrix::zeros(ROWS, x.ncols() + 1);
            all.columns_mut(0, x.ncols()).copy_from(&x);
            all.column_mut(x.ncols()).copy_from(&self.residual[axis].rows(from, ROWS));
            all.transpose() * all
        }

        fn problem(&self, width: usize) -> Problem {
            let count = self.columns[0].ncols();
            Problem {
                groups: (0..count / width).map(|g| g * width..(g + 1) * width).collect(),
                train: (0..6)
                    .map(|axis| self.cross(axis, 0))
                    .fold(DMatrix::zeros(count + 1, count + 1), |a, b| a + b),
                held_out: std::array::from_fn(|axis| self.cross(axis, ROWS)),
                effective_rows: [ROWS as f64; 6],
                admissible: vec![(f64::NEG_INFINITY, f64::INFINITY); count],
            }
        }

        /// The same by a least squares of the rows themselves.
        fn refitted(&self, columns: &[usize]) -> (DVector<f64>, [f64; 6]) {
            let part = |axis: usize, from: usize| self.columns[axis].rows(from, ROWS).select_columns(columns);
            let mut x = DMatrix::zeros(6 * ROWS, columns.len());
            let mut y = DVector::zeros(6 * ROWS);
            for axis in 0..6 {
                x.rows_mut(axis * ROWS, ROWS).copy_from(&part(axis, 0));
                y.rows_mut(axis * ROWS, ROWS).copy_from(&self.residual[axis].rows(0, ROWS));
            }
            let value = x.svd(true, true).solve(&y, 1e-12).unwrap();
            let left = |axis: usize| {
                (self.residual[axis].rows(ROWS, ROWS) - part(axis, ROWS) * &value).norm_squared()
            };
            let left = std::array::from_fn(left);
            (value, left)
        }
    }

    #[test]
    fn every_set_is_visited_once() {
        for (count, size, expected) in [(5, 1, 5), (5, 2, 10), (6, 3, 20), (3, 3, 1), (20, 3, 1140)] {
            let mut seen = std::collections::BTreeSet::new();
            for_each_set(count, size, |set| {
                assert!(set.windows(2).all(|w| w[0] < w[1]) && set[size - 1] < count);
                seen.insert(set.to_vec());
                Ok::<(), Infallible>(())
            })
            .unwrap();
            assert_eq!(seen.len(), expected);
            assert_eq!(sets_of(count, size), expected);
        }
    }

    #[test]
    fn a_search_says_how_far_it_is_and_ends_when_it_is_told_to() {
        let problem = rows(1, 12, &[(3, 0.4)]).problem(1);
        let mut heard = Vec::new();
        let stopped = problem.search_told(3, 1.0, |done, all| {
            heard.push((done, all));
            if done < 2 * TOLD_EVERY { Ok(()) } else { Err("enough") }
        });
        assert_eq!(stopped, Err("enough"));
        // 12 sets of one, 66 of two and 220 of three.
        assert_eq!(heard, [0, 1, 2].map(|k| (k * TOLD_EVERY, 298)));
    }

    #[test]
    fn cross_products_give_what_refitting_every_set_gives() {
        for seed in 0..5 {
            let rows = rows(seed, 10, &[(2, 0.3), (7, -0.2)]);
            let problem = rows.problem(2);
            for members in [vec![0], vec![1, 3], vec![0, 2, 4]] {
                let subset = problem.score(&members, 0.0).unwrap();
                let (values, sse) = rows.refitted(&problem.columns(&members));
                // Sums of 2400 products.
                assert!((DVector::from_vec(subset.values) - values).norm() < 1e-11, "seed {seed}");
                assert!((0..6).all(|a| (subset.sse[a] / sse[a] - 1.0).abs() < 1e-11), "seed {seed}");
            }
        }
    }

    /// y = a - b with a and b alike: each alone looks like nothing, both together explain all. Greedy selection fails here.
    #[test]
    fn finds_two_that_hide_each_other() {
        for seed in 0..20 {
            let mut rows = rows(seed, 8, &[]);
            for axis in 0..6 {
                let twin = rows.columns[axis].column(1) + 0.15 * rows.columns[axis].column(4);
                rows.columns[axis].column_mut(5).copy_from(&twin);
                let hidden = 1.5 * (&twin - rows.columns[axis].column(1));
                rows.residual[axis] += hidden;
                // Not the difference itself, which would do as well.
                rows.columns[axis].column_mut(4).fill(0.0);
            }
            let problem = rows.problem(1);
            let found = problem.search(3, 3.0);
            assert_eq!(found[0].members, [1, 5], "seed {seed}: {:?}", &found[..1]);
            let alone = |k: usize| problem.score(&[k], 3.0).unwrap().score;
            assert!(alone(1).max(alone(5)) < 0.3 * found[0].score, "seed {seed}");
        }
    }

    #[test]
    fn nothing_is_found_in_noise_and_no_set_contains_a_better_one() {
        let mut found = 0;
        for seed in 0..40 {
            let problem = rows(100 + seed, 12, &[]).problem(1);
            found += usize::from(!problem.search(3, 6.0).is_empty());
        }
        // Twelve candidates, and a held-out gain of 6 units by chance: exp(-6) each at most.
        assert!(found <= 2, "{found} of 40");
        let problem = rows(7, 12, &[(3, 0.4)]).problem(1);
        let sets = problem.search(3, 1.0);
        assert!(sets[0].members.contains(&3));
        for (k, set) in sets.iter().enumerate() {
            let part = |other: &Subset| other.members.iter().all(|m| set.members.contains(m));
            assert!(
                sets[..k].iter().all(|better| better.members.len() >= set.members.len() || !part(better))
            );
        }
    }

    #[test]
    fn dead_repeated_and_inadmissible_candidates_are_never_named() {
        let mut rows = rows(3, 6, &[(2, 0.5)]);
        for axis in 0..6 {
            rows.columns[axis].column_mut(0).fill(0.0);
            let twin = 1e6 * rows.columns[axis].column(1);
            rows.columns[axis].column_mut(5).copy_from(&twin);
        }
        let mut problem = rows.problem(1);
        assert!(problem.score(&[0], 0.0).is_none());
        assert!(problem.score(&[1, 5], 0.0).is_none());
        assert!(problem.score(&[1, 2], 0.0).is_some());
        assert!(problem.search(3, 1.0)[0].members.contains(&2));
        problem.admissible[2] = (-1.0, 0.0);
        assert!(problem.search(3, 1.0).iter().all(|set| !set.members.contains(&2)));
    }
}
