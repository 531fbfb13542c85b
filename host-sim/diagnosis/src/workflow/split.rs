//! Which flights to fit on and which to judge by, where the user does not say: always the same for the same files.
//!
//! Every third is held out, the second first: of the files where there are several, else of the parts that one log flew, else of
//! blocks of time of the only flight, with a guard between them, so that nothing smoothed reaches across.

use std::path::{Path, PathBuf};

use flights::{Column, ColumnMap, Flight, FlightError};
use model::Vehicle;

use crate::workflow::error::WorkflowError;
use crate::workflow::loaded::{Source, bytes_of};

/// Time left out on either side of a block's end, s.
const GUARD_S: f64 = 0.5;
/// A flight of this length is cut into five blocks, a shorter one into three, s.
const LONG_S: f64 = 30.0;

type Sources<'a> = Vec<Source<'a>>;

/// Sources to fit on and sources to judge by.
pub(crate) fn split<'a>(
    sources: Sources<'a>,
    vehicle: &Vehicle,
) -> Result<(Sources<'a>, Sources<'a>), WorkflowError> {
    if let [only] = &sources[..] {
        return blocks(only, vehicle);
    }
    let files = numbered_files(&sources);
    let several = files.last().is_some_and(|last| *last > 0);
    let (mut train, mut validate) = (Vec::new(), Vec::new());
    for (index, (source, file)) in sources.into_iter().zip(files).enumerate() {
        let side = if is_held_out(if several { file } else { index }) { &mut validate } else { &mut train };
        side.push(source);
    }
    Ok((train, validate))
}

/// Whether of several flights the one of this number, counted from 0, is to judge by.
pub fn is_held_out(index: usize) -> bool {
    index % 3 == 1
}

/// The number of the file that each source is from.
fn numbered_files(sources: &[Source<'_>]) -> Vec<usize> {
    let mut seen: Vec<&Path> = Vec::new();
    let number = |source: &Source<'_>| -> PathBuf { source.path().to_owned() };
    let paths: Vec<PathBuf> = sources.iter().map(number).collect();
    paths
        .iter()
        .map(|path| {
            seen.iter().position(|own| own == path).unwrap_or_else(|| {
                seen.push(path);
                seen.len() - 1
            })
        })
        .collect()
}

/// Blocks of time of the only flight, as a flight to fit on and one to judge by.
fn blocks<'a>(only: &Source<'a>, vehicle: &Vehicle) -> Result<(Sources<'a>, Sources<'a>), WorkflowError> {
    let (path, flight) = match only {
        Source::File(path) => (*path, read(path, vehicle)?),
        Source::Cut(path, flight) => (*path, (**flight).clone()),
        Source::Memory(flight) => (Path::new(""), (*flight).clone()),
    };
    let t = flight.column(Column::T).unwrap_or(&[]);
    let (Some(first), Some(last)) = (t.first(), t.last()) else { return Ok((Vec::new(), Vec::new())) };
    let count = if last - first >= LONG_S { 5.0 } else { 3.0 };
    let block_s = (last - first) / count;
    let part = |held_out: bool| {
        let keep: Vec<bool> = t
            .iter()
            .map(|t| {
                let place = (t - first) / block_s;
                let block = place.floor().min(count - 1.0);
                let (from_s, to_s) = ((place - block) * block_s, (block + 1.0 - place) * block_s);
                let is_guard = (block > 0.0 && from_s < GUARD_S) || (block < count - 1.0 && to_s < GUARD_S);
                is_held_out(block as usize) == held_out && !is_guard
            })
            .collect();
        let mut cut = flight.with_rows(&keep);
        let stem = flight.name.trim_end_matches(".csv");
        // No name of a file: there is none.
        cut.name = format!("{stem} ({} blocks)", if held_out { "held-out" } else { "training" });
        Source::Cut(path, Box::new(cut))
    };
    Ok((vec![part(false)], vec![part(true)]))
}

fn read(path: &Path, vehicle: &Vehicle) -> Result<Flight, FlightError> {
    Flight::parse_with(&bytes_of(path)?, path, &ColumnMap::of_flight(path, vehicle)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ORDINARY, fly, truth};

    fn flights(count: u64) -> Vec<Flight> {
        (0..count).map(|seed| fly(&truth(), seed, 6.0, &ORDINARY)).collect()
    }

    fn names(sources: &[Source<'_>]) -> Vec<String> {
        sources
            .iter()
            .map(|source| match source {
                Source::Memory(flight) => flight.name.clone(),
                Source::Cut(_, flight) => flight.name.clone(),
                Source::File(path) => path.display().to_string(),
            })
            .collect()
    }

    #[test]
    fn every_third_flight_is_held_out_the_second_first() {
        for (count, held_out) in [(2, vec![1]), (3, vec![1]), (5, vec![1, 4])] {
            let flights = flights(count);
            let paths: Vec<PathBuf> = (0..count).map(|k| PathBuf::from(format!("{k}.ulg"))).collect();
            let sources =
                flights.iter().zip(&paths).map(|(f, p)| Source::Cut(p, Box::new(f.clone()))).collect();
            let (train, validate) = split(sources, &truth().vehicle).unwrap();
            let expected: Vec<String> = held_out.iter().map(|k: &usize| flights[*k].name.clone()).collect();
            assert_eq!(names(&validate), expected);
            assert_eq!(train.len() + validate.len(), count as usize);
        }
    }

    /// Parts of one log were flown in one wind on one battery: they stay together where there is another log.
    #[test]
    fn parts_of_a_log_stay_together_where_there_are_several() {
        let flights = flights(4);
        let paths = [PathBuf::from("a.ulg"), PathBuf::from("b.ulg")];
        let of = |k: usize| Source::Cut(&paths[usize::from(k > 2)], Box::new(flights[k].clone()));
        let (train, validate) = split((0..4).map(of).collect(), &truth().vehicle).unwrap();
        assert_eq!((train.len(), validate.len()), (3, 1));
        let (train, validate) = split((0..3).map(of).collect(), &truth().vehicle).unwrap();
        assert_eq!((train.len(), validate.len()), (2, 1));
    }

    #[test]
    fn blocks_of_the_only_flight_share_no_sample_and_keep_their_distance() {
        let flights = flights(1);
        let (train, validate) = split(vec![Source::Memory(&flights[0])], &truth().vehicle).unwrap();
        let times = |sources: &[Source<'_>]| match &sources[0] {
            Source::Cut(_, flight) => flight.column(Column::T).unwrap().to_vec(),
            _ => panic!("not cut"),
        };
        let (train, validate) = (times(&train), times(&validate));
        assert!(train.len() > validate.len() && validate.len() > 50, "{} {}", train.len(), validate.len());
        let nearest = validate.iter().flat_map(|a| train.iter().map(move |b| (a - b).abs()));
        assert!(nearest.fold(f64::INFINITY, f64::min) > 2.0 * GUARD_S - 0.02);
    }
}
