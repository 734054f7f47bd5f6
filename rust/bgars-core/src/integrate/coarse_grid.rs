//! The coarse operator of a grid none of whose blocks of 2 x 2 pixels falls apart: a grid again, the same as by aggregation.

use rayon::prelude::*;

use super::checkerboard::{Colour, Grid};
use super::stencil::{DOWN, EdgeRow, LEFT, RIGHT, Stencil, UP};

impl Stencil {
    pub fn has_edges(&self) -> bool {
        (0..self.grid.height).any(|row| self.reds(row).iter().any(|side| side.iter().any(|&weight| weight > 0.0)))
    }

    /// `None` where a block has several connected components.
    pub fn coarse(&self) -> Option<Self> {
        let grid = self.grid.coarse();
        if !(0..grid.height).into_par_iter().all(|row| self.blocks_are_connected(row)) {
            return None;
        }
        let rows_of = || {
            |row: usize, right: &mut EdgeRow<f32>, below: &mut EdgeRow<f32>| {
                self.coarse_edges(grid, row, &mut right.weight, &mut below.weight);
            }
        };
        Some(Self::from_edges(grid, rows_of, None))
    }

    /// Weights to the right of and below a row of blocks: two edges in parallel, each over twice the distance.
    fn coarse_edges(&self, grid: Grid, row: usize, right: &mut [f32], below: &mut [f32]) {
        let (upper, lower, next) = (self.reds(2 * row), self.reds(2 * row + 1), self.reds(2 * row + 2));
        let last = grid.width - 1;
        for (k, right) in right[..last].iter_mut().enumerate() {
            *right = 0.5 * (upper[LEFT][k + 1] + lower[RIGHT][k]);
        }
        right[last] = 0.0;
        for (k, below) in below.iter_mut().enumerate() {
            *below = 0.5 * (lower[DOWN][k] + next[UP][k]);
        }
    }

    /// Weights from the reds of a row; none where there is no such row.
    fn reds(&self, row: usize) -> [&[f32]; 4] {
        if row < self.grid.height { self.weights(Colour::Red, row) } else { [&self.no_weights[..]; 4] }
    }

    /// Whether the pixels with edges of every block of a row hang together.
    fn blocks_are_connected(&self, row: usize) -> bool {
        let (upper, lower) = (self.reds(2 * row), self.reds(2 * row + 1));
        let blacks = [2 * row, 2 * row + 1].map(|row| {
            if row < self.grid.height { self.weights(Colour::Black, row) } else { [&self.no_weights[..]; 4] }
        });
        let has_edge = |sides: &[&[f32]; 4], k: usize| sides[0][k] + sides[1][k] + sides[2][k] + sides[3][k] > 0.0;
        (0..self.grid.half()).all(|k| {
            let pixels = [&upper, &lower, &blacks[0], &blacks[1]].map(|sides| u8::from(has_edge(sides, k)));
            let edges =
                [upper[RIGHT][k], upper[DOWN][k], lower[LEFT][k], lower[UP][k]].map(|edge| u8::from(edge > 0.0));
            let (pixels, edges) = (pixels.iter().sum::<u8>(), edges.iter().sum::<u8>());
            // As many edges less than pixels as in a tree, or all four around.
            pixels <= edges + 1
        })
    }
}
