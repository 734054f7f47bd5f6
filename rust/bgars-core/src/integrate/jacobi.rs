//! Diagonal preconditioner.

use std::sync::atomic::{AtomicU64, Ordering};

use faer::dyn_stack::{MemStack, StackReq};
use faer::matrix_free::{LinOp, Precond};
use faer::{MatMut, MatRef, Par};
use rayon::prelude::*;

use super::operator::{column, column_mut};

/// `D^-1`, and a look at the residual on the way: the solver hands it over here and nowhere else.
#[derive(Debug)]
pub(super) struct Jacobi<'a> {
    diagonal: &'a [f64],
    residual_bits: AtomicU64,
}

impl<'a> Jacobi<'a> {
    pub fn new(diagonal: &'a [f64]) -> Self {
        Self { diagonal, residual_bits: AtomicU64::new(f64::NAN.to_bits()) }
    }

    /// Norm of the residual last seen; NaN before the first iteration.
    pub fn residual_norm(&self) -> f64 {
        f64::from_bits(self.residual_bits.load(Ordering::Relaxed))
    }
}

impl LinOp<f64> for Jacobi<'_> {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        self.diagonal.len()
    }

    fn ncols(&self) -> usize {
        self.diagonal.len()
    }

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        self.residual_bits.store(rhs.norm_l2().to_bits(), Ordering::Relaxed);
        let (out, rhs) = (column_mut(out), column(rhs));
        out.par_iter_mut()
            .zip(rhs)
            .zip(self.diagonal)
            .for_each(|((out, &rhs), &diagonal)| *out = if diagonal > 0.0 { rhs / diagonal } else { 0.0 });
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

impl Precond<f64> for Jacobi<'_> {}
