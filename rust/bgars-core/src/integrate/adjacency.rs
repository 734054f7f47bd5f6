//! Both kinds of operators as graphs of unknowns that lie in the rows of a checkerboard.

use std::ops::Range;

use super::checkerboard::{Colour, Grid};
use super::graph::Graph;
use super::stencil::Stencil;

/// What aggregation needs to know of a fine operator.
pub(super) trait Adjacency: Sync {
    fn grid(&self) -> Grid;
    fn len(&self, colour: Colour) -> usize;
    /// Those of a row of pixels.
    fn row(&self, colour: Colour, row: usize) -> Range<usize>;
    fn col(&self, colour: Colour, row: usize, unknown: usize) -> usize;
    /// The edges of an unknown of a row that conduct.
    fn edges(&self, colour: Colour, row: usize, unknown: usize) -> impl Iterator<Item = (usize, f32)>;
}

impl Adjacency for Stencil {
    fn grid(&self) -> Grid {
        self.grid
    }

    fn len(&self, _: Colour) -> usize {
        self.grid.half_pixels()
    }

    fn row(&self, _: Colour, row: usize) -> Range<usize> {
        row * self.grid.half()..(row + 1) * self.grid.half()
    }

    fn col(&self, colour: Colour, row: usize, unknown: usize) -> usize {
        2 * (unknown - row * self.grid.half()) + colour.first_col(row)
    }

    fn edges(&self, colour: Colour, row: usize, unknown: usize) -> impl Iterator<Item = (usize, f32)> {
        let half = self.grid.half();
        let left = unknown + colour.first_col(row);
        // Where no pixel is, no weight leads.
        let ends = [left.wrapping_sub(1), left, unknown.wrapping_sub(half), unknown + half];
        let weights = self.weights(colour, row).map(|side| side[unknown - row * half]);
        ends.into_iter().zip(weights).filter(|&(_, weight)| weight > 0.0)
    }
}

impl Adjacency for Graph {
    fn grid(&self) -> Grid {
        self.grid
    }

    fn len(&self, colour: Colour) -> usize {
        self.parts[colour as usize].len()
    }

    fn row(&self, colour: Colour, row: usize) -> Range<usize> {
        let rows = &self.parts[colour as usize].rows;
        rows[row] as usize..rows[row + 1] as usize
    }

    fn col(&self, colour: Colour, _: usize, unknown: usize) -> usize {
        self.parts[colour as usize].cols[unknown] as usize
    }

    fn edges(&self, colour: Colour, _: usize, unknown: usize) -> impl Iterator<Item = (usize, f32)> {
        let part = &self.parts[colour as usize];
        let edges = part.edges(unknown);
        part.ends[edges.clone()].iter().map(|&end| end as usize).zip(part.weights[edges].iter().copied())
    }
}
