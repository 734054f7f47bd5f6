//! The pixel grid as a checkerboard: every edge joins a red and a black pixel.
//!
//! Pixel (row, col) is red where row + col is even. A row of `width` pixels is kept as `half = ceil(width / 2)` reds (or a few
//! more, see [`LANES`]) and as many blacks: red k of an even row is column 2k and black k column 2k + 1; in odd rows it is the
//! other way round (missing pixels at the end are ones without edges). Then the neighbours of red k above and below are black
//! k, and left and right are two blacks that follow each other, so every stencil runs over contiguous memory.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::spans::{Span, Spans};
use super::stencil::{Sides, Stencil};
use crate::memory::Aligned;
use crate::vector::Packed;

/// Rows of pixels that one task works on; even, so that tasks own whole rows of the next coarser grid.
pub(super) const BAND_ROWS: usize = 32;

/// Pixels of one colour that a row is whole multiples of, unless it has fewer: whole vectors of any processor.
pub(super) const LANES: usize = 16;

/// Size of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub height: usize,
    pub width: usize,
}

impl Grid {
    /// Pixels of one colour in a row.
    #[inline(always)]
    pub fn half(self) -> usize {
        let half = self.width.div_ceil(2);
        if half < LANES { half } else { half.next_multiple_of(LANES) }
    }

    /// Zeros between rows of weights.
    #[inline(always)]
    fn pad(self) -> usize {
        if self.half() < LANES { 1 } else { LANES }
    }

    /// True where rows are whole vectors.
    pub fn has_lanes(self) -> bool {
        self.half() >= LANES
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

/// The weights of all edges, kept at their red pixels: 8 bytes a pixel.
///
/// A negative weight belongs to a *virtual* edge (see `fill`): it carries values between grids, but it is no part of
/// the system.
#[derive(Debug)]
pub(super) struct Weights {
    pub grid: Grid,
    /// To the left, right, upper and lower neighbour. Zeros pad each row, a row of zeros each end.
    sides: [Aligned<f32>; 4],
    /// The part of each band that kernels work on. What is left beside it may be any finite number: no edge leads there.
    pub spans: Spans,
}

/// A row of one side's weights with a zero on either end: red k is at `k + 1`.
pub(super) type PaddedRow<'a, T> = &'a [T];

pub(super) const LEFT: usize = 0;
pub(super) const RIGHT: usize = 1;
pub(super) const UP: usize = 2;
pub(super) const DOWN: usize = 3;

impl Weights {
    /// No edges.
    #[cfg(test)]
    pub fn zeros(grid: Grid) -> Self {
        let mut weights = Self::unset(grid);
        weights.sides.iter_mut().for_each(|side| side.fill(0.0));
        weights
    }

    /// Edges of any weight: every row is to be set by its band.
    pub fn unset(grid: Grid) -> Self {
        let length = grid.pad() + (grid.height + 2) * (grid.half() + grid.pad());
        let mut weights =
            Self { grid, sides: std::array::from_fn(|_| Aligned::any(length)), spans: Spans::whole(grid) };
        let (first, end, stride) = (weights.start(0), weights.start(grid.height as isize), weights.stride());
        for side in &mut weights.sides {
            side[..first].fill(0.0);
            side[first..end].chunks_mut(stride).for_each(|row| row[grid.half()..].fill(0.0));
            side[end..].fill(0.0);
        }
        weights
    }

    /// Gives them up, and their pages to the system at once.
    pub fn release(self) {
        self.sides.into_iter().for_each(Aligned::release);
    }

    /// Weights from one red to the one below.
    #[inline(always)]
    pub fn stride(&self) -> usize {
        self.grid.half() + self.grid.pad()
    }

    /// Where the weights of a row start.
    #[inline(always)]
    fn start(&self, row: isize) -> usize {
        self.grid.pad() + (row + 1) as usize * self.stride()
    }

    #[inline(always)]
    fn side(&self, side: usize, row: isize) -> PaddedRow<'_, f32> {
        &self.sides[side][self.start(row) - 1..][..self.grid.half() + 2]
    }

    /// Weights from the reds of `row` (-1 to `height`) to their left neighbours.
    #[inline(always)]
    pub fn left(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(LEFT, row)
    }

    /// The same to the right.
    #[inline(always)]
    pub fn right(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(RIGHT, row)
    }

    /// The same upward.
    #[inline(always)]
    pub fn up(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(UP, row)
    }

    /// The same downward.
    #[inline(always)]
    pub fn down(&self, row: isize) -> PaddedRow<'_, f32> {
        self.side(DOWN, row)
    }

