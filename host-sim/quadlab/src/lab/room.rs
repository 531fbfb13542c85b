//! Where in the room a model fails: what is left of an axis, averaged in cells of place.

use serde_json::{Value, json};

use super::numbers::mean_in_cells;

/// Where the craft was, m, and what was left there.
pub(super) struct Place {
    pub(super) north_m: f64,
    pub(super) east_m: f64,
    pub(super) up_m: f64,
    pub(super) residual: f64,
}

/// Cells along the longest side of the room.
const CELLS: f64 = 28.0;
/// Samples below which a cell stays empty: a mean of fewer says nothing.
const FEWEST: u32 = 10;

type Coordinate = (&'static str, fn(&Place) -> f64);

const EAST: Coordinate = ("east", |place| place.east_m);
const NORTH: Coordinate = ("north", |place| place.north_m);
const UP: Coordinate = ("up", |place| place.up_m);
/// From above, and from two sides: what goes across, and what goes up.
const PLANES: [[Coordinate; 2]; 3] = [[EAST, NORTH], [EAST, UP], [NORTH, UP]];

/// Mean residual and count in square cells of one size, from above and from two sides.
pub(super) fn map(mut places: Vec<Place>) -> Value {
    places.retain(|p| [p.north_m, p.east_m, p.up_m, p.residual].iter().all(|x| x.is_finite()));
    let longest_m = [EAST, NORTH, UP].into_iter().map(|(_, of)| extent(&places, of)).fold(0.0, f64::max);
    let cell_m = round_length(longest_m / CELLS);
    let plane = |[(across, x), (upwards, y)]: [Coordinate; 2]| {
        let points: Vec<[f64; 3]> = places.iter().map(|place| [x(place), y(place), place.residual]).collect();
        let cells = mean_in_cells(&points, cell_m, FEWEST);
        json!({ "across": across, "upwards": upwards, "x": cells.x, "y": cells.y, "mean": cells.mean, "count": cells.count })
    };
    json!({ "cell_m": cell_m, "fewest": FEWEST, "samples": places.len(), "planes": PLANES.map(plane) })
}

fn extent(places: &[Place], of: fn(&Place) -> f64) -> f64 {
    let (low, high) = places
        .iter()
        .map(of)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    (high - low).max(0.0)
}

/// The next length up that people write: 1, 2 or 5 of a power of ten, and no less than a millimetre.
fn round_length(length_m: f64) -> f64 {
    let power = 10_f64.powf(length_m.max(1e-3).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0];
    steps
        .into_iter()
        .map(|step| step * power)
        .find(|step| *step >= length_m.max(1e-3) * (1.0 - 1e-9))
        .unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hundred samples around each of two places, with residuals of their own, and one where hardly anything was flown.
    fn places() -> Vec<Place> {
        let at = |north_m: f64, east_m: f64, residual: f64, count: u32| {
            (0..count).map(move |k| Place {
                north_m: north_m + 1e-4 * f64::from(k),
                east_m,
                up_m: 1.0,
                residual: residual + if k % 2 == 0 { 0.1 } else { -0.1 },
            })
        };
        at(0.05, 0.05, 2.0, 100).chain(at(2.75, 1.45, -1.0, 100)).chain(at(1.45, 0.55, 9.0, 9)).collect()
    }

    #[test]
    fn each_cell_has_the_mean_of_its_samples_and_too_few_are_none() {
        let map = map(places());
        assert_eq!(map["cell_m"], 0.1);
        let above = &map["planes"][0];
        assert_eq!((&above["across"], &above["upwards"]), (&json!("east"), &json!("north")));
        let cell = |field: &str, east: f64, north: f64| {
            let at = |edges: &Value, x: f64| {
                let edges = edges.as_array().unwrap();
                edges.iter().rposition(|edge| edge.as_f64().unwrap() <= x).unwrap()
            };
            above[field][at(&above["y"], north)][at(&above["x"], east)].clone()
        };
        assert!((cell("mean", 0.05, 0.05).as_f64().unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(cell("count", 0.05, 0.05), 100);
        assert!((cell("mean", 1.45, 2.75).as_f64().unwrap() + 1.0).abs() < 1e-12);
        assert_eq!((cell("mean", 0.55, 1.45), cell("count", 0.55, 1.45)), (Value::Null, json!(9)));
        let full = |plane: &Value| -> usize {
            plane["mean"]
                .as_array()
                .unwrap()
                .iter()
                .flat_map(|row| row.as_array().unwrap())
                .filter(|m| !m.is_null())
                .count()
        };
        assert_eq!(map["planes"].as_array().unwrap().iter().map(full).collect::<Vec<_>>(), [2, 2, 2]);
    }

    #[test]
    fn a_flight_on_the_spot_and_none_at_all_are_maps_too() {
        let still = || Place { north_m: 1.0, east_m: 1.0, up_m: 1.0, residual: 0.5 };
        let map_of_one = map((0..50).map(|_| still()).collect());
        assert_eq!(map_of_one["planes"][0]["count"], json!([[50]]));
        assert_eq!(map(Vec::new())["planes"][0]["count"], json!([]));
        let broken = map(vec![Place { residual: f64::NAN, ..still() }]);
        assert_eq!(broken["samples"], 0);
    }

    #[test]
    fn cells_have_lengths_that_people_write() {
        for (length, written) in
            [(0.0, 1e-3), (0.013, 0.02), (0.05, 0.05), (0.21, 0.5), (0.7, 1.0), (30.0, 50.0)]
        {
            assert!(
                (round_length(length) / written - 1.0_f64).abs() < 1e-9,
                "{length}: {}",
                round_length(length)
            );
        }
    }
}
