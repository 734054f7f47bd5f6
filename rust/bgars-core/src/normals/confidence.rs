//! How far a least-squares normal can be trusted, as one number.

use nalgebra::{Matrix3, Vector3};

/// Standard error of the direction at which the confidence is one half, degrees.
pub(super) const HALF_DEG: f64 = 5.0;

/// Residual a Lambertian fit is assumed to have at least, relative to the albedo: what a fit without redundancy is worth.
pub(super) const PRIOR_RESIDUAL: f64 = 0.02;

/// Independent values that a misfit has to show itself in, however many lights there are: the five harmonics of second order.
///
/// What a matt model misses is a smooth function of the light's direction: neighbouring lights miss alike, and their number adds
/// nothing. Lambert's cosine passes what is of second order and hardly anything above (Basri, Jacobs, "Lambertian reflectance and
/// linear subspaces", IEEE Trans. PAMI 25, 2003, section 3.2).
pub(crate) const MISFIT_MODES: f64 = 5.0;

/// Variance of a misfit of first order, which turns the normal and leaves no residual, over that of one of second order, which
/// leaves one: the squared ratio of the cosine's coefficients, `(2 pi / 3) / (pi / 4)` (ibid., eq. 11).
pub(crate) const HIDDEN_MISFIT: f64 = 64.0 / 9.0;

/// Residual degrees of freedom of so many lights for what the model misses, the prior's one with them.
#[inline]
pub(crate) fn misfit_freedom(lights: f64) -> f64 {
    (lights - 2.0).min(MISFIT_MODES + 1.0) / HIDDEN_MISFIT
}

/// `1 / (1 + (s / 5 deg)^2)` with `s` the standard error of the direction of `solution = rho n`.
///
/// s^2 = sigma^2 (tr C - n^T C n) / rho^2, C = (L^T L)^-1 (the part of the covariance that turns the normal),
/// sigma^2 = 7.1 (sum of squared residuals + (0.02 rho)^2) / min(kept - 3 + 1, 5 + 1): the residual of the fit, taken for a misfit
/// of the model ([`HIDDEN_MISFIT`], [`MISFIT_MODES`]), drawn by one degree of freedom to 2 % of the albedo so that three kept
/// lights, whose residual is zero, are not taken for perfect.
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
    let variance = (squared_residuals + prior * prior) / misfit_freedom(lights_kept as f64);
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
    fn the_half_way_point_is_a_residual_whose_hidden_part_turns_the_normal_by_five_degrees() {
        // Eight ring lights at 45 degrees: C = diag(1/2, 1/2, 1/4); sigma of 5 deg in the direction needs sigma = rho tan(5 deg).
        let inverse = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 0.25));
        let sigma = HALF_DEG.to_radians();
        let sum = sigma * sigma * 6.0 / HIDDEN_MISFIT - PRIOR_RESIDUAL * PRIOR_RESIDUAL;
        let value = confidence(&Vector3::new(0.0, 0.0, 1.0), &inverse, sum, 8);
        approx::assert_relative_eq!(value, 0.5, epsilon = 1e-6);
    }

    #[test]
    fn more_lights_of_the_same_misfit_are_not_trusted_more() {
        // Three times the lights: a third of the covariance, three times the sum of squared residuals.
        let inverse = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 0.25));
        let normal = Vector3::new(0.0, 0.0, 1.0);
        let prior = PRIOR_RESIDUAL * PRIOR_RESIDUAL;
        let few = confidence(&normal, &inverse, 0.1 - prior, 8);
        let many = confidence(&normal, &(inverse / 3.0), 0.3 - prior, 24);
        approx::assert_relative_eq!(few, many, max_relative = 1e-6);
    }

    #[test]
    fn three_lights_are_trusted_less_than_eight_without_residual() {
        let inverse = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 0.25));
        let normal = Vector3::new(0.0, 0.0, 100.0);
        assert!(confidence(&normal, &inverse, 0.0, 3) < confidence(&normal, &inverse, 0.0, 8));
    }
}
