//! Mission scripts: what is read can be begun, and asks for numbers.

use std::path::{Path, PathBuf};

use ground::mission::{CraftStatus, Mission, parse_script};
use proto::{Pose, State};

/// Where the patterns lie that the corpus' scripts name.
fn corpus() -> PathBuf {
    // The manifest is that of the tests, or that of the fuzz targets inside them.
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR"));
    let tests = if manifest.ends_with("fuzz") { manifest.into() } else { manifest.join("fuzz") };
    tests.join("corpus/script")
}

/// A script, flown for a second by a craft that stands and by one that flies.
pub(crate) fn script(bytes: &[u8]) -> Result<(), String> {
    let text = std::str::from_utf8(bytes).map_err(|error| error.to_string())?;
    let steps = parse_script(text, &corpus().join("script.toml")).map_err(|error| error.to_string())?;
    for state in [State::Disarmed, State::Flying] {
        let pose = Pose { position_m: [0.1, -0.2, -1.0], attitude_rad: [0.0, 0.0, 0.5] };
        let craft = CraftStatus { state, pose, preflight: u16::MAX, found: 0 };
        let mut mission = Mission::new(steps.clone(), 0.01, 1.0);
        mission.adopt(&craft);
        for k in 0..100 {
            let command = mission.command(0.01 * f64::from(k), &craft);
            let numbers = [command.yaw_rad, command.z_m].into_iter().chain(command.position_m);
            let numbers = numbers.chain(command.attitude_rad).chain(command.injection);
            assert!(numbers.into_iter().all(f32::is_finite), "{command:?}");
            mission.answered(true);
        }
    }
    Ok(())
}
