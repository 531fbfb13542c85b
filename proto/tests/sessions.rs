//! Both ends of a link with a key, killed and started anew in the middle of whatever they do, on a
//! network that loses packets, and an attacker who has recorded all that was ever sent, holds back
//! what he likes and plays what he likes, from wherever he likes.
//!
//! Whatever happens: no packet is accepted twice, none that is older than two seconds, none of an
//! earlier start of either side once the later one has been heard; and when the network is good again both hear each other at once.
//! Neither side has anything that outlives a start, so there is no file to lose, to roll back or to
//! swap.

#[path = "../../firmware/control/tests/common/cases.rs"]
mod cases;

use std::collections::HashSet;
use std::net::SocketAddr;

use cases::cases;
use proptest::prelude::*;
use proto::{CraftEnd, GroundEnd, Heard, Key, MAX_PACKET_LEN, Message, Pose, TimedPose};

/// Between two packets of each side.
const PERIOD_MS: u32 = 10;

/// What the ground says: the one message that may be overtaken.
const POSE: Message = Message::Pose(TimedPose {
    frame: 0,
    ground_us: 0,
    pose: Pose { position_m: [0.0; 3], attitude_rad: [0.0; 3] },
});

/// A packet that was sent.
#[derive(Debug, Clone)]
struct Sent {
    bytes: Vec<u8>,
    at_ms: u32,
    /// Starts of the ground and of the craft before it.
    starts: [u32; 2],
}

struct World {
    now_ms: u32,
    /// How much faster the craft's clock runs, and what it showed at the beginning.
    pace: f64,
    ground: GroundEnd,
    craft: CraftEnd,
    starts: [u32; 2],
    /// The other side's newest start that ground and craft have heard since their own.
    known: [u32; 2],
    session: Option<u64>,
    /// All that was ever sent up and down.
    sent: [Vec<Sent>; 2],
    accepted: HashSet<Vec<u8>>,
}

fn random(start: u32, side: u8) -> [u8; 32] {
    let mut bytes = [side; 32];
    bytes[..4].copy_from_slice(&start.to_le_bytes());
    bytes
}

fn ends(starts: [u32; 2]) -> (GroundEnd, CraftEnd) {
    let key = Some(Key::new([9; 32]));
    (GroundEnd::new(3, key.clone(), random(starts[0], 1)), CraftEnd::new(3, key, random(starts[1], 2)))
}

fn address(port: u16) -> Option<SocketAddr> {
    Some(SocketAddr::from(([10, 0, 0, 1], port)))
}

impl World {
    fn new(pace: f64) -> Self {
        let (ground, craft) = ends([0, 0]);
        let sent = [Vec::new(), Vec::new()];
        Self {
            now_ms: 5000,
            pace,
            ground,
            craft,
            starts: [0, 0],
            known: [0, 0],
            session: None,
            sent,
            accepted: HashSet::new(),
        }
    }

    /// Its clock, which wraps soon.
    fn craft_ms(&self) -> u32 {
        (u32::MAX - 9000).wrapping_add((f64::from(self.now_ms) * self.pace) as u32)
    }

    /// A packet comes to the craft; was a message of it accepted?
    fn craft_hears(&mut self, packet: &Sent, from: Option<SocketAddr>) -> bool {
        let (mut reply, now_ms) = ([0; MAX_PACKET_LEN], self.craft_ms());
        let glanced = self.craft.clone().glance(from, &packet.bytes).map(drop);
        match self.craft.hear(now_ms, from, &packet.bytes, &mut reply) {
            Ok(Heard::Hello(challenge)) => {
                assert!(challenge.len() <= packet.bytes.len(), "more out than in");
                let challenge = challenge.to_vec();
                self.send(1, challenge);
                false
            }
            Ok(Heard::Message(opened)) => {
                assert_eq!(glanced, Ok(()));
                self.session = Some(opened.session);
                self.check(packet, 1);
                true
            }
            Err(_) => false,
        }
    }

    fn ground_hears(&mut self, packet: &Sent) -> bool {
        let heard = matches!(self.ground.hear(self.now_ms, &packet.bytes), Ok(Some(_)));
        if heard {
            self.check(packet, 0);
        }
        heard
    }

    /// A packet that this side has accepted is new. (A side cannot know of a start before it hears of
    /// it: what was under way when the other was killed may still arrive.)
    fn check(&mut self, packet: &Sent, side: usize) {
        assert!(self.accepted.insert(packet.bytes.clone()), "accepted twice");
        assert_eq!(packet.starts[side], self.starts[side], "of an earlier start of the receiver");
        let other = packet.starts[1 - side];
        assert!(other >= self.known[side], "of an earlier start of the sender");
        self.known[side] = other;
        assert!(self.now_ms - packet.at_ms < 2000, "{} ms old", self.now_ms - packet.at_ms);
    }

