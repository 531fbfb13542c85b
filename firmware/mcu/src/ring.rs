//! Bytes between an interrupt and the main loop, one way.
//!
//! One side pushes, the other pops; each counts on its own, so no lock is needed. What does not fit
//! is refused whole.

use core::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

use embedded_io::ErrorKind;

/// A ring of `N` bytes; `N` is a power of two.
#[derive(Debug)]
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Bytes pushed so far, modulo 2^32 or so.
    pushed: AtomicUsize,
    /// Bytes popped so far.
    popped: AtomicUsize,
}

impl<const N: usize> Default for Ring<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Ring<N> {
    const POWER_OF_TWO: () = assert!(N.is_power_of_two(), "positions go on where the counts wrap");

    /// An empty ring.
    pub const fn new() -> Self {
        let () = Self::POWER_OF_TWO;
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            pushed: AtomicUsize::new(0),
            popped: AtomicUsize::new(0),
        }
    }

    /// Bytes that can be popped.
    pub fn len(&self) -> usize {
        self.pushed.load(Ordering::Acquire).wrapping_sub(self.popped.load(Ordering::Acquire))
    }

    /// Nothing to pop?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Takes all of `bytes` or none, and says whether it did.
    pub fn push(&self, bytes: &[u8]) -> bool {
        if bytes.len() > N - self.len().min(N) {
            return false;
        }
        let start = self.pushed.load(Ordering::Relaxed);
        for (k, byte) in bytes.iter().enumerate() {
            if let Some(place) = self.bytes.get(start.wrapping_add(k) % N) {
                place.store(*byte, Ordering::Relaxed);
            }
        }
        // Only now the other side may look at them.
        self.pushed.store(start.wrapping_add(bytes.len()), Ordering::Release);
        true
    }

    /// The oldest byte.
    pub fn pop(&self) -> Option<u8> {
        if self.is_empty() {
            return None;
        }
        let popped = self.popped.load(Ordering::Relaxed);
        let byte = self.bytes.get(popped % N)?.load(Ordering::Relaxed);
        self.popped.store(popped.wrapping_add(1), Ordering::Release);
        Some(byte)
    }
}

/// The main loop's end of a serial port whose interrupts work on two rings.
#[derive(Debug, Clone, Copy)]
pub struct Serial<'a, const RX: usize, const TX: usize> {
    /// Bytes that have come.
    pub received: &'a Ring<RX>,
    /// Bytes to send.
    pub to_send: &'a Ring<TX>,
    /// Starts the sending.
    pub start: fn(),
}

/// There was no room for all of the bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Full;

impl core::fmt::Display for Full {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("no room in the buffer of the serial port")
    }
}

impl core::error::Error for Full {}

impl embedded_io::Error for Full {
    fn kind(&self) -> ErrorKind {
        ErrorKind::OutOfMemory
    }
}

impl<const RX: usize, const TX: usize> embedded_io::ErrorType for Serial<'_, RX, TX> {
    type Error = Full;
}

impl<const RX: usize, const TX: usize> embedded_io::Read for Serial<'_, RX, TX> {
    /// What has come; nothing if nothing has, without waiting.
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Full> {
        let mut count = 0;
        for (place, byte) in buffer.iter_mut().zip(core::iter::from_fn(|| self.received.pop())) {
            *place = byte;
            count += 1;
        }
        Ok(count)
    }
}

impl<const RX: usize, const TX: usize> embedded_io::ReadReady for Serial<'_, RX, TX> {
    fn read_ready(&mut self) -> Result<bool, Full> {
        Ok(!self.received.is_empty())
    }
}

impl<const RX: usize, const TX: usize> embedded_io::Write for Serial<'_, RX, TX> {
    /// All or nothing, without waiting.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Full> {
        if !self.to_send.push(bytes) {
            return Err(Full);
        }
        (self.start)();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<(), Full> {
        (self.start)();
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_holds_what_it_can_and_refuses_the_rest_whole() {
        let ring = Ring::<8>::new();
        assert!(ring.push(b"abcde") && !ring.push(b"fghi") && ring.push(b"fgh") && !ring.push(b"x"));
        let all: Vec<u8> = std::iter::from_fn(|| ring.pop()).collect();
        assert_eq!(all, b"abcdefgh");
        assert_eq!(ring.pop(), None);
    }

    /// A hundred thousand bytes past another thread, in pieces of changing size.
    #[test]
    fn bytes_arrive_in_order_across_threads() {
        static RING: Ring<64> = Ring::new();
        const COUNT: u32 = 100_000;
        let sender = std::thread::spawn(|| {
            let mut next = 0_u32;
            while next < COUNT {
                let piece: Vec<u8> = (next..COUNT.min(next + 1 + next % 13)).map(|k| k as u8).collect();
                if RING.push(&piece) {
                    next += piece.len() as u32;
                } else {
                    std::thread::yield_now();
                }
            }
        });
        for k in 0..COUNT {
            let byte = loop {
                if let Some(byte) = RING.pop() {
                    break byte;
                }
                std::thread::yield_now();
            };
            assert_eq!(byte, k as u8, "byte {k}");
        }
        sender.join().unwrap();
    }

    #[test]
    fn a_serial_port_reads_what_came_and_writes_all_or_nothing() {
        use embedded_io::{Read, Write};
        let (received, to_send) = (Ring::<4>::new(), Ring::<4>::new());
        let mut port = Serial { received: &received, to_send: &to_send, start: || {} };
        assert_eq!(port.read(&mut [0; 3]), Ok(0));
        received.push(b"abcd");
        let mut three = [0; 3];
        assert_eq!((port.read(&mut three), three), (Ok(3), *b"abc"));
        assert_eq!((port.write(b"xyz"), port.write(b"uv")), (Ok(3), Err(Full)));
        assert_eq!(to_send.len(), 3);
    }

    /// Rings of 1 to 16 bytes that have counted to every boundary of usize, with every number of bytes in
    /// them and as many more, against a queue.
    #[test]
    fn counts_wrap_and_bytes_stay() {
        fn check<const N: usize>() {
            let shift = u64::BITS - usize::BITS;
            for count in crate::residues::residues_u64() {
                let count = (count >> shift) as usize;
                for held in 0..=N {
                    for more in 0..=N + 1 {
                        let counts = [count.wrapping_add(held), count].map(AtomicUsize::new);
                        let [pushed, popped] = counts;
                        let ring = Ring { pushed, popped, ..Ring::<N>::new() };
                        let mut queue: std::collections::VecDeque<u8> =
                            std::iter::repeat_n(0, held).collect();
                        let bytes: Vec<u8> = (1..=more as u8).collect();
                        assert_eq!(ring.push(&bytes), held + more <= N, "{count} {held} {more}");
                        if held + more <= N {
                            queue.extend(&bytes);
                        }
                        assert_eq!((ring.len(), ring.is_empty()), (queue.len(), queue.is_empty()));
                        while let Some(byte) = queue.pop_front() {
                            assert_eq!(ring.pop(), Some(byte), "{count} {held} {more}");
                        }
                        assert_eq!(ring.pop(), None);
                    }
                }
            }
        }
        check::<1>();
        check::<2>();
        check::<8>();
        check::<16>();
    }
}
