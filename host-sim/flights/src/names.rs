//! Names that other programs give the columns of a flight file, and the units that they write behind them.

use std::f64::consts::{PI, TAU};

use crate::columns::COLUMNS;

/// Standard gravity, m/s^2.
const G: f64 = 9.806_65;

/// Other names of columns, in small letters without spaces.
const ALIASES: [(&str, &[&str]); 26] = [
    ("t", &["time", "timestamp", "time_s", "t_s", "seconds"]),
    ("x", &["pos_x", "position_x", "x_m", "north"]),
    ("y", &["pos_y", "position_y", "y_m", "east"]),
    ("z", &["pos_z", "position_z", "z_m", "down"]),
    ("phi", &["roll", "phi_rad", "roll_rad"]),
    ("theta", &["pitch", "theta_rad", "pitch_rad"]),
    ("psi", &["yaw", "psi_rad", "yaw_rad"]),
    ("p", &["rollrate", "roll_rate", "gyro_x", "gyrox", "wx"]),
    ("q", &["pitchrate", "pitch_rate", "gyro_y", "gyroy", "wy"]),
    ("r", &["yawrate", "yaw_rate", "gyro_z", "gyroz", "wz"]),
    ("vbat", &["voltage", "battery", "battery_voltage", "vbatt", "voltage_v"]),
    ("ax", &["acc_x", "accx", "accel_x"]),
    ("ay", &["acc_y", "accy", "accel_y"]),
    ("az", &["acc_z", "accz", "accel_z"]),
    ("vx", &["vel_x", "velocity_x"]),
    ("vy", &["vel_y", "velocity_y"]),
    ("vz", &["vel_z", "velocity_z"]),
    ("qw", &["q_w", "quat_w"]),
    ("qx", &["q_x", "quat_x"]),
    ("qy", &["q_y", "quat_y"]),
    ("qz", &["q_z", "quat_z"]),
    ("cmd1", &["cmd_1", "motor_cmd1"]),
    ("cmd2", &["cmd_2", "motor_cmd2"]),
    ("cmd3", &["cmd_3", "motor_cmd3"]),
    ("cmd4", &["cmd_4", "motor_cmd4"]),
    ("omega1", &["omega_1"]),
];

/// Units as they are written in brackets, and the factor to the file's own.
const UNITS: [(&str, f64); 34] = [
    ("s", 1.0),
    ("sec", 1.0),
    ("ms", 1e-3),
    ("us", 1e-6),
    ("µs", 1e-6),
    ("ns", 1e-9),
    ("m", 1.0),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("rad", 1.0),
    ("deg", PI / 180.0),
    ("°", PI / 180.0),
    ("rad/s", 1.0),
    ("deg/s", PI / 180.0),
    ("°/s", PI / 180.0),
    ("dps", PI / 180.0),
    ("m/s", 1.0),
    ("cm/s", 1e-2),
    ("mm/s", 1e-3),
    ("m/s^2", 1.0),
    ("m/s2", 1.0),
    ("m/s/s", 1.0),
    ("m/s²", 1.0),
    ("g", G),
    ("mg", 1e-3 * G),
    ("v", 1.0),
    ("mv", 1e-3),
    ("rpm", TAU / 60.0),
    ("1", 1.0),
    ("-", 1.0),
    ("%", 1e-2),
    ("pwm", 1.0),
    ("normalised", 1.0),
    ("normalized", 1.0),
];

/// A name in a header row.
pub(crate) enum Named {
    /// A column, by its place in [`COLUMNS`], and the factor to its unit.
    Column(usize, f64),
    /// A column in a unit that is not known.
    UnknownUnit,
    /// Something else.
    Other,
}

