//! What every command stands on: other programs, the workspace, tools, and counts of tests.

pub(crate) mod process;
pub(crate) mod tally;
pub(crate) mod tools;
pub(crate) mod workspace;
