//! Searches of one gain along a grid that is even in its logarithm: what the thesis reads off a
//! root locus by eye.

use crate::error::Result;

/// Value `k` of a grid of `count` steps from `low` to `high`.
fn grid(low: f64, high: f64, k: usize, count: usize) -> f64 {
    low * (high / low).powf(k as f64 / count as f64)
}

/// The largest value in `(low, high)` up to which a condition holds from the first that meets it,
/// to a thousandth.
pub(super) fn largest(low: f64, high: f64, holds: impl Fn(f64) -> Result<bool>) -> Result<Option<f64>> {
    const COUNT: usize = 60;
    let at = |k: usize| grid(low, high, k, COUNT);
    let mut last = None;
    for k in 0..=COUNT {
        if !holds(at(k))? {
            if last.is_some() {
                return refine(at(k - 1), at(k), holds).map(Some);
            }
        } else {
            last = Some(at(k));
        }
    }
    Ok(last)
}

/// Where on a grid from `low` to `high` a value is greatest, and that value; absent where it has
/// none anywhere.
pub(super) fn greatest(
    low: f64,
    high: f64,
    value: impl Fn(f64) -> Result<Option<f64>>,
) -> Result<Option<(f64, f64)>> {
    const COUNT: usize = 60;
    let mut most: Option<(f64, f64)> = None;
    for k in 0..=COUNT {
        let at = grid(low, high, k, COUNT);
        if let Some(value) = value(at)?
            && most.is_none_or(|(_, most)| value > most)
        {
            most = Some((at, value));
        }
    }
    Ok(most)
}

/// The first value for which a condition holds, going up.
pub(super) fn first(low: f64, high: f64, holds: impl Fn(f64) -> Result<bool>) -> Result<Option<f64>> {
    const COUNT: usize = 200;
    let at = |k: usize| grid(low, high, k, COUNT);
    for k in 0..=COUNT {
        if holds(at(k))? {
            return if k == 0 { Ok(Some(low)) } else { refine(at(k), at(k - 1), holds).map(Some) };
        }
    }
    Ok(None)
}

/// The least gain at which a function is as small as it gets, to a per cent, on a fine grid: beyond
/// the point where two real poles meet, more gain only makes them ring.
pub(super) fn best(low: f64, high: f64, value: impl Fn(f64) -> Result<f64>) -> Result<f64> {
    const COUNT: usize = 400;
    let at = |k: usize| grid(low, high, k, COUNT);
    let values = (0..=COUNT).map(|k| value(at(k))).collect::<Result<Vec<f64>>>()?;
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    let near = values.iter().position(|value| *value <= least + 0.01 * least.abs()).unwrap_or(0);
    Ok(at(near))
}

/// The edge between a value that meets a condition and one that does not, to a thousandth, on the
/// good side.
fn refine(mut good: f64, mut bad: f64, holds: impl Fn(f64) -> Result<bool>) -> Result<f64> {
    while (bad - good).abs() > 1e-3 * good.abs() {
        let middle = 0.5 * (good + bad);
        if holds(middle)? { good = middle } else { bad = middle }
    }
    Ok(good)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Edges at numbers that lie on no grid, to the thousandth that is promised.
    #[test]
    fn edges_are_found_to_a_thousandth() {
        let near = |found: f64, edge: f64| (found / edge - 1.0).abs() < 1.1e-3;
        let up_to = largest(0.1, 1000.0, |x| Ok(x > 2.0 && x < 77.7)).unwrap().unwrap();
        assert!(near(up_to, 77.7) && up_to < 77.7, "{up_to}");
        let from = first(0.1, 1000.0, |x| Ok(x > 3.21)).unwrap().unwrap();
        assert!(near(from, 3.21) && from > 3.21, "{from}");
        assert_eq!(largest(0.1, 1000.0, |_| Ok(false)).unwrap(), None);
        assert_eq!(first(0.1, 1000.0, |_| Ok(false)).unwrap(), None);
        // Beyond the grid's end nothing is known, at its start all is.
        assert!(near(largest(0.1, 1000.0, |_| Ok(true)).unwrap().unwrap(), 1000.0));
        assert_eq!(first(0.1, 1000.0, |_| Ok(true)).unwrap(), Some(0.1));
    }

    /// A step of the grid of 61 values over four decades is 17 %, one of 401 is 2.3 %.
    #[test]
    fn extremes_are_found_on_the_grid() {
        let hill = |x: f64| Ok((x > 1.0).then(|| -(x / 20.0).ln().powi(2)));
        let (at, value) = greatest(0.1, 1000.0, hill).unwrap().unwrap();
        assert!((at / 20.0 - 1.0).abs() < 0.17 && value <= 0.0, "{at}");
        assert_eq!(greatest(0.1, 1000.0, |_| Ok(None)).unwrap(), None);
        // A floor that begins at 5: its start, not its end.
        let floor = best(0.1, 1000.0, |x| Ok(-f64::min(x, 5.0))).unwrap();
        assert!((floor / 5.0 - 1.0).abs() < 0.034, "{floor}");
    }

    #[test]
    fn an_error_ends_a_scan() {
        let fails = |_: f64| Err(crate::DesignError::Numerics("a test"));
        assert!(largest(1.0, 2.0, fails).is_err() && first(1.0, 2.0, fails).is_err());
    }
}
