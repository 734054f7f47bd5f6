//! The inner solves as published: conjugate gradient from the last surface, to a tolerance that leaves it unfinished.

use rayon::prelude::*;

use super::super::Progress;
use super::super::reduction::square_sum;
use super::Precision;
use super::frame::Frame;
use super::jacobi::Jacobi;
use super::normal_equations::NormalEquations;
use super::pixels::Pixels;
use super::reweigh::Shares;
use super::solve::{OnReweigh, Progressed};
use crate::memory::Aligned;
use crate::{Error, Result};

/// Largest relative residual of an inner solve.
const TOLERANCE: f64 = 1e-3;
/// Most iterations of an inner solve.
const MAX_ITERS: usize = 5_000;
/// Iterations between two looks at the callback, which cost more than a small iteration.
const PATIENCE: usize = 128;

/// The system of the weights at hand and its solver, their memory used again from one re-weighting to the next.
pub(super) struct Published<'a> {
    frame: &'a Frame,
    system: NormalEquations,
    solver: Solver<'a>,
    /// The surface, framed.
    z: Aligned<f64>,
}

enum Solver<'a> {
    Double(Jacobi<'a, f64>),
    Single(Jacobi<'a, f32>),
}

impl<'a> Published<'a> {
    pub fn new(frame: &'a Frame, precision: Precision) -> Self {
        let solver = match precision {
            Precision::Double => Solver::Double(Jacobi::new(frame)),
            Precision::Single => Solver::Single(Jacobi::new(frame)),
        };
        Self { frame, system: NormalEquations::new(frame), solver, z: frame.zeros() }
    }

    /// Brings `z` (row-major in the box) closer to the solution of the system for some shares.
    pub fn improve(
        &mut self,
        pixels: &Pixels,
        shares: &Shares,
        z: &mut [f64],
        fit: &mut Progressed,
        on_progress: OnReweigh<'_>,
    ) -> Result<()> {
        let Self { frame, system, solver, z: framed } = self;
        system.set(frame, pixels, shares);
        let scale = square_sum(&system.source).sqrt();
        if scale == 0.0 {
            z.fill(0.0);
            return Ok(());
        }
        let (first, stride, width) = (frame.start(0), frame.stride(), pixels.crop.grid.width);
        let rows = framed[first..].par_chunks_mut(stride).zip(z.par_chunks(width));
        rows.enumerate().for_each(|(row, (framed, z))| {
            for span in pixels.spans(row) {
                framed[span.clone()].copy_from_slice(&z[span]);
            }
        });
        let mut stopped = false;
        let mut done = 0;
        let state = Progress { iteration: fit.rounds, residual: fit.change };
        let each = || {
            done += 2;
            stopped = done % PATIENCE == 0 && on_progress(state).is_break();
            !stopped
        };
        let (iterations, left) = match solver {
            Solver::Double(solver) => solver.improve(system, framed, TOLERANCE * scale, MAX_ITERS, each),
            Solver::Single(solver) => solver.improve(system, framed, TOLERANCE * scale, MAX_ITERS, each),
        };
        if stopped {
            return Err(Error::Cancelled);
        }
        fit.inner_iterations += iterations;
        if !left.is_finite() {
            let (iterations, tolerance) = (fit.inner_iterations, TOLERANCE);
            return Err(Error::NoConvergence { iterations, residual: left / scale, tolerance });
        }
        let rows = z.par_chunks_mut(width).zip(framed[first..].par_chunks(stride));
        rows.enumerate().for_each(|(row, (z, framed))| {
            for span in pixels.spans(row) {
                z[span.clone()].copy_from_slice(&framed[span]);
            }
        });
        fit.residual = fit.residual.max(left / scale);
        Ok(())
    }
}
