//! Input checks: what happens to a bad value before it reaches the law.
//!
//! - A value that is not finite or beyond any reason (see [`ANGLE_LIMIT_RAD`] and its neighbours)
//!   never reaches the law. The last good value of that field is held, and a fault of its kind is
//!   raised and counted. A bad injection counts as none.
//! - Position and altitude commands are moved into the configured box (thesis 3: 4 m x 2 m x 2 m on
//!   the floor); a landing's may go below it.
//! - Nothing flies before there has been one sample whose position, attitude and voltage were all
//!   good.
//!
//! Motor cut-off and injection are carried out by the [`controller`](crate::law::controller). What
//! a fault leads to is decided by the [`state_machine`](crate::safety::state_machine).

use crate::config::gains::PositionLimits;
use crate::dsp::trig::wrap_angle;
use crate::inputs::readings::{Command, Measurement};

/// No angle is greater, in rad: far beyond any real one.
pub const ANGLE_LIMIT_RAD: f32 = 1000.0;
/// No position is farther out, in m.
pub const POSITION_LIMIT_M: f32 = 1e5;
/// No body rate is greater, in rad/s.
pub const RATE_LIMIT_RAD_S: f32 = 1e4;
/// No voltage is greater, in V; none is less than 0.
pub const VOLTAGE_LIMIT_V: f32 = 1000.0;

/// How often something was wrong, by kind, since the controller was made or reset; and whether it
/// was in this tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Faults {
    /// Position, attitude or gyro not finite or beyond reason, or a gyro that the configuration
    /// wants is missing.
    pub measurement: Fault,
    /// A command or an injection not finite or beyond reason.
    pub command: Fault,
    /// Voltage not finite or beyond reason.
    pub battery: Fault,
    /// A result was not finite: memory was reset and the last motor commands repeated.
    pub internal: Fault,
}

/// One kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Fault {
    /// Raised in this tick.
    pub now: bool,
    /// Ticks in which it was raised; stays at the greatest number once reached.
    pub count: u32,
}

impl Fault {
    /// Notes whether this tick has the fault.
    #[inline]
    pub(crate) fn note(&mut self, raised: bool) {
        self.now = raised;
        if raised {
            self.count = self.count.saturating_add(1);
        }
    }
}

/// Is every number of the command finite? (A sum is not if one of its parts is not.)
#[inline]
pub(crate) fn is_finite(command: &Command) -> bool {
    let Command { attitude_rad: [a, b], yaw_rad, z_m, position_m: [x, y], injection: [i, j, k, l], .. } =
        *command;
    ((a + b) + (x + y) + (yaw_rad + z_m) + (i + j) + (k + l)).is_finite()
}

/// The last good inputs: what the law sees.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct HeldInputs {
    pub(crate) position_m: [f32; 3],
    pub(crate) attitude_rad: [f32; 3],
    pub(crate) gyro_rad_s: [f32; 3],
    pub(crate) battery_v: f32,
    pub(crate) attitude_command_rad: [f32; 2],
    pub(crate) yaw_command_rad: f32,
    pub(crate) z_command_m: f32,
    pub(crate) position_command_m: [f32; 2],
    pub(crate) injection: [f32; 4],
}

/// The magnitude of a value as its bits: they order as the magnitudes do, with infinity and NaN
/// above all numbers, and comparing integers is cheaper than comparing floats one by one.
#[inline]
pub(crate) fn magnitude(value: f32) -> u32 {
    value.to_bits() & 0x7fff_ffff
}

/// Accepts a value if its magnitude is within the limit (NaN is not); returns whether it did.
#[inline]
fn take(held: &mut f32, value: f32, limit: f32) -> bool {
    let good = magnitude(value) <= limit.to_bits();
    if good {
        *held = value;
    }
    good
}

