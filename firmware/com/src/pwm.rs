//! Motor commands as pulses: the kernel's PWM interface (`/sys/class/pwm`) behind embedded-hal's
//! [`SetDutyCycle`].
//!
//! A channel is a folder `pwmchipN/pwmM` with the files `period`, `duty_cycle` (both in ns),
//! `polarity` and `enable`; it appears when M is written into `pwmchipN/export` (Linux,
//! Documentation/driver-api/pwm.rst). A speed controller reads the length of the pulse alone: 1 ms
//! is idle and 2 ms full, at whatever period it can follow (the thesis' board: 400 Hz).
//!
//! embedded-hal counts a duty in 65535ths of the period: 38 ns of 2.5 ms, far below the microsecond
//! that the thesis' commands are counted in.
//!
//! Idle pulses go on even after the program has ended: a speed controller without pulses may beep
//! or forget its idle. Only a channel that no longer takes an idle pulse is switched off, by its
//! `enable`: its motor would go on with whatever it was told last. The next pulse that it takes
//! switches it on again.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant};

use embedded_hal::pwm::{ErrorKind, ErrorType, SetDutyCycle};

use crate::error::{Error, Result, access};

/// How long a channel may take to appear with the rights that udev gives it.
const EXPORT_PATIENCE: Duration = Duration::from_secs(1);

/// A channel that can be switched off.
pub trait Output: SetDutyCycle {
    /// Pulses go on, or end.
    ///
    /// # Errors
    /// The channel does not obey.
    fn switch(&mut self, on: bool) -> std::result::Result<(), Self::Error>;
}

/// A channel of the kernel's PWM interface.
#[derive(Debug)]
pub struct SysfsPwm {
    duty_cycle: File,
    /// Open from the start: in flight no file is opened.
    enable: File,
    period_ns: u32,
}

/// A duty that could not be written.
#[derive(Debug)]
pub struct PwmError(pub io::Error);

impl embedded_hal::pwm::Error for PwmError {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Other
    }
}

impl SysfsPwm {
    /// Opens `pwmchipN/M` under `root` and starts pulses of `pulse_ns` every `period_ns`.
    ///
    /// # Errors
    /// A channel that is not there, or that refuses the numbers.
    pub fn open(root: &Path, output: &str, period_ns: u32, pulse_ns: u32) -> Result<Self> {
        let folder = export(root, output)?;
        let put = |name: &str, value: &str, what| {
            let path = folder.join(name);
            fs::write(&path, value).map_err(access(&path, what))
        };
        // The kernel refuses a period shorter than the pulse that is there, so the pulse goes
        // first.
        if number(&folder.join("period")) != Some(period_ns) {
            put("duty_cycle", "0\n", "shorten the pulse")?;
            put("period", &format!("{period_ns}\n"), "set the period; does this PWM reach it?")?;
        }
        let open = |name: &str, what| {
            let path = folder.join(name);
            OpenOptions::new().write(true).open(&path).map_err(access(&path, what))
        };
        let mut channel = Self {
            duty_cycle: open("duty_cycle", "open the pulse length")?,
            enable: open("enable", "open the switch")?,
            period_ns,
        };
        channel.write(pulse_ns).map_err(access(&folder.join("duty_cycle"), "set the pulse length"))?;
        // Some drivers know one polarity only and have no file for it.
        let polarity = folder.join("polarity");
        if fs::read_to_string(&polarity).is_ok_and(|text| text.trim() != "normal") {
            put("enable", "0\n", "switch it off to set its polarity")?;
            put("polarity", "normal\n", "set the polarity")?;
        }
        put("enable", "1\n", "switch it on")?;
        Ok(channel)
    }

    /// Writes a pulse length in ns. No allocation. (A sysfs file takes each write as a whole; an
    /// ordinary file keeps what is behind the line, so a reader of one reads the first line.)
    fn write(&mut self, pulse_ns: u32) -> io::Result<()> {
        let mut line = io::Cursor::new([0; 12]);
        writeln!(line, "{pulse_ns}")?;
        let length = usize::try_from(line.position()).unwrap_or(0);
        self.duty_cycle.write_all_at(line.get_ref().get(..length).unwrap_or_default(), 0)
    }
}

