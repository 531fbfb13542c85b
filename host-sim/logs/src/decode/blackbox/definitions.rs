//! How frames are written: how each field is, and what it is a difference from.

use std::ops::Range;

use super::encoding::Reader;
use super::header::{Fields, Header, MOST_FIELDS};

/// Where the counter of iterations and the time stand in a frame.
pub(super) const ITERATION: usize = 0;
/// See `ITERATION`.
pub(super) const TIME: usize = 1;

/// Iterations that are skipped on purpose at most.
const LONGEST_PAUSE: u32 = 5000;

/// The numbers of a frame; signed ones as their two's complement.
pub(super) type Frame = [u32; MOST_FIELDS];

/// How a run of fields is written.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Encoding {
    Signed,
    Unsigned,
    Negative14Bit,
    UpToEight,
    Three,
    ThreeVariable,
    Four,
    Null,
}

/// What a run of fields is a difference from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Predictor {
    Constant(u32),
    Previous,
    StraightLine,
    Average { signed: bool },
    FirstMotor(usize),
    Increment,
}

/// How a kind of frame is written.
#[derive(Debug)]
pub(super) struct Definition {
    encodings: Vec<(Encoding, Range<usize>)>,
    prediction: Box<Prediction>,
}

/// What each field is a difference from: a mask for each predictor, all ones in the fields that have it, so
/// that a frame is predicted without a branch.
#[derive(Debug)]
struct Prediction {
    constant: Frame,
    previous: Frame,
    straight_line: Frame,
    average: Frame,
    signed: Frame,
    /// Fields that have any of these, rounded up.
    count: usize,
    /// Fields that follow the first motor of the same frame, and where that one stands.
    after_motor: Vec<(usize, usize)>,
    counters: Vec<usize>,
}

/// How the frames of a log are written.
#[derive(Debug)]
pub(super) struct Definitions {
    pub(super) whole: Definition,
    pub(super) difference: Definition,
    pub(super) slow: Definition,
    pub(super) position: Definition,
    pub(super) home: Definition,
    pub(super) data_version: i64,
    /// Which iterations are logged: of every so many, so many.
    pub(super) interval: Interval,
}

/// Every `whole` iterations a whole frame; of every `denominator` in between, `numerator` frames.
#[derive(Debug)]
pub(super) struct Interval {
    whole: u32,
    numerator: u32,
    denominator: u32,
}

impl Definitions {
    /// What a header says of the frames, or why they cannot be read.
    pub(super) fn new(header: &Header) -> Result<Self, String> {
        let of = |frame: u8| header.fields.get(&frame).cloned().unwrap_or_default();
        let whole = of(b'I');
        if whole.names.is_empty() {
            return Err("its header does not name the fields".into());
        }
        if whole.names.len() > MOST_FIELDS || whole.names.get(TIME).is_none_or(|name| name != "time") {
            return Err("its header cannot be right".into());
        }
        let shared = Fields { names: whole.names.clone(), signed: whole.signed.clone(), ..of(b'P') };
        let constants = Constants::new(header, &whole.names);
        let interval = header.settings.get("P interval").and_then(|text| text.split_once('/'));
        let part = |text: Option<&str>| {
            text.and_then(|text| text.trim().parse().ok()).filter(|&part: &u32| part > 0).unwrap_or(1)
        };
        Ok(Self {
            whole: Definition::new(&whole, &constants)?,
            difference: Definition::new(&shared, &constants)?,
            slow: Definition::new(&of(b'S'), &constants)?,
            position: Definition::new(&of(b'G'), &constants)?,
            home: Definition::new(&of(b'H'), &constants)?,
            data_version: header.number("Data version").unwrap_or(0),
            interval: Interval {
                whole: header
                    .number("I interval")
                    .and_then(|interval| u32::try_from(interval).ok())
                    .unwrap_or(32)
                    .max(1),
                numerator: part(interval.map(|(numerator, _)| numerator)),
                denominator: part(interval.map(|(_, denominator)| denominator)),
            },
        })
    }
}

/// Numbers of the header that fields are differences from.
struct Constants {
    minimum_throttle: u32,
    battery: u32,
    lowest_motor: u32,
    first_motor: Option<usize>,
}

