//! A graph Laplacian on all pixels of a grid: the 5-point stencil, never stored as a matrix.

use std::borrow::Cow;

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Colour, Grid, TASK, split_row};
use super::real::Real;

pub(super) const LEFT: usize = 0;
pub(super) const RIGHT: usize = 1;
pub(super) const UP: usize = 2;
pub(super) const DOWN: usize = 3;

/// Edges from a row of pixels to the right or down: their weights, and how much each moves of the right side from its first pixel
/// to its second.
#[derive(Debug)]
pub(super) struct EdgeRow<W> {
    pub weight: Vec<W>,
    pub push: Vec<f64>,
}

impl<W: Real> EdgeRow<W> {
    fn zeros(width: usize) -> Self {
        Self { weight: vec![W::default(); width], push: vec![0.0; width] }
    }

    pub fn clear(&mut self) {
        self.weight.fill(W::default());
        self.push.fill(0.0);
    }
}

/// The weights of the edges between neighbouring pixels, kept at the red end of each: in `f32` 8 bytes a pixel.
#[derive(Clone, Debug)]
pub(super) struct Stencil<W = f32> {
    pub grid: Grid,
    /// From each red to the left, right, up and down; a zero before each row and after the last.
    sides: [Vec<W>; 4],
    /// The weights of a row that is not there.
    pub(super) no_weights: Vec<W>,
}

impl<W: Real> Stencil<W> {
    /// From the edges to the right of and below each row of pixels: `rows_of()` gives a function that sets them, asked for row by
    /// row within a band and for the row above it. What leads out of the grid must be zero. Where a right side is asked for, it
    /// becomes what edges push onto the pixels of either colour, less what they take.
    #[allow(clippy::needless_pass_by_value)] // one loan, for this call
    pub fn from_edges<Rows>(grid: Grid, rows_of: impl Fn() -> Rows + Sync, right: Option<&mut [Vec<f64>; 2]>) -> Self
    where
        Rows: FnMut(usize, &mut EdgeRow<W>, &mut EdgeRow<W>),
    {
        let (half, stride) = (grid.half(), grid.half() + 1);
        let mut sides: [Vec<W>; 4] = std::array::from_fn(|_| vec![W::default(); grid.height * stride + 1]);
        let [left, right_side, up, down] = sides.each_mut().map(|side| side[1..].par_chunks_mut(BAND_ROWS * stride));
        let bands = grid.height.div_ceil(BAND_ROWS);
        let pushed: Vec<Option<[&mut [f64]; 2]>> = match right {
            None => (0..bands).map(|_| None).collect(),
            Some([reds, blacks]) => {
                let chunk = BAND_ROWS * half;
                reds.chunks_mut(chunk)
                    .zip(blacks.chunks_mut(chunk))
                    .map(|(reds, blacks)| Some([reds, blacks]))
                    .collect()
            }
        };
        let bands = (left, right_side, up, down, pushed).into_par_iter().enumerate();
        bands.for_each(|(band, (left, right, up, down, mut pushed))| {
            let first = band * BAND_ROWS;
            let mut set = rows_of();
            let [mut along, mut above, mut below] = std::array::from_fn(|_| EdgeRow::zeros(grid.width));
            let (mut unused, mut divergence) = (vec![W::default(); half], vec![0.0; grid.width]);
            if first > 0 {
                set(first - 1, &mut along, &mut above);
            }
            for (k, row) in (first..grid.height.min(first + BAND_ROWS)).enumerate() {
                set(row, &mut along, &mut below);
                let span = k * stride..k * stride + half;
                // An edge to the right is its red left end's; with a black one it is to the left of red k, or in even rows k + 1.
                let before = k * stride + 1 - row % 2;
                split_row(row, &along.weight, [&mut right[span.clone()], &mut left[before..before + half]]);
                split_row(row, &below.weight, [&mut down[span.clone()], &mut unused]);
                split_row(row, &above.weight, [&mut up[span], &mut unused]);
                if let Some(pushed) = &mut pushed {
                    diverge([&above.push, &along.push, &below.push], &mut divergence);
                    let span = k * half..(k + 1) * half;
                    split_row(row, &divergence, pushed.each_mut().map(|colour| &mut colour[span.clone()]));
                }
                std::mem::swap(&mut above, &mut below);
            }
        });
        Self { grid, sides, no_weights: vec![W::default(); half] }
    }

