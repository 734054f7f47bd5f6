//! Algebraic multigrid: where lanes are narrower than a coarse pixel, a grid cannot hold what happens in them.
//!
//! A regular grid has one unknown a pixel. Once a wall runs through the pixels of the next coarser grid, both its sides would
//! have to share one. From there on the hierarchy is a graph instead: its nodes are the reds of the last exact grid, its
//! edges their couplings (`reduced`). A subset of the nodes becomes the next coarser graph (`splitting`, Ruge and Stüben
//! 1987), the others take their values from those they are strongly tied to (`interpolation`; De Sterck, Falgout, Nolting,
//! Yang 2008), and the coarse edges follow by the Galerkin product (`galerkin`). Nothing passes where there is no edge.
//! Smoothing is Gauss-Seidel (`smoother`); the last, small graph is solved directly (`direct`). Strays of the grids above
//! (see `strays`) are nodes like any other (`attach`).

mod attach;
mod block;
mod direct;
mod galerkin;
mod interpolation;
mod matrix;
mod reduced;
mod smoother;
mod splitting;

use rayon::prelude::*;

use super::checkerboard::Weights;
use super::reduction::dot;
use super::strays::Strays;
use crate::memory::{Scratch, zeros};
use attach::Grids;
use direct::Direct;
use galerkin::coarser_graph;
use interpolation::interpolation;
pub(super) use matrix::Rows;
use reduced::{Nodes, reduced_graph};
use smoother::Smoother;
use splitting::split;

/// A graph with at most this many nodes that have edges is solved directly.
const DIRECT_NODES: usize = 256;

/// Most graphs of a hierarchy; each has at most about two thirds of the nodes of the one before.
const MAX_LEVELS: usize = 40;

/// Nodes that one task works on.
const CHUNK: usize = 1 << 12;

/// One V-cycle on the reds of a grid, as on a graph.
#[derive(Debug)]
pub(super) struct GraphCycle {
    nodes: Nodes,
    /// A row a stray: the nodes that its value is measured from.
    bases: Rows,
    levels: Vec<Level>,
    direct: Direct,
}

/// A graph and the way to the next coarser one.
#[derive(Debug)]
struct Level {
    graph: Rows,
    smoother: Smoother,
    /// A row a node: the coarse nodes it takes its value from.
    prolongation: Rows,
}

/// Right side and solution of each graph.
#[derive(Debug)]
pub(super) struct GraphVectors {
    levels: Vec<[Scratch<f32>; 2]>,
    /// What one graph at a time has on its way.
    spare: Scratch<f32>,
    /// Right side, then solution of the strays, above their bases.
    pub strays: Vec<f32>,
}

impl GraphCycle {
    /// The hierarchy below the reds of the last of `weights` and the strays of the others. `before` is told its unknowns first.
    pub fn new(weights: &[&Weights], strays: &[Strays], before: impl FnOnce(usize)) -> Self {
        let last = weights[strays.len()];
        let nodes = Nodes::new(last);
        let grids = Grids { weights, strays, nodes: &nodes };
        let bases = grids.bases();
        before(nodes.len() + bases.len());
        let mut graph = reduced_graph(last, &nodes, bases.len(), &grids.edges_of_strays());
        let mut levels = Vec::new();
        while graph.rows_with_entries() > DIRECT_NODES && levels.len() < MAX_LEVELS {
            let coarse_of = split(&graph);
            let prolongation = interpolation(&graph, &coarse_of);
            let coarser = coarser_graph(&graph, &prolongation);
            let smoother = Smoother::new(&graph);
            let graph = std::mem::replace(&mut graph, coarser);
            levels.push(Level { graph, smoother, prolongation });
        }
        let direct = Direct::new(&graph);
        Self { nodes, bases, levels, direct }
    }

    /// Nodes of the first graph, strays included.
    pub fn unknowns(&self) -> usize {
        self.nodes.len() + self.bases.len()
    }

    /// Memory for [`Self::solve`].
    pub fn vectors(&self) -> GraphVectors {
        let sizes = self.levels.iter().map(|level| level.graph.len()).chain([self.direct.len()]);
        GraphVectors {
            levels: sizes.map(|len| std::array::from_fn(|_| Scratch::filled(0.0, len))).collect(),
            spare: Scratch::filled(0.0, self.unknowns()),
            strays: zeros(self.bases.len()),
        }
    }

    /// Solves for the reds of the grid, whose right side is `b`, and for the strays, whose right side and then solution is in
    /// `vectors`. Returns the product of the whole right side with the solution.
    pub fn solve(&self, b: &[f32], vectors: &mut GraphVectors) -> f64 {
        self.nodes.gather(b, &mut vectors.levels[0][0]);
        let GraphVectors { levels, spare, strays } = vectors;
        let reds = self.nodes.len();
        // The graph knows each stray's whole value, the grids only what it is above its base.
        levels[0][0][reds..].copy_from_slice(strays);
        for (stray, &own) in strays.iter().enumerate() {
            for (node, share) in self.bases.pairs(stray) {
                levels[0][0][node] -= share * own;
            }
        }
        self.cycle(0, levels, spare);
        let [right, whole] = &levels[0];
        for (stray, own) in strays.iter_mut().enumerate() {
            *own = whole[reds + stray] - self.bases.pairs(stray).map(|(node, share)| share * whole[node]).sum::<f32>();
        }
        let products: Vec<f64> = right.par_chunks(CHUNK).zip(whole.par_chunks(CHUNK)).map(|(b, x)| dot(b, x)).collect();
        products.iter().sum()
    }

    /// What [`Self::solve`] found for the reds of the grid.
    pub fn scatter(&self, vectors: &GraphVectors, x: &mut [f32]) {
        self.nodes.scatter(&vectors.levels[0][1], x);
    }

    fn cycle(&self, depth: usize, vectors: &mut [[Scratch<f32>; 2]], spare: &mut [f32]) {
        let Some(([b, x], coarser)) = vectors.split_first_mut() else { return };
        let Some(level) = self.levels.get(depth) else {
            self.direct.solve(b, x);
            return;
        };
        level.smoother.forward_from_zero(&level.graph, b, x);
        let here = x.len();
        level.graph.residual(b, x, &mut spare[..here]);
        level.prolongation.multiply_transposed(&spare[..here], &mut coarser[0][0]);
        self.cycle(depth + 1, coarser, spare);
        level.prolongation.multiply_add(&coarser[0][1], x, &mut spare[..here]);
        level.smoother.backward(&level.graph, b, &spare[..here], x);
    }
}
