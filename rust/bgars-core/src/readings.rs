//! A capture read pixel by pixel as linear grey levels: what is built on it is the same for all types of pixels.

use multiversion::multiversion;

use crate::error::check_length;
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

/// A stack, and how its grey levels become values in proportion to light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capture<'a, P> {
    pub stack: &'a ImageStack<'a, P>,
    pub radiometry: &'a Radiometry<'a, P>,
}

impl<P: Pixel> Capture<'_, P> {
    /// Refuses lights, radiometry and masks (by their names) that do not fit the images.
    pub fn check(&self, lights: &Lights, masks: &[(&'static str, Option<&[bool]>)]) -> Result<()> {
        if lights.len() != self.stack.lights() {
            return Err(Error::LightCountMismatch { images: self.stack.lights(), lights: lights.len() });
        }
        self.radiometry.check(self.stack)?;
        for &(argument, mask) in masks {
            check_length(argument, self.stack.pixels(), mask.map_or(self.stack.pixels(), <[bool]>::len))?;
        }
        Ok(())
    }
}

/// What estimators ask of a [`Capture`].
pub(crate) trait Readings: Sync {
    /// Rows and columns of an image.
    fn size(&self) -> (usize, usize);
    /// Relative intensity of each light.
    fn intensities(&self) -> &[f64];
    /// Grey level of full scale.
    fn full_scale(&self) -> f32;
    /// Linear grey level at which the camera clips, by its response.
    fn clip_level(&self) -> f32;
    /// Linear grey level of a light at a pixel, the offset still in.
    fn level(&self, light: usize, pixel: usize) -> f32;
    /// Writes [`Self::level`] of some pixels.
    fn levels(&self, light: usize, pixels: &[usize], levels: &mut [f32]);
    /// Linear grey level that means "no light" at a pixel.
    fn offset(&self, pixel: usize) -> f32;
    /// True where [`Self::offset`] is zero everywhere.
    fn has_no_offsets(&self) -> bool;
    fn is_clipped(&self, light: usize, pixel: usize) -> bool;
    /// Writes [`Self::is_clipped`] of some pixels.
    fn clipped(&self, light: usize, pixels: &[usize], clipped: &mut [bool]);

    /// Centre of a pixel: x right, y up, origin at the image centre.
    fn centre(&self, pixel: usize) -> (f64, f64) {
        let (height, width) = self.size();
        pixel_centre(pixel / width, pixel % width, height, width)
    }
}

impl<P: Pixel> Readings for Capture<'_, P> {
    fn size(&self) -> (usize, usize) {
        (self.stack.height(), self.stack.width())
    }

    fn intensities(&self) -> &[f64] {
        &self.radiometry.intensities
    }

    fn full_scale(&self) -> f32 {
        self.radiometry.full_scale_of(self.stack)
    }

    fn clip_level(&self) -> f32 {
        let saturation = self.radiometry.saturation;
        match self.radiometry.response {
            Some(table) if saturation.is_finite() => table[(saturation as usize).min(table.len() - 1)],
            _ => saturation,
        }
    }

    fn level(&self, light: usize, pixel: usize) -> f32 {
        self.radiometry.linearise(self.stack.plane(light)[pixel])
    }

    fn levels(&self, light: usize, pixels: &[usize], levels: &mut [f32]) {
        let plane = self.stack.plane(light);
        match run(plane, pixels).filter(|_| self.radiometry.response.is_none()) {
            Some(codes) => widen(codes, levels),
            None => {
                for (level, &pixel) in levels.iter_mut().zip(pixels) {
                    *level = self.radiometry.linearise(plane[pixel]);
                }
            }
        }
    }

    fn offset(&self, pixel: usize) -> f32 {
        self.radiometry.offset(pixel)
    }

    fn has_no_offsets(&self) -> bool {
        !self.radiometry.has_offsets()
    }

    fn is_clipped(&self, light: usize, pixel: usize) -> bool {
        self.stack.plane(light)[pixel].to_f32() >= self.radiometry.saturation
    }

    fn clipped(&self, light: usize, pixels: &[usize], clipped: &mut [bool]) {
        let plane = self.stack.plane(light);
        let is_clipped = |code: &P| code.to_f32() >= self.radiometry.saturation;
        match run(plane, pixels) {
            Some(codes) => clipped.iter_mut().zip(codes).for_each(|(clipped, code)| *clipped = is_clipped(code)),
            None => clipped.iter_mut().zip(pixels).for_each(|(clipped, &pixel)| *clipped = is_clipped(&plane[pixel])),
        }
    }
}

/// The codes of pixels of which each follows the one before: none is left out and none repeated.
fn run<'a, P>(plane: &'a [P], pixels: &[usize]) -> Option<&'a [P]> {
    let (&first, &last) = (pixels.first()?, pixels.last()?);
    let follow = last + 1 == first + pixels.len() && pixels.is_sorted_by(|one, next| one < next);
    follow.then(|| &plane[first..=last])
}

/// Codes as floats.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn widen<P: Pixel>(codes: &[P], levels: &mut [f32]) {
    for (level, code) in levels.iter_mut().zip(codes) {
        *level = code.to_f32();
    }
}

/// Centre of a pixel: x right, y up, origin at the image centre.
pub(crate) fn pixel_centre(row: usize, col: usize, height: usize, width: usize) -> (f64, f64) {
    (col as f64 + 0.5 - width as f64 / 2.0, height as f64 / 2.0 - row as f64 - 0.5)
}
