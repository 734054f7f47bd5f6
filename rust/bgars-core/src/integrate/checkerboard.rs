//! The pixel grid as a checkerboard: every edge joins a red and a black pixel.
//!
//! Pixel (row, col) is red where row + col is even. A row of `width` pixels is kept as `half = ceil(width / 2)` reds and as
//! many blacks: red k of an even row is column 2k and black k column 2k + 1; in odd rows it is the other way round (a missing
//! last pixel is one without edges). Then the neighbours of red k above and below are black k, and left and right are two
//! blacks that follow each other, so every stencil runs over contiguous memory.

use std::ops::{Add, Mul};

use rayon::prelude::*;

use crate::memory::zeros;

/// Rows of pixels that one task works on; even, so that tasks own whole rows of the next coarser grid.
pub(super) const BAND_ROWS: usize = 32;

/// Size of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub height: usize,
    pub width: usize,
}

impl Grid {
    /// Pixels of one colour in a row.
    pub fn half(self) -> usize {
        self.width.div_ceil(2)
    }

    /// Pixels of one colour.
    pub fn half_pixels(self) -> usize {
        self.height * self.half()
    }

    /// The grid of the corners: the reds of even rows.
    pub fn coarser(self) -> Self {
        Self { height: self.height.div_ceil(2), width: self.half() }
    }

    /// True for a row of the grid.
    pub fn contains(self, row: isize) -> bool {
        (0..self.height as isize).contains(&row)
    }
}

/// A floating-point number of a kernel: `f32` in the preconditioner, `f64` in the operator.
pub(super) trait Real:
    Copy + Default + PartialOrd + Send + Sync + From<f32> + Add<Output = Self> + Mul<Output = Self>
{
    /// `1 / self`, or 0 for a pixel without edges.
    fn inverse(self) -> Self;

    /// Rounded to `f32`.
    fn to_f32(self) -> f32;

    /// Exactly as `f64`.
    fn to_f64(self) -> f64;
}

