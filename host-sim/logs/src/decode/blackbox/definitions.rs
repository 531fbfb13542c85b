//! How frames are written: how each field is, and what it is a difference from.

use std::ops::Range;

use super::encoding::{Numbers, Reader, add};
use super::header::{Fields, Header, MOST_FIELDS};
use super::kept::is_kept;
use super::prediction::{Frame, Prediction, Predictor};

/// Where the counter of iterations and the time stand in a frame.
pub(super) const ITERATION: usize = 0;
/// See `ITERATION`.
pub(super) const TIME: usize = 1;

/// Iterations that are skipped on purpose at most.
const LONGEST_PAUSE: u32 = 5000;

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
    FourVersion1,
    Null,
}

/// Fields that are written alike, together where the encoding is of several.
type Run = (Encoding, Range<usize>);

/// Fields that are read at once.
#[derive(Debug)]
enum Step {
    /// Signed numbers, and any that are not kept.
    Numbers(Numbers),
    /// Others that are kept: how they are written, and where they go in a frame.
    Kept(Run),
    /// Groups that are not kept.
    Three,
    Four,
}

/// How a kind of frame is written.
#[derive(Debug)]
pub(super) struct Definition {
    steps: Vec<Step>,
    pub(super) prediction: Prediction,
}

/// Where the fields of a log stand in a frame, those in the order of the log that are kept or cannot be read
/// without them.
#[derive(Debug, Default)]
pub(super) struct Places(Vec<Option<usize>>);

