//! A 5-point system scaled to a diagonal of ones, `D^-1/2 A D^-1/2 = I - C`, and its residual.

use multiversion::multiversion;

use super::frame::LANES;
use super::normal_equations::NormalEquations;
use super::number::Number;
use super::rows::{BELOW, Block, DIAGONAL, R, RIGHT, Ties, X};

/// `1 / sqrt(d)`, 0 for a pixel without edges.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn inverse_roots(diagonal: &[f64], roots: &mut [f64]) {
    for (root, &d) in roots.iter_mut().zip(diagonal) {
        *root = if d > 0.0 { d.sqrt().recip() } else { 0.0 };
    }
}

/// `-C` to the right and below, and D, of part of a row whose first pixel lies `at`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn scale_ties<T: Number>(
    system: &NormalEquations,
    roots: &[f64],
    at: usize,
    stride: usize,
    ties: &mut [Ties<T>],
) {
    let count = ties.len();
    let [right, below, diagonal] = [&system.right, &system.below, &system.diagonal].map(|of| lanes(of, at, count));
    let [root, root_right, root_below] = [at, at + 1, at + stride].map(|at| lanes(roots, at, count));
    for (k, ties) in ties.iter_mut().enumerate() {
        for lane in 0..LANES {
            ties[RIGHT][lane] = T::of(-right[k][lane] * root[k][lane] * root_right[k][lane]);
        }
        for lane in 0..LANES {
            ties[BELOW][lane] = T::of(-below[k][lane] * root[k][lane] * root_below[k][lane]);
        }
        for lane in 0..LANES {
            ties[DIAGONAL][lane] = T::of(diagonal[k][lane]);
        }
    }
}

/// Puts `D^-1/2 (b - A z)` of part of a row whose first pixel lies `at` in the place of x.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn put_residuals<T: Number>(
    system: &NormalEquations,
    roots: &[f64],
    z: &[f64],
    at: usize,
    stride: usize,
    blocks: &mut [Block<T>],
) {
    let count = blocks.len();
    let around = |of| [at, at - 1, at + 1, at - stride, at + stride].map(|at| lanes(of, at, count));
    let ([z, z_left, z_right, z_up, z_down], [root, ..]) = (around(z), around(roots));
    let ([tie_right, tie_left, ..], [tie_down, _, _, tie_up, _]) = (around(&system.right), around(&system.below));
    let [source, ..] = around(&system.source);
    for (k, block) in blocks.iter_mut().enumerate() {
        for (lane, x) in block[X].iter_mut().enumerate() {
            let here = z[k][lane];
            let along = tie_right[k][lane] * (z_right[k][lane] - here) - tie_left[k][lane] * (here - z_left[k][lane]);
            let across = tie_down[k][lane] * (z_down[k][lane] - here) - tie_up[k][lane] * (here - z_up[k][lane]);
            *x = T::of((source[k][lane] + (along + across)) * root[k][lane]);
        }
    }
}

/// Sum of the squares of what parts r from the residual in the place of x, both unscaled by D, of part of a row.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn square_gaps<T: Number>(diagonal: &[f64], blocks: &[Block<T>]) -> f64 {
    let mut sums = [0.0; LANES];
    for (diagonal, block) in diagonal.as_chunks::<LANES>().0.iter().zip(blocks) {
        for (lane, sum) in sums.iter_mut().enumerate() {
            let gap = block[X][lane].to_f64() - block[R][lane].to_f64();
            *sum += diagonal[lane] * gap * gap;
        }
    }
    sums.iter().sum()
}

/// `count` times [`LANES`] numbers from a place on.
#[inline(always)]
fn lanes(numbers: &[f64], at: usize, count: usize) -> &[[f64; LANES]] {
    numbers[at..at + count * LANES].as_chunks().0
}
