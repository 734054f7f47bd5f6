//! What a material shows under one light: a diffuse part and one specular lobe, with the slope over the normal.

use nalgebra::Vector3;

use crate::reflectance::Lobe;

/// Lowest cosine between normal and half vector at which the lobe is computed; far outside any lobe.
const MIN_HALF_COSINE: f64 = 0.05;

/// Lowest `n_z` that the lobe is divided by.
const MIN_N_Z: f64 = 0.02;

/// A material relative to its diffuse albedo.
///
/// `I / (rho E) = n.l + s D G / n_z`, the Torrance-Sparrow form of Cook and Torrance (1982, eq. for R_s) with the Fresnel
/// factor and `1 / (pi m^2)` folded into the strength `s`, and V-cavities
/// `G = min(1, 2 n.h n.v / v.h, 2 n.h n.l / v.h)`; `D` is that of a [`Lobe`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Peak of the lobe over the diffuse albedo, `s`; 0 is a Lambertian surface.
    pub strength: f64,
    /// Root mean square slope of the facets, `m`.
    pub roughness: f64,
    /// Tail of the lobe, `u`: 0 Beckmann, 1 GGX.
    pub tail: f64,
}

/// One light as a pixel sees it: direction and half vector, both of length 1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    pub direction: Vector3<f64>,
    pub half: Vector3<f64>,
}

impl Light {
    pub fn new(direction: Vector3<f64>) -> Self {
        Self { direction, half: (direction + Vector3::z()).normalize() }
    }
}

impl Material {
    /// A Lambertian surface.
    pub const MATTE: Self = Self { strength: 0.0, roughness: 0.3, tail: 0.5 };

    /// Value at unit albedo.
    pub(super) fn shade(&self, normal: &Vector3<f64>, light: &Light) -> f64 {
        self.shade_and_slope(normal, light).0
    }

    /// Value at unit albedo and its gradient over the three components of the normal.
    #[inline]
    pub(super) fn shade_and_slope(&self, normal: &Vector3<f64>, light: &Light) -> (f64, Vector3<f64>) {
        let toward_light = normal.dot(&light.direction);
        if toward_light <= 0.0 {
            return (0.0, Vector3::zeros());
        }
        let cosine = normal.dot(&light.half);
        if self.strength <= 0.0 || cosine < MIN_HALF_COSINE {
            return (toward_light, light.direction);
        }
        let n_z = normal.z.max(MIN_N_Z);
        let lobe = Lobe { strength: self.strength, roughness: self.roughness, tail: self.tail };
        let [facets, .., log_slope] = lobe.distribution(cosine);
        let view_half = light.half.z;
        let (toward_view, away) = (2.0 * cosine * n_z / view_half, 2.0 * cosine * toward_light / view_half);
        // ln G over the cosine of the half vector, n_z and n.l.
        let (masking, over_cosine, over_n_z, over_light) = if toward_view.min(away) >= 1.0 {
            (1.0, 0.0, 0.0, 0.0)
        } else if toward_view < away {
            (toward_view, 1.0 / cosine, 1.0 / n_z, 0.0)
        } else {
            (away, 1.0 / cosine, 0.0, 1.0 / toward_light)
        };
        let lobe = self.strength * facets * masking / n_z;
        let mut slope = light.half * (lobe * (log_slope + over_cosine)) + light.direction * (1.0 + lobe * over_light);
        if normal.z > MIN_N_Z {
            slope.z += lobe * (over_n_z - 1.0 / n_z);
        }
        (toward_light + lobe, slope)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_is_that_of_finite_differences() {
        let light = Light::new(Vector3::new(0.5, 0.2, 0.8).normalize());
        for tail in [0.0, 0.5, 1.5] {
            let material = Material { strength: 1.3, roughness: 0.3, tail };
            for normal in [Vector3::new(0.1, 0.3, 0.9), Vector3::new(-0.5, 0.2, 0.4), Vector3::new(0.9, 0.3, 0.2)] {
                let normal = normal.normalize();
                let (_, slope) = material.shade_and_slope(&normal, &light);
                for axis in 0..3 {
                    let mut step = Vector3::zeros();
                    step[axis] = 1e-6;
                    let change = material.shade(&(normal + step), &light) - material.shade(&(normal - step), &light);
                    approx::assert_relative_eq!(slope[axis], change / 2e-6, epsilon = 1e-5, max_relative = 1e-5);
                }
            }
        }
    }
}
