//! The blacks eliminated: `S = D_red - W D_black^-1 W^T` acts on the reds alone, and half the pixels are gone exactly.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Real, Ring, Weights, divide};

/// `out = S x`.
pub(super) fn multiply<T: Real + std::ops::Sub<Output = T>>(weights: &Weights, x: &[T], out: &mut [T]) {
    let chunk = BAND_ROWS * weights.grid.half();
    out.par_chunks_mut(chunk).enumerate().for_each(|(band, out)| multiply_band(weights, x, band, out));
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
fn multiply_band<T: Real + std::ops::Sub<Output = T>>(weights: &Weights, x: &[T], band: usize, out: &mut [T]) {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (out.len() / n) as isize;
    let mut diagonal = vec![T::default(); n];
    let mut gathered = vec![T::default(); n];
    let [mut reds, mut blacks] = std::array::from_fn(|_| Ring::<T>::new(n));
    for row in first - 2..=end + 1 {
        load(weights, x, row, reds.row_mut(row));
        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        if weights.grid.contains(row) {
            weights.gather_black(row, reds.around(row), blacks.row_mut(row));
            weights.black_diagonal(row, &mut diagonal);
            divide(blacks.row_mut(row), &diagonal);
        } else {
            blacks.row_mut(row).fill(T::default());
        }
        let row = row - 1;
        if row < first {
            continue;
        }
        weights.gather_red(row, blacks.around(row), &mut gathered);
        weights.red_diagonal(row, &mut diagonal);
        let out = &mut out[(row - first) as usize * n..][..n];
        let (gathered, diagonal, here) = (&gathered[..n], &diagonal[..n], &reds.row(row)[1..=n]);
        for k in 0..n {
            out[k] = diagonal[k] * here[k] - gathered[k];
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn eliminate_band<T: Real>(weights: &Weights, blacks: &[T], band: usize, reds: &mut [T]) {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (reds.len() / n) as isize;
    let mut scratch = vec![T::default(); n];
    let mut scaled = Ring::<T>::new(n);
    for row in first - 1..=end {
        load(weights, blacks, row, scaled.row_mut(row));
        if weights.grid.contains(row) {
            weights.black_diagonal(row, &mut scratch);
            divide(scaled.row_mut(row), &scratch);
        }
        let row = row - 1;
        if row < first {
            continue;
        }
        weights.gather_red(row, scaled.around(row), &mut scratch);
        for (red, &gathered) in reds[(row - first) as usize * n..][..n].iter_mut().zip(&scratch) {
            *red = *red + gathered;
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn fill_band<T: Real>(weights: &Weights, reds: &[T], band: usize, blacks: &mut [T]) {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (blacks.len() / n) as isize;
    let [mut gathered, mut diagonal] = std::array::from_fn(|_| vec![T::default(); n]);
    let mut here = Ring::<T>::new(n);
    for row in first - 1..=end {
        load(weights, reds, row, here.row_mut(row));
        let row = row - 1;
        if row < first {
            continue;
        }
        weights.gather_black(row, here.around(row), &mut gathered);
        weights.black_diagonal(row, &mut diagonal);
        let blacks = &mut blacks[(row - first) as usize * n..][..n];
        for ((black, &gathered), &diagonal) in blacks.iter_mut().zip(&gathered).zip(&diagonal) {
            *black = (*black + gathered) * diagonal.inverse();
        }
    }
}
