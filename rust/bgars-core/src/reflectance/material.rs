//! The material of a part: diffuse light, one or two specular lobes, as the camera sees it under one light.

use nalgebra::Vector3;

/// Smallest n_z at which a facet is evaluated: nearer the rim a pixel mixes ball and board.
pub const MIN_N_Z: f64 = 0.02;

/// Products of tail and `tan^2 a / m^2` below which the distribution is Beckmann's by its series.
const SERIES: f64 = 1e-4;

/// Exponents of a distribution below which it is 0.
const NOTHING_LEFT: f64 = -30.0;

/// Which geometric attenuation of the microfacets is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Masking {
    /// V-cavities: `min(1, 2 nh nv / vh, 2 nh nl / vh)` (Cook and Torrance 1982, section 3).
    CookTorrance,
    /// Independent microfacets, `G1(v) G1(l)` (Walter et al. 2007, eqs. 27 and 34).
    Smith,
}

/// One specular lobe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// Grey levels of 255 at the peak of the lobe, where the camera looks along the normal.
    pub strength: f64,
    /// Roughness m: root mean square slope of the microfacets.
    pub roughness: f64,
    /// Weight of the tail, 0 Beckmann to 1 GGX.
    pub tail: f64,
}

impl Lobe {
    /// Distribution of microfacets, 1 at its peak, `t = tan^2 a / m^2`:
    /// `D = (1 + u t)^-(1 + 1/u) / cos^4 a`: Beckmann (Cook and Torrance 1982, eq. 4) for u = 0, GGX (Walter et al. 2007, eq. 33)
    /// for u = 1; its derivatives by the logarithm of the roughness and by the tail; and that of its logarithm by the cosine.
    #[must_use]
    #[inline(always)]
    pub fn distribution(&self, cos_half: f64) -> [f64; 4] {
        if cos_half <= 1e-3 {
            return [0.0; 4];
        }
        let (cos2, u) = (cos_half * cos_half, self.tail);
        let t = (1.0 - cos2).max(0.0) / (cos2 * self.roughness * self.roughness);
        let (bulge, log) = (1.0 + u * t, (u * t).ln_1p());
        let exponent = if u * t < SERIES { -t * (1.0 + u) } else { -(1.0 + 1.0 / u) * log };
        if exponent < NOTHING_LEFT {
            return [0.0; 4];
        }
        // The exponent's derivatives by t, and by u; the limit of that where u t is small.
        let by_t = -(1.0 + u) / bulge;
        let by_tail = if u * t < SERIES { t * (0.5 * t - 1.0) } else { log / (u * u) - (1.0 + 1.0 / u) * t / bulge };
        let t_by_cosine = -2.0 / (self.roughness.powi(2) * cos2 * cos_half);
        let value = exponent.exp() / (cos2 * cos2);
        [value, value * -2.0 * t * by_t, value * by_tail, by_t * t_by_cosine - 4.0 / cos_half]
    }

    /// Shadowing of one direction at cosine `cos` to the normal, between Beckmann's (rational form) and GGX's, by the tail; its
    /// derivative by the logarithm of the roughness, and that by the tail.
    #[must_use]
    #[inline(always)]
    pub fn smith(&self, cos: f64) -> [f64; 3] {
        let tan = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        let slope = self.roughness * tan;
        let root = (1.0 + slope * slope).sqrt();
        let ggx = 2.0 / (1.0 + root);
        let d_ggx = -0.5 * ggx * ggx * slope * slope / root;
        let c = 1.0 / slope.max(1e-9);
        let (beckmann, d_beckmann) = if c < 1.6 {
            let (above, below) = (3.535 * c + 2.181 * c * c, 1.0 + 2.276 * c + 2.577 * c * c);
            let by_c = (3.535 + 4.362 * c - (2.276 + 5.154 * c) * above / below) / below;
            (above / below, -c * by_c)
        } else {
            (1.0, 0.0)
        };
        let mixed = |beckmann: f64, ggx: f64| beckmann + self.tail * (ggx - beckmann);
        [mixed(beckmann, ggx), mixed(d_beckmann, d_ggx), ggx - beckmann]
    }
}

/// The angles of a facet that its brightness depends on.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// N.L
    pub n_dot_l: f64,
    /// N.V = n_z
    pub n_dot_v: f64,
    /// N.H
    pub n_dot_h: f64,
    /// V.H
    pub v_dot_h: f64,
}

impl Facet {
    /// From a unit normal and a unit vector to the light.
    #[must_use]
    #[inline]
    pub fn new(normal: &Vector3<f64>, light: &Vector3<f64>) -> Self {
        let half = Vector3::new(light.x, light.y, light.z + 1.0);
        let length = half.norm().max(1e-9);
        Self {
            n_dot_l: normal.dot(light),
            n_dot_v: normal.z.max(MIN_N_Z),
            n_dot_h: normal.dot(&half) / length,
            v_dot_h: half.z / length,
        }
    }

