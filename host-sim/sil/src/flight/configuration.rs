//! What a flight changes in the controller's configuration, and the room that it flies in.

use std::path::Path;

use control::Config;
use model::Model;

use super::error::SilError;

/// The cage of the thesis' laboratory (chapter 3): 7.6 m x 5.2 m, 2.8 m high, centred on the
/// origin. Greatest |x|, |y| and height, m.
pub const CAGE_M: [f64; 3] = [3.8, 2.6, 2.8];

/// Gains of the default design on the thesis' craft: motors at their ends serve attitude first, and
/// tilt raises the thrust.
///
/// # Errors
/// None, or the file that is built in would not be readable.
pub fn designed_config() -> Result<Config, SilError> {
    const NAME: &str = "f330-designed-gains.toml";
    let text = include_str!("../../../model/vehicles/f330-designed-gains.toml");
    Ok(design::Gains::parse(text, Path::new(NAME))?.config)
}

/// A model whose motors can be commanded, by gains of its own or by the thesis'.
///
/// # Errors
/// A model that cannot be read or simulated, or commanded with these gains.
pub fn flyable(path: &Path, own_gains: bool) -> Result<Model, SilError> {
    let model = Model::read_to_simulate(path)?;
    if !model.can_be_commanded() {
        return Err(SilError::NoMotorMap(path.into()));
    }
    let (found, expected) =
        (model.vehicle.motors.command_range, Config::thesis().command_range.map(f64::from));
    if !own_gains && found != expected {
        return Err(SilError::OtherCommands { path: path.into(), found, expected });
    }
    Ok(model)
}

/// For flights with ideal sensors: a craft at rest without noise gives the same pose to the last
/// bit for seconds, which on a real one only a frozen tracker does, so that it is not judged how
/// often a reading repeats.
pub(crate) fn with_still_sensors(mut config: Config) -> Config {
    const ANY: u32 = 1_000_000;
    (config.supervision.pose.repeats, config.supervision.imu.repeats) = (ANY, ANY);
    config
}

/// Gains with what an identification flight needs beside them
/// ([`FlightPlan::identification`](crate::FlightPlan::identification) says why): references that
/// move at 2.5 m/s, angles up to 20 degrees, the whole cage, and rates from the gyro.
pub fn for_identification(mut config: Config) -> Config {
    use control::gains::{Complement, GyroFusion, Law, PositionLimits};
    config.position_limits = PositionLimits { x_m: [-2.0, 2.0], y_m: [-1.2, 1.2], z_m: [-2.0, -0.1] };
    // Up to the walls: what a hidden effect does to the flight is what is wanted.
    let [x, y, ceiling] = CAGE_M;
    let fence = &mut config.supervision.fence;
    (fence.x_m, fence.y_m, fence.z_m[0]) = ([-x, x], [-y, y], -ceiling);
    config.estimation.gyro = Some(GyroFusion { corner_rad_s: 5.0, complement: Complement::Exact });
    if let Law::ModelBased(law) = &mut config.law {
        for position in [&mut law.loops.x, &mut law.loops.y] {
            position.rate_limit_m_s = 2.5;
            position.output_limit_rad = Some(20_f64.to_radians());
        }
    }
    config
}
