//! Multigrid: one V-cycle as the preconditioner of the reduced system.
//!
//! Grids as long as their pixels hold all that the mask keeps apart, and from there a graph; what a grid loses here and there
//! goes to the graph as `strays`.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::checkerboard::{Grid, Weights, join_row};
use super::coarsen::coarsen;
use super::fill::fill_corners;
use super::graph::{GraphCycle, GraphVectors};
use super::lost::Lost;
use super::real::Real;
use super::reduction::{eliminate_blacks, fill_blacks};
use super::strays::Strays;
use super::transfer::{prolong, restrict};
use crate::memory::Aligned;

/// A grid of at most this many pixels is solved directly.
const DIRECT_PIXELS: usize = 256;

/// A grid on which one pixel in so many is doubtful is left to the graph, whatever it costs.
const HOPELESS: usize = 20;

/// A V-cycle on the reds of the finest grid: symmetric, positive definite, and linear up to rounding in `f32`.
#[derive(Debug)]
pub(super) struct Multigrid<'a> {
    finest: &'a Weights,
    /// The coarser grids, down to the last whose pixels hold all that the mask keeps apart.
    levels: Vec<Weights>,
    /// The strays of each grid but the last.
    strays: Vec<Strays>,
    /// Solves for the reds of the last grid.
    graph: GraphCycle,
    /// Memory of the coarser grids, reused from cycle to cycle.
    vectors: Mutex<Vectors>,
}

#[derive(Debug)]
struct Vectors {
    levels: Vec<LevelVectors>,
    graph: GraphVectors,
}

/// Right side and solution of a coarser grid.
#[derive(Debug)]
struct LevelVectors {
    width: usize,
    half: usize,
    reds: Aligned<f32>,
    blacks: Aligned<f32>,
    red_solution: Aligned<f32>,
    /// Row-major.
    solution: Aligned<f32>,
}

impl LevelVectors {
    fn new(weights: &Weights) -> Self {
        let grid = weights.grid;
        Self {
            width: grid.width,
            half: grid.half(),
            reds: Aligned::zeros(grid.half_pixels()),
            blacks: Aligned::zeros(grid.half_pixels()),
            red_solution: Aligned::zeros(grid.half_pixels()),
            solution: Aligned::any(grid.height * grid.width),
        }
    }

    /// The solution from the reds and the blacks (which lie where their right side was).
    fn join(&mut self) {
        let half = self.half;
        self.solution
            .par_chunks_mut(self.width)
            .zip(self.red_solution.par_chunks(half))
            .zip(self.blacks.par_chunks(half))
            .enumerate()
            .for_each(|(row, ((pixels, reds), blacks))| join_row(row, reds, blacks, pixels));
    }
}

impl<'a> Multigrid<'a> {
    /// Coarsens `finest` as far as grids go, and from there as a graph.
    pub fn new(finest: &'a Weights) -> Self {
        let mut levels: Vec<Weights> = Vec::new();
        let mut strays = Vec::new();
        let mut stray_count = 0;
        loop {
            let weights = levels.last().unwrap_or(finest);
            let pixels = weights.grid.height * weights.grid.width;
            if pixels <= DIRECT_PIXELS {
                break;
            }
            let mut coarser = coarsen(weights);
            let mut lost = Lost::centres(weights, &coarser);
            // Where detours are the rule, they are no longer short and wide.
            let hopeless = lost.doubtful > pixels / HOPELESS;
            if hopeless || is_too_coarse([stray_count, lost.reds.len()], levels.len(), finest.grid) {
                // A grid that is nearly all lanes is no good neighbour for the strays of the one before.
                if hopeless && strays.last().is_some_and(|strays: &Strays| strays.len() > 0) {
                    levels.pop();
                    strays.pop();
                }
                break;
            }
            stray_count += lost.reds.len();
            if !lost.reds.is_empty() {
                lost.add_corners(weights, &coarser);
            }
            strays.push(Strays::new(weights, &coarser, &lost));
            fill_corners(&mut coarser);
            levels.push(coarser);
        }
        let weights: Vec<&Weights> = std::iter::once(finest).chain(&levels).collect();
        let graph = GraphCycle::new(&weights, &strays);
        let vectors = Vectors { levels: levels.iter().map(LevelVectors::new).collect(), graph: graph.vectors() };
        Self { finest, levels, strays, graph, vectors: Mutex::new(vectors) }
    }

    /// Unknowns of the graph that takes over from the grids.
    pub fn graph_unknowns(&self) -> usize {
        self.graph.unknowns()
    }

    /// `x = M b`; returns `<b, x>`.
    pub fn cycle(&self, b: &[f64], x: &mut [f32]) -> f64 {
        let mut vectors = self.vectors.lock().unwrap_or_else(PoisonError::into_inner);
        let Vectors { levels, graph } = &mut *vectors;
        self.reds(0, b, x, levels, graph, 0)
    }

    /// Solves for the reds of a grid (0 is the finest) by a V-cycle; `coarser` are the grids below, `first_stray` counts the
    /// strays of the finer grids. Returns `<b, x>`.
    fn reds<T: Real>(
        &self,
        level: usize,
        b: &[T],
        x: &mut [f32],
        coarser: &mut [LevelVectors],
        graph: &mut GraphVectors,
        first_stray: usize,
    ) -> f64 {
        let Some((next, coarser)) = coarser.split_first_mut() else { return self.graph.solve(b, x, graph) };
        let weights = if level == 0 { self.finest } else { &self.levels[level - 1] };
        let strays = &self.strays[level];
        let own = first_stray..first_stray + strays.len();
        restrict(weights, b, &mut next.reds, &mut next.blacks);
        strays.restrict(b, &mut graph.strays[own.clone()], &mut next.reds, &mut next.blacks);
        self.whole(level + 1, next, coarser, graph, own.end);
        let product = prolong(weights, b, &next.solution, x);
        product + strays.prolong(b, &graph.strays[own], &next.solution, x)
    }

    /// Solves for the whole of a coarser grid: blacks eliminated, reds by a V-cycle, blacks filled in.
    fn whole(
        &self,
        level: usize,
        here: &mut LevelVectors,
        coarser: &mut [LevelVectors],
        graph: &mut GraphVectors,
        first_stray: usize,
    ) {
        let weights = &self.levels[level - 1];
        eliminate_blacks(weights, &mut here.reds, &here.blacks);
        self.reds(level, &here.reds, &mut here.red_solution, coarser, graph, first_stray);
        fill_blacks(weights, &here.red_solution, &mut here.blacks);
        here.join();
    }
}

/// True where a graph must take over from the grid of `level`, which leaves `new` strays after the `earlier` ones of finer grids.
///
/// Every grid between a stray and the graph costs iterations, for its smoothing does not know of the stray: the more so along a
/// slit, which leaves as many strays on every grid. Spots that a lane narrows to leave theirs on one grid, and a graph of many
/// nodes costs time and memory. The bounds are chosen by measurement; `tests/multigrid.rs` holds their effect.
fn is_too_coarse([earlier, new]: [usize; 2], level: usize, finest: Grid) -> bool {
    let pixels = finest.height * finest.width;
    let is_fading = earlier == 0 || 2 * new <= earlier;
    let at_least = match level {
        0 => pixels / HOPELESS,
        1 | 2 if is_fading => (pixels / 1_024).max(64),
        1 => (pixels / 65_536).max(16),
        2 => 8,
        _ => 0,
    };
    earlier + new > at_least
}
