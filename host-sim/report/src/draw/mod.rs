//! From figure to SVG, with `plotters` for everything inside the axes.

mod canvas;
mod data;
mod document;
mod layout;
mod legend;
mod plot;
mod text;

pub(crate) use document::{Drawn, draw};
pub(crate) use text::printable;
