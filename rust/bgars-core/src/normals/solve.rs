//! Least squares on a subset of the lights.

use nalgebra::{Matrix3, Vector3};

use crate::lights::{MIN_CONDITIONING, conditioning};

/// Most lights for which every subset's inverse is computed beforehand (4,096 matrices, 350 KB).
const MAX_TABLE_LIGHTS: usize = 12;

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

    fn of_lights<'a>(directions: impl Iterator<Item = &'a Vector3<f64>>) -> Self {
        Self::new(&directions.fold(Matrix3::zeros(), |gram, direction| gram + direction * direction.transpose()))
    }
}

/// Solves for `rho n` on kept lights: from a table of all subsets where the lights are the same for every pixel and few,
/// else from the normal equations of the pixel.
#[derive(Debug)]
pub(super) struct SubsetSolver {
    table: Vec<Gram>,
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
        let of_subset = |subset: usize| {
            let lights = directions.iter().enumerate();
            Gram::of_lights(lights.filter(|(light, _)| subset >> light & 1 == 1).map(|(_, direction)| direction))
        };
        Self { table: (0..1usize << directions.len()).map(of_subset).collect() }
    }

    /// A solver for lights that change from pixel to pixel.
    pub fn without_table() -> Self {
        Self { table: Vec::new() }
    }

    /// The entry of a subset (bit k: light k), if there is a table.
    #[inline]
    pub fn tabulated(&self, subset: impl FnOnce() -> usize) -> Option<Gram> {
        if self.table.is_empty() { None } else { Some(self.table[subset()]) }
    }

    /// `(L^T L)^-1 L^T I` over the lights marked in `kept`; `None` when these do not fix a normal.
    #[inline]
    pub fn solve(&self, values: &[f32], directions: &[Vector3<f64>], kept: &[bool]) -> Option<Solution> {
        let subset = || kept.iter().rev().fold(0, |bits, &kept| bits << 1 | usize::from(kept));
        let gram = self.tabulated(subset).unwrap_or_else(|| {
            Gram::of_lights(directions.iter().zip(kept).filter(|(_, kept)| **kept).map(|(direction, _)| direction))
        });
        let inverse = gram.inverse?;
        let mut right = Vector3::zeros();
        for ((&value, direction), &kept) in values.iter().zip(directions).zip(kept) {
            if kept {
                right += direction * f64::from(value);
            }
        }
        Some(Solution { scaled_normal: inverse * right, inverse })
    }
}