/// The folder of a channel, exported if necessary.
fn export(root: &Path, output: &str) -> Result<PathBuf> {
    let (chip, channel) = split(output).ok_or_else(|| {
        Error::Other(format!(
            "[pwm] outputs: {output:?} is not an output; write pwmchipN/M, chip N and channel M"
        ))
    })?;
    let chip = root.join(chip);
    let folder = chip.join(format!("pwm{channel}"));
    if folder.is_dir() {
        return Ok(folder);
    }
    let export = chip.join("export");
    fs::write(&export, channel).map_err(access(&export, "open the channel; check the chip's folder"))?;
    let started = Instant::now();
    while OpenOptions::new().write(true).open(folder.join("duty_cycle")).is_err() {
        if started.elapsed() > EXPORT_PATIENCE {
            let source = io::Error::from(io::ErrorKind::TimedOut);
            return Err(access(&folder, "wait for the channel; does udev give the right to write it?")(
                source,
            ));
        }
        sleep(Duration::from_millis(5));
    }
    Ok(folder)
}

/// Chip and channel of `pwmchipN/M`.
pub(crate) fn split(output: &str) -> Option<(&str, &str)> {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let (chip, channel) = output.split_once('/')?;
    (digits(chip.strip_prefix("pwmchip")?) && digits(channel)).then_some((chip, channel))
}

/// The number in the first line of a file.
fn number(path: &Path) -> Option<u32> {
    fs::read_to_string(path).ok()?.lines().next()?.trim().parse().ok()
}

impl ErrorType for SysfsPwm {
    type Error = PwmError;
}

impl SetDutyCycle for SysfsPwm {
    fn max_duty_cycle(&self) -> u16 {
        u16::MAX
    }

    fn set_duty_cycle(&mut self, duty: u16) -> std::result::Result<(), PwmError> {
        let full = u64::from(u16::MAX);
        let pulse_ns = (u64::from(duty) * u64::from(self.period_ns) + full / 2) / full;
        // A pulse is never longer than the period.
        self.write(u32::try_from(pulse_ns).unwrap_or(self.period_ns)).map_err(PwmError)
    }
}

impl Output for SysfsPwm {
    fn switch(&mut self, on: bool) -> std::result::Result<(), PwmError> {
        let line: &[u8] = if on { b"1\n" } else { b"0\n" };
        self.enable.write_all_at(line, 0).map_err(PwmError)
    }
}

/// From motor commands to pulses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pulses {
    /// Lowest and highest motor command, in command units.
    pub command_range: [f64; 2],
    /// The pulses that they stand for, in ns. The lowest is idle.
    pub pulse_ns: [u32; 2],
    /// From pulse to pulse, in ns.
    pub period_ns: u32,
}

impl Pulses {
    /// Duty cycle of a command, from 0 to 1. NaN is idle.
    fn duty_cycle(&self, command: f32) -> f64 {
        let [low, high] = self.command_range;
        let [idle_ns, full_ns] = self.pulse_ns.map(f64::from);
        let part = (f64::from(command) - low) / (high - low);
        // Written so that NaN is idle.
        let part = if part > 0.0 { part.min(1.0) } else { 0.0 };
        (idle_ns + part * (full_ns - idle_ns)) / f64::from(self.period_ns)
    }
}

/// What became of motors that were to idle; a later one is worse.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Idled {
    /// Every channel gives idle pulses.
    Pulses,
    /// One that takes no pulse was switched off.
    SwitchedOff,
    /// One takes no pulse and cannot be switched off.
    OutOfControl,
}

/// A channel, and whether it has been switched off.
#[derive(Debug)]
struct Switched<C> {
    channel: C,
    off: bool,
}

impl<C: Output> Switched<C> {
    /// Writes a duty from 0 to 1, and switches the channel on again if it was off.
    fn set(&mut self, duty_cycle: f64) -> std::result::Result<(), C::Error> {
        let duty = duty_cycle * f64::from(self.channel.max_duty_cycle());
        self.channel.set_duty_cycle(duty.round() as u16)?;
        if self.off {
            self.channel.switch(true)?;
            self.off = false;
        }
        Ok(())
    }

    fn idle(&mut self, duty_cycle: f64) -> Idled {
        if self.set(duty_cycle).is_ok() {
            return Idled::Pulses;
        }
        self.off = self.off || self.channel.switch(false).is_ok();
        if self.off { Idled::SwitchedOff } else { Idled::OutOfControl }
    }
}

/// Four speed controllers.
#[derive(Debug)]
pub struct Motors<C> {
    channels: [Switched<C>; 4],
    pulses: Pulses,
}

impl<C: Output> Motors<C> {
    /// Rotors 1 to 4 on these channels.
    pub fn new(channels: [C; 4], pulses: Pulses) -> Self {
        Self { channels: channels.map(|channel| Switched { channel, off: false }), pulses }
    }

