//! The next coarser grid: its pixels are the corners, its edges what the finer edges conduct between them.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::Weights;
use crate::memory::Aligned;

/// Halves both sides of a grid.
///
/// Weights are conductances. Between two corners lies one edge pixel: two edges in series, `a b / (a + b)`. The paths beside,
/// through the centres, count for the corners on either side of them as far as the blacks at both their ends hang on these.
pub(super) fn coarsen(weights: &Weights) -> Weights {
    let grid = weights.grid;
    let n = grid.half();
    let coarse = grid.coarser();
    let mut rightward = Aligned::<f32>::any(coarse.height * coarse.width);
    let mut downward = Aligned::<f32>::zeros(coarse.height * coarse.width);
    rightward
        .par_chunks_mut(n)
        .zip(downward.par_chunks_mut(n))
        .enumerate()
        .for_each(|(coarse_row, (rightward, downward))| conduct(weights, coarse_row, rightward, downward));
    let mut out = Weights::unset(coarse);
    out.bands_mut().for_each(|mut band| {
        let above = band.rows.start.checked_sub(1);
        band.set_above(above.map_or(&vec![0.0; n], |above| &downward[above * n..][..n]));
        for row in band.rows.clone() {
            band.set_row(row, &rightward[row * n..][..n], &downward[row * n..][..n]);
        }
    });
    out
}

/// What a row of corners conducts to the right, and to the next row of corners.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn conduct(weights: &Weights, coarse_row: usize, rightward: &mut [f32], downward: &mut [f32]) {
    let (grid, n) = (weights.grid, rightward.len());
    let downward = &mut downward[..n];
    let row = 2 * coarse_row as isize;
    // Along the row of the corners: red k, black k, red k + 1.
    let (right, left) = (&weights.right(row)[1..=n], &weights.left(row)[2..n + 2]);
    for k in 0..n {
        rightward[k] = series(right[k], left[k]);
    }
    // Beside it: black k, centre k, black k + 1 of the rows above and below.
    for beside in [row - 1, row + 1] {
        if !grid.contains(beside) {
            continue;
        }
        let (left, right) = (&weights.left(beside)[1..=n], &weights.right(beside)[1..=n]);
        let (down, up) = (&weights.down(beside - 1)[1..n + 2], &weights.up(beside + 1)[1..n + 2]);
        let (own, other) = if beside < row { (up, down) } else { (down, up) };
        for k in 0..n {
            rightward[k] += series(left[k], right[k]) * common(share(own, other, k), share(own, other, k + 1));
        }
    }
    // Down the column of the corners: red k, black k of the row between, red k.
    if !grid.contains(row + 2) {
        return;
    }
    let (down, up) = (&weights.down(row)[1..=n], &weights.up(row + 2)[1..=n]);
    for k in 0..n {
        downward[k] = series(down[k], up[k]);
    }
    // Beside it: black k, centre k, black k of the row of the lower corners. It lies between the corners k and k + 1.
    let (up, down) = (&weights.up(row + 1)[1..=n], &weights.down(row + 1)[1..=n]);
    let (top_own, top_next) = (&weights.right(row)[1..=n], &weights.left(row)[2..n + 2]);
    let (low_own, low_next) = (&weights.right(row + 2)[1..=n], &weights.left(row + 2)[2..n + 2]);
    for (k, next) in downward[1..].iter_mut().enumerate() {
        *next += series(up[k], down[k]) * common(share(top_next, top_own, k), share(low_next, low_own, k));
    }
    for k in 0..n {
        downward[k] += series(up[k], down[k]) * common(share(top_own, top_next, k), share(low_own, low_next, k));
    }
}

/// Two conductances one after the other.
#[inline(always)]
pub(super) fn series(a: f32, b: f32) -> f32 {
    let (a, b) = (a.abs(), b.abs());
    let sum = a + b;
    if sum > 0.0 { a * b / sum } else { 0.0 }
}

/// How much of a black between two corners hangs on the first.
#[inline(always)]
fn share(own: &[f32], other: &[f32], k: usize) -> f32 {
    let (own, other) = (own[k].abs(), other[k].abs());
    let sum = own + other;
    if sum > 0.0 { own / sum } else { 0.0 }
}

/// What a path counts for two corners, by the shares that they have in its ends.
///
/// With `a` and `b` the path ties the corners by `a b`, and each of them to the corner diagonally across by `a (1 - b)` and
/// `b (1 - a)`. A grid has no diagonals: half of these goes to either side, which leaves planes as they are. Corners that
/// have no share in one of the ends stay apart.
#[inline(always)]
fn common(a: f32, b: f32) -> f32 {
    if a > 0.0 && b > 0.0 { 0.5 * (a + b) } else { 0.0 }
}
