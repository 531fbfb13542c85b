//! Single records: what their bytes say, and how far to believe that they are a record at all.

/// Bytes before the first record: magic, version, time at which logging started.
pub(super) const HEADER_BYTES: usize = 16;

/// Bytes of a record's header: size of the body, kind.
pub(super) const RECORD_HEADER_BYTES: usize = 3;

/// What a synchronisation record holds.
const SYNC_MAGIC: [u8; 8] = [0x2F, 0x73, 0x13, 0x20, 0x25, 0x0C, 0xBB, 0x12];

/// A record of the file, its body not looked at.
#[derive(Clone, Copy)]
pub(super) struct Raw<'a> {
    /// The letter that says what it is.
    pub(super) kind: u8,
    /// Where the body starts in the file.
    pub(super) body_at: usize,
    /// What follows the header.
    pub(super) body: &'a [u8],
}

impl<'a> Raw<'a> {
    /// The record at a place, if it ends before `end`.
    pub(super) fn at(bytes: &'a [u8], at: usize, end: usize) -> Option<Self> {
        let bytes = bytes.get(..end)?;
        let &[low, high, kind] = bytes.get(at..)?.first_chunk::<RECORD_HEADER_BYTES>()?;
        let body_at = at + RECORD_HEADER_BYTES;
        let size = usize::from(u16::from_le_bytes([low, high]));
        Some(Self { kind, body_at, body: bytes.get(body_at..)?.get(..size)? })
    }

    /// Where the next record starts.
    pub(super) fn next(&self) -> usize {
        self.body_at + self.body.len()
    }
}

/// How far bytes can be believed to be a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Belief {
    /// Its length and content fit each other: chance does not make this.
    Certain,
    /// Nothing speaks against it; what follows it must decide.
    Possible,
    /// Of a kind or topic that is not known: what follows and what it holds must decide.
    Unknown,
    /// It is none.
    No,
}

/// How far a record can be believed by itself, for all kinds that need no knowledge of the log.
pub(super) fn belief(record: Raw<'_>) -> Belief {
    let body = record.body;
    let if_possible = |possible| if possible { Belief::Possible } else { Belief::No };
    match record.kind {
        b'S' if body == SYNC_MAGIC => Belief::Certain,
        b'S' => Belief::No,
        b'I' => belief_of_pair(pair(body)),
        b'P' => belief_of_parameter(body),
        b'M' => belief_of_pair(
            body.split_first().filter(|(flag, _)| **flag <= 1).and_then(|(_, rest)| pair(rest)),
        ),
        b'Q' => body.split_first().map_or(Belief::No, |(_, rest)| belief_of_parameter(rest)),
        b'L' => if_possible(text(body, 9).is_some()),
        b'C' => if_possible(text(body, 11).is_some()),
        b'O' | b'R' => if_possible(body.len() == 2),
        b'B' => if_possible(body.len() >= FLAG_BITS_BYTES),
        // Later versions may add kinds: they are passed over.
        kind if kind.is_ascii_alphanumeric() && !body.is_empty() => Belief::Unknown,
        _ => Belief::No,
    }
}

fn belief_of_pair(pair: Option<Pair<'_>>) -> Belief {
    match pair {
        Some(pair)
            if pair.kind.bytes().and_then(|size| size.checked_mul(pair.count)) == Some(pair.value.len()) =>
        {
            Belief::Certain
        }
        Some(_) => Belief::Possible,
        None => Belief::No,
    }
}

fn belief_of_parameter(body: &[u8]) -> Belief {
    match pair(body) {
        Some(Pair { kind: Kind::F32 | Kind::I32, count: 1, value, .. }) if value.len() == 4 => {
            Belief::Certain
        }
        _ => Belief::No,
    }
}

/// A type of the specification.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Bool,
    Char,
    /// Another format, or nothing that is known.
    Named,
}

impl Kind {
    pub(super) fn of(name: &str) -> Self {
        match name {
            "int8_t" => Self::I8,
            "uint8_t" => Self::U8,
            "int16_t" => Self::I16,
            "uint16_t" => Self::U16,
            "int32_t" => Self::I32,
            "uint32_t" => Self::U32,
            "int64_t" => Self::I64,
            "uint64_t" => Self::U64,
            "float" => Self::F32,
            "double" => Self::F64,
            "bool" => Self::Bool,
            "char" => Self::Char,
            _ => Self::Named,
        }
    }

