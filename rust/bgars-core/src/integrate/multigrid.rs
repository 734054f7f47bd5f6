//! Geometric multigrid: one V-cycle as the preconditioner of the reduced system.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use faer::dyn_stack::{MemStack, StackReq};
use faer::matrix_free::{LinOp, Precond};
use faer::{MatMut, MatRef, Par};
use rayon::prelude::*;

use super::checkerboard::{Real, Weights, join_row};
use super::coarsen::coarsen;
use super::coarsest::Coarsest;
use super::fill::fill_corners;
use super::operator::{column, column_mut};
use super::reduction::{eliminate_blacks, fill_blacks};
use super::transfer::{prolong, restrict};

/// A grid of at most this many pixels is solved directly.
const DIRECT_PIXELS: usize = 256;

/// A V-cycle on the reds of the finest grid, and a look at the residual on the way: the solver hands it over here and
/// nowhere else.
#[derive(Debug)]
pub(super) struct Multigrid<'a> {
    finest: &'a Weights,
    /// Coarser and coarser, all but the last.
    levels: Vec<Weights>,
    coarsest: Coarsest,
    /// Memory of the coarser grids, reused from cycle to cycle.
    vectors: Mutex<Vec<LevelVectors>>,
    residual_bits: AtomicU64,
}

/// Right side and solution of a coarser grid.
#[derive(Debug)]
struct LevelVectors {
    width: usize,
    reds: Vec<f32>,
    blacks: Vec<f32>,
    red_solution: Vec<f32>,
    /// Row-major.
    solution: Vec<f32>,
}

impl LevelVectors {
    fn new(weights: &Weights) -> Self {
        let grid = weights.grid;
        let [reds, blacks, red_solution] = std::array::from_fn(|_| vec![0.0; grid.half_pixels()]);
        Self { width: grid.width, reds, blacks, red_solution, solution: vec![0.0; grid.height * grid.width] }
    }

    /// The solution from the reds and the blacks (which lie where their right side was).
    fn join(&mut self) {
        let half = self.width.div_ceil(2);
        self.solution
            .par_chunks_mut(self.width)
            .zip(self.red_solution.par_chunks(half))
            .zip(self.blacks.par_chunks(half))
            .enumerate()
            .for_each(|(row, ((pixels, reds), blacks))| join_row(row, reds, blacks, pixels));
    }
}

impl<'a> Multigrid<'a> {
    /// Coarsens `finest` until a grid is small enough to be solved directly.
    pub fn new(finest: &'a Weights) -> Self {
        let mut levels = Vec::new();
        let mut weights = coarsen(finest);
        fill_corners(&mut weights);
        while weights.grid.height * weights.grid.width > DIRECT_PIXELS {
            let mut coarser = coarsen(&weights);
            fill_corners(&mut coarser);
            levels.push(std::mem::replace(&mut weights, coarser));
        }
        let vectors = levels.iter().chain([&weights]).map(LevelVectors::new).collect();
        Self {
            finest,
            coarsest: Coarsest::new(&weights),
            levels,
            vectors: Mutex::new(vectors),
            residual_bits: AtomicU64::new(f64::NAN.to_bits()),
        }
    }

    /// Norm of the residual last seen; NaN before the first iteration.
    pub fn residual_norm(&self) -> f64 {
        f64::from_bits(self.residual_bits.load(Ordering::Relaxed))
    }

    /// `x = M b`.
    pub fn cycle<T: Real>(&self, b: &[T], x: &mut [T]) {
        let mut vectors = self.vectors.lock().unwrap_or_else(PoisonError::into_inner);
        let first = &mut vectors[0];
        restrict(self.finest, b, &mut first.reds, &mut first.blacks);
        self.solve(0, &mut vectors);
        prolong(self.finest, b, &vectors[0].solution, x);
    }

    /// Solves for the whole of a coarser grid: blacks eliminated, reds by a V-cycle, blacks filled in.
    fn solve(&self, level: usize, vectors: &mut [LevelVectors]) {
        let Some((here, coarser)) = vectors.split_first_mut() else { return };
        let Some(weights) = self.levels.get(level) else {
            self.coarsest.solve(&here.reds, &here.blacks, &mut here.solution);
            return;
        };
        eliminate_blacks(weights, &mut here.reds, &here.blacks);
        restrict(weights, &here.reds, &mut coarser[0].reds, &mut coarser[0].blacks);
        self.solve(level + 1, coarser);
        prolong(weights, &here.reds, &coarser[0].solution, &mut here.red_solution);
        fill_blacks(weights, &here.red_solution, &mut here.blacks);
        here.join();
    }
}

impl LinOp<f64> for Multigrid<'_> {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        self.finest.grid.half_pixels()
    }

    fn ncols(&self) -> usize {
        self.finest.grid.half_pixels()
    }

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        self.residual_bits.store(rhs.norm_l2().to_bits(), Ordering::Relaxed);
        self.cycle(column(rhs), column_mut(out));
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

impl Precond<f64> for Multigrid<'_> {}
