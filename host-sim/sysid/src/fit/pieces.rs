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
