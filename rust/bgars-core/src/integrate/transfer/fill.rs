//! Up on a coarser grid, to the solution of all its pixels.

use multiversion::multiversion;
use rayon::prelude::*;

use super::advance::Below;
use super::prolong::{LEAD, Prolonging, finish_row, go_ahead};
use crate::integrate::checkerboard::{BAND_ROWS, Weights, join_whole_row};
use crate::integrate::real::{Real, on_vectors};
use crate::integrate::reduction::fill_row;
use crate::integrate::ring::Ring;
use crate::vector::Packed;

/// The reds that [`super::prolong`] makes of `below` with the changes of the strays, and the blacks that follow from them and from
/// their own right side: to `solution`, row-major, along the spans of the grid.
pub(in crate::integrate) fn prolong_and_fill(
    weights: &Weights,
    below: Below<'_>,
    blacks: &[f32],
    solution: &mut [f32],
) {
    let rows = weights.spans.bands_of_a_task() * BAND_ROWS;
    solution.par_chunks_mut(rows * weights.grid.width).enumerate().for_each_init(
        || Filling::new(weights.grid.half()),
        |memory, (task, solution)| fill_rows(weights, below, blacks, task * rows, memory, solution),
    );
}

/// Rows on their way through [`prolong_and_fill`].
pub(super) struct Filling {
    up: Prolonging,
    reds: Ring<f32>,
    blacks: Vec<f32>,
}

impl Filling {
    pub fn new(n: usize) -> Self {
        Self { up: Prolonging::new(n), reds: Ring::new(n), blacks: vec![0.0; n] }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn fill_rows(
    weights: &Weights,
    below: Below<'_>,
    blacks: &[f32],
    first_row: usize,
    rows: &mut Filling,
    solution: &mut [f32],
) {
    on_vectors!(weights.grid, [f32], fill_rows_with(weights, below, blacks, first_row, rows, solution));
}

#[inline(always)]
pub(super) fn fill_rows_with<V: Packed<Number = f32>>(
    weights: &Weights,
    Below { b, coarse, changes }: Below<'_>,
    blacks: &[f32],
    first_row: usize,
    rows: &mut Filling,
    solution: &mut [f32],
) {
    let (half, width, first) = (weights.grid.half(), weights.grid.width, first_row as isize);
    let end = first + (solution.len() / width) as isize;
    for row in first - LEAD - 1..=end {
        go_ahead::<V>(weights, b, coarse, row, &mut rows.up);
        if row >= first - 1 && weights.grid.contains(row) {
            let reds = rows.reds.row_mut(row);
            finish_row::<V>(weights, b, row, &mut rows.up, &mut reds[weights.spans.at(row).range()], |_, red| red);
            changes.add_to(row as usize * half, reds);
        }
        let row = row - 1;
        if row >= first {
            let span = weights.spans.at(row);
            let own = &mut rows.blacks[span.range()];
            fill_row::<V>(weights, row, span, &rows.reds, &blacks[row as usize * half..][span.range()], own);
            let solution = &mut solution[(row - first) as usize * width..][2 * span.start..(2 * span.end).min(width)];
            join_whole_row(row as usize, &rows.reds.row(row)[1..][span.range()], own, solution);
        }
    }
}