impl Constants {
    fn new(header: &Header, names: &[String]) -> Self {
        let minimum_throttle = header.number("minthrottle");
        let number = |number: Option<i64>, otherwise: u32| number.map_or(otherwise, |number| number as u32);
        Self {
            minimum_throttle: number(minimum_throttle, 1150),
            battery: number(header.number("vbatref"), 4095),
            lowest_motor: number(header.number("motorOutput").or(minimum_throttle), 1150),
            first_motor: names.iter().position(|name| name == "motor[0]"),
        }
    }
}

impl Definition {
    fn new(fields: &Fields, constants: &Constants) -> Result<Self, String> {
        let mut encodings: Vec<(Encoding, Range<usize>)> = Vec::new();
        let mut prediction = Box::new(Prediction::of_nothing());
        let count = fields.names.len().min(MOST_FIELDS);
        for index in 0..count {
            let encoding = Encoding::new(fields.encodings.get(index).copied().unwrap_or(0))?;
            let signed = fields.signed.get(index).is_some_and(|&signed| signed != 0);
            let predictor =
                Predictor::new(fields.predictors.get(index).copied().unwrap_or(0), signed, constants)?;
            let counted = predictor == Predictor::Increment;
            let encoding = if counted { Encoding::Null } else { encoding };
            match encodings.last_mut() {
                Some((last, range)) if *last == encoding && range.len() < encoding.most() => range.end += 1,
                _ => encodings.push((encoding, index..index + 1)),
            }
            prediction.add(index, predictor);
        }
        Ok(Self { encodings, prediction })
    }

    /// Reads the numbers as they are written.
    #[inline]
    pub(super) fn read(&self, reader: &mut Reader, data_version: i64, frame: &mut Frame) {
        for (encoding, range) in &self.encodings {
            let Some(values) = frame.get_mut(range.clone()) else { continue };
            match encoding {
                Encoding::Signed => reader.signed_run(values),
                Encoding::Unsigned => values.iter_mut().for_each(|value| *value = reader.unsigned()),
                Encoding::Negative14Bit => {
                    values.iter_mut().for_each(|value| *value = reader.negative_14_bit())
                }
                Encoding::UpToEight => reader.up_to_eight(values),
                Encoding::Three => put(values, reader.three()),
                Encoding::ThreeVariable => put(values, reader.three_variable()),
                Encoding::Four if data_version < 2 => put(values, reader.four_version_1()),
                Encoding::Four => put(values, reader.four()),
                Encoding::Null => values.fill(0),
            }
        }
    }

    /// Adds what the last frames predict; without one, nothing is predicted from it.
    #[inline]
    pub(super) fn predict(&self, frame: &mut Frame, history: Option<(&Frame, &Frame)>, skipped: u32) {
        let (last, before) = history.unwrap_or((&NOTHING, &NOTHING));
        self.prediction.add_to(frame, last, before);
        for &field in &self.prediction.counters {
            frame[field] = last[field].wrapping_add(skipped).wrapping_add(1);
        }
        for &(field, motor) in &self.prediction.after_motor {
            frame[field] = frame[field].wrapping_add(frame[motor]);
        }
    }
}

/// Writes a group of fields, of which the last of a frame may be fewer.
#[inline]
fn put<const N: usize>(values: &mut [u32], read: [u32; N]) {
    match values.first_chunk_mut() {
        Some(whole) => *whole = read,
        None => values.iter_mut().zip(read).for_each(|(value, read)| *value = read),
    }
}

/// A frame of zeros.
const NOTHING: Frame = [0; MOST_FIELDS];

impl Prediction {
    fn of_nothing() -> Self {
        Self {
            constant: NOTHING,
            previous: NOTHING,
            straight_line: NOTHING,
            average: NOTHING,
            signed: NOTHING,
            count: 0,
            after_motor: Vec::new(),
            counters: Vec::new(),
        }
    }

