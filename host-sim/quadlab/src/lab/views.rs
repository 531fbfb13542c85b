//! Flights seen by a model, as series and clouds that the page draws.

use diagnosis::workflow::{self, Faults, FlightsOfOneKind, LoadedFlight, Silent, WorkflowError};
use model::{AXES, Axis, Model};
use serde::Serialize;
use serde_json::{Value, json};
use sysid::compare::predict_ahead;

use super::numbers::{self, Rows, Window};
use super::refused::Refused;
use crate::render::view::View;

/// A flight held against a model, by itself: what `quadlab compare` does with it alone.
pub(super) struct Seen {
    model: Model,
    flight: LoadedFlight,
    view: View,
}

/// What the page draws over time.
#[derive(Debug, Serialize)]
pub(super) struct Series {
    from: f64,
    to: f64,
    t: Vec<f64>,
    channels: Vec<Channel>,
}

/// One quantity of it; where a line breaks, its value is `null`.
#[derive(Debug, Default, Serialize)]
struct Channel {
    id: &'static str,
    name: &'static str,
    unit: &'static str,
    group: &'static str,
    measured: Vec<f32>,
    predicted: Vec<f32>,
    residual: Vec<f32>,
}

impl Channel {
    fn new(id: &'static str, name: &'static str, unit: &'static str, group: &'static str) -> Self {
        Self { id, name, unit, group, ..Self::default() }
    }
}

/// Names of what is predicted ahead: id, name, unit, group.
const AHEAD: [(&str, &str, &str, &str); 12] = [
    ("north", "north", "m", "position"),
    ("east", "east", "m", "position"),
    ("down", "down", "m", "position"),
    ("velocity_u", "velocity forward", "m/s", "velocity"),
    ("velocity_v", "velocity right", "m/s", "velocity"),
    ("velocity_w", "velocity down", "m/s", "velocity"),
    ("roll", "roll", "rad", "attitude"),
    ("pitch", "pitch", "rad", "attitude"),
    ("yaw", "yaw", "rad", "attitude"),
    ("rate_p", "roll rate", "rad/s", "rates"),
    ("rate_q", "pitch rate", "rad/s", "rates"),
    ("rate_r", "yaw rate", "rad/s", "rates"),
];
/// Quantities that say where the craft is.
const OF_PLACE: [&str; 3] = ["height", "north position", "east position"];
/// Points of a path in space.
const PATH: usize = 3000;

impl Seen {
    pub(super) fn new(model: &Model, flight: LoadedFlight) -> Result<Self, WorkflowError> {
        let mut held = FlightsOfOneKind { flights: vec![flight], faults: Faults::default() };
        workflow::line_up(model, &mut held, &Silent)?;
        let flight = held.flights.remove(0);
        Ok(Self { model: model.clone(), view: View::new(&flight.prepared, model), flight })
    }

    /// How much memory it takes, in rows of the flight.
    pub(super) fn rows(&self) -> usize {
        self.view.time_s.len()
    }

    /// Measured, predicted and what is left of the accelerations.
    pub(super) fn accelerations(&self, window: Window) -> Series {
        let view = &self.view;
        let spoken = |axis: &&Axis| axis.index() < 3 || sysid::has_rotation(&self.model);
        let channels = AXES.iter().filter(spoken).map(|axis| {
            let measured = view.residuals.measured[axis.index()].clone();
            let residual = view.residual(*axis).to_vec();
            let predicted = measured.iter().zip(&residual).map(|(y, e)| y - e).collect();
            let told = Channel::new(axis.name(), axis_name(*axis), axis.unit(), "acceleration");
            (told, [measured, predicted, residual])
        });
        series(&view.time_s, channels.collect(), window)
    }

    /// The same of everything predicted so many samples ahead.
    pub(super) fn ahead(&self, samples: usize, window: Window) -> Series {
        let ahead = predict_ahead(&self.model, &self.flight.prepared, samples);
        let all = AHEAD.iter().zip(ahead.measured.into_iter().zip(ahead.predicted));
        let channels = all.map(|((id, name, unit, group), (measured, predicted))| {
            let residual = measured.iter().zip(&predicted).map(|(y, p)| y - p).collect();
            let told = Channel::new(id, name, unit, group);
            (told, [measured, predicted, residual])
        });
        series(&ahead.time_s, channels.collect(), window)
    }

