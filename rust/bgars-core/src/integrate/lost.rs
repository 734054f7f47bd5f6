//! What the next coarser grid cannot hold.

use rayon::prelude::*;

use super::checkerboard::{Grid, Weights};
use super::detours::Window;
use super::edge_bits::EdgeBits;
use super::places::{Place, blacks_around, diagonal};
use super::strays::{is_alone, place};

/// The centres that tie together what has no coarse edge along the rim of their cell: indices among the reds, ascending. The
/// coarser grid serves them badly or not at all.
pub(super) fn doubtful_centres(weights: &Weights, bits: &EdgeBits) -> Vec<u32> {
    let half = weights.grid.half();
    let rows = (0..weights.grid.height / 2).into_par_iter().map(|cell_row| 2 * cell_row + 1);
    rows.flat_map_iter(|row| {
        doubtful_in_row(weights, bits, row as isize).into_iter().map(move |k| (row * half + k) as u32)
    })
    .collect()
}

/// The reds that get lost: indices in ascending order.
#[derive(Debug)]
pub(super) struct Lost {
    pub reds: Vec<u32>,
}

impl Lost {
    /// The centres that get lost: those of the `doubtful` that tie together what the `coarser` grid does not join nearby, or
    /// that have no corner at all.
    pub fn centres(doubtful: &[u32], weights: &Weights, coarser: &Weights) -> Self {
        let half = weights.grid.half();
        let is_lost = |&&red: &&u32| {
            let (row, k) = place(red, half);
            !has_detour(weights, coarser, row, k)
        };
        Self { reds: doubtful.par_iter().filter(is_lost).copied().collect() }
    }

    /// Adds the corners without edges on the `coarser` grid, and the centres tied to them.
    pub fn add_corners(&mut self, weights: &Weights, coarser: &Weights) {
        let half = weights.grid.half();
        let rows = (0..coarser.grid.height).into_par_iter();
        let found = rows.flat_map_iter(|coarse_row| {
            let row = 2 * coarse_row as isize;
            let sides = weights.row(row);
            // A corner without edges is tied to nothing.
            let tied = (0..half).filter(move |k| sides.iter().any(|side| side[k + 1] != 0.0));
            let alone = tied.filter(move |&k| is_alone(coarser, coarse_row, k));
            alone.flat_map(move |k| {
                let own = (diagonal(blacks_around(weights, (row, k))) > 0.0).then_some((row, k));
                own.into_iter().chain(tied_centres(weights, row, k))
            })
        });
        self.reds.par_extend(found.map(|(row, k)| (row as usize * half + k) as u32));
        self.reds.par_sort_unstable();
        self.reds.dedup();
    }
}

/// The centres that corner `k` of `row` is tied to.
fn tied_centres(weights: &Weights, row: isize, k: usize) -> impl Iterator<Item = Place> {
    let tied = move |&(cell, corner): &(Place, usize)| Rim::around(weights, cell.0, cell.1).is_tied(corner);
    cells_around(weights.grid, (row, k)).filter(tied).map(|(cell, _)| cell)
}

/// The cells around a corner by their centres: above left, above right, below right, below left; the corner's number in each.
pub(super) fn cells_around(grid: Grid, (row, k): Place) -> impl Iterator<Item = (Place, usize)> {
    let before = k.wrapping_sub(1);
    let cells = [((row - 1, before), 2), ((row - 1, k), 3), ((row + 1, k), 0), ((row + 1, before), 1)];
    cells.into_iter().filter(move |&((row, k), _)| grid.contains(row) && k < grid.half())
}

/// The centres of odd `row` that tie together what has no coarse edge along the rim of their cell.
fn doubtful_in_row(weights: &Weights, bits: &EdgeBits, row: isize) -> Vec<usize> {
    let mut centres = lacking_an_edge(bits, row);
    if !centres.is_empty() {
        let cells = CellRow::new(weights, row);
        centres.retain(|&k| cells.rim(k).is_doubtful());
    }
    centres
}

/// The centres of odd `row` in the mask whose cells lack an edge: all there, or none, is the common case.
fn lacking_an_edge(bits: &EdgeBits, row: isize) -> Vec<usize> {
    let (any, real) = (bits.any_around(row), bits.real_around(row));
    bits.places(|word| {
        let [up, right, down, left] = any.spokes(word);
        let [[a, b], [c, d], [e, f], [g, h]] = any.rims(word);
        let whole = (up & right & down & left) & (a & b & c & d) & (e & f & g & h);
        let [up, right, down, left] = real.spokes(word);
        (up | right | down | left) & !whole
    })
}

/// Whether the coarser grid joins all that centre `k` of odd `row` ties together by a short way around.
fn has_detour(weights: &Weights, coarser: &Weights, row: isize, k: usize) -> bool {
    let grid = weights.grid;
    let rim = Rim::around(weights, row, k).without_virtual();
    let mut pixels = rim.corners(0, 0);
    if pixels == 0 {
        return false;
    }
    for (side, (down, right)) in [(-1, 0), (0, 1), (1, 0), (0, -1)].into_iter().enumerate() {
        let beside = (row + 2 * down, k.wrapping_add_signed(right));
        if rim.leads_to_centre(side) && grid.contains(beside.0) && beside.1 < grid.half() {
            let corners = Rim::around(weights, beside.0, beside.1).without_virtual().corners(down, right);
            if corners == 0 {
                return false;
            }
            pixels |= corners;
        }
    }
    Window::around(coarser, (row / 2) as usize, k).joins(pixels)
}

