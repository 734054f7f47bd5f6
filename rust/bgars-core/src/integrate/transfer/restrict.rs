//! Down: smoothed from zero, and what is left taken to the coarser grid.

use multiversion::multiversion;
use rayon::prelude::*;

use super::right_side::{Making, RightSide};
use super::{CentreTies, corner_ties};
use crate::integrate::checkerboard::{BAND_ROWS, Weights, split_row};
use crate::integrate::real::{Real, on_vectors};
use crate::integrate::ring::Ring;
use crate::vector::Packed;

/// `coarse = P^T (b - S D^-1 b)`: smooths `b` from zero and restricts what is left to the coarser grid, as reds and blacks,
/// below the spans of this grid.
///
/// Returns `<b, D^-1 b + D^-1 N D^-1 b>`, `N = D - S = W D_black^-1 W^T`: what the smoothing adds to `<b, x>` in a V-cycle; before
/// it, what making `b` adds. Each band is summed by itself: the same bits for any number of threads.
pub(in crate::integrate) fn restrict(
    weights: &Weights,
    b: RightSide<'_>,
    [coarse_reds, coarse_blacks]: [&mut [f32]; 2],
) -> [f64; 2] {
    let (half, coarse_half) = (weights.grid.half(), weights.grid.coarser().half());
    let bands = weights.spans.bands_of_a_task();
    let rows = bands * BAND_ROWS;
    let coarse = rows / 2 * coarse_half;
    let mut energies = vec![[0.0; 2]; weights.spans.len()];
    let sides = b.of_tasks(rows * half, energies.len().div_ceil(bands));
    (sides, coarse_reds.par_chunks_mut(coarse), coarse_blacks.par_chunks_mut(coarse), energies.par_chunks_mut(bands))
        .into_par_iter()
        .enumerate()
        .for_each_init(
            || Restricting::new(half),
            |memory, (task, (mut b, reds, blacks, energies))| {
                restrict_rows(weights, &mut b, task * rows, memory, [reds, blacks], energies);
            },
        );
    energies.iter().fold([0.0; 2], |sums, energies| [sums[0] + energies[0], sums[1] + energies[1]])
}

/// Rows on their way through the restriction of a band.
pub(super) struct Restricting {
    making: Making,
    smooth: Ring<f32>,
    blacks: Ring<f32>,
    corners: Ring<f32>,
    centres: Ring<f32>,
    vertical: Ring<f32>,
    horizontal: Ring<f32>,
    ties: Ring<f32>,
    coarse: Vec<f32>,
}

impl Restricting {
    pub fn new(n: usize) -> Self {
        let [smooth, blacks, corners, centres, vertical, horizontal, ties] = std::array::from_fn(|_| Ring::new(n));
        let making = Making::new(n);
        Self { making, smooth, blacks, corners, centres, vertical, horizontal, ties, coarse: vec![0.0; n] }
    }
}

/// [`restrict`] to the corners of the rows from `first_row` on; two energies for each band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn restrict_rows(
    weights: &Weights,
    b: &mut RightSide<'_>,
    first_row: usize,
    rows: &mut Restricting,
    coarse: [&mut [f32]; 2],
    energies: &mut [[f64; 2]],
) {
    on_vectors!(weights.grid, [f32], restrict_rows_with(weights, b, first_row, rows, coarse, energies));
}

#[inline(always)]
pub(super) fn restrict_rows_with<V: Packed<Number = f32>>(
    weights: &Weights,
    b: &mut RightSide<'_>,
    first_row: usize,
    rows: &mut Restricting,
    [coarse_reds, coarse_blacks]: [&mut [f32]; 2],
    energies: &mut [[f64; 2]],
) {
    let grid = weights.grid;
    let coarse_half = grid.coarser().half();
    let first = first_row as isize;
    let coarse_rows = coarse_reds.len() / coarse_half;
    let end = first + 2 * coarse_rows as isize;
    let mut count = |row: isize, of: usize, energy: f64| {
        if (first..end).contains(&row) && grid.contains(row) {
            energies[(row - first) as usize / BAND_ROWS][of] += energy;
        }
    };
    for row in first - 4..=end + 2 {
        count(row, 0, b.prepare::<V>(weights, row, &mut rows.making));

        let row = row - 1;
        if row < first - 3 {
            continue;
        }
        count(row, 1, smooth::<V>(weights, b, row, first, rows));

        let row = row - 1;
        if row < first - 2 {
            continue;
        }
        count(row, 1, solve_and_tie_blacks::<V>(weights, row, rows));

        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        leave_residual::<V>(weights, row, rows);
        if row.rem_euclid(2) == 0 {
            continue;
        }
        centres_to_blacks::<V>(weights, row, rows);
        if row <= first {
            continue;
        }
        let row = row - 1;
        blacks_to_corners::<V>(weights, row, rows);
        let coarse_start = (row - first) as usize / 2 * coarse_half;
        // A corner is one pixel of the coarser grid, where each colour has every other.
        let span = weights.spans.at(row);
        let [start, end] = [span.start / 2, span.end.div_ceil(2)];
        let halves = coarse_start + start..coarse_start + end;
        let corners = &rows.coarse[2 * start..span.end];
        split_row((row / 2) as usize, corners, &mut coarse_reds[halves.clone()], &mut coarse_blacks[halves]);
    }
}

