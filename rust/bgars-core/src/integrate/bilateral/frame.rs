//! Rows of the box in a frame of zeros, and the part of each row that the mask reaches.

use std::ops::Range;

use rayon::prelude::*;

use super::number::Number;
use crate::memory::Aligned;

/// Numbers that a loop takes at a time.
pub(super) const LANES: usize = 16;

/// Most rows of a band on average.
const MAX_BAND_ROWS: usize = 64;
/// Fewest rows of a band that is not the only one: the next one needs as many of it.
pub(super) const MIN_BAND_ROWS: usize = 2;

/// Lanes without a pixel that are worth another loop over the rest of the row.
const MIN_GAP: usize = 4;

/// The layout of a *framed* array: each row is followed by numbers of no pixel, and a row of such lies before the first and
/// after the last. They stay zero, so a neighbour can be read without asking whether there is one.
///
/// Rows are widened to whole [`LANES`], and so are the parts of the mask in them: loops over them have no remainder.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub width: usize,
    /// Of each row.
    spans: Spans,
    /// Of each row and the two above it together.
    trios: Spans,
}

/// Columns of a mask from left to right in whole [`LANES`], row by row; smaller gaps than [`MIN_GAP`] count in.
#[derive(Clone, Debug)]
struct Spans {
    spans: Vec<(usize, usize)>,
    /// Where the spans of each row begin, and where the last ones end.
    rows: Vec<usize>,
}

impl Spans {
    /// Of lanes that have a pixel or not, `lanes` a row; a row counts in the `above` rows above it.
    fn new(used: &[bool], lanes: usize, above: usize) -> Self {
        let mut spans: Vec<(usize, usize)> = Vec::new();
        let mut rows = vec![0];
        for row in 0..used.len() / lanes {
            let first = spans.len();
            let is_used = |lane: &usize| (row.saturating_sub(above)..=row).any(|row| used[row * lanes + lane]);
            for lane in (0..lanes).filter(is_used) {
                match spans[first..].last_mut() {
                    Some(last) if lane - last.1 < MIN_GAP => last.1 = lane + 1,
                    _ => spans.push((lane, lane + 1)),
                }
            }
            rows.push(spans.len());
        }
        Self { spans, rows }
    }

    /// None in rows outside the box.
    #[inline(always)]
    fn of(&self, row: isize) -> &[(usize, usize)] {
        match usize::try_from(row) {
            Ok(row) if row + 1 < self.rows.len() => &self.spans[self.rows[row]..self.rows[row + 1]],
            _ => &[],
        }
    }
}

impl Frame {
    /// Of a mask with rows of `width`.
    pub fn new(mask: &[bool], width: usize) -> Self {
        let lanes = |row: &[bool]| row.chunks(LANES).map(|pixels| pixels.contains(&true)).collect::<Vec<_>>();
        let used: Vec<bool> = mask.chunks(width).flat_map(lanes).collect();
        let [spans, trios] = [0, 2].map(|above| Spans::new(&used, width.div_ceil(LANES), above));
        Self { width: width.next_multiple_of(LANES), spans, trios }
    }

    pub fn height(&self) -> usize {
        self.spans.rows.len() - 1
    }

    /// Numbers from a pixel to the one below.
    pub fn stride(&self) -> usize {
        self.width + LANES
    }

    /// Numbers of a framed array.
    pub fn len(&self) -> usize {
        LANES + (self.height() + 2) * self.stride()
    }

    /// Where a row starts in a framed array.
    pub fn start(&self, row: usize) -> usize {
        LANES + (row + 1) * self.stride()
    }

    /// The rows of a framed array.
    pub fn rows_mut<'a, T: Send>(&self, framed: &'a mut [T]) -> impl IndexedParallelIterator<Item = &'a mut [T]> {
        framed[self.start(0)..].par_chunks_mut(self.stride()).take(self.height())
    }

    /// A framed array of zeros.
    pub fn zeros<T: Number>(&self) -> Aligned<T> {
        Aligned::zeros(self.len())
    }

    /// [`Self::spans`] in columns; they may end beyond the width that the mask had.
    pub fn columns(&self, row: usize) -> impl Iterator<Item = Range<usize>> {
        self.spans(row as isize).iter().map(|&(lo, hi)| lo * LANES..hi * LANES)
    }

    /// The rows in bands, from the first to the last, each with about as many lanes as any other.
    ///
    /// Their number is even: two threads then have half of the work each, and neither waits for the other.
    pub fn bands(&self) -> Vec<Range<usize>> {
        let height = self.height();
        // One band where two would be too low for each other's needs.
        let count = (2 * height.div_ceil(2 * MAX_BAND_ROWS)).min(height / MIN_BAND_ROWS).max(1);
        // To begin a span takes about as long as one of its lanes.
        let cost = |row: usize| -> usize { self.spans(row as isize).iter().map(|(lo, hi)| hi - lo + 1).sum() };
        let total: usize = (0..height).map(cost).sum();
        let (mut row, mut before) = (0, 0);
        let bands = (1..=count).map(|band| {
            let (start, most) = (row, height - (count - band) * MIN_BAND_ROWS);
            // A row goes where its middle lies.
            let belongs = |row, before| band == count || (2 * before + cost(row)) * count < 2 * total * band;
            while row < most && (row < start + MIN_BAND_ROWS || belongs(row, before)) {
                before += cost(row);
                row += 1;
            }
            start..row
        });
        bands.collect()
    }

    /// The columns of the mask in a row in whole [`LANES`], in parts from left to right; none in rows outside the box.
    #[inline(always)]
    pub fn spans(&self, row: isize) -> &[(usize, usize)] {
        self.spans.of(row)
    }

    /// The same of a row and the two above it together.
    #[inline(always)]
    pub fn trios(&self, row: isize) -> &[(usize, usize)] {
        self.trios.of(row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_share_all_rows_and_the_work_alike() {
        // Wide above and narrow below, as a goblet is.
        let width = |row: usize| if row < 100 { 320 } else { 16 };
        for height in [1, 2, 3, 4, 5, 64, 127, 128, 129, 250, 1000] {
            let mask: Vec<bool> = (0..height * 320).map(|at| at % 320 < width(at / 320)).collect();
            let (frame, mut next) = (Frame::new(&mask, 320), 0);
            let bands = frame.bands();
            for rows in &bands {
                assert_eq!(rows.start, next);
                assert!(rows.len() >= MIN_BAND_ROWS || height < MIN_BAND_ROWS);
                next = rows.end;
            }
            assert_eq!(next, height);
            assert!(height < 4 || bands.len() % 2 == 0);
            let work = |rows: &[Range<usize>]| -> usize {
                rows.iter().cloned().flatten().map(|row| width(row) / 16 + 1).sum()
            };
            let (first, second) = bands.split_at(bands.len() / 2);
            assert!(height < 4 || work(first).abs_diff(work(second)) <= 21, "{height}: {bands:?}");
        }
    }
}
