//! Geometric multigrid: one V-cycle as the preconditioner of the reduced system.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::checkerboard::{Weights, join_row};
use super::coarsen::coarsen;
use super::coarsest::Coarsest;
use super::fill::fill_corners;
use super::reduction::{eliminate_blacks, fill_blacks};
use super::transfer::{prolong, restrict};
use crate::memory::zeros;

/// A grid of at most this many pixels is solved directly.
const DIRECT_PIXELS: usize = 256;

/// A V-cycle on the reds of the finest grid: symmetric, positive definite, and linear up to rounding in `f32`.
#[derive(Debug)]
pub(super) struct Multigrid<'a> {
    finest: &'a Weights,
    /// Coarser and coarser, all but the last.
    levels: Vec<Weights>,
    coarsest: Coarsest,
    /// Memory of the coarser grids, reused from cycle to cycle.
    vectors: Mutex<Vec<LevelVectors>>,
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
        let [reds, blacks, red_solution] = std::array::from_fn(|_| zeros(grid.half_pixels()));
        Self { width: grid.width, reds, blacks, red_solution, solution: zeros(grid.height * grid.width) }
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
        Self { finest, coarsest: Coarsest::new(&weights), levels, vectors: Mutex::new(vectors) }
    }

    /// `x = M b`; returns `<b, x>`.
    pub fn cycle(&self, b: &[f64], x: &mut [f32]) -> f64 {
        let mut vectors = self.vectors.lock().unwrap_or_else(PoisonError::into_inner);
        let first = &mut vectors[0];
        restrict(self.finest, b, &mut first.reds, &mut first.blacks);
        self.solve(0, &mut vectors);
        prolong(self.finest, b, &vectors[0].solution, x)
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
