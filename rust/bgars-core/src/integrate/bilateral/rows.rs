//! Rows of vectors on their way through a sweep, and the product with a row of the system.

use super::frame::{Aligned, LANES};
use super::number::Number;
use super::sweep::Scaled;

/// The last three rows of a vector, with zeros at either end.
pub(super) struct Ring<T> {
    rows: [Aligned<T>; 3],
    spans: [(usize, usize); 3],
}

impl<T: Number> Ring<T> {
    pub fn new(width: usize) -> Self {
        Self { rows: std::array::from_fn(|_| Aligned::zeros(width + 2 * LANES)), spans: [(0, 0); 3] }
    }

    /// Makes room for a row in place of the oldest: its columns `lo..hi` to be written, the others zero.
    #[inline(always)]
    pub fn begin(&mut self, row: isize, (lo, hi): (usize, usize)) -> &mut [T] {
        let slot = row.rem_euclid(3) as usize;
        let (old_lo, old_hi) = self.spans[slot];
        self.spans[slot] = (lo, hi);
        self.rows[slot][LANES + old_lo..LANES + old_hi].fill(T::default());
        &mut self.rows[slot][LANES + lo..LANES + hi]
    }

    #[inline(always)]
    pub fn row(&self, row: isize, (lo, hi): (usize, usize)) -> &[T] {
        &self.rows[row.rem_euclid(3) as usize][LANES + lo..LANES + hi]
    }

    /// All of a row, zeros before and after.
    #[inline(always)]
    fn whole(&self, row: isize) -> &[T] {
        &self.rows[row.rem_euclid(3) as usize]
    }
}

/// A row of pixels within a framed array.
#[derive(Clone, Copy)]
pub(super) struct Row {
    /// Place of its first pixel.
    pub at: usize,
    /// Its pixels.
    pub n: usize,
    /// Numbers from one row to the next.
    pub stride: usize,
}

/// `C` of a row's pixels to the left, right, above and below.
pub(super) struct Sides<'a, T>([&'a [T]; 4]);

impl<'a, T: Number> Sides<'a, T> {
    #[inline(always)]
    pub fn new(system: &'a Scaled<'_, T>, Row { at, n, stride }: Row) -> Self {
        let Scaled { right, below, .. } = system;
        Self([&right[at - 1..][..n], &right[at..][..n], &below[at - stride..][..n], &below[at..][..n]])
    }

    /// `x - C x` where x is framed, for two vectors.
    #[inline(always)]
    pub fn apply_both(&self, [x, y]: [&[T]; 2], Row { at, n, stride }: Row, [out_x, out_y]: [&mut [T]; 2]) {
        let Self([left, right, up, down]) = self;
        let (left, right, up, down) = (&left[..n], &right[..n], &up[..n], &down[..n]);
        let (x_here, x_left, x_right) = (&x[at..][..n], &x[at - 1..][..n], &x[at + 1..][..n]);
        let (y_here, y_left, y_right) = (&y[at..][..n], &y[at - 1..][..n], &y[at + 1..][..n]);
        let (x_up, x_down) = (&x[at - stride..][..n], &x[at + stride..][..n]);
        let (y_up, y_down) = (&y[at - stride..][..n], &y[at + stride..][..n]);
        let (out_x, out_y) = (&mut out_x[..n], &mut out_y[..n]);
        for k in 0..n {
            let (left, right, up, down) = (left[k], right[k], up[k], down[k]);
            out_x[k] = x_here[k] - ((left * x_left[k] + right * x_right[k]) + (up * x_up[k] + down * x_down[k]));
            out_y[k] = y_here[k] - ((left * y_left[k] + right * y_right[k]) + (up * y_up[k] + down * y_down[k]));
        }
    }

    /// The same for one vector whose last rows are in a ring.
    #[inline(always)]
    pub fn apply(&self, x: &Ring<T>, row: isize, (lo, hi): (usize, usize), out: &mut [T]) {
        let n = hi - lo;
        let Self([left, right, up, down]) = self;
        let (left, right, up, down) = (&left[..n], &right[..n], &up[..n], &down[..n]);
        let at = LANES + lo;
        let (here, x_left, x_right) =
            (&x.whole(row)[at..][..n], &x.whole(row)[at - 1..][..n], &x.whole(row)[at + 1..][..n]);
        let (x_up, x_down) = (&x.whole(row - 1)[at..][..n], &x.whole(row + 1)[at..][..n]);
        let out = &mut out[..n];
        for k in 0..n {
            out[k] =
                here[k] - ((left[k] * x_left[k] + right[k] * x_right[k]) + (up[k] * x_up[k] + down[k] * x_down[k]));
        }
    }
}
