//! Between a grid and the next coarser one, with smoothing on the way: the two halves of a V-cycle.
//!
//! Everything acts on the *reduced* system: the blacks are eliminated exactly, so only the reds are unknown,
//! `S = D_red - W D_black^-1 W^T`. Reds of even rows are the corners (the pixels of the coarser grid), reds of odd rows the
//! centres; blacks lie on the edges between corners. A value of the coarser grid reaches the blacks of even rows from left
//! and right, those of odd rows from above and below, in proportion to the weights of these edges, and from the blacks the
//! centres. Nothing passes an edge of weight zero, so the two sides of a cut stay apart however thin it is.
//!
//! Smoothing is one damping-free Jacobi step on the reduced system (a red-black Gauss-Seidel sweep on the whole) on the way
//! down and its adjoint on the way up. Both halves are plain functions of their input: no thread sees another one's writes.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Real, Ring, Weights, split_row};
use super::reduction::{dot, solve_blacks};

/// `coarse = P^T (b - S D^-1 b)`: smooths `b` from zero and restricts what is left to the coarser grid, as reds and blacks.
pub(super) fn restrict<T: Real>(weights: &Weights, b: &[T], coarse_reds: &mut [f32], coarse_blacks: &mut [f32]) {
    let coarse_half = weights.grid.coarser().half();
    let chunk = BAND_ROWS / 2 * coarse_half;
    coarse_reds
        .par_chunks_mut(chunk)
        .zip(coarse_blacks.par_chunks_mut(chunk))
        .enumerate()
        .for_each(|(band, (reds, blacks))| restrict_band(weights, b, band, reds, blacks));
}

/// `x = D^-1 (b + N (D^-1 b + P coarse))`, `N = W D_black^-1 W^T`: the correction of the coarser grid (row-major), smoothed.
///
/// Returns `<b, x>`, summed in an order that does not depend on the threads.
pub(super) fn prolong<T: Real>(weights: &Weights, b: &[T], coarse: &[f32], x: &mut [f32]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let bands = x.par_chunks_mut(chunk).enumerate();
    let products: Vec<f64> = bands.map(|(band, x)| prolong_band(weights, b, coarse, band, x)).collect();
    products.iter().sum()
}

/// Sums of the weights that tie a row's blacks to corners: left and right in even rows, up and down in odd ones; zeros
/// outside the grid.
#[inline(always)]
fn black_ties(weights: &Weights, row: isize, out: &mut [f32]) {
    if !weights.grid.contains(row) {
        out.fill(0.0);
        return;
    }
    let n = weights.grid.half();
    let out = &mut out[..n];
    let (first, second) = if row.rem_euclid(2) == 0 {
        (&weights.right(row)[1..=n], &weights.left(row)[2..n + 2])
    } else {
        (&weights.down(row - 1)[1..=n], &weights.up(row + 1)[1..=n])
    };
    for k in 0..n {
        out[k] = first[k].abs() + second[k].abs();
    }
}

