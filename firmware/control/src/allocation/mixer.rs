//! From thrust and angular accelerations to squared rotor speeds, and what the motors refuse of
//! them.
//!
//! Thesis (5.11): `[T, tau_phi, tau_theta, tau_psi] = K [w1^2 .. w4^2]`. The rows of K are made of
//! geometry and identified coefficients: `b C_T`; `sqrt(2) l b C_i^p/Ixx` with the sign of the
//! rotor's side (left rolls right, +p); `sqrt(2) l b C_i^q/Iyy` (front pitches up, +q); `b R
//! C_i^r/Izz` (sign in the coefficient); `b = rho pi R^2 R^2`. `sqrt(2) l` is twice the geometric
//! arm of an x frame; the identified coefficients absorb the 2 (K^-1 reproduces only so).
//!
//! A negative squared speed is impossible and becomes 0; a command outside its range is clamped.
//! Each is reported per axis and direction ([`Refused`]), and the next tick's integrators read it:
//! saturation flows backwards as data. In the thesis nothing is rescaled; a configuration can ask
//! for [`desaturation`](crate::allocation::desaturation) instead.

use nalgebra::Matrix4;

use crate::config::error::ConfigError;
use crate::config::gains::{Mixing, RotorCoefficients};
use crate::dsp::trig::sqrt;

/// Directions in which an axis could not be followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Directions(u8);

impl Directions {
    /// Everything that was asked for happened.
    pub const NONE: Self = Self(0);
    /// More was asked for than there is.
    pub const HIGH: Self = Self(1);
    /// Less was asked for than there is.
    pub const LOW: Self = Self(2);
    /// More and less.
    pub const BOTH: Self = Self(3);

    /// More was asked for than there is, or less.
    #[inline]
    pub const fn new(high: bool, low: bool) -> Self {
        Self(high as u8 | (low as u8) << 1)
    }

    /// Was more asked for than there is?
    #[inline]
    pub const fn high(self) -> bool {
        self.0 & Self::HIGH.0 != 0
    }

    /// Was less asked for than there is?
    #[inline]
    pub const fn low(self) -> bool {
        self.0 & Self::LOW.0 != 0
    }

    /// What either could not follow.
    #[inline]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// This refusal, seen by a loop whose output enters with a minus.
    pub fn swapped(self) -> Self {
        Self::new(self.low(), self.high())
    }
}

/// What the motors refused, per axis and direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Refused {
    /// Thrust (upwards positive).
    pub thrust: Directions,
    /// Roll torque.
    pub roll: Directions,
    /// Pitch torque.
    pub pitch: Directions,
    /// Yaw torque.
    pub yaw: Directions,
}

impl Refused {
    /// All of it, in every direction: nothing that is asked for happens.
    pub(crate) const ALL: Self = Self {
        thrust: Directions::BOTH,
        roll: Directions::BOTH,
        pitch: Directions::BOTH,
        yaw: Directions::BOTH,
    };

    /// Was anything refused?
    pub fn any(&self) -> bool {
        *self != Self::default()
    }
}

/// Side of each rotor: left rolls right.
const ROLL_SIGN: [f64; 4] = [1.0, -1.0, -1.0, 1.0];
/// Side of each rotor: front pitches up.
const PITCH_SIGN: [f64; 4] = [1.0, 1.0, -1.0, -1.0];

/// The sign matrix of thesis (4.5): rows rotors, columns thrust, roll, pitch, yaw.
pub const SIGN_MATRIX: [[f64; 4]; 4] =
    [[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0], [1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0]];

/// The matrix K of thesis (5.11): rows thrust, roll, pitch, yaw; columns rotors; N and rad/s^2 per
/// (rad/s)^2.
pub fn effectiveness(c: &RotorCoefficients) -> [[f64; 4]; 4] {
    let radius = c.rotor_radius_m;
    let beta = c.air_density_kg_m3 * core::f64::consts::PI * radius * radius * radius * radius;
    let arm = core::f64::consts::SQRT_2 * c.arm_length_m;
    let [p1, p2, p3, p4] = c.roll;
    let [q1, q2, q3, q4] = c.pitch;
    let [sp1, sp2, sp3, sp4] = ROLL_SIGN;
    let [sq1, sq2, sq3, sq4] = PITCH_SIGN;
    [
        [beta * c.thrust; 4],
        [sp1 * p1, sp2 * p2, sp3 * p3, sp4 * p4].map(|x| arm * beta * x),
        [sq1 * q1, sq2 * q2, sq3 * q3, sq4 * q4].map(|x| arm * beta * x),
        c.yaw.map(|x| beta * radius * x),
    ]
}

