//! What a link does to packets: damage, loss, order, replay, forgery; on datagrams and on a byte
//! stream.

#[path = "../../firmware/control/tests/common/cases.rs"]
mod cases;
mod common;

use cases::cases;
use common::messages;
use common::session;
use proptest::prelude::*;
use proto::{
    CraftEnd, Deframer, GroundEnd, Heard, Key, MAX_PACKET_LEN, MAX_STREAM_LEN, Message, Opener, Refused,
    Role, Sealer, enframe,
};

const LINK: u16 = 7;

fn key(byte: u8) -> Key {
    Key::new([byte; 32])
}

/// One end that speaks and one that hears: plain packets, or those of a session from the ground.
#[derive(Clone)]
enum Pair {
    Plain(Sealer, Opener),
    Session(Box<(GroundEnd, CraftEnd)>),
}

fn pair(in_session: bool) -> Pair {
    match in_session {
        false => Pair::Plain(Sealer::new(Role::Ground, LINK), Opener::new(Role::Ground, LINK)),
        true => Pair::Session(Box::new(session(LINK, Some(key(1))))),
    }
}

impl Pair {
    fn seal(&mut self, message: &Message) -> Vec<u8> {
        let mut buffer = [0; MAX_PACKET_LEN];
        let sealed = match self {
            Self::Plain(sealer, _) => sealer.seal(message, &mut buffer),
            Self::Session(ends) => ends.0.seal(5, message, &mut buffer),
        };
        sealed.unwrap().1.to_vec()
    }

    fn open(&mut self, packet: &[u8]) -> Result<(u64, Message), Refused> {
        match self {
            Self::Plain(_, opener) => opener.unseal(packet),
            Self::Session(ends) => match ends.1.hear(5, None, packet, &mut [0; MAX_PACKET_LEN])? {
                Heard::Message(opened) => Ok((opened.number, opened.message)),
                Heard::Hello(_) => panic!("no hello"),
            },
        }
    }

    fn statistics(&self) -> proto::Statistics {
        match self {
            Self::Plain(_, opener) => opener.statistics,
            Self::Session(ends) => ends.1.statistics,
        }
    }
}

#[test]
fn every_message_arrives() {
    for in_session in [false, true] {
        let mut pair = pair(in_session);
        for (number, message) in (0..).zip(messages()) {
            let packet = pair.seal(&message);
            assert_eq!(pair.open(&packet), Ok((number, message)));
        }
        assert_eq!((pair.statistics().refused, pair.statistics().lost), (0, 0));
    }
}

/// Every bit or byte; a few of them for an interpreter, which is ten thousand times slower.
const fn every(otherwise: usize) -> usize {
    if cfg!(miri) { otherwise } else { 1 }
}

/// Every 1-bit flip of every message, plain and in a session, is refused; so is every cut.
#[test]
fn damage_is_refused() {
    for in_session in [false, true] {
        for message in messages() {
            let mut pair = pair(in_session);
            let packet = pair.seal(&message);
            for bit in (0..packet.len() * 8).step_by(every(97)) {
                let mut damaged = packet.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(pair.open(&damaged), Err(Refused::Damaged), "bit {bit} of {message:?}");
            }
            for length in (0..packet.len()).step_by(every(13)) {
                assert!(pair.open(&packet[..length]).is_err(), "{length} bytes of {message:?}");
            }
            assert!(pair.open(&[packet.as_slice(), &[0]].concat()).is_err());
            assert!(pair.open(&packet).is_ok(), "undamaged it is accepted");
        }
    }
}

/// An attacker mends the CRC, so the tag has to find every flip by itself.
#[test]
fn a_flip_under_a_mended_crc_is_forged() {
    for message in messages() {
        let mut pair = pair(true);
        let packet = pair.seal(&message);
        let signed = packet.len() - 4;
        for bit in (0..signed * 8).step_by(every(401)) {
            let mut forged = packet[..signed].to_vec();
            forged[bit / 8] ^= 1 << (bit % 8);
            let refused = pair.open(&with_crc(forged)).unwrap_err();
            // The header is read before the tag: that is cheaper. Bytes 12 to 19 name the session.
            let by_header = bit < 32 && !matches!(refused, Refused::Damaged | Refused::Replayed);
            let by_session =
                (96..224).contains(&bit) && matches!(refused, Refused::NoSession | Refused::Old { .. });
            let is_forged = matches!(refused, Refused::Forged | Refused::NoSession);
            assert!(is_forged || by_header || by_session, "bit {bit} of {message:?}: {refused:?}");
        }
        assert!(pair.open(&packet).is_ok());
    }
}

