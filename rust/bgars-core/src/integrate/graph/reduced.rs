//! The reds of a grid as a graph: `S = D_red - W D_black^-1 W^T`, entry by entry.

use rayon::prelude::*;

use super::matrix::{Part, Rows};
use super::{CHUNK, SETUP_CHUNK};
use crate::integrate::checkerboard::Weights;
use crate::integrate::places::ties;

/// Which reds are nodes: those with an edge, row by row.
#[derive(Debug)]
pub(super) struct Nodes(Vec<u32>);

impl Nodes {
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

/// The graph of the reds.
pub(super) fn reduced_graph(weights: &Weights) -> (Nodes, Rows) {
    let grid = weights.grid;
    let half = grid.half();
    let nodes: Vec<u32> = (0..grid.height)
        .into_par_iter()
        .flat_map_iter(|row| {
            let sides = weights.row(row as isize);
            let used = move |k: &usize| sides.iter().any(|side| side[k + 1] > 0.0);
            (0..half).filter(used).map(move |k| (row * half + k) as u32)
        })
        .collect();
    let mut node_of = vec![u32::MAX; grid.half_pixels()];
    for (node, &place) in nodes.iter().enumerate() {
        node_of[place as usize] = node as u32;
    }
    let parts = nodes
        .par_chunks(SETUP_CHUNK)
        .map(|nodes| {
            let mut part = Part::default();
            let mut found = Vec::new();
            for &place in nodes {
                let red = ((place as usize / half) as isize, place as usize % half);
                ties(weights, red, &mut found);
                let before = part.columns.len();
                for &((row, k), weight) in found.iter().filter(|tie| tie.0 != red) {
                    part.push(node_of[row as usize * half + k], weight as f32);
                }
                part.end_row(before);
            }
            part
        })
        .collect();
    let count = nodes.len();
    (Nodes(nodes), Rows::join(parts, count))
}
