//! Conjugate gradient on the reduced system (Hestenes and Stiefel 1952), preconditioned by multigrid.
//!
//! Written out here for its memory traffic: the sums ride along with the passes that make their vectors, and every pass runs on
//! all threads. faer's solver, with which the tests compare it, does its vector work on one thread and in passes of its own.

use super::checkerboard::Weights;
use super::edge_bits::EdgeBits;
use super::multigrid::Multigrid;
use super::residual::Residual;
use super::settle::{Right, settle};
use super::steps::Steps;
use super::{OnProgress, Params, Progress};
use crate::memory::Aligned;
use crate::{Error, Result};

/// A graph of more than one node for so many reds needs much of the memory, and much more time than to make the right side again.
const LARGE_GRAPH: usize = 16;

/// What [`conjugate_gradients`] found.
pub(super) struct Solution {
    pub reds: Aligned<f64>,
    pub blacks: Aligned<f64>,
    pub iterations: usize,
    /// Norm of the true residual, relative to `scale`.
    pub residual: f64,
    /// False where the iterations did not suffice, or rounding left nothing of one; the rest is then what they came to.
    pub solved: bool,
    /// True where a large graph was needed, whose memory the allocator may keep for a while.
    pub had_large_graph: bool,
}

/// Solves for the reds of `weights`, which have the edges of `bits`, from `start` or from zero, until the norm of what the
/// system leaves is at most the tolerance times `scale`; the blacks follow from them.
///
/// The residual that the iteration carries along drifts from the true one by rounding: when it says done, the true one is
/// computed, and if it does not agree the iteration starts again from there. It is kept in two floats, not in one: what rounding adds
/// to the sum of a component's residuals no step can take away, and the preconditioner makes the most of it.
pub(super) fn conjugate_gradients(
    weights: &Weights,
    bits: EdgeBits,
    mut right: Right<'_>,
    start: Option<Aligned<f64>>,
    scale: f64,
    params: &Params,
    on_progress: OnProgress<'_>,
) -> Result<Solution> {
    let size = weights.grid.half_pixels();
    let target = (params.relative_tolerance * scale).max(params.absolute_tolerance * (2.0 * size as f64).sqrt());
    // After the steps the blacks lie in q.
    let mut q = Aligned::<f64>::any(size);
    let mut r = Residual::any(size);
    let mut norm = settle(weights, &right, start.as_deref(), None, Some(&mut r)).sqrt();
    let mut x = Steps::from(start, size);
    let (mut iterations, mut solved) = (0, true);
    if norm <= target {
        let residual = if norm > 0.0 { norm / scale } else { 0.0 };
        settle(weights, &right, Some(x.end(weights, [&[], &[]])), Some(&mut q), None);
        return Ok(Solution {
            reds: x.into_solution(),
            blacks: q,
            iterations,
            residual,
            solved,
            had_large_graph: false,
        });
    }
    let mut is_large = false;
    let preconditioner = Multigrid::new(weights, bits, |unknowns| {
        is_large = unknowns > size / LARGE_GRAPH;
        if is_large {
            right.release();
        }
    });
    let mut vectors = preconditioner.vectors();
    // A direction may be any; what x and r take along it agrees in `f64`.
    let [mut p, mut previous] = [Aligned::<f32>::any(size), Aligned::any(size)];
    loop {
        let mut r_z_before = None;
        // Written so that NaN goes on, to be found below.
        while !(norm <= target) {
            solved = iterations < params.max_iters;
            if !solved {
                break;
            }
            let r_z = preconditioner.descend(r.rounded(), &mut vectors);
            // What was there before the first direction is finite, and counts nothing.
            let beta = r_z_before.replace(r_z).map_or(0.0, |before| (r_z / before) as f32);
            std::mem::swap(&mut p, &mut previous);
            let p_q = preconditioner.advance(r.rounded(), x.due(), &vectors, (beta, &previous), &mut p, &mut q);
            // Both are positive but for rounding; what is lost in it cannot be found again.
            solved = r_z > 0.0 && p_q > 0.0;
            if !solved {
                // What waits is a step along the direction before.
                std::mem::swap(&mut p, &mut previous);
                break;
            }
            let alpha = r_z / p_q;
            x.add(alpha);
            norm = r.subtract(weights, alpha, &q).sqrt();
            iterations += 1;
            if on_progress(Progress { iteration: iterations, residual: norm / scale }).is_break() {
                return Err(Error::Cancelled);
            }
        }
        norm = settle(weights, &right, Some(x.end(weights, [&previous, &p])), Some(&mut q), None).sqrt();
        if !solved || norm <= target {
            if is_large {
                [p, previous].into_iter().for_each(Aligned::release);
            }
            let (reds, blacks, residual) = (x.into_solution(), q, norm / scale);
            return Ok(Solution { reds, blacks, iterations, residual, solved, had_large_graph: is_large });
        }
        settle(weights, &right, Some(x.end(weights, [&[], &[]])), None, Some(&mut r));
    }
}
