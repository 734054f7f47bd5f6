//! The reduced system scaled to a diagonal of ones, for a conjugate gradient that never divides.
//!
//! With `D` the diagonals of reds and blacks and `C = D_red^-1/2 W D_black^-1/2`, the system of the reds is
//! `D_red^1/2 (I - C C^T) D_red^1/2`: conjugate gradient on the middle part is Jacobi-preconditioned conjugate gradient on the
//! whole of the checkerboard, two of its iterations at a time (Reid 1972).

use std::ops::{AddAssign, Sub};

use multiversion::multiversion;
use rayon::prelude::*;

use super::super::checkerboard::{BAND_ROWS, Grid, Real, Weights};

/// A number of the inner solver.
pub(super) trait Number: Real + Sub<Output = Self> + AddAssign {
    /// Rounded from `f64`.
    fn of(value: f64) -> Self;
}

impl Number for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
}

impl Number for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
}

/// `I - C C^T`. Vectors are *padded*: a zero after each row of reds, a row of zeros at each end, and one zero before all.
#[derive(Debug)]
pub(super) struct Scaled<T> {
    grid: Grid,
    /// `C` to the left, right, upper and lower black of each red, padded as the vectors.
    sides: [Vec<T>; 4],
    /// `D_red`, not padded.
    pub diagonal: Vec<f64>,
}

impl<T: Number> Scaled<T> {
    pub fn new(weights: &Weights) -> Self {
        let grid = weights.grid;
        let half = grid.half();
        let stride = half + 1;
        let none = vec![0.0f64; half + 2];
        let none = [none.as_slice(); 3];
        let mut diagonal = vec![0.0; grid.half_pixels()];
        // Of the blacks the inverse root, padded as the vectors.
        let mut roots = vec![0.0; 1 + (grid.height + 2) * stride];
        roots[1 + stride..].par_chunks_mut(stride).zip(diagonal.par_chunks_mut(half)).enumerate().for_each(
            |(row, (roots, diagonal))| {
                weights.each_black(row as isize, none, |k, sum, _| {
                    roots[k] = if sum > 0.0 { sum.sqrt().recip() } else { 0.0 }
                });
                weights.each_red(row as isize, none, |k, sum, _| diagonal[k] = sum);
            },
        );
        let mut sides: [Vec<T>; 4] = std::array::from_fn(|_| vec![T::default(); roots.len()]);
        let [left, right, up, down] = sides.each_mut().map(|side| side[1 + stride..].par_chunks_mut(stride));
        (left, right, up, down).into_par_iter().zip(diagonal.par_chunks(half)).enumerate().for_each(
            |(row, ((left, right, up, down), diagonal))| {
                let odd = row % 2;
                let start = 1 + (row + 1) * stride;
                let row = row as isize;
                for k in 0..half {
                    let root = if diagonal[k] > 0.0 { diagonal[k].sqrt().recip() } else { 0.0 };
                    let here = start + k;
                    let scaled = |weight: f32, black: usize| T::of(f64::from(weight.max(0.0)) * root * roots[black]);
                    left[k] = scaled(weights.left(row)[k + 1], here + odd - 1);
                    right[k] = scaled(weights.right(row)[k + 1], here + odd);
                    up[k] = scaled(weights.up(row)[k + 1], here - stride);
                    down[k] = scaled(weights.down(row)[k + 1], here + stride);
                }
            },
        );
        Self { grid, sides, diagonal }
    }

    /// Numbers of a padded vector.
    pub fn padded_len(&self) -> usize {
        self.sides[0].len()
    }

    /// Reds in rows, as a padded vector of `value(red)`.
    pub fn pad(&self, value: impl Fn(usize) -> f64) -> Vec<T> {
        let (half, stride) = (self.grid.half(), self.grid.half() + 1);
        let mut padded = vec![T::default(); self.padded_len()];
        for row in 0..self.grid.height {
            for k in 0..half {
                padded[1 + (row + 1) * stride + k] = T::of(value(row * half + k));
            }
        }
        padded
    }

    /// Calls `visit(red, value)` for the reds of a padded vector.
    pub fn each_red(&self, padded: &[T], mut visit: impl FnMut(usize, f64)) {
        let (half, stride) = (self.grid.half(), self.grid.half() + 1);
        for row in 0..self.grid.height {
            for k in 0..half {
                visit(row * half + k, padded[1 + (row + 1) * stride + k].to_f64());
            }
        }
    }

