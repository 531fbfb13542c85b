//! Both ends of a link with a key, killed and started anew in the middle of whatever they do, on a
//! network that loses packets and an attacker who sends again what he has recorded.
//!
//! Whatever happens: no number is sent twice, no packet is accepted twice, and when the network is
//! good again both sides hear each other at once. How a store behaves is as on a craft (beside the
//! loop, so numbers are there only some packets later) or as on the ground (waited for).

use std::collections::HashSet;

use proptest::prelude::*;
use proto::{Identity, Key, MAX_PACKET_LEN, Message, Opener, Refused, Role, Sealer, State};

/// Packets that a side sends while its store is at work.
const STORING: u32 = 3;

/// What is left of a side when it is killed.
#[derive(Default)]
struct Disk {
    sent: u64,
    heard: u64,
}

struct End {
    role: Role,
    disk: Disk,
    sealer: Sealer,
    opener: Opener,
    /// The store is waited for.
    waits: bool,
    /// Numbers that are being stored, and for how many packets more.
    under_way: Option<(u32, Option<u64>, Option<u64>)>,
    introduce: bool,
}

fn other(role: Role) -> Role {
    match role {
        Role::Ground => Role::Craft,
        Role::Craft => Role::Ground,
    }
}

impl End {
    fn start(role: Role, disk: Disk) -> Self {
        let key = Key::new([9; 32]);
        let sealer = Sealer::authenticated(role, 3, key.clone(), disk.sent);
        let opener = Opener::authenticated(other(role), 3, key, disk.heard);
        let mut end = Self {
            role,
            disk,
            sealer,
            opener,
            waits: role == Role::Ground,
            under_way: None,
            introduce: role == Role::Craft,
        };
        end.store();
        end
    }

    fn killed(self) -> Self {
        Self::start(self.role, self.disk)
    }

    /// All that has to be stored is.
    fn store(&mut self) {
        let wanted = (self.sealer.counter.to_reserve(), self.opener.guard.to_reserve());
        self.stored(wanted.0, wanted.1);
    }

    fn stored(&mut self, sent: Option<u64>, heard: Option<u64>) {
        if let Some(number) = sent {
            assert!(number > self.disk.sent, "stored numbers grow");
            self.disk.sent = number;
            self.sealer.counter.reserved(number);
        }
        if let Some(number) = heard {
            assert!(number > self.disk.heard, "stored numbers grow");
            self.disk.heard = number;
            self.opener.guard.reserved(number);
        }
    }

    fn keep(&mut self) {
        if self.waits {
            return self.store();
        }
        match &mut self.under_way {
            Some((left @ 1.., ..)) => *left -= 1,
            Some((0, sent, heard)) => {
                let (sent, heard) = (*sent, *heard);
                self.under_way = None;
                self.stored(sent, heard);
            }
            None => {
                let wanted = (self.sealer.counter.to_reserve(), self.opener.guard.to_reserve());
                if wanted != (None, None) {
                    self.under_way = Some((STORING, wanted.0, wanted.1));
                }
            }
        }
    }

    /// The next packet and its number, unless numbers are wanting.
    fn speak(&mut self) -> Option<(u64, Vec<u8>)> {
        self.keep();
        let message = match std::mem::take(&mut self.introduce) {
            true => Message::Identity(Identity {
                versions: [1, 2],
                program: [0, 1, 0],
                vehicle_sha256: [0; 32],
                accepts_from: self.opener.guard.accepts_from(),
                state: State::Disarmed,
            }),
            false => Message::Who,
        };
        let mut buffer = [0; MAX_PACKET_LEN];
        self.sealer.seal(&message, &mut buffer).ok().map(|(number, packet)| (number, packet.to_vec()))
    }

    /// Was it accepted?
    fn hear(&mut self, packet: &[u8]) -> bool {
        let mut outcome = self.opener.unseal(packet);
        if self.waits && outcome == Err(Refused::NotReserved) {
            self.store();
            outcome = self.opener.unseal(packet);
        }
        match &outcome {
            Ok((_, message)) => {
                self.sealer.follow(&mut self.opener);
                if let Message::Identity(identity) = message {
                    self.sealer.counter.skip_to(identity.accepts_from);
                }
            }
            Err(Refused::Replayed { .. }) => self.introduce = self.role == Role::Craft,
            Err(_) => {}
        }
        self.keep();
        outcome.is_ok()
    }
}

