//! The blacks that follow from reds, and what the system leaves: the right side of the reduced system, its true residual, and the
//! end of a solution.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Grid, Weights};
use super::edges::Colours;
use super::real::{Real, on_vectors};
use super::reduction::load;
use super::residual::{Residual, split};
use super::ring::Ring;
use super::spans::{Span, each_or_none};
use crate::vector::Packed;

/// Sets some rows of a right side, reds and blacks.
pub(super) type SetRows<'a> = dyn Fn(Range<usize>, [&mut [f64]; 2]) + Send + Sync + 'a;

/// The right side of a system, which is needed before the iterations and after them.
pub(super) enum Right<'a> {
    /// In memory, and perhaps how to make it again.
    Kept(Colours, Option<&'a SetRows<'a>>),
    /// Made anew, row by row.
    Anew(&'a SetRows<'a>),
}

impl Right<'_> {
    /// Gives its memory back to the system if it can be made again.
    pub fn release(&mut self) {
        let &mut Self::Kept(_, Some(again)) = self else { return };
        if let Self::Kept(Colours { reds, blacks, .. }, _) = std::mem::replace(self, Self::Anew(again)) {
            reds.release();
            blacks.release();
        }
    }

    /// The rows from one before a band to one after it, as far as there are any.
    fn around<'b>(&'b self, grid: Grid, band: usize, [reds, blacks]: &'b mut [Vec<f64>; 2]) -> Given<'b> {
        match self {
            Self::Kept(Colours { reds, blacks, .. }, _) => (reds, blacks, 0),
            Self::Anew(again) => {
                let first = band * BAND_ROWS;
                let rows = first.saturating_sub(1)..(first + BAND_ROWS + 1).min(grid.height);
                let (start, size) = (rows.start, rows.len() * grid.half());
                reds.resize(size, 0.0);
                blacks.resize(size, 0.0);
                again(rows, [reds, blacks]);
                (reds, blacks, start)
            }
        }
    }
}

/// `blacks = D_black^-1 (right.blacks + W^T reds)`, and what the system leaves at the reds: `left = right.reds + W blacks - D_red reds`.
/// Returns the square sum of `left`. Both are zero beside the spans of the grid.
///
/// From no reds, `left` is the right side of the reduced system; from a solution, `blacks` are the rest of it. Each is written
/// where it is asked for.
pub(super) fn settle(
    weights: &Weights,
    right: &Right<'_>,
    reds: Option<&[f64]>,
    blacks: Option<&mut [f64]>,
    left: Option<&mut Residual>,
) -> f64 {
    let half = weights.grid.half();
    let (chunk, bands) = (BAND_ROWS * half, weights.spans.len());
    let blacks = each_or_none(blacks.map(|blacks| blacks.chunks_mut(chunk)), bands);
    let left = each_or_none(left.map(|left| left.chunks_mut(chunk)), bands);
    let squares: Vec<f64> = (blacks, left)
        .into_par_iter()
        .enumerate()
        .map_init(
            || (Settling::new(half), [Vec::new(), Vec::new()]),
            |(rows, made), (band, out)| {
                settle_band(weights, right.around(weights.grid, band, made), reds, band, rows, out)
            },
        )
        .collect();
    squares.iter().sum()
}

/// Rows of the right side: reds, blacks, and which row of the grid is their first.
type Given<'a> = (&'a [f64], &'a [f64], usize);

