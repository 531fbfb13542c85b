//! `quadlab lab`: the whole loop on a page in the browser, served on this machine alone.
//!
//! The page calls the one workflow (`diagnosis::workflow`) and draws what it returns; nothing here computes a verdict. What
//! the user did lies in `lab/` beside the flights: models as ordinary model files, diagnoses as JSON, effects of the user's own,
//! and `state.json`.

mod assets;
mod equations;
mod events;
mod flights;
mod guard;
mod jobs;
mod links;
mod next;
mod node;
mod notes;
mod numbers;
mod own_effect;
mod own_effects;
mod own_routes;
mod preview;
mod reading;
mod refused;
mod requests;
mod room;
mod routes;
mod server;
mod session;
mod store;
mod terminal;
mod timeline;
mod trials;
mod upload;
mod used_parts;
mod vehicle;
mod views;

pub(crate) use server::{Options, serve};
