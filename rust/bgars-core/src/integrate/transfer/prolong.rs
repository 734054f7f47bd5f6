//! Up: the coarser grid's correction added, and smoothed.

use multiversion::{multiversion, target::target_cfg_f};
use rayon::prelude::*;

use super::{black_ties, corner_ties, divide_by_centre_ties, round, smoothed_row};
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
    centres: Vec<f32>,
    /// The right side of a row.
    rounded: Vec<f32>,
}

impl Prolonging {
    pub fn new(n: usize) -> Self {
        let [smooth, blacks, ties, on_edges, corners] = std::array::from_fn(|_| Ring::new(n));
        let [centres, rounded] = std::array::from_fn(|_| vec![0.0; n]);
        Self { smooth, blacks, ties, on_edges, corners, centres, rounded }
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
        smoothed_row::<T, V>(weights, b, row, span, &mut rows.rounded, rows.smooth.row_mut(row));
        if grid.contains(row) {
            add_coarse::<V>(weights, row, span, coarse, rows);
        }

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
        round(b, &mut rows.rounded);
        let stencil = weights.red_stencil::<V>(row, span, rows.blacks.around(row));
        let (rounded, out) = (V::chunks(&rows.rounded, stencil.len()), V::chunks_mut(values, stencil.len()));
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
    black_ties::<V>(weights, row, span, rows.ties.row_mut(row));
    let (first, second) = if row % 2 == 0 {
        let beyond = (span.end + 1).min(half);
        rows.corners.row_mut(row)[span.start..beyond]
            .copy_from_slice(&corner_row(coarse, row, half)[span.start..beyond]);
        (&rows.corners.row(row)[1..], &rows.corners.row(row)[2..])
    } else {
        let above = corner_row(coarse, row - 1, half);
        (above, if weights.grid.contains(row + 1) { corner_row(coarse, row + 1, half) } else { above })
    };
    let (to_first, to_second) = corner_ties::<V>(weights, row, span);
    let n = to_first.len();
    let (first, second) = (V::chunks(&first[span.start..], n), V::chunks(&second[span.start..], n));
    let tie = V::chunks(&rows.ties.row(row)[1 + span.start..], n);
    let out = V::chunks_mut(&mut rows.on_edges.row_mut(row)[span.start..], n);
    for k in 0..n {
        let from_second = V::read(&to_second[k]).magnitude() * V::read(&second[k]);
        let sum = V::read(&to_first[k]).magnitude().times_plus(V::read(&first[k]), from_second);
        (sum * V::read(&tie[k]).inverse()).put(&mut out[k]);
    }
}

/// Adds the coarse grid to the reds of a row: itself at corners, from the blacks around them at centres.
#[inline(always)]
fn add_coarse<V: Packed<Number = f32>>(
    weights: &Weights,
    row: isize,
    span: Span,
    coarse: &[f32],
    rows: &mut Prolonging,
) {
    let change = if row % 2 == 0 {
        corner_row(coarse, row, weights.grid.half())
    } else {
        let stencil = weights.red_stencil::<V>(row, span, rows.on_edges.around(row));
        let out = V::chunks_mut(&mut rows.centres[span.start..], stencil.len());
        for k in 0..stencil.len() {
            stencil.sum(k).put(&mut out[k]);
        }
        divide_by_centre_ties::<V>(weights, row, span, &rows.ties, &mut rows.centres);
        &rows.centres
    };
    let n = span.vectors::<V>();
    let change = V::chunks(&change[span.start..], n);
    let out = V::chunks_mut(&mut rows.smooth.row_mut(row)[span.start..], n);
    for k in 0..n {
        (V::read(&out[k]) + V::read(&change[k])).put(&mut out[k]);
    }
}