    /// Weights from the reds of `row` to their left, right, upper and lower neighbours.
    #[inline(always)]
    pub fn row(&self, row: isize) -> [PaddedRow<'_, f32>; 4] {
        [self.left(row), self.right(row), self.up(row), self.down(row)]
    }

    /// The bands of rows, to set.
    pub fn bands_mut(&mut self) -> impl IndexedParallelIterator<Item = Band<'_>> {
        let (half, stride) = (self.grid.half(), self.stride());
        let inner = self.start(0)..self.start(self.grid.height as isize);
        let chunk = BAND_ROWS * stride;
        let [left, right, up, down] = self.sides.each_mut().map(|side| side[inner.clone()].par_chunks_mut(chunk));
        (left, right, up, down).into_par_iter().enumerate().map(move |(band, (left, right, up, down))| Band {
            rows: band * BAND_ROWS..band * BAND_ROWS + left.len() / stride,
            sides: [left, right, up, down],
            half,
            stride,
        })
    }

    /// Sets the weights of red `k` of `row`: left, right, up, down.
    pub fn set_red(&mut self, row: usize, k: usize, weights: [f32; 4]) {
        let index = self.start(row as isize) + k;
        for (side, weight) in self.sides.iter_mut().zip(weights) {
            side[index] = weight;
        }
    }

    /// The weights of the edges of the reds of `row` along a span.
    #[inline(always)]
    pub fn reds<V: Packed>(&self, row: isize, span: Span) -> Sides<'_, V> {
        let (first, n) = (1 + span.start, span.vectors::<V>());
        let [left, right, up, down] = self.row(row);
        Sides([
            V::floats(&left[first..], n),
            V::floats(&right[first..], n),
            V::floats(&up[first..], n),
            V::floats(&down[first..], n),
        ])
    }

    /// The weights of the edges of the blacks of `row`, kept at their four reds.
    #[inline(always)]
    pub fn blacks<V: Packed>(&self, row: isize, span: Span) -> Sides<'_, V> {
        let n = span.vectors::<V>();
        let odd = is_odd(row);
        // Left and right red of black k: k and k + 1 in even rows, k - 1 and k in odd ones.
        Sides([
            V::floats(&self.right(row)[1 - odd + span.start..], n),
            V::floats(&self.left(row)[2 - odd + span.start..], n),
            V::floats(&self.down(row - 1)[1 + span.start..], n),
            V::floats(&self.up(row + 1)[1 + span.start..], n),
        ])
    }

    /// The reds of `row` along a span among the blacks: of the rows above, at and below.
    #[inline(always)]
    pub fn red_stencil<'a, V: Packed>(
        &'a self,
        row: isize,
        span: Span,
        blacks: [PaddedRow<'a, V::Number>; 3],
    ) -> Stencil<'a, V> {
        Stencil::new(self.reds(row, span), blacks, span, is_odd(row))
    }

    /// The blacks of `row` among the reds.
    #[inline(always)]
    pub fn black_stencil<'a, V: Packed>(
        &'a self,
        row: isize,
        span: Span,
        reds: [PaddedRow<'a, V::Number>; 3],
    ) -> Stencil<'a, V> {
        Stencil::new(self.blacks(row, span), reds, span, 1 - is_odd(row))
    }
}

/// The weights of a band of rows.
pub(super) struct Band<'a> {
    /// The rows of the grid.
    pub rows: Range<usize>,
    /// To the left, right, upper and lower neighbour: rows of `half`, `stride` apart.
    sides: [&'a mut [f32]; 4],
    half: usize,
    stride: usize,
}

