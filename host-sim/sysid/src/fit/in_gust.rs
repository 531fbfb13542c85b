//! Terms of the equations of motion in a wind that wanders.
//!
//! The wind is found by its push along the horizontal axes. There it is no prediction: fitted beside it, drag and wind explain each other, the
//! larger the one the smaller the other, and a term that has both is correlated with what it is to explain. So these axes have the terms of a
//! craft without the wind, and its push stays in the residual, of which the slow part is taken ([`crate::fit::slow`]). On the other axes
//! the wind acts as on a craft that flies through it.

use model::{Plant, SampleInput};
use nalgebra::Vector3;

use crate::fit::terms::{Slots, Terms};

/// Room for the terms of the axes on which the wind acts.
#[derive(Default)]
pub(crate) struct InGust(Vec<f64>);

impl InGust {
    /// Writes the terms at a state in a wind that adds `gust_m_s`, body axes.
    pub(crate) fn write(
        &mut self,
        (layout, terms, plant): (&Slots, &impl Terms, &Plant),
        input: &SampleInput,
        gust_m_s: Vector3<f64>,
        row: &mut [f64],
    ) {
        layout.write(terms, &plant.sample_of(input), row);
        self.0.resize(row.len(), 0.0);
        let through = SampleInput { velocity_m_s: input.velocity_m_s - gust_m_s, ..input.clone() };
        layout.write(terms, &plant.sample_of(&through), &mut self.0);
        for slot in layout.slots_but_horizontal_forces() {
            row[slot] = self.0[slot];
        }
    }
}
