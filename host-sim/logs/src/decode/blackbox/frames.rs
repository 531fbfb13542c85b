//! Frames: differences from what the last ones predict, checked against what a clock and a counter can do.

use std::ops::Range;

use super::encoding::Reader;
use super::header::{Fields, Header, MOST_FIELDS};
use super::rows::Rows;

/// Iterations and microseconds that no gap between two frames is longer than.
const LONGEST_GAP: (u32, i64) = (5000, 10_000_000);
/// No frame is longer, bytes.
const LONGEST_FRAME: usize = 256;
/// Where the counter of iterations and the time stand in a frame.
const ITERATION: usize = 0;
const TIME: usize = 1;

/// The numbers of a frame; signed ones as their two's complement.
type Frame = [u32; MOST_FIELDS];

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
#[derive(Debug, Default)]
struct Definition {
    encodings: Vec<(Encoding, Range<usize>)>,
    predictors: Vec<(Predictor, Range<usize>)>,
}

/// How the frames of a log are written.
#[derive(Debug)]
pub(super) struct Definitions {
    whole: Definition,
    difference: Definition,
    slow: Definition,
    position: Definition,
    home: Definition,
    data_version: i64,
    /// Which iterations are logged: of every so many, so many.
    interval: Interval,
}

/// Every `whole` iterations a whole frame; of every `denominator` in between, `numerator` frames.
#[derive(Debug)]
struct Interval {
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
        let mut definition = Self::default();
        let count = fields.names.len().min(MOST_FIELDS);
        for index in 0..count {
            let encoding = Encoding::new(fields.encodings.get(index).copied().unwrap_or(0))?;
            let signed = fields.signed.get(index).is_some_and(|&signed| signed != 0);
            let predictor =
                Predictor::new(fields.predictors.get(index).copied().unwrap_or(0), signed, constants)?;
            let counted = predictor == Predictor::Increment;
            let encoding = if counted { Encoding::Null } else { encoding };
            match definition.encodings.last_mut() {
                Some((last, range)) if *last == encoding && range.len() < encoding.most() => range.end += 1,
                _ => definition.encodings.push((encoding, index..index + 1)),
            }
            match definition.predictors.last_mut() {
                Some((last, range)) if *last == predictor => range.end += 1,
                _ => definition.predictors.push((predictor, index..index + 1)),
            }
        }
        definition.predictors.retain(|(predictor, _)| *predictor != Predictor::Constant(0));
        Ok(definition)
    }

    /// Reads the numbers as they are written.
    #[inline]
    fn read(&self, reader: &mut Reader, data_version: i64, frame: &mut Frame) {
        for (encoding, range) in &self.encodings {
            let Some(values) = frame.get_mut(range.clone()) else { continue };
            match encoding {
                Encoding::Signed => reader.signed_run(values),
                Encoding::Unsigned => values.iter_mut().for_each(|value| *value = reader.unsigned()),
                Encoding::Negative14Bit => {
                    values.iter_mut().for_each(|value| *value = reader.negative_14_bit())
                }
                Encoding::UpToEight => reader.up_to_eight(values),
                Encoding::Three => {
                    values.iter_mut().zip(reader.three()).for_each(|(value, read)| *value = read)
                }
                Encoding::ThreeVariable => {
                    values.iter_mut().zip(reader.three_variable()).for_each(|(value, read)| *value = read);
                }
                Encoding::Four if data_version < 2 => {
                    values.iter_mut().zip(reader.four_version_1()).for_each(|(value, read)| *value = read);
                }
                Encoding::Four => {
                    values.iter_mut().zip(reader.four()).for_each(|(value, read)| *value = read)
                }
                Encoding::Null => values.fill(0),
            }
        }
    }

    /// Adds what the last frames predict; without one, nothing is predicted from it.
    #[inline]
    fn predict(&self, frame: &mut Frame, history: Option<(&Frame, &Frame)>, skipped: u32) {
        for (predictor, range) in &self.predictors {
            let last = |at: &Range<usize>| {
                history.and_then(|(last, before)| Some((last.get(at.clone())?, before.get(at.clone())?)))
            };
            let first_motor =
                if let Predictor::FirstMotor(at) = predictor { frame.get(*at).copied() } else { None };
            let Some(values) = frame.get_mut(range.clone()) else { continue };
            match (predictor, last(range)) {
                (Predictor::Constant(constant), _) => {
                    values.iter_mut().for_each(|value| *value = value.wrapping_add(*constant))
                }
                (Predictor::FirstMotor(_), _) => {
                    values.iter_mut().for_each(|value| *value = value.wrapping_add(first_motor.unwrap_or(0)));
                }
                (Predictor::Increment, last) => {
                    for (index, value) in values.iter_mut().enumerate() {
                        let last = last.and_then(|(last, _)| last.get(index)).copied().unwrap_or(0);
                        *value = last.wrapping_add(skipped).wrapping_add(1);
                    }
                }
                (Predictor::Previous, Some((last, _))) => {
                    values.iter_mut().zip(last).for_each(|(value, last)| *value = value.wrapping_add(*last));
                }
                (Predictor::StraightLine, Some((last, before))) => {
                    for ((value, last), before) in values.iter_mut().zip(last).zip(before) {
                        *value = value.wrapping_add(last.wrapping_mul(2)).wrapping_sub(*before);
                    }
                }
                (Predictor::Average { signed }, Some((last, before))) => {
                    for ((value, &last), &before) in values.iter_mut().zip(last).zip(before) {
                        *value = value.wrapping_add(average(last, before, *signed));
                    }
                }
                (_, None) => {}
            }
        }
    }
}

