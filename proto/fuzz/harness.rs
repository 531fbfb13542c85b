//! What has to hold for any bytes, from a radio or from an attacker.

use proto::{
    CraftEnd, Deframer, GroundEnd, Key, MAX_FRAME_LEN, MAX_PACKET_LEN, MAX_STREAM_LEN, Opener, Role, Sealer,
    decode, encode, enframe,
};

/// Panics if something does not hold.
pub(crate) fn run(bytes: &[u8]) {
    frame(bytes);
    packet(bytes);
    stream(bytes);
}

/// What is decoded can be written, and what was written is decoded to the same bytes.
fn frame(bytes: &[u8]) {
    let Ok(message) = decode(bytes) else { return };
    let mut first = [0; MAX_FRAME_LEN];
    let written = encode(&message, &mut first).expect("every message fits");
    let again = decode(written).expect("what was written is read");
    let mut second = [0; MAX_FRAME_LEN];
    assert_eq!(encode(&again, &mut second).expect("every message fits"), written);
}

/// As it comes, and with a CRC that fits: chance would not find one. Without the key nothing is
/// genuine.
fn packet(bytes: &[u8]) {
    let mut fitting = bytes.to_vec();
    fitting.extend(crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes).to_le_bytes());
    for packet in [bytes, &fitting] {
        let mut buffer = [0; MAX_PACKET_LEN];
        let mut plain = Opener::new(Role::Ground, 0);
        if let Ok((_, message)) = plain.unseal(packet) {
            Sealer::new(Role::Ground, 0).seal(&message, &mut buffer).expect("every message fits");
            assert!(plain.unseal(packet).is_err(), "nothing is accepted twice");
        }
        let mut craft = CraftEnd::new(0, Some(Key::new([0x5A; 32])), [1; 32]);
        assert!(craft.hear(0, None, packet, &mut buffer).is_err(), "nothing is genuine without the key");
        let mut ground = GroundEnd::new(0, None, [2; 32]);
        ground.greet(0, &mut buffer);
        assert!(ground.hear(0, packet).is_err(), "nobody knows what was asked");
    }
}

/// Whatever comes over a wire; and what is stuffed is found again behind it.
fn stream(bytes: &[u8]) {
    let mut deframer = Deframer::new();
    for byte in bytes {
        if let Some(found) = deframer.push(*byte) {
            packet(found);
        }
    }
    deframer.push(0);
    let part = &bytes[..bytes.len().min(MAX_PACKET_LEN)];
    let mut buffer = [0; MAX_STREAM_LEN];
    let stuffed = enframe(part, &mut buffer).expect("every packet fits");
    let (zero, inside) = stuffed.split_last().expect("there is a zero at least");
    assert!(*zero == 0 && !inside.contains(&0));
    let mut found = None;
    for byte in stuffed {
        if let Some(packet) = deframer.push(*byte) {
            found = Some(packet.to_vec());
        }
    }
    assert_eq!(found.as_deref().unwrap_or_default(), part);
}
