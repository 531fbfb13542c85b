//! One HTML file with everything in it: text, tables, figures and where they come from.
//!
//! All text is escaped. The page refers to nothing outside itself, is well-formed XML as well as HTML, follows the reader's light or
//! dark setting (figures stay on a white card), and breaks sensibly when printed. Its one script is ours: it shows values under the
//! pointer and zooms. Figures are there without it, and on paper.

use std::path::Path;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::draw::{Drawn, draw, printable};
use crate::figure::Panels;
use crate::file::{Error, write_atomic};
use crate::number::{significant, unit};

/// Width of a figure on the page, CSS pixels.
const FIGURE_WIDTH_PX: u32 = 820;
const SINGLE_HEIGHT_PX: u32 = 380;
const PANEL_HEIGHT_PX: u32 = 210;

/// A whole page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Title of the window and first heading.
    pub title: String,
    /// First paragraph: what the reader should take away.
    pub lead: String,
    /// In reading order.
    pub sections: Vec<Section>,
    /// Footer: how to make this page again.
    pub provenance: Provenance,
}

/// A heading and what stands below it.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Heading; may be empty.
    pub heading: String,
    blocks: Vec<Block>,
}

#[derive(Clone, Debug)]
enum Block {
    Paragraph(String),
    List(Vec<String>),
    Preformatted(String),
    Table(Table),
    Figure { svg: String, data: String, caption: String },
}

/// Where the numbers on a page come from. All text is given by the caller; empty fields are left out.
#[derive(Clone, Debug, Default)]
pub struct Provenance {
    /// The command as typed.
    pub command_line: String,
    /// Name and version of the program.
    pub version: String,
    /// Date of the run; left empty, the page is the same on every run.
    pub date: String,
    /// Files that were read.
    pub inputs: Vec<InputFile>,
}

/// A file that was read.
#[derive(Clone, Debug)]
pub struct InputFile {
    /// Path as the user gave it.
    pub path: String,
    /// Hash of the content with the name of its algorithm, such as `sha256:9f86…`.
    pub hash: String,
}

/// A table with one heading per column.
#[derive(Clone, Debug, Default)]
pub struct Table {
    /// Shown above the table; may be empty.
    pub caption: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

/// Heading, unit and alignment of a column.
#[derive(Clone, Debug, Default)]
pub struct Column {
    heading: String,
    unit: String,
    numeric: bool,
}

/// What a cell says about its content, shown by a symbol and a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// ✓ green.
    Good,
    /// ✗ red.
    Bad,
    /// – grey.
    Neutral,
}

/// One entry of a table.
#[derive(Clone, Debug, Default)]
pub struct Cell {
    text: String,
    verdict: Option<Verdict>,
}

impl Page {
    /// A page without sections.
    pub fn new(title: impl Into<String>, lead: impl Into<String>) -> Self {
        Self { title: title.into(), lead: lead.into(), ..Self::default() }
    }

    /// Adds a section at the end.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// Sets the footer.
    #[must_use]
    pub fn provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = provenance;
        self
    }

    /// The complete HTML text.
    #[must_use]
    pub fn render(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" xmlns="http://www.w3.org/1999/xhtml" {
                head {
                    (PreEscaped(META))
                    title { (self.title) }
                    style { (PreEscaped(STYLE_SHEET)) }
                }
                body {
                    main {
                        h1 { (self.title) }
                        @if !self.lead.is_empty() { p.lead { (self.lead) } }
                        @for section in &self.sections { (section.markup()) }
                    }
                    (self.provenance.markup())
                    @if self.has_figures() { script type="module" { (PreEscaped(SCRIPT)) } }
                }
            }
        };
        printable(&page.into_string())
    }

    fn has_figures(&self) -> bool {
        let blocks = || self.sections.iter().flat_map(|section| &section.blocks);
        blocks().any(|block| matches!(block, Block::Figure { .. }))
    }

    /// Renders the page and replaces the file at `path` with it, whole or not at all.
    ///
    /// # Errors
    /// Those of [`write_atomic`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        write_atomic(path, self.render())
    }
}

