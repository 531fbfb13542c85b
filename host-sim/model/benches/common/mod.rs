//! The motion that the plant's benches share: the thesis' craft about hover, its rotors on their way to slightly
//! different speeds.

use std::hint::black_box;

use model::{Abreast, Effect, Hold, LANES, Model, Plant, State, Substeps};
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

/// As many such craft as fly side by side, in wind and with worn rotors.
pub(crate) struct Formation {
    plant: Plant,
    abreast: Abreast,
    states: [State; LANES],
    substeps: Substeps,
}

impl Formation {
    /// At rest, with `count` Runge-Kutta steps in a period.
    pub(crate) fn new(count: u32) -> Self {
        let mut model = Model::thesis();
        model.set(Effect::SteadyWind, &[0.5, -0.3]);
        model.set(Effect::MotorEfficiency, &[0.01, 0.0, 0.02, 0.0]);
        let plant = Plant::new(&model);
        let mut abreast = Abreast::new();
        (0..LANES).for_each(|lane| assert!(abreast.enter(lane, &plant)));
        let substeps = plant.substeps(0.01, count);
        let states = [State::at_rest(Vector3::new(0.0, 0.0, -1.0), [635.0; 4]); LANES];
        Self { plant, abreast, states, substeps }
    }

    /// The next control period, side by side.
    #[inline]
    pub(crate) fn step(&mut self) {
        let hold = Hold { commanded_rad_s: COMMANDED_RAD_S, substeps: self.substeps };
        for (lane, state) in self.states.iter().enumerate() {
            self.abreast.put(lane, black_box(state), &[Some(hold), None]);
        }
        self.abreast.advance();
        for (lane, state) in self.states.iter_mut().enumerate() {
            self.abreast.take(lane, black_box(state));
        }
    }

    /// The next control period, one after the other.
    #[inline]
    pub(crate) fn step_each(&mut self) {
        for state in &mut self.states {
            self.plant.step(black_box(state), black_box(&COMMANDED_RAD_S), 11.1, &self.substeps);
        }
    }
}
