//! Results as people read them: tables, figures and pages.

#[cfg(feature = "all-commands")]
pub(crate) mod campaign;
pub(crate) mod design_pages;
pub(crate) mod design_tables;
pub(crate) mod discovery;
pub(crate) mod discovery_page;
pub(crate) mod documents;
pub(crate) mod evidence;
pub(crate) mod excite_page;
pub(crate) mod figures;
#[cfg(feature = "all-commands")]
pub(crate) mod fleet;
#[cfg(feature = "all-commands")]
pub(crate) mod fleet_figures;
pub(crate) mod grid;
pub(crate) mod import_text;
pub(crate) mod pages;
pub(crate) mod stand_ins;
pub(crate) mod tables;
pub(crate) mod unpredicted;
pub(crate) mod view;

/// "1 flight", "2 flights".
pub(crate) fn counted(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
