//! Models that came of each other.

use std::sync::Arc;

use model::{AXES, Effect, Model};
use serde_json::{Value, json};

/// A model and where it comes from.
#[derive(Debug, Clone)]
pub(super) struct Node {
    pub(super) id: u32,
    pub(super) parent: Option<u32>,
    /// The effect that made it of its parent.
    pub(super) effect: Option<String>,
    /// Whether the flights support that.
    pub(super) supported: Option<bool>,
    /// The same in a terminal.
    pub(super) command: String,
    /// What the user wrote about it.
    pub(super) note: String,
    pub(super) model: Arc<Model>,
    /// The document of `quadlab diagnose --json`.
    pub(super) diagnosis: Option<Value>,
    /// The document of `quadlab diagnose --changed --json`.
    pub(super) changes: Option<Value>,
    /// The document of `quadlab discover --json`.
    pub(super) discovery: Option<Value>,
}

impl Node {
    /// A model that was made just now.
    pub(super) fn of(id: u32, from: Option<(u32, Effect)>, model: Model) -> Self {
        Self {
            id,
            parent: from.map(|(parent, _)| parent),
            effect: from.map(|(_, effect)| effect.id().to_owned()),
            supported: None,
            command: String::new(),
            note: String::new(),
            model: Arc::new(model),
            diagnosis: None,
            changes: None,
            discovery: None,
        }
    }

    /// What the page shows.
    pub(super) fn entry(&self) -> Value {
        let fit = self.model.fit.as_ref();
        let names = |role: model::FlightRole| -> Vec<&str> {
            let flights = fit.iter().flat_map(|fit| &fit.flights);
            flights.filter(|flight| flight.role == role).map(|flight| flight.name.as_str()).collect()
        };
        let has_rotation = sysid::has_rotation(&self.model);
        let axes: Option<serde_json::Map<String, Value>> = fit.map(|fit| {
            let figures = |axis: model::Axis| {
                let error = (axis.index() < 3 || has_rotation).then_some(fit.held_out[axis]);
                json!(error.map(|error| json!({ "rms": error.rms, "sse": error.sse, "r2": error.r2 })))
            };
            AXES.iter().map(|axis| (axis.name().to_owned(), figures(*axis))).collect()
        });
        json!({
            "id": self.id,
            "parent": self.parent,
            "effect": self.effect,
            "label": self.effect.as_ref().map_or_else(|| "basic".to_owned(), |effect| format!("+ {effect}")),
            "fitted_on": names(model::FlightRole::Train),
            "judged_on": names(model::FlightRole::Validate),
            "effects": self.model.effects().iter().map(|effect| effect.id()).collect::<Vec<_>>(),
            "axes": axes,
            "verdict": self.diagnosis.as_ref().map(|diagnosis| diagnosis["verdict"].clone()),
            "changed": self.changes.as_ref().map(|changes| changes["verdict"].clone()),
            "discovered": self.discovery.as_ref().map(|discovery| discovery["verdict"].clone()),
            "supported": self.supported,
            "command": self.command,
            "note": self.note,
        })
    }
}
