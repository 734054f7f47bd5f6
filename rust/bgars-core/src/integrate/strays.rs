//! Strays: the few reds of a grid that the next coarser one cannot hold become unknowns of their own.
//!
//! Where a lane is narrower than a coarse pixel here and there, the coarser grid loses it, and with it perhaps the only way
//! between two large parts. Such reds go straight to the graph at the end of the hierarchy, tied to whatever their
//! neighbours are there. Between the grids a stray follows its *base*, the mean of the neighbours that are none, so that the
//! functions of the coarser grid have no hole in its place; the graph's correction comes on top.

use super::checkerboard::Weights;
use super::graph::Rows;
use super::lost::{Lost, Rim};
use super::places::{Place, blacks_around, diagonal, reds_around, ties};

/// The strays of one grid.
#[derive(Debug)]
pub(super) struct Strays {
    /// Their indices among the reds, ascending.
    reds: Vec<u32>,
    /// A row a stray: `N D_red^-1`, what smoothing carries between it and the reds around it.
    smoothing: Rows,
    /// The reds around any stray, ascending.
    around: Vec<u32>,
    /// A row for each of these: the transpose of `smoothing`.
    to_around: Rows,
    /// A row a stray: the coarse pixels (row-major) that its value is measured from, and their shares.
    base: Rows,
    /// That less what the transfer between the grids gives the stray.
    adopted: Rows,
    coarse_width: usize,
    coarse_half: usize,
}

/// How far from other reds strays still have a base, in steps.
const ADOPTIONS: usize = 2;

/// Most coarse pixels of a base.
const MAX_SHARES: usize = 4;

impl Strays {
    /// The strays of a grid.
    pub fn new(weights: &Weights, coarser: &Weights, lost: &Lost) -> Self {
        let half = weights.grid.half();
        let coarse_pixels = coarser.grid.height * coarser.grid.width;
        let reds = lost.reds.clone();
        let base = bases(weights, coarser, &reds);
        let adopted: Vec<Shares> = reds
            .iter()
            .zip(&base)
            .map(|(&red, base)| {
                let mut rest = base.clone();
                let transferred = live_shares(weights, coarser, place(red, half));
                for (pixel, share) in transferred {
                    add_share(&mut rest, pixel, -share);
                }
                rest
            })
            .collect();
        let mut found = Vec::new();
        let smoothing: Vec<Shares> = reds
            .iter()
            .map(|&red| {
                ties(weights, place(red, half), &mut found);
                let factor = |place, weight: f64| weight / diagonal(blacks_around(weights, place));
                found
                    .iter()
                    .map(|&(place, weight)| (place.0 as usize * half + place.1, factor(place, weight)))
                    .collect()
            })
            .collect();
        let (around, to_around) = transposed(&smoothing);
        Self {
            reds,
            smoothing: Rows::from_lists(&smoothing, weights.grid.half_pixels()),
            around,
            to_around,
            base: Rows::from_lists(&base, coarse_pixels),
            adopted: Rows::from_lists(&adopted, coarse_pixels),
            coarse_width: coarser.grid.width,
            coarse_half: coarser.grid.half(),
        }
    }

    pub fn len(&self) -> usize {
        self.reds.len()
    }

    /// The indices of the strays among the reds.
    pub fn reds(&self) -> &[u32] {
        &self.reds
    }

    /// The number of the stray that red `red` is.
    pub fn find(&self, red: usize) -> Option<usize> {
        self.reds.binary_search(&(red as u32)).ok()
    }

    /// The coarse pixels that a stray's value is measured from, and their shares.
    pub fn base(&self, stray: usize) -> impl Iterator<Item = (usize, f32)> {
        self.base.pairs(stray)
    }

    /// What is left of `b` at the strays after smoothing, to `own` and to the coarse right side.
    pub fn restrict(&self, b: &[f32], own: &mut [f32], coarse_reds: &mut [f32], coarse_blacks: &mut [f32]) {
        let half = self.coarse_half;
        for (stray, own) in own.iter_mut().enumerate() {
            *own = self.smoothing.pairs(stray).map(|(red, factor)| factor * b[red]).sum();
            for (pixel, share) in self.adopted.pairs(stray) {
                let (row, col) = (pixel / self.coarse_width, pixel % self.coarse_width);
                let colour = if (row + col).is_multiple_of(2) { &mut *coarse_reds } else { &mut *coarse_blacks };
                colour[row * half + col / 2] += share * *own;
            }
        }
    }

    /// What the strays' `own` correction, smoothed, changes in the reds around them.
    pub fn changes(&self, own: &[f32], coarse: &[f32]) -> Changes<'_> {
        let adopted = |stray: usize| self.adopted.pairs(stray).map(|(pixel, share)| share * coarse[pixel]).sum::<f32>();
        let whole: Vec<f32> = own.iter().enumerate().map(|(stray, own)| own + adopted(stray)).collect();
        let mut values = vec![0.0; self.around.len()];
        self.to_around.multiply(&whole, &mut values);
        Changes { reds: &self.around, values }
    }
}

/// What is to be added to a few reds.
#[derive(Debug)]
pub(super) struct Changes<'a> {
    /// Their indices, ascending.
    reds: &'a [u32],
    values: Vec<f32>,
}

#[cfg(test)]
impl<'a> Changes<'a> {
    pub fn new(reds: &'a [u32], values: Vec<f32>) -> Self {
        Self { reds, values }
    }
}

