//! Checks of the input.

use rayon::prelude::*;

use super::settings::{Field, Params};
use crate::error::{check_length, check_rule};
use crate::{Error, Result};

/// Shortest and longest normal that is taken for one of length 1: interpolation and 8 bits shorten them, garbage is far off.
const LENGTHS: [f32; 2] = [0.5, 2.0];

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
        check_rule(argument, "finite and above 0", value, value.is_finite() && value > 0.0)?;
    }
    check_rule("max_iters", "at least 1", 0.0, params.max_iters > 0)
}

/// Refuses arrays that do not fit each other, and a mask without a pixel.
pub(super) fn check_lengths(field: Field<'_>) -> Result<()> {
    let Field { normals, mask, weights, regions, width } = field;
    check_length("normals", mask.len() * 3, normals.len())?;
    check_length("weights", mask.len(), weights.map_or(mask.len(), <[_]>::len))?;
    check_length("regions", mask.len(), regions.map_or(mask.len(), <[_]>::len))?;
    if width == 0 || !mask.contains(&true) {
        return Err(Error::EmptyMask);
    }
    check_length("mask", mask.len().div_ceil(width) * width, mask.len())
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
    let offence = |pixel: usize| check_pixel(field, facing, pixel).err();
    if let Some(first) = (0..field.mask.len()).into_par_iter().find_map_first(offence) {
        return Err(first);
    }
    let weighs = |(&weight, &used): (&f32, &bool)| used && weight > 0.0;
    let holds = field.weights.is_none_or(|weights| weights.iter().zip(field.mask).any(weighs));
    check_rule("weights", "above 0 in at least one pixel of the mask", 0.0, holds)
}

/// Refuses a normal or a weight inside the mask that means nothing.
fn check_pixel(field: Field<'_>, facing: Facing, pixel: usize) -> Result<()> {
    let Field { normals, mask, weights, width, .. } = field;
    if !mask[pixel] {
        return Ok(());
    }
    let (row, col) = (pixel / width, pixel % width);
    let normal: [f32; 3] = std::array::from_fn(|axis| normals[3 * pixel + axis]);
    let square = normal.iter().map(|component| component * component).sum::<f32>();
    let rule = if !normal.iter().all(|component| component.is_finite()) {
        Some("finite")
    } else if facing == Facing::Camera && normal[2] < 0.0 {
        Some("toward the camera, n_z >= 0")
    } else if !(LENGTHS[0] * LENGTHS[0]..=LENGTHS[1] * LENGTHS[1]).contains(&square) {
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
