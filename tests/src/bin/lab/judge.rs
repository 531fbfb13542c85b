//! Judging answers to difficult flights and logs, where not to know can be the right answer.

use std::collections::BTreeMap;

use model::Effect;
use serde::Serialize;

use crate::trial::{ADEQUATE, GUSTS, NOT_IDENTIFIED, Outcome, UNEXPLAINED};

/// What kind of answer it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Class {
    /// What is hidden, or that nothing is.
    Right,
    /// That these flights do not tell, or a refusal that names the difficulty.
    Honest,
    /// Something is missing, not known what.
    Unexplained,
    /// Nothing missing where something is, or only what the condition itself is.
    Missed,
    /// An effect that is not there.
    WrongName,
    /// A refusal that says something else.
    NoAnswer,
}

impl Class {
    pub(crate) const ALL: [Self; 6] =
        [Self::Right, Self::Honest, Self::Unexplained, Self::Missed, Self::WrongName, Self::NoAnswer];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::Honest => "honest",
            Self::Unexplained => "unexplained",
            Self::Missed => "missed",
            Self::WrongName => "wrong name",
            Self::NoAnswer => "no answer",
        }
    }

    fn of(outcome: &Outcome) -> Self {
        match outcome.answer.as_str() {
            _ if outcome.is_right() => Self::Right,
            NOT_IDENTIFIED => Self::Honest,
            UNEXPLAINED => Self::Unexplained,
            ADEQUATE => Self::Missed,
            _ if outcome.names_the_condition() => Self::Missed,
            answer if answer == GUSTS || Effect::from_id(answer).is_some() => Self::WrongName,
            refusal if outcome.trial.condition.is_some_and(|c| c.is_named_in(refusal)) => Self::Honest,
            _ => Self::NoAnswer,
        }
    }
}

/// The answers under one condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct ConditionScore {
    pub(crate) condition: String,
    pub(crate) trials: usize,
    pub(crate) classes: BTreeMap<Class, usize>,
    /// Wrong names, and refusals that name something else.
    pub(crate) wrong_answers: BTreeMap<String, usize>,
}

impl ConditionScore {
    /// Answers of a class.
    pub(crate) fn of(&self, class: Class) -> usize {
        self.classes.get(&class).copied().unwrap_or(0)
    }
}

/// One score a condition, in the order of the trials.
pub(crate) fn conditions(outcomes: &[Outcome]) -> Vec<ConditionScore> {
    let mut scores: Vec<ConditionScore> = Vec::new();
    for outcome in outcomes {
        let Some(condition) = outcome.trial.condition.map(|condition| condition.name()) else { continue };
        if scores.last().is_none_or(|last| last.condition != condition) {
            let (classes, wrong_answers) = Default::default();
            scores.push(ConditionScore { condition, trials: 0, classes, wrong_answers });
        }
        let Some(score) = scores.last_mut() else { continue };
        let class = Class::of(outcome);
        score.trials += 1;
        *score.classes.entry(class).or_default() += 1;
        if matches!(class, Class::WrongName | Class::NoAnswer) {
            *score.wrong_answers.entry(outcome.answer.clone()).or_default() += 1;
        }
    }
    scores
}

#[cfg(test)]
mod tests {
    use stories::world::{Size, Style};

    use super::*;
    use crate::condition::Condition;
    use crate::plan::{Hidden, Trial};

    fn outcome(condition: Condition, hidden: Hidden, answer: &str) -> Outcome {
        let trial = Trial {
            hidden,
            strength: 0.75,
            noise: 1.0,
            size: Size::F330,
            seed: 1,
            duration_s: 24.0,
            rounds: 1,
            predicts: false,
            style: Style::Usual,
            rough: false,
            outliers: false,
            condition: Some(condition),
        };
        Outcome::failed(&trial, answer.into())
    }

    fn class(condition: Condition, hidden: Hidden, answer: &str) -> Class {
        Class::of(&outcome(condition, hidden, answer))
    }

    #[test]
    fn answers_are_right_honest_missing_or_wrong() {
        let hidden = || Hidden::One("ground-effect");
        let slow = Condition::LoggedAt(25);
        assert_eq!(class(slow, hidden(), "ground-effect"), Class::Right);
        assert_eq!(class(slow, Hidden::Nothing, "adequate"), Class::Right);
        assert_eq!(class(slow, hidden(), "adequate"), Class::Missed);
        assert_eq!(class(slow, hidden(), "not-identified"), Class::Honest);
        assert_eq!(class(slow, Hidden::Nothing, "unexplained"), Class::Unexplained);
        assert_eq!(class(slow, Hidden::Nothing, "input-delay"), Class::WrongName);
        assert_eq!(class(slow, hidden(), "A: under-sampled: 25 Hz"), Class::Honest);
        assert_eq!(class(slow, hidden(), "A: z points up"), Class::NoAnswer);
    }

    #[test]
    fn a_condition_that_is_an_effect_may_be_named_if_what_is_hidden_follows() {
        let wind = Condition::WindBetweenFlights;
        assert_eq!(class(wind, Hidden::Nothing, "steady-wind"), Class::Right);
        let mut told = outcome(wind, Hidden::One("ground-effect"), "steady-wind");
        assert_eq!(Class::of(&told), Class::Missed);
        told.found = vec!["steady-wind", "ground-effect"];
        assert_eq!(Class::of(&told), Class::Right);
        let wanders = Condition::WanderingWind;
        assert_eq!(class(wanders, Hidden::Nothing, "gusts"), Class::Right);
        assert_eq!(class(wanders, Hidden::One("ground-effect"), "gusts"), Class::Missed);
        assert_eq!(class(Condition::Gaps, Hidden::Nothing, "gusts"), Class::WrongName);
        let inertia = Condition::ProductOfInertia;
        assert_eq!(class(inertia, Hidden::Nothing, "product-of-inertia"), Class::Right);
        assert_eq!(class(inertia, Hidden::Nothing, "adequate"), Class::Missed);
    }

    #[test]
    fn counts_are_those_of_each_condition() {
        let outcomes = [
            outcome(Condition::Gaps, Hidden::Nothing, "adequate"),
            outcome(Condition::Gaps, Hidden::Nothing, "tether"),
            outcome(Condition::Short, Hidden::Nothing, "unexplained"),
        ];
        let [gaps, short] = &conditions(&outcomes)[..] else { panic!("two conditions") };
        assert_eq!((gaps.trials, gaps.of(Class::Right), gaps.of(Class::WrongName)), (2, 1, 1));
        assert_eq!(gaps.wrong_answers["tether"], 1);
        assert_eq!((short.trials, short.of(Class::Unexplained)), (1, 1));
    }
}