impl Changes<'_> {
    /// Adds them to those of `reds` that they concern, which follow each other from `first` on.
    pub fn add_to(&self, first: usize, reds: &mut [f32]) {
        let from = |index: usize| self.reds.partition_point(|&red| (red as usize) < index);
        let concerned = from(first)..from(first + reds.len());
        for (&red, value) in self.reds[concerned.clone()].iter().zip(&self.values[concerned]) {
            reds[red as usize - first] += value;
        }
    }
}

/// The columns that have entries, ascending, and the rows of the transpose that are theirs.
fn transposed(rows: &[Shares]) -> (Vec<u32>, Rows) {
    let entries =
        rows.iter().enumerate().flat_map(|(row, shares)| shares.iter().map(move |&(at, share)| (at, row, share)));
    let mut entries: Vec<_> = entries.collect();
    entries.sort_unstable_by_key(|&(column, row, _)| (column, row));
    let columns = entries.chunk_by(|a, b| a.0 == b.0);
    let lists: Vec<Shares> =
        columns.clone().map(|column| column.iter().map(|entry| (entry.1, entry.2)).collect()).collect();
    (columns.map(|column| column[0].0 as u32).collect(), Rows::from_lists(&lists, rows.len()))
}

/// Coarse pixels and the shares that they have in a value.
type Shares = Vec<(usize, f64)>;

fn add_share(shares: &mut Shares, pixel: usize, share: f64) {
    match shares.iter_mut().find(|known| known.0 == pixel) {
        Some(known) => known.1 += share,
        None => shares.push((pixel, share)),
    }
}

/// The base of each stray: the mean of its neighbours that are no strays; failing these, of their neighbours.
fn bases(weights: &Weights, coarser: &Weights, reds: &[u32]) -> Vec<Shares> {
    let half = weights.grid.half();
    let mut found = Vec::new();
    let mut bases = vec![Shares::new(); reds.len()];
    for _ in 0..ADOPTIONS {
        let mut mean_around = |stray: usize| {
            let mut mean = Shares::new();
            ties(weights, place(reds[stray], half), &mut found);
            for &((row, k), weight) in &found {
                let shares = match reds.binary_search(&((row as usize * half + k) as u32)) {
                    Ok(stray) => bases[stray].clone(),
                    Err(_) => live_shares(weights, coarser, (row, k)),
                };
                for (pixel, share) in shares {
                    add_share(&mut mean, pixel, weight * share);
                }
            }
            normalise(&mut mean);
            mean
        };
        let orphans = (0..reds.len()).filter(|&stray| bases[stray].is_empty());
        let adopted: Vec<(usize, Shares)> = orphans.map(|stray| (stray, mean_around(stray))).collect();
        for (stray, shares) in adopted {
            bases[stray] = shares;
        }
    }
    bases
}

/// Keeps the largest shares and makes them add up to 1.
fn normalise(shares: &mut Shares) {
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shares.truncate(MAX_SHARES);
    let sum: f64 = shares.iter().map(|share| share.1).sum();
    for share in shares {
        share.1 /= sum;
    }
}

/// The shares of the coarse pixels that have edges: the others are always 0.
fn live_shares(weights: &Weights, coarser: &Weights, red: Place) -> Shares {
    let mut shares = Vec::new();
    coarse_shares(weights, red, &mut shares);
    let width = coarser.grid.width;
    shares.retain(|&(pixel, _)| !is_alone(coarser, pixel / width, pixel % width));
    shares
}

/// True for a pixel without edges.
pub(super) fn is_alone(weights: &Weights, row: usize, col: usize) -> bool {
    let place = (row as isize, col / 2);
    let is_red = (row + col).is_multiple_of(2);
    diagonal(if is_red { blacks_around(weights, place) } else { reds_around(weights, place) }) == 0.0
}

/// Where red `red` lies.
pub(super) fn place(red: u32, half: usize) -> Place {
    ((red as usize / half) as isize, red as usize % half)
}

/// The coarse pixels (row-major) that a red takes its value from, and their shares (see `transfer`).
pub(super) fn coarse_shares(weights: &Weights, (row, k): Place, shares: &mut Vec<(usize, f64)>) {
    let width = weights.grid.coarser().width;
    shares.clear();
    if row % 2 == 0 {
        shares.push((row as usize / 2 * width + k, 1.0));
        return;
    }
    let rim = Rim::around(weights, row, k);
    let tie = |side: usize| f64::from(rim.rims[side][0].abs() + rim.rims[side][1].abs());
    let tied = (0..4).filter(|&side| tie(side) > 0.0);
    let sum: f64 = tied.clone().map(|side| f64::from(rim.spokes[side])).sum();
    if sum <= 0.0 {
        return;
    }
    let top = (row - 1) as usize / 2 * width + k;
    let corners = [top, top + 1, top + width + 1, top + width];
    for side in tied {
        for (end, weight) in rim.rims[side].into_iter().enumerate() {
            let share = f64::from(rim.spokes[side]) / sum * f64::from(weight.abs()) / tie(side);
            if share > 0.0 {
                let corner = corners[(side + end) % 4];
                match shares.iter_mut().find(|known| known.0 == corner) {
                    Some(known) => known.1 += share,
                    None => shares.push((corner, share)),
                }
            }
        }
    }
}