impl Band<'_> {
    /// Sets the edges from the row above the band down to its first; one weight a pixel.
    pub fn set_above(&mut self, below: &[f32]) {
        let mut elsewhere = vec![0.0; self.half];
        split_whole_row(self.rows.start + 1, below, &mut elsewhere, &mut self.sides[UP][..self.half]);
    }

    /// Sets the edges of a row's pixels to the right, and to the row below; one weight a pixel, the last to the right 0.
    pub fn set_row(&mut self, row: usize, right: &[f32], below: &[f32]) {
        let (at, next) = ((row - self.rows.start) * self.stride, (row + 1 - self.rows.start) * self.stride);
        let half = self.half;
        let [reds_left, reds_right, reds_up, reds_down] = &mut self.sides;
        // The black to the left of red k is black k in odd rows, and k - 1 in even ones.
        let first = 1 - row % 2;
        reds_left[at] = 0.0;
        split_whole_row(row, right, &mut reds_right[at..][..half], &mut reds_left[at + first..][..half]);
        let mut elsewhere = Vec::new();
        let up_to_blacks = if row + 1 < self.rows.end {
            &mut reds_up[next..][..half]
        } else {
            elsewhere.resize(half, 0.0);
            &mut elsewhere[..]
        };
        split_whole_row(row, below, &mut reds_down[at..][..half], up_to_blacks);
    }
}

#[cfg(test)]
impl Weights {
    /// Narrows the work on each band of rows to its pixels with edges.
    pub fn find_spans(&mut self) {
        self.spans = Spans::of_edges(self.grid, &super::edge_bits::EdgeBits::of(self));
    }

    /// Edges of any of some weights, at random, on a grid of 40 x 90 pixels.
    pub fn ragged(choices: [f32; 6]) -> Self {
        let mut weights = Self::zeros(Grid { height: 40, width: 90 });
        for row in 1..39 {
            for k in 1..44 {
                let choice = |side: usize| choices[(((row * 991 + k * 4 + side) * 2_654_435_761) >> 9) % choices.len()];
                weights.set_red(row, k, std::array::from_fn(choice));
            }
        }
        weights
    }
}

/// 1 for an odd row, also for the row above the first.
#[inline(always)]
fn is_odd(row: isize) -> usize {
    row.rem_euclid(2) as usize
}

/// The colour of a row's first pixel, and the other one.
#[inline(always)]
pub(super) fn by_column<T>(row: usize, [reds, blacks]: [T; 2]) -> [T; 2] {
    if row.is_multiple_of(2) { [reds, blacks] } else { [blacks, reds] }
}

/// Splits a row of pixels into its reds and blacks.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn split_row<T: Copy>(row: usize, pixels: &[T], reds: &mut [T], blacks: &mut [T]) {
    let [first, second] = by_column(row, [reds, blacks]);
    for (pair, (first, second)) in pixels.chunks_exact(2).zip(first.iter_mut().zip(second.iter_mut())) {
        *first = pair[0];
        *second = pair[1];
    }
    if pixels.len() % 2 == 1 {
        first[pixels.len() / 2] = pixels[pixels.len() - 1];
    }
}

/// The same, and zeros for the pixels that are missing at the end.
pub(super) fn split_whole_row<T: Copy + Default>(row: usize, pixels: &[T], reds: &mut [T], blacks: &mut [T]) {
    split_row(row, pixels, reds, blacks);
    let [longer, shorter] = by_column(row, [reds, blacks]);
    longer[pixels.len().div_ceil(2)..].fill(T::default());
    shorter[pixels.len() / 2..].fill(T::default());
}

/// Joins reds and blacks to a row of pixels.
#[inline(always)]
pub(super) fn join_row<T: Copy>(row: usize, reds: &[T], blacks: &[T], pixels: &mut [T]) {
    let [first, second] = by_column(row, [reds, blacks]);
    let width = pixels.len();
    for (pair, (&first, &second)) in pixels.chunks_exact_mut(2).zip(first.iter().zip(second)) {
        pair[0] = first;
        pair[1] = second;
    }
    if width % 2 == 1 {
        pixels[width - 1] = first[width / 2];
    }
}

/// [`join_row`], compiled for the processor at hand.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn join_whole_row<T: Copy>(row: usize, reds: &[T], blacks: &[T], pixels: &mut [T]) {
    join_row(row, reds, blacks, pixels);
}
