//! The normal equations as faer's solvers take them: an operator on vectors, its right side and its preconditioners.

use std::sync::{Mutex, PoisonError};

use faer::dyn_stack::MemStack;
use faer::matrix_free::LinOp;
use faer::{MatMut, MatRef, Par};

use super::checkerboard::Colour;
use super::multigrid::Multigrid;
use super::norm::norm;
use super::real::Real;
use super::stencil::Stencil;
use super::vectors::{slice, slice_mut, symmetric_operator};

/// The normal equations of [`super::integrate`] on the checkerboard of pixels, `[D_red, -W; -W^T, D_black]`, and their reduced
/// system, the blacks eliminated (Hageman and Young 1981): `S x = b`, `S = D_red - W D_black^-1 W^T`, on the reds.
///
/// `S` is symmetric and positive semi-definite: the constant of each component is free, and pixels without neighbours have
/// empty rows.
#[derive(Debug)]
pub struct System {
    pub(super) stencil: Stencil,
    /// Right side of the blacks.
    pub(super) blacks: Vec<f64>,
    /// Right side of the reduced system.
    right_side: Vec<f64>,
    /// The norm of the right side before the reduction.
    pub(super) scale: f64,
}

impl System {
    /// From the operator and the right side of both colours.
    pub(super) fn reduce(stencil: Stencil, [mut reds, blacks]: [Vec<f64>; 2]) -> Self {
        let scale = norm(&reds).hypot(norm(&blacks));
        let mut raised = vec![0.0; blacks.len()];
        stencil.update(Colour::Black, &reds, &blacks, &mut raised, |y, _, d, b| *y = b.over(d));
        stencil.update(Colour::Red, &raised, &blacks, &mut reds, |r, sum, _, _| *r += sum);
        Self { stencil, blacks, right_side: reds, scale }
    }

    /// `b`, one value a red pixel (row + column even); every row of the image has equally many, the last of them zeros.
    #[must_use]
    pub fn right_side(&self) -> &[f64] {
        &self.right_side
    }

    /// `S`.
    #[must_use]
    pub fn operator(&self) -> Operator<'_> {
        let blacks = Mutex::new(vec![0.0; self.right_side.len()]);
        Operator { stencil: &self.stencil, blacks }
    }

    /// One multigrid V-cycle, an approximation of the inverse of `S`.
    #[must_use]
    pub fn preconditioner(&self) -> Multigrid<'_> {
        Multigrid::new(&self.stencil)
    }

    /// The blacks that go with a solution.
    pub(super) fn blacks_of(self, reds: &[f64]) -> Vec<f64> {
        let Self { stencil, mut blacks, right_side, .. } = self;
        stencil.update(Colour::Black, reds, &right_side, &mut blacks, |x, sum, d, _| *x = (*x + sum).over(d));
        blacks
    }
}

/// `S` of a [`System`], one vector at a time.
#[derive(Debug)]
pub struct Operator<'a> {
    stencil: &'a Stencil,
    blacks: Mutex<Vec<f64>>,
}

impl LinOp<f64> for Operator<'_> {
    symmetric_operator!(|operator: &Self| operator.stencil.grid.half_pixels());

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        let (x, out) = (slice(rhs), slice_mut(out));
        let mut blacks = self.blacks.lock().unwrap_or_else(PoisonError::into_inner);
        self.stencil.update(Colour::Black, x, x, &mut blacks, |y, sum, d, _| *y = sum.over(d));
        self.stencil.update(Colour::Red, &blacks, x, out, |out, sum, d, x| *out = d * x - sum);
    }
}
