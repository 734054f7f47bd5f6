//! A 5-point system from its edges: the one frame of least squares and bilateral integration.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Band, Grid, Weights, split_whole_row};
use super::reduction::dot;
use crate::memory::Aligned;

/// A right side, or a solution, by colour.
#[derive(Debug)]
pub(super) struct Colours {
    pub reds: Aligned<f64>,
    pub blacks: Aligned<f64>,
    /// The norm of both, as they were made.
    pub norm: f64,
}

/// Where the edges of a row lead.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    /// From each pixel to the one to its right.
    Right,
    /// From each pixel to the one below.
    Below,
}

/// Weights of a row's edges, and how much of the right side each moves from its first pixel to its second.
#[derive(Debug)]
pub(super) struct EdgeRow {
    pub weight: Vec<f32>,
    pub push: Vec<f64>,
}

impl EdgeRow {
    fn zeros(width: usize) -> Self {
        Self { weight: vec![0.0; width], push: vec![0.0; width] }
    }

    fn clear(&mut self) {
        self.weight.fill(0.0);
        self.push.fill(0.0);
    }
}

/// Weights and right side of a graph on the pixels of a grid.
///
/// Each band of rows asks `joiner` for a function that sets the edges of a row, all of them: to the right there is one less than
/// pixels, and the place of the last stays zero. The rows come in order, each to the right and then below, after the edges
/// above the band's first row.
pub(super) fn from_edges<Join>(grid: Grid, joiner: impl Fn() -> Join + Sync) -> (Weights, Colours)
where
    Join: FnMut(Axis, usize, &mut EdgeRow),
{
    let half = grid.half();
    let mut weights = Weights::unset(grid);
    let [mut reds, mut blacks] = [(); 2].map(|()| Aligned::any(grid.half_pixels()));
    let bands =
        weights.bands_mut().zip(reds.par_chunks_mut(BAND_ROWS * half)).zip(blacks.par_chunks_mut(BAND_ROWS * half));
    let square_of = |((mut weights, reds), blacks): ((Band<'_>, &mut [f64]), &mut [f64])| {
        let rows = weights.rows.clone();
        each_row(grid, joiner(), rows.clone(), [&mut *reds, &mut *blacks], |row, [above, along, below]| {
            if row == rows.start {
                weights.set_above(&above.weight);
            }
            weights.set_row(row, &along.weight, &below.weight);
        });
        dot(reds, reds) + dot(blacks, blacks)
    };
    // Each band by itself: the same bits for any number of threads.
    let squares: Vec<f64> = bands.map(square_of).collect();
    let norm = squares.iter().sum::<f64>().sqrt();
    (weights, Colours { reds, blacks, norm })
}

/// Calls `visit` for each of some rows with the edges above, along and below it, and sets the right side of these rows, both
/// colours. `join` is asked as for [`from_edges`].
pub(super) fn each_row(
    grid: Grid,
    mut join: impl FnMut(Axis, usize, &mut EdgeRow),
    rows: Range<usize>,
    [reds, blacks]: [&mut [f64]; 2],
    mut visit: impl FnMut(usize, [&EdgeRow; 3]),
) {
    let half = grid.half();
    let [mut above, mut along, mut below] = std::array::from_fn(|_| EdgeRow::zeros(grid.width));
    if let Some(row) = rows.start.checked_sub(1) {
        join(Axis::Below, row, &mut above);
    }
    let mut divergence = vec![0.0f64; grid.width];
    for (row, (reds, blacks)) in rows.zip(reds.chunks_mut(half).zip(blacks.chunks_mut(half))) {
        join(Axis::Right, row, &mut along);
        if row + 1 < grid.height {
            join(Axis::Below, row, &mut below);
        } else {
            below.clear();
        }
        visit(row, [&above, &along, &below]);
        diverge([&above.push, &along.push, &below.push], &mut divergence);
        split_whole_row(row, &divergence, reds, blacks);
        std::mem::swap(&mut above, &mut below);
    }
}

/// What the edges above, along and below a row push onto its pixels, less what they take.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn diverge([above, along, below]: [&[f64]; 3], divergence: &mut [f64]) {
    let n = divergence.len();
    let (above, along, below) = (&above[..n], &along[..n], &below[..n]);
    for k in 0..n {
        divergence[k] = (above[k] - below[k]) - along[k];
    }
    for (divergence, left) in divergence[1..].iter_mut().zip(along) {
        *divergence += left;
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::super::checkerboard::{DOWN, LEFT, RIGHT, UP};
    use super::*;

    /// A number of its own for every edge.
    fn weight(axis: Axis, row: usize, k: usize) -> f32 {
        (1 + row * 1_000 + 2 * k + usize::from(axis == Axis::Below)) as f32
    }

    /// Weights by edge and divergences by pixel, one at a time; the push of an edge is its weight squared.
    #[test]
    fn a_red_knows_its_four_edges_and_each_pixel_its_pushes() {
        for (height, width) in [(1, 1), (1, 2), (2, 1), (3, 7), (33, 16), (34, 31), (64, 32), (65, 33), (97, 48)] {
            let grid = Grid { height, width };
            let edges_of = |axis: Axis| if axis == Axis::Right { width - 1 } else { width };
            let join = |axis: Axis, row: usize, edges: &mut EdgeRow| {
                for k in 0..edges_of(axis) {
                    edges.weight[k] = weight(axis, row, k);
                    edges.push[k] = f64::from(edges.weight[k]).powi(2);
                }
            };
            let (weights, right) = from_edges(grid, || join);
            let half = grid.half();
            for rows in [0..height, height / 2..height, height / 3..height.div_ceil(2)] {
                let [mut reds, mut blacks] = [vec![7.0; rows.len() * half], vec![7.0; rows.len() * half]];
                each_row(grid, join, rows.clone(), [&mut reds, &mut blacks], |_, _| ());
                let given = rows.start * half..rows.end * half;
                assert_eq!((&reds[..], &blacks[..]), (&right.reds[given.clone()], &right.blacks[given]), "{rows:?}");
            }
            for row in 0..height {
                for place in 0..2 * half {
                    let at = |axis: Axis, row: isize, col: isize, inside: bool| {
                        if inside { weight(axis, row as usize, col as usize) } else { 0.0 }
                    };
                    let (r, c, exists) = (row as isize, place as isize, place < width);
                    let mut edges = [0.0; 4];
                    edges[LEFT] = at(Axis::Right, r, c - 1, exists && place > 0);
                    edges[RIGHT] = at(Axis::Right, r, c, place + 1 < width);
                    edges[UP] = at(Axis::Below, r - 1, c, exists && row > 0);
                    edges[DOWN] = at(Axis::Below, r, c, exists && row + 1 < height);
                    let (k, is_red) = (place / 2, (row + place) % 2 == 0);
                    if is_red {
                        let kept = weights.row(r);
                        assert_eq!(kept.map(|side| side[k + 1]), edges, "{grid:?}: red at {row}, {place}");
                    }
                    let push = edges.map(|weight| f64::from(weight).powi(2));
                    let colour = if is_red { &right.reds } else { &right.blacks };
                    let expected = push[UP] - push[DOWN] - push[RIGHT] + push[LEFT];
                    assert_eq!(colour[row * half + k], expected, "{grid:?}: pushes at {row}, {place}");
                }
            }
        }
    }
}
