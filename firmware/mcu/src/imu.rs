//! The InvenSense MPU-6000 on SPI: gyro and accelerometer, read once a tick.
//!
//! Register map: InvenSense RM-MPU-6000A-00, revision 4.2. Gyro +-1000 deg/s at 32.8 counts for
//! each, accelerometer +-8 g at 4096 counts for each, both low-passed at 44 and 42 Hz (setting 3),
//! below half the 100 Hz of the control loop.
//!
//! The chip lies with x forward, y left and z up; samples are turned into forward, right, down.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::{Operation, SpiDevice};
use proto::ImuSample;

const READ: u8 = 0x80;
const CONFIG: u8 = 0x1a;
const GYRO_CONFIG: u8 = 0x1b;
const ACCEL_CONFIG: u8 = 0x1c;
const ACCEL_XOUT_H: u8 = 0x3b;
const USER_CTRL: u8 = 0x6a;
const PWR_MGMT_1: u8 = 0x6b;
const WHO_AM_I: u8 = 0x75;

const CHIP: u8 = 0x68;
const RAD_S_PER_COUNT: f32 = core::f32::consts::PI / (180.0 * 32.8);
const M_S2_PER_COUNT: f32 = 9.806_65 / 4096.0;

/// Why there is no IMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImuError<E> {
    /// The bus.
    Bus(E),
    /// Something else answers.
    OtherChip(u8),
}

impl<E> From<E> for ImuError<E> {
    fn from(error: E) -> Self {
        Self::Bus(error)
    }
}

/// An MPU-6000.
#[derive(Debug)]
pub struct Mpu6000<S> {
    spi: S,
}

impl<S: SpiDevice> Mpu6000<S> {
    /// Resets the chip and sets it up; takes a fifth of a second.
    ///
    /// # Errors
    /// The bus, or another chip on it.
    pub fn new(spi: S, delay: &mut impl DelayNs) -> Result<Self, ImuError<S::Error>> {
        let mut imu = Self { spi };
        imu.set(PWR_MGMT_1, 0x80)?; // reset
        delay.delay_ms(100);
        imu.set(USER_CTRL, 0x10)?; // SPI only
        imu.set(PWR_MGMT_1, 0x01)?; // clock of the x gyro
        delay.delay_ms(100);
        let mut chip = [0];
        imu.get(WHO_AM_I, &mut chip)?;
        if chip != [CHIP] {
            return Err(ImuError::OtherChip(chip[0]));
        }
        imu.set(CONFIG, 0x03)?;
        imu.set(GYRO_CONFIG, 0x10)?;
        imu.set(ACCEL_CONFIG, 0x10)?;
        Ok(imu)
    }

    /// The newest sample.
    ///
    /// # Errors
    /// The bus.
    pub fn sample(&mut self) -> Result<ImuSample, S::Error> {
        let mut raw = [0; 14];
        self.get(ACCEL_XOUT_H, &mut raw)?;
        let [ax, bx, ay, by, az, bz, _, _, gx, hx, gy, hy, gz, hz] = raw;
        let count = |high, low| f32::from(i16::from_be_bytes([high, low]));
        let frd = |[x, y, z]: [f32; 3], scale: f32| [x * scale, -y * scale, -z * scale];
        Ok(ImuSample {
            gyro_rad_s: frd([count(gx, hx), count(gy, hy), count(gz, hz)], RAD_S_PER_COUNT),
            attitude_rad: None,
            acceleration_m_s2: Some(frd([count(ax, bx), count(ay, by), count(az, bz)], M_S2_PER_COUNT)),
        })
    }

    fn set(&mut self, register: u8, value: u8) -> Result<(), S::Error> {
        self.spi.write(&[register, value])
    }

    fn get(&mut self, register: u8, values: &mut [u8]) -> Result<(), S::Error> {
        self.spi.transaction(&mut [Operation::Write(&[READ | register]), Operation::Read(values)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    /// The chip's registers behind its protocol: the first byte is the register, with the top bit
    /// to read.
    struct Chip([u8; 128]);

    impl embedded_hal::spi::ErrorType for Chip {
        type Error = Infallible;
    }

    impl SpiDevice for Chip {
        fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Infallible> {
            match operations {
                [Operation::Write([register, value])] => self.0[usize::from(*register)] = *value,
                [Operation::Write([register]), Operation::Read(values)] => {
                    let from = usize::from(register & !READ);
                    assert_ne!(register & READ, 0, "a read");
                    values.copy_from_slice(&self.0[from..from + values.len()]);
                }
                other => panic!("{other:?}"),
            }
            Ok(())
        }
    }

    struct NoDelay;

    impl DelayNs for NoDelay {
        fn delay_ns(&mut self, _: u32) {}
    }

    fn chip(who: u8) -> Chip {
        let mut registers = [0; 128];
        registers[0x75] = who;
        Chip(registers)
    }

    #[test]
    fn a_chip_at_rest_on_a_level_craft_feels_gravity_upwards() {
        let mut imu = Mpu6000::new(chip(0x68), &mut NoDelay).unwrap();
        assert_eq!((imu.spi.0[0x1a], imu.spi.0[0x1b], imu.spi.0[0x1c]), (3, 0x10, 0x10));
        // 1 g along the chip's z, which points up: 4096 counts. 90 deg/s about its y: 2952 counts.
        imu.spi.0[0x3b..0x3b + 14]
            .copy_from_slice(&[0, 0, 0, 0, 0x10, 0, 0, 0, 0, 0, 0x0b, 0x88, 0xff, 0xff]);
        let sample = imu.sample().unwrap();
        assert_eq!(sample.acceleration_m_s2, Some([0.0, -0.0, -9.806_65]));
        let [p, q, r] = sample.gyro_rad_s;
        assert_eq!(p, 0.0);
        assert!((q + std::f32::consts::FRAC_PI_2).abs() < 1e-6, "left is minus right: {q}");
        assert!((r - 0.000_532_1).abs() < 1e-6, "one count down about z up: {r}");
    }

    #[test]
    fn another_chip_is_refused() {
        assert!(matches!(Mpu6000::new(chip(0x70), &mut NoDelay), Err(ImuError::OtherChip(0x70))));
    }

    /// Every count of every axis, against f64; the turn into forward, right, down is exact.
    #[test]
    fn any_count_is_its_rate_and_its_acceleration() {
        let mut imu = Mpu6000::new(chip(0x68), &mut NoDelay).unwrap();
        for count in i16::MIN..=i16::MAX {
            let [high, low] = count.to_be_bytes();
            imu.spi.0[0x3b..0x3b + 14].copy_from_slice(&[high, low].repeat(7));
            let sample = imu.sample().unwrap();
            let near = |got: [f32; 3], per_count: f64| {
                let want = f64::from(count) * per_count;
                got.into_iter()
                    .zip([want, -want, -want])
                    .all(|(x, want)| (f64::from(x) - want).abs() <= 3e-7 * want.abs())
            };
            assert!(near(sample.gyro_rad_s, std::f64::consts::PI / 180.0 / 32.8), "{count}: {sample:?}");
            assert!(near(sample.acceleration_m_s2.unwrap(), 9.806_65 / 4096.0), "{count}: {sample:?}");
        }
    }
}
