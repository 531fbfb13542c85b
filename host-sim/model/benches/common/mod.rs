//! The motion that the plant's benches share: the thesis' craft about hover, its rotors on their way to slightly
//! different speeds.

use std::hint::black_box;

use model::{Model, Plant, State, Substeps};
use nalgebra::Vector3;

/// Commanded rotor speeds of [`Motion::step`], rad/s.
const COMMANDED_RAD_S: [f64; 4] = [634.0, 635.0, 636.0, 635.0];

/// A plant, its state, and how a control period of 0.01 s is cut.
pub(crate) struct Motion {
    plant: Plant,
    state: State,
    substeps: Substeps,
}

impl Motion {
    /// At rest, with `count` Runge-Kutta steps in a period.
    pub(crate) fn new(count: u32) -> Self {
        let plant = Plant::new(&Model::thesis());
        let substeps = plant.substeps(0.01, count);
        Self { plant, state: State::at_rest(Vector3::new(0.0, 0.0, -1.0), [635.0; 4]), substeps }
    }

    /// The next control period.
    #[inline]
    pub(crate) fn step(&mut self) {
        self.plant.step(black_box(&mut self.state), black_box(&COMMANDED_RAD_S), 11.1, &self.substeps);
    }
}
