//! Rotor speed and motor command at a battery voltage, thesis (4.11) and (5.12):
//! `omega = command * cmd + voltage * V + offset` (steady state) and its inverse.
//!
//! The printed inverse is rounded (a round trip adds about 0.04 rad/s); a configuration may give it
//! as it is, otherwise the exact inverse is used. The rotor's lag is not compensated.

use crate::allocation::mixer::AtEnd;
use crate::config::gains::MotorMapParams;

/// The map for flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotorMap {
    speed: f32,
    voltage: f32,
    offset: f32,
}

impl MotorMap {
    /// The given inverse, or the exact one.
    pub fn new(params: &MotorMapParams) -> Self {
        let (speed, voltage, offset) = params.inverse.map_or(
            (1.0 / params.command, -params.voltage / params.command, -params.offset / params.command),
            |inverse| (inverse.speed, inverse.voltage, inverse.offset),
        );
        Self { speed: speed as f32, voltage: voltage as f32, offset: offset as f32 }
    }

    /// Motor commands, in command units, for rotor speeds in rad/s at a battery voltage in V.
    #[inline]
    pub fn commands(&self, speeds_rad_s: [f32; 4], battery_v: f32) -> [f32; 4] {
        let at_rest = self.voltage * battery_v + self.offset;
        speeds_rad_s.map(|w| self.speed * w + at_rest)
    }

    /// Squared rotor speed, in rad^2/s^2, of a motor command at a battery voltage in V; 0 where the
    /// rotor would stand still.
    #[inline]
    pub fn squared_speed(&self, command: f32, battery_v: f32) -> f32 {
        let speed_rad_s = (command - (self.voltage * battery_v + self.offset)) / self.speed;
        if speed_rad_s > 0.0 { speed_rad_s * speed_rad_s } else { 0.0 }
    }
}

/// The steady rotor speed in rad/s of a motor command at a battery voltage in V: the forward map.
pub fn rotor_speed_rad_s(params: &MotorMapParams, command: f64, battery_v: f64) -> f64 {
    params.command * command + params.voltage * battery_v + params.offset
}

/// The range of motor commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandRange {
    low: f32,
    high: f32,
    /// By how much the bits of the highest command exceed those of the lowest, where both are positive; 0 where not.
    span: u32,
}

impl CommandRange {
    /// Ends in command units, first the idle command.
    pub fn new([low, high]: [f64; 2]) -> Self {
        let (low, high) = (low as f32, high as f32);
        let span = if low.is_sign_positive() { high.to_bits().saturating_sub(low.to_bits()) } else { 0 };
        Self { low, high, span }
    }

    /// Lowest and highest command.
    pub fn ends(&self) -> [f32; 2] {
        [self.low, self.high]
    }

    /// The idle command.
    pub fn idle(&self) -> f32 {
        self.low
    }

    /// Are all certainly inside the range? Compared as integers, in fewer instructions; so where the range begins below 0, only its
    /// lowest command is certain. What is not a number is never inside.
    #[inline]
    pub(crate) fn surely_holds(&self, commands: [f32; 4]) -> bool {
        let low = self.low.to_bits();
        commands.iter().all(|command| command.to_bits().wrapping_sub(low) <= self.span)
    }

    /// The nearest command inside the range. What is not a number becomes idle.
    #[inline]
    pub fn clamp(&self, command: f32) -> f32 {
        let not_above = if command > self.high { self.high } else { command };
        if not_above >= self.low { not_above } else { self.low }
    }

