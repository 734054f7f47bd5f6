//! What one task of a sweep does: a band of rows.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::super::real::{Real, on_vectors};
use super::frame::{Frame, LANES, MIN_BAND_ROWS};
use super::number::Number;
use super::rows::{
    Around, Block, Edge, Factors, KEPT, Rows, SUMS, Steps, TIES, Ties, VECTORS, add_products, advance, advance_beside,
    all_stages, flush, multiply,
};
use crate::memory::Aligned;
use crate::vector::Packed;

/// Rows on either side of a band whose residual it updates for itself.
pub(super) const BESIDE: usize = MIN_BAND_ROWS;
/// Rows of a band that its neighbours need: the first two and the last two.
const EDGE: usize = 2 * BESIDE;
/// Rows after which the sums of `f32` go over into `f64`.
const FLUSH: usize = 8;

/// `I - C` of a 5-point system scaled to a diagonal of ones.
#[derive(Debug)]
pub(super) struct Scaled<'a, T: Number> {
    pub frame: &'a Frame,
    /// [`Ties`] of a row of zeros, and of every row.
    pub ties: Aligned<T>,
}

impl<'a, T: Number> Scaled<'a, T> {
    /// No ties.
    pub fn new(frame: &'a Frame) -> Self {
        Self { frame, ties: Aligned::zeros((frame.height() + 1) * stride(frame) * TIES * LANES) }
    }

    /// `set` writes the ties of every part of a row, of which it gets where that begins in framed arrays.
    pub fn each_part(&mut self, set: impl Fn(usize, &mut [Ties<T>]) + Sync) {
        let Self { frame, ties } = self;
        let ties = ties.as_chunks_mut().0.as_chunks_mut().0;
        // After the row of zeros.
        ties.par_chunks_exact_mut(stride(frame)).skip(1).enumerate().for_each(|(row, ties)| {
            for &(lo, hi) in frame.spans(row as isize) {
                set(frame.start(row) + lo * LANES, &mut ties[lo..hi]);
            }
        });
    }
}

/// What one task sweeps.
#[derive(Debug)]
pub(super) struct Band<T: Number> {
    pub rows: Range<usize>,
    /// [`Block`]s of its rows, and of [`BESIDE`] more on either side.
    pub blocks: Aligned<T>,
}

impl<T: Number> Band<T> {
    pub fn new(frame: &Frame, rows: Range<usize>) -> Self {
        let blocks = Aligned::zeros((rows.len() + 2 * BESIDE) * stride(frame) * VECTORS * LANES);
        Self { rows, blocks }
    }

    /// Copies to the edge what the bands beside this one need.
    pub fn keep_edge(&self, frame: &Frame, edge: &mut [T]) {
        let (Range { start, end }, stride) = (self.rows.clone(), stride(frame));
        let edge: &mut [Edge<T>] = edge.as_chunks_mut().0.as_chunks_mut().0;
        // An image of a single row has no second one: no spans.
        let rows = (start..start + BESIDE).chain(end.saturating_sub(BESIDE)..end);
        for (row, kept) in rows.zip(edge.chunks_mut(stride)) {
            let blocks = &blocks(&self.blocks)[(row + BESIDE - start) * stride..];
            for &(lo, hi) in frame.spans(row as isize) {
                for (block, kept) in blocks[lo..hi].iter().zip(&mut kept[lo..hi]) {
                    let [_, p, r, a_p, a_r, a_a_p] = *block;
                    *kept = [p, r, a_p, a_r, a_a_p];
                }
            }
        }
    }
}

/// Numbers as blocks.
pub(super) fn blocks<T>(numbers: &[T]) -> &[Block<T>] {
    numbers.as_chunks().0.as_chunks().0
}

pub(super) fn blocks_mut<T>(numbers: &mut [T]) -> &mut [Block<T>] {
    numbers.as_chunks_mut().0.as_chunks_mut().0
}

/// Blocks from a pixel to the one below: those of a row, and one of zeros.
pub(super) fn stride(frame: &Frame) -> usize {
    frame.width / LANES + 1
}

