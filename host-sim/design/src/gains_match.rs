//! Whether gains match a model's vehicle: by the gains file's provenance, and by what the law's
//! mixing and hover thrust do with the model's rotors. The second also catches a file whose
//! provenance is missing or wrong.

use std::path::Path;

use control::gains::Law;
use gains_file::{Gains, GainsError, VehicleId};
use model::Model;

use crate::error::Result;
use crate::loops::law_effect;
use crate::plant::{Linear, TrimTarget};

/// Reads a gains file and refuses it unless it belongs to the model's vehicle. Every program that
/// flies or judges gains on a model calls this.
///
/// # Errors
/// A file that cannot be read or flown, one of another vehicle, or a model that cannot hover.
pub fn read_for(path: &Path, model: &Model) -> Result<Gains> {
    let gains = Gains::read(path)?;
    // What the file itself says comes first: it needs no equilibrium.
    belongs(&gains, model, path)?;
    gains_match(&gains, model, &Linear::new(model, &TrimTarget::default())?, path)?;
    Ok(gains)
}

fn belongs(gains: &Gains, model: &Model, path: &Path) -> Result<()> {
    let sha256 = model.vehicle.sha256();
    Ok(gains.belongs_to(&VehicleId { name: &model.vehicle.name, sha256: Some(&sha256) }, path)?)
}

/// Refuses gains that belong to another vehicle than the model's. `path` is for messages.
///
/// # Errors
/// [`GainsError::OtherVehicle`].
pub fn gains_match(gains: &Gains, model: &Model, linear: &Linear, path: &Path) -> Result<()> {
    belongs(gains, model, path)?;
    let refuse = |reason: String| Err(GainsError::OtherVehicle { path: path.to_owned(), reason }.into());
    let range = model.vehicle.motors.command_range;
    if gains.config.command_range != range {
        return refuse(format!(
            "command_range is {:?}, the vehicle's is {range:?}",
            gains.config.command_range
        ));
    }
    let Law::ModelBased(law) = &gains.config.law else { return Ok(()) };
    let thrust_n = linear.equilibrium.inputs[0];
    if !(law.hover_thrust_n / thrust_n - 1.0).abs().le(&HOVER_TOLERANCE) {
        return refuse(format!(
            "hover_thrust_n is {:.4} N, the model hovers at {thrust_n:.4} N",
            law.hover_thrust_n
        ));
    }
    let effect = law_effect(model, linear, &gains.config, linear.equilibrium.battery_v)?;
    for (axis, what) in ["thrust", "roll", "pitch", "yaw"].into_iter().enumerate() {
        let share = effect[(axis, axis)];
        if !(share > LEAST_EFFECT && share < MOST_EFFECT) {
            return refuse(format!(
                "where the law asks for 1 of {what}, this model's rotors give {share:.3}; make the mixing and the motor map from this model"
            ));
        }
    }
    Ok(())
}

/// Hover thrust may be off by a battery or a payload.
const HOVER_TOLERANCE: f64 = 0.3;
/// A gain error beyond these is not an error of identification but another craft.
const LEAST_EFFECT: f64 = 0.5;
/// See [`LEAST_EFFECT`].
const MOST_EFFECT: f64 = 2.0;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::DesignError;

    const THESIS: &str = include_str!("../../model/vehicles/f330-gains.toml");

    #[test]
    fn gains_of_another_craft_are_refused_with_the_reason() {
        let gains = Gains::parse(THESIS, Path::new("g.toml")).unwrap();
        let check = |edit: &dyn Fn(&mut Model, &mut Gains)| {
            let (mut model, mut gains) = (Model::thesis(), gains.clone());
            edit(&mut model, &mut gains);
            let linear = Linear::new(&model, &TrimTarget::default()).unwrap();
            gains_match(&gains, &model, &linear, Path::new("g.toml"))
        };
        assert!(check(&|_, _| {}).is_ok());
        let reason = |edit: &dyn Fn(&mut Model, &mut Gains)| check(edit).unwrap_err().to_string();
        assert!(reason(&|m, _| m.vehicle.name = "other".into()).contains("\"other\""));
        assert!(reason(&|_, g| g.config.command_range = [0.0, 1.0]).contains("command_range"));
        assert!(reason(&|m, _| m.vehicle.mass = 2.0).contains("hover_thrust_n"));
        let yaw_gone = |m: &mut Model, _: &mut Gains| {
            let mut term = m.term(model::Effect::RotorMoments).unwrap().clone();
            term.coefficients[8..].iter_mut().for_each(|c| c.value *= 0.3);
            let values: Vec<f64> = term.coefficients.iter().map(|c| c.value).collect();
            m.set(model::Effect::RotorMoments, &values);
        };
        assert!(reason(&yaw_gone).contains("asks for 1 of yaw, this model's rotors give 0.300"));
    }

    /// A vehicle that keeps its name but was weighed again is another vehicle.
    #[test]
    fn a_vehicle_of_the_same_name_that_was_measured_otherwise_is_refused() {
        let mut gains = Gains::parse(THESIS, Path::new("g.toml")).unwrap();
        let mut model = Model::thesis();
        let provenance = gains.provenance.as_mut().unwrap();
        provenance.vehicle_sha256 = Some(model.vehicle.sha256());
        let check = |model: &Model| {
            let linear = Linear::new(model, &TrimTarget::default()).unwrap();
            gains_match(&gains, model, &linear, Path::new("g.toml"))
        };
        assert!(check(&model).is_ok());
        model.vehicle.mass *= 1.01;
        let error = check(&model).unwrap_err();
        assert!(matches!(error, DesignError::Gains(GainsError::OtherVehicle { .. })));
        assert!(error.to_string().contains("with other measurements"), "{error}");
    }
}
