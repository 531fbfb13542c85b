//! Motor controllers that take a pulse of 1 to 2 ms, 400 times a second.

use embedded_hal::pwm::SetDutyCycle;

/// From one pulse to the next, us.
pub const FRAME_US: u32 = 2500;
/// The pulse at which a motor idles, us.
pub const IDLE_US: f32 = 1000.0;
const FULL_US: f32 = 2000.0;

/// Four outputs whose timers count one frame of [`FRAME_US`].
#[derive(Debug)]
pub struct Escs<P> {
    outputs: [P; 4],
    low: f32,
    us_per_unit: f32,
}

impl<P: SetDutyCycle> Escs<P> {
    /// Outputs at idle. `command_range`: the commands that mean idle and full, in command units.
    pub fn new(outputs: [P; 4], command_range: [f64; 2]) -> Self {
        let [low, high] = command_range;
        let us_per_unit = (f64::from(FULL_US - IDLE_US) / (high - low)) as f32;
        let mut escs = Self { outputs, low: low as f32, us_per_unit };
        let low = escs.low;
        escs.drive(&[low; 4]);
        escs
    }

    /// Writes motor commands in command units; NaN idles. Did every output accept it?
    pub fn drive(&mut self, commands: &[f32; 4]) -> bool {
        let mut all = true;
        for (output, command) in self.outputs.iter_mut().zip(commands) {
            let pulse_us = IDLE_US + (command - self.low) * self.us_per_unit;
            let pulse_us = if pulse_us.is_nan() { IDLE_US } else { pulse_us.clamp(IDLE_US, FULL_US) };
            let duty = duty(pulse_us, output.max_duty_cycle());
            all &= output.set_duty_cycle(duty).is_ok();
        }
        all
    }
}

/// A pulse as counts of a timer that counts a frame in `full` steps, rounded.
pub fn duty(pulse_us: f32, full: u16) -> u16 {
    (pulse_us * (f32::from(full) / FRAME_US as f32) + 0.5) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    struct Output {
        full: u16,
        duty: u16,
    }

    impl embedded_hal::pwm::ErrorType for Output {
        type Error = Infallible;
    }

    impl SetDutyCycle for Output {
        fn max_duty_cycle(&self) -> u16 {
            self.full
        }

        fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
            assert!(duty <= self.full);
            self.duty = duty;
            Ok(())
        }
    }

    fn pulses_us(command_range: [f64; 2], commands: [f32; 4]) -> [f64; 4] {
        // 21 MHz: 52,500 counts a frame, 21 a microsecond.
        let outputs = [0; 4].map(|_| Output { full: 52_500, duty: 0 });
        let mut escs = Escs::new(outputs, command_range);
        assert!(escs.outputs.iter().all(|output| output.duty == 21_000), "idle from the start");
        assert!(escs.drive(&commands));
        escs.outputs.map(|output| f64::from(output.duty) / 21.0)
    }

    #[test]
    fn a_command_is_a_pulse() {
        let got = pulses_us([1000.0, 2000.0], [1000.0, 1500.4, 1711.9, 2000.0]);
        for (got, want) in got.iter().zip([1000.0, 1500.4, 1711.9, 2000.0]) {
            // Half a count of 1/21 us.
            assert!((got - want).abs() <= 0.5 / 21.0 + 1e-3, "{got} {want}");
        }
        assert_eq!(pulses_us([0.0, 1.0], [0.0, 0.25, 0.5, 1.0]), [1000.0, 1250.0, 1500.0, 2000.0]);
    }

    #[test]
    fn no_pulse_is_ever_outside_what_a_controller_understands() {
        let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30];
        assert_eq!(pulses_us([1000.0, 2000.0], wild), [1000.0, 2000.0, 1000.0, 2000.0]);
    }

    /// Every f32 from idle to full on the board's timer, and every timer of 16 bits at both ends: against
    /// f64, to the rounding of two products.
    #[test]
    fn any_pulse_is_the_nearest_count() {
        let near = |pulse_us: f32, full: u16| {
            let exact = f64::from(pulse_us) * f64::from(full) / f64::from(FRAME_US);
            let duty = duty(pulse_us, full);
            assert!(
                duty <= full && (f64::from(duty) - exact).abs() <= 0.51,
                "{pulse_us} us of {full}: {duty}"
            );
        };
        for bits in IDLE_US.to_bits()..=FULL_US.to_bits() {
            near(f32::from_bits(bits), 52_500);
        }
        for full in 0..=u16::MAX {
            [IDLE_US, 1500.0, FULL_US].iter().for_each(|pulse_us| near(*pulse_us, full));
        }
    }
}