/// The inverse of a mixing matrix given by rows.
///
/// # Errors
/// [`ConfigError::SingularMixing`] if it has none, or none with finite entries.
pub fn inverse(matrix: &[[f64; 4]; 4]) -> Result<[[f64; 4]; 4], ConfigError> {
    let rows = Matrix4::from_fn(|i, j| matrix.get(i).and_then(|row| row.get(j)).copied().unwrap_or(f64::NAN));
    // Rows have different units and sizes of 1e-6: scaled to length 1 the determinant says how far
    // from singular they are.
    let mut scaled = rows;
    let mut lengths = [0.0; 4];
    for (mut row, length) in scaled.row_iter_mut().zip(&mut lengths) {
        *length = row.norm();
        row /= *length;
    }
    let determinant = determinant(&scaled);
    if determinant.is_nan() || determinant.abs() < 1e-9 {
        return Err(ConfigError::SingularMixing);
    }
    let inverse = scaled.try_inverse().ok_or(ConfigError::SingularMixing)?;
    let mut result = [[0.0; 4]; 4];
    for (row, from) in result.iter_mut().zip(inverse.row_iter()) {
        for ((entry, value), length) in row.iter_mut().zip(from.iter()).zip(&lengths) {
            *entry = value / length;
        }
    }
    if result.iter().flatten().all(|x| x.is_finite()) { Ok(result) } else { Err(ConfigError::SingularMixing) }
}

/// The determinant by complementary minors of the upper and the lower two rows. (The library's goes
/// by a decomposition with pivots, which no compiler can show not to panic, and gains are received
/// in flight code.)
fn determinant(matrix: &Matrix4<f64>) -> f64 {
    let [[a0, b0, c0, d0], [a1, b1, c1, d1], [a2, b2, c2, d2], [a3, b3, c3, d3]] = matrix.data.0;
    (a0 * b1 - a1 * b0) * (c2 * d3 - c3 * d2) - (a0 * b2 - a2 * b0) * (c1 * d3 - c3 * d1)
        + (a0 * b3 - a3 * b0) * (c1 * d2 - c2 * d1)
        + (a1 * b2 - a2 * b1) * (c0 * d3 - c3 * d0)
        - (a1 * b3 - a3 * b1) * (c0 * d2 - c2 * d0)
        + (a2 * b3 - a3 * b2) * (c0 * d1 - c1 * d0)
}

/// One rotor's row: how it answers the four axes, and which of their directions it refuses when it
/// is at an end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    pub(crate) thrust: f32,
    pub(crate) roll: f32,
    pub(crate) pitch: f32,
    pub(crate) yaw: f32,
    /// Bit of each axis and direction that asks this rotor for more.
    wants_more: u8,
    /// Bit of each axis and direction that asks this rotor for less.
    wants_less: u8,
}

/// Bits: 0 to 3 thrust, roll, pitch, yaw upwards; 4 to 7 the same downwards.
const UP: [u8; 4] = [1, 2, 4, 8];

impl Row {
    fn new(row: &[f64; 4]) -> Self {
        let [thrust, roll, pitch, yaw] = row.map(|x| x as f32);
        let (mut wants_more, mut wants_less) = (0, 0);
        for (x, up) in row.iter().zip(UP) {
            let down = up << 4;
            if *x > 0.0 {
                wants_more |= up;
                wants_less |= down;
            } else if *x < 0.0 {
                wants_more |= down;
                wants_less |= up;
            }
        }
        Self { thrust, roll, pitch, yaw, wants_more, wants_less }
    }
}

/// Which rotors are at which end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AtEnd {
    /// The rotor was asked for more than its greatest command.
    pub high: bool,
    /// The rotor was asked for less than its least command, or for a negative squared speed.
    pub low: bool,
}

