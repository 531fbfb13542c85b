//! The state machine: what the craft is doing, and one table of what each condition does in each
//! state.
//!
//! ```text
//! disarmed --arm--> armed --fly--> flying <--> hold --> land --> disarmed
//!     ^               |               |          |        |
//!     +---------------+--- disarm ----+----------+--------+-- cut (from anywhere; only disarm leaves it)
//! ```
//!
//! - *disarmed*, *armed*, *cut*: motors idle. *flying*: the pilot's command. *hold*: stay in place.
//!   *land*: descend in place.
//! - Of several conditions the most severe action wins: disarm (on request), cut, stand down, land,
//!   hold, fly, arm.
//! - Hold goes back to flying by itself once nothing asks for it any more; the detectors make sure
//!   that this takes good data for a while. A landing never goes back up. Cut is latched. Only a
//!   request arms, and only with all preflight checks good.
//!
//! The machine is pure: `next(state, conditions)`. Time is in the
//! detectors (`safety/detectors.rs`).

use crate::safety::conditions::{Condition, Conditions};

/// What the craft is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u8)]
pub enum State {
    /// Motors idle, commands ignored.
    #[default]
    Disarmed = 0,
    /// Motors idle; a command without cut-off takes off.
    Armed = 1,
    /// The pilot's command is flown.
    Flying = 2,
    /// The place (or, without poses, the attitude) is held.
    Hold = 3,
    /// Descending in place.
    Land = 4,
    /// Motors idle until the craft is disarmed.
    Cut = 5,
}

impl State {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 6] = [Self::Disarmed, Self::Armed, Self::Flying, Self::Hold, Self::Land, Self::Cut];

    /// Do the motors idle?
    pub const fn motors_idle(self) -> bool {
        matches!(self, Self::Disarmed | Self::Armed | Self::Cut)
    }
}

/// What a condition asks for; a later one is more severe.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Action {
    /// Nothing.
    Stay,
    /// To [`State::Armed`].
    Arm,
    /// To [`State::Flying`].
    Fly,
    /// To [`State::Hold`].
    Hold,
    /// To [`State::Land`].
    Land,
    /// To [`State::Disarmed`], because there is no reason left to fly.
    Stand,
    /// To [`State::Cut`].
    Cut,
    /// To [`State::Disarmed`], on request.
    Disarm,
}