fn with_crc(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&bytes);
    bytes.extend(sum.to_le_bytes());
    bytes
}

#[test]
fn who_is_not_meant_or_not_known_is_refused_by_name() {
    let (mut buffer, mut reply) = ([0; MAX_PACKET_LEN], [0; MAX_PACKET_LEN]);
    let mut hello_of = |link, key| GroundEnd::new(link, key, [2; 32]).greet(0, &mut buffer).unwrap().to_vec();
    let (keyed, open) = (hello_of(LINK, Some(key(1))), hello_of(LINK, None));
    let mut refused = |link, key, packet: &[u8]| {
        CraftEnd::new(link, key, [1; 32]).hear(0, None, packet, &mut reply).unwrap_err()
    };
    assert_eq!(refused(LINK, Some(key(2)), &keyed), Refused::Forged);
    let other = Refused::Link { found: LINK, expected: 8 };
    assert_eq!(refused(8, Some(key(1)), &keyed), other);
    assert_eq!(refused(LINK, None, &keyed), Refused::NoKey);
    assert_eq!(refused(LINK, Some(key(1)), &open), Refused::NoTag);
    let plain = pair(false).seal(&Message::Who);
    assert_eq!(refused(LINK, None, &plain), Refused::NoSession);
    let mut ground = GroundEnd::new(LINK, Some(key(1)), [3; 32]);
    assert_eq!(ground.hear(0, &keyed), Err(Refused::Direction));
    for version in [1, 2, 4] {
        let mut earlier = keyed[..keyed.len() - 4].to_vec();
        earlier[0] = version;
        let named = refused(LINK, Some(key(1)), &with_crc(earlier));
        assert_eq!(named, Refused::Version { found: version });
        assert!(named.to_string().contains(&format!("version {version}, this one speaks 3")), "{named}");
    }
    for refused in [Refused::Forged, Refused::NoKey, Refused::NoTag, Refused::NoSession, other] {
        assert_eq!(refused.to_string().lines().count(), 1);
    }
    assert_eq!(format!("{:?}", key(0x5A)), "Key(..)", "a key is not printed");
}

#[test]
fn a_buffer_that_is_too_short_is_said_to_be() {
    let mut buffer = [0; MAX_PACKET_LEN];
    for length in 0..20 {
        let sealed = Sealer::new(Role::Ground, LINK).seal(&Message::Who, &mut buffer[..length]).map(|_| ());
        assert_eq!(sealed, if length >= 17 { Ok(()) } else { Err(Refused::BufferTooShort) });
    }
    let (mut ground, _) = session(LINK, Some(key(1)));
    for length in 0..49 {
        assert_eq!(ground.seal(0, &Message::Who, &mut buffer[..length]), Err(Refused::BufferTooShort));
    }
    assert_eq!(ground.seal(0, &Message::Who, &mut buffer).unwrap().0, 0, "no number was used up");
}

/// The longest message there can be fits every buffer, stuffed too.
#[test]
fn the_longest_fits() {
    let Message::Telemetry(mut longest) = messages()[8] else { panic!("telemetry") };
    (longest.tick, longest.craft_us, longest.ground_us) = (u32::MAX, u32::MAX, u32::MAX);
    (longest.supervision.conditions, longest.supervision.preflight) = (u32::MAX, u16::MAX);
    longest.imu = longest.imu.map(|imu| proto::ImuSample { attitude_rad: Some([1.0; 3]), ..imu });
    let c = &mut longest.counters;
    for count in [
        &mut c.jitter_us,
        &mut c.overruns,
        &mut c.clock_jumps,
        &mut c.poses_refused,
        &mut c.imu_refused,
        &mut c.commands_refused,
        &mut c.faults,
        &mut c.packets_lost,
        &mut c.packets_refused,
    ] {
        *count = u32::MAX;
    }
    let mut pair = pair(true);
    let packet = pair.seal(&Message::Telemetry(longest));
    let mut buffer = [0; MAX_STREAM_LEN];
    assert!(enframe(&packet, &mut buffer).is_some());
    assert!(pair.open(&packet).is_ok());
    assert!(enframe(&[1; MAX_PACKET_LEN], &mut buffer).is_some());
    for length in 0..packet.len() {
        assert!(enframe(&packet, &mut buffer[..length]).is_none());
    }
}

