//! A model held against the flights, as series and clouds that the page draws.

use std::sync::OnceLock;

use diagnosis::workflow::{self, Faults, FlightsOfOneKind, LoadedFlight, Silent, WorkflowError};
use model::{AXES, Axis, Model};
use serde::Serialize;
use serde_json::{Value, json};
use sysid::compare::predict_ahead;
use sysid::{Comparison, Prepared};

use super::numbers::{self, Rows, Window};
use super::refused::Refused;
use super::room::{self, Place};
use super::table::Table;
use super::timeline;
use crate::render::pages;
use crate::render::view::View;

/// A model held against all flights.
pub(super) struct ModelView {
    model: Model,
    flights: Vec<LoadedFlight>,
    views: Vec<View>,
    /// Its predictions ahead take longest: made when they are first asked for.
    comparison: OnceLock<Comparison>,
    /// Its coefficients flight by flight, likewise.
    timeline: OnceLock<Value>,
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
    /// Beside another flight: the residual less that there, where both have samples.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    residual_apart: Vec<f32>,
}

/// Place of the residual among the lines of a channel.
const RESIDUAL: usize = 2;
/// A channel with its lines at all samples: measured, predicted, residual, and what else is drawn of it.
type Lines = (Channel, Vec<Vec<f64>>);

/// The flight that another is put beside.
pub(super) struct Beside<'a> {
    /// Its start is where the other's goes.
    pub(super) flight: &'a str,
    /// So much later, s.
    pub(super) shift_s: f64,
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

impl ModelView {
    pub(super) fn new(model: &Model, flights: Vec<LoadedFlight>) -> Result<Self, WorkflowError> {
        let mut flights = FlightsOfOneKind { flights, faults: Faults::default() };
        workflow::line_up(model, &mut flights, &Silent)?;
        let views = View::all(&flights.prepared(), model);
        Ok(Self {
            model: model.clone(),
            flights: flights.flights,
            views,
            comparison: OnceLock::new(),
            timeline: OnceLock::new(),
        })
    }

    /// What `quadlab compare` says of it.
    pub(super) fn comparison(&self) -> &Comparison {
        self.comparison.get_or_init(|| sysid::compare(&self.model, &self.prepared()))
    }

    /// Its coefficients, each flight by itself.
    pub(super) fn timeline(&self) -> &Value {
        let fits = || workflow::flight_by_flight(&self.model, &self.prepared());
        self.timeline.get_or_init(|| timeline::document(&self.model, &fits()))
    }

    fn prepared(&self) -> Vec<&Prepared> {
        self.flights.iter().map(|flight| &flight.prepared).collect()
    }

    fn flight(&self, name: &str) -> Result<(&LoadedFlight, &View), Refused> {
        let mut all = self.flights.iter().zip(&self.views);
        all.find(|(flight, _)| flight.prepared.name == name)
            .ok_or_else(|| Refused(format!("{name}: there is no such flight in this folder")))
    }

    /// Measured, predicted and what is left: of the accelerations, or of everything predicted so many samples ahead.
    pub(super) fn series(
        &self,
        flight: &str,
        ahead: Option<usize>,
        window: Window,
    ) -> Result<Series, Refused> {
        let (time_s, lines) = self.lines(flight, ahead)?;
        Ok(series(&time_s, lines, window))
    }

    /// The same on the clock of another flight, with the difference from its residual.
    pub(super) fn series_beside(
        &self,
        flight: &str,
        other: &Beside<'_>,
        ahead: Option<usize>,
        window: Window,
    ) -> Result<Series, Refused> {
        let (mut time_s, mut lines) = self.lines(flight, ahead)?;
        let (other_s, others) = self.lines(other.flight, ahead)?;
        if let (Some(first), Some(start)) = (time_s.first(), other_s.first()) {
            let later_s = start - first + other.shift_s;
            time_s.iter_mut().for_each(|t| *t += later_s);
        }
        for ((channel, own), (_, theirs)) in lines.iter_mut().zip(&others) {
            let wraps = channel.group == "attitude";
            own.push(numbers::apart(&time_s, &own[RESIDUAL], &other_s, &theirs[RESIDUAL], wraps));
        }
        Ok(series(&time_s, lines, window))
    }

    fn lines(&self, flight: &str, ahead: Option<usize>) -> Result<(Vec<f64>, Vec<Lines>), Refused> {
        let (loaded, view) = self.flight(flight)?;
        Ok(match ahead {
            Some(samples) => self.lines_ahead(loaded, samples),
            None => (view.time_s.clone(), self.lines_of_accelerations(view)),
        })
    }

