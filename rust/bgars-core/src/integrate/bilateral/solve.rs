//! The bilateral integrator: solve, re-weigh, until the energy rests.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::super::checkerboard::{Weights, join_row, split_whole_row};
use super::super::components::Runs;
use super::super::conjugate_gradient::conjugate_gradients;
use super::super::edges::Colours;
use super::super::fill::fill_corners;
use super::super::operator::Field;
use super::super::reduction::sum;
use super::super::settle::Right;
use super::super::solve::{Facing, check_lengths, check_pixels};
use super::super::{Params, Progress};
use super::assemble::assemble;
use super::pixels::Pixels;
use super::published::Published;
use super::reweigh::{even, reweigh};
use super::{BilateralParams, BilateralSurface, Pinhole, Setting};
use crate::memory::Aligned;
use crate::{Error, Result};

/// Largest relative residual of an inner solve.
const CONVERGED_TOLERANCE: f64 = 1e-6;
/// Least share of a side in a system that multigrid solves. Weaker ties than this hold nothing within the tolerance, and the
/// preconditioner's `f32` could not carry them.
const CONVERGED_LEAST_SHARE: f64 = 1e-6;
/// Most iterations of an inner solve.
const CONVERGED_ITERS: usize = 500;

/// Callback of [`integrate_bilateral`], once a re-weighting, with the relative change of the energy in place of the residual.
pub type OnReweigh<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// Integrates normals to a surface that may jump between pixels.
///
/// # Inputs
/// `field` as for [`super::super::integrate_field`]; `camera` for perspective, where any side of a normal may face the camera.
///
/// # Method
/// Iteratively re-weighted least squares on one-sided differences (Cao et al. 2022, algorithm 1), each system solved from the
/// surface before it. See [`super`] for the functional.
///
/// # Errors
/// Those of [`super::super::integrate`]; in perspective, normals that look away from the camera.
///
/// # Examples
/// ```
/// use bgars_core::integrate::{BilateralParams, Field, integrate_bilateral};
/// // Flat, and tilted by one pixel a pixel: the fold is no jump, and costs nothing.
/// let s = 0.5f32.sqrt();
/// let normals = [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [-s, 0.0, s], [-s, 0.0, s]].concat();
/// let field = Field { normals: &normals, mask: &[true; 4], weights: None, regions: None, width: 4 };
/// let surface = integrate_bilateral(field, None, &BilateralParams::default(), &mut |_| {
///     std::ops::ControlFlow::Continue(())
/// })?;
/// assert!((surface.height[3] - surface.height[2] - 1.0).abs() < 0.1);
/// assert!(surface.converged);
/// # Ok::<(), bgars_core::Error>(())
/// ```
///
/// # Cost
/// A re-weighting is linear in the pixels of the mask's bounding box, and so is an iteration of the inner solver; the same
/// bits for any number of threads.
pub fn integrate_bilateral(
    field: Field<'_>,
    camera: Option<Pinhole>,
    params: &BilateralParams,
    on_progress: OnReweigh<'_>,
) -> Result<BilateralSurface> {
    let Field { mask, width, .. } = field;
    check(field, camera, params)?;
    let pixels = Pixels::new(field, camera, params.setting);
    let mut published =
        (params.setting == Setting::Compatible).then(|| Published::new(&pixels.frame, params.precision));
    let mut z = Aligned::zeros(pixels.len());
    let mut shares = even(&pixels);
    let mut fit = Progressed::default();
    let mut energies: Vec<f64> = Vec::new();
    let mut at_rest = false;
    while energies.len() < params.max_iters && !at_rest {
        if let Some(published) = &mut published {
            published.improve(&pixels, &shares, &mut z, &mut fit, on_progress)?;
        } else {
            let (system, right) = assemble(&pixels, &shares, CONVERGED_LEAST_SHARE);
            improve(system, right, &mut z, &mut fit, on_progress)?;
        }
        let energy = reweigh(&pixels, &z, params.k, &mut shares);
        let before = energies.last().copied().unwrap_or(f64::INFINITY);
        energies.push(energy);
        fit.change = (energy - before).abs() / before;
        at_rest = energy == 0.0 || (before.is_finite() && fit.change < params.tolerance);
        fit.rounds = energies.len();
        if on_progress(Progress { iteration: fit.rounds, residual: fit.change }).is_break() {
            return Err(Error::Cancelled);
        }
    }
    let runs = Runs::new(mask, field.regions, width);
    let crop = pixels.crop;
    let means = runs.means(|row, cols| {
        let start = (row - crop.row) * crop.grid.width;
        sum(&z[start + cols.start - crop.col..start + cols.end - crop.col])
    });
    let labels = runs.labels();
    let mean_at = |pixel: usize| {
        let (row, col) = (pixel / crop.grid.width + crop.row, pixel % crop.grid.width + crop.col);
        means[labels[row * width + col] as usize]
    };
    Ok(BilateralSurface {
        height: pixels.whole(mask.len(), width, |pixel| z[pixel] - mean_at(pixel)),
        rightward: pixels.whole(mask.len(), width, |pixel| shares[0][pixel]),
        upward: pixels.whole(mask.len(), width, |pixel| shares[1][pixel]),
        labels,
        components: runs.components,
        energies,
        converged: at_rest && !fit.unsolved,
        inner_iterations: fit.inner_iterations,
        residual: fit.residual,
    })
}