    /// `out = (I - C C^T) x`; returns `<x, out>`, summed in an order that does not depend on the threads.
    pub fn multiply(&self, x: &[T], out: &mut [T]) -> f64 {
        let stride = self.grid.half() + 1;
        let inner = &mut out[1 + stride..][..stride * self.grid.height];
        if inner.len() <= BAND_ROWS * stride {
            return multiply_band(self.grid, &self.sides, x, 0, inner);
        }
        let bands = inner.par_chunks_mut(BAND_ROWS * stride).enumerate();
        let products: Vec<f64> = bands.map(|(band, out)| multiply_band(self.grid, &self.sides, x, band, out)).collect();
        products.iter().sum()
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn multiply_band<T: Number>(grid: Grid, sides: &[Vec<T>; 4], x: &[T], band: usize, out: &mut [T]) -> f64 {
    let half = grid.half();
    let stride = half + 1;
    let first = band * BAND_ROWS;
    let end = first + out.len() / stride;
    let [left, right, up, down] = sides;
    // The last four rows of C^T x: a black may lie one before or one after the reds of its row.
    let mut blacks: [Vec<T>; 4] = std::array::from_fn(|_| vec![T::default(); half + 2]);
    let mut product = 0.0;
    // Rows are counted from the padding: 0 is the row of zeros above the image.
    for row in first..end + 2 {
        if (1..=grid.height).contains(&row) {
            let odd = (row - 1) % 2;
            let start = 1 + row * stride;
            let (right, right_x) = (&right[start - odd..][..half], &x[start - odd..][..half]);
            let (left, left_x) = (&left[start + 1 - odd..][..half], &x[start + 1 - odd..][..half]);
            let (down, down_x) = (&down[start - stride..][..half], &x[start - stride..][..half]);
            let (up, up_x) = (&up[start + stride..][..half], &x[start + stride..][..half]);
            let blacks = &mut blacks[row % 4][1..=half];
            for k in 0..half {
                blacks[k] = (right[k] * right_x[k] + left[k] * left_x[k]) + (down[k] * down_x[k] + up[k] * up_x[k]);
            }
        } else {
            blacks[row % 4].fill(T::default());
        }
        if row < first + 2 {
            continue;
        }
        let row = row - 1;
        let odd = (row - 1) % 2;
        let start = 1 + row * stride;
        let here = &x[start..][..half];
        let [left, right, up, down] = [left, right, up, down].map(|side| &side[start..][..half]);
        let (above, at, below) = (&blacks[(row - 1) % 4][1..=half], &blacks[row % 4], &blacks[(row + 1) % 4][1..=half]);
        let (at_left, at_right) = (&at[odd..][..half], &at[odd + 1..][..half]);
        let out = &mut out[(row - 1 - first) * stride..][..half];
        for k in 0..half {
            let sum = (left[k] * at_left[k] + right[k] * at_right[k]) + (up[k] * above[k] + down[k] * below[k]);
            out[k] = here[k] - sum;
        }
        product += dot(here, out);
    }
    product
}

/// Sum of products in sixteen lanes, so that it vectorises and has one order.
#[inline(always)]
pub(super) fn dot<T: Number>(a: &[T], b: &[T]) -> f64 {
    const LANES: usize = 16;
    let mut lanes = [T::default(); LANES];
    let (a_blocks, b_blocks) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
    let rest: f64 = a_blocks.remainder().iter().zip(b_blocks.remainder()).map(|(a, b)| a.to_f64() * b.to_f64()).sum();
    for (a, b) in a_blocks.zip(b_blocks) {
        for lane in 0..LANES {
            lanes[lane] += a[lane] * b[lane];
        }
    }
    lanes.iter().map(|lane| lane.to_f64()).sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::super::super::reduction::multiply;
    use super::*;

    /// Weights that differ everywhere, a fifth of them zero.
    fn weights(grid: Grid) -> Weights {
        let mut weights = Weights::zeros(grid);
        let number = |seed: usize| ((seed * 2_654_435_761) >> 7) % 1000;
        for row in 0..grid.height {
            for k in 0..grid.half() {
                let col = 2 * k + row % 2;
                let inside = [col > 0, col + 1 < grid.width, row > 0, row + 1 < grid.height];
                let side = |side: usize| {
                    let value = number(4 * (row * grid.width + col) + side);
                    if col < grid.width && inside[side] && value >= 200 { value as f32 / 1000.0 } else { 0.0 }
                };
                weights.set_red(row, k, std::array::from_fn(side));
            }
        }
        weights
    }

    #[test]
    fn scaled_and_plain_products_agree_on_any_size() {
        for (height, width) in [(1, 1), (1, 7), (9, 1), (2, 2), (5, 8), (33, 20), (70, 31)] {
            let weights = weights(Grid { height, width });
            let scaled = Scaled::<f64>::new(&weights);
            let x: Vec<f64> = (0..scaled.diagonal.len()).map(|red| (red as f64 * 0.7).sin()).collect();
            let mut plain = vec![0.0; x.len()];
            multiply(&weights, &x, &mut plain);
            // S x = D^1/2 (I - C C^T) D^1/2 x.
            let padded = scaled.pad(|red| scaled.diagonal[red].sqrt() * x[red]);
            let mut out = vec![0.0; scaled.padded_len()];
            let product = scaled.multiply(&padded, &mut out);
            let mut expected_product = 0.0;
            scaled.each_red(&out, |red, value| {
                let root = scaled.diagonal[red].sqrt();
                assert!((root * value - plain[red]).abs() < 1e-9, "{height} x {width}: red {red}");
                expected_product += root * x[red] * value;
            });
            assert!((product - expected_product).abs() < 1e-9, "{height} x {width}");
        }
    }
}
