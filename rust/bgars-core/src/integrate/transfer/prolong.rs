//! Up: the coarser grid's correction added, and smoothed.

use multiversion::multiversion;
use rayon::prelude::*;

use super::{CentreTies, corner_ties};
use crate::integrate::checkerboard::{BAND_ROWS, Weights};
use crate::integrate::real::{Real, on_vectors};
use crate::integrate::reduction::solve_blacks;
use crate::integrate::ring::Ring;
use crate::vector::Packed;

/// `x = D^-1 (b + N (D^-1 b + P coarse))`, `N = W D_black^-1 W^T`: the correction of the coarser grid (row-major), smoothed.
///
/// `x` is written along the spans of the grid.
pub(in crate::integrate) fn prolong(weights: &Weights, b: &[f32], coarse: &[f32], x: &mut [f32]) {
    let task_rows = weights.spans.bands_of_a_task() * BAND_ROWS;
    x.par_chunks_mut(task_rows * weights.grid.half()).enumerate().for_each_init(
        || Prolonging::new(weights.grid.half()),
        |rows, (task, x)| prolong_rows(weights, b, coarse, task * task_rows, rows, x),
    );
}

/// Rows on their way through the prolongation.
pub(super) struct Prolonging {
    smooth: Ring<f32>,
    blacks: Ring<f32>,
    ties: Ring<f32>,
    /// The coarse grid at the blacks.
    on_edges: Ring<f32>,
    corners: Ring<f32>,
}

impl Prolonging {
    pub fn new(n: usize) -> Self {
        let [smooth, blacks, ties, on_edges, corners] = std::array::from_fn(|_| Ring::new(n));
        Self { smooth, blacks, ties, on_edges, corners }
    }
}

/// [`prolong`] to the rows from `first_row` on.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn prolong_rows(
    weights: &Weights,
    b: &[f32],
    coarse: &[f32],
    first_row: usize,
    rows: &mut Prolonging,
    x: &mut [f32],
) {
    on_vectors!(weights.grid, [f32], prolong_rows_with(weights, b, coarse, first_row, rows, x));
}

#[inline(always)]
pub(super) fn prolong_rows_with<V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[f32],
    coarse: &[f32],
    first_row: usize,
    rows: &mut Prolonging,
    x: &mut [f32],
) {
    let (n, first) = (weights.grid.half(), first_row as isize);
    let end = first + (x.len() / n) as isize;
    for row in first - LEAD..end {
        go_ahead::<V>(weights, b, coarse, row, rows);
        if row >= first {
            let x = &mut x[(row - first) as usize * n..][weights.spans.at(row).range()];
            finish_row::<V>(weights, b, row, rows, x, |_, value| value);
        }
    }
}

/// How many rows before the first that is finished [`go_ahead`] begins.
pub(super) const LEAD: isize = 6;

/// What goes ahead of `row`, so that it can be finished: called for one row after the other.
#[inline(always)]
pub(super) fn go_ahead<V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[f32],
    coarse: &[f32],
    row: isize,
    rows: &mut Prolonging,
) {
    // Blacks between corners, one row further: the centres of an odd row need those of the row below.
    corners_to_blacks::<V>(weights, row + 3, coarse, rows);
    smooth_and_correct::<V>(weights, b, row + 2, coarse, rows);
    if weights.grid.contains(row + 1) {
        solve_blacks::<V>(weights, row + 1, weights.spans.at(row + 1), &rows.smooth, &mut rows.blacks);
    }
}

/// `D^-1 (b + N y)` of a row along its span, `y` what [`smooth_and_correct`] left; `then` makes of vector `k` what is written.
#[inline(always)]
pub(super) fn finish_row<V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[f32],
    row: isize,
    rows: &mut Prolonging,
    x: &mut [f32],
    then: impl Fn(usize, V) -> V,
) {
    let (half, span) = (weights.grid.half(), weights.spans.at(row));
    let stencil = weights.red_stencil::<V>(row, span, rows.blacks.around(row));
    let (b, x) = (V::chunks(&b[row as usize * half..][span.range()], stencil.len()), V::chunks_mut(x, stencil.len()));
    for k in 0..stencil.len() {
        then(k, (V::read(&b[k]) + stencil.sum(k)).over(stencil.diagonal(k))).put(&mut x[k]);
    }
}

/// The corners of an even row.
#[inline(always)]
fn corner_row(coarse: &[f32], row: isize, n: usize) -> &[f32] {
    &coarse[(row / 2) as usize * n..][..n]
}

/// The coarse grid at the blacks of a row, between the corners beside each.
#[inline(always)]
fn corners_to_blacks<V: Packed<Number = f32>>(weights: &Weights, row: isize, coarse: &[f32], rows: &mut Prolonging) {
    if !weights.grid.contains(row) {
        return;
    }
    let (half, span) = (weights.grid.half(), weights.spans.at(row));
    let Prolonging { corners, ties, on_edges, .. } = rows;
    let (first, second) = if row % 2 == 0 {
        let beyond = (span.end + 1).min(half);
        corners.row_mut(row)[span.start..beyond].copy_from_slice(&corner_row(coarse, row, half)[span.start..beyond]);
        (&corners.row(row)[1..], &corners.row(row)[2..])
    } else {
        let above = corner_row(coarse, row - 1, half);
        (above, if weights.grid.contains(row + 1) { corner_row(coarse, row + 1, half) } else { above })
    };
    let [to_first, to_second] = corner_ties::<V>(weights, row, span);
    let n = to_first.len();
    let (first, second) = (V::chunks(&first[span.start..], n), V::chunks(&second[span.start..], n));
    let ties = V::chunks_mut(&mut ties.row_mut(row)[span.start..], n);
    let out = V::chunks_mut(&mut on_edges.row_mut(row)[span.start..], n);
    for k in 0..n {
        let (to_first, to_second) = (V::widen(&to_first[k]).magnitude(), V::widen(&to_second[k]).magnitude());
        let sum = to_first.times_plus(V::read(&first[k]), to_second * V::read(&second[k]));
        let tie = to_first + to_second;
        tie.put(&mut ties[k]);
        sum.over(tie).put(&mut out[k]);
    }
}

/// `D^-1 b` of a row, and the coarse grid: itself at corners, from the blacks around them at centres.
#[inline(always)]
fn smooth_and_correct<V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[f32],
    row: isize,
    coarse: &[f32],
    rows: &mut Prolonging,
) {
    if !weights.grid.contains(row) {
        return;
    }
    let (half, span) = (weights.grid.half(), weights.spans.at(row));
    let n = span.vectors::<V>();
    let Prolonging { smooth, ties, on_edges, .. } = rows;
    let b = V::chunks(&b[row as usize * half..][span.range()], n);
    let out = V::chunks_mut(&mut smooth.row_mut(row)[span.start..], n);
    if row % 2 == 0 {
        let sides = weights.reds::<V>(row, span);
        let corners = V::chunks(&corner_row(coarse, row, half)[span.start..], n);
        for k in 0..n {
            (V::read(&b[k]).over(sides.diagonal(k)) + V::read(&corners[k])).put(&mut out[k]);
        }
    } else {
        let stencil = weights.red_stencil::<V>(row, span, on_edges.around(row));
        let ties = CentreTies::<V>::new(stencil.sides(), row, span, ties);
        for k in 0..n {
            let centre = stencil.sum(k).over(ties.sum(k));
            (V::read(&b[k]).over(stencil.diagonal(k)) + centre).put(&mut out[k]);
        }
    }
}