    fn lines_of_accelerations(&self, view: &View) -> Vec<Lines> {
        let spoken = |axis: &&Axis| axis.index() < 3 || sysid::has_rotation(&self.model);
        let of_axis = |axis: &Axis| {
            let measured = view.residuals.measured[axis.index()].clone();
            let residual = view.residual(*axis).to_vec();
            let predicted = measured.iter().zip(&residual).map(|(y, e)| y - e).collect();
            let told = Channel::new(axis.name(), axis_name(*axis), axis.unit(), "acceleration");
            (told, vec![measured, predicted, residual])
        };
        AXES.iter().filter(spoken).map(of_axis).collect()
    }

    fn lines_ahead(&self, flight: &LoadedFlight, samples: usize) -> (Vec<f64>, Vec<Lines>) {
        let ahead = predict_ahead(&self.model, &flight.prepared, samples);
        let all = AHEAD.iter().zip(ahead.measured.into_iter().zip(ahead.predicted));
        let lines = all.map(|((id, name, unit, group), (measured, predicted))| {
            let residual = measured.iter().zip(&predicted).map(|(y, p)| y - p).collect();
            (Channel::new(id, name, unit, group), vec![measured, predicted, residual])
        });
        (ahead.time_s, lines.collect())
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

    /// What is left of an axis over the room, of one flight or of all whose place is known.
    pub(super) fn room(&self, axis: Axis, flight: Option<&str>) -> Result<Value, Refused> {
        let wanted: Vec<(&LoadedFlight, &View)> = match flight {
            Some(name) => vec![self.flight(name)?],
            None => self.flights.iter().zip(&self.views).collect(),
        };
        let (placed, without): (Vec<_>, Vec<_>) =
            wanted.into_iter().partition(|(flight, _)| flight.prepared.has_position);
        let mut places = Vec::new();
        for (_, view) in &placed {
            let of = |name: &str| view.condition(name).map_or(&[][..], |condition| &condition.values);
            let along = of("north position").iter().zip(of("east position")).zip(of("height"));
            places.extend(along.zip(view.residual(axis)).map(|(((north, east), up), residual)| Place {
                north_m: *north,
                east_m: *east,
                up_m: *up,
                residual: *residual,
            }));
        }
        let mut map = room::map(places);
        let names = |all: &[(&LoadedFlight, &View)]| -> Vec<String> {
            all.iter().map(|(flight, _)| flight.prepared.name.clone()).collect()
        };
        map["unit"] = json!(axis.unit());
        map["flights"] = json!(names(&placed));
        map["without_position"] = json!(names(&without));
        Ok(map)
    }

    /// The page of `quadlab compare --html`.
    pub(super) fn report(&self) -> String {
        pages::compare(&self.model, &self.flights, self.comparison()).render()
    }

    /// All samples of a flight as a table.
    pub(super) fn table(&self, flight: &str) -> Result<Table, Refused> {
        let (_, view) = self.flight(flight)?;
        let mut table = Table::default();
        table.push("t_s", view.time_s.clone());
        for axis in AXES {
            let unit = if axis.index() < 3 { "m_s2" } else { "rad_s2" };
            let (measured, residual) = (&view.residuals.measured[axis.index()], view.residual(axis));
            let predicted = measured.iter().zip(residual).map(|(y, e)| y - e).collect();
            table.push(format!("{axis}_measured_{unit}"), measured.clone());
            table.push(format!("{axis}_predicted_{unit}"), predicted);
            table.push(format!("{axis}_residual_{unit}"), residual.to_vec());
        }
        Ok(table)
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

fn series(time_s: &[f64], channels: Vec<Lines>, window: Window) -> Series {
    let lines: Vec<&[f64]> = channels.iter().flat_map(|(_, lines)| lines.iter().map(Vec::as_slice)).collect();
    let Rows { t, lines } = numbers::reduced(time_s, &lines, window);
    let mut reduced = lines.into_iter();
    let channels = channels.into_iter().map(|(channel, lines)| {
        let mut next = reduced.by_ref().take(lines.len());
        let mut line = || next.next().unwrap_or_default();
        Channel { measured: line(), predicted: line(), residual: line(), residual_apart: line(), ..channel }
    });
    Series {
        from: time_s.first().copied().unwrap_or(0.0).max(window.from_s),
        to: time_s.last().copied().unwrap_or(0.0).min(window.to_s),
        channels: channels.collect(),
        t,
    }
}
