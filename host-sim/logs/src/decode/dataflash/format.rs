//! What a type of message looks like: the `FMT` message.

/// How every binary message begins; the type follows.
pub(super) const HEADER: [u8; 2] = [0xa3, 0x95];
/// Header and type.
pub(super) const HEADER_LENGTH: usize = 3;
/// The type of the messages that describe the others.
pub(super) const FMT: u8 = 0x80;
/// No log has as many; more would only be there to fill the memory.
pub(super) const MOST_FORMATS: usize = 1024;

/// A type of message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MessageFormat {
    /// `ATT`.
    pub(super) name: String,
    /// Of the whole message, with its header, bytes.
    pub(super) length: usize,
    /// In the order of the message.
    pub(super) fields: Vec<Field>,
}

/// A field of a message.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    /// `Roll`.
    pub(super) label: String,
    /// How it is written: `c`.
    pub(super) letter: u8,
    /// From the start of the message, bytes.
    pub(super) offset: usize,
}

impl MessageFormat {
    /// A type as a log describes it: letters and names as far as both are there, known, and within the length.
    /// Nothing if the length cannot be or there is no name.
    pub(super) fn new(name: &str, length: usize, letters: &[u8], labels: &str) -> Option<Self> {
        if length < HEADER_LENGTH || name.is_empty() {
            return None;
        }
        let mut offset = HEADER_LENGTH;
        let mut fields = Vec::new();
        for (&letter, label) in letters.iter().zip(labels.split(',')) {
            let Some(width) = width(letter).filter(|width| offset + width <= length) else { break };
            fields.push(Field { label: label.trim().into(), letter, offset });
            offset += width;
        }
        Some(Self { name: name.into(), length, fields })
    }

    /// `FMT` itself.
    pub(super) fn of_formats() -> Self {
        let fields = [
            ("Type", b'B', 3),
            ("Length", b'B', 4),
            ("Name", b'n', 5),
            ("Format", b'N', 9),
            ("Columns", b'Z', 25),
        ];
        let fields = fields.map(|(label, letter, offset)| Field { label: label.into(), letter, offset });
        Self { name: "FMT".into(), length: 89, fields: fields.into() }
    }

    /// A field by its name.
    pub(super) fn field(&self, label: &str) -> Option<&Field> {
        self.fields.iter().find(|field| field.label == label)
    }

    /// Which field is the time on the craft's clock.
    pub(super) fn time_field(&self) -> Option<usize> {
        let is_time = |field: &Field| {
            matches!(field.label.as_str(), "TimeUS" | "TimeMS") && b"bBhHiIqQ".contains(&field.letter)
        };
        self.fields.iter().position(is_time)
    }
}

/// Bytes that a letter stands for; none for a letter that is not known.
pub(super) fn width(letter: u8) -> Option<usize> {
    Some(match letter {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'e' | b'E' | b'L' | b'f' | b'n' => 4,
        b'q' | b'Q' | b'd' => 8,
        b'N' => 16,
        b'Z' | b'a' => 64,
        _ => return None,
    })
}

/// Whether a letter stands for text.
pub(super) fn is_text(letter: u8) -> bool {
    matches!(letter, b'n' | b'N' | b'Z')
}

/// Text of fixed length up to its first zero, without what could harm a terminal.
pub(super) fn plain_text(bytes: &[u8]) -> String {
    let end = memchr::memchr(0, bytes).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end])
        .chars()
        .filter(|c| !c.is_control())
        .collect::<String>()
        .trim_end()
        .into()
}
