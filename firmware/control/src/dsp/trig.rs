//! Sine and cosine together, the square root, and angles wrapped to one turn, in f32 arithmetic
//! alone.
//!
//! Why not `libm::sinf`: it computes in f64 inside, and a Cortex-M4F has no f64 unit. There one
//! sine and one cosine of libm take 2,100 instructions, more than a whole tick is allowed; the pair
//! here takes 57 (counted in QEMU). This is the classic scheme of the Cephes library: reduce to the
//! nearest multiple of pi/2 with a constant split in three (Cody and Waite), then a short
//! polynomial for each function. Plain multiplications and additions only, so every target gives
//! the same bits. The error against exact values is below 1.2e-7 for `|x| <= 1000` rad (see the
//! tests).

use core::f32::consts::{FRAC_2_PI, FRAC_PI_4, PI};

/// One turn in rad.
const TURN: f32 = 2.0 * PI;

/// pi/2 in three parts; the first two are short enough that their product with a small integer is
/// exact.
const HALF_PI: [f32; 3] = [1.570_312_5, 4.837_513e-4, 7.549_79e-8];

/// 1.5 * 2^23: adding and subtracting it rounds a small f32 to the nearest integer.
const ROUND: f32 = 12_582_912.0;

/// Sine and cosine of `x` in rad, meant for `|x| <= 1000`.
///
/// Up to an eighth of a turn there is nothing to reduce, which saves a third of the instructions; the result is the same, bit for bit.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    if x.to_bits() & 0x7fff_ffff < FRAC_PI_4.to_bits() { near_zero(x) } else { reduced(x) }
}

/// For `|x| <= pi/4`.
#[inline]
fn near_zero(r: f32) -> (f32, f32) {
    let r2 = r * r;
    let sine = r + r * r2 * (-1.666_665_5e-1 + r2 * (8.332_161e-3 - r2 * 1.951_529_6e-4));
    let cosine = (1.0 - 0.5 * r2) + r2 * r2 * (4.166_664_6e-2 + r2 * (-1.388_731_6e-3 + r2 * 2.443_315_7e-5));
    (sine, cosine)
}

/// For any angle.
#[inline]
fn reduced(x: f32) -> (f32, f32) {
    let quarter = (x * FRAC_2_PI + ROUND) - ROUND;
    let [high, middle, low] = HALF_PI;
    let (sine, cosine) = near_zero(((x - quarter * high) - quarter * middle) - quarter * low);
    match quarter as i32 & 3 {
        0 => (sine, cosine),
        1 => (cosine, -sine),
        2 => (-sine, -cosine),
        _ => (-cosine, sine),
    }
}

/// The angle moved by whole turns into (-pi, pi], in rad. Values already inside come back bit for
/// bit.
pub fn wrap_angle(angle_rad: f32) -> f32 {
    // The magnitude as an integer, which compares in fewer instructions and sends what is no number the long way.
    if angle_rad.to_bits() & 0x7fff_ffff < PI.to_bits() {
        return angle_rad;
    }
    let wrapped = angle_rad - TURN * libm::floorf((angle_rad + PI) / TURN);
    // Rounding can leave the result one step outside at either end.
    if wrapped <= -PI || wrapped > PI { PI } else { wrapped }
}

/// The square root, rounded as IEEE 754 wants it. ARM's floating-point units and large processors have an instruction for it; elsewhere
/// the same bits come from Newton's iteration, sooner than from libm.
#[inline]
pub fn sqrt(x: f32) -> f32 {
    match fpu::square_root(x) {
        Some(root) => root,
        None if cfg!(any(target_arch = "x86_64", target_arch = "aarch64")) => libm::sqrtf(x),
        None => newton_sqrt(x),
    }
}

