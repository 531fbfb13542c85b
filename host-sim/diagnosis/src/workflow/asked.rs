//! What the flights held out were asked, and what they answered: each further question could be answered by chance.

use model::Axis;

use crate::Addition;
use crate::criteria::HELD_OUT_SIGNIFICANCE;

/// Forms of an axis that the flights held out are asked of at most.
const MOST_QUESTIONS: usize = 2;

/// What the flights held out were asked of an axis: whether a form of so many numbers predicts them.
pub(super) struct Asked {
    pub(super) axis: Axis,
    pub(super) numbers: usize,
}

/// How many questions the flights held out are asked of some axes once they are asked of a form of so many numbers. Two are too many
/// unless this one is simpler: what is fitted to the one flight that shows it may go astray in others, where something simpler does not.
pub(super) fn questions(axes: &[Axis], numbers: usize, asked: &[Asked]) -> Option<usize> {
    let of = |axis: &Axis| asked.iter().filter(|before| before.axis == *axis).count();
    let questions = 1 + axes.iter().map(of).max().unwrap_or(0);
    let is_simpler = asked.iter().filter(|one| axes.contains(&one.axis)).all(|one| numbers < one.numbers);
    (questions <= MOST_QUESTIONS && is_simpler).then_some(questions)
}

/// Whether a form is borne out by flights held out that were asked so many questions (Bonferroni).
pub(super) fn holds(addition: &Addition, questions: usize) -> bool {
    let is_enough = |p_value: f64| p_value < HELD_OUT_SIGNIFICANCE / questions as f64;
    addition.finding.supported && (questions == 1 || addition.finding.held_out_p_value.is_some_and(is_enough))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flights_held_out_are_asked_twice_of_an_axis_and_the_second_time_of_something_simpler() {
        let vertical: &[Axis] = &[Axis::W];
        let forces: &[Axis] = &[Axis::U, Axis::V, Axis::W];
        assert_eq!(questions(vertical, 5, &[]), Some(1));
        let once = [Asked { axis: Axis::W, numbers: 5 }];
        assert_eq!(questions(vertical, 3, &once), Some(2));
        assert_eq!(questions(forces, 3, &once), Some(2), "one of its axes was asked");
        assert_eq!(questions(vertical, 5, &once), None, "it is no simpler");
        assert_eq!(questions(&[Axis::P], 7, &once), Some(1), "another axis");
        let twice = [Asked { axis: Axis::W, numbers: 5 }, Asked { axis: Axis::W, numbers: 3 }];
        assert_eq!(questions(vertical, 2, &twice), None);
    }
}
