//! The least-squares integrator: the solver between its checks and the constants of components.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{Crop, by_column, join_row};
use super::checks::{check, check_memory};
use super::conjugate_gradient::{Limits, conjugate_gradient};
use super::field::assemble;
use super::norm::sum;
use super::settings::{Field, Fit, OnProgress, Params, Progress, Surface};
use crate::components::Runs;
use crate::error::check_length;
use crate::{Error, Result};

/// Integrates `normals` over `mask` to a height map in pixels.
///
/// # Inputs
/// `normals` 3 values a pixel (x right, y up, z to the camera), row-major `mask.len()` pixels in rows of `width`;
/// `weights` one value a pixel (an edge takes the geometric mean of its two; only their ratios count, and pixels of weight 0
/// are left out). The weight `n_z^2` is always in.
///
/// # Method
/// Minimises the sum over edges of `w (n_z dz + n_x)^2` (and the like in y; Horn and Brooks 1986; Quéau, Durou, Aujol 2018,
/// section 3) by conjugate gradient on the normal equations, preconditioned by a multigrid V-cycle (Brandt 1977; Trottenberg,
/// Oosterlee, Schüller 2001). The constant of each component is free: its mean is set to zero at the end.
///
/// # Errors
/// Mismatched lengths, an empty mask, normals inside the mask that are not finite, look away or are far from length 1, weights
/// of which none is above 0, settings out of range, [`Error::NoConvergence`] with iterations and residual,
/// [`Error::Cancelled`].
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
/// An iteration is linear in the pixels between the first and the last of the mask, 32 rows at a time; the same bits for any
/// number of threads.
pub fn integrate(
    normals: &[f32],
    mask: &[bool],
    width: usize,
    weights: Option<&[f32]>,
    params: &Params,
    on_progress: OnProgress<'_>,
) -> Result<Surface> {
    let (mut height_px, mut labels) = (vec![0.0; mask.len()], vec![0; mask.len()]);
    let field = Field { normals, mask, weights, regions: None, width };
    let Fit { components, iterations, residual } =
        integrate_into(field, params, on_progress, &mut height_px, &mut labels)?;
    Ok(Surface { height_px, labels, components, iterations, residual })
}

/// [`integrate`] of any field into memory that is there already, which may hold anything: fresh pages cost a tenth of a large
/// integration. After an error the content means nothing.
///
/// # Errors
/// Those of [`integrate`], and memory for another number of pixels than the mask has.
pub fn integrate_into(
    field: Field<'_>,
    params: &Params,
    on_progress: OnProgress<'_>,
    height_px: &mut [f32],
    labels: &mut [i32],
) -> Result<Fit> {
    check(field, params)?;
    let weighted = without_weightless(field);
    let mask = weighted.as_deref().unwrap_or(field.mask);
    let (field, width) = (Field { mask, ..field }, field.width);
    check_length("height_px", mask.len(), height_px.len())?;
    check_length("labels", mask.len(), labels.len())?;
    let crop = Crop::around(mask, width);
    check_memory(crop.grid.height * crop.grid.width)?;
    let system = assemble(field, crop, params.difference);
    let (half, scale) = (crop.grid.half(), system.scale);
    let limits = Limits {
        target: (params.relative_tolerance * scale).max(params.absolute_tolerance * (mask.len() as f64).sqrt()),
        max_iters: params.max_iters,
    };
    let mut reds = vec![0.0; crop.grid.half_pixels()];
    let relative = |norm: f64| if norm > 0.0 { norm / scale } else { 0.0 };
    let mut report = |iteration, norm| on_progress(Progress { iteration, residual: relative(norm) });
    let (operator, right) = (system.operator(), system.right_side());
    let solution = conjugate_gradient(&operator, || system.preconditioner(), right, &mut reds, limits, &mut report)?;
    drop(operator);
    let (iterations, residual) = (solution.iterations, relative(solution.norm));
    if !solution.solved {
        return Err(Error::NoConvergence { iterations, residual, tolerance: params.relative_tolerance });
    }
    let blacks = system.blacks_of(&reds);
    let runs = Runs::new(mask, field.regions, width);
    // Rows and columns of the box.
    let of_row = |row: usize| [&reds, &blacks].map(|colour| &colour[row * half..(row + 1) * half]);
    let means = runs.means(|row, cols| {
        let (row, cols) = (row - crop.row, cols.start - crop.col..cols.end - crop.col);
        let [first, second] = by_column(row, of_row(row));
        sum(&first[cols.start.div_ceil(2)..cols.end.div_ceil(2)]) + sum(&second[cols.start / 2..cols.end / 2])
    });
    height_px.par_chunks_mut(width).enumerate().for_each_init(
        || vec![0.0; crop.grid.width],
        |values, (row, height_px)| {
            if (crop.row..crop.row + crop.grid.height).contains(&row) {
                join_row(row - crop.row, of_row(row - crop.row), values);
            }
            for (cols, component) in runs.row(row) {
                let values = &values[cols.start - crop.col..cols.end - crop.col];
                center(values, means[component], &mut height_px[cols]);
            }
            for cols in runs.gaps(row) {
                height_px[cols].fill(f32::NAN);
            }
        },
    );
    runs.write_labels(labels);
    Ok(Fit { components: runs.components, iterations, residual })
}

/// Values less their mean.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn center(values: &[f64], mean: f64, out: &mut [f32]) {
    for (out, value) in out.iter_mut().zip(values) {
        *out = (value - mean) as f32;
    }
}

/// The mask without the pixels of weight zero, of which nothing is known; `None` where there are none.
fn without_weightless(field: Field<'_>) -> Option<Vec<bool>> {
    let Field { mask, weights, .. } = field;
    let weights =
        weights.filter(|weights| weights.par_iter().zip(mask).any(|(&weight, &used)| used && weight == 0.0))?;
    Some(mask.iter().zip(weights).map(|(&used, &weight)| used && weight > 0.0).collect())
}

/// The pixels whose normal can be integrated: finite, and toward the camera (`n_z > 0`). 3 values a pixel.
///
/// # Examples
/// ```
/// let normals = [0.0, 0.0, 1.0, f32::NAN, 0.0, 1.0, 1.0, 0.0, 0.0];
/// assert_eq!(bgars_core::integrate::usable(&normals), [true, false, false]);
/// ```
#[must_use]
pub fn usable(normals: &[f32]) -> Vec<bool> {
    let usable = |normal: &[f32; 3]| normal[2] > 0.0 && normal.iter().all(|component| component.is_finite());
    normals.as_chunks().0.par_iter().map(usable).collect()
}