    /// Specular light of a lobe of strength 1, 0 in attached shadow; its derivative by the logarithm of the roughness, and that by
    /// the tail. Inlined, so that nothing is computed that nobody takes.
    #[must_use]
    #[inline(always)]
    pub fn specular(&self, lobe: &Lobe, masking: Masking) -> [f64; 3] {
        if self.n_dot_l <= 0.0 {
            return [0.0; 3];
        }
        let [value, by_roughness, by_tail, _] = lobe.distribution(self.n_dot_h);
        if value == 0.0 {
            return [0.0; 3];
        }
        let slopes = [value, by_roughness, by_tail].map(|slope| slope / self.n_dot_v);
        match masking {
            Masking::CookTorrance => {
                let factor = 2.0 * self.n_dot_h / self.v_dot_h;
                slopes.map(|slope| slope * (factor * self.n_dot_v.min(self.n_dot_l)).min(1.0))
            }
            Masking::Smith => [self.n_dot_v, self.n_dot_l]
                .into_iter()
                .map(|cos| lobe.smith(cos))
                .fold(slopes, |[f, f_m, f_u], [g, g_m, g_u]| [f * g, f_m * g + f * g_m, f_u * g + f * g_u]),
        }
    }

    /// Diffuse light of strength 1 without and with the loss at grazing angles:
    /// `1.35 (1 - (1 - N.L/2)^5)(1 - (1 - N.V/2)^5)` (Ashikhmin and Shirley 2000, eq. 5), relative to Lambert.
    #[must_use]
    #[inline]
    pub fn grazing(&self) -> f64 {
        let half = |cos: f64| 1.0 - (1.0 - 0.5 * cos).powi(5);
        1.35 * half(self.n_dot_l.max(0.0)) * half(self.n_dot_v)
    }
}

/// What a part's surface does with light, under the lights of one rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Grey levels of 255 of a diffuse facet that faces the light: 255 I_d.
    pub diffuse: f64,
    /// Weight of the loss of diffuse light at grazing angles; 0 for Lambert.
    pub grazing: f64,
    /// Grey levels of 255 that are there without a light.
    pub ambient: f64,
    /// One or two specular lobes.
    pub lobes: Vec<Lobe>,
    /// Geometric attenuation of the lobes.
    pub masking: Masking,
    /// Brightness of each light against the rig's; 1 where the rig is right.
    pub gains: Vec<f64>,
}

impl Material {
    /// Grey levels of 255 of a facet under light `light` with relative irradiance `irradiance`, no clipping:
    /// `g (255 I_d N.L [1 + k (A - 1)] + 255 sum_j I_j D_j G / N.V) + B`.
    ///
    /// # Examples
    /// ```
    /// use bgars_core::reflectance::{Lobe, Masking, Material};
    /// use nalgebra::Vector3;
    /// let lobe = Lobe { strength: 100.0, roughness: 0.2, tail: 0.0 };
    /// let material =
    ///     Material { diffuse: 50.0, grazing: 0.0, ambient: 0.0, lobes: vec![lobe], masking: Masking::Smith, gains: vec![1.0] };
    /// let up = Vector3::z();
    /// assert_eq!(material.radiance(0, &up, &up, 1.0), 150.0); // facing camera and light: the peak of both
    /// ```
    #[must_use]
    pub fn radiance(&self, light: usize, normal: &Vector3<f64>, direction: &Vector3<f64>, irradiance: f64) -> f64 {
        self.gains[light] * irradiance * self.brightness(&Facet::new(normal, direction)) + self.ambient
    }

    /// Grey levels of a facet at gain and irradiance 1, ambient light left out.
    #[must_use]
    #[inline]
    pub fn brightness(&self, facet: &Facet) -> f64 {
        let mut sum = self.diffuse * facet.n_dot_l.max(0.0);
        if self.grazing != 0.0 {
            sum *= 1.0 + self.grazing * (facet.grazing() - 1.0);
        }
        for lobe in &self.lobes {
            sum += lobe.strength * facet.specular(lobe, self.masking)[0];
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_are_those_of_the_specular_light() {
        let step = 1e-6;
        for masking in [Masking::CookTorrance, Masking::Smith] {
            for (roughness, tail) in [(0.1, 0.3), (0.35, 0.9), (0.8, 0.02), (0.2, 1e-7)] {
                let lobe = Lobe { strength: 1.0, roughness, tail };
                for (x, y) in [(0.0, 0.1), (0.3, -0.2), (0.6, 0.5), (-0.4, 0.85)] {
                    let normal = Vector3::new(x, y, (1.0f64 - x * x - y * y).sqrt());
                    let facet = Facet::new(&normal, &Vector3::new(0.6, 0.0, 0.8));
                    let [value, by_roughness, by_tail] = facet.specular(&lobe, masking);
                    let at = |roughness: f64, tail: f64| facet.specular(&Lobe { roughness, tail, ..lobe }, masking)[0];
                    approx::assert_relative_eq!(value, at(roughness, tail), max_relative = 1e-12);
                    let wider =
                        (at(roughness * (1.0 + step), tail) - at(roughness * (1.0 - step), tail)) / (2.0 * step);
                    approx::assert_relative_eq!(by_roughness, wider, max_relative = 1e-5, epsilon = 1e-9);
                    // Beside a tail of nothing the step must leave the series.
                    let (low, high) = if tail > step { (tail - step, tail + step) } else { (1e-4, 1.01e-4) };
                    let longer = (at(roughness, high) - at(roughness, low)) / (high - low);
                    approx::assert_relative_eq!(by_tail, longer, max_relative = 2e-2, epsilon = 1e-7);
                }
            }
        }
    }
}
