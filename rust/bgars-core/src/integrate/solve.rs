//! The least-squares integrator: checks, faer's conjugate gradient, constants.

use std::sync::atomic::{AtomicBool, Ordering};

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::matrix_free::InitialGuessStatus;
use faer::matrix_free::conjugate_gradient::{CgError, CgParams, conjugate_gradient, conjugate_gradient_scratch};
use faer::{ColMut, ColRef, Par};

use super::components::{label, remove_means};
use super::jacobi::Jacobi;
use super::operator::{Field, Laplacian};
use super::{OnProgress, Params, Progress, Surface};
use crate::{Error, Result};

/// Integrates `normals` over `mask` to a height map in pixels.
///
/// # Inputs
/// `normals` 3 values a pixel (x right, y up, z to the camera), row-major `mask.len()` pixels in rows of `width`;
/// `weights` one value a pixel (an edge takes the geometric mean of its two). The weight `n_z^2` is always in.
///
/// # Method
/// Minimises the sum over edges of `w (n_z dz + n_x)^2` (and the like in y) by conjugate gradient on the normal equations
/// with a Jacobi preconditioner (Horn and Brooks 1986; Quéau, Durou, Aujol 2018, section 3). The constant of each
/// component is projected out of right side and solution.
///
/// # Errors
/// Mismatched lengths, an empty mask, normals inside the mask that are not finite or look away, settings out of range,
/// [`Error::NoConvergence`] with iterations and residual, [`Error::Cancelled`].
///
/// # Examples
/// ```
/// use bgars_core::integrate::{Params, integrate};
/// // A plane that rises one pixel in height a pixel to the right: n = (-1, 0, 1) / sqrt(2).
/// let s = 0.5f32.sqrt();
/// let normals: Vec<f32> = [-s, 0.0, s].repeat(3);
/// let surface = integrate(&normals, &[true; 3], 3, None, &Params::default(), &mut |_| {
///     std::ops::ControlFlow::Continue(())
/// })?;
/// assert!((surface.height_px[2] - 1.0).abs() < 1e-6);
/// # Ok::<(), bgars_core::Error>(())
/// ```
///
/// # Cost
/// An iteration is linear in the pixels of the image; the same bits for any number of threads.
pub fn integrate(
    normals: &[f32],
    mask: &[bool],
    width: usize,
    weights: Option<&[f32]>,
    params: &Params,
    on_progress: OnProgress<'_>,
) -> Result<Surface> {
    let field = Field { normals, mask, weights, width };
    check(field, params)?;
    let (labels, components) = label(mask, width);
    let cancelled = AtomicBool::new(false);
    let (operator, mut right) = Laplacian::new(field, params.difference, &cancelled);
    remove_means(&mut right, &labels, &components);
    let mut height = vec![0.0; mask.len()];
    let iterations = conjugate_gradients(&operator, &right, &mut height, params, &cancelled, on_progress)?;
    remove_means(&mut height, &labels, &components);
    let residual = relative_residual(&operator, &height, &right);
    let height_px = height.iter().zip(mask).map(|(&z, &used)| if used { z as f32 } else { f32::NAN }).collect();
    Ok(Surface { height_px, labels, components, iterations, residual })
}

