//! Balls with a flat top: within some radius all pixels have one normal, outside the ball is the sphere of its circle.

use nalgebra::Vector3;

use super::ball_normal::BallPixel;
use super::disc::{from_disc, to_disc};
use crate::median::median;

/// A flat top.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlatTop {
    /// Radius of the flat in radii of the ball.
    pub radius: f32,
    /// Its normal on the disc.
    pub point: [f32; 2],
}

/// Radii that are tried: from, to, step, in radii of the ball. A smaller flat is within the noise of a sphere's top.
const RADII: (f32, f32, f32) = (0.2, 0.8, 0.02);

/// Pixels within this radius give the normal of the flat to begin with.
const CORE: f32 = 0.3;

/// Standard deviation that is added to that of the data, in radian (0.5 degrees).
const TOLERANCE_RAD: f32 = 0.0087;

/// A squared deviation counts no more than this, in variances.
const MAX_DEVIATION2: f32 = 9.0;

/// A flat top must explain the normals better than the sphere by so much a pixel of it, and in all, in variances.
const MIN_MEAN_GAIN: f32 = 4.0;
const MIN_GAIN: f32 = 60.0;

/// Looks for a flat top in normals that were found without an expectation.
pub fn flat_top(found: &[BallPixel]) -> Option<FlatTop> {
    let mut best: Option<(f32, FlatTop)> = None;
    let mut core = CORE;
    for _ in 0..2 {
        let point = mean_point(found, core)?;
        let steps = ((RADII.1 - RADII.0) / RADII.2).round() as usize;
        for step in 0..=steps {
            let radius = RADII.0 + step as f32 * RADII.2;
            let (gain, pixels) = gain(found, point, radius);
            let enough = gain > MIN_GAIN && gain > MIN_MEAN_GAIN * pixels as f32;
            if enough && best.is_none_or(|(most, _)| gain > most) {
                best = Some((gain, FlatTop { radius, point }));
            }
        }
        core = best?.1.radius;
    }
    best.map(|(_, flat)| flat)
}

/// Distance of a pixel from the ball's centre in its radii: the length of n_xy on the sphere.
fn distance(pixel: &BallPixel) -> f32 {
    let normal = from_disc(pixel.circle_point.map(f64::from));
    normal.x.hypot(normal.y) as f32
}

/// Median normal of the pixels within a radius.
fn mean_point(found: &[BallPixel], radius: f32) -> Option<[f32; 2]> {
    let inside: Vec<&BallPixel> = found.iter().filter(|pixel| distance(pixel) < radius).collect();
    if inside.is_empty() {
        return None;
    }
    let middle = |axis: usize| {
        let mut values: Vec<f32> = inside.iter().map(|pixel| pixel.normal[axis]).collect();
        f64::from(median(&mut values, f32::total_cmp))
    };
    let (x, y) = (middle(0), middle(1));
    Some(to_disc(&Vector3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())).map(|v| v as f32))
}

/// How much better the flat explains the pixels within a radius, in variances, and their number.
fn gain(found: &[BallPixel], point: [f32; 2], radius: f32) -> (f32, usize) {
    let flat = from_disc(point.map(f64::from)).map(|v| v as f32);
    let mut sum = (0.0, 0);
    for pixel in found.iter().filter(|pixel| distance(pixel) < radius) {
        let variance = pixel.data_error_rad.powi(2) + TOLERANCE_RAD.powi(2);
        let off_flat2 = (Vector3::from(pixel.normal) - flat).norm_squared();
        let deviation2 = |squared: f32| (squared / variance).min(MAX_DEVIATION2);
        sum.0 += deviation2(pixel.off_circle_rad.powi(2)) - deviation2(off_flat2);
        sum.1 += 1;
    }
    sum
}
