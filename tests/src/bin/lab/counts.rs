//! Answers that have to be right so many times (the book's list of tests, "Identification and diagnosis").

use std::fmt;

use crate::plan::Hidden;
use crate::score::Share;
use crate::trial::{ADEQUATE, NOT_IDENTIFIED, Outcome, UNEXPLAINED};

/// Of trials that hide an effect, it is named first in so many percent.
const FIRST_PERCENT: f64 = 90.0;
/// Part of the error of prediction.
const HALF: f64 = 0.5;
/// In so many percent the error of prediction falls to a half with it, of trials in which it does so with the true coefficients: in others,
/// it is less than half of the error. What acts in yaw or close to the floor alone often is, or moves what is seen and not what flies.
const HALVED_PERCENT: f64 = 90.0;
/// In so many percent of all trials that hide an effect, the true coefficients halve the error: else the question above asks little.
const WORTH_PERCENT: f64 = 80.0;
/// Of trials that hide nothing, at most so many percent name something.
const NAMED_PERCENT: f64 = 5.0;
/// Of pairs, both are among the first four, or told to be inseparable, in so many percent.
const PAIRS_PERCENT: f64 = 90.0;
/// How far down the ranking both of a pair may stand.
const PAIR_RANK: usize = 4;

/// A count and what it has to be.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Count {
    what: String,
    share: Share,
    /// Percent, and whether that is the most it may be (else the least).
    bound: (f64, bool),
}

impl Count {
    /// Whether it is as it has to be.
    pub(crate) fn holds(&self) -> bool {
        let (percent, is_most) = self.bound;
        let share = self.share.percent();
        if is_most { share <= percent } else { share >= percent }
    }
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (percent, is_most) = self.bound;
        let [mark, word] =
            [if self.holds() { "holds " } else { "MISSED" }, if is_most { "most" } else { "least" }];
        write!(f, "{mark} {}: {} ({percent:.0} % at {word})", self.what, self.share)
    }
}

/// All that is asked of these outcomes.
pub(crate) fn of(outcomes: &[Outcome]) -> Vec<Count> {
    let mut counts = Vec::new();
    let mut count = |what: String, of: &[&Outcome], hit: fn(&Outcome) -> bool, bound: (f64, bool)| {
        if !of.is_empty() {
            counts.push(Count { what, share: Share::of(of.iter().copied(), hit), bound });
        }
    };
    let mut effects: Vec<&'static str> = Vec::new();
    for outcome in outcomes {
        if let Hidden::One(id) = outcome.trial.hidden {
            effects.push(id);
        }
    }
    effects.dedup();
    for id in effects {
        let own: Vec<_> = outcomes.iter().filter(|outcome| outcome.trial.hidden == Hidden::One(id)).collect();
        count(format!("{id} is named first"), &own, Outcome::is_right, (FIRST_PERCENT, false));
        // Where the effect cannot be added, nobody knows what it is worth: that counts against it.
        let is_asked = |outcome: &&Outcome| outcome.error_left_by_truth.is_none_or(|left| left <= HALF);
        let asked: Vec<_> = own.iter().copied().filter(is_asked).collect();
        let what = format!(
            "{id} halves the error of prediction where the truth does, in {} of {}",
            asked.len(),
            own.len()
        );
        count(what, &asked, halves, (HALVED_PERCENT, false));
    }
    let single: Vec<_> = outcomes.iter().filter(|o| matches!(o.trial.hidden, Hidden::One(_))).collect();
    let truth_halves = |o: &Outcome| o.error_left_by_truth.is_some_and(|left| left <= HALF);
    count("the truth halves the error of prediction".into(), &single, truth_halves, (WORTH_PERCENT, false));
    let hides = |is: fn(&Hidden) -> bool| outcomes.iter().filter(|o| is(&o.trial.hidden)).collect::<Vec<_>>();
    let nothing = hides(|hidden| *hidden == Hidden::Nothing);
    count("something is named where nothing is missing".into(), &nothing, names, (NAMED_PERCENT, true));
    let pairs = hides(|hidden| matches!(hidden, Hidden::Together(_)));
    count(
        "both of a pair are among the first four or told to be inseparable".into(),
        &pairs,
        has_both,
        (PAIRS_PERCENT, false),
    );
    counts
}

fn halves(outcome: &Outcome) -> bool {
    outcome.error_left.is_some_and(|left| left <= HALF)
}

/// Whether an effect is named.
fn names(outcome: &Outcome) -> bool {
    ![ADEQUATE, UNEXPLAINED, NOT_IDENTIFIED].contains(&outcome.answer.as_str())
}

/// Whether each that is hidden stands high, or cannot be told from the first that does.
fn has_both(outcome: &Outcome) -> bool {
    let planted = outcome.trial.planted();
    let stands = |id: &str| outcome.planted.iter().any(|of| of.effect == id && of.rank <= PAIR_RANK);
    let is_told = |id: &str| outcome.confounded_with.contains(&id);
    planted.iter().any(|(id, _)| stands(id)) && planted.iter().all(|(id, _)| stands(id) || is_told(id))
}
