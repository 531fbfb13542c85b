//! Whether a long run's memory grows: the part of the process that lies in RAM, as Linux counts it.

use std::fmt;

/// By how much it may grow from the first tenth of a run to its end.
const FLAT: f64 = 0.01;

/// Why it is not known.
#[derive(Debug, thiserror::Error)]
#[error("cannot read this process' memory from /proc/self/status: {0}; long runs need Linux")]
pub struct MemoryError(String);

/// Memory in use at two times of a run, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// At the end of the first tenth: what a run needs has been asked for.
    pub early: u64,
    /// At the end.
    pub late: u64,
}

impl Memory {
    /// By which part it has grown; negative if it has shrunk.
    pub fn growth(&self) -> f64 {
        self.late as f64 / self.early as f64 - 1.0
    }

    /// It has not grown by more than 1 %.
    pub fn is_flat(&self) -> bool {
        self.growth() <= FLAT
    }
}

impl fmt::Display for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let (early, late, percent) = (mib(self.early), mib(self.late), 100.0 * self.growth());
        let grows = if self.is_flat() { "" } else { "  GROWS" };
        write!(f, "{early:.2} MiB after the first tenth, {late:.2} MiB at the end: {percent:+.2} %{grows}")
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
        let early = resident().unwrap();
        let more = vec![1_u8; 8 << 20];
        let memory = Memory { early, late: resident().unwrap() };
        assert!(memory.late - memory.early >= 7 << 20 && !memory.is_flat(), "{memory} {}", more.len());
        assert!(Memory { early: 10_000, late: 10_099 }.is_flat());
        assert!(Memory { early: 1000, late: 500 }.is_flat(), "given back");
        assert!(!Memory { early: 1000, late: 1011 }.is_flat());
    }
}