/// The bits of `libm::sqrtf`, in two thirds of its instructions on a Cortex-M4F without its own instruction.
///
/// Newton's iteration for `1/sqrt(x)` from the well-known guess by the exponent, and one correction
/// by the exact remainder `x - s^2`, with s cut in two so that every product is exact. All steps
/// scale exactly with powers of 4, so that the test over all numbers from 1 to 4 covers every
/// number here; what is far from 1, zero, negative or no number is left to libm.
#[inline]
fn newton_sqrt(x: f32) -> f32 {
    let bits = x.to_bits();
    // 2^-60 to 2^60: no intermediate result underflows.
    if bits.wrapping_sub(0x2180_0000) > 0x3c00_0000 {
        return far_sqrt(x);
    }
    let half = 0.5 * x;
    let mut y = f32::from_bits(0x5f37_5a86 - (bits >> 1));
    y *= 1.5 - (half * y) * y;
    y *= 1.5 - (half * y) * y;
    y *= 1.5 - (half * y) * y;
    let s = x * y;
    let high = f32::from_bits(s.to_bits() & 0xffff_f000);
    let low = s - high;
    let rest = ((x - high * high) - (high + high) * low) - low * low;
    s + (0.5 * y) * rest
}

#[cold]
fn far_sqrt(x: f32) -> f32 {
    libm::sqrtf(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Cephes states 2e-7 for the pair on its range; a half unit of rounding of the result is 6e-8.
    /// The allowance here is two units in the last place of numbers just under 1.
    const TOLERANCE: f64 = 1.2e-7;

    #[test]
    fn exact_at_zero() {
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
    }

    proptest! {
        #![proptest_config(crate::cases::cases(100_000))]

        #[test]
        fn agrees_with_double_precision(x in -1000.0_f32..1000.0) {
            let (s, c) = sin_cos(x);
            prop_assert!((f64::from(s) - libm::sin(f64::from(x))).abs() < TOLERANCE, "sin {x}: {s}");
            prop_assert!((f64::from(c) - libm::cos(f64::from(x))).abs() < TOLERANCE, "cos {x}: {c}");
        }

        #[test]
        fn wrapping_keeps_the_direction_and_the_range(x in -1000.0_f32..1000.0) {
            let w = wrap_angle(x);
            prop_assert!(w > -PI && w <= PI, "{x} -> {w}");
            let turns = (f64::from(x) - f64::from(w)) / (2.0 * core::f64::consts::PI);
            // 160 turns of a f32 turn that is 1.7e-7 rad long by rounding, and one rounding of x.
            prop_assert!((turns - turns.round()).abs() < 2e-5, "{x} -> {w}");
        }
    }

    /// Every f32 from 1 to 4, and by its scaling every one there is between 2^-60 and 2^60; then
    /// samples of all others.
    #[test]
    fn the_square_root_is_the_exact_one() {
        // An interpreter is ten thousand times slower.
        let every = if cfg!(miri) { 40_009 } else { 1 };
        for bits in (0x3f80_0000..=0x4080_0000_u32).step_by(every) {
            let x = f32::from_bits(bits);
            assert_eq!(newton_sqrt(x).to_bits(), libm::sqrtf(x).to_bits(), "{x}");
        }
        for bits in (0..=u32::MAX)
            .step_by(if cfg!(miri) { 40_000_003 } else { 4099 })
            .chain(0x2180_0000 - 9..0x2180_0000 + 9)
            .chain(0x5d80_0000 - 9..0x5d80_0000 + 9)
        {
            let x = f32::from_bits(bits);
            let (got, want) = (newton_sqrt(x), libm::sqrtf(x));
            assert!(got.to_bits() == want.to_bits() || got.is_nan() && want.is_nan(), "{x}: {got} {want}");
        }
    }

    /// Up to an eighth of a turn, where nothing is reduced.
    #[test]
    fn a_small_angle_has_the_bits_of_any_angle() {
        let every = if cfg!(miri) { 40_000_003 } else { 1009 };
        for magnitude in (0..FRAC_PI_4.to_bits()).step_by(every).chain([FRAC_PI_4.to_bits() - 1]) {
            for x in [f32::from_bits(magnitude), -f32::from_bits(magnitude)] {
                let bits = |(sine, cosine): (f32, f32)| [sine.to_bits(), cosine.to_bits()];
                assert_eq!(bits(near_zero(x)), bits(reduced(x)), "{x}");
            }
        }
        assert!(sin_cos(f32::NAN).0.is_nan());
    }

    #[test]
    fn the_ends_of_the_turn() {
        assert_eq!(wrap_angle(PI), PI);
        assert_eq!(wrap_angle(-PI), PI);
        assert!((wrap_angle(3.0 * PI / 2.0) + PI / 2.0).abs() < 1e-6);
    }
}