    /// Where the weights of a row begin.
    #[inline(always)]
    fn start(&self, row: usize) -> usize {
        row * (self.grid.half() + 1) + 1
    }

    /// Weights from the pixels of one colour of a row to the left, right, up and down.
    #[inline(always)]
    pub fn weights(&self, colour: Colour, row: usize) -> [&[W]; 4] {
        let (half, start, stride) = (self.grid.half(), self.start(row), self.grid.half() + 1);
        let side = |side: usize, first: usize| &self.sides[side][first..first + half];
        // Nothing leads up from the first row, nor down from the last.
        let (is_first, is_last) = (row == 0, row + 1 == self.grid.height);
        match colour {
            Colour::Red => [side(LEFT, start), side(RIGHT, start), side(UP, start), side(DOWN, start)],
            Colour::Black => [
                side(RIGHT, start - row % 2),
                side(LEFT, start + 1 - row % 2),
                if is_first { side(UP, start) } else { side(DOWN, start - stride) },
                if is_last { side(DOWN, start) } else { side(UP, start + stride) },
            ],
        }
    }

    /// Sets the values of one colour: `set(&mut value, sum, diagonal, input)` gets the weighted sum of the neighbours' values,
    /// the sum of the weights, and the number of `input` at the place.
    pub fn update<T: Real + From<W>>(
        &self,
        colour: Colour,
        neighbours: &[T],
        input: &[T],
        values: &mut [T],
        set: impl Fn(&mut T, T, T, T) + Sync,
    ) {
        let half = self.grid.half();
        let bands = values.par_chunks_mut(BAND_ROWS * half).with_min_len(TASK.div_ceil(BAND_ROWS * half));
        bands.enumerate().for_each(|(band, values)| {
            for (row, values) in (band * BAND_ROWS..).zip(values.chunks_mut(half)) {
                let of_row = |row: usize| &neighbours[row * half..(row + 1) * half];
                let vertical = [of_row(row.saturating_sub(1)), of_row((row + 1).min(self.grid.height - 1))];
                let beside = self.beside(colour, row, neighbours);
                let input = &input[row * half..(row + 1) * half];
                update_row(self.weights(colour, row), &beside, vertical, input, values, &set);
            }
        });
    }

    /// The neighbours to the left and right of a row's pixels of one colour: those of pixel k are k and k + 1.
    #[inline(always)]
    fn beside<'a, T: Real>(&self, colour: Colour, row: usize, neighbours: &'a [T]) -> Cow<'a, [T]> {
        let half = self.grid.half();
        let (start, is_first) = (row * half, colour.first_col(row) == 0);
        let first = (start + usize::from(!is_first)).checked_sub(1);
        // Beside the row lies any number, which no weight leads to; at the ends of the vector there is none.
        if let Some(beside) = first.and_then(|first| neighbours.get(first..=first + half)) {
            return Cow::Borrowed(beside);
        }
        let row = &neighbours[start..start + half];
        let ends = [&[T::default()][..], &[]];
        let [before, after] = if is_first { ends } else { [ends[1], ends[0]] };
        Cow::Owned([before, row, after].concat())
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

/// [`Stencil::update`] of a row.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn update_row<W: Copy, T: Real + From<W>, F: Fn(&mut T, T, T, T)>(
    weights: [&[W]; 4],
    beside: &[T],
    vertical: [&[T]; 2],
    input: &[T],
    values: &mut [T],
    set: &F,
) {
    let n = values.len();
    let [w_left, w_right, w_up, w_down] = weights.map(|side| &side[..n]);
    let (left, right, [up, down], input) = (&beside[..n], &beside[1..=n], vertical.map(|row| &row[..n]), &input[..n]);
    for k in 0..n {
        let [l, r, u, d] = [w_left[k], w_right[k], w_up[k], w_down[k]].map(<T as From<W>>::from);
        let sum = (l * left[k] + r * right[k]) + (u * up[k] + d * down[k]);
        set(&mut values[k], sum, (l + r) + (u + d), input[k]);
    }
}
