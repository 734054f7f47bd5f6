//! The weights of a surface: which side of each pixel it follows.

use rayon::prelude::*;

use super::super::checkerboard::BAND_ROWS;
use super::pixels::{Pixel, Pixels};

/// Largest argument of the sigmoid, either way: beyond, one side has all but `e^-70`, which is still a normal number in `f32`.
const MAX_ARGUMENT: f64 = 70.0;

/// Weights of the differences to the right and upward; the opposite ones have the rest.
pub(super) type Shares = [Vec<f64>; 2];

/// Both sides of every pixel alike: where the iteration starts.
pub(super) fn even(pixels: &Pixels) -> Shares {
    [vec![0.5; pixels.all.len()], vec![0.5; pixels.all.len()]]
}

/// Sets the shares by the surface `z` (row-major in the box) and returns the energy with them (Cao et al. 2022, eqs. 11 and 16).
///
/// Summed by bands of rows, in an order that does not depend on the threads.
pub(super) fn reweigh(pixels: &Pixels, z: &[f64], k: f64, shares: &mut Shares) -> f64 {
    let width = pixels.crop.grid.width;
    let chunk = BAND_ROWS * width;
    let [rightward, upward] = shares;
    let energies: Vec<f64> = rightward
        .par_chunks_mut(chunk)
        .zip(upward.par_chunks_mut(chunk))
        .enumerate()
        .map(|(band, (rightward, upward))| {
            let rows = rightward.chunks_mut(width).zip(upward.chunks_mut(width)).enumerate();
            rows.map(|(row, (rightward, upward))| row_of(pixels, z, k, band * BAND_ROWS + row, rightward, upward)).sum()
        })
        .collect();
    energies.iter().sum()
}

fn row_of(pixels: &Pixels, z: &[f64], k: f64, row: usize, rightward: &mut [f64], upward: &mut [f64]) -> f64 {
    let width = pixels.crop.grid.width;
    let first = row * width;
    let mut energy = 0.0;
    let step = |pixel: usize, other: Option<usize>, sign: f64| {
        other.filter(|&other| pixels.joined(pixel, other)).map_or(0.0, |other| sign * (z[other] - z[pixel]))
    };
    for col in 0..width {
        let pixel = first + col;
        if !pixels.used(pixel) {
            continue;
        }
        let Pixel { n, g, trust } = pixels.all[pixel];
        let right = step(pixel, (col + 1 < width).then_some(pixel + 1), 1.0) * g[0];
        let left = step(pixel, (col > 0).then(|| pixel.wrapping_sub(1)), -1.0) * g[0];
        let up = step(pixel, pixel.checked_sub(width), 1.0) * g[1];
        let down = step(pixel, Some(pixel + width).filter(|&below| below < z.len()), -1.0) * g[1];
        for (share, ahead, behind, n) in [(&mut rightward[col], right, left, n[0]), (&mut upward[col], up, down, n[1])]
        {
            *share = sigmoid(k * (behind * behind - ahead * ahead));
            energy += trust * (*share * (ahead + n).powi(2) + (1.0 - *share) * (behind + n).powi(2));
        }
    }
    energy
}

fn sigmoid(argument: f64) -> f64 {
    1.0 / (1.0 + (-argument.clamp(-MAX_ARGUMENT, MAX_ARGUMENT)).exp())
}
