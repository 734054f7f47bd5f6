//! The bilateral integrator: solve, re-weigh, until the energy rests.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::super::checkerboard::{Grid, join_row, split_row};
use super::super::checks::{Facing, check_lengths, check_memory, check_pixels};
use super::super::conjugate_gradient::{Limits, Outcome, conjugate_gradient};
use super::super::norm::{norm, sum};
use super::super::settings::{Field, Progress};
use super::super::system::System;
use super::camera::Pinhole;
use super::jacobi::{Diagonal, Laplacian};
use super::pixels::{Pixels, Shares, assemble};
use super::reweigh::{even, reweigh};
use super::settings::{BilateralParams, BilateralSurface, Setting};
use crate::components::Runs;
use crate::error::check_rule;
use crate::{Error, Result};

/// Largest relative residual of an inner solve as published, and most iterations.
const PUBLISHED: (f64, usize) = (1e-3, 5_000);
/// The same by multigrid.
const CONVERGED: (f64, usize) = (1e-6, 500);
/// Least share of a side in a system that multigrid solves. Weaker ties than this hold nothing within the tolerance, and the
/// preconditioner's `f32` could not carry them.
const CONVERGED_LEAST_SHARE: f64 = 1e-6;

/// Callback of [`integrate_bilateral`], once a re-weighting, with the relative change of the energy in place of the residual.
pub type OnReweigh<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// Integrates normals to a surface that may jump between pixels.
///
/// # Inputs
/// `field` as for [`super::super::integrate_into`]; `camera` for perspective, where any side of a normal may face the camera.
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
    check_memory(2 * mask.len())?;
    let pixels = Pixels::new(field, camera, params.setting);
    let mut z = vec![0.0; pixels.len()];
    let mut shares = even(&pixels);
    let mut fit = Inner::default();
    let mut energies: Vec<f64> = Vec::new();
    let mut at_rest = false;
    while energies.len() < params.max_iters && !at_rest {
        improve(&pixels, &shares, params.setting, &mut z, &mut fit, on_progress)?;
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
        inner_iterations: fit.iterations,
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
    let (k, tolerance) = (params.k, params.tolerance);
    check_rule("k", "finite and at least 0", k, k.is_finite() && k >= 0.0)?;
    check_rule("tol", "finite and above 0", tolerance, tolerance.is_finite() && tolerance > 0.0)?;
    check_rule("max_iters", "at least 1", 0.0, params.max_iters > 0)
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
struct Inner {
    rounds: usize,
    change: f64,
    iterations: usize,
    residual: f64,
    /// Whether the last of them needed more iterations than it was given.
    unsolved: bool,
}

/// Brings `z` (row-major in the box) to the solution of the system for some shares, from where it is.
fn improve(
    pixels: &Pixels,
    shares: &Shares,
    setting: Setting,
    z: &mut [f64],
    fit: &mut Inner,
    on_progress: OnReweigh<'_>,
) -> Result<()> {
    let state = Progress { iteration: fit.rounds, residual: fit.change };
    let mut report = |_: usize, _: f64| on_progress(state);
    let grid = pixels.crop.grid;
    let mut x = split(grid, z);
    let (tolerance, max_iters) = if setting == Setting::Compatible { PUBLISHED } else { CONVERGED };
    let (outcome, scale) = match setting {
        Setting::Compatible => {
            let (stencil, right) = assemble(pixels, shares, 0.0);
            let (right, scale) = (right.concat(), norm(&right[0]).hypot(norm(&right[1])));
            let (operator, limits) = (Laplacian(&stencil), Limits { target: tolerance * scale, max_iters });
            (conjugate_gradient(&operator, || Diagonal(&stencil), &right, &mut x, limits, &mut report)?, scale)
        }
        Setting::Converged => {
            let (stencil, right) = assemble(pixels, shares, CONVERGED_LEAST_SHARE);
            let system = System::reduce(stencil, right);
            let (scale, reds) = (system.scale, &mut x[..grid.half_pixels()]);
            let limits = Limits { target: tolerance * scale, max_iters };
            let (operator, right) = (system.operator(), system.right_side());
            let outcome = conjugate_gradient(&operator, || system.preconditioner(), right, reds, limits, &mut report)?;
            drop(operator);
            let blacks = system.blacks_of(reds);
            x[grid.half_pixels()..].copy_from_slice(&blacks);
            (outcome, scale)
        }
    };
    if scale == 0.0 {
        z.fill(0.0);
        return Ok(());
    }
    let Outcome { iterations, norm, solved } = outcome;
    fit.iterations += iterations;
    let residual = norm / scale;
    if !residual.is_finite() {
        return Err(Error::NoConvergence { iterations: fit.iterations, residual, tolerance });
    }
    fit.unsolved = setting == Setting::Converged && !solved;
    fit.residual = fit.residual.max(residual);
    join(grid, &x, z);
    Ok(())
}

/// Rows of pixels as a vector of reds and blacks.
fn split(grid: Grid, z: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; 2 * grid.half_pixels()];
    let (reds, blacks) = x.split_at_mut(grid.half_pixels());
    let colours = reds.par_chunks_mut(grid.half()).zip(blacks.par_chunks_mut(grid.half()));
    let rows = colours.zip(z.par_chunks(grid.width)).enumerate();
    rows.for_each(|(row, ((reds, blacks), z))| split_row(row, z, [reds, blacks]));
    x
}

/// The way back.
fn join(grid: Grid, x: &[f64], z: &mut [f64]) {
    let (reds, blacks) = x.split_at(grid.half_pixels());
    let colours = reds.par_chunks(grid.half()).zip(blacks.par_chunks(grid.half()));
    let rows = z.par_chunks_mut(grid.width).zip(colours).enumerate();
    rows.for_each(|(row, (z, (reds, blacks)))| join_row(row, [reds, blacks], z));
}
