//! Least squares on a subset of the lights.

use nalgebra::{Matrix3, Vector3};

use crate::lights::{MIN_CONDITIONING, conditioning};

/// The Gram matrix `L^T L` of a subset of lights, as a solver wants it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gram {
    /// `(L^T L)^-1`; `None` where the lights are fewer than three or (nearly) coplanar.
    pub inverse: Option<Matrix3<f64>>,
    /// `det(L^T L)`.
    pub determinant: f64,
}

impl Gram {
    pub fn new(gram: &Matrix3<f64>) -> Self {
        let inverse = if conditioning(gram) < MIN_CONDITIONING { None } else { gram.try_inverse() };
        Self { inverse, determinant: gram.determinant() }
    }
}

/// `rho n` and the inverse of the Gram matrix it came from.
pub(super) struct Solution {
    pub scaled_normal: Vector3<f64>,
    pub inverse: Matrix3<f64>,
}

/// `(L^T L)^-1 L^T I` over the lights marked in `kept`; `None` when these do not fix a normal.
pub(super) fn solve(values: &[f32], directions: &[Vector3<f64>], kept: &[bool]) -> Option<Solution> {
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for ((&value, direction), _) in values.iter().zip(directions).zip(kept).filter(|(_, kept)| **kept) {
        gram += direction * direction.transpose();
        right += direction * f64::from(value);
    }
    let inverse = Gram::new(&gram).inverse?;
    Some(Solution { scaled_normal: inverse * right, inverse })
}
