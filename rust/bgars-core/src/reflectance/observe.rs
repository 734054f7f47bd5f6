//! Pixels as the reflectance estimator sees them: linear, at unit light intensity, in grey levels of 255, bent.

use super::scale::bend_reading;
use crate::median::median;
use crate::readings::Readings;

/// Grey level of a camera that never clips.
const NO_CLIP: f64 = 1e6;

/// Pixels that the usual offset is taken from, about.
const OFFSET_PIXELS: usize = 1000;

/// Reads pixels of a capture on the scale of [`super::scale::bend`].
pub struct Reader<'a> {
    capture: &'a dyn Readings,
    /// Grey levels of 255 for one linear grey level of each light.
    scales: Vec<f32>,
}

impl<'a> Reader<'a> {
    pub fn new(capture: &'a dyn Readings) -> Self {
        let full_scale = f64::from(capture.full_scale());
        let scales = capture.intensities().iter().map(|&i| (255.0 / (full_scale * i)) as f32).collect();
        Self { capture, scales }
    }

    /// Rows and columns of an image.
    pub fn size(&self) -> (usize, usize) {
        self.capture.size()
    }

    /// Centre of a pixel: x right, y up, origin at the image centre.
    pub fn centre(&self, pixel: usize) -> (f64, f64) {
        self.capture.centre(pixel)
    }

    pub fn lights(&self) -> usize {
        self.scales.len()
    }

    /// Linear grey level of 255 at which each light clips, a usual pixel's offset taken off.
    pub fn clip_levels(&self) -> Vec<f64> {
        let pixels = self.size().0 * self.size().1;
        let step = (pixels / OFFSET_PIXELS).max(1);
        let mut offsets: Vec<f32> = (0..pixels).step_by(step).map(|pixel| self.capture.offset(pixel)).collect();
        let offset = median(&mut offsets, f32::total_cmp);
        let clip_level = self.capture.clip_level();
        self.scales.iter().map(|&scale| f64::from((clip_level - offset) * scale).min(NO_CLIP)).collect()
    }

    /// Writes the bent level of every light at a pixel.
    #[inline]
    pub fn read(&self, pixel: usize, bent: &mut [f32]) {
        let offset = self.capture.offset(pixel);
        for (light, (bent, &scale)) in bent.iter_mut().zip(&self.scales).enumerate() {
            *bent = bend_reading((self.capture.level(light, pixel) - offset) * scale);
        }
    }
}
