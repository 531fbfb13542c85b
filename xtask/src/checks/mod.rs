//! The checks of `cargo xtask test` that are ours: each is a function from plain data to a list of problems.

pub(crate) mod arrows;
pub(crate) mod crates;
pub(crate) mod dependencies;
pub(crate) mod flying;
pub(crate) mod folders;
pub(crate) mod known;
pub(crate) mod promises;
pub(crate) mod scripts;
pub(crate) mod structure;
pub(crate) mod tidy;
