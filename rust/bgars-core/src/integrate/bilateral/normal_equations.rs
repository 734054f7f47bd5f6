//! The 5-point system of given weights in `f64`, framed, for the compatible setting.

use multiversion::multiversion;
use rayon::prelude::*;

use super::frame::Frame;
use super::pixels::{Edges, Pixels};
use super::reweigh::Shares;
use crate::memory::Aligned;

/// `A z = source`; all arrays framed.
#[derive(Debug)]
pub(super) struct NormalEquations {
    /// Weight of the edge from each pixel to the right.
    pub right: Aligned<f64>,
    /// The same to the pixel below.
    pub below: Aligned<f64>,
    /// Sum of the weights of a pixel's edges.
    pub diagonal: Aligned<f64>,
    /// Right side.
    pub source: Aligned<f64>,
    /// How much of the right side each edge moves from its first pixel to its second.
    push_right: Aligned<f64>,
    push_below: Aligned<f64>,
}

impl NormalEquations {
    /// No edges.
    pub fn new(frame: &Frame) -> Self {
        let [right, below, diagonal, source, push_right, push_below] = std::array::from_fn(|_| frame.zeros());
        Self { right, below, diagonal, source, push_right, push_below }
    }

    /// Makes it the system for the shares of a surface.
    pub fn set(&mut self, frame: &Frame, pixels: &Pixels, shares: &Shares) {
        let (stride, first, width) = (frame.stride(), frame.start(0), pixels.crop.grid.width);
        let Self { right, below, diagonal, source, push_right, push_below } = self;
        for (weights, pushes, axis) in [(&mut *right, &mut *push_right, 0), (&mut *below, &mut *push_below, 1)] {
            let rows = weights[first..].par_chunks_mut(stride).zip(pushes[first..].par_chunks_mut(stride));
            rows.take(frame.height()).enumerate().for_each(|(row, (weights, pushes))| {
                let edges = Edges { pixels, share: &shares[axis], least: 0.0, axis };
                edges.of_row(row, &mut weights[..width], &mut pushes[..width]);
            });
        }
        let rows = (frame.rows_mut(diagonal), frame.rows_mut(source)).into_par_iter().enumerate();
        rows.for_each(|(row, (diagonal, source))| {
            for span in frame.columns(row) {
                let (at, edges) = (frame.start(row) + span.start, [&*right, below, push_right, push_below]);
                add_up(edges.map(|edges| &edges[..]), at, stride, &mut diagonal[span.clone()], &mut source[span]);
            }
        });
    }
}

/// Diagonal and right side of part of a row whose first pixel lies `at`, from weights and pushes to the right and below.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn add_up(edges: [&[f64]; 4], at: usize, stride: usize, diagonal: &mut [f64], source: &mut [f64]) {
    let count = diagonal.len();
    let source = &mut source[..count];
    let [right, below, push_right, push_below] = edges.map(|numbers| &numbers[at..][..count]);
    let [left, _, push_left, _] = edges.map(|numbers| &numbers[at - 1..][..count]);
    let [_, above, _, push_above] = edges.map(|numbers| &numbers[at - stride..][..count]);
    for k in 0..count {
        diagonal[k] = (left[k] + right[k]) + (above[k] + below[k]);
        source[k] = (push_above[k] - push_below[k]) + (push_left[k] - push_right[k]);
    }
}
