//! A model held against the flights, as series and clouds that the page draws.

use std::sync::OnceLock;

use diagnosis::workflow::{self, Faults, FlightsOfOneKind, LoadedFlight, Silent, WorkflowError};
use model::{AXES, Axis, Effect, Model};
use serde::Serialize;
use serde_json::{Value, json};
use sysid::Comparison;
use sysid::compare::predict_ahead;
use sysid::fit::linearise::contributions;

use super::numbers::{self, Rows, Window};
use super::refused::Refused;
use crate::render::pages;
use crate::render::view::View;

/// A model held against all flights.
pub(super) struct ModelView {
    model: Model,
    flights: Vec<LoadedFlight>,
    views: Vec<View>,
    /// Its predictions ahead take longest: made when they are first asked for.
    comparison: OnceLock<Comparison>,
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

/// What an effect would do to the accelerations, at the ordinary sizes of its coefficients.
#[derive(Debug, Serialize)]
pub(super) struct Contributions {
    from: f64,
    to: f64,
    t: Vec<f64>,
    axes: Vec<OnAxis>,
}

/// One axis of it.
#[derive(Debug, Serialize)]
struct OnAxis {
    id: &'static str,
    name: &'static str,
    unit: &'static str,
    /// What the model leaves.
    residual: Vec<f32>,
    columns: Vec<Column>,
}

/// What one coefficient does.
#[derive(Debug, Serialize)]
struct Column {
    coefficient: &'static str,
    values: Vec<f32>,
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

impl ModelView {
    pub(super) fn new(model: &Model, flights: Vec<LoadedFlight>) -> Result<Self, WorkflowError> {
        let mut flights = FlightsOfOneKind { flights, faults: Faults::default() };
        workflow::line_up(model, &mut flights, &Silent)?;
        let views = View::all(&flights.prepared(), model);
        Ok(Self { model: model.clone(), flights: flights.flights, views, comparison: OnceLock::new() })
    }

    /// What `quadlab compare` says of it.
    pub(super) fn comparison(&self) -> &Comparison {
        let prepared = || self.flights.iter().map(|flight| &flight.prepared).collect::<Vec<_>>();
        self.comparison.get_or_init(|| sysid::compare(&self.model, &prepared()))
    }

    fn flight(&self, name: &str) -> Result<(&LoadedFlight, &View), Refused> {
        let mut all = self.flights.iter().zip(&self.views);
        all.find(|(flight, _)| flight.prepared.name == name)
            .ok_or_else(|| Refused(format!("{name}: there is no such flight in this folder")))
    }

    /// Measured, predicted and what is left of the accelerations.
    pub(super) fn accelerations(&self, flight: &str, window: Window) -> Result<Series, Refused> {
        let (_, view) = self.flight(flight)?;
        let spoken = |axis: &&Axis| axis.index() < 3 || sysid::has_rotation(&self.model);
        let channels = AXES.iter().filter(spoken).map(|axis| {
            let measured = view.residuals.measured[axis.index()].clone();
            let residual = view.residual(*axis).to_vec();
            let predicted = measured.iter().zip(&residual).map(|(y, e)| y - e).collect();
            let told = Channel::new(axis.name(), axis_name(*axis), axis.unit(), "acceleration");
            (told, [measured, predicted, residual])
        });
        Ok(series(&view.time_s, channels.collect(), window))
    }

    /// The same of everything predicted so many samples ahead.
    pub(super) fn ahead(&self, flight: &str, samples: usize, window: Window) -> Result<Series, Refused> {
        let (flight, _) = self.flight(flight)?;
        let ahead = predict_ahead(&self.model, &flight.prepared, samples);
        let all = AHEAD.iter().zip(ahead.measured.into_iter().zip(ahead.predicted));
        let channels = all.map(|((id, name, unit, group), (measured, predicted))| {
            let residual = measured.iter().zip(&predicted).map(|(y, p)| y - p).collect();
            let told = Channel::new(id, name, unit, group);
            (told, [measured, predicted, residual])
        });
        Ok(series(&ahead.time_s, channels.collect(), window))
    }