    /// Writes motor commands, in command units. Every channel is written even if another fails.
    ///
    /// # Errors
    /// The error of the first channel that failed.
    pub fn set(&mut self, commands: &[f32; 4]) -> std::result::Result<(), C::Error> {
        let mut outcome = Ok(());
        for (channel, command) in self.channels.iter_mut().zip(commands) {
            let written = channel.set(self.pulses.duty_cycle(*command));
            outcome = outcome.and(written);
        }
        outcome
    }

    /// All motors to idle; a channel that takes no pulse is switched off. Returns the worst.
    pub fn idle(&mut self) -> Idled {
        let duty_cycle = self.pulses.duty_cycle(f32::NEG_INFINITY);
        let idled = self.channels.iter_mut().map(|channel| channel.idle(duty_cycle));
        idled.fold(Idled::Pulses, Idled::max)
    }
}

impl Motors<SysfsPwm> {
    /// Opens four outputs under `root`, idle.
    ///
    /// # Errors
    /// The first that cannot be had.
    pub fn open(root: &Path, outputs: &[String; 4], pulses: Pulses) -> Result<Self> {
        let [a, b, c, d] = outputs
            .each_ref()
            .map(|output| SysfsPwm::open(root, output, pulses.period_ns, pulses.pulse_ns[0]));
        Ok(Self::new([a?, b?, c?, d?], pulses))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// As the kernel leaves a channel that has just come to be.
    fn channel(root: &Path, output: &str) -> PathBuf {
        let (chip, channel) = split(output).unwrap();
        let folder = root.join(chip).join(format!("pwm{channel}"));
        fs::create_dir_all(&folder).unwrap();
        for (name, value) in
            [("period", "0\n"), ("duty_cycle", "0\n"), ("polarity", "normal\n"), ("enable", "0\n")]
        {
            fs::write(folder.join(name), value).unwrap();
        }
        folder
    }

    const MICROSECONDS: Pulses =
        Pulses { command_range: [1000.0, 2000.0], pulse_ns: [1_000_000, 2_000_000], period_ns: 2_500_000 };

    fn motors(root: &Path, pulses: Pulses) -> (Motors<SysfsPwm>, [PathBuf; 4]) {
        let outputs = ["pwmchip0/0", "pwmchip0/1", "pwmchip1/0", "pwmchip7/12"].map(str::to_owned);
        let folders = outputs.each_ref().map(|output| channel(root, output));
        (Motors::open(root, &outputs, pulses).unwrap(), folders)
    }

    fn pulse_ns(folder: &Path) -> u32 {
        number(&folder.join("duty_cycle")).unwrap()
    }

    #[test]
    fn microseconds_come_out_as_pulses_of_that_length() {
        let root = tempfile::tempdir().unwrap();
        let (mut motors, folders) = motors(root.path(), MICROSECONDS);
        for folder in &folders {
            assert_eq!(
                [number(&folder.join("period")), number(&folder.join("enable"))],
                [Some(2_500_000), Some(1)]
            );
            assert_eq!(pulse_ns(folder), 1_000_000);
        }
        motors.set(&[1000.0, 1234.5, 2000.0, 999.0]).unwrap();
        for (folder, expected) in folders.iter().zip([1_000_000, 1_234_500, 2_000_000, 1_000_000]) {
            // Half a 65535th of 2.5 ms.
            assert!(pulse_ns(folder).abs_diff(expected) <= 20, "{} {expected}", pulse_ns(folder));
        }
        motors.set(&[f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1e30]).unwrap();
        let [a, b, c, d] = folders.each_ref().map(|folder| pulse_ns(folder));
        assert_eq!([a, c, d], [1_000_000; 3], "what is no number is idle");
        assert_eq!(b, 2_000_000);
    }

    #[test]
    fn shorter_numbers_leave_nothing_of_longer_ones_in_the_line() {
        let root = tempfile::tempdir().unwrap();
        let pulses = Pulses { pulse_ns: [900_000, 2_000_000], ..MICROSECONDS };
        let (mut motors, folders) = motors(root.path(), pulses);
        motors.set(&[2000.0; 4]).unwrap();
        assert_eq!(motors.idle(), Idled::Pulses);
        assert!(pulse_ns(&folders[0]).abs_diff(900_000) <= 20);
    }

    /// A channel of a test: refuses pulses, or its switch too.
    #[derive(Debug, Default)]
    struct Stubborn {
        duty: u16,
        on: bool,
        takes_pulses: bool,
        has_switch: bool,
    }

    impl ErrorType for Stubborn {
        type Error = PwmError;
    }

    fn if_so(so: bool) -> std::result::Result<(), PwmError> {
        so.then_some(()).ok_or_else(|| PwmError(io::ErrorKind::Other.into()))
    }

    impl SetDutyCycle for Stubborn {
        fn max_duty_cycle(&self) -> u16 {
            10_000
        }

        fn set_duty_cycle(&mut self, duty: u16) -> std::result::Result<(), PwmError> {
            if_so(self.takes_pulses)?;
            self.duty = duty;
            Ok(())
        }
    }

    impl Output for Stubborn {
        fn switch(&mut self, on: bool) -> std::result::Result<(), PwmError> {
            if_so(self.has_switch)?;
            self.on = on;
            Ok(())
        }
    }

    /// In flight it keeps its last pulse, the least evil; where the motors have to stand it has
    /// none. The others idle as ever, and what is mended comes back with an idle pulse.
    #[test]
    fn a_channel_that_takes_no_idle_pulse_is_switched_off() {
        let good = || Stubborn { on: true, takes_pulses: true, has_switch: true, ..Stubborn::default() };
        let mut motors = Motors::new([good(), good(), good(), good()], MICROSECONDS);
        motors.set(&[2000.0; 4]).unwrap();
        let dead = |motors: &mut Motors<Stubborn>, takes_pulses| {
            motors.channels[2].channel.takes_pulses = takes_pulses
        };
        dead(&mut motors, false);
        assert!(motors.set(&[1500.0; 4]).is_err());
        let seen = |motors: &Motors<Stubborn>| {
            [1, 2].map(|k| (motors.channels[k].channel.duty, motors.channels[k].channel.on))
        };
        assert_eq!(seen(&motors), [(6000, true), (8000, true)]);
        assert_eq!([motors.idle(), motors.idle()], [Idled::SwitchedOff; 2]);
        assert_eq!(seen(&motors), [(4000, true), (8000, false)]);
        dead(&mut motors, true);
        assert_eq!(motors.idle(), Idled::Pulses);
        assert_eq!(seen(&motors), [(4000, true), (4000, true)]);
        dead(&mut motors, false);
        motors.channels[2].channel.has_switch = false;
        assert_eq!(motors.idle(), Idled::OutOfControl);
    }

    #[test]
    fn a_channel_is_exported_and_waited_for() {
        let root = tempfile::tempdir().unwrap();
        let chip = root.path().join("pwmchip3");
        fs::create_dir_all(&chip).unwrap();
        fs::write(chip.join("export"), "").unwrap();
        let kernel = {
            let root = root.path().to_owned();
            std::thread::spawn(move || {
                while fs::read_to_string(chip.join("export")).unwrap() != "2" {
                    sleep(Duration::from_millis(1));
                }
                channel(&root, "pwmchip3/2")
            })
        };
        let mut opened = SysfsPwm::open(root.path(), "pwmchip3/2", 2_500_000, 1_000_000).unwrap();
        let folder = kernel.join().unwrap();
        opened.set_duty_cycle(u16::MAX).unwrap();
        assert_eq!(pulse_ns(&folder), 2_500_000);
    }

    #[test]
    fn what_is_not_there_is_named() {
        let root = tempfile::tempdir().unwrap();
        let message =
            |output: &str| SysfsPwm::open(root.path(), output, 2_500_000, 1_000_000).unwrap_err().to_string();
        assert!(message("pwmchip5/0").contains("pwmchip5/export"), "{}", message("pwmchip5/0"));
        for output in ["pwm0", "pwmchip/0", "pwmchip0/", "../pwmchip0/0", "pwmchip0/0/1", "pwmchip0/../1"] {
            assert!(message(output).contains("pwmchipN/M"), "{output}");
        }
    }

    proptest! {
        /// Whatever a command is, the pulse is between idle and full, and greater commands give no
        /// shorter pulses.
        #[test]
        fn pulses_stay_in_range_and_in_order(a in any::<f32>(), b in any::<f32>()) {
            let (low, high) = (0.4, 0.8); // 1 ms and 2 ms of 2.5 ms
            let [of_a, of_b] = [a, b].map(|command| MICROSECONDS.duty_cycle(command));
            prop_assert!((low..=high).contains(&of_a) && (low..=high).contains(&of_b));
            prop_assert!(a.is_nan() || b.is_nan() || (a <= b) == (of_a <= of_b) || of_a == of_b);
        }
    }
}
