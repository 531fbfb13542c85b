//! On which side of its changes a craft's reference is.
//!
//! What explains a change is linearised about the reference. One that is fitted to flights from before and after a change is a model of
//! neither: its coefficients can be far from both, and causes and sizes are then wrong with small errors. What changed and when does not
//! depend on the reference as much. So, once all flights are read with a first reference, it is looked whether that is from both sides of
//! a change. If so, it is made anew from flights on one side, before the first change where there are enough, and the craft's flights
//! are read again.

use std::ops::Range;

use diagnosis::workflow::{Observer, sha256};
use model::Model;

use crate::answer::{History, histories};
use crate::error::FleetError;
use crate::index::Index;
use crate::layout::Fleet;
use crate::pass::Indexed;
use crate::question::when_of;
use crate::reference::Reference;
use crate::row::Row;

/// Fewest flights that a reference is made of, where a craft has so many between two changes.
const FEWEST: usize = 3;

/// Makes the references anew that are from both sides of a change. Whether any is new: then flights must be read again.
pub(crate) fn settle(
    fleet: &Fleet,
    indexed: &mut Indexed,
    observer: &dyn Observer,
) -> Result<bool, FleetError> {
    let flights = fingerprint(fleet, &indexed.index);
    if flights == indexed.index.judged {
        return Ok(false);
    }
    let mut made = Vec::new();
    let all = histories(fleet, indexed);
    for (craft, history) in fleet.crafts.iter().zip(&all) {
        let Some(reference) = indexed.references.get(&craft.name).filter(|_| craft.model.is_none()) else {
            continue;
        };
        if !is_mixed(&reference.model, history) {
            continue;
        }
        let of_side = |side: Range<usize>| {
            let text = Reference::identified(fleet, craft, Some(&history.rows[side]), observer).ok()?;
            let model = Model::parse(&text, &craft.folder).ok()?;
            (!is_mixed(&model, history)).then_some(text)
        };
        // Where no side gives a model, the one that is there has to do.
        let text = sides(&history.events, history.rows.len()).into_iter().find_map(of_side);
        if observer.is_cancelled() {
            return Err(FleetError::Cancelled);
        }
        made.extend(text.map(|text| (craft, text)));
    }
    let is_new = !made.is_empty();
    for (craft, text) in made {
        let reference = Reference::of_text(&text, craft, &craft.folder)?;
        indexed.references.insert(craft.name.clone(), reference);
        if let Some(kept) = indexed.index.references.get_mut(&craft.name) {
            kept.model = text;
        }
    }
    indexed.index.judged = flights;
    Ok(is_new)
}

/// Of all flights that count, in the order of the index, and of when they were flown.
fn fingerprint(fleet: &Fleet, index: &Index) -> String {
    let of = |row: &Row| {
        let Row { craft, sha256, part, context, .. } = row;
        format!("{craft} {sha256} {part} {context} {}", when_of(fleet, row).unix_s)
    };
    let counts = index.rows.iter().filter(|row| !fleet.settings.excludes(&row.file));
    sha256(counts.map(of).collect::<Vec<_>>().join("\n").as_bytes())
}

/// Whether a model is of flights from both sides of a change.
pub(crate) fn is_mixed(model: &Model, history: &History<'_>) -> bool {
    let flights = model.fit.iter().flat_map(|fit| &fit.flights);
    let place = |flight: &model::FlightRecord| {
        let same: Vec<usize> =
            (0..history.rows.len()).filter(|k| history.rows[*k].sha256 == flight.sha256).collect();
        match same[..] {
            // A flight file may be called otherwise by now; flights of one log are told apart by their names.
            [only] => Some(only),
            _ => same.into_iter().find(|k| history.rows[*k].name == flight.name),
        }
    };
    let side = |place: usize| history.events.iter().filter(|(at, _)| *at <= place).count();
    let mut sides: Vec<usize> = flights.filter_map(place).map(side).collect();
    sides.dedup();
    sides.len() > 1
}

/// The flights between changes, in the order in which a reference is sought there: the first side that has enough flights, then the others.
/// Flights that may as well be of the next side are left out where that leaves enough.
fn sides(events: &[(usize, [usize; 2])], flights: usize) -> Vec<Range<usize>> {
    let mut all: Vec<Range<usize>> = Vec::new();
    let (mut from, mut surely_from) = (0, 0);
    let end = (flights, [flights; 2]);
    for (at, [earliest, latest]) in events.iter().copied().chain([end]) {
        let sure = surely_from..at.min(earliest);
        all.push(if sure.len() >= FEWEST { sure } else { from..at });
        (from, surely_from) = (at, at.max(latest));
    }
    let (enough, mut few): (Vec<_>, Vec<_>) =
        all.into_iter().filter(|side| !side.is_empty()).partition(|side| side.len() >= FEWEST);
    few.sort_by_key(|side| std::cmp::Reverse(side.len()));
    enough.into_iter().chain(few).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_side_before_the_first_change_comes_first_if_it_has_enough_flights() {
        assert_eq!(sides(&[(5, [5, 5])], 10), [0..5, 5..10]);
        assert_eq!(sides(&[(5, [4, 6])], 10), [0..4, 6..10]);
        assert_eq!(sides(&[(4, [1, 7])], 10), [0..4, 7..10], "too few are sure: all before it count");
        assert_eq!(sides(&[(2, [2, 2]), (7, [7, 7])], 10), [2..7, 7..10, 0..2]);
        assert_eq!(sides(&[], 4).first(), Some(&(0..4)));
    }
}
