//! Virtual corners: a hole of one pixel must not grow with every coarser grid.
//!
//! A coarser grid keeps the corners only. A corner outside the mask would leave a gap of one pixel there on every grid below,
//! twice as wide each time. So it is kept as a *virtual* pixel, tied to its neighbours as if it were in the mask; it carries
//! values between grids but has no part in the system. It may not join what the mask keeps apart: its neighbours must be
//! connected around it, through the centres; of several groups it takes the one that conducts best.

use rayon::prelude::*;

use super::checkerboard::Weights;
use super::coarsen::series;

/// Ties every corner without edges to the neighbours around it.
pub(super) fn fill_corners(weights: &mut Weights) {
    let n = weights.grid.half();
    let found: Vec<(usize, usize, [f32; 4])> = (0..weights.grid.height.div_ceil(2))
        .into_par_iter()
        .flat_map_iter(|coarse_row| {
            let row = 2 * coarse_row;
            let weights = &*weights;
            (0..n).filter_map(move |k| virtual_ties(weights, row as isize, k).map(|ties| (row, k, ties)))
        })
        .collect();
    for (row, k, ties) in found {
        weights.set_red(row, k, ties.map(|tie| -tie));
    }
}

/// Weights to the left, right, upper and lower neighbour of corner `k`; `None` if it has edges, or nothing to be tied to.
fn virtual_ties(weights: &Weights, row: isize, k: usize) -> Option<[f32; 4]> {
    let red = k + 1;
    let edges = weights.left(row)[red] + weights.right(row)[red] + weights.up(row)[red] + weights.down(row)[red];
    if edges != 0.0 {
        return None;
    }
    let (above, below) = (row - 1, row + 1);
    // The four ways around, each through one centre: left-up, up-right, right-down, down-left.
    let left_up = series(weights.down(above)[k], weights.right(above)[k]);
    let up_right = series(weights.left(above)[red], weights.down(above)[red]);
    let (right_down, down_left) = if weights.grid.contains(below) {
        (
            series(weights.up(below)[red], weights.left(below)[red]),
            series(weights.right(below)[k], weights.up(below)[k]),
        )
    } else {
        (0.0, 0.0)
    };
    let arcs = [left_up, up_right, right_down, down_left];
    let open: Vec<usize> = (0..4).filter(|&arc| arcs[arc] > 0.0).collect();
    // Neighbours in the order of the arcs: left, up, right, down; arc a joins neighbours a and a + 1.
    let mut group = [0.0; 4];
    match open.as_slice() {
        [] => return None,
        // Opposite arcs alone: two groups, the better one.
        &[a, b] if b - a == 2 => {
            let arc = if arcs[a] >= arcs[b] { a } else { b };
            group[arc] += arcs[arc];
            group[(arc + 1) % 4] += arcs[arc];
        }
        _ => {
            for arc in open {
                group[arc] += arcs[arc];
                group[(arc + 1) % 4] += arcs[arc];
            }
        }
    }
    let [left, up, right, down] = group;
    Some([left, right, up, down])
}
