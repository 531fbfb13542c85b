//! What the IMU board sends over its serial line, 115200 baud, 8 data bits, no parity, 1 stop bit.
//!
//! The thesis' board (3DR APM 2.6) sends rates, attitude, acceleration, battery voltage and current
//! over RS-232; the thesis prints no format, so this one is ours. All integers are little endian,
//! as they lie in an AVR's or ARM's memory:
//!
//! ```text
//! offset  0   version, 1
//!         1   flags: bit 0 acceleration, 1 attitude, 2 voltage, 3 current is measured; the others are 0
//!         2   sequence u16, one more with each frame
//!         4   the board's clock, u32, us modulo 2^32
//!         8   p q r          i16 each, rad/s     / 800  (to +-40.9 rad/s)
//!        14   ax ay az       i16 each, m/s^2     / 200  (to +-163 m/s^2), specific force
//!        20   roll pitch yaw i16 each, rad       / 10000
//!        26   voltage        u16, mV
//!        28   current        i16, 10 mA
//!        30   CRC-16 of all before it (CRC-16/MCRF4XX: MAVLink's, and `_crc_ccitt_update` of avr-libc from 0xFFFF)
//! ```
//!
//! These 32 bytes are stuffed like every packet here ([`enframe`]: COBS and a zero), 34 bytes, 3.0
//! ms on the line. An i16 of -32768 is NaN (a sensor that failed); what is beyond the range is
//! clamped. Body frame FRD.
//!
//! Absent: messages to the board. It sends, at the loop's rate or faster, and the newest frame
//! counts.

use crc::{CRC_16_MCRF4XX, Crc};

use crate::message::ImuSample;
use crate::stream::{Deframer, enframe};

const VERSION: u8 = 1;
const BODY_LEN: usize = 30;
/// Length of a frame before stuffing, in bytes.
pub const FRAME_LEN: usize = BODY_LEN + 2;
/// No stuffed frame is longer, in bytes.
pub const MAX_STUFFED_LEN: usize = FRAME_LEN + 2;

const ACCELERATION: u8 = 1;
const ATTITUDE: u8 = 2;
const VOLTAGE: u8 = 4;
const CURRENT: u8 = 8;

const GYRO_PER_RAD_S: f32 = 800.0;
const ACCELERATION_PER_M_S2: f32 = 200.0;
const ATTITUDE_PER_RAD: f32 = 10_000.0;
const VOLTAGE_PER_V: f32 = 1000.0;
const CURRENT_PER_A: f32 = 100.0;

const CRC: Crc<u16> = Crc::<u16>::new(&CRC_16_MCRF4XX);

/// A frame of the board.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuFrame {
    /// One more with each frame.
    pub sequence: u16,
    /// The board's clock, us modulo 2^32.
    pub board_us: u32,
    /// Rates and, if they are measured, attitude and acceleration.
    pub sample: ImuSample,
    /// Battery voltage, V.
    pub battery_v: Option<f32>,
    /// Battery current, A.
    pub current_a: Option<f32>,
}

/// A value as an integer; clamped to the range, the least i16 for NaN.
fn to_i16(value: f32, per_unit: f32) -> [u8; 2] {
    let scaled = libm::roundf(value * per_unit);
    // The cast saturates; -32768 is taken.
    let whole = if scaled.is_nan() { i16::MIN } else { (scaled as i16).max(-i16::MAX) };
    whole.to_le_bytes()
}

fn from_i16(bytes: [u8; 2], per_unit: f32) -> f32 {
    match i16::from_le_bytes(bytes) {
        i16::MIN => f32::NAN,
        whole => f32::from(whole) / per_unit,
    }
}

/// Little-endian fields, one after the other.
struct Fields<'a>(&'a mut [u8; FRAME_LEN], usize);

impl Fields<'_> {
    fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if let Some(place) = self.0.get_mut(self.1) {
                *place = *byte;
            }
            self.1 += 1;
        }
    }

    fn put_three(&mut self, values: Option<[f32; 3]>, per_unit: f32) {
        for value in values.unwrap_or_default() {
            self.put(&to_i16(value, per_unit));
        }
    }
}

