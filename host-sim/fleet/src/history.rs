//! Series over the flights of a craft: each coefficient of the model, each change about it, and the plainest statistics.

use model::{Model, Vehicle};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use crate::changes::{Base, Candidate};
use crate::equations::{Columns, Equations};
use crate::fit::{Asked, Estimate, Pooled, of_one};
use crate::row::Row;

/// What a series shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// A coefficient of the model, fitted to each flight alone.
    Coefficient,
    /// The size of a change about the model of all flights, by itself.
    Change,
    /// A plain statistic: no model is behind it.
    Plain,
}

/// A value flight by flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// "thrust.C_T", "mass-change.extra_mass", "share of motor 1".
    pub name: String,
    /// What it shows.
    pub kind: Kind,
    /// Its unit.
    pub unit: String,
    /// Whether it is one motor's part of what all four do: these parts sum to one.
    pub is_share: bool,
    /// Which flights of the craft have a value, in order.
    pub at: Vec<usize>,
    /// The values.
    pub values: Vec<Estimate>,
}

/// The flights of a craft that are fitted, and what they are fitted with.
pub(crate) struct Flown<'a> {
    pub(crate) rows: &'a [&'a Row],
    pub(crate) model: &'a Model,
    pub(crate) columns: &'a Columns,
    pub(crate) asked: &'a Asked,
}

impl Flown<'_> {
    pub(crate) fn equations(&self) -> Vec<&Equations> {
        self.rows.iter().map(|row| &row.equations).collect()
    }

    fn unit(&self, parameter: usize) -> String {
        let own = self.columns.parameters[parameter];
        own.effect.info().coefficients[own.coefficient].unit_for(self.model.rotor_quantity()).into()
    }

    /// All series: of the coefficients that are asked for, of the changes about `fit`, and the plain ones.
    pub(crate) fn series(&self, fit: &Pooled, candidates: &[Candidate]) -> Vec<Series> {
        let mut all = self.coefficients();
        all.extend(self.changes(fit, candidates));
        all.extend(plain(self.rows, &self.model.vehicle));
        all
    }

    fn coefficients(&self) -> Vec<Series> {
        let found: Vec<Vec<Option<Estimate>>> =
            self.rows.par_iter().map(|row| of_one(&row.equations, self.asked)).collect();
        let series = |(place, &parameter): (usize, &usize)| {
            let own = &self.columns.parameters[parameter];
            let values = found.iter().map(|flight| flight[place]);
            series(own.name(), Kind::Coefficient, self.unit(parameter), values)
        };
        self.asked.parameters.iter().enumerate().map(series).collect()
    }

    fn changes(&self, fit: &Pooled, candidates: &[Candidate]) -> Vec<Series> {
        let base = Base::new(self.columns, &self.asked.parameters, fit);
        let of = |row: &&Row| {
            let shown = base.shown(&row.equations, candidates);
            shown.iter().map(crate::changes::Shown::estimates).collect::<Vec<_>>()
        };
        let found: Vec<Vec<Vec<Option<Estimate>>>> = self.rows.par_iter().map(of).collect();
        let mut all = Vec::new();
        for (c, candidate) in candidates.iter().enumerate() {
            for (place, &parameter) in candidate.parameters.iter().enumerate() {
                let own = &self.columns.parameters[parameter];
                let values = found.iter().map(|flight| flight[c][place]);
                all.push(series(own.name(), Kind::Change, self.unit(parameter), values));
            }
        }
        all
    }
}

/// By how much a chance is multiplied for all series that were looked at. Plain statistics have one half of the significance and what
/// comes of models has the other: the plain ones are few, and need no model to be right.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tests {
    plain: f64,
    of_models: f64,
}

impl Tests {
    pub(crate) fn of<'a>(all: impl Iterator<Item = &'a Series>) -> Self {
        let mut tests = Self { plain: 0.0, of_models: 0.0 };
        for series in all {
            match series.kind {
                Kind::Plain => tests.plain += 2.0,
                Kind::Coefficient | Kind::Change => tests.of_models += 2.0,
            }
        }
        tests
    }

    /// For a series.
    pub(crate) fn of_series(&self, series: &Series) -> f64 {
        if series.kind == Kind::Plain { self.plain } else { self.of_models }
    }
}

fn series(name: String, kind: Kind, unit: String, values: impl Iterator<Item = Option<Estimate>>) -> Series {
    let is_told = |(k, value): (usize, Option<Estimate>)| {
        let value = value.filter(|own| own.value.is_finite() && own.std_error.is_finite())?;
        Some((k, value))
    };
    let (at, values) = values.enumerate().filter_map(is_told).unzip();
    Series { name, kind, unit, is_share: false, at, values }
}

const fn exact(value: f64) -> Option<Estimate> {
    Some(Estimate { value, std_error: 0.0 })
}

/// A statistic that no model is behind; it has no errors of its own.
fn plain_series(rows: &[&Row], name: &str, unit: String, value: impl Fn(&Row) -> f64) -> Series {
    series(name.into(), Kind::Plain, unit, rows.iter().map(|row| exact(value(row))))
}

/// Statistics that no model is behind: how the motors share the work, and how hard they work.
pub(crate) fn plain(rows: &[&Row], vehicle: &Vehicle) -> Vec<Series> {
    let share = |motor: usize| {
        let name = format!("share of motor {} in the mean command", motor + 1);
        Series { is_share: true, ..plain_series(rows, &name, "1".into(), |row| row.motor_shares[motor]) }
    };
    (0..4).map(share).chain([mean_command(rows, vehicle)]).collect()
}

/// The mean command. A motor turns by what it gets: by the command times the battery's voltage, unless what commands it allows for that
/// already. Of the two that is taken which differs less from flight to flight.
fn mean_command(rows: &[&Row], vehicle: &Vehicle) -> Series {
    let [low, high] = vehicle.motors.command_range;
    let part = |row: &Row| (row.mean_command - low) / (high - low);
    let parts = plain_series(rows, "mean command", "1".into(), part);
    let volts = plain_series(rows, "mean command times voltage", "V".into(), |row| part(row) * row.mean_v);
    if volts.at == parts.at && changes(&volts.values) < changes(&parts.values) {
        return volts;
    }
    plain_series(rows, "mean command", vehicle.motors.command_unit.to_string(), |row| row.mean_command)
}

/// By what part of itself a value changes from one flight to the next, in the middle of all.
fn changes(values: &[Estimate]) -> f64 {
    let pairs = values.windows(2).map(|pair| (pair[1].value / pair[0].value).ln().abs());
    sysid::statistics::median(&mut pairs.filter(|change| change.is_finite()).collect::<Vec<f64>>())
        .unwrap_or(f64::INFINITY)
}

/// Voltages, which are the battery's and not the craft's.
pub(crate) fn voltages(rows: &[&Row]) -> Vec<Series> {
    let of = |name: &str, value: fn(&Row) -> f64| plain_series(rows, name, "V".into(), value);
    vec![of("mean voltage", |row| row.mean_v), of("lowest voltage", |row| row.lowest_v)]
}
