//! Ball pixels with the normals that their circles give them: what a material is fitted on.

use nalgebra::Vector3;

use super::anchor::Circle;
use super::material::{Facet, Material};
use super::scale::bend;
use crate::Lights;

/// Smallest n_z of pixels that a material is fitted on: nearer the rim the neighbours' light is strong.
pub const FIT_MIN_N_Z: f64 = 0.2;

/// About `count` of the values, evenly spaced.
pub fn spaced(values: &[usize], count: usize) -> impl Iterator<Item = &usize> {
    let step = (values.len() as f64 / count as f64).max(1.0);
    let taken = (values.len() as f64 / step) as usize;
    (0..taken).map(move |index| &values[(index as f64 * step) as usize])
}

/// Observations of some pixels under every light, on the scale of [`bend`].
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Number of lights L.
    pub lights: usize,
    /// Bent grey levels, L a pixel; at the clip level where clipped.
    pub values: Vec<f64>,
    /// Bent grey level at which each light clips.
    pub clip: Vec<f64>,
    /// Angles of each pixel's facet under each light, L a pixel.
    pub facets: Vec<Facet>,
    /// Relative irradiance of each light at each pixel, L a pixel.
    pub irradiance: Vec<f64>,
    pub normals: Vec<Vector3<f64>>,
    pub balls: Vec<usize>,
}

impl Samples {
    /// No pixels yet, for lights that clip at these linear grey levels of 255.
    pub fn new(clip_levels: &[f64]) -> Self {
        Self {
            lights: clip_levels.len(),
            clip: clip_levels.iter().map(|&level| bend(level)).collect(),
            ..Self::default()
        }
    }

    /// Adds a pixel of a ball: the normal that its circle gives it and its bent levels.
    pub fn push(&mut self, ball: usize, circle: &Circle, normal: Vector3<f64>, bent: &[f32], lights: &Lights) {
        let point = circle.point(&normal);
        for (light, &value) in bent.iter().enumerate() {
            let (direction, irradiance) = lights.at_point(light, &point);
            self.values.push(f64::from(value).min(self.clip[light]));
            self.facets.push(Facet::new(&normal, &direction));
            self.irradiance.push(irradiance);
        }
        self.normals.push(normal);
        self.balls.push(ball);
    }

    /// The pixels of one ball, every `step`-th of them.
    pub fn of_ball(&self, ball: usize, step: usize) -> Self {
        self.chosen((0..self.len()).filter(|&pixel| self.balls[pixel] == ball).step_by(step))
    }

    /// Every `step`-th pixel.
    pub fn thinned(&self, step: usize) -> Self {
        self.chosen((0..self.len()).step_by(step))
    }

    fn chosen(&self, pixels: impl Iterator<Item = usize>) -> Self {
        let mut chosen = Self { lights: self.lights, clip: self.clip.clone(), ..Self::default() };
        for pixel in pixels {
            let observations = pixel * self.lights..(pixel + 1) * self.lights;
            chosen.values.extend_from_slice(&self.values[observations.clone()]);
            chosen.facets.extend_from_slice(&self.facets[observations.clone()]);
            chosen.irradiance.extend_from_slice(&self.irradiance[observations]);
            chosen.normals.push(self.normals[pixel]);
            chosen.balls.push(self.balls[pixel]);
        }
        chosen
    }

    pub fn len(&self) -> usize {
        self.normals.len()
    }

    /// Predicted linear grey level of an observation.
    #[inline]
    pub fn brightness(&self, index: usize, light: usize, material: &Material) -> f64 {
        material.brightness(&self.facets[index]) * material.gains[light] * self.irradiance[index] + material.ambient
    }
}
