//! What a pixel near the rim of a ball reads: a step and a root, averaged over the pixel and blurred.

use std::f64::consts::FRAC_PI_4;

use rayon::prelude::*;

/// Depth profiles: step, square root and ramp inside the rim, ramp outside; then their derivatives by depth.
pub const PROFILES: usize = 8;
/// Directions of the rim, over an eighth of the circle.
pub const ANGLES: usize = 16;
/// Depths of the table a pixel.
pub const STEPS_PER_PX: f64 = 64.0;
/// Thinnest box: below, the differences of repeated integrals drown in rounding.
const THINNEST_PX: f64 = 0.08;

/// Depth profiles averaged over a square pixel and a Gaussian blur, one row a depth from the deepest outside to the deepest
/// inside, direction after direction.
///
/// # Inputs
/// `blur_px` is the standard deviation of the lens blur, `reach_px` the largest depth.
///
/// # Method
/// Near the rim of a sphere `n_z = sqrt(2 t / R)` with `t` the depth inside the silhouette, so radiance is a series in
/// `sqrt(t)` there. A pixel averages it over a box; along a direction the box is two boxes of widths |cos| and |sin|, one
/// after the other; two more with the variance of the blur stand for the Gaussian. Averages over boxes are differences of
/// repeated integrals, in closed form for powers of `t`.
///
/// # Examples
/// ```
/// use bgars_core::rims::{ANGLES, profiles};
/// let table = profiles(0.3, 9.0);
/// assert_eq!(table.len(), ANGLES * (2 * 9 * 64 + 1));
/// let [step, root, ..] = table[(9 + 4) * 64];
/// assert!((step - 1.0).abs() < 1e-6 && (root - 2.0).abs() < 0.01);
/// assert!(table[(9 - 4) * 64][0].abs() < 1e-6);
/// ```
#[must_use]
pub fn profiles(blur_px: f64, reach_px: f64) -> Vec<[f32; PROFILES]> {
    let half = (reach_px * STEPS_PER_PX).ceil();
    let depths = 2 * half as usize + 1;
    let soft = 6f64.sqrt() * blur_px;
    let mut values = vec![[0.0; PROFILES]; ANGLES * depths];
    values.par_chunks_mut(depths).enumerate().for_each(|(angle, values)| {
        let angle = angle as f64 * (FRAC_PI_4 / (ANGLES - 1) as f64);
        let boxes = Boxes::new([angle.cos(), angle.sin(), soft, soft].map(|width| width.max(THINNEST_PX)));
        for (place, values) in values.iter_mut().enumerate() {
            *values = boxes.average((place as f64 - half) / STEPS_PER_PX).map(|value| value as f32);
        }
    });
    values
}

/// Four boxes, one after the other: the signed shifts at which the repeated integrals are taken.
struct Boxes([(f64, f64); 16]);

impl Boxes {
    fn new(widths_px: [f64; 4]) -> Self {
        let volume: f64 = widths_px.iter().product();
        Self(std::array::from_fn(|corner| {
            let signs: [f64; 4] = std::array::from_fn(|bit| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 });
            let shift: f64 = (0..4).map(|bit| signs[bit] * widths_px[bit] / 2.0).sum();
            (shift, signs.iter().product::<f64>() / volume)
        }))
    }

    /// Averages around a depth.
    fn average(&self, depth_px: f64) -> [f64; PROFILES] {
        let mut sums = [0.0; PROFILES];
        for &(shift, weight) in &self.0 {
            let inside = (depth_px + shift).max(0.0);
            let outside = (-depth_px - shift).max(0.0);
            let root = inside.sqrt();
            let cube = inside * inside * inside;
            let square = outside * outside;
            let outer = square * square;
            let fourth = cube * inside;
            sums[0] += weight / 24.0 * fourth;
            sums[1] += weight * 16.0 / 945.0 * (fourth * root);
            sums[2] += weight / 120.0 * (fourth * inside);
            sums[3] += weight / 120.0 * (outer * outside);
            sums[4] += weight / 6.0 * cube;
            sums[5] += weight * 8.0 / 105.0 * (cube * root);
            sums[6] += weight / 24.0 * fourth;
            sums[7] -= weight / 24.0 * outer;
        }
        sums
    }
}