/// Numbers of a band's edges.
pub(super) fn edge_length(frame: &Frame) -> usize {
    EDGE * stride(frame) * KEPT * LANES
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn sweep_band<T: Number>(
    system: &Scaled<'_, T>,
    steps: Steps,
    edges: &[T],
    index: usize,
    band: &mut Band<T>,
) -> [f64; SUMS] {
    on_vectors!([T], sweep_band_with::<T>(system, steps, edges, index, band))
}

/// A row goes through three stages, each a row behind the one before, whose neighbours it needs: r and p after both iterations
/// (and `A p1`, in the place of A p), then `A p` and `A r`, then `A A p`. Rows beside the band go through the first two as well.
#[inline(always)]
pub(super) fn sweep_band_with<T: Number, V: Packed<Number = T>>(
    system: &Scaled<'_, T>,
    steps: Steps,
    edges: &[T],
    index: usize,
    band: &mut Band<T>,
) -> [f64; SUMS] {
    let frame = system.frame;
    let (stride, start, rows) = (stride(frame), band.rows.start, band.rows.len());
    let blocks = blocks_mut(&mut band.blocks);
    let edges: &[Edge<T>] = edges.as_chunks().0.as_chunks().0;
    let ties: &[Ties<T>] = system.ties.as_chunks().0.as_chunks().0;
    let factors = Factors::<V>::new(steps);
    let mut sums = [[0.0; LANES]; SUMS];
    // Rows are those of the band's blocks: the first of the image's is `BESIDE` further down.
    let spans = |row: usize| frame.spans((start + row) as isize - BESIDE as isize);
    // First and last the rows whose neighbours are beside the band, one stage after the other.
    let outer = [0..2 * BESIDE, (rows + BESIDE).max(2 * BESIDE)..rows + 2 * BESIDE];
    let inner = [2 * BESIDE..rows + BESIDE, 0..0];
    for (outer, inner) in outer.into_iter().zip(inner) {
        let mut lanes = [V::splat(T::default()); SUMS];
        for front in outer {
            for &(lo, hi) in spans(front) {
                let blocks = &mut blocks[front * stride..][lo..hi];
                if front < BESIDE {
                    // The last rows of the band above.
                    advance_beside(&factors, &edges[(index * EDGE + front - BESIDE) * stride..][lo..hi], blocks);
                } else if front >= rows + BESIDE {
                    // The first rows of the band below.
                    let row = (index + 1) * EDGE + front - rows - BESIDE;
                    advance_beside(&factors, &edges[row * stride..][lo..hi], blocks);
                } else {
                    advance(&factors, blocks);
                }
            }
            if front < BESIDE {
                continue;
            }
            for &span in spans(front - 1) {
                multiply(&factors, around(blocks, ties, stride, front - 1, start + front - 1, span));
            }
            if front < 2 * BESIDE {
                continue;
            }
            for &span in spans(front - 2) {
                add_products(around(blocks, ties, stride, front - 2, start + front - 2, span), &mut lanes);
            }
        }
        flush(&lanes, &mut sums);
        for first in inner.clone().step_by(FLUSH) {
            // Of their own: shared with the loops above, they would go to memory and back every row.
            let mut lanes = [V::splat(T::default()); SUMS];
            for front in first..inner.end.min(first + FLUSH) {
                for &span in frame.trios((start + front) as isize - BESIDE as isize) {
                    all_stages(&factors, four_rows(blocks, ties, stride, front, start + front, span), &mut lanes);
                }
            }
            flush(&lanes, &mut sums);
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

/// Part of a row of a band's blocks with its neighbours and ties; `at` counts that row from [`BESIDE`] above the image.
#[inline(always)]
fn around<'a, T>(
    blocks: &'a mut [Block<T>],
    ties: &'a [Ties<T>],
    stride: usize,
    row: usize,
    at: usize,
    (lo, hi): (usize, usize),
) -> Around<'a, T> {
    let (above, here) = blocks.split_at_mut(row * stride);
    let (here, below) = here.split_at_mut(stride);
    Around {
        above: &above[(row - 1) * stride..][lo..hi],
        here: &mut here[lo..=hi],
        below: &below[lo..hi],
        // The first row of ties is the one above the image.
        ties_above: &ties[(at - BESIDE) * stride..][lo..hi],
        ties: &ties[(at - BESIDE + 1) * stride..][lo..hi],
    }
}

/// Part of a row of a band's blocks with the three above it, and their ties; `at` counts the row from [`BESIDE`] above the image.
#[inline(always)]
fn four_rows<'a, T>(
    blocks: &'a mut [Block<T>],
    ties: &'a [Ties<T>],
    stride: usize,
    row: usize,
    at: usize,
    (lo, hi): (usize, usize),
) -> Rows<'a, T> {
    let mut rows = blocks[(row - 3) * stride..(row + 1) * stride].chunks_exact_mut(stride);
    let [top, last, middle, front] = std::array::from_fn(|_| rows.next().unwrap_or_default());
    // The first row of ties is the one above the image.
    let [ties_top, ties_last, ties_middle] = [3, 2, 1].map(|up| &ties[(at + 1 - up - BESIDE) * stride..][lo..hi]);
    Rows {
        top: &top[lo..hi],
        last: &mut last[lo..=hi],
        middle: &mut middle[lo..=hi],
        front: &mut front[lo..hi],
        ties_top,
        ties_last,
        ties_middle,
    }
}
