//! The messages of a simulator that asks tick by tick, byte by byte, as `wire_v3.rs` has the others.

use proptest::prelude::*;
use proto::{
    Command, Error, Input, MAX_FRAME_LEN, Measurement, Message, Mode, Output, Refusal, VERSION, decode,
    encode,
};

fn input() -> Input {
    Input {
        tick: 300,
        measurement: Measurement {
            position_m: [1.0, -2.0, 0.5],
            attitude_rad: [0.0, -0.0, 0.25],
            gyro_rad_s: Some([1.0, 2.0, 4.0]),
            battery_v: 11.5,
        },
        command: Command {
            mode: Mode::Position,
            attitude_rad: [0.5, -0.5],
            yaw_rad: 1.0,
            z_m: -1.0,
            position_m: [2.0, -1.0],
            cut_off: true,
            injection: [1.0, -1.0, 2.0, -2.0],
        },
    }
}

fn output() -> Output {
    Output {
        tick: 127,
        pwm: [1500.0, 1000.0, 2000.0, 1750.0],
        attitude_command_rad: [0.5, -0.5, 1.0],
        z_command_m: -1.0,
        position_reference_m: None,
        thrust: 12.0,
        torque: [1.0, -1.0, 2.0],
        refused: Refusal { roll: [true, false], yaw: [false, true], ..Refusal::default() },
        faults: 2,
    }
}

/// Little-endian bytes of 1.0, -1.0 and so on, from IEEE 754.
const ONE: [u8; 4] = [0, 0, 0x80, 0x3F];
const MINUS_ONE: [u8; 4] = [0, 0, 0x80, 0xBF];
const TWO: [u8; 4] = [0, 0, 0, 0x40];
const MINUS_TWO: [u8; 4] = [0, 0, 0, 0xC0];
const HALF: [u8; 4] = [0, 0, 0, 0x3F];
const MINUS_HALF: [u8; 4] = [0, 0, 0, 0xBF];
const ZERO: [u8; 4] = [0; 4];
const MINUS_ZERO: [u8; 4] = [0, 0, 0, 0x80];

fn check(message: Message, parts: &[&[u8]]) {
    let expected = parts.concat();
    assert_eq!(decode(&expected).unwrap(), message);
    let mut buffer = [0; MAX_FRAME_LEN];
    assert_eq!(encode(&message, &mut buffer).unwrap(), expected);
}

#[test]
fn input_bytes() {
    check(
        Message::Input(input()),
        &[
            &[VERSION],
            &[0],          // Input
            &[0xAC, 0x02], // tick 300, seven bits a byte
            &ONE,
            &MINUS_TWO,
            &HALF, // position
            &ZERO,
            &MINUS_ZERO,
            &[0, 0, 0x80, 0x3E], // attitude, 0.25
            &[1],                // a gyro is there
            &ONE,
            &TWO,
            &[0, 0, 0x80, 0x40], // 4.0
            &[0, 0, 0x38, 0x41], // 11.5 V
            &[1],                // position mode
            &HALF,
            &MINUS_HALF, // attitude command
            &ONE,        // yaw
            &MINUS_ONE,  // z
            &TWO,
            &MINUS_ONE, // position command
            &[1],       // cut off
            &ONE,
            &MINUS_ONE,
            &TWO,
            &MINUS_TWO, // injection
        ],
    );
}

#[test]
fn output_bytes() {
    check(
        Message::Output(output()),
        &[
            &[VERSION],
            &[1],    // Output
            &[0x7F], // tick 127
            &[0, 0x80, 0xBB, 0x44],
            &[0, 0, 0x7A, 0x44],
            &[0, 0, 0xFA, 0x44],
            &[0, 0xC0, 0xDA, 0x44], // 1500, 1000, 2000, 1750
            &HALF,
            &MINUS_HALF,
            &ONE,
            &MINUS_ONE,          // z
            &[0],                // no position reference
            &[0, 0, 0x40, 0x41], // 12.0
            &ONE,
            &MINUS_ONE,
            &TWO,
            &[0, 0, 1, 0, 0, 0, 0, 1], // thrust, roll high, pitch, yaw low
            &[2],                      // faults
        ],
    );
}

#[test]
fn a_cut_frame_is_never_a_message() {
    let mut buffer = [0; MAX_FRAME_LEN];
    for message in [Message::Input(input()), Message::Output(output())] {
        let frame = encode(&message, &mut buffer).unwrap();
        for length in 1..frame.len() {
            assert_eq!(decode(&frame[..length]), Err(Error::Malformed), "{length} of {} bytes", frame.len());
        }
    }
}

#[test]
fn the_longest_frame_fits() {
    // Longest: every variable-length integer at its greatest, every option present.
    let longest = [
        Message::Input(Input { tick: u32::MAX, ..input() }),
        Message::Output(Output {
            tick: u32::MAX,
            position_reference_m: Some([0.0; 2]),
            faults: u32::MAX,
            ..output()
        }),
    ];
    let mut buffer = [0; MAX_FRAME_LEN];
    for message in longest {
        encode(&message, &mut buffer).unwrap();
    }
}

proptest! {
    /// Every bit of a number survives, NaN and infinity among them.
    #[test]
    fn numbers_arrive_bit_for_bit(bits in any::<[u32; 11]>(), tick in any::<u32>()) {
        let f = bits.map(f32::from_bits);
        let mut sent = output();
        sent.tick = tick;
        sent.pwm = [f[0], f[1], f[2], f[3]];
        sent.attitude_command_rad = [f[4], f[5], f[6]];
        sent.torque = [f[7], f[8], f[9]];
        sent.thrust = f[10];
        let mut buffer = [0; MAX_FRAME_LEN];
        let Message::Output(got) = decode(encode(&Message::Output(sent), &mut buffer).unwrap()).unwrap() else {
            panic!("another message came back");
        };
        let back = [
            got.pwm[0], got.pwm[1], got.pwm[2], got.pwm[3], got.attitude_command_rad[0], got.attitude_command_rad[1],
            got.attitude_command_rad[2], got.torque[0], got.torque[1], got.torque[2], got.thrust,
        ];
        prop_assert_eq!(back.map(f32::to_bits), bits);
        prop_assert_eq!(got.tick, tick);
    }

    /// Damaged bytes give an error or a message that can be written again; never a panic.
    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..MAX_FRAME_LEN)) {
        if let Ok(message) = decode(&bytes) {
            let mut buffer = [0; MAX_FRAME_LEN];
            prop_assert!(encode(&message, &mut buffer).is_ok());
        }
    }
}
