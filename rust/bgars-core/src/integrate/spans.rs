//! The part of each band of rows that has edges: kernels work on it alone, so a mask costs its own pixels, not the image's.

use std::ops::Range;

use super::checkerboard::{BAND_ROWS, Grid, LANES};
use super::edge_bits::EdgeBits;
use crate::vector::Packed;

/// Rows above and below a band that its kernels compute for themselves.
const HALO_ROWS: usize = 3;

/// Pixels of a colour, the same in each row of a band; whole vectors where the grid has any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub start: usize,
    pub end: usize,
}

impl Span {
    pub fn range(self) -> Range<usize> {
        self.start..self.end
    }

    /// How many vectors it is long.
    #[inline(always)]
    pub fn vectors<V: Packed>(self) -> usize {
        (self.end - self.start) / V::WIDTH
    }
}

/// The spans of all bands.
#[derive(Debug)]
pub(super) struct Spans {
    bands: Vec<Span>,
    grid: Grid,
}

impl Spans {
    /// Every row from end to end.
    pub fn whole(grid: Grid) -> Self {
        Self { bands: vec![Span { start: 0, end: grid.half() }; grid.height.div_ceil(BAND_ROWS)], grid }
    }

    /// All pixels with edges, virtual ones included.
    pub fn of_edges(grid: Grid, bits: &EdgeBits) -> Self {
        let Grid { height, .. } = grid;
        let (half, lanes) = (grid.half(), if grid.has_lanes() { LANES } else { 1 });
        let reds: Vec<_> = (0..height).map(|row| reds_with_edges(bits, row)).collect();
        let span = |band: usize| {
            // The black at the far end of an edge lies in a row of its own, or one further left or right.
            let first = (band * BAND_ROWS).saturating_sub(HALO_ROWS + 1);
            let rows = &reds[first..((band + 1) * BAND_ROWS + HALO_ROWS + 1).min(height)];
            let hull = rows.iter().flatten().cloned().reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
            let Range { start, end } = hull.map_or(0..0, |reds| reds.start.saturating_sub(1)..(reds.end + 1).min(half));
            Span { start: start / lanes * lanes, end: end.next_multiple_of(lanes) }
        };
        Self { bands: (0..height.div_ceil(BAND_ROWS)).map(span).collect(), grid }
    }

    /// The span of a band.
    #[inline]
    pub fn band(&self, band: usize) -> Span {
        self.bands[band]
    }

    /// The span of the band that a row of the grid is in.
    #[inline(always)]
    pub fn at(&self, row: isize) -> Span {
        self.bands[row as usize / BAND_ROWS]
    }

    /// How many bands.
    pub fn len(&self) -> usize {
        self.bands.len()
    }

    /// Bands that one task works on: rows around a task are worked on twice, but all threads are to end together. What comes
    /// out is the same for any number.
    pub fn bands_of_a_task(&self) -> usize {
        /// Tasks for each of several threads.
        const TASKS: usize = 4;
        let threads = rayon::current_num_threads();
        self.bands.len().div_ceil(if threads == 1 { 1 } else { TASKS * threads })
    }

    /// The parts of a band's rows that its span covers, counted from the band's first pixel of a colour.
    pub fn parts(&self, band: usize) -> impl Iterator<Item = Range<usize>> {
        let (half, Span { start, end }) = (self.grid.half(), self.bands[band]);
        let rows = BAND_ROWS.min(self.grid.height - band * BAND_ROWS);
        // Rows without a gap between them are one part.
        let (parts, end) = if end - start == half { (1, rows * half) } else { (rows, end) };
        (0..parts).map(move |row| row * half + start..row * half + end)
    }
}

/// From the first to the last red with an edge; `None` in a row without any.
fn reds_with_edges(bits: &EdgeBits, row: usize) -> Option<Range<usize>> {
    let row = bits.any(row as isize);
    bits.hull(|word| row.to_any_side(word))
}

/// The chunks of `count` tasks where there are any, else as often nothing.
pub(super) fn each_or_none<C>(mut chunks: Option<impl Iterator<Item = C>>, count: usize) -> Vec<Option<C>> {
    (0..count).map(|_| chunks.as_mut().and_then(Iterator::next)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Weights;

    /// No edges but those of some reds to the right.
    fn spans(grid: Grid, reds: &[(usize, usize)]) -> Vec<(usize, usize)> {
        let mut weights = Weights::zeros(grid);
        for &(row, k) in reds {
            weights.set_red(row, k, [0.0, 1.0, 0.0, 0.0]);
        }
        weights.find_spans();
        weights.spans.bands.iter().map(|span| (span.start, span.end)).collect()
    }

    #[test]
    fn spans_hold_both_ends_of_every_edge_of_a_band_and_of_the_rows_around_it() {
        let grid = Grid { height: 3 * BAND_ROWS, width: 128 };
        assert_eq!(spans(grid, &[(2, 17), (2, 30)]), [(16, 32), (0, 0), (0, 0)]);
        // Black 32 may be tied to red 31.
        assert_eq!(spans(grid, &[(2, 31)]), [(16, 48), (0, 0), (0, 0)]);
        assert_eq!(spans(grid, &[(2, 5), (BAND_ROWS + 3, 40)]), [(0, 48), (32, 48), (0, 0)]);
        assert_eq!(spans(grid, &[(BAND_ROWS + 4, 40)]), [(0, 0), (32, 48), (0, 0)]);
    }

    #[test]
    fn short_rows_are_counted_one_by_one() {
        assert_eq!(spans(Grid { height: 3, width: 20 }, &[(0, 4)]), [(3, 6)]);
    }

    #[test]
    fn rows_without_a_gap_are_one_part() {
        let grid = Grid { height: BAND_ROWS + 2, width: 16 };
        let spans = Spans { bands: vec![Span { start: 0, end: 8 }, Span { start: 2, end: 5 }], grid };
        assert!(spans.parts(0).eq(std::iter::once(0..8 * BAND_ROWS)));
        assert_eq!(spans.parts(1).collect::<Vec<_>>(), [2..5, 10..13]);
    }
}
