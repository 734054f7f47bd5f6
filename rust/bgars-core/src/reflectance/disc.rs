//! Normals toward the camera on a disc of equal area (Lambert's azimuthal projection), radius 1 where n_z = 0.

use nalgebra::Vector3;

/// `(a, b) = n_xy / sqrt(1 + n_z)`.
#[inline]
pub fn to_disc(normal: &Vector3<f64>) -> [f64; 2] {
    let scale = (1.0 + normal.z).sqrt().recip();
    [normal.x * scale, normal.y * scale]
}

/// The unit normal of a point of the disc; points outside are moved to its edge.
#[inline]
pub fn from_disc([a, b]: [f64; 2]) -> Vector3<f64> {
    let radius2 = a * a + b * b;
    if radius2 > 1.0 {
        let length = radius2.sqrt();
        return Vector3::new(a / length, b / length, 0.0);
    }
    let scale = (2.0 - radius2).sqrt();
    Vector3::new(a * scale, b * scale, 1.0 - radius2)
}

/// How `(a, b)` moves with the direction: for a displacement `(da, db)` the angle squared in radian^2 is
/// `g0 da^2 + 2 g1 da db + g2 db^2`.
#[inline]
pub fn metric([a, b]: [f64; 2]) -> [f64; 3] {
    // n_xy = s (a, b), s^2 = 2 - r^2, n_z = 1 - r^2: ds = -(a da + b db) / s.
    let radius2 = (a * a + b * b).min(0.999);
    let s2 = 2.0 - radius2;
    // |dn|^2 = s^2 |dp|^2 + 2 s ds (p.dp) + ds^2 r^2 + 4 (p.dp)^2 = s^2 |dp|^2 + (p.dp)^2 (2 + r^2 / s^2)
    let k = 2.0 + radius2 / s2;
    [s2 + k * a * a, k * a * b, s2 + k * b * b]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_and_the_normals_are_inverse_and_the_metric_is_the_angle() {
        for point in [[0.0, 0.0], [0.3, -0.2], [-0.6, 0.55], [0.0, 0.95]] {
            let normal = from_disc(point);
            approx::assert_relative_eq!(normal.norm(), 1.0, epsilon = 1e-12);
            let back = to_disc(&normal);
            approx::assert_relative_eq!(back[0], point[0], epsilon = 1e-12);
            approx::assert_relative_eq!(back[1], point[1], epsilon = 1e-12);
            let [g0, g1, g2] = metric(point);
            for (da, db) in [(1e-5, 0.0), (0.0, 1e-5), (1e-5, -1e-5)] {
                let angle2 = (from_disc([point[0] + da, point[1] + db]) - normal).norm_squared();
                approx::assert_relative_eq!(
                    angle2,
                    g0 * da * da + 2.0 * g1 * da * db + g2 * db * db,
                    max_relative = 1e-3
                );
            }
        }
    }
}
