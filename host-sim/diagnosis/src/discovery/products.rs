//! Sums of products of columns that stand side by side, row after row.
//!
//! A search sums products over some rows at a time, which stay in a processor's cache. A general product of matrices copies both into an
//! order of its own first, which takes as long as the sums.

use nalgebra::DMatrix;

/// Some columns of rows that stand one after the other.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    /// All values, row by row.
    pub(super) rows: &'a [f32],
    /// Values of a row.
    pub(super) width: usize,
    /// The first of the columns.
    pub(super) first: usize,
    /// How many there are.
    pub(super) count: usize,
}

/// Sums over the rows of the products of each of some columns with each of others: a column for each of `one`, a row for each of `other`.
#[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2", "aarch64+neon"))]
pub(super) fn products(one: Columns<'_>, other: Columns<'_>) -> DMatrix<f32> {
    // As many at once as registers hold.
    match (one.count, other.count) {
        (OWN.., AT_ONCE..) => products_with::<AT_ONCE>(one, other),
        (OWN.., 8..) => products_with::<8>(one, other),
        (OWN.., 4..) => products_with::<4>(one, other),
        _ => products_one_by_one(one, other),
    }
}

/// Columns whose products with others are summed at once, ...
const OWN: usize = 4;
/// ... and how many these others are where there are enough: what has a multiple of so many is summed in the least time.
pub(super) const AT_ONCE: usize = 16;

/// The sums of so many columns with so many others at once.
#[inline(always)]
fn products_with<const OTHERS: usize>(one: Columns<'_>, other: Columns<'_>) -> DMatrix<f32> {
    let mut all = DMatrix::zeros(other.count, one.count);
    for k in firsts_of_groups(one.count, OWN) {
        let own = Columns { first: one.first + k, ..one };
        for l in firsts_of_groups(other.count, OTHERS) {
            let sums = block::<OTHERS>(own, Columns { first: other.first + l, ..other });
            for (column, sums) in all.as_mut_slice()[k * other.count..].chunks_mut(other.count).zip(sums) {
                column[l..l + OTHERS].copy_from_slice(&sums);
            }
        }
    }
    all
}

/// Where groups of `size` among at least as many begin. The last one may take some again that the one before it has taken.
#[inline(always)]
fn firsts_of_groups(count: usize, size: usize) -> impl Iterator<Item = usize> {
    (0..count).step_by(size).map(move |first| first.min(count - size))
}

/// The sums of the first columns of both. Each has a name, as compilers keep arrays of arrays out of registers.
#[inline(always)]
fn block<const OTHERS: usize>(one: Columns<'_>, other: Columns<'_>) -> [[f32; OTHERS]; OWN] {
    let [mut a, mut b, mut c, mut d] = [[0.0; OTHERS]; OWN];
    for (own, others) in one.rows.chunks_exact(one.width).zip(other.rows.chunks_exact(other.width)) {
        let (own, others) = (own[one.first..].first_chunk::<OWN>(), others[other.first..].first_chunk());
        let (Some(own), Some(others)): (_, Option<&[f32; OTHERS]>) = (own, others) else { break };
        for l in 0..OTHERS {
            a[l] += own[0] * others[l];
            b[l] += own[1] * others[l];
            c[l] += own[2] * others[l];
            d[l] += own[3] * others[l];
        }
    }
    [a, b, c, d]
}

#[inline(always)]
fn products_one_by_one(one: Columns<'_>, other: Columns<'_>) -> DMatrix<f32> {
    let mut all = DMatrix::zeros(other.count, one.count);
    for (own, others) in one.rows.chunks_exact(one.width).zip(other.rows.chunks_exact(other.width)) {
        let (own, others) = (&own[one.first..][..one.count], &others[other.first..][..other.count]);
        for (own, column) in own.iter().zip(all.as_mut_slice().chunks_exact_mut(other.count)) {
            column.iter_mut().zip(others).for_each(|(sum, other)| *sum += own * other);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whole numbers, of which sums are exact: of so many columns that they are taken in each of the ways, with some left over.
    #[test]
    fn columns_at_once_give_the_sums_of_each_with_each() {
        let number = |k: usize| ((7 * k) % 11) as f32 - 5.0;
        for (own, others) in [(1, 1), (2, 19), (4, 3), (5, 7), (7, 8), (9, 15), (4, 16), (11, 41)] {
            let (one_width, other_width, rows) = (own + 2, others + 3, 6);
            let one: Vec<f32> = (0..one_width * rows).map(number).collect();
            let other: Vec<f32> = (0..other_width * rows).map(|k| number(k + 3)).collect();
            let one = Columns { rows: &one, width: one_width, first: 2, count: own };
            let other = Columns { rows: &other, width: other_width, first: 1, count: others };
            let found = products(one, other);
            let expected = DMatrix::from_fn(others, own, |l, k| {
                let of =
                    |row: usize| one.rows[row * one_width + 2 + k] * other.rows[row * other_width + 1 + l];
                (0..rows).map(of).sum::<f32>()
            });
            assert_eq!(found, expected, "{own} {others}");
        }
    }
}
