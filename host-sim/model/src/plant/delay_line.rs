//! Dead time between command and rotor in simulation.

use std::collections::VecDeque;

use crate::plant::equations::{Hold, Holds, Plant, Substeps};
use crate::plant::state::State;
use crate::sample::Surroundings;

/// Dead time between command and rotor (`input-delay`): past commands, and where in the period they take over. The battery
/// acts at the motor and has no dead time.
///
/// Without dead time it is a plain [`Plant::step`].
#[derive(Debug, Clone)]
pub struct DelayLine {
    /// Commands not yet in force, oldest first; the first one is in force at the start of the period.
    waiting: VecDeque<[f64; 4]>,
    /// The period before and after the takeover.
    before: Option<Substeps>,
    after: Option<Substeps>,
}

impl DelayLine {
    /// For a plant, a control period and its integration steps, after a long time of `initial` commands.
    pub fn new(plant: &Plant, period_s: f64, count: u32, initial: [f64; 4]) -> Self {
        let delay_s = plant.adjustments().dead_time_s().max(0.0);
        let whole = (delay_s / period_s).floor();
        let part = delay_s / period_s - whole;
        let cut = |part: f64| {
            let steps = (part * f64::from(count)).ceil().max(1.0) as u32;
            (part > 1e-9).then(|| plant.substeps(part * period_s, steps))
        };
        let waiting = std::iter::repeat_n(initial, whole as usize + 1).collect();
        Self { waiting, before: cut(part), after: cut(1.0 - part) }
    }

    /// What the rotors are commanded in one period in which `command` is given.
    #[inline]
    pub fn holds(&mut self, plant: &Plant, command: &[f64; 4], battery_v: f64) -> Holds {
        self.waiting.push_back(*command);
        let hold = |substeps: Option<Substeps>, command: Option<&[f64; 4]>| {
            let commanded_rad_s = plant.commanded_rad_s(command?, battery_v);
            Some(Hold { commanded_rad_s, substeps: substeps? })
        };
        let before = hold(self.before, self.waiting.front());
        self.waiting.pop_front();
        [before, hold(self.after, self.waiting.front())]
    }

    /// Advances `state` over one period in which `command` is given.
    pub fn step(&mut self, plant: &Plant, state: &mut State, command: &[f64; 4], around: &Surroundings) {
        for hold in self.holds(plant, command, around.battery_v).into_iter().flatten() {
            plant.step(state, &hold.commanded_rad_s, *around, &hold.substeps);
        }
    }
}
