//! What a link does to packets: damage, loss, order, replay, forgery; on datagrams and on a byte
//! stream.

mod common;

use common::messages;
use proptest::prelude::*;
use proto::{
    Deframer, Key, LEAP, MAX_PACKET_LEN, MAX_STREAM_LEN, Message, Opener, RESERVE, Refused, Role, Sealer,
    enframe,
};

const LINK: u16 = 7;

fn key(byte: u8) -> Key {
    Key::new([byte; 32])
}

fn pair(keyed: bool) -> (Sealer, Opener) {
    if !keyed {
        return (Sealer::open(Role::Ground, LINK), Opener::open(Role::Ground, LINK));
    }
    let mut sealer = Sealer::authenticated(Role::Ground, LINK, key(1), 0);
    let mut opener = Opener::authenticated(Role::Ground, LINK, key(1), 0);
    sealer.counter.reserved(LEAP + RESERVE);
    opener.guard.reserved(LEAP + RESERVE);
    (sealer, opener)
}

fn sealed(sealer: &mut Sealer, message: &Message) -> Vec<u8> {
    let mut buffer = [0; MAX_PACKET_LEN];
    sealer.seal(message, &mut buffer).unwrap().1.to_vec()
}

#[test]
fn every_message_arrives() {
    for keyed in [false, true] {
        let (mut sealer, mut opener) = pair(keyed);
        let first = if keyed { LEAP } else { 0 };
        for (number, message) in (first..).zip(messages()) {
            let packet = sealed(&mut sealer, &message);
            assert_eq!(opener.unseal(&packet), Ok((number, message)));
        }
        assert_eq!((opener.statistics.refused, opener.statistics.lost), (0, 0));
    }
}

/// Every 1-bit flip of every message, with and without a key, is refused; so is every cut.
#[test]
fn damage_is_refused() {
    for keyed in [false, true] {
        for message in messages() {
            let (mut sealer, opener) = pair(keyed);
            let packet = sealed(&mut sealer, &message);
            for bit in 0..packet.len() * 8 {
                let mut damaged = packet.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(
                    opener.clone().unseal(&damaged),
                    Err(Refused::Damaged),
                    "bit {bit} of {message:?}"
                );
            }
            for length in 0..packet.len() {
                assert!(opener.clone().unseal(&packet[..length]).is_err(), "{length} bytes of {message:?}");
            }
            assert!(opener.clone().unseal(&[packet.as_slice(), &[0]].concat()).is_err());
            assert!(opener.clone().unseal(&packet).is_ok(), "undamaged it is accepted");
        }
    }
}

/// An attacker mends the CRC, so the tag has to find every flip by itself.
#[test]
fn a_flip_under_a_mended_crc_is_forged() {
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
    for message in messages() {
        let (mut sealer, opener) = pair(true);
        let packet = sealed(&mut sealer, &message);
        let signed = packet.len() - 4;
        for bit in 0..signed * 8 {
            let mut forged = packet.clone();
            forged[bit / 8] ^= 1 << (bit % 8);
            let sum = crc.checksum(&forged[..signed]).to_le_bytes();
            forged[signed..].copy_from_slice(&sum);
            let refused = opener.clone().unseal(&forged).unwrap_err();
            // The header is read before the tag: that is cheaper.
            let by_header = bit < 32 && !matches!(refused, Refused::Damaged | Refused::Replayed { .. });
            assert!(refused == Refused::Forged || by_header, "bit {bit} of {message:?}: {refused:?}");
        }
    }
}

#[test]
fn who_is_not_meant_or_not_known_is_refused_by_name() {
    let (mut sealer, _) = pair(true);
    let packet = sealed(&mut sealer, &Message::Who);
    let refused = |mut opener: Opener, packet: &[u8]| {
        opener.guard.reserved(LEAP + RESERVE);
        opener.unseal(packet).unwrap_err()
    };
    assert_eq!(refused(Opener::authenticated(Role::Ground, LINK, key(2), 0), &packet), Refused::Forged);
    assert_eq!(refused(Opener::authenticated(Role::Craft, LINK, key(1), 0), &packet), Refused::Direction);
    let other = Refused::Link { found: LINK, expected: 8 };
    assert_eq!(refused(Opener::authenticated(Role::Ground, 8, key(1), 0), &packet), other);
    assert_eq!(refused(Opener::open(Role::Ground, LINK), &packet), Refused::NoKey);
    let bare = sealed(&mut Sealer::open(Role::Ground, LINK), &Message::Who);
    assert_eq!(refused(Opener::authenticated(Role::Ground, LINK, key(1), 0), &bare), Refused::NoTag);
    for refused in [Refused::Forged, Refused::NoKey, Refused::NoTag, other] {
        assert_eq!(refused.to_string().lines().count(), 1);
    }
    assert_eq!(format!("{:?}", key(0x5A)), "Key(..)", "a key is not printed");
}

