//! From grey levels to values proportional to light: response, dark frame, black level, light intensity.

use crate::error::{check_length, check_rule};
use crate::{Error, ImageStack, Pixel, Result};

/// How a grey level becomes a radiance, applied pixel by pixel inside the kernels, so that no float copy of a stack is made.
///
/// value = (response(code) - response(dark code or black level)) / intensity
#[derive(Clone, Debug)]
pub struct Radiometry<'a, P> {
    /// Inverse response by code (`P::CODES` entries, in grey levels); `None` for a linear camera.
    pub response: Option<&'a [f32]>,
    /// Dark frame, `height * width` grey levels, lights off.
    pub dark: Option<&'a [P]>,
    /// Grey level of no light (before the response is inverted), where there is no dark frame.
    pub black_level: f32,
    /// Grey level at and above which a pixel counts as clipped; infinity when nothing clips.
    pub saturation: f32,
    /// Grey level of full scale: thresholds given "of 255" scale with it, albedo 1 is this level; `None`: what
    /// [`Self::full_scale_of`] finds.
    pub full_scale: Option<f32>,
    /// Relative intensity of each light; one entry a light.
    pub intensities: Vec<f64>,
}

impl<P: Pixel> Radiometry<'_, P> {
    /// A linear camera without offset and lights of equal intensity 1.
    #[must_use]
    pub fn linear(lights: usize, full_scale: f32) -> Self {
        Self {
            response: None,
            dark: None,
            black_level: 0.0,
            saturation: full_scale,
            full_scale: Some(full_scale),
            intensities: vec![1.0; lights],
        }
    }

    /// Checks every field against the stack it is to serve.
    ///
    /// # Errors
    /// Names the field and the value that break a rule.
    pub fn check(&self, stack: &ImageStack<'_, P>) -> Result<()> {
        if let Some(response) = self.response {
            check_length("response", P::CODES.unwrap_or(0), response.len())?;
        }
        if let Some(dark) = self.dark {
            check_length("dark", stack.pixels(), dark.len())?;
        }
        check_length("light_intensities", stack.lights(), self.intensities.len())?;
        for (index, &value) in self.intensities.iter().enumerate() {
            if !(value.is_finite() && value > 0.0) {
                return Err(Error::BadIntensity { index, value });
            }
        }
        let full_scale = self.full_scale.unwrap_or(f32::MAX);
        let (black, clipped) = (self.black_level, self.saturation);
        for (argument, value, rule, holds) in [
            ("full_scale", full_scale, "finite and above 0", full_scale.is_finite() && full_scale > 0.0),
            ("black_level", black, "at least 0 and below full scale", (0.0..full_scale).contains(&black)),
            ("saturation", clipped, "above the black level", clipped > black),
        ] {
            check_rule(argument, rule, f64::from(value), holds)?;
        }
        Ok(())
    }

    /// Grey level of full scale: the one given, else the largest code of integers, and of floats the largest finite value, which
    /// takes a look at all of them.
    ///
    /// # Examples
    /// ```
    /// use bgars_core::{ImageStack, Radiometry};
    /// let radiometry = Radiometry { full_scale: None, ..Radiometry::linear(1, 1.0) };
    /// assert_eq!(radiometry.full_scale_of(&ImageStack::new(&[0.25, 0.5], 1, 1, 2)?), 0.5);
    /// # Ok::<(), bgars_core::Error>(())
    /// ```
    #[must_use]
    pub fn full_scale_of(&self, stack: &ImageStack<'_, P>) -> f32 {
        self.full_scale.unwrap_or_else(|| match P::CODES {
            Some(codes) => (codes - 1) as f32,
            None => stack.largest_finite().max(LEAST_FULL_SCALE),
        })
    }

    /// True where the values of the images are in proportion to light, but for an offset.
    #[allow(clippy::float_cmp)] // intensities that are 1 by default
    pub(crate) fn is_plain(&self) -> bool {
        self.response.is_none() && self.intensities.iter().all(|&intensity| (1.0 / intensity) as f32 == 1.0)
    }

    /// True where something is subtracted from the values of the images.
    pub(crate) fn has_offsets(&self) -> bool {
        self.dark.is_some() || self.black_level != 0.0
    }

    /// Linear grey levels of one code, the offset still in.
    #[inline]
    pub(crate) fn linearise(&self, code: P) -> f32 {
        match self.response {
            Some(table) => table[code.code()],
            None => code.to_f32(),
        }
    }

    /// Linear grey levels that mean "no light" at a pixel.
    #[inline]
    pub(crate) fn offset(&self, pixel: usize) -> f32 {
        match (self.dark, self.response) {
            (Some(dark), _) => self.linearise(dark[pixel]),
            (None, None) => self.black_level,
            (None, Some(table)) => interpolate(table, self.black_level),
        }
    }
}

/// Full scale of floats that show no light.
const LEAST_FULL_SCALE: f32 = 1e-30;

/// The response table at a grey level between two codes.
fn interpolate(table: &[f32], level: f32) -> f32 {
    let last = table.len() - 1;
    let position = level.clamp(0.0, last as f32);
    let below = (position as usize).min(last.saturating_sub(1));
    let fraction = position - below as f32;
    table[below] + fraction * (table[(below + 1).min(last)] - table[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_level_between_two_codes_is_interpolated() {
        let table: Vec<f32> = (0..256).map(|code| (code * code) as f32).collect();
        let mut radiometry = Radiometry::<u8>::linear(3, 255.0);
        radiometry.response = Some(&table);
        radiometry.black_level = 2.5;
        approx::assert_relative_eq!(radiometry.offset(0), 6.5);
    }
}
