//! How far a least-squares normal can be trusted, as one number.

use nalgebra::{Matrix3, Vector3};

/// Standard error of the direction at which the confidence is one half, degrees.
pub(super) const HALF_DEG: f64 = 5.0;

/// Residual a Lambertian fit is assumed to have at least, relative to the albedo: what a fit without redundancy is worth.
pub(super) const PRIOR_RESIDUAL: f64 = 0.02;

/// `1 / (1 + (s / 5 deg)^2)` with `s` the standard error of the direction of `solution = rho n`.
///
/// s^2 = sigma^2 (tr C - n^T C n) / rho^2, C = (L^T L)^-1 (the part of the covariance that turns the normal),
/// sigma^2 = (sum of squared residuals + (0.02 rho)^2) / (kept - 3 + 1): the residual of the fit, drawn by one degree of
/// freedom to 2 % of the albedo so that three kept lights, whose residual is zero, are not taken for perfect.
#[inline]
pub(super) fn confidence(
    solution: &Vector3<f64>,
    inverse: &Matrix3<f64>,
    squared_residuals: f64,
    lights_kept: usize,
) -> f32 {
    let albedo = solution.norm();
    let normal = solution / albedo;
    let prior = PRIOR_RESIDUAL * albedo;
    let variance = (squared_residuals + prior * prior) / (lights_kept as f64 - 2.0);
    let turning = inverse.trace() - normal.dot(&(inverse * normal));
    let standard_error_deg = (variance * turning.max(0.0)).sqrt().to_degrees() / albedo;
    confidence_of(standard_error_deg)
}

/// `1 / (1 + (s / 5 deg)^2)` of a standard error in degrees.
#[inline]
pub(crate) fn confidence_of(standard_error_deg: f64) -> f32 {
    let ratio = standard_error_deg / HALF_DEG;
    (1.0 / (1.0 + ratio * ratio)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn residual_of_one_twentieth_of_the_albedo_is_near_the_half_way_point() {
        // Eight ring lights at 45 degrees: C = diag(1/2, 1/2, 1/4); sigma of 5 deg in the direction needs sigma = rho tan(5 deg).
        let inverse = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 0.25));
        let sigma = HALF_DEG.to_radians();
        let sum = sigma * sigma * 6.0 - PRIOR_RESIDUAL * PRIOR_RESIDUAL;
        let value = confidence(&Vector3::new(0.0, 0.0, 1.0), &inverse, sum, 8);
        approx::assert_relative_eq!(value, 0.5, epsilon = 1e-6);
    }

    #[test]
    fn three_lights_are_trusted_less_than_eight_without_residual() {
        let inverse = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 0.25));
        let normal = Vector3::new(0.0, 0.0, 100.0);
        assert!(confidence(&normal, &inverse, 0.0, 3) < confidence(&normal, &inverse, 0.0, 8));
    }
}
