//! The values of a pixel as the fit sees them.

use nalgebra::Vector3;

use super::lobe::Light;
use crate::Lights;
use crate::median::median;
use crate::normals::NormalMap;
use crate::readings::Readings;

/// Least standard deviation of a value that is reckoned with, of full scale: one grey level of 255.
const NOISE: f64 = 1.0 / 255.0;

/// Residual at which a light loses half its weight, relative to the pixel's mean value.
pub(super) const SCALE: f64 = 0.02;

/// Weight of a black value where the model is brighter: a cast shadow is no surprise.
pub(super) const BLACK_WEIGHT: f64 = 0.1;

/// Median of |x| of a standard normal variable.
const MEDIAN_OF_NORMAL: f64 = 0.6745;

/// Measured noise counts so many times: Cauchy's loss is then nearly as efficient as least squares.
const NOISE_FACTOR: f64 = 2.0;

/// What a value can say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// Light was measured.
    Lit,
    /// Within 2 noise levels of no light: attached or cast shadow.
    Black,
    /// At the saturation level: at least this bright.
    Clipped,
}

/// One pixel: values of full scale, at unit light intensity.
#[derive(Clone, Debug)]
pub(super) struct Observation {
    pub values: Vec<f64>,
    pub kinds: Vec<Kind>,
    pub lights: Vec<Light>,
    /// What a difference is multiplied with: 1 / root of squared mean value and squared noise over scale.
    pub weight: f64,
    /// Standard deviation of a value that is reckoned with, of full scale.
    pub noise: f64,
    /// The same as it was measured, of full scale.
    pub sigma: f64,
}

impl Observation {
    /// A weighted difference between model and value; one-sided where the value is clipped.
    #[inline]
    pub fn residual(&self, light: usize, model: f64) -> f64 {
        let residual = (model - self.values[light]) * self.weight;
        if self.kinds[light] == Kind::Clipped { residual.min(0.0) } else { residual }
    }

    /// The share that a light's cost counts with.
    #[inline]
    pub fn share(&self, light: usize) -> f64 {
        if self.kinds[light] == Kind::Black { BLACK_WEIGHT } else { 1.0 }
    }

    pub fn without(&self, light: usize) -> Self {
        let mut rest = self.clone();
        rest.values.remove(light);
        rest.kinds.remove(light);
        rest.lights.remove(light);
        rest
    }

    fn weigh(&mut self) {
        let mean = self.values.iter().sum::<f64>() / self.values.len() as f64;
        self.weight = 1.0 / mean.hypot(self.noise / SCALE);
    }
}

/// Reads observations from a capture.
pub(super) struct Reader<'a> {
    capture: &'a dyn Readings,
    lights: &'a Lights,
    /// 1 / (intensity of a light, full scale), its mean over the lights 1 / full scale.
    scales: Vec<f64>,
    /// Mean of 1 / intensity: albedo over full scale is this many times the albedo of the fit.
    pub albedo_scale: f64,
    /// Standard deviation of a value, of full scale: one grey level of 255, or more where the images are noisier.
    pub noise: f64,
    /// The same as it was measured; 0 before.
    pub sigma: f64,
}

impl<'a> Reader<'a> {
    pub fn new(capture: &'a dyn Readings, lights: &'a Lights) -> Self {
        let inverse: Vec<f64> = capture.intensities().iter().map(|intensity| 1.0 / intensity).collect();
        let albedo_scale = inverse.iter().sum::<f64>() / inverse.len() as f64;
        let unit = albedo_scale * f64::from(capture.full_scale());
        let scales = inverse.iter().map(|scale| scale / unit).collect();
        Self { capture, lights, scales, albedo_scale, noise: NOISE, sigma: 0.0 }
    }

    /// Room for a pixel, with the lights of the image centre.
    pub fn room(&self) -> Observation {
        let count = self.lights.len();
        Observation {
            values: vec![0.0; count],
            kinds: vec![Kind::Lit; count],
            lights: (0..count).map(|light| Light::new(self.lights.at(light, 0.0, 0.0).0)).collect(),
            weight: 1.0,
            noise: self.noise,
            sigma: self.sigma,
        }
    }

    pub fn read(&self, pixel: usize, into: &mut Observation) {
        let offset = self.capture.offset(pixel);
        let (x_px, y_px) = self.capture.centre(pixel);
        for light in 0..self.lights.len() {
            let mut value = f64::from(self.capture.level(light, pixel) - offset) * self.scales[light];
            if let Lights::Near { .. } = self.lights {
                let (direction, falloff) = self.lights.at(light, x_px, y_px);
                into.lights[light] = Light::new(direction);
                value /= falloff;
            }
            into.values[light] = value;
            into.kinds[light] = if self.capture.is_clipped(light, pixel) {
                Kind::Clipped
            } else if value <= 2.0 * self.noise {
                Kind::Black
            } else {
                Kind::Lit
            };
        }
        into.weigh();
    }

    /// Raises the noise to what `sample` shows, where that is more: the median second difference along the row of what a
    /// Lambertian facet leaves over. Texture and shading are smooth there or the facet's own; noise is neither.
    pub fn measure_noise(&mut self, sample: &[usize], lambertian: &NormalMap) {
        let lights = self.lights.len();
        let (_, width) = self.capture.size();
        // Three unknowns of each pixel follow the noise.
        let spread = (6.0 * (1.0 - 3.0 / lights as f64)).sqrt() * MEDIAN_OF_NORMAL;
        let mut differences = Vec::new();
        let mut observation = self.room();
        for &pixel in sample {
            let col = pixel % width;
            if col == 0 || col + 1 == width || !lambertian.mask[pixel - 1..=pixel + 1].iter().all(|&valid| valid) {
                continue;
            }
            let mut sums = vec![0.0; lights];
            for (at, factor) in [(pixel - 1, 1.0), (pixel, -2.0), (pixel + 1, 1.0)] {
                self.read(at, &mut observation);
                let scaled = start(&lambertian.normals, at) * (f64::from(lambertian.albedo[at]) / self.albedo_scale);
                for light in 0..lights {
                    let model = scaled.dot(&observation.lights[light].direction);
                    sums[light] += factor * (observation.values[light] - model);
                }
            }
            differences.extend(sums.into_iter().map(f64::abs));
        }
        if differences.is_empty() {
            return;
        }
        self.sigma = median(&mut differences, f64::total_cmp) / spread;
        self.noise = f64::max(NOISE, NOISE_FACTOR * self.sigma);
    }
}

/// The estimated normal of a pixel to start from; (0, 0, 1) where there is none.
pub(super) fn start(normals: &[f32], pixel: usize) -> Vector3<f64> {
    let at = &normals[3 * pixel..3 * pixel + 3];
    let normal = Vector3::new(f64::from(at[0]), f64::from(at[1]), f64::from(at[2]));
    if normal.x.is_nan() { Vector3::z() } else { normal.normalize() }
}