macro_rules! real {
    ($type:ty) => {
        impl Real for $type {
            #[inline(always)]
            fn inverse(self) -> Self {
                if self > 0.0 { 1.0 / self } else { 0.0 }
            }

            #[inline(always)]
            #[allow(clippy::unnecessary_cast)]
            fn to_f32(self) -> f32 {
                self as f32
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
        }
    };
}
real!(f32);
real!(f64);

/// The weights of all edges, kept at their red pixels: 8 bytes a pixel.
///
/// A negative weight belongs to a *virtual* edge (see `fill`): it carries values between grids, but it is no part of
/// the system.
#[derive(Debug)]
pub(super) struct Weights {
    pub grid: Grid,
    /// To the left, right, upper and lower neighbour. A zero pads each row, a row of zeros each end.
    sides: [Vec<f32>; 4],
}

/// A row of one side's weights with a zero on either end: red k is at `k + 1`.
pub(super) type PaddedRow<'a, T> = &'a [T];

const LEFT: usize = 0;
const RIGHT: usize = 1;
const UP: usize = 2;
const DOWN: usize = 3;

impl Weights {
    /// No edges.
    pub fn zeros(grid: Grid) -> Self {
        let length = 1 + (grid.height + 2) * (grid.half() + 1);
        Self { grid, sides: std::array::from_fn(|_| zeros(length)) }
    }

    fn side(&self, side: usize, row: isize) -> PaddedRow<'_, f32> {
        let half = self.grid.half();
        let start = (row + 1) as usize * (half + 1);
        &self.sides[side][start..start + half + 2]
    }

    /// Weights from the reds of `row` (-1 to `height`) to their left neighbours.
    pub fn left(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(LEFT, row)
    }

    /// The same to the right.
    pub fn right(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(RIGHT, row)
    }

    /// The same upward.
    pub fn up(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(UP, row)
    }

    /// The same downward.
    pub fn down(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(DOWN, row)
    }

    /// The weights of each band of rows, to write: rows of `half` weights and a zero each, left, right, up, down.
    pub fn bands_mut(&mut self) -> impl IndexedParallelIterator<Item = [&mut [f32]; 4]> {
        let stride = self.grid.half() + 1;
        let inner = 1 + stride..1 + stride * (self.grid.height + 1);
        let chunk = BAND_ROWS * stride;
        let [left, right, up, down] = self.sides.each_mut().map(|side| side[inner.clone()].par_chunks_mut(chunk));
        (left, right, up, down).into_par_iter().map(|(left, right, up, down)| [left, right, up, down])
    }

    /// Sets the weights of red `k` of `row`: left, right, up, down.
    pub fn set_red(&mut self, row: usize, k: usize, weights: [f32; 4]) {
        let index = 1 + (row + 1) * (self.grid.half() + 1) + k;
        for (side, weight) in self.sides.iter_mut().zip(weights) {
            side[index] = weight;
        }
    }

    /// The weights of the edges of the reds of `row`: left, right, up, down.
    #[inline(always)]
    fn red_sides(&self, row: isize) -> [&[f32]; 4] {
        let n = self.grid.half();
        [LEFT, RIGHT, UP, DOWN].map(|side| &self.side(side, row)[1..=n])
    }

    /// The weights of the edges of the blacks of `row`, kept at their four reds: left, right, up, down.
    #[inline(always)]
    fn black_sides(&self, row: isize) -> [&[f32]; 4] {
        let n = self.grid.half();
        let odd = is_odd(row);
        // Left and right red of black k: k and k + 1 in even rows, k - 1 and k in odd ones.
        [
            &self.right(row)[1 - odd..][..n],
            &self.left(row)[2 - odd..][..n],
            &self.down(row - 1)[1..=n],
            &self.up(row + 1)[1..=n],
        ]
    }

    /// Calls `visit(k, sum of weights, sum of weights times neighbours)` for the reds of `row`; `blacks` are the padded rows
    /// above, at and below it.
    #[inline(always)]
    pub fn each_red<T: Real>(&self, row: isize, blacks: [PaddedRow<'_, T>; 3], visit: impl FnMut(usize, T, T)) {
        let odd = is_odd(row);
        each(self.grid.half(), self.red_sides(row), blacks, odd, visit);
    }

    /// The same for the blacks of `row`.
    #[inline(always)]
    pub fn each_black<T: Real>(&self, row: isize, reds: [PaddedRow<'_, T>; 3], visit: impl FnMut(usize, T, T)) {
        let odd = is_odd(row);
        each(self.grid.half(), self.black_sides(row), reds, 1 - odd, visit);
    }

    /// `out_k = b_k / diagonal_k` for the reds of `row`; 0 where there are no edges.
    #[inline(always)]
    pub fn scale_reds<T: Real>(&self, row: isize, b: impl Fn(usize) -> T, out: &mut [T]) {
        scale(self.grid.half(), self.red_sides(row), b, out);
    }

    /// The same for the blacks of `row`.
    #[inline(always)]
    pub fn scale_blacks<T: Real>(&self, row: isize, b: impl Fn(usize) -> T, out: &mut [T]) {
        scale(self.grid.half(), self.black_sides(row), b, out);
    }
}

/// 1 for an odd row, also for the row above the first.
#[inline(always)]
fn is_odd(row: isize) -> usize {
    row.rem_euclid(2) as usize
}

/// `shift` is 0 where the left neighbour of pixel k is pixel k - 1 of the other colour, 1 where it is pixel k.
#[inline(always)]
fn each<T: Real>(
    n: usize,
    [left, right, up, down]: [&[f32]; 4],
    [above, here, below]: [PaddedRow<'_, T>; 3],
    shift: usize,
    mut visit: impl FnMut(usize, T, T),
) {
    let (above, below) = (&above[1..=n], &below[1..=n]);
    let (here_left, here_right) = (&here[shift..][..n], &here[1 + shift..][..n]);
    let (left, right, up, down) = (&left[..n], &right[..n], &up[..n], &down[..n]);
    for k in 0..n {
        let [left, right, up, down] = [left[k], right[k], up[k], down[k]].map(real::<T>);
        let sum = (left * here_left[k] + right * here_right[k]) + (up * above[k] + down * below[k]);
        visit(k, (left + right) + (up + down), sum);
    }
}

#[inline(always)]
fn scale<T: Real>(n: usize, [left, right, up, down]: [&[f32]; 4], b: impl Fn(usize) -> T, out: &mut [T]) {
    let (left, right, up, down) = (&left[..n], &right[..n], &up[..n], &down[..n]);
    let out = &mut out[..n];
    for k in 0..n {
        let [left, right, up, down] = [left[k], right[k], up[k], down[k]].map(real::<T>);
        out[k] = b(k) * ((left + right) + (up + down)).inverse();
    }
}

/// The weight of an edge of the system; 0 for a virtual edge.
#[inline(always)]
fn real<T: Real>(weight: f32) -> T {
    T::from(weight.max(0.0))
}

/// The last four padded rows of a quantity that is computed row after row.
pub(super) struct Ring<T> {
    rows: [Vec<T>; 4],
}

impl<T: Real> Ring<T> {
    pub fn new(half: usize) -> Self {
        Self { rows: std::array::from_fn(|_| vec![T::default(); half + 2]) }
    }

    #[inline(always)]
    pub fn row(&self, row: isize) -> PaddedRow<'_, T> {
        &self.rows[row.rem_euclid(4) as usize]
    }

    /// The rows above, at and below `row`.
    #[inline(always)]
    pub fn around(&self, row: isize) -> [PaddedRow<'_, T>; 3] {
        [self.row(row - 1), self.row(row), self.row(row + 1)]
    }

    /// The `half` values of a row, to write.
    #[inline(always)]
    pub fn row_mut(&mut self, row: isize) -> &mut [T] {
        let row = &mut self.rows[row.rem_euclid(4) as usize];
        let end = row.len() - 1;
        &mut row[1..end]
    }
}

/// Splits a row of pixels into its reds and blacks.
#[inline(always)]
pub(super) fn split_row<T: Copy>(row: usize, pixels: &[T], reds: &mut [T], blacks: &mut [T]) {
    let (first, second) = if row.is_multiple_of(2) { (reds, blacks) } else { (blacks, reds) };
    for (pair, (first, second)) in pixels.chunks_exact(2).zip(first.iter_mut().zip(second.iter_mut())) {
        *first = pair[0];
        *second = pair[1];
    }
    if pixels.len() % 2 == 1 {
        first[pixels.len() / 2] = pixels[pixels.len() - 1];
    }
}

/// Joins reds and blacks to a row of pixels.
#[inline(always)]
pub(super) fn join_row<T: Copy>(row: usize, reds: &[T], blacks: &[T], pixels: &mut [T]) {
    let (first, second) = if row.is_multiple_of(2) { (reds, blacks) } else { (blacks, reds) };
    let width = pixels.len();
    for (pair, (&first, &second)) in pixels.chunks_exact_mut(2).zip(first.iter().zip(second)) {
        pair[0] = first;
        pair[1] = second;
    }
    if width % 2 == 1 {
        pixels[width - 1] = first[width / 2];
    }
}
