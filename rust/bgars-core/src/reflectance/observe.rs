//! Pixels as the reflectance estimator sees them: linear, at unit light intensity, in grey levels of 255, bent.

use super::scale::bend_reading;
use crate::median::median;
use crate::{ImageStack, Pixel, Radiometry};

/// Grey level of a camera that never clips.
const NO_CLIP: f64 = 1e6;

/// Pixels that the usual offset is taken from, about.
const OFFSET_PIXELS: usize = 1000;

/// Reads pixels of a stack on the scale of [`super::scale::bend`].
#[derive(Debug)]
pub struct Reader<'a, 'b, P> {
    stack: &'a ImageStack<'b, P>,
    radiometry: &'a Radiometry<'b, P>,
    /// Grey levels of 255 for one linear grey level of each light.
    scales: Vec<f32>,
    /// Linear grey level at which the camera clips, by its response.
    clip_level: f32,
}

impl<'a, 'b, P: Pixel> Reader<'a, 'b, P> {
    /// A reader for a stack and its radiometry.
    pub fn new(stack: &'a ImageStack<'b, P>, radiometry: &'a Radiometry<'b, P>) -> Self {
        let full_scale = f64::from(radiometry.full_scale_of(stack));
        let scales = radiometry.intensities.iter().map(|&i| (255.0 / (full_scale * i)) as f32).collect();
        let clip_level = match radiometry.response {
            Some(table) if radiometry.saturation.is_finite() => {
                table[(radiometry.saturation as usize).min(table.len() - 1)]
            }
            _ => radiometry.saturation,
        };
        Self { stack, radiometry, scales, clip_level }
    }

    /// Rows and columns of an image.
    pub fn size(&self) -> (usize, usize) {
        (self.stack.height(), self.stack.width())
    }

    /// Number of lights.
    pub fn lights(&self) -> usize {
        self.stack.lights()
    }

    /// Linear grey level of 255 at which each light clips, a usual pixel's offset taken off.
    pub fn clip_levels(&self) -> Vec<f64> {
        let pixels = self.stack.pixels();
        let step = (pixels / OFFSET_PIXELS).max(1);
        let mut offsets: Vec<f32> = (0..pixels).step_by(step).map(|pixel| self.radiometry.offset(pixel)).collect();
        let offset = median(&mut offsets, f32::total_cmp);
        self.scales.iter().map(|&scale| f64::from((self.clip_level - offset) * scale).min(NO_CLIP)).collect()
    }

    /// Writes the bent level of every light at a pixel.
    #[inline]
    pub fn read(&self, pixel: usize, bent: &mut [f32]) {
        let offset = self.radiometry.offset(pixel);
        for (light, (bent, &scale)) in bent.iter_mut().zip(&self.scales).enumerate() {
            let level = (self.radiometry.linearise(self.stack.plane(light)[pixel]) - offset) * scale;
            *bent = bend_reading(level);
        }
    }
}
