//! Conjugate gradient on the reduced system (Hestenes and Stiefel 1952), preconditioned by multigrid.
//!
//! Written out here for its memory traffic: the sums ride along with the passes that make their vectors, and every pass runs on
//! all threads. faer's solver, with which the tests compare it, does its vector work on one thread and in passes of its own.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Weights};
use super::multigrid::Multigrid;
use super::reduction::{dot, multiply, residual_norm};
use super::{OnProgress, Params, Progress};
use crate::memory::{self, Aligned};
use crate::{Error, Result};

/// Elements of a vector that one task copies or adds up.
const BLOCK: usize = 1 << 14;

/// What [`conjugate_gradients`] found.
pub(super) struct Solution {
    pub x: Aligned<f64>,
    pub iterations: usize,
    /// Norm of the true residual, relative to `scale`.
    pub residual: f64,
    /// False where the iterations did not suffice, or rounding left nothing of one; x is then what they came to.
    pub solved: bool,
}

/// Solves `S x = b` from zero, until the norm of `b - S x` is at most the tolerance times `scale`; `b` is zero beside the spans.
///
/// The residual that the iteration carries along drifts from the true one by rounding: when it says done, the true one is
/// computed, and if it does not agree the iteration starts again from there.
pub(super) fn conjugate_gradients(
    weights: &Weights,
    b: &[f64],
    scale: f64,
    params: &Params,
    on_progress: OnProgress<'_>,
) -> Result<Solution> {
    let size = b.len();
    let mut solution = Solution { x: Aligned::zeros(size), iterations: 0, residual: 0.0, solved: true };
    if scale == 0.0 {
        return Ok(solution);
    }
    let target = (params.relative_tolerance * scale).max(params.absolute_tolerance * (2.0 * size as f64).sqrt());
    let preconditioner = Multigrid::new(weights);
    let chunk = BAND_ROWS * weights.grid.half();
    let Solution { x, iterations, residual, solved } = &mut solution;
    // A direction may be any; what x and r take along it agrees in `f64`.
    let [mut p, mut z] = [Aligned::<f32>::any(size), Aligned::any(size)];
    let [mut q, mut r] = [Aligned::<f64>::any(size), Aligned::any(size)];
    r.par_chunks_mut(BLOCK).zip(b.par_chunks(BLOCK)).for_each(|(r, b)| r.copy_from_slice(b));
    let mut norm = square_sum(b).sqrt();
    loop {
        *residual = norm / scale;
        if norm <= target {
            return Ok(solution);
        }
        let mut r_z_before = None;
        // Written so that NaN goes on, to be found below.
        while !(norm <= target) {
            if *iterations == params.max_iters {
                (*residual, *solved) = (norm / scale, false);
                return Ok(solution);
            }
            let r_z = preconditioner.cycle(&r, &mut z);
            if let Some(before) = r_z_before.replace(r_z) {
                let beta = (r_z / before) as f32;
                p.par_chunks_mut(chunk).zip(z.par_chunks(chunk)).enumerate().for_each(|(band, (p, z))| {
                    for part in weights.spans.parts(band) {
                        turn_part(beta, &mut p[part.clone()], &z[part]);
                    }
                });
            } else {
                std::mem::swap(&mut p, &mut z);
            }
            let p_q = multiply(weights, &p, &mut q);
            // Both are positive but for rounding; what is lost in it cannot be found again.
            if !(r_z > 0.0 && p_q > 0.0) {
                memory::forget();
                (*residual, *solved) = (norm / scale, false);
                return Ok(solution);
            }
            norm = step(weights, r_z / p_q, [x, &mut r], &p, &q).sqrt();
            *iterations += 1;
            if on_progress(Progress { iteration: *iterations, residual: norm / scale }).is_break() {
                return Err(Error::Cancelled);
            }
        }
        norm = residual_norm(weights, x, b);
        if norm > target {
            multiply(weights, x, &mut q);
            (r.par_chunks_mut(chunk), b.par_chunks(chunk), q.par_chunks(chunk)).into_par_iter().enumerate().for_each(
                |(band, (r, b, q))| {
                    for part in weights.spans.parts(band) {
                        for ((r, b), q) in r[part.clone()].iter_mut().zip(&b[part.clone()]).zip(&q[part]) {
                            *r = b - q;
                        }
                    }
                },
            );
        }
    }
}

/// `p = z + beta p` of a part of a band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn turn_part(beta: f32, p: &mut [f32], z: &[f32]) {
    for (p, &z) in p.iter_mut().zip(z) {
        *p = z + beta * *p;
    }
}

/// `x += alpha p`, `r -= alpha q` along the spans of the grid; returns `<r, r>`.
fn step(weights: &Weights, alpha: f64, [x, r]: [&mut [f64]; 2], p: &[f32], q: &[f64]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let squares: Vec<f64> =
        (x.par_chunks_mut(chunk), r.par_chunks_mut(chunk), p.par_chunks(chunk), q.par_chunks(chunk))
            .into_par_iter()
            .enumerate()
            .map(|(band, (x, r, p, q))| {
                let step = |part: Range<usize>| {
                    step_part(alpha, &mut x[part.clone()], &mut r[part.clone()], &p[part.clone()], &q[part])
                };
                weights.spans.parts(band).map(step).sum::<f64>()
            })
            .collect();
    squares.iter().sum()
}

/// [`step`] of a part of a band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn step_part(alpha: f64, x: &mut [f64], r: &mut [f64], p: &[f32], q: &[f64]) -> f64 {
    for (x, &p) in x.iter_mut().zip(p) {
        *x += alpha * f64::from(p);
    }
    for (r, q) in r.iter_mut().zip(q) {
        *r -= alpha * q;
    }
    dot(r, r)
}

/// Sum of squares, by blocks in parallel and then in order: the same bits for any number of threads.
pub(super) fn square_sum(vector: &[f64]) -> f64 {
    let blocks: Vec<f64> = vector.par_chunks(BLOCK).map(|block| dot(block, block)).collect();
    blocks.iter().sum()
}
