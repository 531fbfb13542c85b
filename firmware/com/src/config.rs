//! The configuration file: ports, paths, and which craft this is. Everything is checked before any
//! device is opened.
//!
//! Paths in it are relative to its own folder. The law flies with the gains file (`[files] gains`,
//! written by `quadlab design`); the vehicle file describes the craft. Gains made for another
//! vehicle are refused: by what their `[provenance]` says (the name, and the hash of its
//! measurements where `[files] vehicle_sha256` gives it) and by the range of commands.

use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use control::Config as Law;
use gains_file::{CELLS, CraftFiles, Gains, Motors, Vehicle};
use proto::Key;
use serde::Deserialize;

use crate::error::{Error, Result, access};
use crate::imu;
use crate::pwm::{self, Pulses};
use crate::watchdog::BoardWatchdog;

/// The file as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    files: Files,
    link: LinkTable,
    imu: ImuTable,
    pwm: PwmTable,
    #[serde(default)]
    battery: BatteryTable,
    #[serde(default)]
    timing: TimingTable,
    #[serde(default)]
    guardian: GuardianTable,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Files {
    vehicle: PathBuf,
    gains: PathBuf,
    vehicle_sha256: Option<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LinkTable {
    listen: String,
    #[serde(default)]
    number: u16,
    key: Option<PathBuf>,
    /// Until version 2 of the messages.
    counters: Option<PathBuf>,
    #[serde(default)]
    open: bool,
    #[serde(default = "one")]
    telemetry_every: u16,
}

fn one() -> u16 {
    1
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ImuTable {
    port: PathBuf,
    #[serde(default = "usual_baud")]
    baud: u32,
}

fn usual_baud() -> u32 {
    115_200
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PwmTable {
    #[serde(default = "sysfs")]
    root: PathBuf,
    outputs: Vec<String>,
    period_ns: u32,
    pulse_ns: Option<[u32; 2]>,
}

fn sysfs() -> PathBuf {
    "/sys/class/pwm".into()
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct BatteryTable {
    converter: Option<PathBuf>,
    volt_per_count: Option<f64>,
    cells: Option<u8>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TimingTable {
    priority: u8,
}

impl Default for TimingTable {
    fn default() -> Self {
        Self { priority: 80 }
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct GuardianTable {
    silence_s: f64,
    last_end: Option<PathBuf>,
    watchdog: Option<PathBuf>,
}

impl Default for GuardianTable {
    fn default() -> Self {
        Self { silence_s: 0.08, last_end: None, watchdog: None }
    }
}

/// The link to the ground.
#[derive(Debug, Clone)]
pub struct LinkSettings {
    /// Where the ground's packets come in.
    pub listen: SocketAddr,
    /// Tells apart crafts that share a key.
    pub number: u16,
    /// What both sides share; without one only peers on this machine are heard, unless the link is
    /// open.
    pub key: Option<Key>,
    /// Peers on other machines are heard without a key.
    pub open: bool,
    /// Ticks from one telemetry message to the next.
    pub telemetry_every: u16,
}

/// Where the battery's voltage comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum BatterySource {
    /// The IMU board's frames.
    Imu,
    /// A converter that Linux knows.
    Converter {
        /// Its raw value.
        path: PathBuf,
        /// Volts at the battery for each count.
        volt_per_count: f64,
    },
}

/// Everything that the program has to know, checked.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Name of the vehicle.
    pub vehicle: String,
    /// The flight law's configuration.
    pub law: Law,
    /// SHA-256 of gains and vehicle file ([`gains_file::craft_sha256`]).
    pub vehicle_sha256: [u8; 32],
    /// The link.
    pub link: LinkSettings,
    /// The IMU's serial port and its baud rate.
    pub imu: (PathBuf, u32),
    /// The folder of the PWM chips.
    pub pwm_root: PathBuf,
    /// Channels of rotors 1 to 4.
    pub outputs: [String; 4],
    /// From commands to pulses.
    pub pulses: Pulses,
    /// The battery.
    pub battery: BatterySource,
    /// Real-time priority of the loop; the guardian's is one more.
    pub priority: u8,
    /// After this long without a sign of life, the guardian ends the loop.
    pub silence: Duration,
    /// Where the cause of the last end is kept.
    pub last_end: Option<PathBuf>,
    /// That cause, as the ground is told; unknown until the program looks there.
    pub ended: proto::Ending,
    /// The board's watchdog.
    pub watchdog: BoardWatchdog,
}

impl Setup {
    /// Reads and checks a configuration file and the files it names.
    ///
    /// # Errors
    /// The first thing that is wrong: file, field, what, and how to mend it.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).map_err(access(path, "read the configuration"))?;
        let file: File = parse(&text, path)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let refuse = |message: String| Error::Content { path: path.to_owned(), message };
        let at = |relative: &PathBuf| folder.join(relative);

        let Files { vehicle, gains, vehicle_sha256 } = &file.files;
        if let Some(cells) = file.battery.cells.filter(|cells| !CELLS.contains(cells)) {
            return Err(refuse(format!(
                "[battery] cells is {cells}: give the pack's number of cells in series, 1 to 14"
            )));
        }
        let CraftFiles { config: law, vehicle, sha256 } =
            CraftFiles::read(&at(gains), &at(vehicle), vehicle_sha256.as_deref())?
                .with_battery_levels(file.battery.cells);

        let link = link(&file.link, folder).map_err(refuse)?;
        let outputs = outputs(file.pwm.outputs).map_err(refuse)?;
        let pulses = pulses(&vehicle, file.pwm.period_ns, file.pwm.pulse_ns).map_err(refuse)?;
        let battery = battery(&file.battery, folder).map_err(refuse)?;
        if !(1..=98).contains(&file.timing.priority) {
            return Err(refuse(format!(
                "[timing] priority is {}: give a number from 1 to 98 (99 is the kernel's own)",
                file.timing.priority
            )));
        }
        let silence_s = file.guardian.silence_s;
        if !(silence_s >= 3.0 * law.sample_time_s && silence_s <= 5.0) {
            return Err(refuse(format!(
                "[guardian] silence_s is {silence_s}: give a time from three periods of the loop ({} s) to 5 s",
                3.0 * law.sample_time_s
            )));
        }
        if imu::rate(file.imu.baud).is_none() {
            return Err(refuse(format!(
                "[imu] baud is {}: 38400 (one frame a tick), 57600, 115200 (the usual), 230400, 460800, 921600 or 1000000",
                file.imu.baud
            )));
        }
        Ok(Self {
            vehicle: vehicle.name,
            law,
            vehicle_sha256: sha256,
            link,
            imu: (at(&file.imu.port), file.imu.baud),
            pwm_root: at(&file.pwm.root),
            outputs,
            pulses,
            battery,
            priority: file.timing.priority,
            silence: Duration::from_secs_f64(silence_s),
            last_end: file.guardian.last_end.as_ref().map(at),
            ended: proto::Ending::Unknown,
            watchdog: BoardWatchdog::of(file.guardian.watchdog.as_deref(), folder),
        })
    }

    /// Period of the loop in ns.
    pub fn period_ns(&self) -> u64 {
        // `control` has checked that it is a sensible time.
        (self.law.sample_time_s * 1e9).round() as u64
    }
}

/// Parses a file; an error is one line with its place.
fn parse<T: for<'a> Deserialize<'a>>(text: &str, path: &Path) -> Result<T> {
    toml::from_str(text).map_err(|error| Error::Content {
        path: path.to_owned(),
        message: gains_file::toml_message(text, &error),
    })
}

/// Reads a gains file, whichever vehicle it is for.
///
/// # Errors
/// What is wrong in it.
pub fn read_gains(path: &Path) -> Result<Law> {
    Ok(Gains::read(path)?.config)
}

fn link(table: &LinkTable, folder: &Path) -> std::result::Result<LinkSettings, String> {
    let listen: SocketAddr = table.listen.parse().map_err(|_| {
        format!("[link] listen is {:?}: write address and port, such as 0.0.0.0:14650", table.listen)
    })?;
    let key = table.key.as_ref().map(|key| proto_files::read_key(&folder.join(key)));
    let key = key.transpose().map_err(|error| format!("[link] key: {error}"))?;
    if table.counters.is_some() {
        return Err("[link] counters: packet numbers are no longer kept on a disk (each start draws random bytes instead); delete this line, and the folder".into());
    }
    if key.is_none() && !table.open && !listen.ip().to_canonical().is_loopback() {
        return Err(format!(
            "[link] listen is {listen}, and there is no key: whoever can reach the port could fly the craft; name a key file, or say open = true"
        ));
    }
    Ok(LinkSettings {
        listen,
        number: table.number,
        key,
        open: table.open,
        telemetry_every: table.telemetry_every,
    })
}

fn outputs(outputs: Vec<String>) -> std::result::Result<[String; 4], String> {
    if let Some(wrong) = outputs.iter().find(|output| pwm::split(output).is_none()) {
        return Err(format!(
            "[pwm] outputs: {wrong:?} is not an output; write pwmchipN/M, chip N and channel M"
        ));
    }
    for (at, output) in outputs.iter().enumerate() {
        if outputs[..at].contains(output) {
            return Err(format!("[pwm] outputs: {output} is named twice; each rotor needs its own"));
        }
    }
    let count = outputs.len();
    outputs.try_into().map_err(|_| {
        format!("[pwm] outputs: {count} are named; name four, for rotors 1 front-left, 2 front-right, 3 rear-right, 4 rear-left")
    })
}

fn pulses(
    vehicle: &Vehicle,
    period_ns: u32,
    pulse_ns: Option<[u32; 2]>,
) -> std::result::Result<Pulses, String> {
    let Motors { command_unit, command_range } = &vehicle.motors;
    let pulse_ns = match (pulse_ns, command_unit.as_str()) {
        (Some(pulse_ns), _) => pulse_ns,
        (None, "us") => command_range.map(|us| (us * 1000.0).round() as u32),
        (None, unit) => {
            return Err(format!(
                "[pwm] pulse_ns is missing: the vehicle's commands are in {unit:?}, so say which pulses its lowest and highest command are, such as [1000000, 2000000]"
            ));
        }
    };
    let [idle_ns, full_ns] = pulse_ns;
    if !(0 < idle_ns && idle_ns < full_ns && full_ns <= period_ns) {
        return Err(format!(
            "[pwm] pulses from {idle_ns} ns to {full_ns} ns every {period_ns} ns: idle must be shorter than full, and full no longer than the period"
        ));
    }
    Ok(Pulses { command_range: *command_range, pulse_ns, period_ns })
}

fn battery(table: &BatteryTable, folder: &Path) -> std::result::Result<BatterySource, String> {
    match (&table.converter, table.volt_per_count) {
        (None, None) => Ok(BatterySource::Imu),
        (Some(path), Some(volt_per_count)) if volt_per_count.is_finite() && volt_per_count > 0.0 => {
            Ok(BatterySource::Converter { path: folder.join(path), volt_per_count })
        }
        _ => Err("[battery] needs both converter (a file with a raw value) and volt_per_count (more than 0), or neither: then the voltage comes with the IMU's frames".into()),
    }
}

#[cfg(test)]
mod tests {
    use control::supervision_limits::BatteryLevels;

    use super::*;
    use std::os::unix::fs::PermissionsExt;

    const VEHICLE: &str =
        "name = 'a craft'\nmass = 1.2\n[motors]\ncommand_unit = 'us'\ncommand_range = [1000.0, 2000.0]\n";
    const CONFIG: &str = "[files]\nvehicle = 'vehicle.toml'\ngains = 'gains.toml'\n\
        [link]\nlisten = '127.0.0.1:0'\n\
        [imu]\nport = '/dev/ttyO0'\n\
        [pwm]\noutputs = ['pwmchip0/0', 'pwmchip0/1', 'pwmchip0/2', 'pwmchip0/3']\nperiod_ns = 2500000\n";

    struct Case {
        folder: tempfile::TempDir,
    }

    impl Case {
        fn new() -> Self {
            let case = Self { folder: tempfile::tempdir().unwrap() };
            case.write("com.toml", CONFIG);
            case.write("vehicle.toml", VEHICLE);
            let law = toml::to_string(&Law::thesis()).unwrap();
            case.write(
                "gains.toml",
                &format!("{law}\n[provenance]\nvehicle = 'a craft'\nvehicle_sha256 = 'aa'\n"),
            );
            case
        }

        fn write(&self, name: &str, text: &str) {
            fs::write(self.folder.path().join(name), text).unwrap();
        }

        fn replace(&self, name: &str, from: &str, to: &str) {
            let text = fs::read_to_string(self.folder.path().join(name)).unwrap();
            assert!(text.contains(from), "{from} in {text}");
            self.write(name, &text.replacen(from, to, 1));
        }

        fn read(&self) -> Result<Setup> {
            Setup::read(&self.folder.path().join("com.toml"))
        }
    }

    #[test]
    fn a_short_file_suffices() {
        let case = Case::new();
        let setup = case.read().unwrap();
        assert_eq!(setup.law, Law::thesis());
        assert_eq!(setup.pulses.pulse_ns, [1_000_000, 2_000_000]);
        assert_eq!(setup.battery, BatterySource::Imu);
        assert_eq!((setup.period_ns(), setup.imu.1), (10_000_000, 115_200));
        assert!(setup.link.key.is_none() && !setup.link.open);
    }

    /// The example, and with every key that it has.
    #[test]
    fn the_example_names_every_key() {
        const EXAMPLE: &str = include_str!("../com.toml");
        let case = Case::new();
        case.write("com.toml", EXAMPLE);
        case.read().unwrap();
        // A line that is switched off is a key or a table; with all of them on only paths are
        // missing.
        let key = |line: &str| {
            line.strip_prefix("# ")
                .filter(|line| line.starts_with('[') || line.contains(" = "))
                .map(str::to_owned)
        };
        let full: Vec<String> =
            EXAMPLE.lines().map(|line| key(line).unwrap_or_else(|| line.to_owned())).collect();
        assert!(full.iter().any(|line| line.starts_with("open = false")));
        case.write("com.toml", &full.join("\n"));
        let message = case.read().unwrap_err().to_string();
        assert!(message.contains("with other measurements"), "{message}");
        case.write("com.toml", &full.join("\n").replace("vehicle_sha256", "# vehicle_sha256"));
        let message = case.read().unwrap_err().to_string();
        assert!(message.contains("/etc/quadlab/key"), "{message}");
    }

    /// The gains' levels are the pilot's; a craft whose gains have none goes by its pack.
    #[test]
    fn battery_levels_are_those_of_the_pack_where_the_gains_have_none() {
        let case = Case::new();
        case.replace("com.toml", "[pwm]", "[battery]\ncells = 4\n[pwm]");
        assert_eq!(case.read().unwrap().law.supervision.battery, BatteryLevels::THREE_CELLS);
        for level in ["warn_v = 10.6\n", "land_v = 10.3\n", "empty_v = 10.0\n"] {
            case.replace("gains.toml", level, "");
        }
        assert_eq!(case.read().unwrap().law.supervision.battery, BatteryLevels::of_cells(4));
        // That of com.toml is the one that is in the craft today, that of the vehicle the usual one.
        case.replace("vehicle.toml", "[motors]", "[battery]\ncells = 6\n[motors]");
        assert_eq!(case.read().unwrap().law.supervision.battery, BatteryLevels::of_cells(4));
        case.replace("com.toml", "[battery]\ncells = 4\n", "");
        assert_eq!(case.read().unwrap().law.supervision.battery, BatteryLevels::of_cells(6));
        case.replace("vehicle.toml", "cells = 6", "cells = 15");
        let message = case.read().unwrap_err().to_string();
        assert!(message.contains("vehicle.toml: battery.cells = 15 is impossible"), "{message}");
        case.replace("vehicle.toml", "[battery]\ncells = 15\n", "");
        assert_eq!(case.read().unwrap().law.supervision.battery, BatteryLevels::NONE);
    }

    #[test]
    fn each_mistake_is_one_line_that_names_it() {
        let key = "0".repeat(64);
        let cases: [(&str, &str, &str, &str); 24] = [
            ("com.toml", "[imu]", "[imy]", "line 6: "),
            ("com.toml", "port = ", "prot = ", "prot"),
            ("com.toml", "'127.0.0.1:0'", "'localhost'", "[link] listen"),
            ("com.toml", "'127.0.0.1:0'", "'0.0.0.0:14650'", "there is no key"),
            ("com.toml", "'127.0.0.1:0'", "'127.0.0.1:0'\nkey = 'none'", "[link] key: "),
            ("com.toml", "'127.0.0.1:0'", "'127.0.0.1:0'\nkey = 'loose'", "chmod 600"),
            ("com.toml", "'127.0.0.1:0'", "'127.0.0.1:0'\ncounters = 'old'", "delete this line"),
            ("com.toml", "[pwm]", "baud = 9600\n[pwm]", "[imu] baud is 9600"),
            ("com.toml", "'pwmchip0/3'", "'pwm3'", "\"pwm3\" is not an output"),
            ("com.toml", "'pwmchip0/3'", "'pwmchip0/0'", "twice"),
            ("com.toml", ", 'pwmchip0/3'", "", "3 are named"),
            ("com.toml", "2500000", "1500000", "no longer than the period"),
            ("com.toml", "2500000", "2500000\npulse_ns = [2000000, 1000000]", "shorter than full"),
            ("com.toml", "[pwm]", "[battery]\nconverter = 'raw'\n[pwm]", "[battery]"),
            ("com.toml", "[pwm]", "[battery]\ncells = 0\n[pwm]", "[battery] cells is 0"),
            ("com.toml", "[pwm]", "[timing]\npriority = 99\n[pwm]", "[timing] priority is 99"),
            ("com.toml", "[pwm]", "[guardian]\nsilence_s = 0.01\n[pwm]", "[guardian] silence_s"),
            ("com.toml", "'vehicle.toml'", "'other.toml'", "other.toml: cannot read the vehicle file"),
            ("com.toml", "gains = ", "vehicle_sha256 = 'bb'\ngains = ", "with other measurements"),
            ("vehicle.toml", "'us'", "'fraction'", "[pwm] pulse_ns is missing"),
            ("vehicle.toml", "a craft", "another", "they are for \"a craft\", this is \"another\""),
            ("vehicle.toml", "2000.0", "1900.0", "command_range is [1000.0, 2000.0]"),
            ("gains.toml", "[provenance]\nvehicle = 'a craft'\nvehicle_sha256 = 'aa'", "", "no [provenance]"),
            ("gains.toml", "kp = 100.0", "kp = nan", "kp is NaN"),
        ];
        for (name, from, to, expected) in cases {
            let case = Case::new();
            for (key_file, mode) in [("key", 0o600), ("loose", 0o644)] {
                case.write(key_file, &key);
                let path = case.folder.path().join(key_file);
                fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
            }
            case.replace(name, from, to);
            let message = case.read().expect_err(expected).to_string();
            assert!(message.contains(expected), "{message:?} should say {expected:?}");
            assert_eq!(message.lines().count(), 1, "{message}");
            assert!(message.contains(".toml: "), "{message}");
        }
    }

    #[test]
    fn with_a_key_the_link_may_leave_the_machine() {
        let case = Case::new();
        case.write("key", &"5a".repeat(32));
        fs::set_permissions(case.folder.path().join("key"), fs::Permissions::from_mode(0o600)).unwrap();
        case.replace("com.toml", "'127.0.0.1:0'", "'0.0.0.0:14650'\nkey = 'key'");
        assert!(case.read().unwrap().link.key.is_some());
    }
}
