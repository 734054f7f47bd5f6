//! What the system leaves at the reds, as conjugate gradient carries it along.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Weights};
use crate::memory::Aligned;

/// Sums in flight.
const LANES: usize = 8;

/// A number for each red, as a float and the float that is missing to it: 48 bits. The V-cycle reads the first alone, and nothing
/// else needs to be kept for it.
pub(super) struct Residual {
    rounded: Aligned<f32>,
    missing: Aligned<f32>,
}

impl Residual {
    /// Any numbers, to be written before they are read.
    pub fn any(size: usize) -> Self {
        Self { rounded: Aligned::any(size), missing: Aligned::any(size) }
    }

    /// As floats.
    pub fn rounded(&self) -> &[f32] {
        &self.rounded
    }

    /// Chunks of both floats, to set by [`split`].
    pub fn chunks_mut(&mut self, chunk: usize) -> impl Iterator<Item = [&mut [f32]; 2]> {
        self.rounded.chunks_mut(chunk).zip(self.missing.chunks_mut(chunk)).map(|(rounded, missing)| [rounded, missing])
    }

    /// `self -= alpha q` along the spans of the grid; returns the square sum of what is left, each band summed by itself.
    pub fn subtract(&mut self, weights: &Weights, alpha: f64, q: &[f64]) -> f64 {
        let chunk = BAND_ROWS * weights.grid.half();
        let (rounded, missing) = (self.rounded.par_chunks_mut(chunk), self.missing.par_chunks_mut(chunk));
        let squares: Vec<f64> = (rounded, missing, q.par_chunks(chunk))
            .into_par_iter()
            .enumerate()
            .map(|(band, (rounded, missing, q))| {
                let parts = weights.spans.parts(band);
                parts
                    .map(|part| {
                        subtract_part([&mut rounded[part.clone()], &mut missing[part.clone()]], alpha, &q[part])
                    })
                    .sum()
            })
            .collect();
        squares.iter().sum()
    }
}

/// Numbers as floats, and the floats that are missing to them.
#[inline(always)]
fn halves<const N: usize>(numbers: [f64; N]) -> [[f32; N]; 2] {
    let rounded = numbers.map(|number| number as f32);
    [rounded, std::array::from_fn(|lane| (numbers[lane] - f64::from(rounded[lane])) as f32)]
}

/// [`halves`] of any count of numbers.
#[inline(always)]
pub(super) fn split(numbers: &[f64], [rounded, missing]: [&mut [f32]; 2]) {
    for ((&number, rounded), missing) in numbers.iter().zip(rounded).zip(missing) {
        [[*rounded], [*missing]] = halves([number]);
    }
}

/// [`Residual::subtract`] from a part of a band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn subtract_part([rounded, missing]: [&mut [f32]; 2], alpha: f64, q: &[f64]) -> f64 {
    let (rounded, rounded_rest) = rounded.as_chunks_mut::<LANES>();
    let (missing, missing_rest) = missing.as_chunks_mut::<LANES>();
    let (q, q_rest) = q.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for ((rounded, missing), q) in rounded.iter_mut().zip(missing).zip(q) {
        let squares = subtract_lanes([rounded, missing], alpha, q);
        for lane in 0..LANES {
            sums[lane] += squares[lane];
        }
    }
    let mut rest = 0.0;
    for ((rounded, missing), &q) in rounded_rest.iter_mut().zip(missing_rest).zip(q_rest) {
        let [mut one, mut other] = [[*rounded], [*missing]];
        rest += subtract_lanes([&mut one, &mut other], alpha, &[q])[0];
        [[*rounded], [*missing]] = [one, other];
    }
    sums.iter().sum::<f64>() + rest
}

/// [`Residual::subtract`] from some numbers; returns their squares.
#[inline(always)]
fn subtract_lanes<const N: usize>([rounded, missing]: [&mut [f32; N]; 2], alpha: f64, q: &[f64; N]) -> [f64; N] {
    // All are read before any is written: only then are they taken for a vector.
    let left: [f64; N] =
        std::array::from_fn(|lane| (f64::from(rounded[lane]) + f64::from(missing[lane])) - alpha * q[lane]);
    [*rounded, *missing] = halves(left);
    left.map(|left| left * left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Grid;

    /// Within `2^-48` of what is there before and after, along the spans alone; the sum is that of the exact numbers.
    #[test]
    fn two_floats_follow_a_double() {
        for (height, width) in [(70, 150), (3, 9)] {
            let grid = Grid { height, width };
            let (half, size) = (grid.half(), grid.half_pixels());
            let mut weights = Weights::zeros(grid);
            for row in 0..height.min(35) {
                (1..4).for_each(|k| weights.set_red(row, k, [1.0; 4]));
            }
            weights.find_spans();
            let number = |seed: usize| ((seed * 2_654_435_761) >> 7) as f64 % 1000.0 / 997.0 - 0.5;
            let mut expected: Vec<f64> = (0..size).map(number).collect();
            let q: Vec<f64> = (0..size).map(|at| number(at + 12_345)).collect();
            let mut residual = Residual::any(size);
            residual.chunks_mut(7).zip(expected.chunks(7)).for_each(|(floats, numbers)| split(numbers, floats));
            for alpha in [0.7, -1e-3, 0.9] {
                let found = residual.subtract(&weights, alpha, &q);
                let mut squares = 0.0;
                for at in 0..size {
                    if weights.spans.at((at / half) as isize).range().contains(&(at % half)) {
                        expected[at] -= alpha * q[at];
                        squares += expected[at] * expected[at];
                    }
                    let (rounded, missing) = (residual.rounded[at], residual.missing[at]);
                    assert!((f64::from(rounded) + f64::from(missing) - expected[at]).abs() < 4.0 * 2f64.powi(-48));
                    assert!(f64::from(missing).abs() <= f64::from(rounded).abs() * 2f64.powi(-24));
                }
                assert!((found - squares).abs() < 1e-13 * squares && squares > 0.0, "{found} for {squares}");
            }
        }
    }
}