/// Refuses what the integrator cannot work on.
fn check(field: Field<'_>, camera: Option<Pinhole>, params: &BilateralParams) -> Result<()> {
    check_lengths(field)?;
    match camera {
        None => check_pixels(field, Facing::Camera)?,
        Some(camera) => {
            camera.check()?;
            check_pixels(field, Facing::Anywhere)?;
            check_facing(field, camera)?;
        }
    }
    for (argument, value, positive) in [("k", params.k, false), ("tol", params.tolerance, true)] {
        if !(value.is_finite() && (value > 0.0 || !positive && value == 0.0)) {
            let rule = if positive { "finite and above 0" } else { "finite and at least 0" };
            return Err(Error::OutOfRange { argument, rule, value });
        }
    }
    if params.max_iters == 0 {
        return Err(Error::OutOfRange { argument: "max_iters", rule: "at least 1", value: 0.0 });
    }
    Ok(())
}

/// Refuses a camera under which most of the surface looks away: a sign is wrong somewhere.
fn check_facing(field: Field<'_>, camera: Pinhole) -> Result<()> {
    let Field { normals, mask, width, .. } = field;
    let away = |&pixel: &usize| {
        let normal = std::array::from_fn(|axis| f64::from(normals[3 * pixel + axis]));
        mask[pixel] && camera.slants(normal, pixel / width, pixel % width)[0] <= 0.0
    };
    let count = (0..mask.len()).into_par_iter().filter(away).count();
    let pixels = mask.iter().filter(|&&used| used).count();
    if 2 * count > pixels {
        return Err(Error::LooksAway { count, pixels });
    }
    Ok(())
}

/// What the inner solves add up to.
#[derive(Default)]
pub(super) struct Progressed {
    pub rounds: usize,
    pub change: f64,
    pub inner_iterations: usize,
    pub residual: f64,
    /// Whether the last of them needed more iterations than it was given.
    pub unsolved: bool,
}

/// Brings `z` (row-major in the box) to the solution of a system by multigrid.
fn improve(
    mut weights: Weights,
    right: Colours,
    z: &mut [f64],
    fit: &mut Progressed,
    on_progress: OnReweigh<'_>,
) -> Result<()> {
    let grid = weights.grid;
    let (width, half) = (grid.width, grid.half());
    let scale = right.norm;
    if scale == 0.0 {
        z.fill(0.0);
        return Ok(());
    }
    let bits = fill_corners(&mut weights);
    let mut reds = Aligned::any(grid.half_pixels());
    // Of the blacks only the memory matters: they follow from the reds.
    reds.par_chunks_mut(half)
        .zip(z.par_chunks(width))
        .enumerate()
        .for_each_init(|| vec![0.0; half], |blacks, (row, (reds, z))| split_whole_row(row, z, reds, blacks));
    let inner = Params { relative_tolerance: CONVERGED_TOLERANCE, max_iters: CONVERGED_ITERS, ..Params::default() };
    let state = Progress { iteration: fit.rounds, residual: fit.change };
    let solution = conjugate_gradients(
        &weights,
        bits,
        Right::Kept(right, None),
        Some(reds),
        scale,
        &inner,
        &mut |_: Progress| on_progress(state),
    )?;
    fit.inner_iterations += solution.iterations;
    if !solution.residual.is_finite() {
        let (iterations, tolerance) = (fit.inner_iterations, CONVERGED_TOLERANCE);
        return Err(Error::NoConvergence { iterations, residual: solution.residual, tolerance });
    }
    fit.unsolved = !solution.solved;
    fit.residual = fit.residual.max(solution.residual);
    z.par_chunks_mut(width)
        .zip(solution.reds.par_chunks(half))
        .zip(solution.blacks.par_chunks(half))
        .enumerate()
        .for_each(|(row, ((z, reds), blacks))| join_row(row, reds, blacks, z));
    Ok(())
}
