//! Whether a long run's memory grows: the part of the process that lies in RAM, as Linux counts it.

use std::fmt;

/// By how much it may grow in the second half of a run. A leak grows there as it did before; what rare flights need for the first
/// time (a deeper stack, a longer list) has mostly been asked for.
const FLAT: f64 = 0.01;

/// Why it is not known.
#[derive(Debug, thiserror::Error)]
#[error("cannot read this process' memory from /proc/self/status: {0}; long runs need Linux")]
pub struct MemoryError(String);

/// Memory in use at two times of a run, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// After half of the run.
    pub half: u64,
    /// At the end.
    pub end: u64,
}

impl Memory {
    /// By which part it has grown; negative if it has shrunk.
    pub fn growth(&self) -> f64 {
        self.end as f64 / self.half as f64 - 1.0
    }

    /// It has not grown by more than 1 %.
    pub fn is_flat(&self) -> bool {
        self.growth() <= FLAT
    }
}

impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let (half, end, percent) = (mib(self.half), mib(self.end), 100.0 * self.growth());
        let grows = if self.is_flat() { "" } else { "  GROWS" };
        write!(f, "{half:.2} MiB after half of it, {end:.2} MiB at the end: {percent:+.2} %{grows}")
    }
}

/// What of this process lies in RAM now, bytes.
pub(super) fn resident() -> Result<u64, MemoryError> {
    let text = std::fs::read_to_string("/proc/self/status").map_err(|e| MemoryError(e.to_string()))?;
    parse(&text).ok_or_else(|| MemoryError("it has no line VmRSS in kB".into()))
}

fn parse(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_is_found_and_counts_in_units_of_1024() {
        let status = "Name:\tsil\nVmHWM:\t    9000 kB\nVmRSS:\t    4096 kB\nThreads:\t1\n";
        assert_eq!(parse(status), Some(4 << 20));
        assert_eq!(parse("VmRSS:\t 12 MB\n"), None);
        assert_eq!(parse(""), None);
    }

    /// 8 MiB that are written to are seen, and are more than 1 % of a test.
    #[test]
    fn memory_that_grows_is_not_flat() {
        let half = resident().unwrap();
        let more = vec![1_u8; 8 << 20];
        let memory = Memory { half, end: resident().unwrap() };
        assert!(memory.end - memory.half >= 7 << 20 && !memory.is_flat(), "{memory} {}", more.len());
        assert!(Memory { half: 10_000, end: 10_099 }.is_flat());
        assert!(Memory { half: 1000, end: 500 }.is_flat(), "given back");
        assert!(!Memory { half: 1000, end: 1011 }.is_flat());
    }
}
