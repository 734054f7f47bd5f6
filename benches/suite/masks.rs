//! Masks to integrate over, and the normals of one wavy surface.

/// A full image.
#[must_use]
pub fn rectangle(side: usize) -> Vec<bool> {
    vec![true; side * side]
}

/// A disc as wide as the image with round holes, twelve across.
#[must_use]
pub fn disc_with_holes(side: usize) -> Vec<bool> {
    let pitch = side as f64 / 12.0;
    let middle = (side as f64 - 1.0) / 2.0;
    let pixel = |index: usize| ((index % side) as f64, (index / side) as f64);
    let used = |index| {
        let (x, y) = pixel(index);
        let hole = (x % pitch - pitch / 2.0).hypot(y % pitch - pitch / 2.0) < 0.2 * pitch;
        (x - middle).hypot(y - middle) < 0.48 * side as f64 && !hole
    };
    (0..side * side).map(used).collect()
}

/// Unit normals of long and short waves, 3 values a pixel.
#[must_use]
pub fn wavy_normals(side: usize) -> Vec<f32> {
    let turn = std::f64::consts::TAU;
    let slope = |pixel: usize, period: f64| {
        let along = pixel as f64;
        0.35 * (turn * along / side as f64).cos() + 0.25 * (turn * along / period).cos()
    };
    let p: Vec<f64> = (0..side).map(|col| slope(col, 37.0)).collect();
    let mut normals = Vec::with_capacity(side * side * 3);
    for row in 0..side {
        let q = slope(row, 53.0);
        for &p in &p {
            let inverse = 1.0 / (1.0 + p * p + q * q).sqrt();
            normals.extend([-p * inverse, -q * inverse, inverse].map(|component| component as f32));
        }
    }
    normals
}

/// Heights that go with no pattern a writer could profit from, in pixels.
#[must_use]
pub fn wavy_heights(side: usize) -> Vec<f32> {
    let height = |index: usize| {
        let (x, y) = ((index % side) as f32, (index / side) as f32);
        20.0 * (x / 37.0).sin() * (y / 53.0).cos()
    };
    (0..side * side).map(height).collect()
}