/// [`take`] for each field, all at once if all are good.
#[inline]
fn take_all<const N: usize>(held: &mut [f32; N], values: [f32; N], limit: f32) -> bool {
    let greatest = values.iter().fold(0, |greatest, value| magnitude(*value).max(greatest));
    let good = greatest <= limit.to_bits();
    if good {
        *held = values;
    } else {
        take_the_good(held, &values, limit);
    }
    good
}

/// The rare case of [`take_all`].
#[cold]
fn take_the_good(held: &mut [f32], values: &[f32], limit: f32) {
    for (held, value) in held.iter_mut().zip(values) {
        take(held, *value, limit);
    }
}

impl HeldInputs {
    /// Accepts the good fields of a measurement. Returns whether all of it was good (the voltage
    /// included); the gyro counts only if it is wanted.
    #[inline]
    pub(crate) fn measure(&mut self, m: &Measurement, wants_gyro: bool, faults: &mut Faults) -> bool {
        let position = take_all(&mut self.position_m, m.position_m, POSITION_LIMIT_M);
        let attitude = take_all(&mut self.attitude_rad, m.attitude_rad, ANGLE_LIMIT_RAD);
        let [_, _, yaw] = &mut self.attitude_rad;
        *yaw = wrap_angle(*yaw);
        let gyro = !wants_gyro
            || m.gyro_rad_s.is_some_and(|gyro| take_all(&mut self.gyro_rad_s, gyro, RATE_LIMIT_RAD_S));
        let battery = m.battery_v >= 0.0 && take(&mut self.battery_v, m.battery_v, VOLTAGE_LIMIT_V);
        faults.measurement.note(!(position && attitude && gyro));
        faults.battery.note(!battery);
        position && attitude && battery
    }

    /// [`HeldInputs::measure`] for a position and an attitude that the detectors have accepted.
    #[inline]
    pub(crate) fn measure_checked(&mut self, m: &Measurement, wants_gyro: bool, faults: &mut Faults) -> bool {
        let [roll, pitch, yaw] = m.attitude_rad;
        (self.position_m, self.attitude_rad) = (m.position_m, [roll, pitch, wrap_angle(yaw)]);
        let gyro = !wants_gyro
            || m.gyro_rad_s.is_some_and(|gyro| take_all(&mut self.gyro_rad_s, gyro, RATE_LIMIT_RAD_S));
        let battery = m.battery_v >= 0.0 && take(&mut self.battery_v, m.battery_v, VOLTAGE_LIMIT_V);
        faults.measurement.note(!gyro);
        faults.battery.note(!battery);
        battery
    }

    /// What is commanded before there has been a good command: stay here, level.
    pub(crate) fn hold_here(&mut self) {
        let ([x, y, z], [_, _, yaw]) = (self.position_m, self.attitude_rad);
        self.attitude_command_rad = [0.0; 2];
        self.yaw_command_rad = yaw;
        self.z_command_m = z;
        self.position_command_m = [x, y];
    }

    /// Accepts a command, or its good fields, with positions moved into the box. Is it known to be finite?
    #[inline]
    pub(crate) fn command(&mut self, c: &Command, finite: bool, bounds: &Bounds, faults: &mut Faults) {
        let ([roll, pitch], [x, y]) = (c.attitude_rad, c.position_m);
        let greatest = magnitude(roll).max(magnitude(pitch)).max(magnitude(c.yaw_rad));
        if greatest > ANGLE_LIMIT_RAD.to_bits() || !(finite || is_finite(c)) {
            return self.command_in_part(c, bounds, faults);
        }
        self.attitude_command_rad = c.attitude_rad;
        self.yaw_command_rad = wrap_angle(c.yaw_rad);
        self.z_command_m = bounds.z.clamp(c.z_m);
        self.position_command_m = [bounds.x.clamp(x), bounds.y.clamp(y)];
        self.injection = c.injection;
        faults.command.note(false);
    }