    /// Takes in the predictor of a field.
    fn add(&mut self, field: usize, predictor: Predictor) {
        const YES: u32 = u32::MAX;
        const TOGETHER: usize = 8;
        match predictor {
            Predictor::Constant(0) => return,
            Predictor::Constant(constant) => self.constant[field] = constant,
            Predictor::Previous => self.previous[field] = YES,
            Predictor::StraightLine => self.straight_line[field] = YES,
            Predictor::Average { signed } => {
                self.average[field] = YES;
                self.signed[field] = if signed { YES } else { 0 };
            }
            Predictor::FirstMotor(motor) => return self.after_motor.push((field, motor)),
            Predictor::Increment => return self.counters.push(field),
        }
        self.count = (field + 1).next_multiple_of(TOGETHER).min(MOST_FIELDS);
    }

    /// Adds all but what follows the first motor.
    #[inline]
    fn add_to(&self, frame: &mut Frame, last: &Frame, before: &Frame) {
        let count = self.count.min(MOST_FIELDS);
        let masks = self.previous[..count].iter().zip(&self.straight_line[..count]);
        let averages = self.average[..count].iter().zip(&self.signed[..count]);
        let history = last[..count].iter().zip(&before[..count]);
        let fields =
            frame[..count].iter_mut().zip(&self.constant[..count]).zip(masks).zip(averages).zip(history);
        for ((((value, constant), (previous, line)), (mean, signed)), (&last, &before)) in fields {
            let straight = last.wrapping_mul(2).wrapping_sub(before);
            let predicted = (last & previous) | (straight & line) | (average(last, before, *signed) & mean);
            *value = value.wrapping_add(*constant).wrapping_add(predicted);
        }
    }
}

/// The mean, towards zero, without a carry out of 32 bits; of signed numbers where `signed` is all ones.
#[inline]
fn average(last: u32, before: u32, signed: u32) -> u32 {
    let (both, either) = (last & before, last ^ before);
    let half = (either >> 1) | (either & signed & (1 << 31));
    let down = both.wrapping_add(half);
    down.wrapping_add((down >> 31) & either & 1 & signed)
}

impl Encoding {
    fn new(number: i64) -> Result<Self, String> {
        Ok(match number {
            0 => Self::Signed,
            1 => Self::Unsigned,
            3 => Self::Negative14Bit,
            6 => Self::UpToEight,
            7 => Self::Three,
            8 => Self::Four,
            9 => Self::Null,
            10 => Self::ThreeVariable,
            _ => return Err(format!("encoding {number} is not known")),
        })
    }

    /// Fields that are written together at most.
    fn most(self) -> usize {
        match self {
            Self::UpToEight => 8,
            Self::Three | Self::ThreeVariable => 3,
            Self::Four => 4,
            Self::Signed | Self::Unsigned | Self::Negative14Bit | Self::Null => MOST_FIELDS,
        }
    }
}

impl Predictor {
    fn new(number: i64, signed: bool, constants: &Constants) -> Result<Self, String> {
        Ok(match number {
            // Positions are differences from the home position, times of positions from the frame before: not kept.
            0 | 7 | 10 => Self::Constant(0),
            1 => Self::Previous,
            2 => Self::StraightLine,
            3 => Self::Average { signed },
            4 => Self::Constant(constants.minimum_throttle),
            5 => Self::FirstMotor(
                constants.first_motor.ok_or("a field follows the first motor, which is not there")?,
            ),
            6 => Self::Increment,
            8 => Self::Constant(1500),
            9 => Self::Constant(constants.battery),
            11 => Self::Constant(constants.lowest_motor),
            _ => return Err(format!("predictor {number} is not known")),
        })
    }
}

impl Interval {
    /// Iterations after one that are not logged.
    pub(super) fn skipped_after(&self, iteration: u32) -> u32 {
        if self.denominator == 1 {
            return 0;
        }
        let logged =
            |at: u32| (at % self.whole).wrapping_add(self.numerator - 1) % self.denominator < self.numerator;
        // A whole frame is always logged, so that this ends.
        (0..self.whole.min(LONGEST_PAUSE))
            .find(|&count| logged(iteration.wrapping_add(1).wrapping_add(count)))
            .unwrap_or(0)
    }
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
                assert_eq!(
                    i64::from(average(last as u32, before as u32, u32::MAX) as i32),
                    wide,
                    "{last} {before}"
                );
                let wide = (u64::from(last as u32) + u64::from(before as u32)) / 2;
                assert_eq!(u64::from(average(last as u32, before as u32, 0)), wide, "{last} {before}");
            }
        }
    }
}
