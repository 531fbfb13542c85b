//! The lab's page in a real browser, and attacks on its server: `quadlab lab` as a user has it, on
//! copies of flights in a temporary folder.
//!
//! Without Chromium and its driver (`cargo xtask setup`) the stories of the page are skipped by
//! name; the attacks over plain HTTP run everywhere.
#![forbid(unsafe_code)]

mod accessibility;
mod attacks;
mod browser;
mod discovery;
mod figures;
mod first_use;
mod flights;
mod folder;
mod many_flights;
mod notes;
mod own_effect;
mod page;
mod preview;
mod report_page;
mod server;
mod used;
