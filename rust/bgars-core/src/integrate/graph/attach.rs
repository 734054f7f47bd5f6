//! The strays of the grids, tied to the graph.

use super::matrix::Rows;
use super::reduced::{Edge, Nodes};
use crate::integrate::checkerboard::Weights;
use crate::integrate::places::{Place, diagonal, reds_around, ties};
use crate::integrate::strays::{Strays, coarse_shares, place};

/// Most nodes that stand for the neighbour of a stray.
const MAX_STANDINS: usize = 4;

/// The grids above the graph: each but the last with its strays; the reds of the last are the first nodes.
pub(super) struct Grids<'a> {
    pub weights: &'a [&'a Weights],
    pub strays: &'a [Strays],
    pub nodes: &'a Nodes,
}

impl Grids<'_> {
    /// The edges of the strays, which are the nodes after the others, those of the finest grid first; ascending.
    ///
    /// An edge from a stray to a red that is none goes to the nodes that hold this red, in proportion to their shares.
    pub fn edges_of_strays(&self) -> Vec<Edge> {
        let mut edges = Vec::new();
        let mut add = |from: u32, to: u32, weight: f64| {
            if from != to {
                edges.push(Edge { from, to, weight });
            }
        };
        let mut found = Vec::new();
        for (level, strays) in self.strays.iter().enumerate() {
            let weights = self.weights[level];
            let half = weights.grid.half();
            for (stray, &red) in strays.reds().iter().enumerate() {
                let node = (self.first_node(level) + stray) as u32;
                let here = place(red, half);
                ties(weights, here, &mut found);
                for &((row, k), weight) in found.iter().filter(|tie| tie.0 != here) {
                    if let Some(other) = strays.find(row as usize * half + k) {
                        add(node, (self.first_node(level) + other) as u32, weight);
                        continue;
                    }
                    // w (v - c_1 v_1 - c_2 v_2 ...)^2 as edges: w c_i to each, -w c_i c_j between them.
                    let standins = self.standins(level, (row, k));
                    for &(other, share) in &standins {
                        add(node, other, weight * share);
                        add(other, node, weight * share);
                        for &(third, part) in standins.iter().filter(|standin| standin.0 != other) {
                            add(other, third, -weight * share * part);
                        }
                    }
                }
            }
        }
        // Stable, and so are the sums.
        edges.sort_by_key(|edge| (edge.from, edge.to));
        edges.dedup_by(|next, kept| {
            let same = (next.from, next.to) == (kept.from, kept.to);
            if same {
                kept.weight += next.weight;
            }
            same
        });
        edges
    }

    /// The node of the first stray of a grid.
    fn first_node(&self, level: usize) -> usize {
        self.nodes.len() + self.strays[..level].iter().map(Strays::len).sum::<usize>()
    }

    /// The nodes that hold a red of a grid, and their shares.
    fn standins(&self, level: usize, red: Place) -> Vec<(u32, f64)> {
        let weights = self.weights[level];
        let index = red.0 as usize * weights.grid.half() + red.1;
        let Some(strays) = self.strays.get(level) else {
            return self.nodes.find(index).map(|node| (node as u32, 1.0)).into_iter().collect();
        };
        if let Some(stray) = strays.find(index) {
            return vec![((self.first_node(level) + stray) as u32, 1.0)];
        }
        let mut pixels = Vec::new();
        coarse_shares(weights, red, &mut pixels);
        self.hold(level + 1, pixels.into_iter())
    }

    /// What each stray's value is measured from: a row a stray, in the order of their nodes.
    pub fn bases(&self) -> Rows {
        let mut rows = Vec::new();
        for (level, strays) in self.strays.iter().enumerate() {
            for stray in 0..strays.len() {
                let base = strays.base(stray).map(|(pixel, share)| (pixel, f64::from(share)));
                let nodes = self.hold(level + 1, base);
                rows.push(nodes.into_iter().map(|(node, share)| (node as usize, share)).collect());
            }
        }
        Rows::from_lists(&rows, self.first_node(self.strays.len()))
    }

    /// The nodes that hold a value made of shares of the pixels (row-major) of a grid.
    fn hold(&self, level: usize, pixels: impl Iterator<Item = (usize, f64)>) -> Vec<(u32, f64)> {
        let weights = self.weights[level];
        let mut nodes: Vec<(u32, f64)> = Vec::new();
        let mut add = |red: Place, share: f64| {
            for (node, part) in self.standins(level, red) {
                match nodes.iter_mut().find(|known| known.0 == node) {
                    Some(known) => known.1 += share * part,
                    None => nodes.push((node, share * part)),
                }
            }
        };
        for (pixel, share) in pixels {
            let (row, col) = (pixel / weights.grid.width, pixel % weights.grid.width);
            let place = (row as isize, col / 2);
            if (row + col).is_multiple_of(2) {
                add(place, share);
            } else {
                // A black follows from its reds.
                let reds = reds_around(weights, place);
                let sum = diagonal(reds);
                for (red, weight) in reds.into_iter().filter(|edge| edge.1 > 0.0) {
                    add(red, share * weight / sum);
                }
            }
        }
        nodes.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
        nodes.truncate(MAX_STANDINS);
        let sum: f64 = nodes.iter().map(|node| node.1).sum();
        nodes.iter().map(|&(node, share)| (node, share / sum)).collect()
    }
}
