//! Up: the coarser grid's correction added, and smoothed.

use multiversion::multiversion;
use rayon::prelude::*;

use super::{CentreTies, corner_ties};
use crate::integrate::checkerboard::{BAND_ROWS, Weights};
use crate::integrate::real::{Real, on_vectors};
use crate::integrate::reduction::{dot, solve_blacks};
use crate::integrate::ring::Ring;
use crate::integrate::spans::Span;
use crate::vector::Packed;

/// `x = D^-1 (b + N (D^-1 b + P coarse))`, `N = W D_black^-1 W^T`: the correction of the coarser grid (row-major), smoothed.
///
/// `x` is written along the spans of the grid. Returns `<b, x>`, summed in an order that does not depend on the threads.
pub(in crate::integrate) fn prolong<T: Real>(weights: &Weights, b: &[T], coarse: &[f32], x: &mut [f32]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let bands = x.par_chunks_mut(chunk).enumerate();
    let products: Vec<f64> = bands
        .map_init(
            || Prolonging::new(weights.grid.half()),
            |rows, (band, x)| prolong_band(weights, b, coarse, band, rows, x),
        )
        .collect();
    products.iter().sum()
}

/// Rows on their way through the prolongation of a band.
pub(super) struct Prolonging {
    smooth: Ring<f32>,
    blacks: Ring<f32>,
    ties: Ring<f32>,
    /// The coarse grid at the blacks.
    on_edges: Ring<f32>,
    corners: Ring<f32>,
    /// The right side of a row.
    rounded: Vec<f32>,
}

impl Prolonging {
    pub fn new(n: usize) -> Self {
        let [smooth, blacks, ties, on_edges, corners] = std::array::from_fn(|_| Ring::new(n));
        Self { smooth, blacks, ties, on_edges, corners, rounded: vec![0.0; n] }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn prolong_band<T: Real>(
    weights: &Weights,
    b: &[T],
    coarse: &[f32],
    band: usize,
    rows: &mut Prolonging,
    x: &mut [f32],
) -> f64 {
    on_vectors!(weights.grid, f32, prolong_band_with::<T>(weights, b, coarse, band, rows, x))
}

#[inline(always)]
pub(super) fn prolong_band_with<T: Real, V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[T],
    coarse: &[f32],
    band: usize,
    rows: &mut Prolonging,
    x: &mut [f32],
) -> f64 {
    let grid = weights.grid;
    let (n, span) = (grid.half(), weights.spans.band(band));
    let first = (band * BAND_ROWS) as isize;
    let end = first + (x.len() / n) as isize;
    let mut product = 0.0;
    for ahead in first - 3..=end + 2 {
        // Blacks between corners, one row ahead: the centres of an odd row need those of the row below.
        corners_to_blacks::<V>(weights, ahead, span, coarse, rows);

        let row = ahead - 1;
        if row < first - 2 {
            continue;
        }
        smooth_and_correct::<T, V>(weights, b, row, span, coarse, rows);

        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        solve_blacks::<V>(weights, row, span, &rows.smooth, &mut rows.blacks);

        let row = row - 1;
        if row < first {
            continue;
        }
        let values = &mut x[(row - first) as usize * n..][span.range()];
        let b = &b[row as usize * n..][span.range()];
        let stencil = weights.red_stencil::<V>(row, span, rows.blacks.around(row));
        let rounded = V::chunks(T::floats(b, &mut rows.rounded), stencil.len());
        let out = V::chunks_mut(values, stencil.len());
        for k in 0..stencil.len() {
            ((V::read(&rounded[k]) + stencil.sum(k)) * stencil.diagonal(k).inverse()).put(&mut out[k]);
        }
        product += dot(b, values);
    }
    product
}

/// The corners of an even row.
#[inline(always)]
fn corner_row(coarse: &[f32], row: isize, n: usize) -> &[f32] {
    &coarse[(row / 2) as usize * n..][..n]
}

/// The coarse grid at the blacks of a row, between the corners beside each.
#[inline(always)]
fn corners_to_blacks<V: Packed<Number = f32>>(
    weights: &Weights,
    row: isize,
    span: Span,
    coarse: &[f32],
    rows: &mut Prolonging,
) {
    if !weights.grid.contains(row) {
        return;
    }
    let half = weights.grid.half();
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
        (sum * tie.inverse()).put(&mut out[k]);
    }
}

/// `D^-1 b` of a row, and the coarse grid: itself at corners, from the blacks around them at centres.
#[inline(always)]
fn smooth_and_correct<T: Real, V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[T],
    row: isize,
    span: Span,
    coarse: &[f32],
    rows: &mut Prolonging,
) {
    if !weights.grid.contains(row) {
        return;
    }
    let (half, n) = (weights.grid.half(), span.vectors::<V>());
    let Prolonging { smooth, ties, on_edges, rounded, .. } = rows;
    let b = V::chunks(T::floats(&b[row as usize * half..][span.range()], rounded), n);
    let out = V::chunks_mut(&mut smooth.row_mut(row)[span.start..], n);
    if row % 2 == 0 {
        let sides = weights.reds::<V>(row, span);
        let corners = V::chunks(&corner_row(coarse, row, half)[span.start..], n);
        for k in 0..n {
            (V::read(&b[k]) * sides.diagonal(k).inverse() + V::read(&corners[k])).put(&mut out[k]);
        }
    } else {
        let stencil = weights.red_stencil::<V>(row, span, on_edges.around(row));
        let ties = CentreTies::<V>::new(weights, row, span, ties);
        for k in 0..n {
            let centre = stencil.sum(k) * ties.inverse(k);
            (V::read(&b[k]) * stencil.diagonal(k).inverse() + centre).put(&mut out[k]);
        }
    }
}