/// The weights of the edges in a row of cells.
pub(super) struct CellRow<'a> {
    pub spokes: [&'a [f32]; 4],
    pub rims: [[&'a [f32]; 2]; 4],
    beyond: [&'a [f32]; 4],
}

impl<'a> CellRow<'a> {
    /// The cells around the centres of odd `row`.
    pub fn new(weights: &'a Weights, row: isize) -> Self {
        let n = weights.grid.half();
        let here = 1..=n;
        let next = 2..n + 2;
        Self {
            spokes: [weights.up(row), weights.right(row), weights.down(row), weights.left(row)]
                .map(|side| &side[here.clone()]),
            rims: [
                [&weights.right(row - 1)[here.clone()], &weights.left(row - 1)[next.clone()]],
                [&weights.down(row - 1)[next.clone()], &weights.up(row + 1)[next.clone()]],
                [&weights.left(row + 1)[next], &weights.right(row + 1)[here.clone()]],
                [&weights.up(row + 1)[here.clone()], &weights.down(row - 1)[here.clone()]],
            ],
            beyond: [
                &weights.down(row - 2)[here.clone()],
                &weights.left(row)[2..n + 2],
                &weights.up((row + 2).min(weights.grid.height as isize))[here],
                &weights.right(row)[..n],
            ],
        }
    }

    #[inline(always)]
    fn rim(&self, k: usize) -> Rim {
        Rim {
            spokes: self.spokes.map(|side| side[k]),
            rims: self.rims.map(|rim| rim.map(|side| side[k])),
            beyond: self.beyond.map(|side| side[k]),
        }
    }
}

/// The edges of one cell, clockwise from the top.
#[derive(Debug)]
pub(super) struct Rim {
    /// From the centre to the blacks above, right, below and left.
    pub spokes: [f32; 4],
    /// From each of these blacks to the corners before and after it: rim c joins the corners c and c + 1, counted clockwise
    /// from the top left.
    pub rims: [[f32; 2]; 4],
    /// From each of these blacks to the centre of the next cell.
    beyond: [f32; 4],
}

impl Rim {
    /// The cell of centre `k` of odd `row`.
    pub fn around(weights: &Weights, row: isize, k: usize) -> Self {
        CellRow::new(weights, row).rim(k)
    }

    /// Whether corner `c` and the centre are tied to a common black.
    fn is_tied(&self, c: usize) -> bool {
        let before = (c + 3) % 4;
        let tied = |side: usize, end: usize| self.spokes[side] > 0.0 && self.rims[side][end] != 0.0;
        tied(c, 0) || tied(before, 1)
    }

    /// The cell without its virtual corners.
    fn without_virtual(&self) -> Self {
        Self { rims: self.rims.map(|rim| rim.map(|weight| weight.max(0.0))), ..*self }
    }

    /// Whether the centre is tied to the next one on a side through a black that has no corner.
    fn leads_to_centre(&self, side: usize) -> bool {
        self.spokes[side] > 0.0 && self.beyond[side] > 0.0 && self.rims[side].iter().all(|&weight| weight == 0.0)
    }

    /// The tied corners as pixels of a window; the cell is `down` and `right` of the window's.
    fn corners(&self, down: isize, right: isize) -> u64 {
        let places = [(0, 0), (0, 1), (1, 1), (1, 0)].into_iter().enumerate();
        let tied = places.filter(|&(c, _)| self.is_tied(c));
        tied.map(|(_, place)| Window::pixel(down + place.0, right + place.1)).fold(0, |all, pixel| all | pixel)
    }

    fn is_doubtful(&self) -> bool {
        // Virtual corners hold nothing, and a centre outside the mask has nothing to hold.
        let real = self.without_virtual();
        if real.spokes.iter().all(|&spoke| spoke <= 0.0) {
            return false;
        }
        if (0..4).any(|side| real.leads_to_centre(side)) {
            return true;
        }
        let joined = |c: usize| real.rims[c][0] > 0.0 && real.rims[c][1] > 0.0;
        let corners = (0..4).filter(|&c| real.is_tied(c)).count();
        // Going around, the tied corners are one group if all but one of them are followed by a tied one along a rim.
        let linked = (0..4).filter(|&c| real.is_tied(c) && real.is_tied((c + 1) % 4) && joined(c)).count();
        corners == 0 || linked + 1 < corners
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_doubtful_centres_are_found() {
        let (weights, mut found) = (Weights::ragged([0.0, 0.0, 0.3, 0.7, 1.0, -0.5]), 0);
        let bits = EdgeBits::of(&weights);
        for row in (1..40).step_by(2) {
            let cells = CellRow::new(&weights, row);
            let slow = |&k: &usize| {
                let Rim { spokes, rims, .. } = cells.rim(k);
                let lacks_an_edge = spokes.iter().chain(rims.as_flattened()).any(|&weight| weight == 0.0);
                lacks_an_edge && cells.rim(k).is_doubtful()
            };
            let doubtful: Vec<usize> = (0..weights.grid.half()).filter(slow).collect();
            assert_eq!(doubtful_in_row(&weights, &bits, row), doubtful);
            found += doubtful.len();
        }
        assert!(found > 50, "{found}");
    }
}
