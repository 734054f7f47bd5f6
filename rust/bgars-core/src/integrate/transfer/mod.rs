//! Between a grid and the next coarser one, with smoothing on the way: the two halves of a V-cycle.
//!
//! Everything acts on the *reduced* system: the blacks are eliminated exactly, so only the reds are unknown,
//! `S = D_red - W D_black^-1 W^T`. Reds of even rows are the corners (the pixels of the coarser grid), reds of odd rows the
//! centres; blacks lie on the edges between corners. A value of the coarser grid reaches the blacks of even rows from left
//! and right, those of odd rows from above and below, in proportion to the weights of these edges, and from the blacks the
//! centres. Nothing passes an edge of weight zero, so the two sides of a cut stay apart however thin it is.
//!
//! Smoothing is one damping-free Jacobi step on the reduced system (a red-black Gauss-Seidel sweep on the whole) on the way
//! down and its adjoint on the way up. Both halves are plain functions of their input: no thread sees another one's writes.

mod prolong;
mod restrict;

pub(super) use prolong::prolong;
pub(super) use restrict::restrict;

use super::checkerboard::{PaddedRow, Weights};
use super::real::Real;
use super::ring::Ring;
use super::spans::Span;
use crate::vector::Packed;

/// Sums of the weights that tie a row's blacks to corners: left and right in even rows, up and down in odd ones.
#[inline(always)]
fn black_ties<V: Packed<Number = f32>>(weights: &Weights, row: isize, span: Span, out: &mut [f32]) {
    if !weights.grid.contains(row) {
        return;
    }
    let (first, second) = corner_ties::<V>(weights, row, span);
    let out = V::chunks_mut(&mut out[span.start..], first.len());
    for k in 0..first.len() {
        (V::read(&first[k]).magnitude() + V::read(&second[k]).magnitude()).put(&mut out[k]);
    }
}

/// The weights between a row's blacks and their corners: left and right in even rows, above and below in odd ones.
#[inline(always)]
fn corner_ties<V: Packed<Number = f32>>(weights: &Weights, row: isize, span: Span) -> (&[V::Chunk], &[V::Chunk]) {
    let (first, second) = if row.rem_euclid(2) == 0 {
        (&weights.right(row)[1..], &weights.left(row)[2..])
    } else {
        (&weights.down(row - 1)[1..], &weights.up(row + 1)[1..])
    };
    let n = span.vectors::<V>();
    (V::chunks(&first[span.start..], n), V::chunks(&second[span.start..], n))
}

/// Divides by the weights that tie the centres of odd `row` to blacks that have a corner themselves.
#[inline(always)]
fn divide_by_centre_ties<V: Packed<Number = f32>>(
    weights: &Weights,
    row: isize,
    span: Span,
    ties: &Ring<f32>,
    values: &mut [f32],
) {
    let n = span.vectors::<V>();
    let [above, here, below] = ties.around(row);
    let sides: [(PaddedRow<'_, f32>, PaddedRow<'_, f32>); 4] = [
        (&weights.left(row)[1..], &here[1..]),
        (&weights.right(row)[1..], &here[2..]),
        (&weights.up(row)[1..], &above[1..]),
        (&weights.down(row)[1..], &below[1..]),
    ];
    let [left, right, up, down] =
        sides.map(|(weight, tie)| (V::chunks(&weight[span.start..], n), V::chunks(&tie[span.start..], n)));
    let values = V::chunks_mut(&mut values[span.start..], n);
    for k in 0..n {
        let mut sum = V::read(&left.0[k]).where_positive(V::read(&left.1[k]));
        for (weight, tie) in [right, up, down] {
            sum = sum + V::read(&weight[k]).where_positive(V::read(&tie[k]));
        }
        (V::read(&values[k]) * sum.inverse()).put(&mut values[k]);
    }
}