    /// Size of a value; none for a format.
    pub(super) fn bytes(self) -> Option<usize> {
        match self {
            Self::I8 | Self::U8 | Self::Bool | Self::Char => Some(1),
            Self::I16 | Self::U16 => Some(2),
            Self::I32 | Self::U32 | Self::F32 => Some(4),
            Self::I64 | Self::U64 | Self::F64 => Some(8),
            Self::Named => None,
        }
    }
}

/// `float[3] name` taken apart: type, how many, name.
pub(super) fn typed_name(text: &str) -> Option<(&str, usize, &str)> {
    let (kind, name) = text.trim().split_once(' ')?;
    let (kind, count) = match kind.split_once('[') {
        Some((kind, count)) => (kind, count.strip_suffix(']')?.parse().ok()?),
        None => (kind, 1),
    };
    (is_name(kind) && is_name(name)).then_some((kind, count, name))
}

/// Whether these are the characters that names may have.
pub(super) fn is_name(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"_-/".contains(&byte))
}

/// A value with its name: an information or a parameter.
pub(super) struct Pair<'a> {
    pub(super) kind: Kind,
    /// How many values its type says.
    pub(super) count: usize,
    pub(super) name: &'a str,
    pub(super) value: &'a [u8],
}

/// The pair in a body: length of the key, key, value.
pub(super) fn pair(body: &[u8]) -> Option<Pair<'_>> {
    let (&length, rest) = body.split_first()?;
    let (key, value) = rest.split_at_checked(usize::from(length))?;
    let (kind, count, name) = typed_name(std::str::from_utf8(key).ok()?)?;
    Some(Pair { kind: Kind::of(kind), count, name, value })
}

/// Level and text of a logged string, whose text starts at `start`.
pub(super) fn text(body: &[u8], start: usize) -> Option<&[u8]> {
    let text = body.get(start..)?;
    // Only the beginning: a text that is looked through at every place of a file would take too long.
    let beginning = &text[..text.len().min(64)];
    let printed = beginning.iter().all(|&byte| byte >= b' ' || byte.is_ascii_whitespace() || byte == 0x1b);
    (printed && body.first().is_some_and(|level| (b'0'..=b'7').contains(level) || *level <= 7))
        .then_some(text)
}

/// Instance, number and name in a subscription.
pub(super) fn subscription(body: &[u8]) -> Option<(u8, u16, &str)> {
    let (&[instance, low, high], name) = body.split_first_chunk::<3>()?;
    let name = std::str::from_utf8(name).ok()?;
    is_name(name).then_some((instance, u16::from_le_bytes([low, high]), name))
}

/// Least size of a flag record's body.
const FLAG_BITS_BYTES: usize = 40;

/// What a flag record says, which may only be the first one.
#[derive(Clone, Copy)]
pub(super) struct FlagBits<'a> {
    body: &'a [u8; FLAG_BITS_BYTES],
}

/// The flag record of a file, if it has one.
pub(super) fn flag_bits(bytes: &[u8]) -> Option<FlagBits<'_>> {
    let record = Raw::at(bytes, HEADER_BYTES, bytes.len()).filter(|record| record.kind == b'B')?;
    Some(FlagBits { body: record.body.first_chunk()? })
}

impl FlagBits<'_> {
    /// The number of the first byte with an incompatible flag that the specification does not name.
    pub(super) fn unknown_incompatible(self) -> Option<usize> {
        let incompatible = &self.body[8..16];
        incompatible.iter().enumerate().position(|(byte, &flags)| flags & !u8::from(byte == 0) != 0)
    }

    /// Where appended data starts: places within the file, rising.
    pub(super) fn appended(self, end: usize) -> Vec<usize> {
        let mut places = Vec::new();
        if self.body[8] & 1 == 0 {
            return places;
        }
        for offset in self.body[16..].as_chunks::<8>().0 {
            let last = places.last().copied().unwrap_or(HEADER_BYTES);
            match usize::try_from(u64::from_le_bytes(*offset)) {
                Ok(offset) if offset > last && offset < end => places.push(offset),
                _ => {}
            }
        }
        places
    }
}