impl Section {
    /// A section without content.
    pub fn new(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), blocks: vec![] }
    }

    /// Adds a paragraph.
    #[must_use]
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.with(Block::Paragraph(text.into()))
    }

    /// Adds a list with bullets.
    #[must_use]
    pub fn list<T: Into<String>>(self, items: impl IntoIterator<Item = T>) -> Self {
        self.with(Block::List(items.into_iter().map(Into::into).collect()))
    }

    /// Adds text that keeps its line breaks and columns.
    #[must_use]
    pub fn preformatted(self, text: impl Into<String>) -> Self {
        self.with(Block::Preformatted(text.into()))
    }

    /// Adds a table.
    #[must_use]
    pub fn table(self, table: Table) -> Self {
        self.with(Block::Table(table))
    }

    /// Adds a figure or a stack of them, in the size of the page, with a caption that says what to see.
    #[must_use]
    pub fn figure(self, figure: impl Into<Panels>, caption: impl Into<String>) -> Self {
        let panels = figure.into();
        let height = match panels.figures.as_slice() {
            [figure] if figure.equal_scale => FIGURE_WIDTH_PX * 3 / 4,
            [] | [_] => SINGLE_HEIGHT_PX,
            more => {
                60 + PANEL_HEIGHT_PX
                    * u32::try_from(more.len()).unwrap_or(u32::MAX / PANEL_HEIGHT_PX).min(100)
            }
        };
        let Drawn { svg, data } = draw(&panels.figures, FIGURE_WIDTH_PX, height);
        self.with(Block::Figure { svg, data, caption: caption.into() })
    }

    fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    fn markup(&self) -> Markup {
        html! {
            section {
                @if !self.heading.is_empty() { h2 { (self.heading) } }
                @for block in &self.blocks { (block.markup()) }
            }
        }
    }
}

impl Block {
    fn markup(&self) -> Markup {
        match self {
            Self::Paragraph(text) => html! { p { (text) } },
            Self::List(items) => html! { ul { @for item in items { li { (item) } } } },
            // The line break after the tag is dropped by HTML: it keeps a first empty line of the text.
            Self::Preformatted(text) => html! { pre tabindex="0" { "\n" (text) } },
            Self::Table(table) => table.markup(),
            Self::Figure { svg, data, caption } => html! {
                figure {
                    div.card tabindex="0" { (PreEscaped(svg)) }
                    script type="application/json" { (PreEscaped(data)) }
                    @if !caption.is_empty() { figcaption { (caption) } }
                }
            },
        }
    }
}

impl Provenance {
    fn markup(&self) -> Markup {
        let fields = [("Command", &self.command_line), ("Version", &self.version), ("Date", &self.date)];
        if fields.iter().all(|(_, text)| text.is_empty()) && self.inputs.is_empty() {
            return html! {};
        }
        html! {
            footer {
                h2 { "How this page was made" }
                dl {
                    @for (name, text) in fields.iter().filter(|(_, text)| !text.is_empty()) {
                        dt { (name) }
                        dd { code { (text) } }
                    }
                    @if !self.inputs.is_empty() {
                        dt { "Read" }
                        @for InputFile { path, hash } in &self.inputs {
                            dd { code { (path) } " " code.hash { (hash) } }
                        }
                    }
                }
            }
        }
    }
}

impl Table {
    /// A table without rows.
    pub fn new(caption: impl Into<String>, columns: impl Into<Vec<Column>>) -> Self {
        Self { caption: caption.into(), columns: columns.into(), rows: vec![] }
    }

    /// Adds a row. Missing cells are left empty; surplus cells are shown in columns without heading.
    pub fn push(&mut self, row: impl IntoIterator<Item = impl Into<Cell>>) {
        self.rows.push(row.into_iter().map(Into::into).collect());
    }

