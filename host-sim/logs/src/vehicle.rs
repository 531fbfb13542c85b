//! The vehicle file that logs can fill, and what has to be measured for the rest of it.

use std::fmt::Write as _;

use flights::Column;
use model::{LogColumns, LogFrames, MotorMapKind, Motors, Pack, Spin, Vehicle};

use crate::format::Format;
use crate::import::Import;
use crate::recording::Hints;

/// A vehicle file as far as logs fill it.
#[derive(Debug, Clone, PartialEq)]
pub struct Draft {
    /// The vehicle, with typical values where the logs say nothing.
    pub vehicle: Vehicle,
    /// What has to be measured: field of the file, and how, a sentence each.
    pub missing: Vec<(&'static str, &'static str)>,
}

/// Sizes of a usual craft that logs in a format: kg, m from the centre to a motor, m of rotor radius.
fn usual_sizes(format: Format) -> [f64; 3] {
    match format {
        Format::Crazyflie | Format::Rosbag1 | Format::Rosbag2 | Format::Mcap | Format::Parquet => {
            [0.034, 0.046, 0.0235]
        }
        Format::Blackbox => [0.6, 0.11, 0.0635],
        Format::Ulog | Format::Dataflash | Format::Csv => [1.5, 0.25, 0.127],
    }
}

/// Whether every flight has rotor speeds: they stand in the place of a motor map.
fn has_speeds(flown: &[&Import]) -> bool {
    let mut parts = flown.iter().flat_map(|import| &import.flights);
    parts.all(|part| part.flight.column(Column::Omega1).is_some())
}

/// The vehicle file of the craft that wrote these logs; nothing without a flight. An error says where the logs contradict
/// each other.
pub fn draft(imports: &[Import]) -> Result<Option<Draft>, String> {
    let flown: Vec<&Import> = imports.iter().filter(|import| !import.flights.is_empty()).collect();
    let Some(first) = flown.first() else { return Ok(None) };
    let unit = one_of(&flown, "have motor commands in different units", |h| h.command_unit.clone())?;
    let spin = one_of(&flown, "have motors that spin in different directions", |h| h.spin)?;
    let positions = one_of(&flown, "have rotors in different places", |h| h.rotor_positions_m)?;
    let name = flown.iter().find_map(|import| import.hints.name.clone());
    let number = |of: fn(&Hints) -> Option<f64>| flown.iter().find_map(|import| of(&import.hints));
    let [mass, usual_arm, rotor_radius] = usual_sizes(first.format);
    let arm_length = positions.map(mean_arm);
    let named_range = flown.iter().find_map(|import| import.hints.command_range);
    let range = named_range.or_else(|| flown_range(&flown)).unwrap_or([0.0, 1.0]);
    let missing = missing(arm_length.is_some(), spin.is_some(), named_range.is_some());
    let vehicle = Vehicle {
        name: name.unwrap_or_else(|| "craft".into()),
        mass,
        arm_length: arm_length.unwrap_or(usual_arm),
        rotor_radius,
        air_density: number(|h| h.air_density).unwrap_or(1.225),
        gravity: number(|h| h.gravity).unwrap_or(9.81),
        tracked_point: [0.0; 3],
        unmeasured: missing.iter().map(|(field, _)| (*field).to_owned()).collect(),
        motors: Motors {
            spin: spin.unwrap_or(["ccw", "cw", "ccw", "cw"]).map(sense),
            command_unit: unit.unwrap_or_else(|| "of the log".into()),
            command_range: range,
            map: (!has_speeds(&flown)).then_some(MotorMapKind::Identify),
            command: None,
            voltage: None,
            offset: None,
            lag: None,
            log_order: None,
        },
        battery: Pack { cells: cells(&flown) },
        columns: LogColumns::new(),
        frames: LogFrames::default(),
    };
    Ok(Some(Draft { vehicle, missing }))
}

/// Of the packs that flew; nothing where the logs name different ones.
fn cells(flown: &[&Import]) -> Option<u8> {
    let mut said = flown.iter().filter_map(|import| import.hints.cells);
    let first = said.next()?;
    said.all(|other| other == first)
        .then(|| u8::try_from(first).ok())
        .flatten()
        .filter(|cells| Pack::CELLS.contains(cells))
}