/// `D^-1 b` of a row; returns `<b, D^-1 b>`.
#[inline(always)]
fn smooth<V: Packed<Number = f32>>(
    weights: &Weights,
    b: &mut RightSide<'_>,
    row: isize,
    first: isize,
    rows: &mut Restricting,
) -> f64 {
    if !weights.grid.contains(row) {
        return 0.0;
    }
    let span = weights.spans.at(row);
    let b = b.row::<V>(weights, row, first, &mut rows.making);
    let sides = weights.reds::<V>(row, span);
    let (b, out) = (V::chunks(b, sides.len()), V::chunks_mut(&mut rows.smooth.row_mut(row)[span.start..], sides.len()));
    let mut energy = V::splat(0.0);
    for k in 0..sides.len() {
        let b = V::read(&b[k]);
        let smooth = b.over(sides.diagonal(k));
        smooth.put(&mut out[k]);
        energy = b.times_plus(smooth, energy);
    }
    energy.sum()
}

/// `D_black^-1 W^T` of the smoothed reds of a row, and what ties its blacks to corners; returns the product of the former with
/// `W^T` of the reds.
#[inline(always)]
fn solve_and_tie_blacks<V: Packed<Number = f32>>(weights: &Weights, row: isize, rows: &mut Restricting) -> f64 {
    if !weights.grid.contains(row) {
        return 0.0;
    }
    let span = weights.spans.at(row);
    let Restricting { smooth, blacks, ties, .. } = rows;
    let stencil = weights.black_stencil::<V>(row, span, smooth.around(row));
    let [first, second] = corner_ties::<V>(weights, row, span);
    let blacks = V::chunks_mut(&mut blacks.row_mut(row)[span.start..], stencil.len());
    let ties = V::chunks_mut(&mut ties.row_mut(row)[span.start..], stencil.len());
    let mut energy = V::splat(0.0);
    for k in 0..stencil.len() {
        let sum = stencil.sum(k);
        let solved = sum.over(stencil.diagonal(k));
        energy = sum.times_plus(solved, energy);
        solved.put(&mut blacks[k]);
        (V::widen(&first[k]).magnitude() + V::widen(&second[k]).magnitude()).put(&mut ties[k]);
    }
    energy.sum()
}

/// The residual of a row: `D - N` applied to `D^-1 b` leaves `N D^-1 b`. At centres, over their ties.
#[inline(always)]
fn leave_residual<V: Packed<Number = f32>>(weights: &Weights, row: isize, rows: &mut Restricting) {
    if !weights.grid.contains(row) {
        return;
    }
    let span = weights.spans.at(row);
    let Restricting { blacks, ties, corners, centres, .. } = rows;
    let stencil = weights.red_stencil::<V>(row, span, blacks.around(row));
    if row % 2 == 0 {
        let out = V::chunks_mut(&mut corners.row_mut(row)[span.start..], stencil.len());
        for k in 0..stencil.len() {
            stencil.sum(k).put(&mut out[k]);
        }
    } else {
        let ties = CentreTies::<V>::new(stencil.sides(), row, span, ties);
        let out = V::chunks_mut(&mut centres.row_mut(row)[span.start..], stencil.len());
        for k in 0..stencil.len() {
            stencil.sum(k).over(ties.sum(k)).put(&mut out[k]);
        }
    }
}

/// The centres of an odd row to the blacks beside them.
#[inline(always)]
fn centres_to_blacks<V: Packed<Number = f32>>(weights: &Weights, row: isize, rows: &mut Restricting) {
    if !weights.grid.contains(row) {
        return;
    }
    let span = weights.spans.at(row);
    let (start, n) = (span.start, span.vectors::<V>());
    let here = &rows.centres.row(row)[start..];
    let (before, after) = (V::chunks(here, n), V::chunks(&here[1..], n));
    let (right, left) = (V::chunks(&weights.right(row)[start..], n), V::chunks(&weights.left(row)[1 + start..], n));
    let tie = V::chunks(&rows.ties.row(row)[1 + start..], n);
    let out = V::chunks_mut(&mut rows.vertical.row_mut(row)[start..], n);
    for k in 0..n {
        let sum = V::read(&right[k]).times_plus(V::read(&before[k]), V::read(&left[k]) * V::read(&after[k]));
        sum.over(V::read(&tie[k])).put(&mut out[k]);
    }
}

/// The blacks around the corners of an even row to these; the blacks of the row itself take from the centres first.
#[inline(always)]
fn blacks_to_corners<V: Packed<Number = f32>>(weights: &Weights, row: isize, rows: &mut Restricting) {
    let span = weights.spans.at(row);
    let (first, n) = (1 + span.start, span.vectors::<V>());
    let (down, up) = (V::chunks(&weights.down(row - 1)[first..], n), V::chunks(&weights.up(row + 1)[first..], n));
    let [above, _, below] = rows.centres.around(row);
    let (above, below) = (V::chunks(&above[first..], n), V::chunks(&below[first..], n));
    let tie = V::chunks(&rows.ties.row(row)[first..], n);
    let out = V::chunks_mut(&mut rows.horizontal.row_mut(row)[span.start..], n);
    for k in 0..n {
        let sum = V::read(&down[k]).times_plus(V::read(&above[k]), V::read(&up[k]) * V::read(&below[k]));
        sum.over(V::read(&tie[k])).put(&mut out[k]);
    }
    let [above, _, below] = rows.vertical.around(row);
    let stencil = weights.red_stencil::<V>(row, span, [above, rows.horizontal.row(row), below]);
    let corner = V::chunks(&rows.corners.row(row)[first..], n);
    let coarse = V::chunks_mut(&mut rows.coarse[span.start..], n);
    for k in 0..n {
        stencil.plus_magnitudes(V::read(&corner[k]), k).put(&mut coarse[k]);
    }
}
