//! What every command stands on: other programs, the workspace, tools, pages in Markdown, and counts of tests.

pub(crate) mod markdown;
pub(crate) mod process;
pub(crate) mod tally;
pub(crate) mod tools;
pub(crate) mod workspace;
