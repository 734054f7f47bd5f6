//! Least squares on a subset of the lights.

use nalgebra::{Matrix3, Vector3};

use crate::lights::{MIN_CONDITIONING, conditioning};

/// `(L^T L)^-1` of a Gram matrix; `None` where the lights are fewer than three or (nearly) coplanar.
pub(super) fn inverse(gram: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    if conditioning(gram) < MIN_CONDITIONING { None } else { gram.try_inverse() }
}

/// `rho n` and the inverse of the Gram matrix it came from.
pub(crate) struct Solution {
    pub scaled_normal: Vector3<f64>,
    pub inverse: Matrix3<f64>,
}

/// `(L^T L)^-1 L^T I` over the lights marked in `kept`; `None` when these do not fix a normal.
pub(crate) fn solve(values: &[f32], directions: &[Vector3<f64>], kept: &[bool]) -> Option<Solution> {
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for ((&value, direction), _) in values.iter().zip(directions).zip(kept).filter(|(_, kept)| **kept) {
        gram += direction * direction.transpose();
        right += direction * f64::from(value);
    }
    let inverse = inverse(&gram)?;
    Some(Solution { scaled_normal: inverse * right, inverse })
}
