//! Light stacks to estimate normals from.

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMap, estimate};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};

/// Images of a wavy Lambertian surface with a highlight, one after the other, and the ring of lights they were made with.
///
/// `convert` makes a pixel of an intensity in 0..=1. Slopes and highlights change from pixel to pixel, so that no branch is
/// always taken the same way.
pub fn wavy<P>(lights: usize, side: usize, convert: impl Fn(f32) -> P) -> (Vec<P>, Lights) {
    let directions: Vec<[f64; 3]> = (0..lights)
        .map(|light| {
            let azimuth = std::f64::consts::TAU * light as f64 / lights as f64;
            let s = 0.5f64.sqrt();
            [s * azimuth.cos(), s * azimuth.sin(), s]
        })
        .collect();
    let slopes = |period: f32| -> Vec<f32> { (0..side).map(|pixel| (pixel as f32 / period).sin()).collect() };
    let (p, q) = (slopes(40.0), slopes(55.0));
    let mut images = Vec::with_capacity(lights * side * side);
    for light in &directions {
        let [lx, ly, lz] = light.map(|component| component as f32);
        for &q in &q {
            images.extend(p.iter().map(|&p| {
                let cosine = (lx * p + ly * q + lz) / (1.0 + p * p + q * q).sqrt();
                let lobe = (cosine - 0.97).max(0.0) / 0.03;
                convert((0.5 * cosine.max(0.0) + 0.5 * lobe).min(1.0))
            }));
        }
    }
    (images, Lights::directional(&directions).unwrap())
}

/// Unit vectors on a ring, tilted a little from light to light so that no two subsets are alike.
#[must_use]
pub fn tilted_ring(count: usize, elevation_deg: f64) -> Vec<[f64; 3]> {
    (0..count)
        .map(|light| {
            let azimuth = std::f64::consts::TAU * light as f64 / count as f64;
            let elevation = (elevation_deg + 7.0 * ((light * light) % 3) as f64).to_radians();
            [elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin()]
        })
        .collect()
}

/// Normals of images of one row, of a linear camera, with the kept lights.
#[must_use]
pub fn estimate_row<P: Pixel>(
    images: &[P],
    lights: &Lights,
    mask: Option<&[bool]>,
    method: Method,
    full_scale: f32,
) -> NormalMap {
    let width = images.len() / lights.len();
    let stack = ImageStack::new(images, lights.len(), 1, width).unwrap();
    let radiometry = Radiometry::linear(lights.len(), full_scale);
    estimate(&stack, lights, &radiometry, mask, method, true, &mut |_| ControlFlow::Continue(())).unwrap()
}
