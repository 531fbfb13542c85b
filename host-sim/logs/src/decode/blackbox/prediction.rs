//! What the numbers of a frame are differences from.

use std::ops::Range;

use super::header::MOST_FIELDS;

/// Numbers that are predicted at once.
const TOGETHER: usize = 4;

/// The numbers of a frame that are kept, signed ones as their two's complement; room behind them, that the last can
/// be predicted together with others, too.
pub(super) type Frame = [u32; MOST_FIELDS + TOGETHER];

/// A frame of zeros.
pub(super) const NOTHING: Frame = [0; MOST_FIELDS + TOGETHER];

/// What a number is a difference from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Predictor {
    Constant(u32),
    Previous,
    StraightLine,
    Average {
        signed: bool,
    },
    /// The first motor of the same frame, which stands there.
    FirstMotor(usize),
    Increment,
}

/// What the numbers of a kind of frame are differences from.
#[derive(Debug, Default)]
pub(super) struct Prediction {
    /// One run of numbers after the other, without gaps.
    runs: Vec<(Predictor, Range<usize>)>,
}

impl Prediction {
    /// Takes in the predictor of the next number.
    pub(super) fn push(&mut self, predictor: Predictor) {
        let end = self.runs.last().map_or(0, |(_, run)| run.end);
        match self.runs.last_mut() {
            Some((last, run)) if *last == predictor => run.end += 1,
            _ => self.runs.push((predictor, end..end + 1)),
        }
    }

    /// What the last two frames say of this one; without them, nothing is predicted from them.
    #[inline]
    pub(super) fn predict(&self, frame: &mut Frame, history: Option<(&Frame, &Frame)>, skipped: u32) {
        let history = history.unwrap_or((&NOTHING, &NOTHING));
        for (predictor, run) in &self.runs {
            let run = run.clone();
            match *predictor {
                Predictor::Constant(constant) => each(frame, history, run, |_, _| constant),
                Predictor::Previous => each(frame, history, run, |last, _| last),
                Predictor::StraightLine => {
                    each(frame, history, run, |last, before| last.wrapping_mul(2).wrapping_sub(before))
                }
                Predictor::Average { signed: true } => each(frame, history, run, signed_average),
                Predictor::Average { signed: false } => each(frame, history, run, average),
                // Added when that motor is known.
                Predictor::FirstMotor(_) => each(frame, history, run, |_, _| 0),
                Predictor::Increment => {
                    each(frame, history, run, |last, _| last.wrapping_add(skipped).wrapping_add(1))
                }
            }
        }
    }

    /// Adds the first motor to the numbers that follow it.
    #[inline]
    pub(super) fn add_first_motor(&self, frame: &mut Frame) {
        for (predictor, run) in &self.runs {
            if let Predictor::FirstMotor(motor) = *predictor {
                run.clone().for_each(|number| frame[number] = frame[number].wrapping_add(frame[motor]));
            }
        }
    }
}

/// Predicts a run of numbers; up to three behind it are overwritten.
#[inline]
fn each(
    frame: &mut Frame,
    (last, before): (&Frame, &Frame),
    run: Range<usize>,
    predict: impl Fn(u32, u32) -> u32,
) {
    let mut start = run.start;
    while start < run.end {
        let of = start..start + TOGETHER;
        let (Some(frame), Some(last), Some(before)) =
            (frame.get_mut(of.clone()), last.get(of.clone()), before.get(of))
        else {
            return;
        };
        for ((frame, &last), &before) in frame.iter_mut().zip(last).zip(before) {
            *frame = predict(last, before);
        }
        start += TOGETHER;
    }
}

/// The mean, rounded down, without a carry out of 32 bits.
#[inline]
fn average(last: u32, before: u32) -> u32 {
    (last & before).wrapping_add((last ^ before) >> 1)
}

/// The same of signed numbers, towards zero.
#[inline]
fn signed_average(last: u32, before: u32) -> u32 {
    let either = last ^ before;
    let down = (last & before).wrapping_add((either as i32 >> 1) as u32);
    down.wrapping_add((down >> 31) & either)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_of_64_bits() {
        let numbers = [0, 1, 2, 3, -1, -2, -3, 32_767, i32::MAX, i32::MIN, i32::MIN + 1];
        for last in numbers {
            for before in numbers {
                let wide = (i64::from(last) + i64::from(before)) / 2;
                let narrow = signed_average(last as u32, before as u32) as i32;
                assert_eq!(i64::from(narrow), wide, "{last} {before}");
                let wide = (u64::from(last as u32) + u64::from(before as u32)) / 2;
                assert_eq!(u64::from(average(last as u32, before as u32)), wide, "{last} {before}");
            }
        }
    }
}
