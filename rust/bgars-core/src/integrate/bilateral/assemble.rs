//! The 5-point system of given weights: an edge carries what both its pixels ask of it.

use rayon::prelude::*;

use super::super::checkerboard::{BAND_ROWS, Weights, split_row};
use super::super::operator::Colours;
use super::pixels::Pixels;
use super::reweigh::Shares;
use crate::memory::zeros;

/// Weights of a row's edges and what they push: how much of the right side moves from their first pixel to their second.
#[derive(Debug, Default, Clone)]
struct Edges {
    weight: Vec<f32>,
    push: Vec<f64>,
}

impl Edges {
    fn clear(&mut self, width: usize) {
        self.weight.clear();
        self.weight.resize(width, 0.0);
        self.push.clear();
        self.push.resize(width, 0.0);
    }

    /// The first `edges` of a row whose first pixel is `first`: to the right (axis 0) or to the row below (axis 1).
    fn join(&mut self, pixels: &Pixels, share: &[f64], least: f64, first: usize, edges: usize, axis: usize) {
        let share = |pixel: usize| share[pixel].clamp(least, 1.0 - least);
        let width = pixels.crop.grid.width;
        let stride = if axis == 0 { 1 } else { width };
        self.clear(width);
        for k in 0..edges {
            let (a, b) = (first + k, first + k + stride);
            if !pixels.joined(a, b) {
                continue;
            }
            let (near, far) = (&pixels.all[a], &pixels.all[b]);
            // Ahead is to the right and up: the edge is ahead of its left pixel, and of its lower one.
            let (share_a, share_b) = if axis == 0 { (share(a), 1.0 - share(b)) } else { (1.0 - share(a), share(b)) };
            let (pull_a, pull_b) = (near.trust * share_a * near.g[axis], far.trust * share_b * far.g[axis]);
            self.weight[k] = (pull_a * near.g[axis] + pull_b * far.g[axis]) as f32;
            let push = pull_a * near.n[axis] + pull_b * far.n[axis];
            self.push[k] = if axis == 0 { -push } else { push };
        }
    }
}

/// Weights and right side of the normal equations for the shares of a surface, none of them taken below `least`.
pub(super) fn assemble(pixels: &Pixels, shares: &Shares, least: f64) -> (Weights, Colours) {
    let grid = pixels.crop.grid;
    let (width, half) = (grid.width, grid.half());
    let mut weights = Weights::zeros(grid);
    let mut right = Colours { reds: zeros(grid.half_pixels()), blacks: zeros(grid.half_pixels()) };
    let bands = weights
        .bands_mut()
        .zip(right.reds.par_chunks_mut(BAND_ROWS * half))
        .zip(right.blacks.par_chunks_mut(BAND_ROWS * half))
        .enumerate();
    bands.for_each(|(band, ((mut sides, reds), blacks))| {
        let first = band * BAND_ROWS;
        let [mut above, mut along, mut below] = [Edges::default(), Edges::default(), Edges::default()];
        above.clear(width);
        if first > 0 {
            above.join(pixels, &shares[1], least, (first - 1) * width, width, 1);
        }
        let mut left = vec![0.0f32; width];
        let mut unused = vec![0.0f32; half];
        let mut divergence = vec![0.0f64; width];
        for offset in 0..reds.len() / half {
            let row = first + offset;
            along.join(pixels, &shares[0], least, row * width, width - 1, 0);
            let edges_below = if row + 1 < grid.height { width } else { 0 };
            below.join(pixels, &shares[1], least, row * width, edges_below, 1);
            left[1..].copy_from_slice(&along.weight[..width - 1]);
            let sources = [&left, &along.weight, &above.weight, &below.weight];
            for (side, source) in sides.iter_mut().zip(sources) {
                split_row(row, source, &mut side[offset * (half + 1)..][..half], &mut unused);
            }
            for k in 0..width {
                let from_left = if k > 0 { along.push[k - 1] } else { 0.0 };
                divergence[k] = (above.push[k] - below.push[k]) + (from_left - along.push[k]);
            }
            let span = offset * half..(offset + 1) * half;
            split_row(row, &divergence, &mut reds[span.clone()], &mut blacks[span]);
            std::mem::swap(&mut above, &mut below);
        }
    });
    (weights, right)
}
