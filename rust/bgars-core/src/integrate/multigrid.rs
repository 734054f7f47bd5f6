//! Multigrid: one V-cycle as the preconditioner of the reduced system.
//!
//! Grids as long as their pixels hold all that the mask keeps apart, and from there a graph; what a grid loses here and there
//! goes to the graph as `strays`.

use rayon::prelude::*;

use super::checkerboard::{Grid, Weights};
use super::coarsen::coarsen;
use super::edge_bits::EdgeBits;
use super::fill::fill_corners;
use super::graph::{GraphCycle, GraphVectors};
use super::lost::{Lost, doubtful_centres};
use super::reduction::{eliminate_blacks, fill_and_join, multiply};
use super::steps::Due;
use super::strays::{Changes, Strays};
use super::transfer::{Below, RightSide, advance, prolong, prolong_and_fill, restrict};
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
}

/// Memory of the coarser grids, used again from cycle to cycle: a cycle goes down to the solution of the second grid, and up.
#[derive(Debug)]
pub(super) struct Vectors {
    levels: Vec<LevelVectors>,
    graph: GraphVectors,
}

/// Right side and solution of a coarser grid.
#[derive(Debug)]
struct LevelVectors {
    reds: Aligned<f32>,
    blacks: Aligned<f32>,
    /// The right side of the reds with the blacks eliminated; on the last grid their solution in the end.
    reduced: Aligned<f32>,
    /// Row-major.
    solution: Aligned<f32>,
}

impl LevelVectors {
    fn new(weights: &Weights) -> Self {
        let grid = weights.grid;
        Self {
            reds: Aligned::zeros(grid.half_pixels()),
            blacks: Aligned::zeros(grid.half_pixels()),
            reduced: Aligned::zeros(grid.half_pixels()),
            solution: Aligned::any(grid.height * grid.width),
        }
    }
}

impl<'a> Multigrid<'a> {
    /// Coarsens `finest`, which has the edges of `bits`, as far as grids go, and from there as a graph. `before_graph` is told the
    /// unknowns of this one before it takes memory.
    pub fn new(finest: &'a Weights, mut bits: EdgeBits, before_graph: impl FnOnce(usize)) -> Self {
        let mut levels: Vec<Weights> = Vec::new();
        let mut strays = Vec::new();
        let mut stray_count = 0;
        loop {
            let weights = levels.last().unwrap_or(finest);
            let pixels = weights.grid.height * weights.grid.width;
            if pixels <= DIRECT_PIXELS {
                break;
            }
            let doubtful = doubtful_centres(weights, &bits);
            // Where detours are the rule, they are no longer short and wide.
            if doubtful.len() > pixels / HOPELESS {
                // A grid that is nearly all lanes is no good neighbour for the strays of the one before.
                if strays.last().is_some_and(|strays: &Strays| strays.len() > 0) {
                    levels.pop();
                    strays.pop();
                }
                break;
            }
            let mut coarser = coarsen(weights);
            let mut lost = Lost::centres(&doubtful, weights, &coarser);
            if is_too_coarse([stray_count, lost.reds.len()], levels.len(), finest.grid) {
                break;
            }
            stray_count += lost.reds.len();
            if !lost.reds.is_empty() {
                lost.add_corners(weights, &coarser);
            }
            strays.push(Strays::new(weights, &coarser, &lost));
            bits = fill_corners(&mut coarser);
            levels.push(coarser);
        }
        drop(bits);
        let weights: Vec<&Weights> = std::iter::once(finest).chain(&levels).collect();
        let graph = GraphCycle::new(&weights, &strays, before_graph);
        Self { finest, levels, strays, graph }
    }

    /// Memory for cycles.
    pub fn vectors(&self) -> Vectors {
        Vectors { levels: self.levels.iter().map(LevelVectors::new).collect(), graph: self.graph.vectors() }
    }

    /// Unknowns of the graph that takes over from the grids.
    pub fn graph_unknowns(&self) -> usize {
        self.graph.unknowns()
    }

    /// `x = M b`.
    pub fn cycle(&self, b: &[f32], vectors: &mut Vectors, x: &mut [f32]) {
        self.descend(b, vectors);
        let Some(next) = vectors.levels.first() else { return self.graph.scatter(&vectors.graph, x) };
        prolong(self.finest, b, &next.solution, x);
        self.changes(0, next, &vectors.graph, 0).add_to(0, x);
    }

    /// The way down; returns `<b, M b>`, which is known before `M b` is.
    pub fn descend(&self, b: &[f32], vectors: &mut Vectors) -> f64 {
        let Vectors { levels, graph } = vectors;
        let Some((next, coarser)) = levels.split_first_mut() else { return self.graph.solve(b, graph) };
        let [_, smoothed] = restrict(self.finest, RightSide::Reds(b), [&mut next.reds, &mut next.blacks]);
        self.strays[0].restrict(b, &mut graph.strays[..self.strays[0].len()], &mut next.reds, &mut next.blacks);
        smoothed + self.solve(1, next, coarser, graph, self.strays[0].len())
    }