    /// The rare case of [`HeldInputs::command`].
    #[cold]
    fn command_in_part(&mut self, c: &Command, bounds: &Bounds, faults: &mut Faults) {
        let mut good = take_all(&mut self.attitude_command_rad, c.attitude_rad, ANGLE_LIMIT_RAD);
        good &= take(&mut self.yaw_command_rad, c.yaw_rad, ANGLE_LIMIT_RAD);
        self.yaw_command_rad = wrap_angle(self.yaw_command_rad);
        good &= take(&mut self.z_command_m, c.z_m, f32::MAX);
        self.z_command_m = bounds.z.clamp(self.z_command_m);
        good &= take_all(&mut self.position_command_m, c.position_m, f32::MAX);
        let [x, y] = self.position_command_m;
        self.position_command_m = [bounds.x.clamp(x), bounds.y.clamp(y)];
        self.injection = [0.0; 4];
        good &= take_all(&mut self.injection, c.injection, f32::MAX);
        faults.command.note(!good);
    }
}

/// An interval of positions in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Interval {
    low: f32,
    high: f32,
}

impl Interval {
    fn new([low, high]: [f64; 2]) -> Self {
        Self { low: low as f32, high: high as f32 }
    }

    /// The nearest value inside; anything that is not a number goes to the lower end.
    #[inline]
    fn clamp(&self, value: f32) -> f32 {
        if value > self.high {
            self.high
        } else if value >= self.low {
            value
        } else {
            self.low
        }
    }
}

/// The box of position commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    x: Interval,
    y: Interval,
    z: Interval,
}

impl Bounds {
    pub(crate) fn new(limits: &PositionLimits) -> Self {
        Self { x: Interval::new(limits.x_m), y: Interval::new(limits.y_m), z: Interval::new(limits.z_m) }
    }

