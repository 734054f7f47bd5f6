//! Aggregation by connected parts: each block of 2 x 2 pixels becomes one coarse unknown for every connected component of the
//! unknowns in it, so that no wall of the mask is ever merged across. The blocks form a checkerboard again.

use rayon::prelude::*;

use super::adjacency::Adjacency;
use super::checkerboard::{COLOURS, Colour};
use super::graph::{Graph, Part};

impl Members {
    /// The blacks of a coarse unknown.
    pub fn of(&self, unknown: usize) -> &[u32] {
        &self.blacks[self.starts[unknown] as usize..self.starts[unknown + 1] as usize]
    }
}

/// Which coarse unknown each black belongs to, both ways; of the reds none needs to know.
#[derive(Debug)]
pub(super) struct Aggregates {
    /// Prolongation: the coarse unknown of each black, `2 index + colour`.
    pub parents: Vec<u32>,
    /// Restriction: the blacks of each coarse unknown of either colour.
    pub members: [Members; 2],
}

/// Lists of blacks.
#[derive(Debug, Default)]
pub(super) struct Members {
    /// Where each list begins, and the end.
    pub starts: Vec<u32>,
    pub blacks: Vec<u32>,
}

/// An unknown of the fine operator.
#[derive(Clone, Copy)]
struct Node {
    block: u32,
    colour: Colour,
    row: u32,
    unknown: u32,
}

/// The aggregates of a row of blocks, one after the other.
struct RowOfBlocks {
    nodes: Vec<Node>,
    /// Where the nodes of each aggregate begin, and the end.
    starts: Vec<usize>,
}

/// The coarse operator, resistors in a network: edges between the same aggregates in parallel, halved because each leads over
/// twice the distance; and the aggregates.
pub(super) fn aggregate(fine: &impl Adjacency) -> (Graph, Aggregates) {
    let grid = fine.grid().coarse();
    let rows: Vec<RowOfBlocks> = (0..grid.height).into_par_iter().map(|row| aggregates_of(fine, row)).collect();
    let (parents, starts) = number(fine, &rows);
    let row_parts: Vec<([Part; 2], [Members; 2])> =
        rows.into_par_iter().enumerate().map(|(row, blocks)| coarse_row(fine, row, &blocks, &parents)).collect();
    let mut parts = COLOURS.map(|colour| Part {
        rows: starts.iter().map(|start| start[colour as usize]).collect(),
        starts: vec![0],
        ..Part::default()
    });
    let mut members = COLOURS.map(|_| Members { starts: vec![0], blacks: Vec::new() });
    for (row_parts, row_members) in row_parts {
        for (all, of_row) in parts.iter_mut().zip(row_parts) {
            let first = all.ends.len() as u32;
            all.starts.extend(of_row.starts.iter().map(|start| first + start));
            all.ends.extend(of_row.ends);
            all.weights.extend(of_row.weights);
            all.cols.extend(of_row.cols);
        }
        for (all, of_row) in members.iter_mut().zip(row_members) {
            let first = all.blacks.len() as u32;
            all.starts.extend(of_row.starts.iter().map(|start| first + start));
            all.blacks.extend(of_row.blacks);
        }
    }
    let [_, parents] = parents;
    (Graph { grid, parts }, Aggregates { parents, members })
}

/// The connected components of each block of a row.
fn aggregates_of(fine: &impl Adjacency, row: usize) -> RowOfBlocks {
    let mut nodes = Vec::new();
    for row in 2 * row..(2 * row + 2).min(fine.grid().height) {
        for colour in COLOURS {
            // A pixel without edges needs no coarse unknown.
            for unknown in fine.row(colour, row).filter(|&unknown| fine.edges(colour, row, unknown).next().is_some()) {
                let block = (fine.col(colour, row, unknown) / 2) as u32;
                nodes.push(Node { block, colour, row: row as u32, unknown: unknown as u32 });
            }
        }
    }
    nodes.sort_by_key(|node| node.block);
    let mut starts = Vec::new();
    let (mut first, mut labels) = (0, Vec::new());
    for block in nodes.chunk_by_mut(|a, b| a.block == b.block) {
        label_components(fine, block, &mut labels);
        let mut order: Vec<(usize, Node)> = labels.iter().copied().zip(block.iter().copied()).collect();
        order.sort_by_key(|&(label, _)| label);
        for (place, node) in block.iter_mut().zip(&order) {
            *place = node.1;
        }
        starts.extend((0..order.len()).filter(|&k| k == 0 || order[k].0 != order[k - 1].0).map(|k| first + k));
        first += block.len();
    }
    starts.push(nodes.len());
    RowOfBlocks { nodes, starts }
}

