//! Light stacks to estimate normals from.

use bgars_core::Lights;

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