    fn send(&mut self, way: usize, bytes: Vec<u8>) -> Sent {
        let sent = Sent { bytes, at_ms: self.now_ms, starts: self.starts };
        self.sent[way].push(sent.clone());
        sent
    }

    /// A period: what each says, and as far as it comes through is heard; did both hear a message?
    fn exchange(&mut self, through: [bool; 2]) -> bool {
        self.now_ms += PERIOD_MS;
        let mut buffer = [0; MAX_PACKET_LEN];
        let hello = self.ground.greet(self.now_ms, &mut buffer).map(<[u8]>::to_vec);
        let who = self.ground.seal(self.now_ms, &POSE, &mut buffer).map(|(_, packet)| packet.to_vec());
        let (mut up, challenges) = (false, self.sent[1].len());
        for bytes in hello.into_iter().chain(who) {
            let packet = self.send(0, bytes);
            up |= through[0] && self.craft_hears(&packet, address(1));
        }
        self.craft.forget_silent(self.craft_ms());
        let craft_ms = self.craft_ms();
        if let Some(session) = self.session
            && let Ok((_, packet)) = self.craft.seal(craft_ms, session, &Message::Who, &mut buffer)
        {
            let bytes = packet.to_vec();
            self.send(1, bytes);
        }
        let said = self.sent[1][challenges..].to_vec();
        let down = said.iter().filter(|packet| through[1] && self.ground_hears(packet)).count();
        up && down > 0
    }

    fn start(&mut self, side: usize) {
        self.starts[side] += 1;
        self.known[side] = 0;
        let (ground, craft) = ends(self.starts);
        match side {
            0 => self.ground = ground,
            _ => (self.craft, self.session) = (craft, None),
        }
    }

    /// The attacker plays packets, from the ground's address or another.
    fn play(&mut self, from: usize, count: usize, port: u16) {
        for way in [0, 1] {
            for packet in self.sent[way].clone().iter().skip(from).take(count) {
                if way == 0 {
                    self.craft_hears(packet, address(port))
                } else {
                    self.ground_hears(packet)
                };
            }
        }
    }
}

/// Half a second until a ground station notices, a hello and its challenge, a packet each way.
const SOON: usize = 55;

#[derive(Debug, Clone)]
enum Happening {
    /// So many periods, of which these are lost (a bit each, over and over).
    Talk {
        periods: u16,
        lost_up: u8,
        lost_down: u8,
    },
    StartGround,
    StartCraft,
    /// Nothing gets through: what is said meanwhile is withheld.
    Withhold {
        periods: u16,
    },
    Play {
        from: prop::sample::Index,
        count: usize,
        port: u16,
    },
    /// The network is good: how soon do both hear each other?
    Calm,
}

fn happening() -> impl Strategy<Value = Happening> {
    prop_oneof![
        4 => (1_u16..60, any::<u8>(), any::<u8>())
            .prop_map(|(periods, lost_up, lost_down)| Happening::Talk { periods, lost_up, lost_down }),
        2 => Just(Happening::StartGround),
        2 => Just(Happening::StartCraft),
        2 => (1_u16..700).prop_map(|periods| Happening::Withhold { periods }),
        3 => (any::<prop::sample::Index>(), 1_usize..80, 1_u16..3)
            .prop_map(|(from, count, port)| Happening::Play { from, count, port }),
        3 => Just(Happening::Calm),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 200, ..cases(10_000) })]

    #[test]
    #[cfg_attr(miri, ignore = "thousands of tags take an interpreter hours; the other tests here go the same ways")]
    fn no_recording_fits_and_nobody_waits(
        happenings in prop::collection::vec(happening(), 1..10),
        pace in 0.985_f64..1.015,
    ) {
        let mut world = World::new(pace);
        for what in happenings {
            match what {
                Happening::Talk { periods, lost_up, lost_down } => {
                    for k in 0..periods {
                        let bit = 1_u8 << (k % 8);
                        world.exchange([lost_up & bit == 0, lost_down & bit == 0]);
                    }
                }
                Happening::StartGround => world.start(0),
                Happening::StartCraft => world.start(1),
                Happening::Withhold { periods } => {
                    for _ in 0..periods {
                        world.exchange([false; 2]);
                    }
                }
                Happening::Play { from, count, port } => {
                    let longest = world.sent[0].len().max(world.sent[1].len()) + 1;
                    world.play(from.index(longest), count, port);
                }
                Happening::Calm => {
                    let lost = (0..200).take_while(|_| !world.exchange([true; 2])).count();
                    prop_assert!(lost < SOON, "{lost} periods until both heard each other");
                }
            }
        }
        world.play(0, usize::MAX, 1);
    }
}

