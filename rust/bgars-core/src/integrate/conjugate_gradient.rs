//! faer's conjugate gradient, watched: it tells its progress, can be stopped, and is held to the true residual.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::matrix_free::conjugate_gradient::{CgParams, conjugate_gradient as solve, conjugate_gradient_scratch};
use faer::matrix_free::{InitialGuessStatus, LinOp, Precond};
use faer::{MatMut, MatRef, Par};
use rayon::prelude::*;

use super::norm::norm;
use super::vectors::{slice, slice_mut, symmetric_operator};
use crate::{Error, Result};

/// What the true residual may lie above the target by, relative to it.
const ROUNDING: f64 = 1e-6;

/// What both sides are multiplied by. faer 0.24 takes the norm of every residual, and for that squares values times 1e-154, too:
/// of values below one that is subnormal, and takes a third of an iteration. A power of two changes no digit.
const LIFT: f64 = (1_u64 << 40) as f64;

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Largest norm of the residual.
    pub target: f64,
    pub max_iters: usize,
}

/// How far the iterations came.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outcome {
    pub iterations: usize,
    /// Norm of the true residual.
    pub norm: f64,
    /// Whether it is as small as asked for.
    pub solved: bool,
}

/// Called with the iterations done and the norm of the residual.
pub(super) type Report<'a> = &'a mut dyn FnMut(usize, f64) -> ControlFlow<()>;

/// Brings `x` to the solution of `operator x = right`, preconditioned; nothing is set up where it is there already.
///
/// The residual that the iteration carries along drifts from the true one by rounding: when it says done, the true one is
/// computed, and if it does not agree the iteration starts again from there, as long as that helps.
pub(super) fn conjugate_gradient<P: Precond<f64>>(
    operator: &impl LinOp<f64>,
    preconditioner: impl FnOnce() -> P,
    right: &[f64],
    x: &mut [f64],
    limits: Limits,
    report: Report<'_>,
) -> Result<Outcome> {
    let mut outcome = Outcome { iterations: 0, norm: true_norm(operator, right, x), solved: true };
    if outcome.norm <= limits.target {
        return Ok(outcome);
    }
    let preconditioner = preconditioner();
    let lifted: Vec<f64> = right.par_iter().map(|value| value * LIFT).collect();
    x.par_iter_mut().for_each(|value| *value *= LIFT);
    let watch = Watch { stopped: AtomicBool::new(false), norm: AtomicU64::new(0) };
    let (watched, preconditioner) = (Stoppable(operator, &watch), Noting(&preconditioner, &watch));
    let request = conjugate_gradient_scratch(&preconditioner, &watched, 1, Par::Seq);
    let mut memory =
        MemBuffer::try_new(request).map_err(|_| Error::OutOfMemory { bytes: request.unaligned_bytes_required() })?;
    loop {
        let (before, start) = (outcome.norm, outcome.iterations);
        let params = CgParams {
            // faer 0.24 leaves its residual unset for a guess of zero.
            initial_guess: InitialGuessStatus::MaybeNonZero,
            abs_tolerance: limits.target * LIFT,
            rel_tolerance: 0.0,
            max_iters: limits.max_iters - start,
            ..CgParams::default()
        };
        let done = &mut outcome.iterations;
        let each = |_: MatRef<'_, f64>| {
            // The residual of this iteration is known in the next one.
            if *done > start && report(*done, f64::from_bits(watch.norm.load(Ordering::Relaxed)) / LIFT).is_break() {
                watch.stopped.store(true, Ordering::Relaxed);
            }
            *done += 1;
        };
        let (solution, right) = (MatMut::from_column_major_slice_mut(x, right.len(), 1), column(&lifted));
        // It ends converged, out of iterations, or where rounding leaves nothing of a product: the true residual tells.
        let _ = solve(solution, &preconditioner, &watched, right, params, each, Par::Seq, MemStack::new(&mut memory));
        if watch.stopped.load(Ordering::Relaxed) {
            return Err(Error::Cancelled);
        }
        outcome.norm = true_norm(operator, &lifted, x) / LIFT;
        outcome.solved = outcome.norm <= limits.target * (1.0 + ROUNDING);
        if outcome.iterations > start && report(outcome.iterations, outcome.norm).is_break() {
            return Err(Error::Cancelled);
        }
        if outcome.solved || outcome.iterations >= limits.max_iters || !(outcome.norm < before) {
            x.par_iter_mut().for_each(|value| *value /= LIFT);
            return Ok(outcome);
        }
    }
}

fn column(values: &[f64]) -> MatRef<'_, f64> {
    MatRef::from_column_major_slice(values, values.len(), 1)
}

/// Norm of `right - operator x`.
fn true_norm(operator: &impl LinOp<f64>, right: &[f64], x: &[f64]) -> f64 {
    if x.par_iter().all(|&value| value == 0.0) {
        return norm(right);
    }
    let mut left = vec![0.0; right.len()];
    let product = MatMut::from_column_major_slice_mut(&mut left, right.len(), 1);
    operator.apply(product, column(x), Par::Seq, MemStack::new(&mut []));
    left.iter_mut().zip(right).for_each(|(left, right)| *left = right - *left);
    norm(&left)
}

/// What the solver's parts know of each other.
#[derive(Debug)]
struct Watch {
    stopped: AtomicBool,
    /// Bits of the norm of the last residual.
    norm: AtomicU64,
}

/// An operator that ends the solver where it was stopped, by numbers that are none.
#[derive(Debug)]
struct Stoppable<'a, A>(&'a A, &'a Watch);

/// A preconditioner that notes the norm of the residual.
#[derive(Debug)]
struct Noting<'a, P>(&'a P, &'a Watch);

impl<A: LinOp<f64>> LinOp<f64> for Stoppable<'_, A> {
    symmetric_operator!(|watched: &Self| watched.0.nrows());

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        if self.1.stopped.load(Ordering::Relaxed) {
            slice_mut(out).fill(f64::NAN);
        } else {
            self.0.apply(out, rhs, par, stack);
        }
    }
}

impl<P: Precond<f64>> LinOp<f64> for Noting<'_, P> {
    symmetric_operator!(|watched: &Self| watched.0.nrows());

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        if self.1.stopped.load(Ordering::Relaxed) {
            slice_mut(out).fill(0.0);
        } else {
            self.1.norm.store(norm(slice(rhs)).to_bits(), Ordering::Relaxed);
            self.0.apply(out, rhs, par, stack);
        }
    }
}

impl<P: Precond<f64>> Precond<f64> for Noting<'_, P> {}