/// Divides by the weights that tie the centres of odd `row` to blacks that have a corner themselves.
#[inline(always)]
fn divide_by_centre_ties(weights: &Weights, row: isize, ties: &Ring<f32>, values: &mut [f32]) {
    let n = weights.grid.half();
    let [above, here, below] = ties.around(row);
    let (above, below, here_left, here_right) = (&above[1..=n], &below[1..=n], &here[1..=n], &here[2..n + 2]);
    let (left, right) = (&weights.left(row)[1..=n], &weights.right(row)[1..=n]);
    let (up, down) = (&weights.up(row)[1..=n], &weights.down(row)[1..=n]);
    let values = &mut values[..n];
    let tied = |weight: f32, tie: f32| if tie > 0.0 { weight } else { 0.0 };
    for k in 0..n {
        let sum = (tied(left[k], here_left[k]) + tied(right[k], here_right[k]))
            + (tied(up[k], above[k]) + tied(down[k], below[k]));
        values[k] *= sum.inverse();
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn restrict_band<T: Real>(weights: &Weights, b: &[T], band: usize, coarse_reds: &mut [f32], coarse_blacks: &mut [f32]) {
    let grid = weights.grid;
    let n = grid.half();
    let coarse_half = grid.coarser().half();
    let first = (band * BAND_ROWS) as isize;
    let coarse_rows = coarse_reds.len() / coarse_half;
    let end = first + 2 * coarse_rows as isize;
    let [mut horizontal, mut coarse] = std::array::from_fn(|_| vec![0.0f32; n]);
    let [mut smooth, mut blacks, mut residual, mut centres] = std::array::from_fn(|_| Ring::<f32>::new(n));
    let [mut vertical, mut ties] = std::array::from_fn(|_| Ring::<f32>::new(n));
    for row in first - 3..=end + 1 {
        smoothed_row(weights, b, row, smooth.row_mut(row));

        let row = row - 1;
        if row < first - 2 {
            continue;
        }
        solve_blacks(weights, row, &smooth, &mut blacks);
        black_ties(weights, row, ties.row_mut(row));

        // The residual: D - N applied to D^-1 b leaves N D^-1 b.
        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        let out = residual.row_mut(row);
        if grid.contains(row) {
            weights.each_red(row, blacks.around(row), |k, _, sum| out[k] = sum);
        } else {
            out.fill(0.0);
        }
        if row.rem_euclid(2) == 0 {
            continue;
        }
        // Odd row: centres to their blacks.
        let values = centres.row_mut(row);
        if grid.contains(row) {
            values.copy_from_slice(&residual.row(row)[1..=n]);
            divide_by_centre_ties(weights, row, &ties, values);
        } else {
            values.fill(0.0);
        }
        let out = vertical.row_mut(row);
        if grid.contains(row) {
            let here = centres.row(row);
            let (right, left) = (&weights.right(row)[..n], &weights.left(row)[1..=n]);
            let (before, after, tie) = (&here[..n], &here[1..=n], &ties.row(row)[1..=n]);
            let out = &mut out[..n];
            for k in 0..n {
                out[k] = (right[k] * before[k] + left[k] * after[k]) * tie[k].inverse();
            }
        } else {
            out.fill(0.0);
        }
        if row <= first {
            continue;
        }
        // Even row above it: blacks to their corners.
        let row = row - 1;
        {
            let (down, up) = (&weights.down(row - 1)[1..=n], &weights.up(row + 1)[1..=n]);
            let (above, below) = (&centres.row(row - 1)[1..=n], &centres.row(row + 1)[1..=n]);
            let tie = &ties.row(row)[1..=n];
            let horizontal = &mut horizontal[..n];
            for k in 0..n {
                horizontal[k] = (down[k] * above[k] + up[k] * below[k]) * tie[k].inverse();
            }
        }
        {
            let (left, right) = (&weights.left(row)[1..=n], &weights.right(row)[1..=n]);
            let (up, down) = (&weights.up(row)[1..=n], &weights.down(row)[1..=n]);
            let corner = &residual.row(row)[1..=n];
            let (above, below) = (&vertical.row(row - 1)[1..=n], &vertical.row(row + 1)[1..=n]);
            let horizontal = &horizontal[..n];
            let coarse = &mut coarse[..n];
            for k in 0..n {
                coarse[k] =
                    corner[k] + right[k].abs() * horizontal[k] + (up[k].abs() * above[k] + down[k].abs() * below[k]);
            }
            for k in 1..n {
                coarse[k] += left[k].abs() * horizontal[k - 1];
            }
        }
        let coarse_row = (row - first) as usize / 2;
        let span = coarse_row * coarse_half..(coarse_row + 1) * coarse_half;
        split_row((row / 2) as usize, &coarse, &mut coarse_reds[span.clone()], &mut coarse_blacks[span]);
    }
}

/// `D^-1 b` of a row; zeros outside the grid.
#[inline(always)]
fn smoothed_row<T: Real>(weights: &Weights, b: &[T], row: isize, out: &mut [f32]) {
    if weights.grid.contains(row) {
        let b = &b[row as usize * weights.grid.half()..][..weights.grid.half()];
        weights.scale_reds(row, |k| b[k].to_f32(), out);
    } else {
        out.fill(0.0);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn prolong_band<T: Real>(weights: &Weights, b: &[T], coarse: &[f32], band: usize, x: &mut [f32]) -> f64 {
    let grid = weights.grid;
    let n = grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (x.len() / n) as isize;
    let mut product = 0.0;
    let mut centres = vec![0.0; n];
    let mut corners_left = vec![0.0; n + 1];
    let [mut smooth, mut blacks, mut ties, mut on_edges] = std::array::from_fn(|_| Ring::<f32>::new(n));
    let corner_row = |row: isize| &coarse[(row / 2) as usize * n..][..n];
    // Blacks between corners, one row ahead: the centres of an odd row need those of the row below.
    let mut interpolate_blacks = |row: isize, ties: &mut Ring<f32>, on_edges: &mut Ring<f32>| {
        black_ties(weights, row, ties.row_mut(row));
        if !grid.contains(row) {
            on_edges.row_mut(row).fill(0.0);
            return;
        }
        let tie = &ties.row(row)[1..=n];
        let out = &mut on_edges.row_mut(row)[..n];
        if row % 2 == 0 {
            corners_left[..n].copy_from_slice(corner_row(row));
            let (here, next) = (&corners_left[..n], &corners_left[1..=n]);
            let (right, left) = (&weights.right(row)[1..=n], &weights.left(row)[2..n + 2]);
            for k in 0..n {
                out[k] = (right[k].abs() * here[k] + left[k].abs() * next[k]) * tie[k].inverse();
            }
        } else {
            let above = corner_row(row - 1);
            let below = if grid.contains(row + 1) { corner_row(row + 1) } else { above };
            let (down, up) = (&weights.down(row - 1)[1..=n], &weights.up(row + 1)[1..=n]);
            for k in 0..n {
                out[k] = (down[k].abs() * above[k] + up[k].abs() * below[k]) * tie[k].inverse();
            }
        }
    };
    for ahead in first - 3..=end + 2 {
        interpolate_blacks(ahead, &mut ties, &mut on_edges);

        let row = ahead - 1;
        if row < first - 2 {
            continue;
        }
        smoothed_row(weights, b, row, smooth.row_mut(row));
        if grid.contains(row) {
            let out = smooth.row_mut(row);
            if row % 2 == 0 {
                for (out, &corner) in out.iter_mut().zip(corner_row(row)) {
                    *out += corner;
                }
            } else {
                weights.each_red(row, on_edges.around(row), |k, _, sum| centres[k] = sum);
                divide_by_centre_ties(weights, row, &ties, &mut centres);
                for (out, &centre) in out.iter_mut().zip(&centres) {
                    *out += centre;
                }
            }
        }

        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        solve_blacks(weights, row, &smooth, &mut blacks);

        let row = row - 1;
        if row < first {
            continue;
        }
        let values = &mut x[(row - first) as usize * n..][..n];
        let b = &b[row as usize * n..][..n];
        weights.each_red(row, blacks.around(row), |k, diagonal, sum| {
            values[k] = (b[k].to_f32() + sum) * diagonal.inverse();
        });
        product += dot(b, values);
    }
    product
}
