//! By how much a craft and its air are otherwise than their model says.

use model::{Effect, Model};

/// By how much a craft and its air are otherwise than their model says; nothing by default.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviations {
    /// More than the model's mass, kg.
    pub extra_mass_kg: f64,
    /// Centre of mass forward and to the right of the model's, m.
    pub off_centre_m: [f64; 2],
    /// Part of the thrust that each motor lacks.
    pub thrust_loss: [f64; 4],
    /// More than the model's time constant of the rotors, s.
    pub slower_rotors_s: f64,
    /// More dead time between command and rotor, s.
    pub dead_time_s: f64,
    /// Wind at z = 0 to the north and east beside the model's, m/s.
    pub wind_m_s: [f64; 2],
    /// By how much more it grows with the height, 1/s.
    pub shear_per_s: [f64; 2],
}

impl Deviations {
    /// Each effect with what is added to its coefficients.
    fn of_effects(&self) -> [(Effect, &[f64]); 7] {
        use std::slice::from_ref;
        [
            (Effect::MassChange, from_ref(&self.extra_mass_kg)),
            (Effect::ComOffset, &self.off_centre_m),
            (Effect::MotorEfficiency, &self.thrust_loss),
            (Effect::MotorLag, from_ref(&self.slower_rotors_s)),
            (Effect::InputDelay, from_ref(&self.dead_time_s)),
            (Effect::SteadyWind, &self.wind_m_s),
            (Effect::WindShear, &self.shear_per_s),
        ]
    }

    /// Makes a model of a craft like them. Effects that nothing is added to stay away from models without them.
    pub fn shift(&self, model: &mut Model) {
        for (effect, more) in self.of_effects() {
            let own: Option<Vec<f64>> =
                model.term(effect).map(|term| term.coefficients.iter().map(|c| c.value).collect());
            if own.is_none() && more.iter().all(|value| *value == 0.0) {
                continue;
            }
            let own = own.unwrap_or_else(|| vec![0.0; more.len()]);
            let values: Vec<f64> = own.iter().zip(more).map(|(own, more)| own + more).collect();
            model.set(effect, &values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_deviates_is_added_to_what_the_model_has() {
        let mut model = Model::thesis();
        let count = model.effects().len();
        Deviations::default().shift(&mut model);
        assert_eq!(model.effects().len(), count);
        model.set(Effect::SteadyWind, &[0.5, -0.5]);
        let deviations = Deviations { extra_mass_kg: 0.1, wind_m_s: [0.25, 0.0], ..Deviations::default() };
        deviations.shift(&mut model);
        let values = |effect| -> Vec<f64> {
            model.term(effect).unwrap().coefficients.iter().map(|c| c.value).collect()
        };
        assert_eq!(values(Effect::SteadyWind), [0.75, -0.5]);
        assert_eq!(values(Effect::MassChange), [0.1]);
        assert!(!model.has(Effect::WindShear));
    }
}