    /// At which end a command lies outside.
    pub fn at_end(&self, command: f32) -> AtEnd {
        AtEnd { high: command > self.high, low: command.is_nan() || command < self.low }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::thesis::THESIS_MOTOR_MAP;
    use proptest::prelude::*;

    /// Hover commands of the printed matrix and map (reference numbers, 2 decimals; f32 holds 1800
    /// to 1.2e-4).
    #[test]
    fn hover_commands_at_several_voltages() {
        let map = MotorMap::new(&THESIS_MOTOR_MAP);
        let hover = [611.409, 634.3527, 633.6577, 657.8632];
        for (volts, want) in [
            (9.9, [1750.97, 1780.19, 1779.31, 1810.14]),
            (11.1, [1682.71, 1711.94, 1711.05, 1741.89]),
            (12.6, [1597.39, 1626.62, 1625.73, 1656.57]),
        ] {
            for (got, want) in map.commands(hover, volts).into_iter().zip(want) {
                assert!((got - want).abs() < 0.006, "{volts} V: {got} {want}");
            }
        }
    }

    /// 860.52 rad/s at 2000 us and 11.1 V (reference numbers, 2 decimals), and a rotor that stands
    /// still.
    #[test]
    fn squared_speeds_of_the_range() {
        let map = MotorMap::new(&MotorMapParams { inverse: None, ..THESIS_MOTOR_MAP });
        // In squares: twice 860.52 rad/s times half of the last decimal.
        assert!((f64::from(map.squared_speed(2000.0, 11.1)) - 860.52 * 860.52).abs() < 2.0 * 860.52 * 0.005);
        assert_eq!(map.squared_speed(0.0, 11.1), 0.0);
        assert_eq!(map.squared_speed(f32::NAN, 11.1), 0.0);
    }

    proptest! {
        /// The exact inverse returns to the command within f32 rounding; the printed one adds about
        /// 0.04 rad/s.
        #[test]
        fn round_trip(command in 1000.0_f64..2000.0, volts in 9.9_f64..12.6) {
            let exact = MotorMapParams { inverse: None, ..THESIS_MOTOR_MAP };
            for (params, tolerance_rad_s) in [(exact, 1e-3), (THESIS_MOTOR_MAP, 0.05)] {
                let omega = rotor_speed_rad_s(&params, command, volts);
                prop_assume!(omega > 0.0);
                let [back, ..] = MotorMap::new(&params).commands([omega as f32; 4], volts as f32);
                let again = rotor_speed_rad_s(&params, f64::from(back), volts);
                prop_assert!((again - omega).abs() < tolerance_rad_s, "{omega} -> {again}");
            }
        }

        /// What is surely inside is; and in a range from 0 on, what is inside is surely so.
        #[test]
        fn what_is_surely_inside_is_inside(low in -2000.0_f64..2000.0, width in 0.0_f64..2000.0, bits in any::<u32>(), command in -3000.0_f32..5000.0) {
            let range = CommandRange::new([low, low + width]);
            let [low, high] = range.ends();
            for command in [f32::from_bits(bits), command, low, high, low.next_down(), high.next_up()] {
                let inside = command >= low && command <= high;
                let surely = range.surely_holds([low, command, low, low]);
                prop_assert!(inside || !surely, "{command} in {range:?}");
                prop_assert!(surely || !inside || low < 0.0, "{command} in {range:?}");
            }
        }

        #[test]
        fn clamp_is_total(bits in any::<u32>()) {
            let range = CommandRange::new([1000.0, 2000.0]);
            let command = range.clamp(f32::from_bits(bits));
            prop_assert!((1000.0..=2000.0).contains(&command));
        }
    }

    #[test]
    fn clamp_and_its_report() {
        let range = CommandRange::new([1000.0, 2000.0]);
        let (inside, high, low) =
            (AtEnd::default(), AtEnd { high: true, low: false }, AtEnd { high: false, low: true });
        for (command, clamped, end) in [
            (1500.0, 1500.0, inside),
            (2000.0, 2000.0, inside),
            (1000.0, 1000.0, inside),
            (2000.5, 2000.0, high),
            (999.0, 1000.0, low),
            (f32::INFINITY, 2000.0, high),
            (f32::NAN, 1000.0, low),
        ] {
            assert_eq!((range.clamp(command), range.at_end(command)), (clamped, end), "{command}");
        }
    }
}