    /// Quantities that residuals can be drawn over: those of the place only where it was logged.
    pub(super) fn quantities(&self, has_place: bool) -> Value {
        let known =
            self.view.conditions().filter(|condition| has_place || !OF_PLACE.contains(&condition.name));
        known.map(|condition| json!({ "name": condition.name, "unit": condition.unit })).collect()
    }

    /// Adds the residual of an axis over a quantity to points, and tells the quantity's unit.
    pub(super) fn add_residual(
        &self,
        axis: Axis,
        quantity: &str,
        points: &mut Vec<(f64, f64)>,
    ) -> Option<&'static str> {
        let condition = self.view.condition(quantity)?;
        points.extend(condition.values.iter().copied().zip(self.view.residual(axis).iter().copied()));
        Some(condition.unit)
    }

    /// Spectra of what is measured and of what is left, and how what is left hangs together.
    pub(super) fn spectrum(&self, axis: Axis) -> Value {
        let measured = &self.view.residuals.measured[axis.index()];
        let period_s = self.flight.prepared.period_s;
        let mut spectrum = numbers::spectrum(measured, self.view.residual(axis), period_s);
        spectrum["unit"] = json!(axis.unit());
        spectrum
    }

    /// The way through the room, with what is left of an axis.
    pub(super) fn path(&self, axis: Axis) -> Value {
        let view = &self.view;
        let picked = |name: &str| -> Vec<f64> {
            let condition = view.condition(name);
            condition.map(|condition| numbers::thinned(&condition.values, PATH)).unwrap_or_default()
        };
        json!({
            "t": numbers::thinned(&view.time_s, PATH),
            "north_m": picked("north position"),
            "east_m": picked("east position"),
            "up_m": picked("height"),
            "residual": numbers::thinned(view.residual(axis), PATH),
            "unit": axis.unit(),
        })
    }

    /// All samples of a flight as a table.
    pub(super) fn table(&self) -> String {
        use std::fmt::Write as _;
        let view = &self.view;
        let mut text = String::from("t_s");
        for axis in AXES {
            let unit = if axis.index() < 3 { "m_s2" } else { "rad_s2" };
            let _ = write!(text, ",{axis}_measured_{unit},{axis}_predicted_{unit},{axis}_residual_{unit}");
        }
        text.push('\n');
        for (row, time) in view.time_s.iter().enumerate() {
            let _ = write!(text, "{time}");
            for axis in AXES {
                let measured = view.residuals.measured[axis.index()][row];
                let residual = view.residual(axis)[row];
                let _ = write!(text, ",{measured},{},{residual}", measured - residual);
            }
            text.push('\n');
        }
        text
    }
}

/// The residual of an axis over a quantity, of one flight or of several.
pub(super) fn residual(
    flights: impl Iterator<Item = Result<std::sync::Arc<Seen>, Refused>>,
    axis: Axis,
    quantity: &str,
) -> Result<Value, Refused> {
    let (mut points, mut unit) = (Vec::new(), None);
    for seen in flights {
        unit = seen?.add_residual(axis, quantity, &mut points).or(unit);
    }
    let unit = unit.ok_or_else(|| Refused(format!("{quantity}: no such quantity; load the page again")))?;
    let mut density = numbers::density(&points);
    density["unit"] = json!(axis.unit());
    density["quantity_unit"] = json!(unit);
    Ok(density)
}

fn axis_name(axis: Axis) -> &'static str {
    match axis {
        Axis::U => "acceleration forward",
        Axis::V => "acceleration right",
        Axis::W => "acceleration down",
        Axis::P => "angular acceleration in roll",
        Axis::Q => "angular acceleration in pitch",
        Axis::R => "angular acceleration in yaw",
    }
}

fn series(time_s: &[f64], channels: Vec<(Channel, [Vec<f64>; 3])>, window: Window) -> Series {
    let lines: Vec<&[f64]> = channels.iter().flat_map(|(_, lines)| lines.iter().map(Vec::as_slice)).collect();
    let Rows { t, lines } = numbers::reduced(time_s, &lines, window);
    let mut lines = lines.into_iter();
    let mut next = || lines.next().unwrap_or_default();
    let reduced = |(channel, _)| Channel { measured: next(), predicted: next(), residual: next(), ..channel };
    Series {
        from: time_s.first().copied().unwrap_or(0.0).max(window.from_s),
        to: time_s.last().copied().unwrap_or(0.0).min(window.to_s),
        channels: channels.into_iter().map(reduced).collect(),
        t,
    }
}
