//! Images of balls by the material model, for benches and tests.

use bgars_core::Lights;
use bgars_core::reflectance::{Circle, Lobe, Masking, Material};
use nalgebra::Vector3;

/// Paper-like solder: diffuse light and one strong lobe.
#[must_use]
pub fn solder(lights: usize) -> Material {
    Material {
        diffuse: 150.0,
        grazing: 0.0,
        ambient: 0.0,
        lobes: vec![Lobe { strength: 700.0, roughness: 0.3, tail: 0.0 }],
        masking: Masking::Smith,
        gains: vec![1.0; lights],
    }
}

/// Equal balls on a square grid that fills an image of `side` x `side` pixels.
#[must_use]
pub fn grid(side: usize, balls_a_row: usize, radius_px: f64) -> Vec<Circle> {
    let pitch = side as f64 / balls_a_row as f64;
    let at = |index: usize| (index as f64 + 0.5) * pitch - side as f64 / 2.0;
    (0..balls_a_row * balls_a_row)
        .map(|ball| Circle::exact(at(ball % balls_a_row), at(ball / balls_a_row), radius_px))
        .collect()
}

/// Images of balls on a black board, rounded to whole grey levels of 255 and clipped. `shape(ball, normal)` turns the normal
/// of the sphere into that of the ball.
#[must_use]
pub fn photograph(
    side: usize,
    lights: &Lights,
    circles: &[Circle],
    material: &Material,
    shape: impl Fn(usize, Vector3<f64>) -> Vector3<f64>,
) -> Vec<u8> {
    let mut images = vec![0; lights.len() * side * side];
    for (ball, circle) in circles.iter().enumerate() {
        let (rows, cols) = circle.window(side, side);
        for (row, col) in rows.flat_map(|row| cols.clone().map(move |col| (row, col))) {
            let (x, y) = (col as f64 + 0.5 - side as f64 / 2.0, side as f64 / 2.0 - row as f64 - 0.5);
            let Some(sphere) = circle.normal(x, y) else { continue };
            let normal = shape(ball, sphere);
            for light in 0..lights.len() {
                let (direction, irradiance) = lights.at_point(light, &circle.point(&sphere));
                let level = material.radiance(light, &normal, &direction, irradiance);
                images[(light * side + row) * side + col] = level.round().clamp(0.0, 255.0) as u8;
            }
        }
    }
    images
}
