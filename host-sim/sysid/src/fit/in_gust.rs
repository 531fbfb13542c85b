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
        let through = SampleInput { velocity_m_s: input.velocity_m_s - gust_m_s, ..*input };
        layout.write(terms, &plant.sample_of(&through), &mut self.0);
        for slot in layout.slots_but_horizontal_forces() {
            row[slot] = self.0[slot];
        }
    }
}

#[cfg(test)]
mod tests {
    use model::{Axis, Effect, Model};

    use crate::fit::gusts;
    use crate::testing::prepared;

    /// A craft that stands in a north wind, nose to the north, is one that flies to the south: its flapping moment is that of the air, and
    /// its drag is not told apart from what pushes.
    #[test]
    fn the_wind_turns_a_craft_and_does_not_push_it() {
        let mut flight = prepared(400, |_, _| {});
        gusts::expect(&mut [&mut flight]);
        let [north, _] = flight.stretches[0].gust_ned_m_s.as_mut().unwrap();
        north.fill(2.0);
        let model = Model::new(model::Vehicle::thesis());
        let effects = [Effect::LinearDrag, Effect::FlappingMoment];
        let columns = flight.columns(&effects, &model, 1, None);
        let at = |column: usize, axis: Axis| columns[column][axis.index()].as_ref().unwrap()[100];
        assert!(at(0, Axis::U).abs() < 1e-9);
        let pitching = (3..columns.len()).find(|&c| columns[c][Axis::Q.index()].is_some()).unwrap();
        assert!((at(pitching, Axis::Q) + 2.0).abs() < 1e-9, "{}", at(pitching, Axis::Q));
    }
}
