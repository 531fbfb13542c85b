//! Measured quantities as people call them.

/// A quantity, by its name in formulas.
pub(super) fn meaning(name: &'static str) -> &'static str {
    match name {
        "u" => "forward airspeed u",
        "v" => "sideward airspeed v",
        "w" => "airspeed w along the rotors' axis (positive down)",
        "speed" => "airspeed",
        "horizontal_speed" => "horizontal airspeed",
        "north_speed" => "speed north",
        "east_speed" => "speed east",
        "down_speed" => "sink rate",
        "north" => "north position",
        "east" => "east position",
        "p" => "roll rate",
        "q" => "pitch rate",
        "r" => "yaw rate",
        "phi" => "roll angle",
        "theta" => "pitch angle",
        "psi" => "heading",
        "omega1" => "speed of rotor 1",
        "omega2" => "speed of rotor 2",
        "omega3" => "speed of rotor 3",
        "omega4" => "speed of rotor 4",
        "rotor_speed" => "mean rotor speed",
        "vbat" => "battery voltage",
        "energy" => "energy used",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use model::{COMBINATIONS, QUANTITIES, Quantity};

    use super::*;

    #[test]
    fn no_two_quantities_are_called_the_same() {
        let names = || QUANTITIES.iter().chain(COMBINATIONS).map(|quantity| quantity.name);
        let called: std::collections::BTreeSet<&str> = names().map(meaning).collect();
        assert_eq!(called.len(), names().count());
    }

    /// The model says for itself what its quantities are.
    #[test]
    fn angles_rates_and_the_battery_are_called_what_the_model_calls_them() {
        for name in ["p", "q", "r", "phi", "theta", "vbat"] {
            assert_eq!(meaning(name), Quantity::named(name).unwrap().meaning);
        }
    }

    #[test]
    fn a_further_column_keeps_its_name() {
        assert_eq!(meaning("payload_kg"), "payload_kg");
    }
}
