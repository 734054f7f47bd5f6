//! What the kernel refuses.

use rayon::prelude::*;

use super::Method;
use crate::readings::Capture;
use crate::{Error, ImageStack, Lights, Pixel, Result};

/// Pixels that are looked through for NaN at a time.
const FINITE_BLOCK: usize = 1 << 14;

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
    if let Method::SpecularFilter { threshold } = method
        && !(threshold.is_finite() && threshold > 0.0)
    {
        return Err(Error::OutOfRange {
            argument: "threshold",
            rule: "finite and above 0 (grey levels of 255)",
            value: f64::from(threshold),
        });
    }
    Ok(())
}

/// Refuses NaN and infinity in pixels that are to be used.
pub(crate) fn check_finite<P: Pixel>(stack: &ImageStack<'_, P>, mask: Option<&[bool]>) -> Result<()> {
    for image in 0..stack.lights() {
        let plane = stack.plane(image);
        // Nearly always all is well, and that shows quickly.
        let all_finite = |block: &[P]| block.iter().fold(true, |finite, pixel| finite & pixel.to_f32().is_finite());
        if plane.par_chunks(FINITE_BLOCK).all(all_finite) {
            continue;
        }
        let bad = |&pixel: &usize| !plane[pixel].to_f32().is_finite() && mask.is_none_or(|mask| mask[pixel]);
        let count = (0..plane.len()).into_par_iter().filter(bad).count();
        if let Some(first) = if count > 0 { (0..plane.len()).find(bad) } else { None } {
            let (row, col) = (first / stack.width(), first % stack.width());
            return Err(Error::NonFinitePixel { image, row, col, count });
        }
    }
    Ok(())
}
