//! Why a craft that is asked to arm does not.

use control::Preflight;
use proto::State;

/// Preflight checks while the craft is asked to arm: one that comes and goes counts as failed too.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct PreflightHistory {
    count: u32,
    /// How often each failed, in the order of [`Preflight::NAMES`].
    missing: [u32; Preflight::NAMES.len()],
}

impl PreflightHistory {
    pub(super) fn look(&mut self, preflight: u16) {
        self.count += 1;
        for (missing, (bit, _)) in self.missing.iter_mut().zip(Preflight::NAMES) {
            *missing += u32::from(preflight & bit == 0);
        }
    }

    /// Why it does not arm, for people.
    pub(super) fn why(&self, state: State) -> String {
        if state == State::Cut {
            return "the craft was cut: disarm it first".into();
        }
        let mut names: Vec<_> =
            self.missing.iter().zip(Preflight::NAMES).filter(|(missing, _)| **missing > 0).collect();
        names.sort_by_key(|(missing, _)| std::cmp::Reverse(*missing));
        let said: Vec<_> = names
            .into_iter()
            .map(|(missing, (_, name))| match 100 * missing / self.count.max(1) {
                100 => name.to_owned(),
                percent => format!("{name} ({} % of the time)", percent.max(1)),
            })
            .collect();
        match said.as_slice() {
            [] => "its checks pass, and it does not arm: do packets reach it?".into(),
            names => format!("the craft refuses, these checks fail: {}", names.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checks_are_named_with_their_share_of_the_time_worst_first() {
        let all = Preflight::ALL.bits();
        let [(first, first_name), (second, second_name), ..] = Preflight::NAMES;
        let mut history = PreflightHistory::default();
        for k in 0..8 {
            history.look(if k == 0 { all & !first & !second } else { all & !second });
        }
        let why = history.why(State::Disarmed);
        assert!(why.ends_with(&format!("{second_name}, {first_name} (12 % of the time)")), "{why}");
        assert!(history.why(State::Cut).contains("disarm it first"));
        let mut good = PreflightHistory::default();
        good.look(all);
        assert!(good.why(State::Disarmed).contains("packets"));
    }
}
