//! The reds of a grid as a graph: `S = D_red - W D_black^-1 W^T`, entry by entry.

use rayon::prelude::*;

use super::CHUNK;
use super::matrix::Rows;
use crate::integrate::checkerboard::Weights;
use crate::integrate::places::ties;

/// Which reds are nodes: those with an edge, row by row.
#[derive(Debug)]
pub(super) struct Nodes(Vec<u32>);

impl Nodes {
    pub fn new(weights: &Weights) -> Self {
        let half = weights.grid.half();
        let rows = (0..weights.grid.height).into_par_iter();
        let found = rows.flat_map_iter(|row| {
            let sides = weights.row(row as isize);
            let used = move |k: &usize| sides.iter().any(|side| side[k + 1] > 0.0);
            (0..half).filter(used).map(move |k| (row * half + k) as u32)
        });
        Self(found.collect())
    }

    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// The node of a red.
    pub fn find(&self, red: usize) -> Option<usize> {
        self.0.binary_search(&(red as u32)).ok()
    }

    pub fn gather(&self, reds: &[f32], nodes: &mut [f32]) {
        nodes.par_chunks_mut(CHUNK).zip(self.0.par_chunks(CHUNK)).for_each(|(nodes, places)| {
            for (node, &place) in nodes.iter_mut().zip(places) {
                *node = reds[place as usize];
            }
        });
    }

    /// The reds that are no nodes become 0.
    pub fn scatter(&self, nodes: &[f32], reds: &mut [f32]) {
        reds.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, reds)| {
            reds.fill(0.0);
            let first = chunk * CHUNK;
            let start = self.0.partition_point(|&place| (place as usize) < first);
            for (node, &place) in nodes[start..].iter().zip(&self.0[start..]) {
                let Some(red) = reds.get_mut(place as usize - first) else { break };
                *red = *node;
            }
        });
    }
}

/// The graph of the reds, and of `strays` more nodes, with further `edges` (ascending; what ties a pair already grows).
pub(super) fn reduced_graph(weights: &Weights, nodes: &Nodes, strays: usize, edges: &[Edge]) -> Rows {
    let half = weights.grid.half();
    let mut node_of = vec![u32::MAX; weights.grid.half_pixels()];
    for (node, &place) in nodes.0.iter().enumerate() {
        node_of[place as usize] = node as u32;
    }
    let count = nodes.len() + strays;
    Rows::build(count, count, Vec::new, |found, node, row| {
        if let Some(&place) = nodes.0.get(node) {
            let red = ((place as usize / half) as isize, place as usize % half);
            ties(weights, red, found);
            for &((line, k), weight) in found.iter().filter(|tie| tie.0 != red) {
                row.push(node_of[line as usize * half + k], weight as f32);
            }
        }
        let first = edges.partition_point(|edge| (edge.from as usize) < node);
        for edge in edges[first..].iter().take_while(|edge| edge.from as usize == node) {
            row.add(edge.to, edge.weight as f32);
        }
    })
}

/// An edge of a graph, from one of its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub from: u32,
    pub to: u32,
    pub weight: f64,
}
