//! The weights of a surface: which side of each pixel it follows.

use rayon::prelude::*;

use super::pixels::{Pixels, Shares};

/// Largest argument of the sigmoid, either way: beyond, one side has all but `e^-70`, which is still a normal number in `f32`.
const MAX_ARGUMENT: f64 = 70.0;

/// Both sides of every pixel alike: where the iteration starts.
pub(super) fn even(pixels: &Pixels) -> Shares {
    std::array::from_fn(|_| vec![0.5; pixels.len()])
}

/// Sets the shares by the surface `z` (row-major in the box) and returns the energy with them (Cao et al. 2022, eqs. 11 and 16).
///
/// Summed by rows, in an order that does not depend on the threads.
pub(super) fn reweigh(pixels: &Pixels, z: &[f64], k: f64, shares: &mut Shares) -> f64 {
    let Pixels { n, g, trust, ties, .. } = pixels;
    let width = pixels.crop.grid.width;
    // Zero where nothing is joined, and beyond the ends.
    let step = |axis: usize, tie: usize, from: usize, to: usize| match (ties[axis].get(tie), z.get(from), z.get(to)) {
        (Some(tie), Some(from), Some(to)) => tie * (to - from),
        _ => 0.0,
    };
    // Sets a pixel's share along an axis and returns its energy.
    let set = |pixel: usize, axis: usize, ahead: f64, behind: f64, share: &mut f64| {
        let (ahead, behind) = (ahead * g[axis][pixel], behind * g[axis][pixel]);
        *share = sigmoid(k * (behind * behind - ahead * ahead));
        let (ahead, behind) = (ahead + n[axis][pixel], behind + n[axis][pixel]);
        trust[pixel] * (*share * (ahead * ahead) + (1.0 - *share) * (behind * behind))
    };
    let [rightward, upward] = shares;
    let rows = rightward.par_chunks_mut(width).zip(upward.par_chunks_mut(width)).enumerate();
    let energies: Vec<f64> = rows
        .map(|(row, (rightward, upward))| {
            let pixels = (row * width..).zip(rightward.iter_mut().zip(upward));
            pixels
                .map(|(here, (rightward, upward))| {
                    let [left, above] = [here.wrapping_sub(1), here.wrapping_sub(width)];
                    set(here, 0, step(0, here, here, here + 1), step(0, left, left, here), rightward)
                        + set(here, 1, step(1, above, here, above), step(1, here, here + width, here), upward)
                })
                .sum()
        })
        .collect();
    energies.iter().sum::<f64>() / pixels.unit
}

#[inline(always)]
fn sigmoid(argument: f64) -> f64 {
    1.0 / (1.0 + (-argument.clamp(-MAX_ARGUMENT, MAX_ARGUMENT)).exp())
}
