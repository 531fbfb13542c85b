//! The answer as tables: a row for each flight, each value of a series, each change.

use table::{Table, Values};

use crate::answer::Answered;
use crate::history::Kind;
use crate::row::Row;
use crate::words::word;

/// Tables by their names: "flights", "histories", "changes".
pub fn tables(answered: &Answered<'_>) -> Vec<(&'static str, Table)> {
    vec![("flights", flights(answered)), ("histories", histories(answered)), ("changes", changes(answered))]
}

fn flights(answered: &Answered<'_>) -> Table {
    let all: Vec<(&str, &crate::question::FlightOf<'_>)> = answered
        .histories
        .iter()
        .flat_map(|own| own.flights.iter().map(move |flight| (own.craft.as_str(), flight)))
        .collect();
    let real =
        |of: &dyn Fn(&Row) -> f64| Values::Real(all.iter().map(|(_, flight)| of(flight.row)).collect());
    let mut table = Table::default();
    table.push("craft", Values::Text(all.iter().map(|(craft, _)| (*craft).to_owned()).collect()));
    table.push("flight", Values::Text(all.iter().map(|(_, flight)| flight.row.label()).collect()));
    table.push("date", Values::Text(all.iter().map(|(_, flight)| flight.when.to_string()).collect()));
    table.push("date_from", Values::Text(all.iter().map(|(_, flight)| word(&flight.when.from)).collect()));
    table.push("unix_s", Values::Real(all.iter().map(|(_, flight)| flight.when.unix_s).collect()));
    let battery =
        |(_, flight): &(&str, &crate::question::FlightOf<'_>)| flight.battery.clone().unwrap_or_default();
    table.push("battery", Values::Text(all.iter().map(battery).collect()));
    table.push("airborne_s", real(&|row| row.airborne_s));
    table.push("period_s", real(&|row| row.period_s));
    table.push("mean_v", real(&|row| row.mean_v));
    table.push("lowest_v", real(&|row| row.lowest_v));
    table.push("late_s", real(&|row| row.late_s));
    for motor in 0..4 {
        table.push(format!("share_of_motor_{}", motor + 1), real(&|row| row.motor_shares[motor]));
    }
    table.push("mean_command", real(&|row| row.mean_command));
    let faults = |(_, flight): &(&str, &crate::question::FlightOf<'_>)| {
        flight.row.faults.iter().map(|fault| fault.kind.as_str()).collect::<Vec<_>>().join(" ")
    };
    table.push("faults", Values::Text(all.iter().map(faults).collect()));
    table.push("sha256", Values::Text(all.iter().map(|(_, flight)| flight.row.sha256.clone()).collect()));
    table
}

fn histories(answered: &Answered<'_>) -> Table {
    let (mut craft, mut flight, mut date) = (Vec::new(), Vec::new(), Vec::new());
    let (mut name, mut kind, mut unit) = (Vec::new(), Vec::new(), Vec::new());
    let (mut value, mut std_error) = (Vec::new(), Vec::new());
    for own in &answered.histories {
        for series in &own.series {
            for (at, estimate) in series.at.iter().zip(&series.values) {
                craft.push(own.craft.clone());
                flight.push(own.flights[*at].row.label());
                date.push(own.flights[*at].when.to_string());
                name.push(series.name.clone());
                kind.push(word(&series.kind));
                unit.push(series.unit.clone());
                value.push(estimate.value);
                std_error.push(if series.kind == Kind::Plain { f64::NAN } else { estimate.std_error });
            }
        }
    }
    let mut table = Table::default();
    for (column, values) in [
        ("craft", craft),
        ("flight", flight),
        ("date", date),
        ("series", name),
        ("kind", kind),
        ("unit", unit),
    ] {
        table.push(column, Values::Text(values));
    }
    table.push("value", Values::Real(value));
    table.push("std_error", Values::Real(std_error));
    table
}

fn changes(answered: &Answered<'_>) -> Table {
    let (mut craft, mut flight, mut date, mut earliest, mut latest) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut series, mut unit, mut before, mut after) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (mut std_error, mut p_value, mut drifts) = (Vec::new(), Vec::new(), Vec::new());
    for own in &answered.answer.crafts {
        for event in &own.changes {
            for moved in &event.moved {
                craft.push(own.craft.clone());
                flight.push(event.from.flight.clone());
                date.push(event.from.date.clone());
                earliest.push(event.likely[0].clone());
                latest.push(event.likely[1].clone());
                series.push(moved.series.clone());
                unit.push(moved.unit.clone());
                before.push(moved.before.value);
                after.push(moved.after.value);
                std_error.push(moved.std_error);
                p_value.push(moved.p_value);
                drifts.push(moved.drifts);
            }
        }
    }
    let mut table = Table::default();
    for (column, values) in
        [("craft", craft), ("from_flight", flight), ("date", date), ("earliest", earliest)]
    {
        table.push(column, Values::Text(values));
    }
    for (column, values) in [("latest", latest), ("series", series), ("unit", unit)] {
        table.push(column, Values::Text(values));
    }
    for (column, values) in
        [("before", before), ("after", after), ("std_error", std_error), ("p_value", p_value)]
    {
        table.push(column, Values::Real(values));
    }
    table.push("drifts", Values::Flag(drifts));
    table
}
