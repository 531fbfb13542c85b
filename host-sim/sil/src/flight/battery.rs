//! The batteries of simulated flights.

use model::{Battery, Model};

/// The thesis' battery, V.
pub(super) const THESIS_BATTERY_V: f64 = 11.1;
/// A lithium-polymer pack of three cells in mid-discharge that ends near the thesis' 11.1 V: its
/// fall of 0.2 V a minute and its sag of half a volt are assumed (the thesis gives neither).
pub(super) const FLIGHT_BATTERY: Battery =
    Battery { full_v: 12.1, decay_v_per_s: 0.008, hover_sag_v: 0.5, hover_speed_rad_s: 635.0 };

/// The battery of a craft with another voltage than the thesis': the thesis' for this flight,
/// scaled from its 11.1 V to what the model was made at. A constant one stays constant; one that
/// falls and sags does so by the same shares. Absent: the model does not say at which voltage it
/// was made.
///
/// A model file holds no battery: it says what the craft does at a voltage, and flights' voltages
/// come with the flights. The shares (a fall of 4 % a minute, 4 % of sag in hover) are those of a
/// lithium-polymer pack of any number of cells.
pub(crate) fn battery_of(model: &Model, thesis: Battery) -> Option<Battery> {
    let made_at_v = model.reference.battery_v;
    if !(made_at_v > 0.0) {
        return None;
    }
    let share = made_at_v / THESIS_BATTERY_V;
    if share == 1.0 {
        return Some(thesis);
    }
    let hover_speed_rad_s = match design::plant::equilibrium(model, &design::plant::TrimTarget::default()) {
        Ok(hover) => hover.rotor_rad_s.iter().sum::<f64>() / 4.0,
        Err(_) => thesis.hover_speed_rad_s,
    };
    Some(Battery {
        full_v: share * thesis.full_v,
        decay_v_per_s: share * thesis.decay_v_per_s,
        hover_sag_v: share * thesis.hover_sag_v,
        hover_speed_rad_s,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battery_scales_with_the_voltage_that_the_model_was_made_at() {
        let mut model = Model::thesis();
        model.reference.battery_v = 2.0 * THESIS_BATTERY_V;
        let twice = battery_of(&model, FLIGHT_BATTERY).unwrap();
        assert_eq!((twice.full_v, twice.hover_sag_v), (24.2, 1.0));
        assert_eq!(twice.decay_v_per_s, 0.016);
        let constant = battery_of(&model, Battery::constant(THESIS_BATTERY_V)).unwrap();
        assert_eq!(constant.voltage_v(100.0, &[700.0; 4]), 22.2);
        model.reference.battery_v = THESIS_BATTERY_V;
        assert_eq!(battery_of(&model, FLIGHT_BATTERY), Some(FLIGHT_BATTERY));
        model.reference.battery_v = 0.0;
        assert_eq!(battery_of(&model, FLIGHT_BATTERY), None);
    }
}
