//! Checks of the input.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::settings::{Field, Params};
use crate::{Error, Result};

/// Shortest and longest normal that is taken for one of length 1: interpolation and 8 bits shorten them, garbage is far off.
const LENGTHS: [f32; 2] = [0.5, 2.0];

/// Pixels that are checked at a time.
pub(super) const CHECK_PIXELS: usize = 1 << 14;

/// Work memory of an integration, in bytes a pixel: most where a graph begins early.
const WORK_BYTES: usize = 80;

/// Refuses an image whose work memory the system does not give, before any of it is used.
pub(super) fn check_memory(pixels: usize) -> Result<()> {
    let bytes = pixels.saturating_mul(WORK_BYTES);
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(|_| Error::OutOfMemory { bytes })
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

pub(super) fn check_length(argument: &'static str, expected: usize, actual: usize) -> Result<()> {
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
