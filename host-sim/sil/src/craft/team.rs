//! Craft that are advanced side by side: the same bits as each by itself, sooner.

use model::{Abreast, LANES};

use super::simulated_craft::SimulatedCraft;

/// Craft that are advanced together, each in a lane of its own.
#[derive(Debug, Clone)]
pub(crate) struct Team {
    abreast: Abreast,
}

impl Team {
    /// Craft in a team.
    pub(crate) const SIZE: usize = LANES;

    /// Of nobody.
    pub(crate) fn new() -> Self {
        Self { abreast: Abreast::new() }
    }

    /// Gives a lane to a craft; whether it can fly there.
    pub(crate) fn enter(&mut self, lane: usize, craft: &SimulatedCraft) -> bool {
        self.abreast.enter(lane, craft.plant())
    }

    /// Begins a tick of the craft of a lane, as in [`SimulatedCraft::advance`].
    #[inline]
    pub(crate) fn begin_tick(
        &mut self,
        lane: usize,
        craft: &mut SimulatedCraft,
        pwm: &[f32; 4],
        voltage_v: f64,
    ) {
        let holds = craft.begin_tick(pwm, voltage_v);
        self.abreast.put(lane, &craft.state, &holds);
    }

    /// Advances all whose tick has begun.
    pub(crate) fn advance(&mut self) {
        self.abreast.advance();
    }

    /// Ends a tick that was begun.
    #[inline]
    pub(crate) fn end_tick(&self, lane: usize, craft: &mut SimulatedCraft) {
        self.abreast.take(lane, &mut craft.state);
        craft.end_tick();
    }
}
