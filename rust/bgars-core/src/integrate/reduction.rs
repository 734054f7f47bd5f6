//! The blacks eliminated: `S = D_red - W D_black^-1 W^T` acts on the reds alone, and half the pixels are gone exactly.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Real, Ring, Weights};

/// `out = S x`; returns `<x, S x>`, summed in an order that does not depend on the threads.
pub(super) fn multiply(weights: &Weights, x: &[f64], out: &mut [f64]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let bands = out.par_chunks_mut(chunk).enumerate();
    let products: Vec<f64> = bands.map(|(band, out)| multiply_band(weights, x, band, out)).collect();
    products.iter().sum()
}

/// `reds += W D_black^-1 blacks`: the right side of the reduced system.
pub(super) fn eliminate_blacks<T: Real>(weights: &Weights, reds: &mut [T], blacks: &[T]) {
    let chunk = BAND_ROWS * weights.grid.half();
    reds.par_chunks_mut(chunk).enumerate().for_each(|(band, reds)| eliminate_band(weights, blacks, band, reds));
}

/// `blacks = D_black^-1 (blacks + W^T reds)`: from right side to solution.
pub(super) fn fill_blacks<T: Real>(weights: &Weights, reds: &[T], blacks: &mut [T]) {
    let chunk = BAND_ROWS * weights.grid.half();
    blacks.par_chunks_mut(chunk).enumerate().for_each(|(band, blacks)| fill_band(weights, reds, band, blacks));
}

/// `D_black^-1 W^T reds` of a row; zeros outside the grid.
#[inline(always)]
pub(super) fn solve_blacks<T: Real>(weights: &Weights, row: isize, reds: &Ring<T>, blacks: &mut Ring<T>) {
    let out = blacks.row_mut(row);
    if weights.grid.contains(row) {
        weights.each_black(row, reds.around(row), |k, diagonal, sum| out[k] = sum * diagonal.inverse());
    } else {
        out.fill(T::default());
    }
}

/// Copies a row of `values` into a padded row; zeros outside the grid.
#[inline(always)]
fn load<T: Real>(weights: &Weights, values: &[T], row: isize, out: &mut [T]) {
    let n = weights.grid.half();
    if weights.grid.contains(row) {
        out.copy_from_slice(&values[row as usize * n..][..n]);
    } else {
        out.fill(T::default());
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn multiply_band(weights: &Weights, x: &[f64], band: usize, out: &mut [f64]) -> f64 {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (out.len() / n) as isize;
    let [mut reds, mut blacks] = std::array::from_fn(|_| Ring::<f64>::new(n));
    let mut product = 0.0;
    for row in first - 2..=end + 1 {
        load(weights, x, row, reds.row_mut(row));
        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        solve_blacks(weights, row, &reds, &mut blacks);
        let row = row - 1;
        if row < first {
            continue;
        }
        let here = &reds.row(row)[1..=n];
        let out = &mut out[(row - first) as usize * n..][..n];
        weights.each_red(row, blacks.around(row), |k, diagonal, sum| out[k] = diagonal * here[k] - sum);
        product += dot(here, out);
    }
    product
}

/// Sum in eight lanes, so that it vectorises and has one order.
pub(super) fn sum(values: &[f64]) -> f64 {
    let (blocks, rest) = values.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for block in blocks {
        for (lane, value) in lanes.iter_mut().zip(block) {
            *lane += value;
        }
    }
    lanes.iter().chain(rest).sum()
}

/// Sum of products in eight lanes, so that it vectorises and has one order.
#[inline(always)]
pub(super) fn dot<A: Real, B: Real>(a: &[A], b: &[B]) -> f64 {
    const LANES: usize = 8;
    let mut lanes = [0.0; LANES];
    let (a_blocks, b_blocks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(a, b)| a.to_f64() * b.to_f64()).sum();
    for (a, b) in a_blocks.zip(b_blocks) {
        for lane in 0..LANES {
            lanes[lane] += a[lane].to_f64() * b[lane].to_f64();
        }
    }
    lanes.iter().sum::<f64>() + rest
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn eliminate_band<T: Real>(weights: &Weights, blacks: &[T], band: usize, reds: &mut [T]) {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (reds.len() / n) as isize;
    let mut scaled = Ring::<T>::new(n);
    for row in first - 1..=end {
        if weights.grid.contains(row) {
            let blacks = &blacks[row as usize * n..][..n];
            weights.scale_blacks(row, |k| blacks[k], scaled.row_mut(row));
        } else {
            scaled.row_mut(row).fill(T::default());
        }
        let row = row - 1;
        if row < first {
            continue;
        }
        let reds = &mut reds[(row - first) as usize * n..][..n];
        weights.each_red(row, scaled.around(row), |k, _, sum| reds[k] = reds[k] + sum);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn fill_band<T: Real>(weights: &Weights, reds: &[T], band: usize, blacks: &mut [T]) {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (blacks.len() / n) as isize;
    let mut here = Ring::<T>::new(n);
    for row in first - 1..=end {
        load(weights, reds, row, here.row_mut(row));
        let row = row - 1;
        if row < first {
            continue;
        }
        let blacks = &mut blacks[(row - first) as usize * n..][..n];
        weights.each_black(row, here.around(row), |k, diagonal, sum| {
            blacks[k] = (blacks[k] + sum) * diagonal.inverse();
        });
    }
}
