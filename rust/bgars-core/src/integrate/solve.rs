//! The least-squares integrator: checks, the solver, constants.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{by_column, join_whole_row};
use super::components::Runs;
use super::conjugate_gradient::{Solution, conjugate_gradients};
use super::fill::fill_corners;
use super::operator::{Field, FieldEdges};
use super::reduction::sum;
use super::settle::Right;
use super::{Fit, OnProgress, Params, Surface};
use crate::memory::zeros;
use crate::{Error, Result};

/// Shortest and longest normal that is taken for one of length 1: interpolation and 8 bits shorten them, garbage is far off.
const LENGTHS: [f32; 2] = [0.5, 2.0];

/// Pixels that are checked at a time.
const CHECK_PIXELS: usize = 1 << 14;

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
    integrate_field(Field { normals, mask, weights, regions: None, width }, params, on_progress)
}

/// [`integrate`] with regions: pixels of different ones are not joined, so that each region floats freely.
///
/// # Errors
/// Those of [`integrate`].
///
/// # Examples
/// ```
/// use bgars_core::integrate::{Field, Params, integrate_field};
/// let (normals, mask) = ([0.0, 0.0, 1.0].repeat(4), [true; 4]);
/// let field = Field { normals: &normals, mask: &mask, weights: None, regions: Some(&[7, 7, 8, 8]), width: 4 };
/// let surface = integrate_field(field, &Params::default(), &mut |_| std::ops::ControlFlow::Continue(()))?;
/// assert_eq!(surface.components.len(), 2);
/// # Ok::<(), bgars_core::Error>(())
/// ```
pub fn integrate_field(field: Field<'_>, params: &Params, on_progress: OnProgress<'_>) -> Result<Surface> {
    let (mut height_px, mut labels) = (zeros(field.mask.len()), zeros(field.mask.len()));
    let fit = integrate_into(field, params, on_progress, &mut height_px, &mut labels)?;
    let Fit { components, iterations, residual } = fit;
    Ok(Surface { height_px, labels, components, iterations, residual })
}

