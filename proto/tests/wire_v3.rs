//! Version 3 byte by byte: a change of any of these bytes needs a new version and a new file beside
//! this one.

mod common;

use common::messages;
use proptest::prelude::*;
use proto::{
    CraftEnd, Error, GroundEnd, Heard, Key, MAX_FRAME_LEN, MAX_PACKET_LEN, Message, Pose, Role, Sealer,
    TimedPose, VERSION, decode, encode,
};

/// The bytes of a frame: words are f32 by name, everything else hexadecimal.
fn bytes(text: &str) -> Vec<u8> {
    text.split_whitespace()
        .flat_map(|word| match word {
            "0" => vec![0; 4],
            "-0" => vec![0, 0, 0, 0x80],
            ".5" => vec![0, 0, 0, 0x3F],
            "-.5" => vec![0, 0, 0, 0xBF],
            "1" => vec![0, 0, 0x80, 0x3F],
            "-1" => vec![0, 0, 0x80, 0xBF],
            "2" => vec![0, 0, 0, 0x40],
            "-2" => vec![0, 0, 0, 0xC0],
            hexadecimal => hexadecimal
                .as_bytes()
                .chunks(2)
                .map(|two| u8::from_str_radix(std::str::from_utf8(two).unwrap(), 16).unwrap())
                .collect(),
        })
        .collect()
}

/// The frame of each message of [`messages`], in its order; integers seven bits a byte, options
/// with a leading byte.
fn pinned() -> Vec<Vec<u8>> {
    let pose = "1 -2 .5  0 -0 -1";
    let supervision = "03 40 FF07";
    [
        format!("03 02  05 8001  01 {pose}  00  2  00  01 03  01"),
        format!("03 03  7F  1 2 -1 -2  .5 -.5 1  -1  00  2  1 -1 2  0000000000000000 02  {supervision}"),
        format!("03 04  01 02 {pose}"),
        "03 05  01 .5 -.5 1 -1 2 -1 00 1 -1 2 -2".into(),
        "03 06  01".into(),
        "03 07  02 1 2 -1".into(),
        "03 08  AC02".into(),
        "03 09".into(),
        format!(
            "03 0A  AC02 FFFFFFFF0F 01  {supervision}  00  1 2 -1  -2  {pose}  .5 -.5 1
             01 1 1 1 00 01 -1 -1 -1  2  1 -1 .5  1 2 -1 -2  0000 0100 0000 0000  2  01 1
             01 02 03 04 05 06 07 08 8001"
        ),
        format!("03 0B  03 03  00 01 AC02  {}  00", "AB".repeat(32)),
        "03 0C  07 01 01".into(),
        "03 0D  03".into(),
    ]
    .iter()
    .map(|text| bytes(text))
    .collect()
}

#[test]
fn every_message_has_its_bytes() {
    assert_eq!(VERSION, 3, "another version needs its own bytes");
    let pinned = pinned();
    assert_eq!(messages().len(), pinned.len());
    for (message, expected) in messages().iter().zip(&pinned) {
        let mut buffer = [0; MAX_FRAME_LEN];
        assert_eq!(encode(message, &mut buffer).unwrap(), expected.as_slice(), "{message:?}");
        assert_eq!(decode(expected).unwrap(), *message);
    }
}

// Header, tag, keys and CRC, computed outside: Python's hmac, hashlib and zlib.crc32.
const PLAIN: &str = "030002010000000000000000091740CC7C";
const HELLO: &str = "030D02010000000000000000740690E98D21C249E8030000000000000000000000000000000000000000000023B33763B79C82ADB6CC93814D1C3BE40CC75384";
const CHALLENGE: &str = "030F02010000000000000000740690E98D21C24970110100E8030000B710E68B41CBC2B5F4AEC7AFDBF47128AF83CB853438C3E9E7774EED2AF260D52FCE669F";
const WHO: &str =
    "030902010000000000000000740690E98D21C249FC03000070110100090749CE2F8DAD73C2C8793203A909DF361C9410BE";

/// A message without fields: plain, and in a session with its hello and challenge.
#[test]
fn packets_have_their_bytes() {
    let (mut buffer, mut reply) = ([0; MAX_PACKET_LEN], [0; MAX_PACKET_LEN]);
    let mut plain = Sealer::new(Role::Ground, 0x0102);
    assert_eq!(plain.seal(&Message::Who, &mut buffer).unwrap(), (0, bytes(PLAIN).as_slice()));
    let key = Key::new(std::array::from_fn(|k| k as u8));
    let mut ground = GroundEnd::new(0x0102, Some(key.clone()), [2; 32]);
    let mut craft = CraftEnd::new(0x0102, Some(key), [1; 32]);
    let from = Some("10.1.2.3:4567".parse().unwrap());
    let hello = ground.greet(1000, &mut buffer).unwrap();
    assert_eq!(hello, bytes(HELLO));
    let heard = craft.hear(70_000, from, hello, &mut reply);
    assert_eq!(heard, Ok(Heard::Hello(bytes(CHALLENGE).as_slice())));
    assert_eq!(ground.hear(1010, &bytes(CHALLENGE)), Ok(None));
    assert_eq!(ground.seal(1020, &Message::Who, &mut buffer).unwrap(), (0, bytes(WHO).as_slice()));
    let opened = craft.hear(70_030, from, &bytes(WHO), &mut reply).unwrap();
    assert!(matches!(opened, Heard::Message(opened) if opened.message == Message::Who), "{opened:?}");
}

#[test]
fn other_versions_and_wrong_bytes_are_refused_by_name() {
    for version in [0, 1, 2, 4] {
        assert_eq!(decode(&[version, 9]), Err(Error::Version { found: version }));
    }
    let named = Error::Version { found: 2 }.to_string();
    assert!(named.contains("version 2, this one speaks 3"), "{named}");
    assert_eq!(decode(&[]), Err(Error::Empty));
    assert_eq!(decode(&[VERSION]), Err(Error::Malformed));
    assert_eq!(decode(&[VERSION, 99]), Err(Error::Malformed));
    assert_eq!(decode(&[VERSION, 9, 0, 0]), Err(Error::TrailingBytes(2)));
    assert_eq!(encode(&Message::Who, &mut []), Err(Error::BufferTooShort));
    for frame in pinned() {
        for length in 1..frame.len() {
            assert_eq!(decode(&frame[..length]), Err(Error::Malformed), "{length} of {} bytes", frame.len());
        }
    }
}

proptest! {
    /// Every bit of a number survives, NaN and infinity among them.
    #[test]
    fn numbers_arrive_bit_for_bit(bits in any::<[u32; 6]>()) {
        let f = bits.map(f32::from_bits);
        let pose = Pose { position_m: [f[0], f[1], f[2]], attitude_rad: [f[3], f[4], f[5]] };
        let sent = Message::Pose(TimedPose { frame: 1, ground_us: 2, pose });
        let mut buffer = [0; MAX_FRAME_LEN];
        let Message::Pose(got) = decode(encode(&sent, &mut buffer).unwrap()).unwrap() else {
            panic!("another message came back");
        };
        let back = [got.pose.position_m, got.pose.attitude_rad];
        prop_assert_eq!(back.as_flattened().iter().map(|f| f.to_bits()).collect::<Vec<_>>(), bits.to_vec());
    }
}