/// A mixing matrix: rows rotors, columns thrust, roll, pitch, yaw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixer {
    pub(crate) rows: [Row; 4],
    /// Thrust of 1 of each rotor: the first row of K.
    thrust_of_each: [f32; 4],
}

impl Mixer {
    /// The inverse mixing matrix that a configuration describes.
    ///
    /// # Errors
    /// [`ConfigError::SingularMixing`] if the matrix has no inverse.
    pub fn new(mixing: &Mixing) -> Result<Self, ConfigError> {
        let (rows, matrix) = match mixing {
            Mixing::Inverse(rows) => (*rows, inverse(rows)?),
            Mixing::Matrix(matrix) => (inverse(matrix)?, *matrix),
            Mixing::Coefficients(coefficients) => {
                let matrix = effectiveness(coefficients);
                (inverse(&matrix)?, matrix)
            }
        };
        let [thrust_of_each, ..] = matrix;
        Ok(Self::from_rows(&rows, &thrust_of_each))
    }

    /// The sign matrix of thesis (4.5), for the hand-tuned law.
    pub fn signs() -> Self {
        // Its columns are orthogonal and of length 2: its inverse is a quarter of it, turned over.
        Self::from_rows(&SIGN_MATRIX, &[0.25; 4])
    }

    fn from_rows(rows: &[[f64; 4]; 4], thrust_of_each: &[f64; 4]) -> Self {
        let [a, b, c, d] = rows;
        let rows = [Row::new(a), Row::new(b), Row::new(c), Row::new(d)];
        Self { rows, thrust_of_each: thrust_of_each.map(|thrust| thrust as f32) }
    }

    /// The thrust of these squared rotor speeds (or commands): what [`Mixer::mix`] was given, where no rotor is at an end.
    #[cold]
    pub fn thrust(&self, squared: [f32; 4]) -> f32 {
        self.thrust_of_each.iter().zip(squared).map(|(thrust, one)| thrust * one).sum()
    }

    /// The product with `[thrust, roll, pitch, yaw]`: a squared rotor speed (or a command) for each
    /// rotor.
    #[inline]
    pub fn mix(&self, thrust: f32, [roll, pitch, yaw]: [f32; 3]) -> [f32; 4] {
        self.rows.map(|row| row.thrust * thrust + row.roll * roll + row.pitch * pitch + row.yaw * yaw)
    }

    /// What the rotors at their ends refuse of each axis.
    #[inline]
    pub fn refused(&self, at_end: [AtEnd; 4]) -> Refused {
        let mut bits = 0;
        for (row, end) in self.rows.iter().zip(at_end) {
            if end.high {
                bits |= row.wants_more;
            }
            if end.low {
                bits |= row.wants_less;
            }
        }
        let axis = |up: u8| Directions::new(bits & up != 0, bits & (up << 4) != 0);
        let [thrust, roll, pitch, yaw] = UP;
        Refused { thrust: axis(thrust), roll: axis(roll), pitch: axis(pitch), yaw: axis(yaw) }
    }
}

/// Speeds in rad/s from squared speeds; negative ones (and what is not a number) become 0.
#[inline]
pub fn rotor_speeds(squared: [f32; 4]) -> [f32; 4] {
    if are_positive(squared) { squared.map(sqrt) } else { speeds_of_those_that_turn(squared) }
}

/// Is each certainly a finite number above 0, or 0? Its bits are below those of infinity where those of all four together are, which is
/// one comparison.
#[inline]
pub(crate) fn are_positive([a, b, c, d]: [f32; 4]) -> bool {
    a.to_bits() | b.to_bits() | c.to_bits() | d.to_bits() < f32::INFINITY.to_bits()
}

/// Are all four finite? (A sum is not if one of its parts is not.)
#[inline]
pub(crate) fn are_finite([a, b, c, d]: [f32; 4]) -> bool {
    ((a + b) + (c + d)).is_finite()
}

