//! Version 2 byte by byte: a change of any of these bytes needs a new version and a new file beside
//! this one.

mod common;

use common::messages;
use proto::{
    Key, MAX_FRAME_LEN, MAX_PACKET_LEN, Message, Role, Sealer, SendCounter, VERSION, decode, encode,
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
        format!("02 02  05 8001  01 {pose}  00  2  00  01 03  01"),
        format!("02 03  7F  1 2 -1 -2  .5 -.5 1  -1  00  2  1 -1 2  0000000000000000 02  {supervision}"),
        format!("02 04  01 02 {pose}"),
        "02 05  01 .5 -.5 1 -1 2 -1 00 1 -1 2 -2".into(),
        "02 06  01".into(),
        "02 07  02 1 2 -1".into(),
        "02 08  AC02".into(),
        "02 09".into(),
        format!(
            "02 0A  AC02 FFFFFFFF0F 01  {supervision}  00  1 2 -1  -2  {pose}  .5 -.5 1
             01 1 1 1 00 01 -1 -1 -1  2  1 -1 .5  1 2 -1 -2  0000 0100 0000 0000  2  01 1
             01 02 03 04 05 06 07 08 8001"
        ),
        format!("02 0B  01 02  00 01 AC02  {}  AC02  00", "AB".repeat(32)),
        "02 0C  07 01 01".into(),
    ]
    .iter()
    .map(|text| bytes(text))
    .collect()
}

#[test]
fn every_message_has_its_bytes() {
    assert_eq!(VERSION, 2, "another version needs its own bytes");
    let pinned = pinned();
    assert_eq!(messages().len(), pinned.len());
    for (message, expected) in messages().iter().zip(&pinned) {
        let mut buffer = [0; MAX_FRAME_LEN];
        assert_eq!(encode(message, &mut buffer).unwrap(), expected.as_slice(), "{message:?}");
        assert_eq!(decode(expected).unwrap(), *message);
    }
}

// Header, tag and CRC, computed outside: Python's hmac, hashlib and zlib.crc32.
const PLAIN: &str = "0200020100000000000000000992995AA1";
const KEYED: &str = "020302012C01000000000000094AE6B78BD0AE7D5BE1B8A74E94598DF97D79F024";

/// A message without fields, open from the ground and with a key from the craft.
#[test]
fn packets_have_their_bytes() {
    let mut buffer = [0; MAX_PACKET_LEN];
    let who = Message::Who;
    let mut open = Sealer::open(Role::Ground, 0x0102);
    assert_eq!(open.seal(&who, &mut buffer).unwrap(), (0, bytes(PLAIN).as_slice()));
    let mut keyed = Sealer::authenticated(Role::Craft, 0x0102, Key::new(std::array::from_fn(|k| k as u8)), 0);
    keyed.counter = SendCounter::volatile();
    keyed.counter.skip_to(300);
    assert_eq!(keyed.seal(&who, &mut buffer).unwrap(), (300, bytes(KEYED).as_slice()));
}