    /// The way up after [`Self::descend`]: the next direction `p = M b + beta previous` and `q = S p`; returns `<p, q>`. The steps
    /// that are due are taken on the way, along what is in `p` and along `previous`.
    pub fn advance(
        &self,
        b: &[f32],
        due: Option<Due<'_>>,
        vectors: &Vectors,
        (beta, previous): (f32, &[f32]),
        p: &mut [f32],
        q: &mut [f64],
    ) -> f64 {
        if let Some(next) = vectors.levels.first() {
            let changes = self.changes(0, next, &vectors.graph, 0);
            let below = Below { b, coarse: &next.solution, changes: &changes };
            return advance(self.finest, below, (beta, previous), due, p, q);
        }
        if let Some(due) = due {
            due.take(self.finest, [p, previous]);
        }
        self.graph.scatter(&vectors.graph, p);
        p.par_iter_mut().zip(previous).for_each(|(p, previous)| *p += beta * previous);
        multiply(self.finest, p, q)
    }

    /// From the right side of a whole coarser grid to its solution: blacks eliminated, reds by a V-cycle, blacks filled in.
    /// `coarser` are the grids below, `first_stray` counts the strays of the finer ones. Returns the product of right side and
    /// solution: all that smoothing and blacks add on the way, and the part of the graph.
    fn solve(
        &self,
        level: usize,
        here: &mut LevelVectors,
        coarser: &mut [LevelVectors],
        graph: &mut GraphVectors,
        first_stray: usize,
    ) -> f64 {
        let weights = &self.levels[level - 1];
        let LevelVectors { reds, blacks, reduced, solution } = here;
        let Some((next, coarser)) = coarser.split_first_mut() else {
            let of_blacks = eliminate_blacks(weights, reds, blacks);
            let of_reds = self.graph.solve(reds, graph);
            self.graph.scatter(graph, reduced);
            fill_and_join(weights, reduced, blacks, solution);
            return of_blacks + of_reds;
        };
        let strays = &self.strays[level];
        let own = first_stray..first_stray + strays.len();
        let right = RightSide::Whole { colours: [reds, blacks], reduced };
        let [of_blacks, smoothed] = restrict(weights, right, [&mut next.reds, &mut next.blacks]);
        strays.restrict(reduced, &mut graph.strays[own.clone()], &mut next.reds, &mut next.blacks);
        let of_rest = self.solve(level + 1, next, coarser, graph, own.end);
        let changes = self.changes(level, next, graph, first_stray);
        let below = Below { b: reduced, coarse: &next.solution, changes: &changes };
        prolong_and_fill(weights, below, blacks, solution);
        of_blacks + (smoothed + of_rest)
    }

    /// What the strays of a grid change in it.
    fn changes(&self, level: usize, next: &LevelVectors, graph: &GraphVectors, first_stray: usize) -> Changes<'_> {
        let strays = &self.strays[level];
        strays.changes(&graph.strays[first_stray..first_stray + strays.len()], &next.solution)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::Difference;
    use crate::integrate::operator::{Field, assemble};
    use crate::integrate::reduction::dot;

    fn number(seed: usize) -> f64 {
        ((seed * 2_654_435_761) >> 7) as f64 % 1000.0 / 1000.0
    }

    /// The product that the way down knows is that of the right side with what the way up makes of it, whether grids, strays or
    /// the graph alone hold the mask.
    #[test]
    fn the_way_down_knows_the_product() {
        const SIDE: usize = 150;
        let pixel = |index: usize| (index % SIDE, index / SIDE);
        let of_spots = |index: usize| {
            let (x, y) = pixel(index);
            number(index / 900) > 0.2 && (x % 37 != 0 || y % 31 < 28)
        };
        let masks: [(&str, Vec<bool>); 4] = [
            ("full", vec![true; SIDE * SIDE]),
            ("slits", (0..SIDE * SIDE).map(|index| pixel(index).0 % 37 != 0 || pixel(index).1 < 9).collect()),
            ("spots", (0..SIDE * SIDE).map(of_spots).collect()),
            ("percolation", (0..SIDE * SIDE).map(|index| number(index) > 0.35).collect()),
        ];
        let mut with = [false; 3];
        for (name, mask) in masks {
            let normals = [0.0, 0.0, 1.0].repeat(mask.len());
            let field = Field { normals: &normals, mask: &mask, weights: None, regions: None, width: SIDE };
            let (mut weights, _) = assemble(field, Difference::Trapezoid);
            let bits = fill_corners(&mut weights);
            let multigrid = Multigrid::new(&weights, bits, |_| ());
            let mut vectors = multigrid.vectors();
            let half = weights.grid.half();
            let mut b = vec![0.0; weights.grid.half_pixels()];
            for (red, b) in b.iter_mut().enumerate() {
                let (row, k) = ((red / half) as isize, red % half);
                let is_tied = weights.row(row).iter().any(|side| side[k + 1] > 0.0);
                *b = if is_tied { number(red) as f32 - 0.5 } else { 0.0 };
            }
            let mut x = vec![0.0; b.len()];
            multigrid.cycle(&b, &mut vectors, &mut x);
            let expected = dot(&b, &x);
            let product = multigrid.descend(&b, &mut vectors);
            assert!((product - expected).abs() < 1e-5 * expected, "{name}: {product} for {expected}");
            let strays = multigrid.strays.iter().any(|strays| strays.len() > 0);
            with = [with[0] || multigrid.levels.is_empty(), with[1] || strays, with[2] || !multigrid.levels.is_empty()];
        }
        assert_eq!(with, [true; 3], "no mask that is all graph, has strays, has grids");
    }
}