/// How the frames of a log are written.
#[derive(Debug)]
pub(super) struct Definitions {
    pub(super) whole: Definition,
    pub(super) difference: Definition,
    pub(super) slow: Definition,
    pub(super) position: Definition,
    pub(super) home: Definition,
    pub(super) places: Places,
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
        let version = header.number("Data version").unwrap_or(0);
        let runs = |fields: &Fields| runs(fields, version);
        let places = Places::new(&whole.names, &[runs(&whole)?, runs(&shared)?].concat());
        let constants = Constants::new(header, &whole.names, &places);
        let kept = |fields: &Fields| Definition::new(fields, runs(fields)?, &constants, &places);
        let passed = |fields: &Fields| {
            Definition::new(fields, runs(fields)?, &constants, &Places::of_all(fields.names.len()))
        };
        let interval = header.settings.get("P interval").and_then(|text| text.split_once('/'));
        let part = |text: Option<&str>| {
            text.and_then(|text| text.trim().parse().ok()).filter(|&part: &u32| part > 0).unwrap_or(1)
        };
        Ok(Self {
            whole: kept(&whole)?,
            difference: kept(&shared)?,
            slow: passed(&of(b'S'))?,
            position: passed(&of(b'G'))?,
            home: passed(&of(b'H'))?,
            places,
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
    /// Where in a frame it stands.
    first_motor: Option<usize>,
}

impl Constants {
    fn new(header: &Header, names: &[String], places: &Places) -> Self {
        let minimum_throttle = header.number("minthrottle");
        let number = |number: Option<i64>, otherwise: u32| number.map_or(otherwise, |number| number as u32);
        Self {
            minimum_throttle: number(minimum_throttle, 1150),
            battery: number(header.number("vbatref"), 4095),
            lowest_motor: number(header.number("motorOutput").or(minimum_throttle), 1150),
            first_motor: names.iter().position(|name| name == "motor[0]").and_then(|field| places.of(field)),
        }
    }
}

/// How the fields of a kind of frame are written.
fn runs(fields: &Fields, version: i64) -> Result<Vec<Run>, String> {
    let mut runs: Vec<Run> = Vec::new();
    for field in 0..fields.names.len().min(MOST_FIELDS) {
        let encoding = match (fields.encodings.get(field), fields.predictors.get(field)) {
            // Counters are not written.
            (_, Some(&INCREMENT)) => Encoding::Null,
            (encoding, _) => Encoding::new(encoding.copied().unwrap_or(0), version)?,
        };
        match runs.last_mut() {
            Some((last, run)) if *last == encoding && run.len() < encoding.most() => run.end += 1,
            _ => runs.push((encoding, field..field + 1)),
        }
    }
    Ok(runs)
}

impl Places {
    fn new(names: &[String], runs: &[Run]) -> Self {
        let mut kept: Vec<bool> =
            names.iter().enumerate().map(|(field, name)| field <= TIME || is_kept(name)).collect();
        // The others of a group come with it, and with them the others of their groups in the other kind of frame.
        loop {
            let before = kept.clone();
            for (encoding, group) in runs.iter().filter(|(encoding, _)| encoding.most() < MOST_FIELDS) {
                let group = &mut kept[group.clone()];
                let any = group.contains(&true) || !encoding.is_passed();
                group.fill(any);
            }
            if kept == before {
                break;
            }
        }
        let mut count = 0..;
        Self(kept.into_iter().map(|kept| kept.then(|| count.next()).flatten()).collect())
    }

    /// Each at its own place.
    fn of_all(count: usize) -> Self {
        Self((0..count).map(Some).collect())
    }

    /// Where a field stands.
    pub(super) fn of(&self, field: usize) -> Option<usize> {
        self.0.get(field).copied().flatten()
    }
}

/// How the fields of a run are read.
fn steps((encoding, run): Run, places: &Places) -> Vec<Step> {
    let place = places.of(run.start);
    match (encoding, place) {
        (Encoding::Null, _) => Vec::new(),
        (Encoding::Signed | Encoding::Unsigned | Encoding::Negative14Bit, _) => {
            let mut steps = Vec::new();
            for place in run.map(|field| places.of(field)) {
                if let Some(place) = place.filter(|_| encoding != Encoding::Signed) {
                    steps.push(Step::Kept((encoding, place..place + 1)));
                    continue;
                }
                let taken = match steps.last_mut() {
                    Some(Step::Numbers(numbers)) => numbers.take(place),
                    _ => false,
                };
                if !taken {
                    steps.push(Step::Numbers(Numbers::new(place)));
                }
            }
            steps
        }
        (_, Some(place)) => vec![Step::Kept((encoding, place..place + run.len()))],
        (Encoding::Four, None) => vec![Step::Four],
        (_, None) => vec![Step::Three],
    }
}

impl Definition {
    fn new(fields: &Fields, runs: Vec<Run>, constants: &Constants, places: &Places) -> Result<Self, String> {
        let mut prediction = Prediction::default();
        for field in 0..fields.names.len().min(MOST_FIELDS) {
            let number = fields.predictors.get(field).copied().unwrap_or(0);
            let signed = fields.signed.get(field).is_some_and(|&signed| signed != 0);
            let predictor = predictor(number, signed, constants)?;
            if places.of(field).is_some() {
                prediction.push(predictor);
            }
        }
        let steps = runs.into_iter().flat_map(|run| steps(run, places)).collect();
        Ok(Self { steps, prediction })
    }

    /// Adds the numbers that are written to a frame.
    #[inline]
    pub(super) fn read(&self, reader: &mut Reader, frame: &mut Frame) {
        let mut local = *reader;
        for step in &self.steps {
            match step {
                Step::Numbers(numbers) => {
                    if let Some(values) = frame.get_mut(numbers.places.clone()) {
                        local.numbers(numbers, values);
                    }
                }
                Step::Kept((encoding, run)) => {
                    if let Some(values) = frame.get_mut(run.clone()) {
                        encoding.read(&mut local, values);
                    }
                }
                Step::Three => local.pass_three(),
                Step::Four => local.pass_four(),
            }
        }
        *reader = local;
    }
}

impl Encoding {
    fn new(number: i64, version: i64) -> Result<Self, String> {
        Ok(match number {
            0 => Self::Signed,
            1 => Self::Unsigned,
            3 => Self::Negative14Bit,
            6 => Self::UpToEight,
            7 => Self::Three,
            8 if version < 2 => Self::FourVersion1,
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
            Self::Four | Self::FourVersion1 => 4,
            Self::Signed | Self::Unsigned | Self::Negative14Bit | Self::Null => MOST_FIELDS,
        }
    }

    /// Whether fields that are not kept are read past; the others are kept.
    fn is_passed(self) -> bool {
        !matches!(self, Self::UpToEight | Self::FourVersion1)
    }

    /// Adds the numbers of a run to some values.
    #[inline]
    fn read(self, reader: &mut Reader, values: &mut [u32]) {
        match self {
            Self::Signed => values.iter_mut().for_each(|value| add(value, reader.signed())),
            Self::Unsigned => values.iter_mut().for_each(|value| add(value, reader.unsigned())),
            Self::Negative14Bit => values.iter_mut().for_each(|value| add(value, reader.negative_14_bit())),
            Self::UpToEight => reader.up_to_eight(values),
            Self::Three => reader.three(values),
            Self::ThreeVariable => reader.three_variable(values),
            Self::Four => reader.four(values),
            Self::FourVersion1 => reader.four_version_1(values),
            Self::Null => {}
        }
    }
}

/// The predictor of numbers that count frames.
const INCREMENT: i64 = 6;

/// A predictor by its number.
fn predictor(number: i64, signed: bool, constants: &Constants) -> Result<Predictor, String> {
    Ok(match number {
        // Positions are differences from the home position, times of positions from the frame before: not kept.
        0 | 7 | 10 => Predictor::Constant(0),
        1 => Predictor::Previous,
        2 => Predictor::StraightLine,
        3 => Predictor::Average { signed },
        4 => Predictor::Constant(constants.minimum_throttle),
        5 => Predictor::FirstMotor(
            constants.first_motor.ok_or("a field follows the first motor, which is not there")?,
        ),
        INCREMENT => Predictor::Increment,
        8 => Predictor::Constant(1500),
        9 => Predictor::Constant(constants.battery),
        11 => Predictor::Constant(constants.lowest_motor),
        _ => return Err(format!("predictor {number} is not known")),
    })
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
