//! The 5-point system of given weights in `f64`, framed, for the compatible setting.

use rayon::prelude::*;

use super::frame::Frame;
use super::pixels::{Edges, Pixels};
use super::reweigh::Shares;

/// `A z = source`; all arrays framed.
#[derive(Debug, Default)]
pub(super) struct NormalEquations {
    /// Weight of the edge from each pixel to the right.
    pub right: Vec<f64>,
    /// The same to the pixel below.
    pub below: Vec<f64>,
    /// Sum of the weights of a pixel's edges.
    pub diagonal: Vec<f64>,
    /// Right side.
    pub source: Vec<f64>,
    /// How much of the right side each edge moves from its first pixel to its second.
    push_right: Vec<f64>,
    push_below: Vec<f64>,
}

impl NormalEquations {
    /// No edges.
    pub fn new(frame: &Frame) -> Self {
        let [right, below, diagonal, source, push_right, push_below] = std::array::from_fn(|_| vec![0.0; frame.len()]);
        Self { right, below, diagonal, source, push_right, push_below }
    }

    /// Makes it the system for the shares of a surface.
    pub fn set(&mut self, frame: &Frame, pixels: &Pixels, shares: &Shares) {
        let (stride, first, width) = (frame.stride(), frame.start(0), pixels.crop.grid.width);
        let Self { right, below, diagonal, source, push_right, push_below } = self;
        for (weights, pushes, axis) in [(&mut *right, &mut *push_right, 0), (&mut *below, &mut *push_below, 1)] {
            let rows = weights[first..].par_chunks_mut(stride).zip(pushes[first..].par_chunks_mut(stride));
            rows.take(frame.height).enumerate().for_each(|(row, (weights, pushes))| {
                let edges = Edges { pixels, share: &shares[axis], least: 0.0, axis };
                edges.of_row(row, &mut weights[..width], &mut pushes[..width]);
            });
        }
        let rows = diagonal[first..].par_chunks_mut(stride).zip(source[first..].par_chunks_mut(stride));
        rows.take(frame.height).enumerate().for_each(|(row, (diagonal, source))| {
            let (lo, hi) = frame.span(row as isize);
            let start = frame.start(row);
            for k in lo..hi {
                let i = start + k;
                diagonal[k] = (right[i - 1] + right[i]) + (below[i - stride] + below[i]);
                source[k] = (push_below[i - stride] - push_below[i]) + (push_right[i - 1] - push_right[i]);
            }
        });
    }
}
