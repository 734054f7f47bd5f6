//! The whole system as published, reds and blacks in one vector, and its diagonal as a preconditioner.

use faer::dyn_stack::MemStack;
use faer::matrix_free::{LinOp, Precond};
use faer::{MatMut, MatRef, Par};

use super::super::checkerboard::Colour;
use super::super::real::Real;
use super::super::stencil::Stencil;
use super::super::vectors::{slice, slice_mut, symmetric_operator};

/// `[D_red, -W; -W^T, D_black]`.
#[derive(Debug)]
pub(super) struct Laplacian<'a>(pub &'a Stencil<f64>);

/// The inverse of its diagonal.
#[derive(Debug)]
pub(super) struct Diagonal<'a>(pub &'a Stencil<f64>);

/// Sets both colours of `out` from those of `x` as [`Stencil::update`] does.
fn update(stencil: &Stencil<f64>, x: &[f64], out: &mut [f64], set: impl Fn(&mut f64, f64, f64, f64) + Sync) {
    let ((x_red, x_black), (red, black)) = (x.split_at(x.len() / 2), out.split_at_mut(x.len() / 2));
    stencil.update(Colour::Red, x_black, x_red, red, &set);
    stencil.update(Colour::Black, x_red, x_black, black, &set);
}

impl LinOp<f64> for Laplacian<'_> {
    symmetric_operator!(|laplacian: &Self| 2 * laplacian.0.grid.half_pixels());

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        update(self.0, slice(rhs), slice_mut(out), |out, sum, d, x| *out = d * x - sum);
    }
}

impl LinOp<f64> for Diagonal<'_> {
    symmetric_operator!(|diagonal: &Self| 2 * diagonal.0.grid.half_pixels());

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        update(self.0, slice(rhs), slice_mut(out), |out, _, d, r| *out = r.over(d));
    }
}

impl Precond<f64> for Diagonal<'_> {}
