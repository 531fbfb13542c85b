//! What a model predicts of a flight, and what it leaves, but for the pull of a load.

use model::Model;

use crate::fit::rotation::has_rotation;
use crate::fit::rows::RowColumn;
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