/// Writes a frame in its stuffed form with its zero, as it goes over the line; [`MAX_STUFFED_LEN`]
/// bytes suffice.
pub fn encode<'a>(frame: &ImuFrame, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let ImuFrame { sequence, board_us, sample, battery_v, current_a } = frame;
    let flag = |bit: u8, there: bool| if there { bit } else { 0 };
    let flags = flag(ACCELERATION, sample.acceleration_m_s2.is_some())
        | flag(ATTITUDE, sample.attitude_rad.is_some())
        | flag(VOLTAGE, battery_v.is_some())
        | flag(CURRENT, current_a.is_some());
    let mut bytes = [0; FRAME_LEN];
    let mut fields = Fields(&mut bytes, 0);
    fields.put(&[VERSION, flags]);
    fields.put(&sequence.to_le_bytes());
    fields.put(&board_us.to_le_bytes());
    fields.put_three(Some(sample.gyro_rad_s), GYRO_PER_RAD_S);
    fields.put_three(sample.acceleration_m_s2, ACCELERATION_PER_M_S2);
    fields.put_three(sample.attitude_rad, ATTITUDE_PER_RAD);
    fields.put(&(libm::roundf(battery_v.unwrap_or_default() * VOLTAGE_PER_V) as u16).to_le_bytes());
    fields.put(&to_i16(current_a.unwrap_or_default(), CURRENT_PER_A));
    let crc = CRC.checksum(&bytes[..BODY_LEN]).to_le_bytes();
    Fields(&mut bytes, BODY_LEN).put(&crc);
    enframe(&bytes, buffer)
}

/// Reads a frame without its stuffing; none if it is damaged or of another version.
fn decode(bytes: &[u8]) -> Option<ImuFrame> {
    let bytes: &[u8; FRAME_LEN] = bytes.try_into().ok()?;
    let (body, crc) = bytes.split_last_chunk::<2>()?;
    let [version, flags, s0, s1, t0, t1, t2, t3, rest @ ..] = body else { return None };
    let known = flags & !(ACCELERATION | ATTITUDE | VOLTAGE | CURRENT) == 0;
    if CRC.checksum(body) != u16::from_le_bytes(*crc) || *version != VERSION || !known {
        return None;
    }
    let (words, _) = rest.as_chunks::<2>();
    let &[p, q, r, ax, ay, az, roll, pitch, yaw, voltage, current] = words else { return None };
    let there = |bit: u8| flags & bit != 0;
    let three = |words: [[u8; 2]; 3], per_unit| words.map(|word| from_i16(word, per_unit));
    Some(ImuFrame {
        sequence: u16::from_le_bytes([*s0, *s1]),
        board_us: u32::from_le_bytes([*t0, *t1, *t2, *t3]),
        sample: ImuSample {
            gyro_rad_s: three([p, q, r], GYRO_PER_RAD_S),
            attitude_rad: there(ATTITUDE).then(|| three([roll, pitch, yaw], ATTITUDE_PER_RAD)),
            acceleration_m_s2: there(ACCELERATION).then(|| three([ax, ay, az], ACCELERATION_PER_M_S2)),
        },
        battery_v: there(VOLTAGE).then(|| f32::from(u16::from_le_bytes(voltage)) / VOLTAGE_PER_V),
        current_a: there(CURRENT).then(|| from_i16(current, CURRENT_PER_A)),
    })
}

/// Frames that never came between two that did, by their sequence. A leap back is a board that began
/// anew.
fn lost_between(last: u16, sequence: u16) -> u16 {
    let gap = sequence.wrapping_sub(last).wrapping_sub(1);
    if gap < 0x8000 { gap } else { 0 }
}

/// Finds frames in what comes over the line.
#[derive(Debug, Default)]
pub struct Parser {
    deframer: Deframer,
    last: Option<u16>,
    /// Frames that were damaged or of another version; stays at the greatest number.
    pub refused: u32,
    /// Frames that never came, by the gaps in their sequence; stays at the greatest number.
    pub lost: u32,
}

