//! Flights seen by a model, as series and clouds that the page draws.

use std::sync::Arc;

use diagnosis::workflow::{self, Faults, FlightsOfOneKind, LoadedFlight, Silent, WorkflowError};
use model::{AXES, Axis, Effect, Model};
use serde::Serialize;
use serde_json::{Value, json};
use sysid::compare::predict_ahead;
use sysid::fit::linearise::contributions;
use table::{Table, Values};

use super::numbers::{self, Rows, Window};
use super::refused::Refused;
use super::room::{self, Place};
use crate::render::view::View;

/// A flight held against a model, by itself: what `quadlab compare` does with it alone.
pub(super) struct Seen {
    model: Model,
    flight: LoadedFlight,
    view: View,
    /// All that flies, where only parts are used: what is not used can be looked at as well.
    whole: Option<(LoadedFlight, View)>,
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
    pub(super) other: &'a Seen,
    /// So much later, s.
    pub(super) shift_s: f64,
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

impl Seen {
    pub(super) fn new(
        model: &Model,
        flight: LoadedFlight,
        whole: Option<LoadedFlight>,
    ) -> Result<Self, WorkflowError> {
        let held = |flight| {
            let mut held = FlightsOfOneKind { flights: vec![flight], faults: Faults::default() };
            workflow::line_up(model, &mut held, &Silent)?;
            let flight = held.flights.remove(0);
            let view = View::new(&flight.prepared, model);
            Ok::<_, WorkflowError>((flight, view))
        };
        let (flight, view) = held(flight)?;
        let whole = whole.and_then(|whole| held(whole).ok());
        Ok(Self { model: model.clone(), flight, view, whole })
    }

    /// How much memory it takes, in rows of the flight.
    pub(super) fn rows(&self) -> usize {
        let of = |view: &View| view.time_s.len();
        of(&self.view) + self.whole.as_ref().map_or(0, |(_, whole)| of(whole))
    }

    /// Measured, predicted and what is left: of the accelerations, or of everything predicted so many samples ahead.
    pub(super) fn series(&self, ahead: Option<usize>, window: Window) -> Series {
        let (time_s, lines) = self.lines(ahead);
        series(&time_s, lines, window)
    }

    /// The same on the clock of another flight, with the difference from its residual.
    pub(super) fn series_beside(&self, beside: &Beside<'_>, ahead: Option<usize>, window: Window) -> Series {
        let (mut time_s, mut lines) = self.lines(ahead);
        let (other_s, others) = beside.other.lines(ahead);
        if let (Some(first), Some(start)) = (time_s.first(), other_s.first()) {
            let later_s = start - first + beside.shift_s;
            time_s.iter_mut().for_each(|t| *t += later_s);
        }
        for ((channel, own), (_, theirs)) in lines.iter_mut().zip(&others) {
            let wraps = channel.group == "attitude";
            own.push(numbers::apart(&time_s, &own[RESIDUAL], &other_s, &theirs[RESIDUAL], wraps));
        }
        series(&time_s, lines, window)
    }

    fn lines(&self, ahead: Option<usize>) -> (Vec<f64>, Vec<Lines>) {
        let of = |flight: &LoadedFlight, view: &View| match ahead {
            Some(samples) => self.lines_ahead(flight, samples),
            None => (view.time_s.clone(), self.lines_of_accelerations(view)),
        };
        let (time_s, lines) = of(&self.flight, &self.view);
        match &self.whole {
            Some((flight, view)) => beside_each_other((time_s, lines), of(flight, view)),
            None => (time_s, lines),
        }
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

    /// The columns that an effect has in the regression, times the ordinary sizes of their coefficients, beside what the model
    /// leaves. Samples at which a formula has no value are left out.
    pub(super) fn contributions(&self, effect: Effect, window: Window) -> Result<Contributions, Refused> {
        let mut flight = self.flight.prepared.clone();
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

    /// Adds the places of a flight, with what is left of an axis there.
    fn add_places(&self, axis: Axis, places: &mut Vec<Place>) {
        let of = |name: &str| self.view.condition(name).map_or(&[][..], |condition| &condition.values);
        let along = of("north position").iter().zip(of("east position")).zip(of("height"));
        places.extend(along.zip(self.view.residual(axis)).map(|(((north, east), up), residual)| Place {
            north_m: *north,
            east_m: *east,
            up_m: *up,
            residual: *residual,
        }));
    }

    /// All samples of a flight as a table.
    pub(super) fn table(&self) -> Table {
        let view = &self.view;
        let mut table = Table::default();
        table.push("t_s", Values::Real(view.time_s.clone()));
        for axis in AXES {
            let unit = if axis.index() < 3 { "m_s2" } else { "rad_s2" };
            let (measured, residual) = (&view.residuals.measured[axis.index()], view.residual(axis));
            let predicted = measured.iter().zip(residual).map(|(y, e)| y - e).collect();
            table.push(format!("{axis}_measured_{unit}"), Values::Real(measured.clone()));
            table.push(format!("{axis}_predicted_{unit}"), Values::Real(predicted));
            table.push(format!("{axis}_residual_{unit}"), Values::Real(residual.to_vec()));
        }
        table
    }
}

/// What is left of an axis over the room, of all flights whose place is known.
pub(super) fn room(
    flights: impl Iterator<Item = Result<Arc<Seen>, Refused>>,
    axis: Axis,
) -> Result<Value, Refused> {
    let (mut places, mut placed, mut without) = (Vec::new(), Vec::new(), Vec::new());
    for seen in flights {
        let seen = seen?;
        let name = seen.flight.prepared.name.clone();
        if seen.flight.prepared.has_position {
            seen.add_places(axis, &mut places);
            placed.push(name);
        } else {
            without.push(name);
        }
    }
    let mut map = room::map(places);
    map["unit"] = json!(axis.unit());
    map["flights"] = json!(placed);
    map["without_position"] = json!(without);
    Ok(map)
}

/// The residual of an axis over a quantity, of one flight or of several.
pub(super) fn residual(
    flights: impl Iterator<Item = Result<Arc<Seen>, Refused>>,
    axis: Axis,
    quantity: &str,
) -> Result<Value, Refused> {
    let (mut points, mut unit) = (Vec::new(), None);
    for seen in flights {
        unit = seen?.add_residual(axis, quantity, &mut points).or(unit);
    }
    let unit =
        unit.ok_or_else(|| Refused::new(format!("{quantity}: no such quantity; load the page again")))?;
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

/// The lines of what is used, and those of all that flies where nothing is used.
fn beside_each_other(
    (time_s, lines): (Vec<f64>, Vec<Lines>),
    (whole_s, others): (Vec<f64>, Vec<Lines>),
) -> (Vec<f64>, Vec<Lines>) {
    let rows = numbers::rows_of_both(&time_s, &whole_s);
    let picked = |own: &[f64], other: &[f64]| rows.iter().map(|row| row.of(own, other)).collect();
    let lines = lines.into_iter().zip(&others).map(|((channel, own), (_, other))| {
        (channel, own.iter().zip(other).map(|(own, other)| picked(own, other)).collect())
    });
    (picked(&time_s, &whole_s), lines.collect())
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
    let channels = channels.collect();
    let [from, to] = window.within(time_s);
    Series { from, to, channels, t }
}
