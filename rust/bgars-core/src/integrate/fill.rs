//! Virtual corners: a hole of one pixel must not grow with every coarser grid.
//!
//! A coarser grid keeps the corners only. A corner outside the mask would leave a gap of one pixel there on every grid below,
//! twice as wide each time. So it is kept as a *virtual* pixel, tied to its neighbours as if it were in the mask; it carries
//! values between grids but has no part in the system. It may not join what the mask keeps apart: its neighbours must be
//! connected around it, through the centres; of several groups it takes the one that conducts best.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{PaddedRow, Weights};
use super::coarsen::series;
use super::places::above_zero;
use super::real::{greater, lesser};
use super::stops::stops;

/// Ties every corner without edges to the neighbours around it, or makes it a stop. These are a grid's last edges: its spans
/// follow.
pub(super) fn fill_corners(weights: &mut Weights) {
    for tied in [ways_around, stops] {
        for (row, k, ties) in tied(weights) {
            weights.set_red(row, k, ties.map(|tie| -tie));
        }
    }
    weights.find_spans();
}

/// Corners to be tied, by row and number, and their ties: left, right, up, down.
pub(super) type Tied = Vec<(usize, usize, [f32; 4])>;

/// The corners without edges that have a way around.
fn ways_around(weights: &Weights) -> Tied {
    let n = weights.grid.half();
    (0..weights.grid.height.div_ceil(2))
        .into_par_iter()
        .flat_map_iter(|coarse_row| {
            let row = 2 * coarse_row;
            let around = Around::new(weights, row as isize);
            let mut free = vec![0.0; n];
            find_free(&around, &mut free);
            let candidates = above_zero(&free).into_iter();
            candidates.filter_map(move |k| around.virtual_ties(k).map(|ties| (row, k, ties)))
        })
        .collect()
}

/// The weights in and beside a row of corners: left, right, up, down.
pub(super) struct Around<'a> {
    above: [PaddedRow<'a, f32>; 4],
    here: [PaddedRow<'a, f32>; 4],
    below: [PaddedRow<'a, f32>; 4],
}

/// Of each corner without edges the strongest way around, by its weaker edge; 0 for the others. Corners are seldom of this
/// kind: one fast pass finds them.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn find_free(around: &Around<'_>, free: &mut [f32]) {
    let n = free.len();
    let ([left_above, right_above, _, down_above], [left_below, right_below, up_below, _]) =
        (around.above, around.below);
    let arcs = [
        [&down_above[..n], &right_above[..n]],
        [&left_above[1..=n], &down_above[1..=n]],
        [&up_below[1..=n], &left_below[1..=n]],
        [&right_below[..n], &up_below[..n]],
    ];
    let own = around.here.map(|side| &side[1..=n]);
    for k in 0..n {
        let (mut tied, mut way) = (0.0f32, 0.0f32);
        for side in own {
            tied = greater(tied, side[k].abs());
        }
        for [a, b] in arcs {
            way = greater(way, lesser(a[k].abs(), b[k].abs()));
        }
        free[k] = if tied == 0.0 { way } else { 0.0 };
    }
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
        let open: Vec<usize> = (0..4).filter(|&arc| arcs[arc] > 0.0).collect();
        // Neighbours in the order of the arcs: left, up, right, down; arc a joins neighbours a and a + 1.
        let mut group = [0.0; 4];
        match open.as_slice() {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pass_finds_all_corners_to_be_tied() {
        let (weights, mut found) = (Weights::ragged([0.0, 0.0, 0.0, 0.0, 0.7, -0.5]), 0);
        let n = weights.grid.half();
        for row in (0..40).step_by(2) {
            let (around, mut free) = (Around::new(&weights, row), vec![0.0; n]);
            find_free(&around, &mut free);
            for k in (0..n).filter(|&k| around.virtual_ties(k).is_some()) {
                assert!(free[k] > 0.0, "corner {k} of row {row}");
                found += 1;
            }
        }
        assert!(found > 5, "{found}");
    }
}