/// Refuses what the solver cannot work on.
fn check(field: Field<'_>, params: &Params) -> Result<()> {
    let Field { normals, mask, weights, width } = field;
    let length = |argument, expected, actual| {
        if expected == actual { Ok(()) } else { Err(Error::LengthMismatch { argument, expected, actual }) }
    };
    length("normals", mask.len() * 3, normals.len())?;
    if let Some(weights) = weights {
        length("weights", mask.len(), weights.len())?;
    }
    if width == 0 || !mask.contains(&true) {
        return Err(Error::EmptyMask);
    }
    length("mask", mask.len().div_ceil(width) * width, mask.len())?;
    for pixel in (0..mask.len()).filter(|&pixel| mask[pixel]) {
        let (row, col) = (pixel / width, pixel % width);
        let normal = &normals[pixel * 3..pixel * 3 + 3];
        if !(normal.iter().all(|component| component.is_finite()) && normal[2] >= 0.0) {
            return Err(Error::BadNormal { row, col, n_z: f64::from(normal[2]) });
        }
        if let Some(weights) = weights
            && !(weights[pixel].is_finite() && weights[pixel] >= 0.0)
        {
            return Err(Error::BadWeight { row, col, value: f64::from(weights[pixel]) });
        }
    }
    for (argument, value) in
        [("relative_tolerance", params.relative_tolerance), ("absolute_tolerance", params.absolute_tolerance)]
    {
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::OutOfRange { argument, rule: "finite and above 0", value });
        }
    }
    if params.max_iters == 0 {
        return Err(Error::OutOfRange { argument: "max_iters", rule: "at least 1", value: 0.0 });
    }
    Ok(())
}

/// Runs faer's solver from zero; returns the number of iterations.
fn conjugate_gradients(
    operator: &Laplacian<'_>,
    right: &[f64],
    height: &mut [f64],
    params: &Params,
    cancelled: &AtomicBool,
    on_progress: OnProgress<'_>,
) -> Result<usize> {
    let right_norm = norm(right);
    let preconditioner = Jacobi::new(&operator.diagonal);
    // faer's own vector work stays on one thread: its sums must not depend on the number of threads.
    let par = Par::Seq;
    let cg_params = CgParams {
        // Not `Zero`: faer 0.24 then leaves its residual uninitialised.
        initial_guess: InitialGuessStatus::MaybeNonZero,
        abs_tolerance: params.absolute_tolerance * (right.len() as f64).sqrt(),
        rel_tolerance: params.relative_tolerance,
        max_iters: params.max_iters,
        ..Default::default()
    };
    let mut buffer = MemBuffer::new(conjugate_gradient_scratch(&preconditioner, operator, 1, par));
    let mut iteration = 0;
    let outcome = conjugate_gradient(
        ColMut::from_slice_mut(height).as_mat_mut(),
        &preconditioner,
        operator,
        ColRef::from_slice(right).as_mat(),
        cg_params,
        |_| {
            iteration += 1;
            let residual = preconditioner.residual_norm() / right_norm;
            if on_progress(Progress { iteration, residual }).is_break() {
                cancelled.store(true, Ordering::Relaxed);
            }
        },
        par,
        MemStack::new(&mut buffer),
    );
    if cancelled.load(Ordering::Relaxed) {
        return Err(Error::Cancelled);
    }
    match outcome {
        Ok(info) => Ok(info.iter_count),
        // The operator is semi-definite by construction: only a direction lost in rounding ends up here.
        Err(CgError::NonPositiveDefiniteOperator | CgError::NonPositiveDefinitePreconditioner) => {
            Err(no_convergence(operator, height, right, iteration, params))
        }
        Err(CgError::NoConvergence { .. }) => Err(no_convergence(operator, height, right, params.max_iters, params)),
    }
}

fn no_convergence(
    operator: &Laplacian<'_>,
    height: &[f64],
    right: &[f64],
    iterations: usize,
    params: &Params,
) -> Error {
    Error::NoConvergence {
        iterations,
        residual: relative_residual(operator, height, right),
        tolerance: params.relative_tolerance,
    }
}

/// `|b - A x| / |b|`; 0 for a zero right side.
fn relative_residual(operator: &Laplacian<'_>, x: &[f64], right: &[f64]) -> f64 {
    let mut residual = vec![0.0; right.len()];
    operator.multiply(&mut residual, x);
    for (residual, right) in residual.iter_mut().zip(right) {
        *residual = right - *residual;
    }
    let scale = norm(right);
    if scale > 0.0 { norm(&residual) / scale } else { 0.0 }
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|value| value * value).sum::<f64>().sqrt()
}
