//! Multigrid (Brandt 1977; Trottenberg, Oosterlee, Schüller 2001) as a preconditioner: one symmetric V-cycle in `f32`.

use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};

use faer::dyn_stack::MemStack;
use faer::matrix_free::{LinOp, Precond};
use faer::{MatMut, MatRef, Par};
use rayon::prelude::*;

use super::adjacency::Adjacency;
use super::aggregation::{Aggregates, aggregate};
use super::checkerboard::{Colour, Grid, TASK, join_row, split_row};
use super::graph::{Graph, each};
use super::real::Real;
use super::stencil::Stencil;
use super::vectors::{slice, slice_mut, symmetric_operator};

/// How much of a second cycle counts. By less than one, the whole stays positive where a cycle overshoots, up to threefold.
const SECOND_CYCLE: f32 = 0.5;

/// The operator of a level: a grid as long as no block of pixels falls apart, a graph from there on.
#[derive(Debug)]
enum Operator<'a> {
    Grid(Cow<'a, Stencil>),
    Graph(Graph),
}

/// How values travel between an operator and the next coarser one: restriction is the transpose of prolongation, and both of them
/// smooth over the edges of the finer operator (smoothed aggregation, Vanek, Mandel, Brezina 1996): `P = (1 - D^-1 A) P_0`,
/// where `P_0` gives each unknown the value of its aggregate. Only reds take it, so that blacks alone need to know theirs.
#[derive(Debug)]
enum Transfer {
    /// Aggregates are the blocks of 2 x 2 pixels of a grid.
    Blocks(Grid),
    /// The connected components of blocks.
    Components(Aggregates),
}

/// An operator, and the way to the next coarser one.
#[derive(Debug)]
struct Level<'a> {
    operator: Operator<'a>,
    transfer: Option<Transfer>,
}

/// Reds and blacks.
type Values = [Vec<f32>; 2];

#[derive(Debug)]
struct Vectors {
    right: Values,
    solution: Values,
    /// Of the reds, over the diagonal.
    residual: Vec<f32>,
}

/// One V-cycle on the reduced system of a grid: symmetric, positive definite, and linear up to rounding in `f32`.
#[derive(Debug)]
pub struct Multigrid<'a> {
    /// The finest first.
    levels: Vec<Level<'a>>,
    vectors: Mutex<Vec<Vectors>>,
    /// Reds of the finest.
    size: usize,
}

impl<'a> Multigrid<'a> {
    pub(super) fn new(finest: &'a Stencil) -> Self {
        let mut levels = vec![Level { operator: Operator::Grid(Cow::Borrowed(finest)), transfer: None }];
        while let Some(finer) = levels.last_mut()
            && let Some((transfer, operator)) = finer.operator.coarse()
        {
            finer.transfer = Some(transfer);
            levels.push(Level { operator, transfer: None });
        }
        let vectors = levels.iter().map(|level| level.operator.vectors()).collect();
        Self { levels, vectors: Mutex::new(vectors), size: finest.len(Colour::Red) }
    }
}

/// One cycle for the right side of the first of some levels: red-black Gauss-Seidel, the coarse correction, and the same sweep
/// backward.
fn v_cycle(levels: &[Level<'_>], vectors: &mut [Vectors]) {
    let ([level, coarse_levels @ ..], [here, coarse @ ..]) = (levels, vectors) else { return };
    let (a, Vectors { right: [r_red, r_black], solution: [x_red, x_black], residual }) = (&level.operator, here);
    a.update(Colour::Red, x_black, r_red, x_red, |x, _, d, r| *x = r.over(d));
    if let (Some(transfer), [below, ..]) = (&level.transfer, &mut *coarse) {
        a.update(Colour::Black, x_red, r_black, x_black, |x, sum, d, r| *x = (r + sum).over(d));
        // What blacks leave is zero now, and what a red leaves is what its neighbours give.
        a.update(Colour::Red, x_black, r_red, residual, |left, sum, d, _| *left = sum.over(d));
        a.update(Colour::Black, residual, r_black, x_black, |x, sum, _, _| *x = sum);
        transfer.restrict(x_black, &mut below.right);
        coarse_correction(coarse_levels, coarse);
        transfer.prolong(&coarse[0].solution, x_black);
        a.update(Colour::Red, x_black, r_red, x_red, |x, sum, d, _| *x += sum.over(d));
    }
    a.update(Colour::Black, x_red, r_black, x_black, |x, sum, d, r| *x = (r + sum).over(d));
    a.update(Colour::Red, x_black, r_red, x_red, |x, sum, d, r| *x = (r + sum).over(d));
}

/// One cycle, and on a graph a second one for what the first leaves, damped: where lanes are narrow the hierarchy is deep and coarse
/// operators are rough, so that errors would add up from level to level (a W-cycle; Trottenberg et al., section 2.4).
fn coarse_correction(levels: &[Level<'_>], vectors: &mut [Vectors]) {
    v_cycle(levels, vectors);
    let [Level { operator: Operator::Graph(a), transfer: Some(_) }, ..] = levels else { return };
    let Vectors { right: [r_red, r_black], solution: [x_red, x_black], .. } = &mut vectors[0];
    a.update(Colour::Red, x_black, x_red, r_red, |r, sum, d, x| *r += sum - d * x);
    a.update(Colour::Black, x_red, x_black, r_black, |r, sum, d, x| *r += sum - d * x);
    let first = vectors[0].solution.clone();
    v_cycle(levels, vectors);
    for (x, first) in vectors[0].solution.iter_mut().flatten().zip(first.iter().flatten()) {
        *x = first + SECOND_CYCLE * *x;
    }
}

impl Operator<'_> {
    /// As [`Stencil::update`].
    fn update(
        &self,
        colour: Colour,
        neighbours: &[f32],
        input: &[f32],
        values: &mut [f32],
        set: impl Fn(&mut f32, f32, f32, f32) + Sync,
    ) {
        match self {
            Self::Grid(stencil) => stencil.update(colour, neighbours, input, values, set),
            Self::Graph(graph) => graph.update(colour, neighbours, input, values, set),
        }
    }

    /// The next coarser operator and the way to it; `None` where no edges would be left.
    fn coarse(&self) -> Option<(Transfer, Self)> {
        let stencil = match self {
            Self::Grid(stencil) => stencil.as_ref(),
            Self::Graph(graph) => return components(graph),
        };
        match stencil.coarse() {
            Some(coarse) if coarse.has_edges() => {
                Some((Transfer::Blocks(stencil.grid), Self::Grid(Cow::Owned(coarse))))
            }
            Some(_) => None,
            None => components(stencil),
        }
    }

    fn vectors(&self) -> Vectors {
        let lengths = [Colour::Red, Colour::Black].map(|colour| match self {
            Self::Grid(stencil) => stencil.len(colour),
            Self::Graph(graph) => graph.len(colour),
        });
        let zeros = || lengths.map(|length| vec![0.0; length]);
        Vectors { right: zeros(), solution: zeros(), residual: vec![0.0; lengths[0]] }
    }
}

/// Aggregation of a fine operator.
fn components<'a>(fine: &impl Adjacency) -> Option<(Transfer, Operator<'a>)> {
    let (graph, aggregates) = aggregate(fine);
    graph.has_edges().then_some((Transfer::Components(aggregates), Operator::Graph(graph)))
}

