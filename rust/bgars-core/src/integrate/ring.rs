//! Rows that are worked on while they are in the nearest cache.

use super::checkerboard::{LANES, PaddedRow};
use super::real::Real;
use crate::memory::Aligned;

/// The last four padded rows of a quantity that is computed row after row.
pub(super) struct Ring<T: Real> {
    rows: Aligned<T>,
    half: usize,
}

impl<T: Real> Ring<T> {
    pub fn new(half: usize) -> Self {
        Self { rows: Aligned::zeros(4 * (half + LANES) + LANES), half }
    }

    #[inline(always)]
    fn start(&self, row: isize) -> usize {
        LANES + row.rem_euclid(4) as usize * (self.half + LANES)
    }

    #[inline(always)]
    pub fn row(&self, row: isize) -> PaddedRow<'_, T> {
        &self.rows[self.start(row) - 1..][..self.half + 2]
    }

    /// The rows above, at and below `row`.
    #[inline(always)]
    pub fn around(&self, row: isize) -> [PaddedRow<'_, T>; 3] {
        [self.row(row - 1), self.row(row), self.row(row + 1)]
    }

    /// The `half` values of a row, to write.
    #[inline(always)]
    pub fn row_mut(&mut self, row: isize) -> &mut [T] {
        let start = self.start(row);
        &mut self.rows[start..][..self.half]
    }
}