impl Parser {
    /// Takes one byte; gives the frame that it ends.
    pub fn push(&mut self, byte: u8) -> Option<ImuFrame> {
        let dropped = self.deframer.dropped;
        let decoded = self.deframer.push(byte).map(decode);
        if decoded.is_none() && self.deframer.dropped == dropped {
            return None;
        }
        let Some(frame) = decoded.flatten() else {
            self.refused = self.refused.saturating_add(1);
            return None;
        };
        let lost = self.last.map_or(0, |last| lost_between(last, frame.sequence));
        self.lost = self.lost.saturating_add(lost.into());
        self.last = Some(frame.sequence);
        Some(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stuffed(frame: &ImuFrame) -> Vec<u8> {
        encode(frame, &mut [0; MAX_STUFFED_LEN]).unwrap().to_vec()
    }

    fn frames(bytes: &[u8], parser: &mut Parser) -> Vec<ImuFrame> {
        bytes.iter().filter_map(|byte| parser.push(*byte)).collect()
    }

    fn frame(sequence: u16) -> ImuFrame {
        let sample = ImuSample { gyro_rad_s: [0.5, -1.0, 2.0], attitude_rad: None, acceleration_m_s2: None };
        ImuFrame { sequence, board_us: 7, sample, battery_v: Some(11.1), current_a: None }
    }

    /// The catalogue's check value of MAVLink's CRC, and a frame that was laid out by hand.
    #[test]
    fn the_bytes_are_those_of_the_table() {
        assert_eq!(CRC.checksum(b"123456789"), 0x6f91);
        let expected: [u8; 30] = [
            1, 4, 0x34, 0x12, 7, 0, 0, 0, // version, voltage only, sequence 0x1234, clock 7
            0x90, 0x01, 0xe0, 0xfc, 0x40, 0x06, // 400, -800, 1600
            0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, // not measured
            0x5c, 0x2b, 0, 0, // 11100 mV
        ];
        let bytes = stuffed(&frame(0x1234));
        let mut deframer = Deframer::new();
        let inside = bytes.iter().find_map(|byte| deframer.push(*byte).map(<[u8]>::to_vec)).unwrap();
        assert_eq!(inside[..30], expected);
        assert_eq!(inside.len(), FRAME_LEN);
    }

    #[test]
    fn every_flipped_bit_and_every_cut_is_refused() {
        let bytes = stuffed(&frame(3));
        for bit in 0..bytes.len() * 8 {
            let mut damaged = bytes.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(frames(&damaged, &mut Parser::default()), [], "bit {bit}");
        }
        for length in 0..bytes.len() {
            assert_eq!(frames(&bytes[..length], &mut Parser::default()), [], "{length} bytes");
        }
    }

    #[test]
    fn gaps_are_counted_across_the_wrap() {
        let mut parser = Parser::default();
        for sequence in [65534, 65535, 0, 3, 4] {
            assert_eq!(frames(&stuffed(&frame(sequence)), &mut parser).len(), 1);
        }
        assert_eq!((parser.lost, parser.refused), (2, 0));
        frames(&stuffed(&frame(0)), &mut parser);
        assert_eq!(parser.lost, 2, "a board that began anew has lost nothing");
    }

    #[test]
    fn no_number_stays_no_number_and_too_much_stays_much() {
        let mut sent = frame(0);
        sent.sample.gyro_rad_s = [f32::NAN, 1e9, f32::NEG_INFINITY];
        let [got] = frames(&stuffed(&sent), &mut Parser::default())[..] else { panic!("one frame") };
        let [p, q, r] = got.sample.gyro_rad_s;
        assert!(p.is_nan());
        assert_eq!([q, r], [32767.0 / 800.0, -32767.0 / 800.0]);
    }

    prop_compose! {
        fn any_frame()(
            sequence in any::<u16>(), board_us in any::<u32>(),
            gyro_rad_s in [-40.0f32..40.0, -40.0..40.0, -40.0..40.0],
            attitude_rad in prop::option::of([-3.2f32..3.2, -3.2..3.2, -3.2..3.2]),
            acceleration_m_s2 in prop::option::of([-160.0f32..160.0, -160.0..160.0, -160.0..160.0]),
            battery_v in prop::option::of(0.0f32..65.0), current_a in prop::option::of(-300.0f32..300.0),
        ) -> ImuFrame {
            let sample = ImuSample { gyro_rad_s, attitude_rad, acceleration_m_s2 };
            ImuFrame { sequence, board_us, sample, battery_v, current_a }
        }
    }

    /// Half a step of the scale, and a little for the rounding of f32.
    fn near(a: f32, b: f32, per_unit: f32) -> bool {
        (a - b).abs() <= 0.5001 / per_unit + b.abs() * f32::EPSILON * 2.0
    }

    fn all_near(a: Option<[f32; 3]>, b: Option<[f32; 3]>, per_unit: f32) -> bool {
        match (a, b) {
            (Some(a), Some(b)) => a.iter().zip(b).all(|(a, b)| near(*a, b, per_unit)),
            (a, b) => a == b,
        }
    }

    proptest! {
        /// A frame comes out as it went in, to half a step of its scale, behind whatever garbage
        /// came before.
        #[test]
        fn frames_survive_the_line(sent in any_frame(), garbage in prop::collection::vec(any::<u8>(), 0..600)) {
            let mut parser = Parser::default();
            frames(&garbage, &mut parser);
            parser.push(0);
            let got = frames(&stuffed(&sent), &mut parser);
            prop_assert_eq!(got.len(), 1);
            let got = got[0];
            prop_assert_eq!((got.sequence, got.board_us), (sent.sequence, sent.board_us));
            let (a, b) = (got.sample, sent.sample);
            prop_assert!(all_near(Some(a.gyro_rad_s), Some(b.gyro_rad_s), GYRO_PER_RAD_S));
            prop_assert!(all_near(a.acceleration_m_s2, b.acceleration_m_s2, ACCELERATION_PER_M_S2));
            prop_assert!(all_near(a.attitude_rad, b.attitude_rad, ATTITUDE_PER_RAD));
            let one = |value: Option<f32>| value.map(|value| [value; 3]);
            prop_assert!(all_near(one(got.battery_v), one(sent.battery_v), VOLTAGE_PER_V));
            prop_assert!(all_near(one(got.current_a), one(sent.current_a), CURRENT_PER_A));
        }

        /// Noise is not taken for frames: 32 bytes with a right CRC, version and flags among random
        /// ones have a chance of 2^-28 each; and nothing panics.
        #[test]
        fn noise_is_no_frame(noise in prop::collection::vec(any::<u8>(), 0..if cfg!(miri) { 100 } else { 4000 })) {
            prop_assert_eq!(frames(&noise, &mut Parser::default()), vec![]);
        }
    }
}

/// Every u16 sequence after every 257th (at night, after every one), every i16 on the line on each
/// scale, and every 4,099th f32 (at night, every one): against wide integers and f64.
#[cfg(test)]
#[cfg(not(miri))]
mod arithmetic {
    use super::*;
    use crate::residues::stride;

    const SCALES: [f32; 4] = [GYRO_PER_RAD_S, ACCELERATION_PER_M_S2, ATTITUDE_PER_RAD, CURRENT_PER_A];

    #[test]
    fn frames_lost_between_any_two() {
        for last in (0..=u16::MAX).step_by(stride(257)) {
            for sequence in 0..=u16::MAX {
                let ahead = (i64::from(sequence) - i64::from(last)).rem_euclid(1 << 16);
                let want = if (1..=1 << 15).contains(&ahead) { ahead - 1 } else { 0 };
                assert_eq!(i64::from(lost_between(last, sequence)), want, "{last} {sequence}");
            }
        }
    }

    /// What is read of the line is written as it was; only NaN has two names.
    #[test]
    fn every_number_on_the_line_is_its_own() {
        for scale in SCALES {
            for whole in i16::MIN..=i16::MAX {
                let value = from_i16(whole.to_le_bytes(), scale);
                assert_eq!(value.is_nan(), whole == i16::MIN);
                let exact = f64::from(whole) / f64::from(scale);
                assert!(value.is_nan() || value == exact as f32, "{whole}: {value}");
                assert_eq!(to_i16(value, scale), whole.to_le_bytes(), "{whole} by {scale}");
            }
        }
    }

    /// The product of two f32 is exact in f64; it is rounded to f32 once, then to a whole number.
    fn is_rounded_and_clamped(bits: u32) {
        let value = f32::from_bits(bits);
        for scale in SCALES {
            let scaled = f64::from((f64::from(value) * f64::from(scale)) as f32);
            let want = if scaled.is_nan() { -32768.0 } else { scaled.round().clamp(-32767.0, 32767.0) };
            assert_eq!(f64::from(i16::from_le_bytes(to_i16(value, scale))), want, "{bits:#x} by {scale}");
        }
    }

    /// Every so manyth f32, at night every one, dealt out to several threads.
    #[test]
    fn any_bits_become_a_number_on_the_line() {
        const THREADS: u8 = 4;
        std::thread::scope(|scope| {
            for first in 0..THREADS {
                let own = (u32::from(first)..=u32::MAX).step_by(usize::from(THREADS) * stride(1023));
                scope.spawn(move || own.for_each(is_rounded_and_clamped));
            }
        });
    }
}