/// Somebody passes on a ground station's first packets from an address of his own, and so has the session there: the ground's next
/// packet brings it back. Without a key it is his: there, everybody could have made it.
#[test]
fn a_session_that_is_passed_on_comes_back_to_whom_it_is_with() {
    for key in [Some(Key::new([9; 32])), None] {
        let mut ground = GroundEnd::new(3, key.clone(), random(0, 1));
        let mut craft = CraftEnd::new(3, key.clone(), random(0, 2));
        let (mut buffer, mut reply) = ([0; MAX_PACKET_LEN], [0; MAX_PACKET_LEN]);
        let [own, his] = [address(1), address(2)];
        let hello = ground.greet(100, &mut buffer).unwrap();
        let Ok(Heard::Hello(challenge)) = craft.hear(100, his, hello, &mut reply) else { panic!("a hello") };
        assert_eq!(ground.hear(101, challenge), Ok(None));
        let (_, first) = ground.seal(102, &Message::Who, &mut buffer).unwrap();
        assert!(craft.hear(102, own, first, &mut reply).is_err(), "the challenge was for another address");
        let Ok(Heard::Message(opened)) = craft.hear(103, his, first, &mut reply) else { panic!("a message") };
        assert_eq!(craft.peer(opened.session), Some(his));
        let (_, second) = ground.seal(112, &Message::Who, &mut buffer).unwrap();
        let is_heard = craft.hear(112, own, second, &mut reply).is_ok();
        let expected = if key.is_some() { (true, own) } else { (false, his) };
        assert_eq!((is_heard, craft.peer(opened.session)), (expected.0, Some(expected.1)));
    }
}

/// Traffic that was recorded and withheld for longer than it may be old moves nothing, whoever has
/// been restarted since; what is a moment late is taken.
#[test]
fn what_was_withheld_is_refused_by_its_age() {
    for (withheld_ms, taken) in [(500, true), (1800, true), (2000, false), (70_000, false)] {
        let mut world = World::new(1.0);
        while !world.exchange([true; 2]) {}
        world.exchange([false; 2]);
        let late = world.sent[0].last().unwrap().clone();
        world.now_ms += withheld_ms;
        assert_eq!(world.craft_hears(&late, address(1)), taken, "{withheld_ms} ms");
    }
}

/// A craft that is not heard goes on hearing: its ground's packets are new by both clocks, whose
/// paces differ by as much as those of a craft that is out of order.
#[test]
fn a_link_that_works_one_way_works_for_most_of_a_minute() {
    for pace in [0.988, 1.0, 1.012] {
        let mut world = World::new(pace);
        while !world.exchange([true; 2]) {}
        let periods = if cfg!(miri) { 10 } else { 5500 };
        let heard = (0..periods)
            .filter(|_| {
                world.exchange([true, false]);
                world.session.is_some()
            })
            .count();
        let refused = world.craft.statistics.refused;
        assert_eq!((heard, refused), (periods, 0), "{pace}");
    }
}

/// A pose that later packets overtook is taken, once and while it is not old; nothing else is, and nothing that more than 31 overtook.
#[test]
fn only_a_pose_may_be_overtaken() {
    let said = |message: &Message, overtakes: usize, later_ms: u32| {
        let mut world = World::new(1.0);
        while !world.exchange([true; 2]) {}
        let mut buffer = [0; MAX_PACKET_LEN];
        let (_, packet) = world.ground.seal(world.now_ms, message, &mut buffer).unwrap();
        let packet = packet.to_vec();
        for _ in 0..overtakes {
            let (_, next) = world.ground.seal(world.now_ms, &Message::Who, &mut buffer).unwrap();
            let next = Sent { bytes: next.to_vec(), at_ms: world.now_ms, starts: [0; 2] };
            assert!(world.craft_hears(&next, address(1)));
        }
        let before = world.craft.statistics;
        world.now_ms += later_ms;
        let packet = Sent { bytes: packet, at_ms: world.now_ms, starts: [0; 2] };
        let mut reply = [0; MAX_PACKET_LEN];
        let mut hear = |world: &mut World| {
            let now_ms = world.craft_ms();
            match world.craft.hear(now_ms, address(1), &packet.bytes, &mut reply) {
                Ok(Heard::Message(opened)) => opened.is_overtaken && opened.message == *message,
                _ => false,
            }
        };
        let taken = hear(&mut world);
        let counted = world.craft.statistics;
        assert_eq!(counted.accepted - before.accepted, u32::from(taken));
        assert_eq!(before.lost - counted.lost, u32::from(taken), "it is lost no more");
        assert!(!hear(&mut world), "twice");
        taken
    };
    for overtakes in [1, 2, 31] {
        assert!(said(&POSE, overtakes, 0), "{overtakes}");
    }
    assert!(!said(&POSE, 32, 0), "too many overtook it");
    assert!(said(&POSE, 1, 1800) && !said(&POSE, 1, 2000), "by its age");
    for other in [Message::Who, Message::Request(proto::Request::Arm), Message::Command(proto::Command::IDLE)]
    {
        assert!(!said(&other, 1, 0), "{other:?}");
    }
}
