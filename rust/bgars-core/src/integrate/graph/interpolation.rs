//! Values of a graph from those of the next coarser one.

use super::matrix::Rows;
use super::splitting::{FINE, strong_limits};

/// Most coarse nodes that a node takes its value from.
const MAX_SOURCES: usize = 4;

/// Stands for a node that is no source.
const NONE: u32 = u32::MAX;

/// A row a node: 1 for a coarse node, else shares of coarse nodes that add up to 1.
///
/// Extended+i interpolation (De Sterck, Falgout, Nolting, Yang 2008): a fine node hangs on the coarse ones it
/// depends on, and through the fine ones it depends on, on theirs. Rows of a Laplacian add up to zero, hence the shares to
/// one. Of many sources the largest are kept.
pub(super) fn interpolation(graph: &Rows, coarse_of: &[u32]) -> Rows {
    let limits = strong_limits(graph);
    let coarse_nodes = coarse_of.iter().filter(|&&coarse| coarse != FINE).count();
    let memory = || Sources { graph, coarse_of, limits: &limits, shares: Vec::new(), place: vec![NONE; graph.len()] };
    Rows::build(graph.len(), coarse_nodes, memory, |sources, node, row| {
        if coarse_of[node] != FINE {
            row.push(coarse_of[node], 1.0);
            return;
        }
        let shares = sources.of(node);
        let sum: f64 = shares.iter().map(|source| source.1).sum();
        for &(source, share) in shares {
            row.push(coarse_of[source as usize], (share / sum) as f32);
        }
    })
}

/// Finds the sources of one node after another.
struct Sources<'a> {
    graph: &'a Rows,
    coarse_of: &'a [u32],
    limits: &'a [f32],
    /// Coarse nodes and what the node hangs on each.
    shares: Vec<(u32, f64)>,
    /// Where each node is in `shares`.
    place: Vec<u32>,
}

impl Sources<'_> {
    /// The sources of fine `node` and their weights.
    fn of(&mut self, node: usize) -> &[(u32, f64)] {
        let Self { graph, coarse_of, limits, shares, place } = self;
        let is_coarse = |node: usize| coarse_of[node] != FINE;
        shares.clear();
        let mut add = |source: usize| {
            if place[source] == NONE {
                place[source] = shares.len() as u32;
                shares.push((source as u32, 0.0));
            }
        };
        for (other, _) in graph.pairs(node).filter(|&(_, weight)| weight >= limits[node]) {
            if is_coarse(other) {
                add(other);
            } else {
                let strong = graph.pairs(other).filter(|&(_, weight)| weight >= limits[other]);
                strong.filter(|&(farther, _)| is_coarse(farther)).for_each(|(farther, _)| add(farther));
            }
        }
        for (other, weight) in graph.pairs(node).filter(|&(_, weight)| weight > 0.0) {
            if place[other] != NONE {
                shares[place[other] as usize].1 += f64::from(weight);
            } else if !is_coarse(other) && weight >= limits[node] {
                // What the fine neighbour passes on, to each source and back to this node.
                let ties = || graph.pairs(other).filter(|&(_, weight)| weight > 0.0);
                let passes = ties().filter(|&(farther, _)| farther == node || place[farther] != NONE);
                let factor = f64::from(weight) / passes.map(|(_, tie)| f64::from(tie)).sum::<f64>();
                for (farther, tie) in ties().filter(|&(farther, _)| place[farther] != NONE) {
                    shares[place[farther] as usize].1 += factor * f64::from(tie);
                }
            }
        }
        for &(source, _) in &*shares {
            place[source as usize] = NONE;
        }
        shares.retain(|source| source.1 > 0.0);
        if shares.len() > MAX_SOURCES {
            shares.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            shares.truncate(MAX_SOURCES);
        }
        shares
    }
}
