//! What a model predicts of a flight, and what it leaves, but for the pull of a load.

use model::Model;

use crate::fit::least_squares::RowColumn;
use crate::fit::rotation::has_rotation;
use crate::prepare::Prepared;

/// The targets of what a model speaks of over the rows at every `stride`th sample: what it does not is no error of it, so that nothing is
/// measured there and nothing predicted.
pub(crate) fn measured(flight: &Prepared, model: &Model, stride: usize) -> [Vec<f64>; 6] {
    let mut measured = flight.targets(&model.vehicle, &model.adjustments(), stride);
    if !has_rotation(model) {
        measured[3..].iter_mut().for_each(|axis| axis.fill(0.0));
    }
    measured
}

pub(crate) fn less(measured: &[Vec<f64>; 6], predicted: &RowColumn) -> [Vec<f64>; 6] {
    std::array::from_fn(|axis| match &predicted[axis] {
        Some(predicted) => measured[axis].iter().zip(predicted).map(|(m, p)| m - p).collect(),
        None => measured[axis].clone(),
    })
}

/// Measured, and measured less predicted but for the pull of a load, over the rows at every `stride`th sample.
pub(crate) fn measured_less_predicted(
    flight: &Prepared,
    model: &Model,
    stride: usize,
) -> ([Vec<f64>; 6], [Vec<f64>; 6]) {
    let measured = measured(flight, model, stride);
    let predicted = flight.predicted_by(&[model], stride, None).pop().unwrap_or_default();
    let residual = less(&measured, &predicted);
    (measured, residual)
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::testing::{NONE, fly, truth};

    #[test]
    fn where_nothing_is_predicted_all_is_left() {
        let measured: [Vec<f64>; 6] = std::array::from_fn(|axis| vec![axis as f64, 1.0]);
        let mut predicted = RowColumn::default();
        predicted[4] = Some(vec![0.5, -1.0]);
        let left = less(&measured, &predicted);
        assert_eq!((&left[3], &left[4]), (&vec![3.0, 1.0], &vec![3.5, 2.0]));
    }

    #[test]
    fn a_model_of_forces_alone_has_no_moments_to_explain() {
        let mut model = truth();
        let flight = Prepared::new(&fly(&model, 1, 5.0, &NONE), &model.vehicle).unwrap();
        let all = measured(&flight, &model, 3);
        assert!(all[3..].iter().all(|axis| axis.iter().any(|m| m.abs() > 0.1)));
        model.terms.retain(|term| matches!(term.effect, Effect::Thrust | Effect::LinearDrag));
        let forces = measured(&flight, &model, 3);
        assert_eq!(forces[..3], all[..3]);
        assert!(forces[3..].iter().all(|axis| axis.len() == all[3].len()));
        assert!(forces[3..].iter().flatten().all(|m| *m == 0.0));
    }

    #[test]
    fn the_true_model_leaves_next_to_nothing_of_a_flight_without_noise() {
        let model = truth();
        let flight = Prepared::new(&fly(&model, 1, 8.0, &NONE), &model.vehicle).unwrap();
        let (measured, left) = measured_less_predicted(&flight, &model, 3);
        for (axis, (measured, left)) in measured.iter().zip(&left).enumerate() {
            let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
            assert!(square(left) < 1e-3 * square(measured), "{axis}: {} {}", square(left), square(measured));
        }
    }
}