    /// Adds a row, for tables written in one go.
    #[must_use]
    pub fn row(mut self, row: impl IntoIterator<Item = impl Into<Cell>>) -> Self {
        self.push(row);
        self
    }

    fn markup(&self) -> Markup {
        let widest = self.rows.iter().map(Vec::len).max().unwrap_or(0).max(self.columns.len());
        let surplus = Column::default();
        let nothing = Cell::default();
        let columns: Vec<_> = self.columns.iter().chain(std::iter::repeat(&surplus)).take(widest).collect();
        html! {
            div.scroll tabindex="0" {
                table {
                    @if !self.caption.is_empty() { caption { (self.caption) } }
                    thead { tr { @for column in &columns { (column.markup()) } } }
                    tbody {
                        @for row in &self.rows {
                            tr {
                                @for (cell, column) in row.iter().chain(std::iter::repeat(&nothing)).zip(&columns) {
                                    (cell.markup(column))
                                }
                            }
                        }
                        @if self.rows.is_empty() { tr { td colspan=(widest.max(1)) { "no data" } } }
                    }
                }
            }
        }
    }
}

impl Column {
    /// A column of words, aligned left.
    pub fn text(heading: impl Into<String>) -> Self {
        Self { heading: heading.into(), ..Self::default() }
    }

    /// A column of numbers in `unit` (may be empty), aligned right.
    pub fn number(heading: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { heading: heading.into(), unit: unit.into(), numeric: true }
    }

    fn class(&self) -> Option<&'static str> {
        self.numeric.then_some("number")
    }

    fn markup(&self) -> Markup {
        html! {
            th scope="col" class=[self.class()] {
                (self.heading)
                @if !unit(&self.unit).is_empty() { " " span.unit { "[" (self.unit) "]" } }
            }
        }
    }
}

impl Verdict {
    fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Bad => "bad",
            Self::Neutral => "neutral",
        }
    }

    fn symbol(self) -> &'static str {
        match self {
            Self::Good => "✓",
            Self::Bad => "✗",
            Self::Neutral => "–",
        }
    }
}

impl Cell {
    /// A number with `digits` significant digits, written by [`significant`]; one that is not finite reads `–`.
    #[must_use]
    pub fn number(value: f64, digits: usize) -> Self {
        let text = if value.is_finite() { significant(value, digits) } else { "–".to_owned() };
        Self { text, verdict: None }
    }

    /// Marks the cell.
    #[must_use]
    pub fn verdict(mut self, verdict: Verdict) -> Self {
        self.verdict = Some(verdict);
        self
    }

    fn markup(&self, column: &Column) -> Markup {
        html! {
            td class=[column.class()] {
                @if let Some(verdict) = self.verdict {
                    span class=(verdict.class()) { (verdict.symbol()) "\u{a0}" (self.text) }
                } @else {
                    (self.text)
                }
            }
        }
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self { text: text.to_owned(), verdict: None }
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self { text, verdict: None }
    }
}

/// Closed with a slash, as XML wants and HTML allows; maud writes void elements without.
const META: &str = "<meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
                    <meta name=\"color-scheme\" content=\"light dark\"/>";

/// Values under the pointer and zooming, for readers with scripts. XML reads nothing in it, and HTML takes the marks for remarks.
const SCRIPT: &str = concat!(
    "//<![CDATA[\n",
    include_str!("plots/numbers.js"),
    include_str!("plots/closer.js"),
    include_str!("plots/plots.js"),
    "//]]>"
);