/// The table: for each condition the action in [`State::ALL`]: disarmed, armed, flying, hold, land,
/// cut.
#[rustfmt::skip]
pub const TABLE: [(Condition, [Action; 6]); Condition::ALL.len()] = {
    use Action::{Arm, Cut, Disarm, Fly, Hold, Land, Stand, Stay};
    use Condition as C;
    [
        //                       disarmed armed  flying  hold    land    cut
        (C::ArmRequested,       [Arm,    Stay,   Stay,   Stay,   Stay,   Stay]),
        (C::FlightRequested,    [Stay,   Fly,    Stay,   Stay,   Stay,   Stay]),
        (C::DisarmRequested,    [Disarm, Disarm, Disarm, Disarm, Disarm, Disarm]),
        (C::LandRequested,      [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::CutRequested,       [Cut,    Cut,    Cut,    Cut,    Cut,    Stay]),
        (C::Landed,             [Stay,   Stay,   Stay,   Stay,   Stand,  Stay]),
        (C::LinkLate,           [Stay,   Stand,  Hold,   Hold,   Stay,   Stay]),
        (C::LinkLost,           [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::PoseLate,           [Stay,   Stand,  Hold,   Hold,   Stay,   Stay]),
        (C::PoseLost,           [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::PoseGone,           [Stay,   Stand,  Cut,    Cut,    Cut,    Stay]),
        (C::PoseFrozen,         [Stay,   Stay,   Stay,   Stay,   Stay,   Stay]),
        (C::PoseJumped,         [Stay,   Stay,   Stay,   Stay,   Stay,   Stay]),
        (C::ImuLate,            [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::ImuStuck,           [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::ImuDisagrees,       [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::ImuGone,            [Stay,   Stand,  Cut,    Cut,    Cut,    Stay]),
        (C::BatteryLow,         [Stay,   Stand,  Stay,   Stay,   Stay,   Stay]),
        (C::BatteryCritical,    [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::BatteryEmpty,       [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::Tilted,             [Stay,   Stand,  Cut,    Cut,    Cut,    Stay]),
        (C::OutsideFence,       [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::ThrustLost,         [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::ClockJumped,        [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::LoopOverrun,        [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::NotANumber,         [Stay,   Stand,  Land,   Land,   Cut,    Stay]),
        (C::OutputsFailed,      [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::IdleForLong,        [Stay,   Stand,  Stay,   Stay,   Stay,   Stay]),
        (C::Crashed,            [Stay,   Stand,  Cut,    Cut,    Cut,    Stay]),
        (C::MotorFailed,        [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::Vibrating,          [Stay,   Stand,  Land,   Land,   Stay,   Stay]),
        (C::PoseOld,            [Stay,   Stay,   Stay,   Stay,   Stay,   Stay]),
    ]
};

/// The table of one state, transposed: the conditions that ask for each action.
struct Row {
    any: u32,
    disarm: u32,
    cut: u32,
    stand: u32,
    land: u32,
    hold: u32,
    fly: u32,
}

const fn row(state: State) -> Row {
    let mut row = Row { any: 0, disarm: 0, cut: 0, stand: 0, land: 0, hold: 0, fly: 0 };
    let mut rest: &[(Condition, [Action; 6])] = &TABLE;
    while let [(condition, [disarmed, armed, flying, hold, land, cut]), others @ ..] = rest {
        let action = match state {
            State::Disarmed => *disarmed,
            State::Armed => *armed,
            State::Flying => *flying,
            State::Hold => *hold,
            State::Land => *land,
            State::Cut => *cut,
        };
        let bit = condition.bit();
        match action {
            Action::Stay => {}
            Action::Arm => {}
            Action::Fly => row.fly |= bit,
            Action::Hold => row.hold |= bit,
            Action::Land => row.land |= bit,
            Action::Stand => row.stand |= bit,
            Action::Cut => row.cut |= bit,
            Action::Disarm => row.disarm |= bit,
        }
        if !matches!(action, Action::Stay) {
            row.any |= bit;
        }
        rest = others;
    }
    row
}

static ROWS: [Row; 6] = [
    row(State::Disarmed),
    row(State::Armed),
    row(State::Flying),
    row(State::Hold),
    row(State::Land),
    row(State::Cut),
];

/// The most severe of what the conditions ask for in a state.
#[inline]
pub fn action(state: State, conditions: Conditions) -> Action {
    let [disarmed, armed, flying, hold, land, cut] = &ROWS;
    let row = match state {
        State::Disarmed => disarmed,
        State::Armed => armed,
        State::Flying => flying,
        State::Hold => hold,
        State::Land => land,
        State::Cut => cut,
    };
    if conditions.bits() & row.any == 0 { Action::Stay } else { severest(row, conditions.bits()) }
}

/// The most severe action that some condition asks for.
#[cold]
fn severest(row: &Row, bits: u32) -> Action {
    let by_severity = [
        (row.disarm, Action::Disarm),
        (row.cut, Action::Cut),
        (row.stand, Action::Stand),
        (row.land, Action::Land),
        (row.hold, Action::Hold),
        (row.fly, Action::Fly),
    ];
    by_severity.into_iter().find(|(mask, _)| bits & mask != 0).map_or(Action::Arm, |(_, action)| action)
}

/// The state after this one.
#[inline]
pub fn next(state: State, conditions: Conditions) -> State {
    match action(state, conditions) {
        Action::Stay if matches!(state, State::Hold) => State::Flying,
        Action::Stay => state,
        Action::Arm => State::Armed,
        Action::Fly => State::Flying,
        Action::Hold => State::Hold,
        Action::Land => State::Land,
        Action::Cut => State::Cut,
        Action::Stand | Action::Disarm => State::Disarmed,
    }
}

#[cfg(test)]
mod tests {
    //! The machine against rules written a second time, in other words and the other way round: by
    //! state, from what must be true of a safe craft, not from the table.

    use super::*;
    use Condition as C;

    fn any(set: Conditions, of: &[Condition]) -> bool {
        of.iter().any(|c| set.has(*c))
    }

    /// Dangers in three grades.
    const STOP: [Condition; 4] = [C::PoseGone, C::ImuGone, C::Tilted, C::Crashed];
    const DOWN: [Condition; 15] = [
        C::LinkLost,
        C::PoseLost,
        C::ImuLate,
        C::ImuStuck,
        C::ImuDisagrees,
        C::BatteryCritical,
        C::BatteryEmpty,
        C::OutsideFence,
        C::ThrustLost,
        C::ClockJumped,
        C::LoopOverrun,
        C::NotANumber,
        C::OutputsFailed,
        C::MotorFailed,
        C::Vibrating,
    ];
    const WAIT: [Condition; 2] = [C::LinkLate, C::PoseLate];

    fn by_the_rules(state: State, set: Conditions) -> State {
        if set.has(C::DisarmRequested) {
            return State::Disarmed;
        }
        if state == State::Cut || set.has(C::CutRequested) {
            return State::Cut;
        }
        let (stop, down, wait) = (any(set, &STOP), any(set, &DOWN), any(set, &WAIT));
        match state {
            State::Disarmed => {
                if set.has(C::ArmRequested) {
                    State::Armed
                } else {
                    State::Disarmed
                }
            }
            State::Armed => {
                if stop || down || wait || any(set, &[C::BatteryLow, C::LandRequested, C::IdleForLong]) {
                    State::Disarmed
                } else if set.has(C::FlightRequested) {
                    State::Flying
                } else {
                    State::Armed
                }
            }
            State::Flying | State::Hold => {
                if stop {
                    State::Cut
                } else if down || set.has(C::LandRequested) {
                    State::Land
                } else if wait {
                    State::Hold
                } else {
                    State::Flying
                }
            }
            State::Land => {
                if stop || set.has(C::NotANumber) {
                    State::Cut
                } else if set.has(C::Landed) {
                    State::Disarmed
                } else {
                    State::Land
                }
            }
            State::Cut => unreachable!(),
        }
    }

    /// Conditions with the same row of the table, together.
    fn classes() -> Vec<Vec<Condition>> {
        let mut classes: Vec<([Action; 6], Vec<Condition>)> = Vec::new();
        for (condition, row) in TABLE {
            match classes.iter_mut().find(|(of, _)| *of == row) {
                Some((_, class)) => class.push(condition),
                None => classes.push((row, vec![condition])),
            }
        }
        classes.into_iter().map(|(_, class)| class).collect()
    }

    /// The generator of Steele, Lea and Flood (SplitMix64).
    fn scrambled(k: u64) -> u64 {
        let a = (k ^ k >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let b = (a ^ a >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        b ^ b >> 31
    }

    fn follows_the_rules(state: State, set: Conditions) {
        let got = next(state, set);
        assert!(got == by_the_rules(state, set), "{state:?} {:?}: {got:?}", set.iter().collect::<Vec<_>>());
    }

    /// Every state with every combination of rows of the table, each row by each of the conditions
    /// that have it and by several of them; and 10^7 sets of any conditions, few and many.
    #[test]
    fn every_state_with_every_set_of_conditions() {
        let classes = classes();
        assert!((8..=16).contains(&classes.len()), "{}: the combinations can be counted", classes.len());
        // An interpreter is ten thousand times slower.
        let every = if cfg!(miri) { 4001 } else { 1 };
        for state in State::ALL {
            for combination in (0_u64..1 << classes.len()).step_by(every) {
                for draw in 0..20 {
                    let of_class = |(k, class): (usize, &Vec<Condition>)| {
                        let others = scrambled(combination << 16 | draw << 8 | k as u64);
                        let member = class[draw as usize % class.len()].bit();
                        let more = class.iter().map(|c| c.bit()).sum::<u32>() & others as u32;
                        if combination & 1 << k == 0 {
                            0
                        } else {
                            member | if draw % 2 == 0 { 0 } else { more }
                        }
                    };
                    let bits = classes.iter().enumerate().map(of_class).sum();
                    follows_the_rules(state, Conditions::from_bits(bits));
                }
            }
        }
        for k in (0_u64..10_000_000).step_by(10 * every - 9) {
            let (bits, thin) = (scrambled(2 * k), scrambled(2 * k + 1));
            let few = (bits >> 32) & thin & (thin >> 32);
            let set = Conditions::from_bits(if k % 2 == 0 { bits } else { few } as u32);
            follows_the_rules(State::ALL[(k % 6) as usize], set);
        }
    }

    /// The order of actions is their severity, and each row of the table is its condition's.
    #[test]
    fn the_most_severe_wins() {
        for state in State::ALL {
            for (a, first) in TABLE {
                for (b, second) in TABLE {
                    let want = first[state as usize].max(second[state as usize]);
                    assert_eq!(
                        action(state, Conditions::from_bits(a.bit() | b.bit())),
                        want,
                        "{state:?} {a:?} {b:?}"
                    );
                }
            }
        }
        assert_eq!(TABLE.map(|(condition, _)| condition), Condition::ALL);
    }

    #[test]
    fn motors_turn_where_something_is_flown() {
        let turning = State::ALL.map(|state| !state.motors_idle());
        assert_eq!(turning, [false, false, true, true, true, false]);
    }

    #[test]
    fn cut_is_left_by_disarm_alone() {
        for condition in Condition::ALL.into_iter().filter(|c| *c != C::DisarmRequested) {
            assert_eq!(next(State::Cut, Conditions::from_bits(condition.bit())), State::Cut);
        }
        let all = Conditions::from_bits(!C::DisarmRequested.bit());
        assert_eq!(next(State::Cut, all), State::Cut);
        assert_eq!(next(State::Cut, Conditions::from_bits(u32::MAX)), State::Disarmed);
    }

    #[test]
    fn nothing_but_a_request_arms() {
        for k in (0..4_000_000).step_by(if cfg!(miri) { 40_009 } else { 1 }) {
            let without = Conditions::from_bits(scrambled(k) as u32 & !C::ArmRequested.bit());
            let next = next(State::Disarmed, without);
            assert!(next == State::Disarmed || next == State::Cut);
        }
    }
}