#[cold]
fn speeds_of_those_that_turn(squared: [f32; 4]) -> [f32; 4] {
    squared.map(|w2| if w2 > 0.0 { sqrt(w2) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::thesis::{THESIS_INVERSE_MIXING, THESIS_ROTORS};
    use proptest::prelude::*;

    fn largest_relative_difference(
        a: &[[f64; 4]; 4],
        b: &[[f64; 4]; 4],
        columns: core::ops::Range<usize>,
    ) -> f64 {
        let mut worst = 0.0_f64;
        for i in 0..4 {
            for j in columns.clone() {
                worst = worst.max((a[i][j] / b[i][j] - 1.0).abs());
            }
        }
        worst
    }

    /// The tables print four digits: 2e-4 on the torque columns, 2e-3 on thrust with C_T = 0.0180,
    /// 2e-4 with the unrounded C_T = 0.0180325 that the printed matrix was made with.
    #[test]
    fn inverse_is_the_printed_one() {
        let from_tables = inverse(&effectiveness(&THESIS_ROTORS)).unwrap();
        assert!(largest_relative_difference(&from_tables, &THESIS_INVERSE_MIXING, 1..4) < 2e-4);
        assert!(largest_relative_difference(&from_tables, &THESIS_INVERSE_MIXING, 0..1) < 2e-3);
        assert!(largest_relative_difference(&from_tables, &THESIS_INVERSE_MIXING, 0..1) > 1e-3);
        let unrounded =
            inverse(&effectiveness(&RotorCoefficients { thrust: 0.0180325, ..THESIS_ROTORS })).unwrap();
        assert!(largest_relative_difference(&unrounded, &THESIS_INVERSE_MIXING, 0..4) < 2e-4);
    }

    proptest! {
        /// As by nalgebra's decomposition: products of four numbers of up to 1, so some roundings
        /// of 1e-16.
        #[test]
        fn the_determinant_is_the_librarys(entries in prop::array::uniform16(-1.0..1.0_f64)) {
            let matrix = Matrix4::from_row_slice(&entries);
            prop_assert!((determinant(&matrix) - matrix.determinant()).abs() < 1e-14);
        }
    }

    /// Entries computed independently (numpy) from the same tables, seven digits.
    #[test]
    fn inverse_agrees_with_numpy() {
        let numpy = [
            [31447.19, 4242.991, 4067.073, 18753.633],
            [33850.29, -3788.160, 4022.299, -17392.912],
            [33774.66, -5053.566, -4064.528, 19529.566],
            [36405.21, 4598.735, -4024.844, -20890.287],
        ];
        let ours = inverse(&effectiveness(&THESIS_ROTORS)).unwrap();
        assert!(largest_relative_difference(&ours, &numpy, 0..4) < 2e-7);
    }

    #[test]
    fn inverse_times_matrix_is_one() {
        let k = effectiveness(&THESIS_ROTORS);
        let inv = inverse(&k).unwrap();
        for (i, row) in k.iter().enumerate() {
            for j in 0..4 {
                let product: f64 = row.iter().zip(&inv).map(|(a, b)| a * b[j]).sum();
                let want = if i == j { 1.0 } else { 0.0 };
                // Rows of K differ by 1e2 in size: double rounding times that.
                assert!((product - want).abs() < 1e-12, "({i},{j}): {product}");
            }
        }
    }

    /// Hover speeds of the printed matrix at 11.9093 N, as published with the reference numbers (4
    /// decimals).
    #[test]
    fn hover_speeds() {
        let mixer = Mixer::new(&Mixing::Inverse(THESIS_INVERSE_MIXING)).unwrap();
        let speeds = rotor_speeds(mixer.mix(11.9093, [0.0; 3]));
        for (got, want) in speeds.into_iter().zip([611.409, 634.3527, 633.6577, 657.8632]) {
            assert!((got - want).abs() < 2e-4, "{got} {want}: f32 holds 600 to 6e-5"); // twice that
        }
    }

    proptest! {
        /// Of what was mixed the thrust is the one that was asked for, however the mixing is given. Rounding of f32, in units of the
        /// torques' parts of up to 5 N.
        #[test]
        fn the_thrust_of_what_was_mixed_is_the_one_asked_for(thrust in 1.0_f32..25.0, torque in prop::array::uniform3(-20.0_f32..20.0)) {
            let matrix = effectiveness(&THESIS_ROTORS);
            for mixing in [Mixing::Inverse(THESIS_INVERSE_MIXING), Mixing::Matrix(matrix), Mixing::Coefficients(THESIS_ROTORS)] {
                let mixer = Mixer::new(&mixing).unwrap();
                let back = mixer.thrust(mixer.mix(thrust, torque));
                prop_assert!((back - thrust).abs() < 1e-4, "{mixing:?}: {back} for {thrust}");
            }
            let signs = Mixer::signs();
            prop_assert!((signs.thrust(signs.mix(thrust, torque)) - thrust).abs() < 1e-4);
        }
    }

    /// An inverse of nothing.
    #[test]
    fn an_inverse_without_a_matrix_is_refused() {
        let mut rows = THESIS_INVERSE_MIXING;
        rows[3] = rows[2];
        assert_eq!(Mixer::new(&Mixing::Inverse(rows)), Err(ConfigError::SingularMixing));
    }

    /// More left thrust rolls right, more front thrust pitches up, faster 1 and 3 yaw right.
    #[test]
    fn each_axis_speeds_up_its_rotors() {
        for mixer in [Mixer::new(&Mixing::Coefficients(THESIS_ROTORS)).unwrap(), Mixer::signs()] {
            let faster = |thrust, torque| mixer.mix(thrust, torque).map(|x| x > 0.0);
            assert_eq!(faster(1.0, [0.0; 3]), [true; 4]);
            assert_eq!(faster(0.0, [1.0, 0.0, 0.0]), [true, false, false, true]);
            assert_eq!(faster(0.0, [0.0, 1.0, 0.0]), [true, true, false, false]);
            assert_eq!(faster(0.0, [0.0, 0.0, 1.0]), [true, false, true, false]);
        }
    }

    proptest! {
        /// Whether all four are looked at together or each by itself.
        #[test]
        fn the_speed_of_a_rotor_is_its_own(exponents in any::<[u8; 4]>(), fractions in any::<[u32; 4]>(), narrow in any::<bool>()) {
            let mut squares = [0.0; 4];
            for ((w2, exponent), fraction) in squares.iter_mut().zip(exponents).zip(fractions) {
                // Nearly all drawn bits are numbers that no four of a craft are; those of a craft have about one exponent.
                let exponent = if narrow { 0x90 | exponent & 3 } else { exponent };
                *w2 = f32::from_bits(u32::from(exponent) << 23 | fraction & 0x807f_ffff);
            }
            let by_itself = squares.map(|w2| if w2 > 0.0 { libm::sqrtf(w2) } else { 0.0 });
            prop_assert_eq!(rotor_speeds(squares).map(f32::to_bits), by_itself.map(f32::to_bits));
            prop_assert!(!are_positive(squares) || squares.iter().all(|w2| w2.is_finite() && w2.is_sign_positive()));
        }
    }

    /// Alone and beside others that are, whatever their bits have in common.
    #[test]
    fn only_finite_numbers_from_zero_on_are_surely_positive() {
        assert!(are_positive([0.0; 4]) && are_positive([4e5, 5e5, 6e5, 2e5]) && are_positive([1.0; 4]));
        for none in [f32::INFINITY, f32::NAN, -f32::NAN, -1.0, -0.0, f32::NEG_INFINITY] {
            for others in [0.0, 4e5, none] {
                for at in 0..4 {
                    let mut squares = [others; 4];
                    squares[at] = none;
                    assert!(!are_positive(squares), "{squares:?}");
                }
            }
        }
    }

    #[test]
    fn directions_are_what_they_were_made_of() {
        for (high, low) in [(false, false), (false, true), (true, false), (true, true)] {
            let one = Directions::new(high, low);
            assert_eq!((one.high(), one.low()), (high, low));
            assert_eq!(one.swapped(), Directions::new(low, high));
            for other in [Directions::NONE, Directions::HIGH, Directions::LOW, Directions::BOTH] {
                let either = one.or(other);
                assert_eq!((either.high(), either.low()), (high || other.high(), low || other.low()));
            }
        }
    }

    #[test]
    fn negative_squares_are_zero_and_refused() {
        let mixer = Mixer::signs();
        let squares = mixer.mix(1.0, [3.0, 0.0, 0.0]);
        assert_eq!(squares, [4.0, -2.0, -2.0, 4.0]);
        assert_eq!(rotor_speeds(squares), [2.0, 0.0, 0.0, 2.0]);
        assert_eq!(rotor_speeds([-0.0, 0.0, f32::NAN, -1.0]).map(f32::to_bits), [0; 4], "no zero has a sign");
        let ends = squares.map(|w2| AtEnd { high: false, low: w2 < 0.0 });
        let refused = mixer.refused(ends);
        assert!(refused.roll == Directions::HIGH, "more roll to the right is refused");
        assert!(refused.thrust == Directions::LOW, "less thrust is refused, more is not");
        assert!(!mixer.refused([AtEnd::default(); 4]).any());
    }

    #[test]
    fn a_rotor_at_its_upper_end_refuses_what_asks_it_for_more() {
        let mixer = Mixer::signs();
        let mut ends = [AtEnd::default(); 4];
        ends[1].high = true; // front right
        let only = Directions::new;
        let want = Refused {
            thrust: only(true, false),
            roll: only(false, true),
            pitch: only(true, false),
            yaw: only(false, true),
        };
        assert_eq!(mixer.refused(ends), want);
    }

    /// Every rotor at either end, at both or at none, of a mixer whose entries have every sign: what an
    /// axis loses is what some rotor at an end would have to do for it.
    #[test]
    fn every_set_of_rotors_at_their_ends() {
        let signs = [1.0, -1.0, 0.0];
        for row in (0..81_usize).step_by(if cfg!(miri) { 41 } else { 1 }) {
            let column = |k: u32| signs[row / 3_usize.pow(k) % 3];
            let entries = [column(0), column(1), column(2), column(3)];
            // Each rotor answers the axes in another order.
            let rows: [[f64; 4]; 4] =
                core::array::from_fn(|rotor| core::array::from_fn(|axis| entries[(rotor + axis) % 4]));
            let mixer = Mixer::from_rows(&rows, &[1.0; 4]);
            for ends in 0..256_u32 {
                let at_end: [AtEnd; 4] = core::array::from_fn(|rotor| AtEnd {
                    high: ends >> (2 * rotor) & 1 != 0,
                    low: ends >> (2 * rotor) & 2 != 0,
                });
                let refuses = |axis: usize, sign: f64| {
                    (0..4).any(|rotor: usize| {
                        let more = sign * rows[rotor][axis];
                        at_end[rotor].high && more > 0.0 || at_end[rotor].low && more < 0.0
                    })
                };
                let axis = |k| Directions::new(refuses(k, 1.0), refuses(k, -1.0));
                let want = Refused { thrust: axis(0), roll: axis(1), pitch: axis(2), yaw: axis(3) };
                let got = mixer.refused(at_end);
                assert_eq!(got, want, "{rows:?} {at_end:?}");
                assert_eq!(got.any(), (0..4).any(|k| refuses(k, 1.0) || refuses(k, -1.0)));
            }
        }
    }

    #[test]
    fn singular_matrices_are_refused() {
        let mut k = effectiveness(&THESIS_ROTORS);
        k[3] = k[0].map(|x| 2.0 * x); // every rotor yaws the same way
        assert_eq!(inverse(&k), Err(ConfigError::SingularMixing));
        assert_eq!(inverse(&[[0.0; 4]; 4]), Err(ConfigError::SingularMixing));
        assert_eq!(inverse(&[[f64::NAN; 4]; 4]), Err(ConfigError::SingularMixing));
        // A determinant of the least size that counts, and one below it; the rows have length 1.
        let nearly = |least: f64| {
            inverse(&[
                [1.0, 0.0, 0.0, 0.0],
                [0.0, 1.0, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0, least],
            ])
        };
        assert!(nearly(1e-9).is_ok() && nearly(-1e-9).is_ok());
        assert_eq!(nearly(0.999e-9), Err(ConfigError::SingularMixing));
    }

    proptest! {
        #[test]
        fn speeds_are_never_nan_or_negative(bits in any::<[u32; 4]>()) {
            let speeds = rotor_speeds(bits.map(f32::from_bits));
            prop_assert!(speeds.iter().all(|w| *w >= 0.0));
        }
    }
}
