//! A battery behind a divider, at an analogue input.

/// A divider and the converter behind it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divider {
    /// Volts at the battery for one at the input.
    pub ratio: f32,
    /// Voltage of the greatest count, V.
    pub reference_v: f32,
    /// The greatest count.
    pub full: u16,
}

impl Divider {
    /// Voltage at the battery, V. At the greatest count the input is beyond its range and the
    /// voltage is not known: NaN.
    pub fn volts(&self, count: u16) -> f32 {
        if count >= self.full {
            return f32::NAN;
        }
        f32::from(count) * (self.reference_v * self.ratio / f32::from(self.full))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 kOhm over 1 kOhm, 12 bits of 3.3 V.
    #[test]
    fn counts_are_volts() {
        let divider = Divider { ratio: 11.0, reference_v: 3.3, full: 4095 };
        assert_eq!(divider.volts(0), 0.0);
        // 11.1 V give 1.00909 V at the input, count 1252.2; one count is 8.86 mV.
        assert!((divider.volts(1252) - 11.1).abs() < 0.009, "{}", divider.volts(1252));
        assert!(divider.volts(4095).is_nan(), "clipped is not measured");
    }

    /// Every count of every converter of 8 to 16 bits, against f64: two roundings of f32.
    #[test]
    fn any_count_is_its_voltage() {
        for bits in 8..=16 {
            let full = ((1_u32 << bits) - 1) as u16;
            let divider = Divider { ratio: 11.0, reference_v: 3.3, full };
            for count in 0..=u16::MAX {
                let (volts, wide) =
                    (divider.volts(count), f64::from(count) / f64::from(full) * f64::from(3.3_f32) * 11.0);
                assert_eq!(volts.is_nan(), count >= full);
                assert!(volts.is_nan() || (f64::from(volts) - wide).abs() <= 3e-7 * wide, "{count}: {volts}");
            }
        }
    }
}
