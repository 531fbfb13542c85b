//! Rust sources read with a parser: modules and their files, which file uses which, lengths.

mod attributes;
mod graph;
mod lengths;
mod names;
mod paths;
mod tree;

pub(crate) use attributes::for_tests;
pub(crate) use graph::Graph;
pub(crate) use lengths::lengths;
pub(crate) use names::arrows;
pub(crate) use tree::{SourceFile, Tree};