/// How to measure the fields of a vehicle file that logs do not tell, in their order.
const HOW: [(&str, &str); 6] = [
    ("mass", "weigh the craft ready to fly, with its battery, in kg"),
    ("arm_length", "measure from the middle of the craft to the shaft of a motor, in m"),
    ("rotor_radius", "measure half of the diameter of a propeller, in m"),
    (
        "tracked_point",
        "measure from the centre of mass (where the craft balances) to the point whose position is logged (with motion capture the centre of the markers, otherwise usually the flight controller): forward, right and down, in m",
    ),
    (
        "motors.spin",
        "see which way each propeller turns, seen from above (cw or ccw): 1 front-left, 2 front-right, 3 rear-right, 4 rear-left",
    ),
    (
        "motors.command_range",
        "look up the motor commands at idle and at full throttle; the values here are only the smallest and largest in the logs",
    ),
];

/// How to measure a field of a vehicle file.
pub fn how_to_measure(field: &str) -> Option<&'static str> {
    HOW.iter().find(|(own, _)| *own == field).map(|(_, how)| *how)
}

/// What has to be measured, each with how.
fn missing(has_arm: bool, has_spin: bool, has_range: bool) -> Vec<(&'static str, &'static str)> {
    let told = [("arm_length", has_arm), ("motors.spin", has_spin), ("motors.command_range", has_range)];
    HOW.into_iter().filter(|(field, _)| !told.contains(&(*field, true))).collect()
}

/// What all logs that say it agree on.
fn one_of<T: PartialEq>(
    flown: &[&Import],
    problem: &str,
    of: impl Fn(&Hints) -> Option<T>,
) -> Result<Option<T>, String> {
    let mut said = flown.iter().filter_map(|import| Some((import, of(&import.hints)?)));
    let Some((first, value)) = said.next() else { return Ok(None) };
    match said.find(|(_, other)| *other != value) {
        Some((other, _)) => Err(format!(
            "{} and {} {problem}: these are two craft; import the logs of one craft at a time",
            first.path.display(),
            other.path.display()
        )),
        None => Ok(Some(value)),
    }
}

fn sense(spin: &str) -> Spin {
    if spin == "cw" { Spin::Cw } else { Spin::Ccw }
}

fn mean_arm(positions_m: [[f64; 2]; 4]) -> f64 {
    positions_m.iter().map(|[front, right]| front.hypot(*right)).sum::<f64>() / 4.0
}

/// Smallest and largest command in flight.
fn flown_range(flown: &[&Import]) -> Option<[f64; 2]> {
    let columns = [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4];
    let parts = flown.iter().flat_map(|import| &import.flights);
    let all = parts.flat_map(|part| columns.iter().filter_map(|c| part.flight.column(*c)).flatten());
    let finite = all.copied().filter(|command| command.is_finite());
    let [low, high] = finite.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
    (low < high).then_some([low, high])
}