/// [`integrate_field`] into memory that is there already, which may hold anything: fresh pages cost a tenth of a large
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
    let edges = FieldEdges::new(field, params.difference);
    let (mut weights, right) = edges.assemble();
    let bits = fill_corners(&mut weights);
    let again = |rows: Range<usize>, colours: [&mut [f64]; 2]| edges.right_side(rows, colours);
    let scale = right.norm;
    let half = weights.grid.half();
    let Solution { reds, blacks, iterations, residual, solved, had_large_graph } =
        conjugate_gradients(&weights, bits, Right::Kept(right, Some(&again)), None, scale, params, on_progress)?;
    if !solved {
        return Err(Error::NoConvergence { iterations, residual, tolerance: params.relative_tolerance });
    }
    if had_large_graph {
        // What is written now would come on top of it.
        weights.release();
    }
    let runs = Runs::new(mask, field.regions, width);
    let fill = |row: usize, values: &mut [f64]| {
        let span = row * half..(row + 1) * half;
        join_whole_row(row, &reds[span.clone()], &blacks[span], values);
    };
    let means = runs.means(|row, cols| {
        let span = row * half..(row + 1) * half;
        let [first, second] = by_column(row, [&reds[span.clone()], &blacks[span]]);
        sum(&first[cols.start.div_ceil(2)..cols.end.div_ceil(2)]) + sum(&second[cols.start / 2..cols.end / 2])
    });
    height_px.par_chunks_mut(width).enumerate().for_each_init(
        || vec![0.0; width],
        |values, (row, height_px)| {
            fill(row, values);
            for (cols, component) in runs.row(row) {
                center(&values[cols.clone()], means[component], &mut height_px[cols]);
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
    let mut usable = zeros(normals.len() / 3);
    usable.par_chunks_mut(CHECK_PIXELS).zip(normals.par_chunks(3 * CHECK_PIXELS)).for_each(|(usable, normals)| {
        for (usable, normal) in usable.iter_mut().zip(normals.chunks_exact(3)) {
            // NaN and infinity spread into the sum of their products with zero.
            *usable = normal[2] > 0.0 && (normal[0] * 0.0 + normal[1] * 0.0) + normal[2] * 0.0 == 0.0;
        }
    });
    usable
}

/// Refuses what the solver cannot work on.
pub(super) fn check(field: Field<'_>, params: &Params) -> Result<()> {
    check_lengths(field)?;
    check_pixels(field, Facing::Camera)?;
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

/// Refuses arrays that do not fit each other, and a mask without a pixel.
pub(super) fn check_lengths(field: Field<'_>) -> Result<()> {
    let Field { normals, mask, weights, regions, width } = field;
    check_length("normals", mask.len() * 3, normals.len())?;
    if let Some(weights) = weights {
        check_length("weights", mask.len(), weights.len())?;
    }
    if let Some(regions) = regions {
        check_length("regions", mask.len(), regions.len())?;
    }
    if width == 0 || !mask.contains(&true) {
        return Err(Error::EmptyMask);
    }
    check_length("mask", mask.len().div_ceil(width) * width, mask.len())?;
    Ok(())
}

fn check_length(argument: &'static str, expected: usize, actual: usize) -> Result<()> {
    if expected == actual { Ok(()) } else { Err(Error::LengthMismatch { argument, expected, actual }) }
}

/// Where normals may point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Facing {
    /// `n_z >= 0`.
    Camera,
    /// In perspective the camera may see a normal with `n_z < 0`.
    Anywhere,
}

/// Refuses normals and weights inside the mask that mean nothing.
pub(super) fn check_pixels(field: Field<'_>, facing: Facing) -> Result<()> {
    // Nearly always all is well, and that shows quickly; only otherwise the first offender is looked for.
    let pixels = field.mask.len();
    let chunks = (0..pixels.div_ceil(CHECK_PIXELS)).into_par_iter();
    let sound = |chunk: usize| are_sound(field, facing, chunk * CHECK_PIXELS..((chunk + 1) * CHECK_PIXELS).min(pixels));
    if !chunks.map(sound).all(|sound| sound) {
        (0..pixels).try_for_each(|pixel| check_pixel(field, facing, pixel))?;
    }
    let weighs = |(&weight, &used): (&f32, &bool)| used && weight > 0.0;
    if field.weights.is_some_and(|weights| !weights.iter().zip(field.mask).any(weighs)) {
        let rule = "above 0 in at least one pixel of the mask";
        return Err(Error::OutOfRange { argument: "weights", rule, value: 0.0 });
    }
    Ok(())
}

/// True when [`check_pixel`] refuses none of some pixels; without branches.
#[allow(clippy::needless_bitwise_bool)]
fn are_sound(field: Field<'_>, facing: Facing, pixels: Range<usize>) -> bool {
    let mask = &field.mask[pixels.clone()];
    let normals = field.normals[3 * pixels.start..3 * pixels.end].as_chunks::<3>().0;
    let mut sound = are_unit(normals, mask, facing == Facing::Anywhere);
    // NaN and infinity spread into products with zero.
    let is_finite = |value: f32| value * 0.0 == 0.0;
    for (&weight, &used) in field.weights.map_or(&[][..], |weights| &weights[pixels]).iter().zip(mask) {
        sound &= !used | (is_finite(weight) & (weight >= 0.0));
    }
    sound
}

/// True when the normals in the mask have about length 1 and, unless they may point `away`, face the camera.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
#[allow(clippy::needless_bitwise_bool)]
fn are_unit(normals: &[[f32; 3]], mask: &[bool], away: bool) -> bool {
    let [least, most] = [LENGTHS[0] * LENGTHS[0], LENGTHS[1] * LENGTHS[1]];
    let n = mask.len();
    let normals = &normals[..n];
    let mut sound = true;
    for k in 0..n {
        let [x, y, z] = normals[k];
        let square = x * x + y * y + z * z;
        // Comparisons with NaN are false.
        sound &= !mask[k] | ((square >= least) & (square <= most) & (away | (z >= 0.0)));
    }
    sound
}

/// Refuses a normal or a weight inside the mask that means nothing.
fn check_pixel(field: Field<'_>, facing: Facing, pixel: usize) -> Result<()> {
    let Field { normals, mask, weights, width, .. } = field;
    if !mask[pixel] {
        return Ok(());
    }
    let (row, col) = (pixel / width, pixel % width);
    let normal: [f32; 3] = std::array::from_fn(|axis| normals[3 * pixel + axis]);
    let length = normal.iter().map(|component| component * component).sum::<f32>().sqrt();
    let rule = if !normal.iter().all(|component| component.is_finite()) {
        Some("finite")
    } else if facing == Facing::Camera && normal[2] < 0.0 {
        Some("toward the camera, n_z >= 0")
    } else if !(LENGTHS[0]..=LENGTHS[1]).contains(&length) {
        Some("of length 1 (0.5 to 2 is let through)")
    } else {
        None
    };
    if let Some(rule) = rule {
        return Err(Error::BadNormal { row, col, rule, normal });
    }
    if let Some(weights) = weights
        && !(weights[pixel].is_finite() && weights[pixel] >= 0.0)
    {
        return Err(Error::BadWeight { row, col, value: f64::from(weights[pixel]) });
    }
    Ok(())
}
