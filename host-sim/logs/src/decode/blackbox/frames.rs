//! Frames: differences from what the last ones predict, checked against what a clock and a counter can do.

use super::definitions::{Definition, Definitions, ITERATION, TIME};
use super::encoding::Reader;
use super::header::Header;
use super::rows::Rows;

/// Iterations and microseconds that no gap between two frames is longer than.
const LONGEST_GAP: (u32, i64) = (5000, 10_000_000);
/// No frame is longer, bytes.
const LONGEST_FRAME: usize = 256;
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
    rows: &'log mut Rows,
    has_history: bool,
    /// Whether the last frame is a whole one, which stands for the one before it, too.
    after_whole: bool,
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
pub(super) fn read<'log>(bytes: &'log [u8], definitions: &'log Definitions, rows: &'log mut Rows) -> Found {
    let mut stream = Stream {
        reader: Reader::new(bytes),
        definitions,
        rows,
        has_history: false,
        after_whole: false,
        valid: false,
        taken: None,
        candidate: None,
        wraps: 0,
        found: Found::default(),
    };
    let mut in_garbage = false;
    while let Some(letter) = stream.reader.next() {
        let known = match letter {
            b'I' => stream.whole(),
            b'P' => stream.difference(),
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
        if stream.rows.full() {
            stream.found.too_many = true;
            break;
        }
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
        let start = self.reader.left();
        if let Some([.., next]) = self.rows.frames() {
            definition.read(&mut self.reader, next);
        }
        start - self.reader.left() <= LONGEST_FRAME
    }

    /// Reads a whole frame.
    fn whole(&mut self) -> bool {
        let start = self.reader.left();
        let definition = &self.definitions.whole;
        let Some([_, last, next]) = self.rows.frames() else { return false };
        let history = self.has_history.then_some((&*last, &*last));
        definition.prediction.predict(next, history, 0);
        definition.read(&mut self.reader, next);
        if self.reader.past_end {
            return self.is_cut();
        }
        if start - self.reader.left() > LONGEST_FRAME {
            return false;
        }
        definition.prediction.add_first_motor(next);
        let now = (next[ITERATION], next[TIME]);
        let now = self.now(now);
        self.valid = self.taken.is_none_or(|taken| follows(taken, now))
            || self.candidate.is_some_and(|candidate| follows(candidate, now));
        if !self.valid {
            // Two whole frames that follow on each other: the log goes on here.
            self.candidate = Some(now);
            self.has_history = false;
            return false;
        }
        self.take(now);
        self.after_whole = true;
        true
    }

    /// Reads a frame of differences.
    fn difference(&mut self) -> bool {
        let start = self.reader.left();
        let definition = &self.definitions.difference;
        let skipped =
            self.taken.map_or(0, |(iteration, _)| self.definitions.interval.skipped_after(iteration));
        let Some([before, last, next]) = self.rows.frames() else { return false };
        let history = self.has_history.then_some((&*last, if self.after_whole { &*last } else { &*before }));
        definition.prediction.predict(next, history, skipped);
        definition.read(&mut self.reader, next);
        if self.reader.past_end {
            return self.is_cut();
        }
        if start - self.reader.left() > LONGEST_FRAME {
            return false;
        }
        if !self.valid {
            self.found.left_out += 1;
            return true;
        }
        definition.prediction.add_first_motor(next);
        let now = (next[ITERATION], next[TIME]);
        let now = self.now(now);
        if self.taken.is_none_or(|taken| follows(taken, now)) {
            self.take(now);
            self.after_whole = false;
            return true;
        }
        self.has_history = false;
        self.found.left_out += 1;
        false
    }

    /// The log ends within a frame: what is missing of it would be zeros, so it is no row.
    fn is_cut(&mut self) -> bool {
        self.found.cut = true;
        true
    }

    /// The next frame becomes the last one.
    fn take(&mut self, now: (u32, i64)) {
        self.wraps = now.1 & !i64::from(u32::MAX);
        self.taken = Some(now);
        self.candidate = None;
        self.has_history = true;
        self.rows.push(now.1, self.reader.left());
    }

    /// Iteration and time of the next frame. The clock of 32 bits wraps every 71.6 minutes.
    fn now(&self, (iteration, ticks): (u32, u32)) -> (u32, i64) {
        let wrapped = self.taken.is_some_and(|(_, taken)| {
            let taken = taken as u32;
            ticks < taken && i64::from(ticks.wrapping_sub(taken)) < LONGEST_GAP.1
        });
        (iteration, self.wraps + i64::from(ticks) + if wrapped { 1 << 32 } else { 0 })
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
