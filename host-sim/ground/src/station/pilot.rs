//! What the pilot can ask for in flight, and what takes two keys.

use proto::State;

/// What the pilot can ask for in flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the words say it")]
pub enum PilotRequest {
    Arm,
    TakeOff,
    Pattern,
    Land,
    Disarm,
    Cut,
    /// Yes to what was just asked back.
    Confirm,
}

/// How long an answer is waited for, us.
const PATIENCE_US: u64 = 3_000_000;

/// Disarming in the air is a fall: it takes a second key, another one, and soon.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Confirmation {
    asked_us: Option<u64>,
}

/// What becomes of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Verdict {
    /// It is done.
    Do(PilotRequest),
    /// Not yet, or not at all; why, for the pilot.
    Wait(&'static str),
}

impl Confirmation {
    /// Judges a request to a craft in this state, if one is known.
    pub(super) fn judge(&mut self, request: PilotRequest, state: Option<State>, now_us: u64) -> Verdict {
        let asked_us = self.asked_us.take();
        let stands = matches!(state, Some(State::Disarmed | State::Armed | State::Cut));
        match request {
            PilotRequest::Disarm if !stands => {
                self.asked_us = Some(now_us);
                Verdict::Wait("disarming in the air is a fall: Y within 3 s does it, l lands")
            }
            PilotRequest::Confirm => match asked_us {
                Some(asked_us) if now_us.saturating_sub(asked_us) <= PATIENCE_US => {
                    Verdict::Do(PilotRequest::Disarm)
                }
                _ => Verdict::Wait("there is nothing to confirm"),
            },
            other => Verdict::Do(other),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use PilotRequest::{Confirm, Cut, Disarm, Land};

    const FLYING: Option<State> = Some(State::Flying);

    #[test]
    fn disarming_in_the_air_takes_another_key_and_soon() {
        for state in [FLYING, Some(State::Hold), Some(State::Land), None] {
            let mut confirmation = Confirmation::default();
            for at_us in [0, 100_000, 200_000] {
                assert!(matches!(confirmation.judge(Disarm, state, at_us), Verdict::Wait(_)), "{state:?}");
            }
            assert_eq!(confirmation.judge(Confirm, state, 3_200_000), Verdict::Do(Disarm));
            assert!(matches!(confirmation.judge(Confirm, state, 3_200_000), Verdict::Wait(_)), "once");
        }
    }

    #[test]
    fn a_late_yes_or_one_after_something_else_is_none() {
        let mut confirmation = Confirmation::default();
        confirmation.judge(Disarm, FLYING, 0);
        assert!(matches!(confirmation.judge(Confirm, FLYING, 3_000_001), Verdict::Wait(_)));
        confirmation.judge(Disarm, FLYING, 0);
        assert_eq!(confirmation.judge(Land, FLYING, 1), Verdict::Do(Land));
        assert!(matches!(confirmation.judge(Confirm, FLYING, 2), Verdict::Wait(_)));
    }

    #[test]
    fn a_craft_that_stands_is_disarmed_at_once_and_a_cut_never_waits() {
        for state in [State::Disarmed, State::Armed, State::Cut] {
            assert_eq!(Confirmation::default().judge(Disarm, Some(state), 0), Verdict::Do(Disarm));
        }
        assert_eq!(Confirmation::default().judge(Cut, FLYING, 0), Verdict::Do(Cut));
    }
}