/// The mean, towards zero, without a carry out of 32 bits.
#[inline]
fn average(last: u32, before: u32, signed: bool) -> u32 {
    let (both, either) = (last & before, last ^ before);
    if !signed {
        return both + (either >> 1);
    }
    let down = (both as i32).wrapping_add(either as i32 >> 1) as u32;
    down.wrapping_add((down >> 31) & either & 1)
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
    fn skipped_after(&self, iteration: u32) -> u32 {
        if self.denominator == 1 {
            return 0;
        }
        let logged =
            |at: u32| (at % self.whole).wrapping_add(self.numerator - 1) % self.denominator < self.numerator;
        // A whole frame is always logged, so that this ends.
        (0..self.whole.min(LONGEST_GAP.0))
            .find(|&count| logged(iteration.wrapping_add(1).wrapping_add(count)))
            .unwrap_or(0)
    }
}

/// What was found beside the rows.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Places where what stands is no frame, or a frame that cannot be.
    bad_places: usize,
    /// Frames that were left out until the next whole one.
    left_out: usize,
    /// The last frame is not whole.
    pub(super) cut: bool,
    /// There are more rows than bytes to hold them.
    too_many: bool,
}

impl Found {
    /// What is missing, in a sentence.
    pub(super) fn sentence(&self, header: &Header) -> Option<String> {
        let mut parts = Vec::new();
        if header.damaged_lines > 0 {
            parts.push(format!("{} damaged lines in its header", header.damaged_lines));
        }
        if self.bad_places > 0 {
            parts.push(format!(
                "damaged in {} places, {} frames left out until the next whole ones",
                self.bad_places, self.left_out
            ));
        }
        if self.cut {
            parts.push("cut off within its last frame".into());
        }
        if self.too_many {
            parts.push("more rows than its bytes can hold, the rest left out".into());
        }
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

/// The state between frames.
struct Stream<'log> {
    reader: Reader<'log>,
    definitions: &'log Definitions,
    current: Box<Frame>,
    last: Box<Frame>,
    before: Box<Frame>,
    has_history: bool,
    /// Whether differences can be added up: no damage since the last whole frame.
    valid: bool,
    /// Iteration and time of the last frame that was taken.
    taken: Option<(u32, i64)>,
    /// The same of a whole frame that cannot follow on it.
    candidate: Option<(u32, i64)>,
    wraps: i64,
    found: Found,
}

/// Reads the frames of a log.
pub(super) fn read(bytes: &[u8], definitions: &Definitions, rows: &mut Rows) -> Found {
    let empty = || Box::new([0; MOST_FIELDS]);
    let mut stream = Stream {
        reader: Reader::new(bytes),
        definitions,
        current: empty(),
        last: empty(),
        before: empty(),
        has_history: false,
        valid: false,
        taken: None,
        candidate: None,
        wraps: 0,
        found: Found::default(),
    };
    let mut in_garbage = false;
    while let Some(letter) = stream.reader.next() {
        let start = stream.reader.at;
        let known = match letter {
            b'I' => stream.whole(rows),
            b'P' => stream.difference(rows),
            b'S' => stream.pass(&definitions.slow),
            b'G' => stream.pass(&definitions.position),
            b'H' => stream.pass(&definitions.home),
            b'E' => match stream.event() {
                Event::End => break,
                Event::Known => true,
                Event::Unknown => false,
            },
            _ => false,
        };
        if !known {
            stream.valid = false;
        }
        // Erased memory is no damage.
        let is_bad = !known && letter != 0xff;
        stream.found.bad_places += usize::from(is_bad && !in_garbage);
        in_garbage = !known;
        if rows.full() {
            stream.found.too_many = true;
            break;
        }
        debug_assert!(stream.reader.at >= start);
    }
    stream.found
}

/// What an event says to the reader.
enum Event {
    End,
    Known,
    Unknown,
}

impl Stream<'_> {
    /// Reads past a frame that is not kept.
    fn pass(&mut self, definition: &Definition) -> bool {
        let start = self.reader.at;
        definition.read(&mut self.reader, self.definitions.data_version, &mut self.current);
        self.reader.at - start <= LONGEST_FRAME
    }

