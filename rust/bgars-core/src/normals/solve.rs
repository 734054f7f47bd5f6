//! Least squares on a subset of the lights.

use nalgebra::{Matrix3, Vector3};

use crate::lights::{MIN_CONDITIONING, conditioning};

/// Most lights for which every subset's inverse is computed beforehand (4,096 matrices, 300 KB).
const MAX_TABLE_LIGHTS: usize = 12;

/// `(L^T L)^-1` of a subset of lights, or `None` where it is rank-deficient.
type Inverse = Option<Matrix3<f64>>;

/// Solves for `rho n` on kept lights: from a table of all subsets where the lights are the same for every pixel and few,
/// else from the normal equations of the pixel.
#[derive(Debug)]
pub(super) struct SubsetSolver {
    table: Vec<Inverse>,
}

/// `rho n` and the inverse of the Gram matrix it came from.
pub(super) struct Solution {
    pub scaled_normal: Vector3<f64>,
    pub inverse: Matrix3<f64>,
}

impl SubsetSolver {
    /// A solver with the table of `directions` when there are at most 12 of them; without one otherwise.
    pub fn with_table(directions: &[Vector3<f64>]) -> Self {
        if directions.len() > MAX_TABLE_LIGHTS {
            return Self::without_table();
        }
        let table = (0..1usize << directions.len())
            .map(|subset| {
                let lights = directions.iter().enumerate();
                inverse_gram(lights.filter(|(light, _)| subset >> light & 1 == 1).map(|(_, direction)| direction))
            })
            .collect();
        Self { table }
    }

    /// A solver for lights that change from pixel to pixel.
    pub fn without_table() -> Self {
        Self { table: Vec::new() }
    }

    /// `(L^T L)^-1 L^T I` over the lights marked in `kept`; `None` when these do not fix a normal.
    #[inline]
    pub fn solve(&self, values: &[f32], directions: &[Vector3<f64>], kept: &[bool]) -> Option<Solution> {
        let inverse = if self.table.is_empty() {
            inverse_gram(directions.iter().zip(kept).filter(|(_, kept)| **kept).map(|(direction, _)| direction))?
        } else {
            let subset = kept.iter().rev().fold(0, |bits, &kept| bits << 1 | usize::from(kept));
            self.table[subset]?
        };
        let mut right = Vector3::zeros();
        for ((&value, direction), &kept) in values.iter().zip(directions).zip(kept) {
            if kept {
                right += direction * f64::from(value);
            }
        }
        Some(Solution { scaled_normal: inverse * right, inverse })
    }
}

/// `(L^T L)^-1` of some unit vectors, `None` where they are fewer than three or (nearly) coplanar.
fn inverse_gram<'a>(directions: impl Iterator<Item = &'a Vector3<f64>>) -> Inverse {
    let gram = directions.fold(Matrix3::zeros(), |gram, direction| gram + direction * direction.transpose());
    if conditioning(&gram) < MIN_CONDITIONING { None } else { gram.try_inverse() }
}