    /// The same box, so much deeper.
    pub(crate) fn deeper(self, by_m: f32) -> Self {
        Self { z: Interval { high: self.z.high + by_m, ..self.z }, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::gains::Config;
    use proptest::prelude::*;

    fn bounds() -> Bounds {
        Bounds::new(&Config::thesis().position_limits)
    }

    #[test]
    fn commands_are_moved_into_the_box() {
        let mut inputs = HeldInputs::default();
        let mut faults = Faults::default();
        let mut commanded = |x, y, z| {
            let command = Command { position_m: [x, y], z_m: z, ..Command::default() };
            inputs.command(&command, false, &bounds(), &mut faults);
            let [x, y] = inputs.position_command_m;
            [x, y, inputs.z_command_m]
        };
        assert_eq!(commanded(1.0, 0.5, -1.0), [1.0, 0.5, -1.0]);
        assert_eq!(commanded(3.0, 1.5, -2.5), [2.0, 1.0, -2.0]);
        assert_eq!(commanded(-3.0, -1.5, 0.5), [-2.0, -1.0, 0.0]);
        assert_eq!(commanded(f32::NAN, 0.0, -0.5), [-2.0, 0.0, -0.5], "the last good x is held");
        assert_eq!(faults.command, Fault { now: true, count: 1 });
    }

    proptest! {
        /// All at once or field by field.
        #[test]
        fn a_good_command_is_what_its_fields_are(numbers in any::<[f32; 10]>(), scale in prop::sample::select(vec![1e-30_f32, 1e-3, 1.0, 1e30])) {
            let [roll, pitch, yaw_rad, z_m, x, y, i, j, k, l] = numbers.map(|number| number * scale);
            let command = Command {
                attitude_rad: [roll, pitch],
                yaw_rad,
                z_m,
                position_m: [x, y],
                injection: [i, j, k, l],
                ..Command::default()
            };
            let (mut at_once, mut in_part) = ((HeldInputs::default(), Faults::default()), (HeldInputs::default(), Faults::default()));
            in_part.0.command_in_part(&command, &bounds(), &mut in_part.1);
            for finite in [false, is_finite(&command)] {
                at_once.0.command(&command, finite, &bounds(), &mut at_once.1);
                prop_assert_eq!(at_once.0, in_part.0);
                prop_assert_eq!(at_once.1.command.now, in_part.1.command.now);
            }
        }
    }

    #[test]
    fn each_field_is_held_by_itself() {
        let mut inputs = HeldInputs::default();
        let mut faults = Faults::default();
        let good = Measurement {
            position_m: [1.0, 2.0, -1.0],
            attitude_rad: [0.1, 0.2, 0.3],
            gyro_rad_s: None,
            battery_v: 11.1,
        };
        assert!(inputs.measure(&good, false, &mut faults));
        let bad = Measurement {
            position_m: [1.1, f32::NAN, f32::INFINITY],
            attitude_rad: [-1e30, 0.25, 0.35],
            gyro_rad_s: None,
            battery_v: -1.0,
        };
        assert!(!inputs.measure(&bad, false, &mut faults));
        assert_eq!(inputs.position_m, [1.1, 2.0, -1.0]);
        assert_eq!(inputs.attitude_rad, [0.1, 0.25, 0.35]);
        assert_eq!(inputs.battery_v, 11.1);
        assert_eq!((faults.measurement.count, faults.battery.count, faults.command.count), (1, 1, 0));
        inputs.measure(&good, true, &mut faults);
        assert_eq!(faults.measurement, Fault { now: true, count: 2 }, "a wanted gyro is missing");
        inputs.measure(&good, false, &mut faults);
        assert_eq!(faults.measurement, Fault { now: false, count: 2 });
    }

    #[test]
    fn a_bad_injection_is_none() {
        let mut inputs = HeldInputs::default();
        let command = Command { injection: [5.0, f32::NAN, f32::INFINITY, -5.0], ..Command::default() };
        inputs.command(&command, false, &bounds(), &mut Faults::default());
        assert_eq!(inputs.injection, [5.0, 0.0, 0.0, -5.0]);
    }

    #[test]
    fn counts_do_not_roll_over() {
        let mut fault = Fault { now: false, count: u32::MAX };
        fault.note(true);
        assert_eq!(fault.count, u32::MAX);
    }

    proptest! {
        #[test]
        fn nothing_bad_gets_through(m in any::<[u32; 10]>(), c in any::<[u32; 10]>()) {
            let f = |k: usize| f32::from_bits(m[k]);
            let g = |k: usize| f32::from_bits(c[k]);
            let mut inputs = HeldInputs::default();
            let mut faults = Faults::default();
            let measurement = Measurement {
                position_m: [f(0), f(1), f(2)],
                attitude_rad: [f(3), f(4), f(5)],
                gyro_rad_s: Some([f(6), f(7), f(8)]),
                battery_v: f(9),
            };
            inputs.measure(&measurement, true, &mut faults);
            let command = Command {
                attitude_rad: [g(0), g(1)],
                yaw_rad: g(2),
                z_m: g(3),
                position_m: [g(4), g(5)],
                injection: [g(6), g(7), g(8), g(9)],
                ..Command::default()
            };
            inputs.command(&command, false, &bounds(), &mut faults);
            let HeldInputs { position_m, attitude_rad, gyro_rad_s, battery_v, .. } = inputs;
            prop_assert!(position_m.iter().all(|x| x.abs() <= POSITION_LIMIT_M));
            prop_assert!(attitude_rad.iter().all(|x| x.abs() <= ANGLE_LIMIT_RAD));
            prop_assert!(gyro_rad_s.iter().all(|x| x.abs() <= RATE_LIMIT_RAD_S));
            prop_assert!((0.0..=VOLTAGE_LIMIT_V).contains(&battery_v));
            prop_assert!((-2.0..=0.0).contains(&inputs.z_command_m));
            prop_assert!(inputs.attitude_command_rad.iter().all(|x| x.abs() <= ANGLE_LIMIT_RAD));
            prop_assert!(inputs.injection.iter().all(|x| x.is_finite()));
        }
    }
}
