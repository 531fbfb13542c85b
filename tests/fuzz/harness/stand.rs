//! Logs of a motor stand and the map that they give: one file of both, the craft's log before a line `--`, the tachometer's behind it.

use std::path::Path;
use std::sync::LazyLock;

use model::Vehicle;
use motor_stand::motor_map::motor_map;
use motor_stand::stand::Stand;

static VEHICLE: LazyLock<Vehicle> = LazyLock::new(|| {
    Vehicle::parse(include_str!("../corpus/vehicle/f330.toml"), Path::new("f330.toml"))
        .expect("the thesis' craft")
});

/// Line between the two logs.
const BETWEEN: &[u8] = b"\n--\n";

/// What is read has a value for each time, and a map of finite numbers or a reason why there is none.
pub(crate) fn stand(bytes: &[u8]) -> Result<(), String> {
    let at = bytes.windows(BETWEEN.len()).position(|window| window == BETWEEN).ok_or("one log")?;
    let (craft, rotor) = (&bytes[..at + 1], &bytes[at + BETWEEN.len()..]);
    let stand =
        Stand::parse((craft, Path::new("craft.csv")), (rotor, Path::new("rotor.csv")), &VEHICLE, None)
            .map_err(|error| error.to_string())?;
    assert_eq!(stand.battery_v.len(), stand.craft_s.len());
    for motor in &stand.motors {
        assert_eq!(
            (motor.command.len(), motor.speed_rad_s.len()),
            (stand.craft_s.len(), stand.rotor_s.len())
        );
    }
    let maps =
        [false, true].map(|with_voltage| motor_map(&stand, with_voltage).map_err(|why| why.to_string()));
    for map in &maps {
        match map {
            Ok(found) => assert!(found.clock.offset_s.value.is_finite(), "{found:?}"),
            Err(why) => assert!(!why.contains(char::is_control), "{why:?}"),
        }
    }
    let [plain, _] = maps;
    plain.map(drop)
}
