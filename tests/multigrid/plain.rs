//! Fields, masks, and the system of both as a plain matrix.

use nalgebra::{DMatrix, DVector};

/// Numbers in -0.5 .. 0.5 from a linear congruence.
pub fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64 - 0.5
    }
}

/// Noisy normals of a wavy surface, so that every frequency has to be solved for.
pub fn wavy_normals(height: usize, width: usize, seed: u64) -> Vec<f32> {
    let mut noise = noise(seed);
    let mut normals = Vec::with_capacity(height * width * 3);
    for row in 0..height {
        for col in 0..width {
            let (u, v) = (col as f64 * 20.0 / width as f64, row as f64 * 20.0 / height as f64);
            let (p, q) = (0.6 * u.sin() * v.cos() + 0.1 * noise(), 0.6 * (v + u).cos() + 0.1 * noise());
            let length = (1.0 + p * p + q * q).sqrt();
            normals.extend([-p / length, -q / length, 1.0 / length].map(|component| component as f32));
        }
    }
    normals
}

/// `inside(x, y)` with the image centre as origin and half the height as unit.
pub fn mask(height: usize, width: usize, inside: impl Fn(f64, f64) -> bool) -> Vec<bool> {
    let unit = height as f64 / 2.0;
    (0..height * width)
        .map(|pixel| {
            let (row, col) = (pixel / width, pixel % width);
            inside((col as f64 + 0.5 - width as f64 / 2.0) / unit, (unit - row as f64 - 0.5) / unit)
        })
        .collect()
}

pub fn disc_with_holes(x: f64, y: f64) -> bool {
    let from_hole = |coordinate: f64, shift: f64| (coordinate * 4.0 + shift).rem_euclid(1.0) - 0.5;
    x.hypot(y) < 0.96 && from_hole(x, 0.3).hypot(from_hole(y, 0.1)) > 0.2
}

/// A disc with cuts of one pixel: straight, slanted, and a frame around an island.
pub fn slits(size: usize) -> impl Fn(f64, f64) -> bool {
    let pixel = 2.0 / size as f64;
    move |x, y| {
        let on = |distance: f64| distance.abs() < 0.51 * pixel;
        let straight = on(x + 0.26) && y < 0.4 || on(y + 0.42) && x > -0.6;
        let slanted = (y - 0.37 * x - 0.22).abs() < 0.7 * pixel && x.abs() < 0.6;
        let (u, v) = (x - 0.45, y + 0.05);
        let frame = on(u.abs().max(v.abs()) - 0.15);
        x.hypot(y) < 0.96 && !straight && !slanted && !frame
    }
}

/// The graph Laplacian of the mask with weights `n_z^2`, edge by edge, and its right side.
pub fn slow_system(normals: &[f32], mask: &[bool], width: usize) -> (DMatrix<f64>, DVector<f64>) {
    let pixels = mask.len();
    let mut matrix = DMatrix::zeros(pixels, pixels);
    let mut right = DVector::zeros(pixels);
    let mut edge = |a: usize, b: usize, axis: usize, sign: f64| {
        if mask[a] && mask[b] {
            let mean = |axis: usize| f64::midpoint(f64::from(normals[3 * a + axis]), f64::from(normals[3 * b + axis]));
            let (weight, step) = (mean(2) * mean(2), -sign * mean(axis) / mean(2));
            matrix[(a, a)] += weight;
            matrix[(b, b)] += weight;
            matrix[(a, b)] -= weight;
            matrix[(b, a)] -= weight;
            right[a] -= weight * step;
            right[b] += weight * step;
        }
    };
    for pixel in 0..pixels {
        if pixel % width + 1 < width {
            edge(pixel, pixel + 1, 0, 1.0);
        }
        if pixel + width < pixels {
            edge(pixel, pixel + width, 1, -1.0);
        }
    }
    (matrix, right)
}
