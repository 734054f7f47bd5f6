//! The blacks eliminated: `S = D_red - W D_black^-1 W^T` acts on the reds alone, and half the pixels are gone exactly.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Grid, Weights, join_row};
use super::real::{Real, on_vectors};
use super::ring::Ring;
use super::spans::Span;
use crate::vector::Packed;

/// `out = S x` along the spans of the grid; returns `<x, S x>`, summed in an order that does not depend on the threads.
pub(super) fn multiply<T: Real>(weights: &Weights, x: &[T], out: &mut [f64]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let bands = out.par_chunks_mut(chunk).enumerate();
    let rows = || [Ring::new(weights.grid.half()), Ring::new(weights.grid.half())];
    let products: Vec<f64> =
        bands.map_init(rows, |rows, (band, out)| multiply_band(weights, x, band, rows, out)).collect();
    products.iter().sum()
}

/// `reds += W D_black^-1 blacks`: the right side of the reduced system, along its spans. Returns `<blacks, D_black^-1 blacks>`.
pub(super) fn eliminate_blacks<T: Real>(weights: &Weights, reds: &mut [T], blacks: &[T]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let bands = reds.par_chunks_mut(chunk).enumerate();
    let memory = || Ring::new(weights.grid.half());
    let energies: Vec<f64> =
        bands.map_init(memory, |scaled, (band, reds)| eliminate_band(weights, blacks, band, scaled, reds)).collect();
    energies.iter().sum()
}

/// `blacks = D_black^-1 (blacks + W^T reds)`: from right side to solution, along the spans; reds and blacks to `solution`, row-major.
pub(super) fn fill_and_join(weights: &Weights, reds: &[f32], blacks: &mut [f32], solution: &mut [f32]) {
    let width = weights.grid.width;
    let chunk = BAND_ROWS * weights.grid.half();
    (blacks.par_chunks_mut(chunk), solution.par_chunks_mut(BAND_ROWS * width))
        .into_par_iter()
        .enumerate()
        .for_each_init(
            || Ring::new(weights.grid.half()),
            |here, (band, (blacks, solution))| {
                fill_band(weights, reds, band, here, blacks);
                join_band(weights, reds, blacks, band, solution);
            },
        );
}

/// Joins reds and blacks of a band while they are near.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn join_band(weights: &Weights, reds: &[f32], blacks: &[f32], band: usize, solution: &mut [f32]) {
    let (half, width, span) = (weights.grid.half(), weights.grid.width, weights.spans.band(band));
    let (first, cols) = (band * BAND_ROWS, 2 * span.start..(2 * span.end).min(width));
    for (at, solution) in solution.chunks_exact_mut(width).enumerate() {
        let reds = &reds[(first + at) * half..][span.range()];
        join_row(first + at, reds, &blacks[at * half..][span.range()], &mut solution[cols.clone()]);
    }
}

/// `D_black^-1 W^T reds` of a row, along a span.
#[inline(always)]
pub(super) fn solve_blacks<V: Packed<Number: Real>>(
    weights: &Weights,
    row: isize,
    span: Span,
    reds: &Ring<V::Number>,
    blacks: &mut Ring<V::Number>,
) {
    if !weights.grid.contains(row) {
        return;
    }
    let stencil = weights.black_stencil::<V>(row, span, reds.around(row));
    let out = V::chunks_mut(&mut blacks.row_mut(row)[span.start..], stencil.len());
    for k in 0..stencil.len() {
        stencil.sum(k).over(stencil.diagonal(k)).put(&mut out[k]);
    }
}