/// The rows of a band to write, where they are asked for: of the blacks, and of what is left.
type Settled<'a> = (Option<&'a mut [f64]>, Option<[&'a mut [f32]; 2]>);

/// Rows on their way.
struct Settling {
    reds: Ring<f64>,
    blacks: Ring<f64>,
    left: Vec<f64>,
}

impl Settling {
    fn new(half: usize) -> Self {
        Self { reds: Ring::new(half), blacks: Ring::new(half), left: vec![0.0; half] }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn settle_band(
    weights: &Weights,
    given: Given<'_>,
    reds: Option<&[f64]>,
    band: usize,
    rows: &mut Settling,
    out: Settled<'_>,
) -> f64 {
    on_vectors!(weights.grid, [f64], settle_band_with(weights, given, reds, band, rows, out))
}

#[inline(always)]
fn settle_band_with<V: Packed<Number = f64>>(
    weights: &Weights,
    (given_reds, given_blacks, first_given): Given<'_>,
    reds: Option<&[f64]>,
    band: usize,
    rows: &mut Settling,
    (mut blacks, mut left): Settled<'_>,
) -> f64 {
    let n = weights.grid.half();
    let first = (band * BAND_ROWS) as isize;
    let end = (first + BAND_ROWS as isize).min(weights.grid.height as isize);
    let span = weights.spans.band(band);
    if let Some(blacks) = &mut blacks {
        clear_beside(span, n, blacks);
    }
    left.iter_mut().flatten().for_each(|floats| clear_beside(span, n, floats));
    let mut squares = 0.0;
    for row in first - 2..=end + 1 {
        // Without any, the rows stay zero.
        if let Some(reds) = reds {
            load(weights.grid, reds, row, span, rows.reds.row_mut(row), |value| value);
        }
        let row = row - 1;
        if row >= first - 1 && weights.grid.contains(row) {
            let stencil = weights.black_stencil::<V>(row, span, rows.reds.around(row));
            let given = V::chunks(&given_blacks[(row as usize - first_given) * n..][span.range()], stencil.len());
            let out = V::chunks_mut(&mut rows.blacks.row_mut(row)[span.start..], stencil.len());
            for k in 0..stencil.len() {
                (V::read(&given[k]) + stencil.sum(k)).over(stencil.diagonal(k)).put(&mut out[k]);
            }
            if let Some(blacks) = &mut blacks
                && (first..end).contains(&row)
            {
                let solved = &rows.blacks.row(row)[1..][span.range()];
                blacks[(row - first) as usize * n..][span.range()].copy_from_slice(solved);
            }
        }
        let row = row - 1;
        if row < first {
            continue;
        }
        let stencil = weights.red_stencil::<V>(row, span, rows.blacks.around(row));
        let given = V::chunks(&given_reds[(row as usize - first_given) * n..][span.range()], stencil.len());
        let own = V::chunks(&rows.reds.row(row)[1 + span.start..], stencil.len());
        let out = V::chunks_mut(&mut rows.left[span.range()], stencil.len());
        let mut square = V::splat(V::Number::default());
        for k in 0..stencil.len() {
            let rest = (V::read(&given[k]) + stencil.sum(k)) - stencil.diagonal(k) * V::read(&own[k]);
            rest.put(&mut out[k]);
            square = rest.times_plus(rest, square);
        }
        squares += square.sum();
        if let Some(left) = &mut left {
            let out = left.each_mut().map(|floats| &mut floats[(row - first) as usize * n..][span.range()]);
            split(&rows.left[span.range()], out);
        }
    }
    squares
}

/// Zeros beside a span in all rows of a band.
fn clear_beside<T: Default + Clone>(span: Span, half: usize, band: &mut [T]) {
    for row in band.chunks_mut(half) {
        row[..span.start].fill(T::default());
        row[span.end..].fill(T::default());
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;
    use crate::integrate::places::{Place, blacks_around, diagonal, reds_around};
    use crate::memory::Aligned;

    /// Sum of weights times values at the far ends of a pixel's edges.
    fn sum_around(edges: [(Place, f64); 4], half: usize, values: &[f64]) -> f64 {
        let real = edges.into_iter().filter(|edge| edge.1 > 0.0);
        real.map(|((row, k), weight)| weight * values[row as usize * half + k]).sum()
    }

    /// One pixel at a time; what is beside the spans is zero, whatever the memory held.
    #[test]
    fn blacks_follow_from_reds_and_the_rest_is_left() {
        let mut weights = Weights::ragged([0.0, 0.3, 1.0, 0.7, -0.5, 0.0]);
        // Nothing to the right of two whole vectors.
        for row in 0..weights.grid.height {
            (31..weights.grid.half()).for_each(|k| weights.set_red(row, k, [0.0; 4]));
        }
        weights.find_spans();
        let (grid, half) = (weights.grid, weights.grid.half());
        let number = |seed: usize| ((seed * 2_654_435_761) >> 7) as f64 % 1000.0 / 1000.0 - 0.5;
        let mut right =
            Colours { reds: Aligned::zeros(grid.half_pixels()), blacks: Aligned::zeros(grid.half_pixels()), norm: 0.0 };
        let mut reds = vec![0.0; grid.half_pixels()];
        let (mut blacks, mut left) = (vec![7.0; reds.len()], Residual::any(reds.len()));
        split(&vec![7.0; reds.len()], left.chunks_mut(reds.len()).next().unwrap());
        for (place, red) in reds.iter_mut().enumerate() {
            *red = number(place);
            (right.reds[place], right.blacks[place]) = (number(place + 9_999), number(place + 77_777));
        }
        let all = [right.reds.to_vec(), right.blacks.to_vec()];
        let again = |rows: Range<usize>, colours: [&mut [f64]; 2]| {
            for (colour, all) in colours.into_iter().zip(&all) {
                colour.copy_from_slice(&all[rows.start * half..rows.end * half]);
            }
        };
        let mut given = Right::Kept(right, Some(&again));
        let squares = settle(&weights, &given, Some(&reds), Some(&mut blacks), Some(&mut left));
        let sums = |left: &mut Residual| -> Vec<f64> {
            let [rounded, missing] = left.chunks_mut(reds.len()).next().unwrap();
            let sum = |(&rounded, &missing): (&f32, &f32)| f64::from(rounded) + f64::from(missing);
            rounded.iter().zip(&*missing).map(sum).collect()
        };
        let first_left = sums(&mut left);
        let (mut expected, mut beside) = (0.0, 0);
        for row in 0..grid.height {
            let span = weights.spans.at(row as isize);
            for k in 0..half {
                let (at, place) = (row * half + k, (row as isize, k));
                if !span.range().contains(&k) {
                    assert!(blacks[at] == 0.0 && first_left[at] == 0.0, "beside: {k} of row {row}");
                    beside += 1;
                    continue;
                }
                let edges = reds_around(&weights, place);
                let sum = diagonal(edges);
                let black = if sum > 0.0 { (all[1][at] + sum_around(edges, half, &reds)) / sum } else { 0.0 };
                assert!((blacks[at] - black).abs() < 1e-12, "black {k} of row {row}");
                let edges = blacks_around(&weights, place);
                let rest = all[0][at] + sum_around(edges, half, &blacks) - diagonal(edges) * reds[at];
                assert!((first_left[at] - rest).abs() < 1e-12, "red {k} of row {row}");
                expected += rest * rest;
            }
        }
        assert!(beside > 0);
        assert!((squares - expected).abs() < 1e-12 * expected && expected > 1.0, "{squares} for {expected}");

        let kept = (squares, blacks.clone(), first_left);
        given.release();
        assert!(matches!(given, Right::Anew(_)));
        let squares = settle(&weights, &given, Some(&reds), Some(&mut blacks), Some(&mut left));
        assert!((squares, blacks.clone(), sums(&mut left)) == kept, "a right side made again");
        blacks.fill(7.0);
        assert!(squares == settle(&weights, &given, Some(&reds), Some(&mut blacks), None) && blacks == kept.1);
        assert!(squares == settle(&weights, &given, Some(&reds), None, None));
    }
}
