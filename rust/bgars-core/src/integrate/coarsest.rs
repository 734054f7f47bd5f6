//! The coarsest grid, solved directly.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::checkerboard::{Weights, join_row};

/// Added to the diagonal, relative to it: the constant of a component is free, and a factorisation needs it fixed.
const REGULARISATION: f64 = 1e-4;

/// `A^-1` of a small grid by Cholesky factorisation.
#[derive(Debug)]
pub(super) struct Coarsest {
    width: usize,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl Coarsest {
    pub fn new(weights: &Weights) -> Self {
        let grid = weights.grid;
        let (width, pixels) = (grid.width, grid.height * grid.width);
        let mut matrix = DMatrix::<f64>::zeros(pixels, pixels);
        let mut join = |a: usize, b: usize, weight: f32| {
            if weight > 0.0 {
                let weight = f64::from(weight);
                matrix[(a, b)] -= weight;
                matrix[(b, a)] -= weight;
                matrix[(a, a)] += weight * (1.0 + REGULARISATION);
                matrix[(b, b)] += weight * (1.0 + REGULARISATION);
            }
        };
        for row in 0..grid.height {
            for col in (row % 2..width).step_by(2) {
                let (pixel, red, row) = (row * width + col, col / 2 + 1, row as isize);
                if col > 0 {
                    join(pixel, pixel - 1, weights.left(row)[red]);
                }
                if col + 1 < width {
                    join(pixel, pixel + 1, weights.right(row)[red]);
                }
                if row > 0 {
                    join(pixel, pixel - width, weights.up(row)[red]);
                }
                if row + 1 < grid.height as isize {
                    join(pixel, pixel + width, weights.down(row)[red]);
                }
            }
        }
        for pixel in 0..pixels {
            if matrix[(pixel, pixel)] == 0.0 {
                matrix[(pixel, pixel)] = 1.0;
            }
        }
        Self { width, factor: Cholesky::new(matrix) }
    }

    /// `solution = A^-1 (reds, blacks)`, row-major.
    pub fn solve(&self, reds: &[f32], blacks: &[f32], solution: &mut [f32]) {
        let half = self.width.div_ceil(2);
        for (row, pixels) in solution.chunks_exact_mut(self.width).enumerate() {
            join_row(row, &reds[row * half..][..half], &blacks[row * half..][..half], pixels);
        }
        if let Some(factor) = &self.factor {
            let mut vector = DVector::from_iterator(solution.len(), solution.iter().map(|&value| f64::from(value)));
            factor.solve_mut(&mut vector);
            for (out, &value) in solution.iter_mut().zip(&vector) {
                *out = value as f32;
            }
        }
    }
}