impl Transfer {
    /// Sums up the values of the blacks.
    fn restrict(&self, blacks: &[f32], coarse: &mut Values) {
        let [coarse_reds, coarse_blacks] = coarse;
        match self {
            Self::Blocks(fine) => {
                let (half, coarse_half) = (fine.half(), fine.coarse().half());
                let rows = coarse_reds.par_chunks_mut(coarse_half).zip(coarse_blacks.par_chunks_mut(coarse_half));
                rows.enumerate().with_min_len(TASK.div_ceil(half)).for_each_init(
                    || vec![0.0; half],
                    |sums, (row, (coarse_reds, coarse_blacks))| {
                        sums.fill(0.0);
                        for blacks in blacks.chunks(half).skip(2 * row).take(2) {
                            sums.iter_mut().zip(blacks).for_each(|(sum, black)| *sum += black);
                        }
                        split_row(row, sums, [coarse_reds, coarse_blacks]);
                    },
                );
            }
            Self::Components(Aggregates { members, .. }) => {
                for (values, members) in [coarse_reds, coarse_blacks].into_iter().zip(members) {
                    each(values, |unknown, value| {
                        *value = members.of(unknown).iter().map(|&black| blacks[black as usize]).sum();
                    });
                }
            }
        }
    }

    /// Gives the blacks the values of their aggregates.
    fn prolong(&self, [coarse_reds, coarse_blacks]: &Values, blacks: &mut [f32]) {
        match self {
            Self::Blocks(fine) => {
                let (half, coarse_half) = (fine.half(), fine.coarse().half());
                blacks.par_chunks_mut(2 * half).with_min_len(TASK.div_ceil(2 * half)).enumerate().for_each(
                    |(row, blacks)| {
                        let span = row * coarse_half..(row + 1) * coarse_half;
                        let (first, second) = blacks.split_at_mut(half);
                        join_row(row, [&coarse_reds[span.clone()], &coarse_blacks[span]], first);
                        second.copy_from_slice(&first[..second.len()]);
                    },
                );
            }
            Self::Components(Aggregates { parents, .. }) => {
                let coarse = [coarse_reds, coarse_blacks];
                each(blacks, |unknown, black| {
                    let parent = parents[unknown] as usize;
                    *black = coarse[parent % 2].get(parent / 2).copied().unwrap_or_default();
                });
            }
        }
    }
}

impl LinOp<f64> for Multigrid<'_> {
    symmetric_operator!(|multigrid: &Self| multigrid.size);

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        let mut vectors = self.vectors.lock().unwrap_or_else(PoisonError::into_inner);
        let rounded = vectors[0].right[0].par_iter_mut().zip(slice(rhs)).with_min_len(TASK);
        rounded.for_each(|(rounded, &number)| *rounded = number as f32);
        v_cycle(&self.levels, &mut vectors);
        let out = slice_mut(out).par_iter_mut().zip(&vectors[0].solution[0]).with_min_len(TASK);
        out.for_each(|(out, &number)| *out = f64::from(number));
    }
}

impl Precond<f64> for Multigrid<'_> {}
