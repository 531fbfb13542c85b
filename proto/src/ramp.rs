//! Ramps of time: microseconds modulo 2^32, 71.6 minutes.

/// Turns microseconds modulo 2^32 into ones that go on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Unwrapped {
    last: Option<(u32, i64)>,
}

impl Unwrapped {
    /// The next value; steps of up to 35 minutes either way are understood.
    pub fn push(&mut self, us: u32) -> i64 {
        let whole = match self.last {
            None => i64::from(us),
            Some((before, whole)) => whole + i64::from(us.wrapping_sub(before).cast_signed()),
        };
        self.last = Some((us, whole));
        whole
    }
}
