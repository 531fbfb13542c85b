//! Plots and self-contained HTML pages, the same for every program of the project.
//!
//! Data goes in, text comes out: a [`Figure`] (or [`Panels`] stacked over one time axis) becomes an SVG, a [`Page`] of paragraphs,
//! tables and figures becomes one HTML file that opens without a network, prints, and can be read on a phone. The same input gives
//! the same bytes on every run: no clock, no random identifier, no environment is read.
//!
//! ```
//! use report::{Axis, Cell, Column, Figure, Mark, Page, Section, Series, Style, Table, Verdict};
//!
//! let rate = Figure::new("Roll rate", Axis::new("time", "s"), Axis::new("roll rate", "rad/s"))
//!     .with(Series::line("measured", Style::Measured, [(0.0, 0.1), (0.01, f64::NAN), (0.02, 0.3)]))
//!     .mark(Mark::limit("limit", 1.5));
//! let errors = Table::new("Error", [Column::text("flight"), Column::number("rms", "rad/s")])
//!     .row([Cell::from("A"), Cell::number(0.0231, 3).verdict(Verdict::Good)]);
//! let page = Page::new("Flight A", "The limit was kept.")
//!     .section(Section::new("Rates").figure(rate, "One sample is missing.").table(errors));
//! assert!(page.render().contains("0.0231"));
//! // page.write("flight-a.html")?;
//! ```
//!
//! Conventions:
//!
//! - Numbers for people are written by [`number`] and nowhere else.
//! - Every axis and every table column has a unit next to its name; values are SI unless the unit says otherwise.
//! - A [`Style`] is a role (measured, predicted before, predicted after, reference, limit), not a colour. Each role has one colour of
//!   the Okabe-Ito palette *and* one dash or width, so that print and colour-blind eyes can tell them apart.
//! - A value that cannot be drawn (NaN, infinite, beyond 1e100, not positive on a logarithmic axis) is a gap, never a zero.
//! - Long series are thinned to what the pixels can show, keeping the extremes of every pixel column: peaks stay. Beside the drawing,
//!   a page has up to 8192 samples of each line, for who looks at a part of it closely.
//!
//! Deliberately absent: scripts of others, fonts, colour maps, reading of data files, and the current date (the caller gives it).
#![forbid(unsafe_code)]

mod axis;
mod decimate;
mod draw;
mod figure;
mod file;
pub mod number;
mod page;
mod statistics;
mod style;

pub use axis::Axis;
pub use figure::{Figure, Kind, Mark, Panels, Series};
pub use file::{Error, check_writable, print, write_atomic};
pub use number::significant;
pub use page::{Cell, Column, InputFile, Page, Provenance, Section, Table, Verdict};
pub use plain_line::{LONGEST_ERROR, error_line, plain_line};
pub use statistics::{Bin, Sample, bin_statistics, binned_scatter, histogram};
pub use style::Style;
