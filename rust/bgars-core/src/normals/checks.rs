//! What the kernel refuses.

use rayon::prelude::*;

use super::Method;
use crate::error::check_rule;
use crate::readings::Capture;
use crate::{Error, ImageStack, Lights, Pixel, Result};

/// Refuses what the kernel cannot work on.
pub(super) fn check<P: Pixel>(
    capture: &Capture<'_, P>,
    lights: &Lights,
    mask: Option<&[bool]>,
    method: Method,
) -> Result<()> {
    capture.check(lights, &[("mask", mask)])?;
    if capture.stack.pixels() == 0 || mask.is_some_and(|mask| !mask.contains(&true)) {
        return Err(Error::EmptyMask);
    }
    let Method::SpecularFilter { threshold } = method else { return Ok(()) };
    let (rule, holds) = ("finite and above 0 (grey levels of 255)", threshold.is_finite() && threshold > 0.0);
    check_rule("threshold", rule, f64::from(threshold), holds)
}

/// Refuses NaN and infinity in pixels that are to be used.
pub(crate) fn check_finite<P: Pixel>(stack: &ImageStack<'_, P>, mask: Option<&[bool]>) -> Result<()> {
    for image in 0..stack.lights() {
        let plane = stack.plane(image);
        let bad = |&pixel: &usize| !plane[pixel].to_f32().is_finite() && mask.is_none_or(|mask| mask[pixel]);
        let count = (0..plane.len()).into_par_iter().filter(bad).count();
        if let Some(first) = if count > 0 { (0..plane.len()).find(bad) } else { None } {
            let (row, col) = (first / stack.width(), first % stack.width());
            return Err(Error::NonFinitePixel { image, row, col, count });
        }
    }
    Ok(())
}
