//! Virtual corners: a hole of one pixel must not grow with every coarser grid.
//!
//! A coarser grid keeps the corners only. A corner outside the mask would leave a gap of one pixel there on every grid below,
//! twice as wide each time. So it is kept as a *virtual* pixel, tied to its neighbours as if it were in the mask; it carries
//! values between grids but has no part in the system. It may not join what the mask keeps apart: its neighbours must be
//! connected around it, through the centres; of several groups it takes the one that conducts best.

use std::ops::Range;

use rayon::prelude::*;

use super::checkerboard::{DOWN, Grid, LEFT, PaddedRow, RIGHT, UP, Weights};
use super::coarsen::series;
use super::edge_bits::EdgeBits;
use super::spans::Spans;
use super::stops::stops;

/// Pixels of the rows whose corners are found before they are tied.
const PART_PIXELS: usize = 1 << 18;

/// Ties every corner without edges to the neighbours around it, or makes it a stop. These are a grid's last edges: its spans
/// follow. Returns which edges there are then.
pub(super) fn fill_corners(weights: &mut Weights) -> EdgeBits {
    let mut bits = EdgeBits::of(weights);
    // Corners that have a way around do not know of each other; of those in a few rows at a time there are never many.
    let Grid { height, width } = weights.grid;
    let rows = PART_PIXELS.div_ceil(width).next_multiple_of(2);
    for first in (0..height).step_by(rows) {
        let tied = ways_around(weights, &bits, first..(first + rows).min(height));
        tie(weights, &mut bits, tied);
    }
    let tied = stops(weights, &bits);
    tie(weights, &mut bits, tied);
    weights.spans = Spans::of_edges(weights.grid, &bits);
    bits
}

fn tie(weights: &mut Weights, bits: &mut EdgeBits, tied: Tied) {
    for (row, k, ties) in tied {
        weights.set_red(row, k, ties.map(|tie| -tie));
        bits.tie(row, k, ties);
    }
}

/// Corners to be tied, by row and number, and their ties: left, right, up, down.
pub(super) type Tied = Vec<(usize, usize, [f32; 4])>;

/// The corners without edges that have a way around, in some rows from an even one on.
fn ways_around(weights: &Weights, bits: &EdgeBits, rows: Range<usize>) -> Tied {
    let rows = rows.into_par_iter().step_by(2);
    rows.flat_map_iter(|row| {
        let ties = move |k: usize| Around::new(weights, row as isize).virtual_ties(k).map(|ties| (row, k, ties));
        beside_ways(bits, row as isize).into_iter().filter_map(ties)
    })
    .collect()
}

/// The corners of a row without edges around which two edges lead.
fn beside_ways(bits: &EdgeBits, row: isize) -> Vec<usize> {
    let [above, here, below] = [bits.any(row - 1), bits.any(row), bits.any(row + 1)];
    bits.places(|word| {
        let free = !here.to_any_side(word);
        if free == 0 {
            return 0;
        }
        let left_above = above.before(DOWN, word) & above.before(RIGHT, word);
        let right_above = above.at(LEFT, word) & above.at(DOWN, word);
        let left_below = below.before(RIGHT, word) & below.before(UP, word);
        let right_below = below.at(UP, word) & below.at(LEFT, word);
        free & ((left_above | right_above) | (left_below | right_below))
    })
}

/// The weights in and beside a row of corners: left, right, up, down.
pub(super) struct Around<'a> {
    above: [PaddedRow<'a, f32>; 4],
    here: [PaddedRow<'a, f32>; 4],
    below: [PaddedRow<'a, f32>; 4],
}

impl<'a> Around<'a> {
    pub fn new(weights: &'a Weights, row: isize) -> Self {
        Self { above: weights.row(row - 1), here: weights.row(row), below: weights.row(row + 1) }
    }

    /// What the four ways around corner `k` conduct, each through one centre: from left to up, up to right, right to down, down to
    /// left; `None` for a corner with edges.
    fn arcs(&self, k: usize) -> Option<[f32; 4]> {
        let red = k + 1;
        if self.here.iter().any(|side| side[red] != 0.0) {
            return None;
        }
        let ([left_above, right_above, _, down_above], [left_below, right_below, up_below, _]) =
            (self.above, self.below);
        Some([
            series(down_above[k], right_above[k]),
            series(left_above[red], down_above[red]),
            series(up_below[red], left_below[red]),
            series(right_below[k], up_below[k]),
        ])
    }

    /// True for a corner without edges and without a way around.
    pub fn is_free(&self, k: usize) -> bool {
        self.arcs(k).is_some_and(|arcs| arcs.iter().all(|&arc| arc <= 0.0))
    }

    /// Weights to the left, right, upper and lower neighbour of corner `k`; `None` if it has edges, or nothing to be tied to.
    fn virtual_ties(&self, k: usize) -> Option<[f32; 4]> {
        let arcs = self.arcs(k)?;
        if arcs.iter().all(|&arc| arc <= 0.0) {
            return None;
        }
        // Of opposite arcs alone, which make two groups, the better one.
        let mut open = arcs.map(|arc| arc > 0.0);
        for (a, b) in [(0, 2), (1, 3)] {
            if open[a] && open[b] && !open[a + 1] && !open[(b + 1) % 4] {
                open[if arcs[a] >= arcs[b] { b } else { a }] = false;
            }
        }
        // Neighbours in the order of the arcs: left, up, right, down; arc a joins neighbours a and a + 1.
        let mut group = [0.0; 4];
        for arc in (0..4).filter(|&arc| open[arc]) {
            group[arc] += arcs[arc];
            group[(arc + 1) % 4] += arcs[arc];
        }
        let [left, up, right, down] = group;
        Some([left, right, up, down])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::Difference;
    use crate::integrate::operator::{Field, assemble};

    #[test]
    fn all_corners_to_be_tied_are_found() {
        let (weights, mut found) = (Weights::ragged([0.0, 0.0, 0.0, 0.0, 0.7, -0.5]), 0);
        let bits = EdgeBits::of(&weights);
        for row in (0..40).step_by(2) {
            let around = Around::new(&weights, row);
            let tied: Vec<usize> = (0..weights.grid.half()).filter(|&k| around.virtual_ties(k).is_some()).collect();
            assert_eq!(beside_ways(&bits, row), tied, "row {row}");
            found += tied.len();
        }
        assert!(found > 5, "{found}");
    }

    #[test]
    fn corners_found_in_parts_are_those_found_at_once() {
        const WIDTH: usize = 700;
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state >> 24
        };
        let mask: Vec<bool> = (0..WIDTH * 900).map(|_| next() > 64).collect();
        let normals = [0.0, 0.0, 1.0].repeat(mask.len());
        let field = Field { normals: &normals, mask: &mask, weights: None, regions: None, width: WIDTH };
        let [(mut parts, _), (mut whole, _)] = [(); 2].map(|()| assemble(field, Difference::Trapezoid));
        assert!(mask.len() > 2 * PART_PIXELS);
        fill_corners(&mut parts);
        let mut bits = EdgeBits::of(&whole);
        let tied = ways_around(&whole, &bits, 0..whole.grid.height);
        assert!(tied.len() > 1_000, "{}", tied.len());
        tie(&mut whole, &mut bits, tied);
        let tied = stops(&whole, &bits);
        tie(&mut whole, &mut bits, tied);
        for row in 0..whole.grid.height as isize {
            assert_eq!(parts.row(row), whole.row(row), "row {row}");
        }
    }
}
