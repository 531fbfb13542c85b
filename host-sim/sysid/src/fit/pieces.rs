//! A flight in pieces, over each of which a load's swing is followed from one beginning.

use std::ops::Range;

use crate::fit::slung_load::Carried;
use crate::prepare::Prepared;

/// Time from one independent value of filtered noise to the next, s.
pub(crate) const INDEPENDENT_S: f64 = 0.1;

/// Part of noise, percent, that the beginnings explain at most: four numbers of the independent values of two axes in a piece.
pub const BY_CHANCE_PERCENT: f64 = 100.0 * 4.0 * INDEPENDENT_S / (2.0 * PIECE_S);

/// Length of a piece, s: several swings of a cable of a metre, short enough for a wide swing to be followed.
const PIECE_S: f64 = 4.0;

/// A piece of a flight, over which a load's swing is followed from one beginning.
#[derive(Debug, Clone)]
pub(crate) struct Piece {
    pub(crate) stretch: usize,
    /// Samples of the stretch: those of neighbours overlap by what filters need at their ends.
    pub(crate) samples: Range<usize>,
    /// Rows of the flight.
    pub(crate) rows: Range<usize>,
}

impl Piece {
    /// Whether there is one before it.
    pub(crate) fn goes_on(&self) -> bool {
        self.samples.start > 0
    }
}

/// The flight in pieces; their rows are those of the flight, in the same order.
pub(crate) fn pieces(flight: &Prepared, stride: usize) -> Vec<Piece> {
    let fit_stride = flight.fit_stride();
    let of_piece = ((PIECE_S / flight.period_s) as usize / fit_stride).max(1) * fit_stride;
    let mut all: Vec<Piece> = Vec::new();
    for (stretch, samples) in flight.stretches.iter().map(|stretch| stretch.time_s.len()).enumerate() {
        let places = samples - 2 * flight.margin;
        // The last one takes the rest.
        let count = ((places + of_piece / 2) / of_piece).max(1);
        for piece in 0..count {
            let (from, to) =
                (piece * of_piece, if piece + 1 == count { places } else { (piece + 1) * of_piece });
            let row = all.last().map_or(0, |last| last.rows.end);
            let rows = row..row + (to - from).div_ceil(stride);
            all.push(Piece { stretch, samples: from..to + 2 * flight.margin, rows });
        }
    }
    all
}

/// Rows of a flight in blocks that know little of each other's swing: up to twice as long as a swing remembers, 1 / (zeta w0), two of a
/// stretch at least.
pub(crate) fn blocks(flight: &Prepared, carried: &Carried, stride: usize) -> Vec<Range<usize>> {
    let memory_s = 1.0 / carried.decay_per_s();
    let pieces = pieces(flight, stride);
    let of_stretches = pieces.chunk_by(|a, b| a.stretch == b.stretch);
    let blocks = of_stretches.flat_map(|of_stretch| {
        let seconds = PIECE_S * of_stretch.len() as f64;
        // A swing that is not damped remembers all.
        let count = if memory_s > 0.0 { (seconds / (2.0 * memory_s)).ceil() as usize } else { 0 };
        of_stretch.chunks(of_stretch.len().div_ceil(count.clamp(2, of_stretch.len().max(2))))
    });
    blocks.map(|block| block[0].rows.start..block[block.len() - 1].rows.end).collect()
}

#[cfg(test)]
mod tests {
    use model::Effect;

    use super::*;
    use crate::fit::slung_load::of_model;
    use crate::testing::{prepared, truth};

    fn of_lengths(lengths: &[usize]) -> Prepared {
        let longest = lengths.iter().copied().max().unwrap();
        let mut flight = prepared(longest, |_, _| {});
        let whole = flight.stretches[0].clone();
        flight.stretches = lengths.iter().map(|length| whole.part(0..*length)).collect();
        flight
    }

    #[test]
    fn the_rows_of_the_pieces_are_those_of_the_flight_one_after_another() {
        for lengths in [&[100][..], &[460], &[461, 100, 1999], &[2000, 659, 660, 661]] {
            let flight = of_lengths(lengths);
            for stride in [1, flight.fit_stride()] {
                let pieces = pieces(&flight, stride);
                let mut next = 0;
                for piece in &pieces {
                    assert_eq!(piece.rows.start, next);
                    next = piece.rows.end;
                    // Each row has its sample.
                    let samples = piece.samples.len() - 2 * flight.margin;
                    assert_eq!(piece.rows.len(), samples.div_ceil(stride));
                    assert!(piece.samples.end <= lengths[piece.stretch]);
                }
                let rows: usize = flight.stretches.iter().map(|s| flight.row_samples(s, stride).len()).sum();
                assert_eq!(next, rows, "{lengths:?} by {stride}");
            }
        }
    }

    /// Four seconds are 399 samples in strides of three; the margins are 30 on either side.
    #[test]
    fn neighbours_overlap_by_what_filters_need_and_the_last_takes_the_rest() {
        let flight = of_lengths(&[1500]);
        let all: Vec<_> = pieces(&flight, 3).into_iter().map(|p| (p.goes_on(), p.samples)).collect();
        assert_eq!(all, [(false, 0..459), (true, 399..858), (true, 798..1257), (true, 1197..1500)]);
        let short = pieces(&of_lengths(&[100]), 3);
        assert_eq!((short.len(), short[0].samples.clone()), (1, 0..100));
    }

    #[test]
    fn blocks_are_longer_than_a_swing_remembers_and_cover_all_rows() {
        let flight = of_lengths(&[4000, 900]);
        let blocks_of = |damping: f64| {
            let mut model = truth();
            model.set(Effect::SlungLoad, &[0.1, 1.0, damping]);
            let blocks = blocks(&flight, &of_model(&model).unwrap(), 3);
            let rows = pieces(&flight, 3).last().unwrap().rows.end;
            assert_eq!((blocks[0].start, blocks[blocks.len() - 1].end), (0, rows));
            assert!(blocks.windows(2).all(|w| w[0].end == w[1].start));
            blocks.len()
        };
        // The first stretch is ten pieces of 4 s, the second two. A swing of sqrt(9.81) rad/s that
        // is damped by 0.08 remembers 4 s: five blocks of 8 s. One that is not remembers all: the
        // fewest.
        assert_eq!((blocks_of(0.08), blocks_of(0.0)), (5 + 2, 2 + 2));
    }

    /// Four numbers of two times forty independent values.
    #[test]
    fn by_chance_the_beginnings_explain_a_twentieth() {
        assert!((BY_CHANCE_PERCENT - 5.0).abs() < 1e-12);
    }
}
