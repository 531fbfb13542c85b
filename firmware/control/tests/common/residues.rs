//! Where the arithmetic of counters and clocks goes wrong first: tests of several crates take their numbers from here.
//!
//! Those in modules `arithmetic` need no interpreter that looks at memory: Miri leaves them out, and gets few numbers elsewhere.
#![allow(dead_code, reason = "each crate's tests use what they need")]

/// 0, every power of two and its neighbours, and as much below 2^32: wherever a bit, a sign or a carry changes.
pub(crate) fn residues() -> Vec<u32> {
    residues_u64().into_iter().filter_map(|wide| u32::try_from(wide).ok()).chain(negatives()).collect()
}

fn negatives() -> impl Iterator<Item = u32> {
    (0..31).flat_map(|bit| [1_u32 << bit, (1 << bit) + 1]).map(u32::wrapping_neg)
}

/// The same of 2^64.
pub(crate) fn residues_u64() -> Vec<u64> {
    let near = |bit: u32| [(1_u64 << bit) - 1, 1 << bit, (1 << bit) + 1];
    let mut all: Vec<u64> = (0..64).flat_map(near).flat_map(|n| [n, n.wrapping_neg()]).collect();
    all.sort_unstable();
    all.dedup();
    all.into_iter().step_by(if cfg!(miri) { 29 } else { 1 }).collect()
}

/// A few of them, where every one is combined with every other.
pub(crate) const FEW: [u32; 10] =
    [0, 1, 9_999, 1 << 16, (1 << 31) - 1, 1 << 31, (1 << 31) + 1, u32::MAX - 10_000, u32::MAX - 1, u32::MAX];

/// What a clock may have counted in all when it shows such a number, and what it counts meanwhile stays positive.
pub(crate) const TURN: i128 = 1 << 32;

/// All of a range where `QUADLAB_EXHAUSTIVE` is set, as at night; else every `stride`th. A stride that is odd meets every residue of
/// small powers of two.
pub(crate) fn stride(otherwise: usize) -> usize {
    if std::env::var_os("QUADLAB_EXHAUSTIVE").is_some() { 1 } else { otherwise }
}
