//! Stops: empty corners that lend their place to a lane which crosses a cell from corner to corner.
//!
//! Where a lane turns from one column to the next, only two corners across a cell may lie in it, and a grid has no diagonals.
//! One of the other two corners becomes a *stop* between them, a virtual pixel (see `fill`): tied to the black beside the one
//! corner, it gets its edge to the other by the path through the centre. The tie is such that the coarser grid's two edges
//! conduct, one after the other, what the lane does.

use rayon::prelude::*;

use super::checkerboard::{DOWN, Grid, LEFT, RIGHT, UP, Weights};
use super::coarsen::series;
use super::edge_bits::{CellBits, EdgeBits, moved_on};
use super::fill::{Around, Tied};
use super::lost::{Rim, cells_around};
use super::places::Place;

/// Most that a stop has in a black: all of it where the lane ends in a much stronger edge, but that would take an endless tie.
const MAX_SHARE: f32 = 0.999;

/// The corners that become stops, and their ties.
pub(super) fn stops(weights: &Weights, bits: &EdgeBits) -> Tied {
    let rows = (0..weights.grid.height).into_par_iter().step_by(2);
    rows.flat_map_iter(|row| {
        let ties = move |k: usize| stop(weights, (row as isize, k)).map(|ties| (row, k, ties));
        beside_lanes(weights.grid, bits, row as isize).into_iter().filter_map(ties)
    })
    .collect()
}

/// The corners of a row without edges that have a lane in a cell beside them.
fn beside_lanes(grid: Grid, bits: &EdgeBits, row: isize) -> Vec<usize> {
    let here = bits.any(row);
    let cells = |row: isize, corners: [usize; 2]| {
        grid.contains(row).then(|| LaneBits { any: bits.any_around(row), real: bits.real_around(row), corners })
    };
    let (above, below) = (cells(row - 1, [3, 2]), cells(row + 1, [0, 1]));
    bits.places(|word| {
        let free = !here.to_any_side(word);
        if free == 0 {
            return 0;
        }
        let lanes = |cells: &Option<LaneBits<'_>>| cells.as_ref().map_or(0, |cells| cells.past_corners(word));
        free & (lanes(&above) | lanes(&below))
    })
}

/// Where lanes cross the cells of a row that has the corners on one side.
struct LaneBits<'a> {
    any: CellBits<'a>,
    real: CellBits<'a>,
    /// What number corner k is in its own cell, and in the one before.
    corners: [usize; 2],
}

impl LaneBits<'_> {
    /// The corners that a lane leads past.
    #[inline(always)]
    fn past_corners(&self, word: usize) -> u64 {
        let [own, next] = self.corners;
        let previous = if word > 0 { self.past(next, word - 1) } else { 0 };
        self.past(own, word) | moved_on(previous, self.past(next, word))
    }

    /// The cells that a lane crosses past their corner `own`.
    #[inline(always)]
    fn past(&self, own: usize, word: usize) -> u64 {
        let spokes = self.real.spokes(word);
        if spokes[0] & spokes[2] | spokes[1] & spokes[3] == 0 {
            return 0;
        }
        let (rims, real_rims) = (self.any.rims(word), self.real.rims(word));
        let mut lanes = 0;
        for (side, end) in lanes_past(own) {
            let across = (side + 2) % 4;
            // The fourth corner of the cell must not hang on the lane.
            let lane = rims[side][end] & spokes[side] & spokes[across] & rims[across][end];
            lanes |= lane & !real_rims[across][1 - end];
        }
        lanes
    }
}

/// The lanes that may cross a cell past its corner `own`: the side of the rim that each comes by, and the end of this side that it
/// comes from.
#[inline(always)]
fn lanes_past(own: usize) -> [(usize, usize); 2] {
    [(own, 1), ((own + 3) % 4, 0)]
}

/// The ties of a corner to the left, right, up and down if it is to be a stop.
fn stop(weights: &Weights, corner: Place) -> Option<[f32; 4]> {
    if !is_free(weights, corner) {
        return None;
    }
    let mut best = (0.0, [0.0; 4]);
    for (cell, own) in cells_around(weights.grid, corner) {
        // Of two corners that could serve, the upper one does.
        if own >= 2 && is_free(weights, (cell.0 - 1, cell.1 + own - 2)) {
            continue;
        }
        let Rim { spokes, rims, .. } = Rim::around(weights, cell.0, cell.1);
        for (side, end) in lanes_past(own) {
            let across = (side + 2) % 4;
            let lane = [rims[side][end].abs(), spokes[side], spokes[across], rims[across][end].abs()];
            // The fourth corner of the cell must not hang on the lane.
            if rims[across][1 - end] > 0.0 || lane.iter().any(|&edge| edge <= 0.0) {
                continue;
            }
            let conductance = 1.0 / lane.iter().map(|edge| 1.0 / edge).sum::<f32>();
            if conductance > best.0 {
                let mut ties = [0.0; 4];
                ties[towards(own, side)] = tie(lane, conductance);
                best = (conductance, ties);
            }
        }
    }
    (best.0 > 0.0).then_some(best.1)
}

/// Where the side of a cell's rim lies, seen from its corner `own`.
fn towards(own: usize, side: usize) -> usize {
    match (own, side) {
        (0, 0) | (3, 2) => RIGHT,
        (1, 0) | (2, 2) => LEFT,
        (0, 3) | (1, 1) => DOWN,
        _ => UP,
    }
}

