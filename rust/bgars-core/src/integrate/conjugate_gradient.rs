//! Conjugate gradient on the reduced system (Hestenes and Stiefel 1952), preconditioned by multigrid.
//!
//! Written out here for its memory traffic: the sums ride along with the passes that make their vectors, and every pass runs on
//! all threads. faer's solver, with which the tests compare it, does its vector work on one thread and in passes of its own.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Weights};
use super::edges::Colours;
use super::multigrid::Multigrid;
use super::reduction::{dot, settle};
use super::{OnProgress, Params, Progress};
use crate::memory::{self, Aligned};
use crate::{Error, Result};

/// Elements of a vector that one task copies or adds up.
const BLOCK: usize = 1 << 14;

/// What [`conjugate_gradients`] found.
pub(super) struct Solution {
    pub reds: Aligned<f64>,
    pub blacks: Aligned<f64>,
    pub iterations: usize,
    /// Norm of the true residual, relative to `scale`.
    pub residual: f64,
    /// False where the iterations did not suffice, or rounding left nothing of one; the rest is then what they came to.
    pub solved: bool,
}

/// Solves for the reds, from `x`, until the norm of what the system leaves is at most the tolerance times `scale`; the blacks
/// follow from them.
///
/// The residual that the iteration carries along drifts from the true one by rounding: when it says done, the true one is
/// computed, and if it does not agree the iteration starts again from there.
pub(super) fn conjugate_gradients(
    weights: &Weights,
    right: &Colours,
    mut x: Aligned<f64>,
    scale: f64,
    params: &Params,
    on_progress: OnProgress<'_>,
) -> Result<Solution> {
    let size = x.len();
    let target = (params.relative_tolerance * scale).max(params.absolute_tolerance * (2.0 * size as f64).sqrt());
    // Between the steps the blacks lie in q.
    let [mut q, mut r] = [Aligned::<f64>::any(size), Aligned::any(size)];
    let mut norm = settle(weights, right, &x, &mut q, &mut r).sqrt();
    let (mut iterations, mut solved) = (0, true);
    if norm <= target {
        let residual = if norm > 0.0 { norm / scale } else { 0.0 };
        return Ok(Solution { reds: x, blacks: q, iterations, residual, solved });
    }
    let preconditioner = Multigrid::new(weights);
    let mut vectors = preconditioner.vectors();
    // A direction may be any; what x and r take along it agrees in `f64`.
    let [mut p, mut previous] = [Aligned::<f32>::any(size), Aligned::any(size)];
    // r for the V-cycle, which reads it twice.
    let mut rounded = Aligned::<f32>::any(size);
    loop {
        round(&r, &mut rounded);
        let mut r_z_before = None;
        // A step that x has not taken yet: two at once touch its memory half as often.
        let mut waiting = None;
        // Written so that NaN goes on, to be found below.
        while !(norm <= target) {
            solved = iterations < params.max_iters;
            if !solved {
                break;
            }
            let r_z = preconditioner.descend(&rounded, &mut vectors);
            // What was there before the first direction is finite, and counts nothing.
            let beta = r_z_before.replace(r_z).map_or(0.0, |before| (r_z / before) as f32);
            std::mem::swap(&mut p, &mut previous);
            let p_q = preconditioner.advance(&rounded, &vectors, (beta, &previous), &mut p, &mut q);
            // Both are positive but for rounding; what is lost in it cannot be found again.
            solved = r_z > 0.0 && p_q > 0.0;
            if !solved {
                memory::forget();
                // What waits is a step along the direction before.
                std::mem::swap(&mut p, &mut previous);
                break;
            }
            let alpha = r_z / p_q;
            norm = subtract(weights, (alpha, &q), &mut r, &mut rounded).sqrt();
            waiting = match waiting {
                Some(before) => {
                    take_steps(weights, [(before, &previous), (alpha, &p)], &mut x);
                    None
                }
                None => Some(alpha),
            };
            iterations += 1;
            if on_progress(Progress { iteration: iterations, residual: norm / scale }).is_break() {
                return Err(Error::Cancelled);
            }
        }
        if let Some(alpha) = waiting {
            take_steps(weights, [(alpha, &p), (0.0, &p)], &mut x);
        }
        norm = settle(weights, right, &x, &mut q, &mut r).sqrt();
        if !solved || norm <= target {
            return Ok(Solution { reds: x, blacks: q, iterations, residual: norm / scale, solved });
        }
    }
}

/// A residual as floats.
fn round(r: &[f64], rounded: &mut [f32]) {
    rounded.par_chunks_mut(BLOCK).zip(r.par_chunks(BLOCK)).for_each(|(rounded, r)| {
        for (rounded, &r) in rounded.iter_mut().zip(r) {
            *rounded = r as f32;
        }
    });
}

/// `r -= alpha q` along the spans of the grid, also rounded; returns `<r, r>`, each band summed by itself.
fn subtract(weights: &Weights, (alpha, q): (f64, &[f64]), r: &mut [f64], rounded: &mut [f32]) -> f64 {
    let chunk = BAND_ROWS * weights.grid.half();
    let squares: Vec<f64> = (r.par_chunks_mut(chunk), rounded.par_chunks_mut(chunk), q.par_chunks(chunk))
        .into_par_iter()
        .enumerate()
        .map(|(band, (r, rounded, q))| {
            let parts = weights.spans.parts(band);
            parts.map(|part| subtract_part((alpha, &q[part.clone()]), &mut r[part.clone()], &mut rounded[part])).sum()
        })
        .collect();
    squares.iter().sum()
}

/// [`subtract`] from a part of a band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn subtract_part((alpha, q): (f64, &[f64]), r: &mut [f64], rounded: &mut [f32]) -> f64 {
    for ((r, rounded), q) in r.iter_mut().zip(rounded).zip(q) {
        *r -= alpha * q;
        *rounded = *r as f32;
    }
    dot(r, r)
}

/// A step, and the direction it is taken along.
type Step<'a> = (f64, &'a [f32]);

/// `x` takes two steps, one after the other, along the spans of the grid.
fn take_steps(weights: &Weights, [(alpha, p), (beta, q)]: [Step<'_>; 2], x: &mut [f64]) {
    let chunk = BAND_ROWS * weights.grid.half();
    (x.par_chunks_mut(chunk), p.par_chunks(chunk), q.par_chunks(chunk)).into_par_iter().enumerate().for_each(
        |(band, (x, p, q))| {
            for part in weights.spans.parts(band) {
                take_steps_of_part([(alpha, &p[part.clone()]), (beta, &q[part.clone()])], &mut x[part]);
            }
        },
    );
}

/// [`take_steps`] in a part of a band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn take_steps_of_part([(alpha, p), (beta, q)]: [Step<'_>; 2], x: &mut [f64]) {
    for ((x, &p), &q) in x.iter_mut().zip(p).zip(q) {
        *x = (*x + alpha * f64::from(p)) + beta * f64::from(q);
    }
}

/// Sum of squares, by blocks in parallel and then in order: the same bits for any number of threads.
pub(super) fn square_sum(vector: &[f64]) -> f64 {
    let blocks: Vec<f64> = vector.par_chunks(BLOCK).map(|block| dot(block, block)).collect();
    blocks.iter().sum()
}
