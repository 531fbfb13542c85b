//! What of a log could not be read.

/// What was left out.
#[derive(Debug, Default)]
pub(super) struct Damage {
    places: usize,
    bytes: usize,
    first_at: usize,
    /// The last message is not whole.
    pub(super) cut: bool,
    /// Descriptions of messages that cannot be.
    pub(super) formats: usize,
}

impl Damage {
    /// Bytes at a place that are no message.
    pub(super) fn leave_out(&mut self, at: usize, bytes: usize) {
        if self.places == 0 {
            self.first_at = at;
        }
        self.places += 1;
        self.bytes += bytes;
    }

    /// A sentence each.
    pub(super) fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        if self.places > 0 {
            sentences.push(format!(
                "{} bytes in {} place{} are no messages and were left out, the first at byte {}",
                self.bytes,
                self.places,
                if self.places == 1 { "" } else { "s" },
                self.first_at
            ));
        }
        if self.formats > 0 {
            sentences
                .push(format!("{} descriptions of messages cannot be right and were left out", self.formats));
        }
        if self.cut {
            sentences.push("the log is cut off within its last message".into());
        }
        sentences
    }
}