impl Draft {
    /// The text of the file, with how to measure what is missing.
    pub fn to_toml(&self) -> String {
        let Vehicle { name, mass, arm_length, rotor_radius, air_density, gravity, motors, .. } =
            &self.vehicle;
        let how = |field: &str| {
            let found = self.missing.iter().find(|(own, _)| *own == field);
            found.map_or(String::new(), |(_, how)| format!("   # NOT MEASURED: {how}"))
        };
        let mut text = String::from(
            "# Filled in from logs. Values marked NOT MEASURED are guesses: replace each with your own,\n\
             # then delete its name from the list `unmeasured`.\n",
        );
        let unmeasured = self.missing.iter().map(|(field, _)| format!("{field:?}")).collect::<Vec<_>>();
        let [low, high] = motors.command_range;
        let spin = motors.spin.map(|spin| if spin == Spin::Cw { "\"cw\"" } else { "\"ccw\"" });
        let _ = write!(
            text,
            "name = {name:?}\nmass = {mass:?}{}\narm_length = {arm_length:?}{}\nrotor_radius = {rotor_radius:?}{}\n\
             air_density = {air_density:?}   # kg/m^3\ngravity = {gravity:?}   # m/s^2\n\
             tracked_point = [0.0, 0.0, 0.0]{}\nunmeasured = [{}]\n\n\
             [motors]   # 1 front-left, 2 front-right, 3 rear-right, 4 rear-left\nspin = [{}]{}\n\
             command_unit = {:?}\ncommand_range = [{low:?}, {high:?}]{}\n\
             {}",
            how("mass"),
            how("arm_length"),
            how("rotor_radius"),
            how("tracked_point"),
            unmeasured.join(", "),
            spin.join(", "),
            how("motors.spin"),
            motors.command_unit,
            how("motors.command_range"),
            match motors.map {
                Some(MotorMapKind::Identify) =>
                    "map = \"identify\"   # no test stand: see `quadlab motor-map`\n",
                None => "# no motor map: the logs have rotor speeds\n",
            },
        );
        if let Some(cells) = self.vehicle.battery.cells {
            let _ =
                write!(text, "\n[battery]\ncells = {cells}   # in series: when the craft warns and lands\n");
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use flights::Flight;

    use super::*;
    use crate::conversion::Part;
    use crate::import::Sources;
    use crate::log::Losses;

    fn import(file: &str, hints: Hints) -> Import {
        let command = vec![1200.0, 1300.0, 1250.0];
        let columns = [(Column::T, vec![0.0, 0.01, 0.02]), (Column::Cmd1, command)];
        let flight = Flight::from_columns("log.csv", columns);
        Import {
            path: PathBuf::from(file),
            format: Format::Ulog,
            firmware: None,
            messages: Vec::new(),
            clocks: Vec::new(),
            sources: Sources::default(),
            flights: vec![Part { flight, span: [0.0, 0.02], rate_hz: 100.0, lost_s: 0.0, cuts: Vec::new() }],
            hints,
            losses: Losses::default(),
            limits: Vec::new(),
            notes: Vec::new(),
        }
    }

    #[test]
    fn what_logs_tell_is_filled_in_and_the_rest_is_asked_for() {
        let hints = Hints {
            spin: Some(["cw", "ccw", "cw", "ccw"]),
            rotor_positions_m: Some([[0.15, -0.2], [0.15, 0.2], [-0.15, 0.2], [-0.15, -0.2]]),
            command_unit: Some("us".into()),
            gravity: Some(9.79),
            cells: Some(4),
            ..Hints::default()
        };
        let draft = draft(&[import("a.ulg", Hints::default()), import("b.ulg", hints)]).unwrap().unwrap();
        assert!((draft.vehicle.arm_length - 0.25).abs() < 1e-12);
        assert_eq!((draft.vehicle.gravity, draft.vehicle.air_density), (9.79, 1.225));
        assert_eq!(draft.vehicle.battery.cells, Some(4));
        assert_eq!(draft.vehicle.motors.command_range, [1200.0, 1300.0]);
        let fields: Vec<&str> = draft.missing.iter().map(|(field, _)| *field).collect();
        assert_eq!(fields, ["mass", "rotor_radius", "tracked_point", "motors.command_range"]);
        let text = draft.to_toml();
        assert_eq!(Vehicle::parse(&text, Path::new("vehicle.toml")).unwrap(), draft.vehicle, "{text}");
        assert!(text.contains("mass = 1.5   # NOT MEASURED: weigh the craft"), "{text}");
    }

    /// Where all flights have rotor speeds, a model is fitted to these; of one without them the map has to be found.
    #[test]
    fn rotor_speeds_stand_in_the_place_of_a_map() {
        let with_speeds = |file| {
            let mut import = import(file, Hints::default());
            let all = [Column::T, Column::Cmd1, Column::Omega1].map(|column| (column, vec![0.0, 0.01, 0.02]));
            import.flights[0].flight = Flight::from_columns("log.csv", all);
            import
        };
        let all = draft(&[with_speeds("a.bbl"), with_speeds("b.bbl")]).unwrap().unwrap();
        assert_eq!(all.vehicle.motors.map, None);
        let text = all.to_toml();
        assert!(!text.contains("identify"), "{text}");
        assert_eq!(Vehicle::parse(&text, Path::new("vehicle.toml")).unwrap(), all.vehicle, "{text}");
        let some = draft(&[with_speeds("a.bbl"), import("b.bbl", Hints::default())]).unwrap().unwrap();
        assert_eq!(some.vehicle.motors.map, Some(MotorMapKind::Identify));
    }

    #[test]
    fn logs_of_two_craft_are_not_put_into_one_file() {
        let turning = |spin| import("a.ulg", Hints { spin: Some(spin), ..Hints::default() });
        let two = [turning(["cw", "ccw", "cw", "ccw"]), turning(["ccw", "cw", "ccw", "cw"])];
        assert!(draft(&two).unwrap_err().contains("import the logs of one craft at a time"));
    }

    #[test]
    fn without_a_flight_there_is_no_vehicle() {
        let none = Import { flights: Vec::new(), ..import("a.ulg", Hints::default()) };
        assert_eq!(draft(&[none]), Ok(None));
    }
}
