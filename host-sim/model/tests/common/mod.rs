//! Craft that are drawn for the tests of the plant.

use model::{Kind, Model, State, effects::CATALOGUE, frames};
use nalgebra::Vector3;

/// A craft of the thesis with some of the effects of the catalogue besides, by `which` bits, with coefficients of ordinary size, but
/// without some.
pub(crate) fn craft(which: u32, sizes: &[f64], without: &[&str]) -> Model {
    let mut model = Model::thesis();
    let mut sizes = sizes.iter().cycle();
    for (place, &effect) in CATALOGUE.iter().enumerate() {
        let left_out = without.contains(&effect.id()) || effect.info().kind == Kind::Basic;
        if left_out || which >> place & 1 == 0 {
            continue;
        }
        let size = |c: &model::Coefficient| sizes.next().map_or(0.0, |size| c.typical * size);
        let values: Vec<f64> = effect.info().coefficients.iter().map(size).collect();
        model.set(effect, &values);
    }
    model
}

/// Any motion, from twelve numbers between -1 and 1.
pub(crate) fn state(x: &[f64]) -> State {
    let three = |k: usize, most: f64| most * Vector3::new(x[k], x[k + 1], x[k + 2]);
    let mut state = State::at_rest(three(0, 3.0), [0, 1, 2, 3].map(|k| 600.0 + 300.0 * x[k]));
    state.attitude = frames::quaternion_from_euler(three(3, 1.5));
    (state.velocity_m_s, state.rate_rad_s) = (three(6, 6.0), three(9, 8.0));
    state
}