#[test]
fn nothing_is_accepted_twice_even_after_a_restart() {
    let (mut sealer, mut opener) = pair(true);
    let packets: Vec<_> = (0..100).map(|_| sealed(&mut sealer, &Message::Who)).collect();
    for packet in &packets {
        assert!(opener.unseal(packet).is_ok());
        assert!(matches!(opener.unseal(packet), Err(Refused::Replayed { .. })));
    }
    // What the store holds is where the restarted craft begins.
    let stored = LEAP + RESERVE;
    let mut restarted = Opener::authenticated(Role::Ground, LINK, key(1), stored);
    restarted.guard.reserved(stored + RESERVE);
    for packet in &packets {
        assert_eq!(restarted.unseal(packet), Err(Refused::Replayed { accepts_from: stored }));
    }
    // The ground hears from where on it is accepted, and skips ahead.
    sealer.counter.skip_to(restarted.guard.accepts_from());
    sealer.counter.reserved(stored + RESERVE);
    assert!(restarted.unseal(&sealed(&mut sealer, &Message::Who)).is_ok());
}

#[test]
fn a_sender_without_numbers_says_so() {
    let mut sealer = Sealer::authenticated(Role::Ground, LINK, key(1), 0);
    let mut buffer = [0; MAX_PACKET_LEN];
    assert_eq!(sealer.seal(&Message::Who, &mut buffer), Err(Refused::OutOfNumbers));
    assert!(sealer.counter.to_reserve().is_some());
    for length in 0..20 {
        let mut open = Sealer::open(Role::Ground, LINK);
        let sealed = open.seal(&Message::Who, &mut buffer[..length]).map(|(_, packet)| packet.len());
        assert_eq!(sealed.is_ok(), length >= 17, "{length} bytes of buffer");
    }
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
    let (mut sealer, mut opener) = pair(true);
    let packet = sealed(&mut sealer, &Message::Telemetry(longest));
    let mut buffer = [0; MAX_STREAM_LEN];
    assert!(enframe(&packet, &mut buffer).is_some());
    assert!(opener.unseal(&packet).is_ok());
    assert!(enframe(&[1; MAX_PACKET_LEN], &mut buffer).is_some());
    for length in 0..packet.len() {
        assert!(enframe(&packet, &mut buffer[..length]).is_none());
    }
}

fn stream(packets: &[Vec<u8>]) -> Vec<u8> {
    let mut buffer = [0; MAX_STREAM_LEN];
    packets.iter().flat_map(|packet| enframe(packet, &mut buffer).unwrap().to_vec()).collect()
}

fn received(opener: &mut Opener, bytes: &[u8]) -> Vec<Message> {
    let mut deframer = Deframer::new();
    let mut messages = Vec::new();
    for byte in bytes {
        if let Some(packet) = deframer.push(*byte) {
            messages.extend(opener.unseal(packet).ok().map(|(_, message)| message));
        }
    }
    messages
}

#[test]
fn a_stream_is_in_step_again_after_any_lost_or_wrong_byte() {
    let (mut sealer, opener) = pair(true);
    let packets: Vec<_> = messages().iter().map(|message| sealed(&mut sealer, message)).collect();
    let bytes = stream(&packets);
    assert_eq!(received(&mut opener.clone(), &bytes), messages());
    for k in 0..bytes.len() {
        let lost = [&bytes[..k], &bytes[k + 1..]].concat();
        let mut wrong = bytes.clone();
        wrong[k] ^= 0x5A;
        for damaged in [lost, wrong] {
            let got = received(&mut opener.clone(), &damaged);
            // The packet that was hit, and if it was its zero the one behind it too.
            assert!(got.len() >= messages().len() - 2, "byte {k}: {} messages", got.len());
            assert!(got.iter().all(|message| messages().contains(message)));
        }
    }
    let after_noise = [&[0xFF; 5000][..], &[0], &bytes].concat();
    assert_eq!(received(&mut opener.clone(), &after_noise), messages());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    /// The fuzz target's property, bounded: a packet or stream made of a real one by cutting,
    /// repeating and overwriting never panics, and what is accepted is a message that was sent.
    #[test]
    fn mutated_packets_are_refused_or_real(
        which in 0_usize..11,
        keyed in any::<bool>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..4), 1..8),
    ) {
        let (mut sealer, mut opener) = pair(keyed);
        let message = messages()[which];
        let mut bytes = stream(&[sealed(&mut sealer, &message)]);
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
        let _ = opener.clone().unseal(&bytes);
        let got = received(&mut opener, &bytes);
        prop_assert!(got.iter().all(|m| *m == message), "{got:?}");
    }

    /// Loss, order and repetition: what is accepted is in the order it was sent, each once, and the
    /// count of losses fits.
    #[test]
    fn order_is_kept(order in prop::collection::vec(0_usize..60, 0..200)) {
        let (mut sealer, mut opener) = pair(true);
        let packets: Vec<_> = (0..60).map(|_| sealed(&mut sealer, &Message::Who)).collect();
        let numbers: Vec<u64> = order.iter().filter_map(|k| opener.unseal(&packets[*k]).ok()).map(|(n, _)| n).collect();
        prop_assert!(numbers.windows(2).all(|w| w[0] < w[1]));
        if let (Some(first), Some(last)) = (numbers.first(), numbers.last()) {
            let never_came = (last - first + 1) as usize - numbers.len();
            prop_assert_eq!(opener.statistics.lost as usize, never_came);
        }
    }
}