    /// Reads a whole frame.
    fn whole(&mut self, rows: &mut Rows) -> bool {
        let start = self.reader.at;
        self.definitions.whole.read(&mut self.reader, self.definitions.data_version, &mut self.current);
        let history = self.has_history.then_some((&*self.last, &*self.last));
        self.definitions.whole.predict(&mut self.current, history, 0);
        if self.reader.at - start > LONGEST_FRAME {
            return false;
        }
        let now = self.now();
        self.valid = self.taken.is_none_or(|taken| follows(taken, now))
            || self.candidate.is_some_and(|candidate| follows(candidate, now));
        if !self.valid {
            // Two whole frames that follow on each other: the log goes on here.
            self.candidate = Some(now);
            self.has_history = false;
            return false;
        }
        self.take(now, rows);
        self.before.copy_from_slice(&*self.last);
        true
    }

    /// Reads a frame of differences.
    fn difference(&mut self, rows: &mut Rows) -> bool {
        let start = self.reader.at;
        self.definitions.difference.read(&mut self.reader, self.definitions.data_version, &mut self.current);
        if self.reader.at - start > LONGEST_FRAME {
            return false;
        }
        if !self.valid {
            self.found.left_out += 1;
            return true;
        }
        let skipped =
            self.taken.map_or(0, |(iteration, _)| self.definitions.interval.skipped_after(iteration));
        let history = self.has_history.then_some((&*self.last, &*self.before));
        self.definitions.difference.predict(&mut self.current, history, skipped);
        let now = self.now();
        if self.taken.is_none_or(|taken| follows(taken, now)) {
            self.take(now, rows);
            return true;
        }
        self.has_history = false;
        self.found.left_out += 1;
        false
    }

    /// The current frame becomes the last one.
    fn take(&mut self, now: (u32, i64), rows: &mut Rows) {
        self.wraps = now.1 & !i64::from(u32::MAX);
        self.taken = Some(now);
        self.candidate = None;
        self.has_history = true;
        self.found.cut |= self.reader.past_end;
        rows.push(now.1, &self.current, self.reader.at);
        std::mem::swap(&mut self.before, &mut self.last);
        std::mem::swap(&mut self.last, &mut self.current);
    }

    /// Iteration and time of the current frame. The clock of 32 bits wraps every 71.6 minutes.
    fn now(&self) -> (u32, i64) {
        let ticks = self.current[TIME];
        let wrapped = self.taken.is_some_and(|(_, taken)| {
            let taken = taken as u32;
            ticks < taken && i64::from(ticks.wrapping_sub(taken)) < LONGEST_GAP.1
        });
        (self.current[ITERATION], self.wraps + i64::from(ticks) + if wrapped { 1 << 32 } else { 0 })
    }

    /// Reads an event.
    fn event(&mut self) -> Event {
        match self.reader.next() {
            // The beep by which recordings of other devices are lined up.
            Some(0) => {
                self.reader.unsigned();
                Event::Known
            }
            // A setting changed in flight.
            Some(13) => {
                if self.reader.next().is_some_and(|function| function > 127) {
                    (0..4).for_each(|_| _ = self.reader.next());
                } else {
                    self.reader.unsigned();
                }
                Event::Known
            }
            // The log was paused and goes on.
            Some(14) => {
                let (iteration, time) = (self.reader.unsigned(), self.reader.unsigned());
                self.taken = Some((iteration, self.wraps + i64::from(time)));
                Event::Known
            }
            // Disarmed, flight mode, sensor failed. blackbox_decode does not know them and leaves out what follows
            // up to the next whole frame; so do we, that rows are the same.
            Some(15 | 40) => self.wait_after(1),
            Some(30) => self.wait_after(2),
            Some(255) if self.reader.passes(b"End of log") => Event::End,
            _ => Event::Unknown,
        }
    }

    /// Goes past the numbers of an event.
    fn wait_after(&mut self, numbers: usize) -> Event {
        (0..numbers).for_each(|_| _ = self.reader.unsigned());
        self.valid = false;
        Event::Known
    }
}

/// Whether a frame can follow on another one.
fn follows((iteration, time): (u32, i64), now: (u32, i64)) -> bool {
    let most = iteration.wrapping_add(LONGEST_GAP.0);
    now.0 >= iteration && now.0 < most && now.1 >= time && now.1 < time.saturating_add(LONGEST_GAP.1)
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
                    i64::from(average(last as u32, before as u32, true) as i32),
                    wide,
                    "{last} {before}"
                );
                let wide = (u64::from(last as u32) + u64::from(before as u32)) / 2;
                assert_eq!(u64::from(average(last as u32, before as u32, false)), wide, "{last} {before}");
            }
        }
    }
}
