//! Up on the finest grid, and on to the next direction of conjugate gradient and its product, while its rows are near.

use multiversion::multiversion;
use rayon::prelude::*;

use super::prolong::{LEAD, Prolonging, finish_row, go_ahead};
use crate::integrate::checkerboard::{BAND_ROWS, Weights};
use crate::integrate::real::{Real, on_vectors};
use crate::integrate::reduction::{multiply_row, solve_blacks};
use crate::integrate::ring::Ring;
use crate::integrate::spans::each_or_none;
use crate::integrate::steps::Due;
use crate::integrate::strays::Changes;
use crate::vector::Packed;

/// What the way up starts from.
#[derive(Clone, Copy)]
pub(in crate::integrate) struct Below<'a> {
    /// The right side of the grid's reds.
    pub b: &'a [f32],
    /// The solution of the next coarser one, row-major.
    pub coarse: &'a [f32],
    /// What the strays change.
    pub changes: &'a Changes<'a>,
}

/// `p = z + beta previous` and `q = S p`, along the spans of the grid, where `z` is what [`super::prolong`] makes of `below` with
/// the changes of the strays. The steps that are `due`, along what is in `p` and along `previous`, are taken before. Returns
/// `<p, q>`, each band summed by itself: the same bits for any number of threads.
pub(in crate::integrate) fn advance(
    weights: &Weights,
    below: Below<'_>,
    (beta, previous): (f32, &[f32]),
    due: Option<Due<'_>>,
    p: &mut [f32],
    q: &mut [f64],
) -> f64 {
    let half = weights.grid.half();
    let bands = weights.spans.bands_of_a_task();
    let chunk = bands * BAND_ROWS * half;
    let mut products = vec![0.0; weights.spans.len()];
    let due = each_or_none(due.map(|due| due.chunks(chunk)), products.len().div_ceil(bands));
    (p.par_chunks_mut(chunk), q.par_chunks_mut(chunk), products.par_chunks_mut(bands), due)
        .into_par_iter()
        .enumerate()
        .for_each_init(
            || Advancing::new(half),
            |rows, (task, (p, q, products, due))| {
                advance_rows(weights, below, (beta, previous), task * bands * BAND_ROWS, rows, (p, q, products, due));
            },
        );
    products.iter().sum()
}

/// Rows on their way through [`advance`].
pub(super) struct Advancing {
    up: Prolonging,
    /// The direction in a row beside the task's own.
    beside: Vec<f32>,
    reds: Ring<f64>,
    blacks: Ring<f64>,
}

impl Advancing {
    pub fn new(n: usize) -> Self {
        Self { up: Prolonging::new(n), beside: vec![0.0; n], reds: Ring::new(n), blacks: Ring::new(n) }
    }
}

/// The rows of a task to write: of `p`, of `q`, `<p, q>` of each band, and of the solution, if steps are due.
type Out<'a> = (&'a mut [f32], &'a mut [f64], &'a mut [f64], Option<Due<'a>>);

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn advance_rows(
    weights: &Weights,
    below: Below<'_>,
    before: (f32, &[f32]),
    first_row: usize,
    rows: &mut Advancing,
    out: Out<'_>,
) {
    on_vectors!(weights.grid, [f32, f64], advance_rows_with(weights, below, before, first_row, rows, out));
}

#[inline(always)]
pub(super) fn advance_rows_with<V: Packed<Number = f32>, D: Packed<Number = f64>>(
    weights: &Weights,
    below: Below<'_>,
    before: (f32, &[f32]),
    first_row: usize,
    rows: &mut Advancing,
    (p, q, products, mut due): Out<'_>,
) {
    let (n, first) = (weights.grid.half(), first_row as isize);
    let end = first + (p.len() / n) as isize;
    // The product reaches two rows further.
    for row in first - LEAD - 2..end + 2 {
        go_ahead::<V>(weights, below.b, below.coarse, row, &mut rows.up);
        if row >= first - 2 && weights.grid.contains(row) {
            let own = (first..end).contains(&row).then(|| {
                let at = (row - first) as usize;
                let (own, span) = (&mut p[at * n..][..n], weights.spans.at(row));
                if let Some(due) = &mut due {
                    let previous = &before.1[row as usize * n..][span.range()];
                    due.take_row(at, n, span, [&own[span.range()], previous]);
                }
                own
            });
            turn_row::<V, D>(weights, below, before, row, rows, own);
        }
        let row = row - 1;
        if row >= first - 1 && weights.grid.contains(row) {
            solve_blacks::<D>(weights, row, weights.spans.at(row), &rows.reds, &mut rows.blacks);
        }
        let row = row - 1;
        if row >= first {
            let span = weights.spans.at(row);
            let at = (row - first) as usize;
            let out = &mut q[at * n..][span.range()];
            products[at / BAND_ROWS] += multiply_row::<D>(weights, row, span, [&rows.reds, &rows.blacks], out);
        }
    }
}

/// A row of the direction, to the task's `own` memory if it is one of its rows.
#[inline(always)]
fn turn_row<V: Packed<Number = f32>, D: Packed<Number = f64>>(
    weights: &Weights,
    Below { b, changes, .. }: Below<'_>,
    (beta, previous): (f32, &[f32]),
    row: isize,
    rows: &mut Advancing,
    own: Option<&mut [f32]>,
) {
    let (half, span) = (weights.grid.half(), weights.spans.at(row));
    let Advancing { up, beside, reds, .. } = rows;
    let p = own.unwrap_or(beside);
    let before = V::chunks(&previous[row as usize * half..][span.range()], span.vectors::<V>());
    let beta = V::splat(beta);
    finish_row::<V>(weights, b, row, up, &mut p[span.range()], |k, z| beta.times_plus(V::read(&before[k]), z));
    changes.add_to(row as usize * half, p);
    let p = &p[span.range()];
    let n = span.vectors::<D>();
    let floats = D::floats(p, n);
    let numbers = D::chunks_mut(&mut reds.row_mut(row)[span.start..], n);
    for k in 0..n {
        D::widen(&floats[k]).put(&mut numbers[k]);
    }
}