/// A link and everything that was ever sent over it.
struct World {
    ground: End,
    craft: End,
    /// The last number sent to the craft and to the ground.
    last: [Option<u64>; 2],
    /// All that they accepted.
    accepted: [HashSet<Vec<u8>>; 2],
}

impl World {
    fn new() -> Self {
        Self {
            ground: End::start(Role::Ground, Disk::default()),
            craft: End::start(Role::Craft, Disk::default()),
            last: [None; 2],
            accepted: [HashSet::new(), HashSet::new()],
        }
    }

    /// A packet each way, as far as they come through; which was accepted: the one up, the one
    /// down.
    fn exchange(&mut self, through: [bool; 2]) -> [bool; 2] {
        [0, 1].map(|way| {
            let (from, to) = match way {
                0 => (&mut self.ground, &mut self.craft),
                _ => (&mut self.craft, &mut self.ground),
            };
            let Some((number, packet)) = from.speak() else { return false };
            assert!(self.last[way].replace(number) < Some(number), "{number} sent twice");
            let accepted = through[way] && to.hear(&packet);
            if accepted {
                self.accepted[way].insert(packet);
            }
            accepted
        })
    }

    /// How many exchanges it takes until both sides hear each other in each of ten in a row.
    fn until_heard(&mut self) -> usize {
        let mut good = 0;
        for count in 1..=200 {
            good = if self.exchange([true; 2]) == [true; 2] { good + 1 } else { 0 };
            if good == 10 {
                return count - 10;
            }
        }
        panic!("not in 200 packets each way");
    }

    /// The attacker plays everything again that was accepted.
    fn replay(&mut self) {
        for (to, accepted) in [&mut self.craft, &mut self.ground].into_iter().zip(&self.accepted) {
            for packet in accepted {
                assert!(!to.hear(packet), "a recorded packet was accepted");
            }
        }
    }
}

/// Storing twice (the limit of what is heard, then the numbers ahead), two ways, and one packet to
/// hear of it: less than twenty packets each way are lost. At a hundred a second that is a fifth of
/// a second.
const SOON: usize = 20;

#[derive(Debug, Clone)]
enum Happening {
    /// So many packets each way, of which these are lost (a bit each, over and over).
    Talk {
        packets: u16,
        lost_up: u8,
        lost_down: u8,
    },
    KillGround,
    KillCraft,
    Replay,
    /// The network is good: how soon do both hear each other?
    Calm,
}

fn happening() -> impl Strategy<Value = Happening> {
    prop_oneof![
        4 => (1_u16..1500, any::<u8>(), any::<u8>())
            .prop_map(|(packets, lost_up, lost_down)| Happening::Talk { packets, lost_up, lost_down }),
        3 => Just(Happening::KillGround),
        3 => Just(Happening::KillCraft),
        1 => Just(Happening::Replay),
        4 => Just(Happening::Calm),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn nothing_comes_twice_and_nobody_waits(happenings in prop::collection::vec(happening(), 1..12)) {
        let mut world = World::new();
        for what in happenings {
            match what {
                Happening::Talk { packets, lost_up, lost_down } => {
                    for k in 0..packets {
                        let bit = 1_u8 << (k % 8);
                        world.exchange([lost_up & bit == 0, lost_down & bit == 0]);
                    }
                }
                Happening::KillGround => world.ground = replace(&mut world.ground).killed(),
                Happening::KillCraft => world.craft = replace(&mut world.craft).killed(),
                Happening::Replay => world.replay(),
                Happening::Calm => {
                    let lost = world.until_heard();
                    prop_assert!(lost < SOON, "{lost} packets until both heard each other");
                }
            }
        }
        world.replay();
    }
}

/// Takes an end out of its place; what is left there is thrown away.
fn replace(end: &mut End) -> End {
    let role = end.role;
    std::mem::replace(end, End::start(role, Disk::default()))
}
