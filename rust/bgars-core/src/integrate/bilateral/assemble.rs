//! The system of given weights for multigrid: an edge carries what both its pixels ask of it.

use super::super::checkerboard::Weights;
use super::super::edges::{Axis, Colours, EdgeRow, from_edges};
use super::pixels::{Edges, Pixels};
use super::reweigh::Shares;

/// Weights and right side of the normal equations for the shares of a surface, none of them taken below `least`.
pub(super) fn assemble(pixels: &Pixels, shares: &Shares, least: f64) -> (Weights, Colours) {
    let grid = pixels.crop.grid;
    from_edges(grid, || {
        let mut weight = vec![0.0; grid.width];
        move |axis: Axis, row: usize, edges: &mut EdgeRow| {
            let axis = usize::from(axis == Axis::Below);
            weight.fill(0.0);
            edges.push.fill(0.0);
            Edges { pixels, share: &shares[axis], least, axis }.of_row(row, &mut weight, &mut edges.push);
            for (rounded, weight) in edges.weight.iter_mut().zip(&weight) {
                *rounded = *weight as f32;
            }
        }
    })
}