/// Copies the part of a row of `values` that a span covers, converted.
#[inline(always)]
pub(super) fn load<T: Real, U: Real>(
    grid: Grid,
    values: &[T],
    row: isize,
    span: Span,
    out: &mut [U],
    convert: impl Fn(T) -> U,
) {
    if grid.contains(row) {
        let values = &values[row as usize * grid.half()..][span.range()];
        for (out, value) in out[span.range()].iter_mut().zip(values) {
            *out = convert(*value);
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn multiply_band<T: Real>(weights: &Weights, x: &[T], band: usize, rows: &mut [Ring<f64>; 2], out: &mut [f64]) -> f64 {
    on_vectors!(weights.grid, [f64], multiply_band_with::<T>(weights, x, band, rows, out))
}

#[inline(always)]
fn multiply_band_with<T: Real, V: Packed<Number = f64>>(
    weights: &Weights,
    x: &[T],
    band: usize,
    [reds, blacks]: &mut [Ring<f64>; 2],
    out: &mut [f64],
) -> f64 {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (out.len() / n) as isize;
    let span = weights.spans.band(band);
    let mut product = 0.0;
    for row in first - 2..=end + 1 {
        load(weights.grid, x, row, span, reds.row_mut(row), T::to_f64);
        let row = row - 1;
        if row < first - 1 {
            continue;
        }
        solve_blacks::<V>(weights, row, span, reds, blacks);
        let row = row - 1;
        if row < first {
            continue;
        }
        let out = &mut out[(row - first) as usize * n..][span.range()];
        product += multiply_row::<V>(weights, row, span, [reds, blacks], out);
    }
    product
}

/// `S x` of a row along a span, from `x` and what [`solve_blacks`] made of it; returns `<x, S x>`.
#[inline(always)]
pub(super) fn multiply_row<V: Packed<Number = f64>>(
    weights: &Weights,
    row: isize,
    span: Span,
    [reds, blacks]: [&Ring<f64>; 2],
    out: &mut [f64],
) -> f64 {
    let stencil = weights.red_stencil::<V>(row, span, blacks.around(row));
    let values = V::chunks(&reds.row(row)[1 + span.start..], stencil.len());
    let products = V::chunks_mut(out, stencil.len());
    let mut energy = V::splat(V::Number::default());
    for k in 0..stencil.len() {
        let x = V::read(&values[k]);
        let product = stencil.diagonal(k) * x - stencil.sum(k);
        product.put(&mut products[k]);
        energy = x.times_plus(product, energy);
    }
    energy.sum()
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

/// Sum of squares, by blocks in parallel and then in order: the same bits for any number of threads.
pub(super) fn square_sum(vector: &[f64]) -> f64 {
    /// Numbers that one task adds up.
    const BLOCK: usize = 1 << 14;
    let blocks: Vec<f64> = vector.par_chunks(BLOCK).map(|block| dot(block, block)).collect();
    blocks.iter().sum()
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
fn eliminate_band<T: Real>(weights: &Weights, blacks: &[T], band: usize, scaled: &mut Ring<T>, reds: &mut [T]) -> f64 {
    on_vectors!(weights.grid, [T], eliminate_band_with(weights, blacks, band, scaled, reds))
}

#[inline(always)]
fn eliminate_band_with<V: Packed<Number: Real>>(
    weights: &Weights,
    blacks: &[V::Number],
    band: usize,
    scaled: &mut Ring<V::Number>,
    reds: &mut [V::Number],
) -> f64 {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (reds.len() / n) as isize;
    let span = weights.spans.band(band);
    let mut before = vec![V::Number::default(); n];
    let mut energy = 0.0;
    for row in first - 1..=end {
        let of_row = scale_blacks::<V>(weights, blacks, row, span, scaled);
        if (first..end).contains(&row) {
            energy += of_row;
        }
        let row = row - 1;
        if row >= first {
            let reds = &mut reds[(row - first) as usize * n..][span.range()];
            before[span.range()].copy_from_slice(reds);
            add_blacks::<V>(weights, row, span, &before[span.range()], scaled, reds);
        }
    }
    energy
}

/// `D_black^-1 blacks` of a row along a span; returns its product with the blacks.
#[inline(always)]
pub(super) fn scale_blacks<V: Packed<Number: Real>>(
    weights: &Weights,
    blacks: &[V::Number],
    row: isize,
    span: Span,
    scaled: &mut Ring<V::Number>,
) -> f64 {
    if !weights.grid.contains(row) {
        return 0.0;
    }
    let sides = weights.blacks::<V>(row, span);
    let out = V::chunks_mut(&mut scaled.row_mut(row)[span.start..], sides.len());
    let blacks = V::chunks(&blacks[row as usize * weights.grid.half()..][span.range()], sides.len());
    let mut energy = V::splat(V::Number::default());
    for k in 0..sides.len() {
        let black = V::read(&blacks[k]);
        let solved = black.over(sides.diagonal(k));
        solved.put(&mut out[k]);
        energy = black.times_plus(solved, energy);
    }
    energy.sum()
}

/// `reds + W scaled` of a row along a span.
#[inline(always)]
pub(super) fn add_blacks<V: Packed<Number: Real>>(
    weights: &Weights,
    row: isize,
    span: Span,
    reds: &[V::Number],
    scaled: &Ring<V::Number>,
    out: &mut [V::Number],
) {
    let stencil = weights.red_stencil::<V>(row, span, scaled.around(row));
    let (reds, out) = (V::chunks(reds, stencil.len()), V::chunks_mut(out, stencil.len()));
    for k in 0..stencil.len() {
        (V::read(&reds[k]) + stencil.sum(k)).put(&mut out[k]);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn fill_band(weights: &Weights, reds: &[f32], band: usize, here: &mut Ring<f32>, blacks: &mut [f32]) {
    on_vectors!(weights.grid, [f32], fill_band_with(weights, reds, band, here, blacks));
}

#[inline(always)]
fn fill_band_with<V: Packed<Number = f32>>(
    weights: &Weights,
    reds: &[f32],
    band: usize,
    here: &mut Ring<f32>,
    blacks: &mut [f32],
) {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = first + (blacks.len() / n) as isize;
    let span = weights.spans.band(band);
    let mut before = vec![0.0; n];
    for row in first - 1..=end {
        load(weights.grid, reds, row, span, here.row_mut(row), |value| value);
        let row = row - 1;
        if row < first {
            continue;
        }
        let blacks = &mut blacks[(row - first) as usize * n..][span.range()];
        before[span.range()].copy_from_slice(blacks);
        fill_row::<V>(weights, row, span, here, &before[span.range()], blacks);
    }
}

/// `D_black^-1 (blacks + W^T reds)` of a row along a span.
#[inline(always)]
pub(super) fn fill_row<V: Packed<Number: Real>>(
    weights: &Weights,
    row: isize,
    span: Span,
    reds: &Ring<V::Number>,
    blacks: &[V::Number],
    out: &mut [V::Number],
) {
    let stencil = weights.black_stencil::<V>(row, span, reds.around(row));
    let (blacks, out) = (V::chunks(blacks, stencil.len()), V::chunks_mut(out, stencil.len()));
    for k in 0..stencil.len() {
        (V::read(&blacks[k]) + stencil.sum(k)).over(stencil.diagonal(k)).put(&mut out[k]);
    }
}