/// Contains neither `<` nor `&`, so that it is the same text in HTML and XML.
const STYLE_SHEET: &str = "
:root { color-scheme: light dark; --ink: #1d1d1f; --soft: #57606a; --line: #d0d7de; --paper: #ffffff; --shade: #f4f6f8;
  --good: #00684b; --bad: #b03a00; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e6e6; --soft: #a5adb6; --line: #444c56; --paper: #16191d; --shade: #22272e; --good: #43c59e; --bad: #ff9a62; } }
* { box-sizing: border-box; }
body { margin: 0; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, 'Segoe UI', Roboto, 'Liberation Sans', Arial, sans-serif; }
main, footer { max-width: 54rem; margin: 0 auto; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0.5rem 0; overflow-wrap: anywhere; }
h2 { font-size: 1.25rem; line-height: 1.3; margin: 2rem 0 0.5rem; overflow-wrap: anywhere; }
p, li { max-width: 45rem; overflow-wrap: break-word; }
.lead { font-size: 1.1rem; color: var(--soft); }
.scroll, .card, pre { overflow-x: auto; }
table { border-collapse: collapse; margin: 0.75rem 0; font-size: 0.95rem; }
caption { text-align: left; font-weight: 600; padding: 0.25rem 0; }
th, td { padding: 0.3rem 0.75rem; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
th { background: var(--shade); border-bottom-width: 2px; vertical-align: bottom; }
.unit { font-weight: normal; color: var(--soft); white-space: nowrap; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.good { color: var(--good); font-weight: 600; }
.bad { color: var(--bad); font-weight: 600; }
.neutral { color: var(--soft); }
figure { margin: 1rem 0; break-inside: avoid; }
.card { background: #ffffff; border: 1px solid var(--line); border-radius: 6px; padding: 4px; }
.card svg { display: block; width: 100%; min-width: 600px; height: auto; }
figure { position: relative; }
.card.live svg { cursor: crosshair; user-select: none; -webkit-user-select: none; }
.reading { position: absolute; z-index: 1; pointer-events: none; padding: 0.25rem 0.5rem; border: 1px solid #8a939d; border-radius: 5px;
  background: #fffffff0; color: #1d1d1f; font-size: 0.8125rem; line-height: 1.4; font-variant-numeric: tabular-nums; max-width: 60%; }
.reading div { display: flex; gap: 0.5rem; align-items: center; white-space: nowrap; }
.reading b { margin-left: auto; padding-left: 0.5rem; }
.plot-tools { display: flex; flex-wrap: wrap; gap: 0.3rem; align-items: center; margin-top: 0.3rem; color: var(--soft); font-size: 0.875rem; }
.plot-tools button { min-width: 2rem; font: inherit; color: var(--ink); background: var(--shade); border: 1px solid var(--soft);
  border-radius: 5px; padding: 0.1rem 0.5rem; }
.plot-tools button:disabled { color: var(--soft); border-color: var(--line); }
.spoken { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); white-space: nowrap; }
figcaption { color: var(--soft); font-size: 0.95rem; margin-top: 0.4rem; max-width: 45rem; }
pre, code { font-family: ui-monospace, 'DejaVu Sans Mono', Menlo, Consolas, monospace; font-size: 0.875rem; }
pre { background: var(--shade); border: 1px solid var(--line); border-radius: 6px; padding: 0.75rem; }
footer { margin-top: 3rem; padding-top: 0.5rem; border-top: 1px solid var(--line); color: var(--soft); font-size: 0.9rem; }
footer h2 { font-size: 1rem; margin-top: 0.5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 0.2rem 1rem; }
dt { font-weight: 600; grid-column: 1; }
dd { margin: 0; grid-column: 2; overflow-wrap: anywhere; }
@media (max-width: 600px) { th, td { padding: 0.3rem 0.4rem; } table { font-size: 0.875rem; } }
@media print {
  :root { --ink: #000000; --soft: #333333; --line: #999999; --paper: #ffffff; --shade: #f2f2f2; --good: #00553d; --bad: #8f2f00; }
  body { padding: 0; font-size: 10pt; }
  .scroll, .card, pre { overflow: visible; }
  .card { border: 0; padding: 0; }
  .reading, .plot-tools, .spoken, .closer { display: none; }
  .card svg { min-width: 0; }
  pre { white-space: pre-wrap; overflow-wrap: anywhere; }
  tr { break-inside: avoid; }
  h1, h2, caption { break-after: avoid; }
}
";