    /// The columns that an effect has in the regression, times the ordinary sizes of their coefficients, beside what the model
    /// leaves. Samples at which a formula has no value are left out.
    pub(super) fn contributions(
        &self,
        flight: &str,
        effect: Effect,
        window: Window,
    ) -> Result<Contributions, Refused> {
        let mut flight = self.flight(flight)?.0.prepared.clone();
        flight.leave_out_undefined(&self.model, &[effect])?;
        let view = View::new(&flight, &self.model);
        let columns = contributions(&flight, &self.model, effect);
        let named = || effect.info().coefficients.iter().zip(&columns);
        let mut lines: Vec<&[f64]> = Vec::new();
        for axis in effect.info().axes {
            lines.push(view.residual(*axis));
            lines.extend(named().filter_map(|(_, column)| column[axis.index()].as_deref()));
        }
        let Rows { t, lines } = numbers::reduced(&view.time_s, &lines, window);
        let mut lines = lines.into_iter();
        let mut next = || lines.next().unwrap_or_default();
        let on_axis = |axis: &Axis| {
            let residual = next();
            let there = named().filter(|(_, column)| column[axis.index()].is_some());
            let columns = there.map(|(c, _)| Column { coefficient: c.name, values: next() }).collect();
            OnAxis { id: axis.name(), name: axis_name(*axis), unit: axis.unit(), residual, columns }
        };
        let axes = effect.info().axes.iter().map(on_axis).collect();
        let [from, to] = window.within(&view.time_s);
        Ok(Contributions { from, to, t, axes })
    }

    /// Quantities that residuals can be drawn over: those of the place only where a flight says it.
    pub(super) fn quantities(&self) -> Value {
        let has_place = self.flights.iter().any(|flight| flight.prepared.has_position);
        let all = self.views.first().into_iter().flat_map(View::conditions);
        let known = all.filter(|condition| has_place || !OF_PLACE.contains(&condition.name));
        known.map(|condition| json!({ "name": condition.name, "unit": condition.unit })).collect()
    }

    /// The residual of an axis over a quantity, of one flight or of all.
    pub(super) fn residual(
        &self,
        axis: Axis,
        quantity: &str,
        flight: Option<&str>,
    ) -> Result<Value, Refused> {
        let views: Vec<&View> = match flight {
            Some(name) => vec![self.flight(name)?.1],
            None => self.views.iter().collect(),
        };
        let (mut points, mut unit) = (Vec::new(), None);
        for view in views {
            let Some(condition) = view.condition(quantity) else { continue };
            unit = Some(condition.unit);
            points.extend(condition.values.iter().copied().zip(view.residual(axis).iter().copied()));
        }
        let unit =
            unit.ok_or_else(|| Refused(format!("{quantity}: no such quantity; load the page again")))?;
        let mut density = numbers::density(&points);
        density["unit"] = json!(axis.unit());
        density["quantity_unit"] = json!(unit);
        Ok(density)
    }

    /// Spectra of what is measured and of what is left, and how what is left hangs together.
    pub(super) fn spectrum(&self, flight: &str, axis: Axis) -> Result<Value, Refused> {
        let (loaded, view) = self.flight(flight)?;
        let measured = &view.residuals.measured[axis.index()];
        let mut spectrum = numbers::spectrum(measured, view.residual(axis), loaded.prepared.period_s);
        spectrum["unit"] = json!(axis.unit());
        Ok(spectrum)
    }

    /// The way through the room, with what is left of an axis.
    pub(super) fn path(&self, flight: &str, axis: Axis) -> Result<Value, Refused> {
        let (_, view) = self.flight(flight)?;
        let picked = |name: &str| -> Vec<f64> {
            let condition = view.condition(name);
            condition.map(|condition| numbers::thinned(&condition.values, PATH)).unwrap_or_default()
        };
        Ok(json!({
            "t": numbers::thinned(&view.time_s, PATH),
            "north_m": picked("north position"),
            "east_m": picked("east position"),
            "up_m": picked("height"),
            "residual": numbers::thinned(view.residual(axis), PATH),
            "unit": axis.unit(),
        }))
    }

    /// The page of `quadlab compare --html`.
    pub(super) fn report(&self) -> String {
        pages::compare(&self.model, &self.flights, self.comparison()).render()
    }

    /// All samples of a flight as a table.
    pub(super) fn table(&self, flight: &str) -> Result<String, Refused> {
        use std::fmt::Write as _;
        let (_, view) = self.flight(flight)?;
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
        Ok(text)
    }
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
    let [from, to] = window.within(time_s);
    Series { from, to, channels: channels.into_iter().map(reduced).collect(), t }
}