/// `D^-1 b` of a row. `rounded` takes b.
#[inline(always)]
fn smoothed_row<T: Real, V: Packed<Number = f32>>(
    weights: &Weights,
    b: &[T],
    row: isize,
    span: Span,
    rounded: &mut [f32],
    out: &mut [f32],
) {
    if !weights.grid.contains(row) {
        return;
    }
    round(&b[row as usize * out.len()..][span.range()], rounded);
    let sides = weights.reds::<V>(row, span);
    let (b, out) = (V::chunks(rounded, sides.len()), V::chunks_mut(&mut out[span.start..], sides.len()));
    for k in 0..sides.len() {
        (V::read(&b[k]) * sides.diagonal(k).inverse()).put(&mut out[k]);
    }
}

/// A part of a row as the first floats of `out`.
#[inline(always)]
fn round<T: Real>(part: &[T], out: &mut [f32]) {
    for (out, value) in out.iter_mut().zip(part) {
        *out = value.to_f32();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Grid;
    use crate::vector::{One, Portable};

    fn number(seed: usize) -> f32 {
        ((seed * 2_654_435_761) >> 7) as f32 % 1000.0 / 1000.0
    }

    /// Edges of any weight, a quarter of them missing and some virtual.
    fn weights(grid: Grid) -> Weights {
        let mut weights = Weights::zeros(grid);
        for row in 0..grid.height {
            for k in 0..grid.width / 2 {
                let weight = |side: usize| match (row * 991 + k * 4 + side) % 16 {
                    0..4 => 0.0,
                    4 => -0.5,
                    _ => number(row * 991 + k * 4 + side),
                };
                let [left, right, up, down] = std::array::from_fn(weight);
                let inside = |edge: f32, there: bool| if there { edge } else { 0.0 };
                let (first, last) = (k > 0, k + 1 < grid.width / 2);
                let ends = [inside(left, first), inside(right, last), inside(up, row > 0)];
                weights.set_red(row, k, [ends[0], ends[1], ends[2], inside(down, row + 1 < grid.height)]);
            }
        }
        weights
    }

    fn assert_near(a: &[f32], b: &[f32]) {
        assert!(a.iter().any(|a| *a != 0.0));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= 1e-5 * (1.0 + b.abs()), "{a} for {b}");
        }
    }

    #[test]
    fn every_instruction_set_does_the_same() {
        let grid = Grid { height: 32, width: 64 };
        let (weights, n, coarse) = (weights(grid), grid.half(), grid.coarser());
        let b: Vec<f64> = (0..grid.half_pixels()).map(|place| f64::from(number(place)) - 0.5).collect();
        let down = |band: &dyn Fn(&mut restrict::Restricting, [&mut [f32]; 2])| {
            let [mut reds, mut blacks] = [vec![0.0; coarse.half_pixels()], vec![0.0; coarse.half_pixels()]];
            band(&mut restrict::Restricting::new(n), [&mut reds, &mut blacks]);
            [reds, blacks].concat()
        };
        let fast = down(&|rows, out| restrict::restrict_band(&weights, &b, 0, rows, out));
        assert_near(&fast, &down(&|rows, out| restrict::restrict_band_with::<_, Portable>(&weights, &b, 0, rows, out)));
        assert_near(&fast, &down(&|rows, out| restrict::restrict_band_with::<_, One<f32>>(&weights, &b, 0, rows, out)));

        let correction: Vec<f32> = (0..coarse.height * coarse.width).map(|place| number(place + 5) - 0.5).collect();
        let up = |band: &dyn Fn(&mut prolong::Prolonging, &mut [f32]) -> f64| {
            let mut x = vec![0.0; grid.half_pixels()];
            let product = band(&mut prolong::Prolonging::new(n), &mut x);
            x.push(product as f32);
            x
        };
        let fast = up(&|rows, x| prolong::prolong_band(&weights, &b, &correction, 0, rows, x));
        let portable = up(&|rows, x| prolong::prolong_band_with::<_, Portable>(&weights, &b, &correction, 0, rows, x));
        let one = up(&|rows, x| prolong::prolong_band_with::<_, One<f32>>(&weights, &b, &correction, 0, rows, x));
        assert_near(&fast, &portable);
        assert_near(&fast, &one);
    }
}