/// The tie of a stop to the first black of a lane of four edges.
///
/// With u the share that the stop has in this black, `coarsen` makes of it two edges, a u and q (1 + u) / 2 with
/// q = b c / (b + c). One after the other they have the lane's conductance g where K u^2 + (K - q - 2) u = q, K = q / g, all in
/// units of a.
fn tie([a, b, c, _]: [f32; 4], conductance: f32) -> f32 {
    let (q, g) = (series(b, c) / a, conductance / a);
    let k = q / g;
    let half = 0.5 * (k - q - 2.0);
    let root = (half * half + k * q).sqrt();
    // Two forms of the same, each without cancellation.
    let share = if half > 0.0 { q / (root + half) } else { (root - half) / k };
    // Also of NaN, where the edges are too far apart for floats.
    let share = share.min(MAX_SHARE);
    a * share / (1.0 - share)
}

/// True for a corner of the grid without edges and without a way around.
fn is_free(weights: &Weights, (row, k): Place) -> bool {
    k < weights.grid.half() && Around::new(weights, row).is_free(k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::coarsen::{coarsen, conduct};
    use crate::integrate::fill::fill_corners;
    use crate::integrate::lost::{Lost, doubtful_centres};

    #[test]
    fn all_stops_are_found() {
        let (weights, mut found) = (Weights::ragged([0.0, 0.0, 0.0, 0.0, 0.3, 0.7]), 0);
        let bits = EdgeBits::of(&weights);
        for row in (0..40).step_by(2) {
            let beside = beside_lanes(weights.grid, &bits, row);
            for k in (0..weights.grid.half()).filter(|&k| stop(&weights, (row, k)).is_some()) {
                assert!(beside.contains(&k), "corner {k} of row {row}");
                found += 1;
            }
        }
        assert!(found > 5, "{found}");
    }

    /// A grid with a single lane of four edges, past corner `own` of the cell around red 8 of row 7, and the corners at its ends.
    fn single_lane(own: usize, (side, end): (usize, usize), lane: [f32; 4]) -> (Weights, [usize; 2]) {
        const SPOKES: [usize; 4] = [UP, RIGHT, DOWN, LEFT];
        let mut weights = Weights::zeros(Grid { height: 16, width: 64 });
        let across = (side + 2) % 4;
        let ends = [(side + end) % 4, (across + end) % 4];
        assert!(!ends.contains(&own));
        for (corner, side, weight) in [(ends[0], side, lane[0]), (ends[1], across, lane[3])] {
            let mut edges = [0.0; 4];
            edges[towards(corner, side)] = weight;
            let (row, k) = [(6, 8), (6, 9), (8, 9), (8, 8)][corner];
            weights.set_red(row, k, edges);
        }
        let mut edges = [0.0; 4];
        (edges[SPOKES[side]], edges[SPOKES[across]]) = (lane[1], lane[2]);
        weights.set_red(7, 8, edges);
        (weights, ends)
    }

    #[test]
    fn the_coarser_grid_conducts_across_a_cell_what_the_lane_does() {
        for own in 0..4 {
            for past in lanes_past(own) {
                let far_apart =
                    [[1.0, 1.0, 1.0, 1e9], [1e9, 1.0, 1.0, 1.0], [1.0, 1e-9, 1.0, 1.0], [1e-9, 1.0, 1.0, 1e9]];
                let lanes = [[1.0; 4], [0.3, 2.0, 0.01, 1.0], [5.0, 0.2, 0.9, 0.04]];
                let lanes = lanes.map(|lane| (lane, 1e-5)).into_iter().chain(far_apart.map(|lane| (lane, 0.05)));
                for (lane, most) in lanes {
                    let (mut weights, ends) = single_lane(own, past, lane);
                    let bits = fill_corners(&mut weights);
                    let [mut right, mut down, mut elsewhere] = [[0.0; 32], [0.0; 32], [0.0; 32]];
                    conduct(&weights, 3, &mut right, &mut down);
                    let [top, left, next] = [right[8], down[8], down[9]];
                    conduct(&weights, 4, &mut right, &mut elsewhere);
                    // The rim of the coarse cell: sides between its corners 0 and 1, 1 and 2, 2 and 3, 3 and 0.
                    let rim = [top, next, right[8], left];
                    let first = ends[0].min(ends[1]);
                    let ways = [[first, first + 1], [(first + 2) % 4, (first + 3) % 4]];
                    let conducted: f32 = ways.map(|[a, b]| series(rim[a], rim[b])).iter().sum();
                    let expected = 1.0 / lane.iter().map(|edge| 1.0 / edge).sum::<f32>();
                    let error = (conducted / expected - 1.0).abs();
                    assert!(error < most, "{own}, {past:?}, {lane:?}: {conducted} for {expected}");
                    assert!(
                        Lost::centres(&doubtful_centres(&weights, &bits), &weights, &coarsen(&weights)).reds.is_empty()
                    );
                }
            }
        }
    }

    #[test]
    fn edges_too_far_apart_for_floats_make_finite_ties() {
        for lane in [[1e-30, 1e30, 1.0, 1.0], [1e30, 1.0, 1.0, 1e-30], [1.0, 1e30, 1e30, 1e-30], [1e-44, 1.0, 1.0, 1.0]]
        {
            let (weights, _) = single_lane(0, (0, 1), lane);
            let ties = stops(&weights, &EdgeBits::of(&weights)).into_iter().flat_map(|stop| stop.2);
            assert!(ties.into_iter().all(f32::is_finite), "{lane:?}");
        }
    }

    #[test]
    fn a_corner_of_the_mask_is_no_stop() {
        let (mut weights, _) = single_lane(0, (0, 1), [1.0; 4]);
        // Both corners beside the lane have edges of their own, away from it.
        weights.set_red(6, 8, [1.0, 0.0, 0.0, 0.0]);
        weights.set_red(8, 9, [0.0, 1.0, 0.0, 0.0]);
        assert!(stops(&weights, &EdgeBits::of(&weights)).is_empty());
    }
}
