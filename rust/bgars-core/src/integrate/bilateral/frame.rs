//! Rows of the box in a frame of zeros, and the part of each row that the mask reaches.

use super::number::Number;
use crate::memory::Aligned;

/// Numbers that a loop takes at a time.
pub(super) const LANES: usize = 16;

/// The layout of a *framed* array: each row is followed by numbers of no pixel, and a row of such lies before the first and
/// after the last. They stay zero, so a neighbour can be read without asking whether there is one.
///
/// Rows are widened to whole [`LANES`], and so are the spans of the mask in them: loops over them have no remainder.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub height: usize,
    pub width: usize,
    /// First and last (exclusive) column of the mask in each row, outward to whole lanes; both 0 in an empty row.
    spans: Vec<(usize, usize)>,
}

impl Frame {
    /// `used` tells the pixels of the mask by row and column.
    pub fn new(height: usize, width: usize, used: impl Fn(usize, usize) -> bool) -> Self {
        let span = |row: usize| {
            let first = (0..width).find(|&col| used(row, col))?;
            Some((first, 1 + (0..width).rfind(|&col| used(row, col))?))
        };
        let widened = |(lo, hi): (usize, usize)| (lo / LANES * LANES, hi.next_multiple_of(LANES));
        let spans = (0..height).map(|row| span(row).map_or((0, 0), widened)).collect();
        Self { height, width: width.next_multiple_of(LANES), spans }
    }

    /// Numbers from a pixel to the one below.
    pub fn stride(&self) -> usize {
        self.width + LANES
    }

    /// Numbers of a framed array.
    pub fn len(&self) -> usize {
        LANES + (self.height + 2) * self.stride()
    }

    /// Where a row starts in a framed array.
    pub fn start(&self, row: usize) -> usize {
        LANES + (row + 1) * self.stride()
    }

    /// A framed array of zeros.
    pub fn zeros<T: Number>(&self) -> Aligned<T> {
        Aligned::zeros(self.len())
    }

    /// The columns of a row that the mask reaches; none in rows outside the box.
    pub fn span(&self, row: isize) -> (usize, usize) {
        usize::try_from(row).ok().and_then(|row| self.spans.get(row)).copied().unwrap_or((0, 0))
    }
}