/// What a name stands for. `exact` are the names that are there as they should be: another name for the same is left alone.
pub(crate) fn named(name: &str, exact: &[usize]) -> Named {
    if let Some(column) = COLUMNS.iter().position(|own| *own == name) {
        return Named::Column(column, 1.0);
    }
    let (bare, unit) = split_unit(name);
    let small = bare.trim().to_lowercase().replace(' ', "_");
    let alias = ALIASES.iter().find(|(own, others)| *own == small || others.contains(&small.as_str()));
    let known = alias.map_or(small.as_str(), |(own, _)| own);
    let Some(column) = COLUMNS.iter().position(|own| *own == known) else { return Named::Other };
    if exact.contains(&column) {
        return Named::Other;
    }
    // Microseconds of a command are its unit, not a time.
    let is_command = known.starts_with("cmd");
    match unit {
        None => Named::Column(column, 1.0),
        Some(_) if is_command => Named::Column(column, 1.0),
        Some(unit) => match UNITS.iter().find(|(name, _)| *name == unit.to_lowercase()) {
            Some((_, factor)) => Named::Column(column, *factor),
            None => Named::UnknownUnit,
        },
    }
}

/// Whether a name is another one of a column of ours: roll for phi.
pub(crate) fn is_other_name(name: &str) -> bool {
    matches!(named(name, &[]), Named::Column(..)) && !COLUMNS.contains(&name)
}

/// Whether a name is that of a column of ours, or another one for it.
pub fn is_known_name(name: &str) -> bool {
    !matches!(named(name, &[]), Named::Other)
}

/// A name without the unit behind it.
pub(crate) fn bare(name: &str) -> &str {
    split_unit(name).0.trim()
}

/// Factor to SI units of a further column; nothing where its unit is not known. "g" may be grams or gravities.
pub(crate) fn unit_of_further(name: &str) -> Option<f64> {
    const MORE: [&str; 6] = ["kg", "N", "Nm", "A", "W", "Pa"];
    let Some(unit) = split_unit(name).1 else { return Some(1.0) };
    if MORE.contains(&unit) {
        return Some(1.0);
    }
    let unit = unit.to_lowercase();
    let known = UNITS.iter().find(|(own, _)| *own == unit && !["g", "mg"].contains(own));
    known.map(|(_, factor)| *factor)
}

/// "x [mm]" or "x (mm)" as name and unit.
fn split_unit(name: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((bare, rest)) = name.split_once(open)
            && let Some(unit) = rest.trim().strip_suffix(close)
        {
            return (bare, Some(unit.trim()));
        }
    }
    (name, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(name: &str) -> Option<(&'static str, f64)> {
        match named(name, &[]) {
            Named::Column(column, factor) => Some((COLUMNS[column], factor)),
            Named::UnknownUnit | Named::Other => None,
        }
    }

    #[test]
    fn other_names_capitals_and_units_in_brackets_are_known() {
        let known = [
            ("time [ms]", "t", 1e-3),
            ("Roll (deg)", "phi", PI / 180.0),
            ("PITCH", "theta", 1.0),
            ("yaw rate [deg/s]", "r", PI / 180.0),
            ("X [mm]", "x", 1e-3),
            ("Battery Voltage [V]", "vbat", 1.0),
            ("acc_z [g]", "az", G),
            ("omega3 [rpm]", "omega3", TAU / 60.0),
            ("cmd2 [us]", "cmd2", 1.0),
            ("qw", "qw", 1.0),
        ];
        for (name, own, factor) in known {
            assert_eq!(column(name), Some((own, factor)), "{name}");
        }
        assert_eq!(column("load_north"), None);
        assert!(matches!(named("x [furlong]", &[]), Named::UnknownUnit));
    }

    #[test]
    fn another_name_for_what_is_there_is_left_alone() {
        assert!(matches!(named("timestamp", &[0]), Named::Other));
        assert!(matches!(named("roll", &[0]), Named::Column(4, _)));
    }

    #[test]
    fn every_alias_is_of_a_column_and_of_one_only() {
        let mut all: Vec<&str> = ALIASES.iter().flat_map(|(_, others)| others.iter().copied()).collect();
        assert!(ALIASES.iter().all(|(own, _)| COLUMNS.contains(own)));
        assert!(all.iter().all(|name| !COLUMNS.contains(name)));
        let count = all.len();
        all.sort_unstable();
        all.dedup();
        assert_eq!(all.len(), count);
    }
}
