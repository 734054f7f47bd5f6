//! Values of a graph from those of the next coarser one.

use super::matrix::Rows;
use super::splitting::{FINE, strong_limits};
use crate::memory::Scratch;

/// Most coarse nodes that a node takes its value from.
const MAX_SOURCES: usize = 4;

/// Stands for a node that is no source.
const NONE: u32 = u32::MAX;

/// Shares are whole multiples of one part in so many: a short value (see `block`) each, and their sum exactly 1.
const PARTS: f64 = 256.0;

/// A row a node: 1 for a coarse node, else shares of coarse nodes that add up to 1.
///
/// Extended+i interpolation (De Sterck, Falgout, Nolting, Yang 2008): a fine node hangs on the coarse ones it
/// depends on, and through the fine ones it depends on, on theirs. Rows of a Laplacian add up to zero, hence the shares to
/// one. Of many sources the largest are kept.
pub(super) fn interpolation(graph: &Rows, coarse_of: &[u32]) -> Rows {
    let limits = strong_limits(graph);
    let coarse_nodes = coarse_of.iter().filter(|&&coarse| coarse != FINE).count();
    let memory =
        || Sources { graph, coarse_of, limits: &limits, shares: Vec::new(), place: Scratch::filled(NONE, graph.len()) };
    Rows::build(graph.len(), coarse_nodes, memory, |sources, node, row| {
        if coarse_of[node] != FINE {
            row.push(coarse_of[node], 1.0);
            return;
        }
        for &(source, share) in in_parts(sources.of(node)) {
            row.push(coarse_of[source as usize], share as f32);
        }
    })
}

/// Shares of a whole in its parts; the largest makes up for what the others lose or win.
fn in_parts(shares: &mut Vec<(u32, f64)>) -> &[(u32, f64)] {
    let sum: f64 = shares.iter().map(|source| source.1).sum();
    let (mut left, mut largest) = (PARTS, 0);
    for at in 0..shares.len() {
        // Rounded to the nearest.
        shares[at].1 = f64::from((shares[at].1 * (PARTS / sum) + 0.5) as u32);
        left -= shares[at].1;
        largest = if shares[at].1 > shares[largest].1 { at } else { largest };
    }
    if let Some(largest) = shares.get_mut(largest) {
        largest.1 += left;
    }
    shares.retain(|source| source.1 > 0.0);
    for source in &mut *shares {
        source.1 /= PARTS;
    }
    shares
}

/// Finds the sources of one node after another.
struct Sources<'a> {
    graph: &'a Rows,
    coarse_of: &'a [u32],
    limits: &'a [f32],
    /// Coarse nodes and what the node hangs on each.
    shares: Vec<(u32, f64)>,
    /// Where each node is in `shares`.
    place: Scratch<u32>,
}

impl Sources<'_> {
    /// The sources of fine `node` and their weights.
    fn of(&mut self, node: usize) -> &mut Vec<(u32, f64)> {
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

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;
    use crate::integrate::graph::block::nearest_short;

    #[test]
    fn shares_are_short_and_add_up_to_one() {
        for seed in 1..500 {
            let given: Vec<(u32, f64)> =
                (0..=seed % 4).map(|at| (at, f64::from((seed * 31 + at * 17) % 97 + 1))).collect();
            let sum: f64 = given.iter().map(|source| source.1).sum();
            let mut shares = given.clone();
            let shares = in_parts(&mut shares);
            assert_eq!(shares.iter().map(|source| source.1).sum::<f64>(), 1.0);
            for &(source, share) in shares {
                assert_eq!(f64::from(nearest_short(share as f32)), share);
                assert!((share - given[source as usize].1 / sum).abs() < 2.0 / PARTS, "{given:?}: {shares:?}");
            }
        }
        // What is too small for a part is left out.
        assert_eq!(in_parts(&mut vec![(4, 1e-4), (9, 1.0)]), [(9, 1.0)]);
    }
}