fn stream(packets: &[Vec<u8>]) -> Vec<u8> {
    let mut buffer = [0; MAX_STREAM_LEN];
    packets.iter().flat_map(|packet| enframe(packet, &mut buffer).unwrap().to_vec()).collect()
}

fn received(pair: &mut Pair, bytes: &[u8]) -> Vec<Message> {
    let mut deframer = Deframer::new();
    let mut messages = Vec::new();
    for byte in bytes {
        if let Some(packet) = deframer.push(*byte) {
            messages.extend(pair.open(packet).ok().map(|(_, message)| message));
        }
    }
    messages
}

#[test]
fn a_stream_is_in_step_again_after_any_lost_or_wrong_byte() {
    let mut pair = pair(true);
    let packets: Vec<_> = messages().iter().map(|message| pair.seal(message)).collect();
    let bytes = stream(&packets);
    assert_eq!(received(&mut pair.clone(), &bytes), messages());
    for k in (0..bytes.len()).step_by(every(501)) {
        let lost = [&bytes[..k], &bytes[k + 1..]].concat();
        let mut wrong = bytes.clone();
        wrong[k] ^= 0x5A;
        for damaged in [lost, wrong] {
            let got = received(&mut pair.clone(), &damaged);
            // The packet that was hit, and if it was its zero the one behind it too.
            assert!(got.len() >= messages().len() - 2, "byte {k}: {} messages", got.len());
            assert!(got.iter().all(|message| messages().contains(message)));
        }
    }
    let after_noise = [&[0xFF; 5000][..], &[0], &bytes].concat();
    assert_eq!(received(&mut pair.clone(), &after_noise), messages());
}

/// Packets whose order is changed.
const SENT: usize = if cfg!(miri) { 6 } else { 60 };

proptest! {
    #![proptest_config(cases(20_000))]

    /// The fuzz target's property, bounded: a packet or stream made of a real one by cutting,
    /// repeating and overwriting never panics, and what is accepted is a message that was sent.
    #[test]
    fn mutated_packets_are_refused_or_real(
        which in 0..messages().len(),
        keyed in any::<bool>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..4), 1..8),
    ) {
        let mut pair = pair(keyed);
        let message = messages()[which];
        let mut bytes = stream(&[pair.seal(&message)]);
        for (place, byte, kind) in edits {
            if bytes.is_empty() { break; }
            let k = place.index(bytes.len());
            match kind {
                0 => bytes[k] = byte,
                1 => { bytes.remove(k); }
                2 => bytes.insert(k, byte),
                _ => bytes.truncate(k),
            }
        }
        let _ = pair.clone().open(&bytes);
        let got = received(&mut pair, &bytes);
        prop_assert!(got.iter().all(|m| *m == message), "{got:?}");
    }

    /// Loss, order and repetition: what is accepted is in the order it was sent, each once, and the
    /// count of losses fits.
    #[test]
    fn order_is_kept(order in prop::collection::vec(0..SENT, 0..3 * SENT)) {
        let mut pair = pair(true);
        let packets: Vec<_> = (0..SENT).map(|_| pair.seal(&Message::Who)).collect();
        let numbers: Vec<u64> = order.iter().filter_map(|k| pair.open(&packets[*k]).ok()).map(|(n, _)| n).collect();
        prop_assert!(numbers.windows(2).all(|w| w[0] < w[1]));
        if let (Some(first), Some(last)) = (numbers.first(), numbers.last()) {
            let never_came = (last - first + 1) as usize - numbers.len();
            prop_assert_eq!(pair.statistics().lost as usize, never_came);
        }
    }
}