/// Labels the nodes of a block: equal where edges within it connect them.
fn label_components(fine: &impl Adjacency, block: &[Node], labels: &mut Vec<usize>) {
    labels.clear();
    labels.extend(0..block.len());
    for (k, node) in block.iter().enumerate().filter(|(_, node)| node.colour == Colour::Red) {
        for (end, _) in fine.edges(Colour::Red, node.row as usize, node.unknown as usize) {
            let same = |other: &Node| other.colour == Colour::Black && other.unknown == end as u32;
            let Some(other) = block.iter().position(same) else { continue };
            let [kept, gone] = [labels[k].min(labels[other]), labels[k].max(labels[other])];
            labels.iter_mut().filter(|label| **label == gone).for_each(|label| *label = kept);
        }
    }
}

impl RowOfBlocks {
    fn aggregates(&self) -> impl Iterator<Item = &[Node]> {
        self.starts.windows(2).map(|ends| &self.nodes[ends[0]..ends[1]])
    }
}

/// The coarse unknown of each unknown, `2 index + colour`, for either colour of the fine operator; and the number of the first of
/// each row of blocks, for either colour, and how many there are.
fn number(fine: &impl Adjacency, rows: &[RowOfBlocks]) -> ([Vec<u32>; 2], Vec<[u32; 2]>) {
    let mut parents = COLOURS.map(|colour| vec![0; fine.len(colour)]);
    let (mut next, mut starts) = ([0; 2], vec![[0; 2]]);
    for (row, blocks) in rows.iter().enumerate() {
        for nodes in blocks.aggregates() {
            let colour = Colour::at(row, nodes[0].block as usize) as usize;
            for node in nodes {
                parents[node.colour as usize][node.unknown as usize] = 2 * next[colour] + colour as u32;
            }
            next[colour] += 1;
        }
        starts.push(next);
    }
    (parents, starts)
}

/// The coarse unknowns of a row of blocks with their edges, and the blacks that belong to them; numbers count from the row's first.
fn coarse_row(
    fine: &impl Adjacency,
    row: usize,
    blocks: &RowOfBlocks,
    parents: &[Vec<u32>; 2],
) -> ([Part; 2], [Members; 2]) {
    let mut found = <([Part; 2], [Members; 2])>::default();
    let mut edges: Vec<(u32, f32)> = Vec::new();
    for nodes in blocks.aggregates() {
        let colour = Colour::at(row, nodes[0].block as usize);
        let (part, members) = (&mut found.0[colour as usize], &mut found.1[colour as usize]);
        edges.clear();
        for node in nodes {
            if node.colour == Colour::Black {
                members.blacks.push(node.unknown);
            }
            let own = parents[node.colour as usize][node.unknown as usize];
            for (end, weight) in fine.edges(node.colour, node.row as usize, node.unknown as usize) {
                let other = parents[node.colour.other() as usize][end];
                if other == own {
                    continue;
                }
                match edges.iter_mut().find(|(end, _)| *end == other / 2) {
                    Some((_, sum)) => *sum += 0.5 * weight,
                    None => edges.push((other / 2, 0.5 * weight)),
                }
            }
        }
        part.cols.push(nodes[0].block);
        part.ends.extend(edges.iter().map(|&(end, _)| end));
        part.weights.extend(edges.iter().map(|&(_, weight)| weight));
        part.starts.push(part.ends.len() as u32);
        members.starts.push(members.blacks.len() as u32);
    }
    found
}
