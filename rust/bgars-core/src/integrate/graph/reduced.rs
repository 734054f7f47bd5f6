//! The reds of a grid as a graph: `S = D_red - W D_black^-1 W^T`, entry by entry.

use std::ops::Range;

use rayon::prelude::*;

use super::CHUNK;
use super::block::nearest_short;
use super::matrix::Rows;
use crate::integrate::checkerboard::Weights;
use crate::integrate::edge_bits::{REDS, reds_of};
use crate::integrate::places::ties;
use crate::memory::Scratch;

/// Which reds are nodes: those with an edge, row by row.
#[derive(Debug)]
pub(super) struct Nodes {
    /// A bit a red, the first by the lowest.
    bits: Vec<u64>,
    /// Nodes before each word of bits, and all of them.
    before: Vec<u32>,
}

/// Words that one task works on.
const WORDS: usize = CHUNK / REDS;

impl Nodes {
    pub fn new(weights: &Weights) -> Self {
        let (half, count) = (weights.grid.half(), weights.grid.half_pixels());
        let word = |word: usize| {
            let reds = word * REDS..((word + 1) * REDS).min(count);
            let is_node = |red: usize| weights.row((red / half) as isize).iter().any(|side| side[red % half + 1] > 0.0);
            reds.enumerate().map(|(bit, red)| u64::from(is_node(red)) << bit).sum::<u64>()
        };
        let bits: Vec<u64> = (0..count.div_ceil(REDS)).into_par_iter().with_min_len(WORDS).map(word).collect();
        let mut before = vec![0; bits.len() + 1];
        for (word, bits) in bits.iter().enumerate() {
            before[word + 1] = before[word] + bits.count_ones();
        }
        Self { bits, before }
    }

    pub fn len(&self) -> usize {
        self.before[self.bits.len()] as usize
    }

    /// The node of a red.
    pub fn find(&self, red: usize) -> Option<usize> {
        let (word, bit) = (red / REDS, 1 << (red % REDS));
        let bits = self.bits[word];
        (bits & bit != 0).then(|| (self.before[word] + (bits & (bit - 1)).count_ones()) as usize)
    }

    /// The reds that are nodes among those of some words.
    fn reds(&self, words: Range<usize>) -> impl Iterator<Item = usize> {
        words.flat_map(|word| reds_of(word, self.bits[word]))
    }

    /// The words of each task.
    fn tasks(&self) -> impl Iterator<Item = Range<usize>> {
        (0..self.bits.len()).step_by(WORDS).map(|first| first..(first + WORDS).min(self.bits.len()))
    }

    pub fn gather(&self, reds: &[f32], mut nodes: &mut [f32]) {
        let parts = self.tasks().map(|words| {
            let count = self.before[words.end] - self.before[words.start];
            (words, nodes.split_off_mut(..count as usize).unwrap_or_default())
        });
        parts.collect::<Vec<_>>().into_par_iter().for_each(|(words, nodes)| {
            for (node, red) in nodes.iter_mut().zip(self.reds(words)) {
                *node = reds[red];
            }
        });
    }

    /// The reds that are no nodes become 0.
    pub fn scatter(&self, nodes: &[f32], reds: &mut [f32]) {
        let tasks: Vec<_> = self.tasks().collect();
        tasks.into_par_iter().zip(reds.par_chunks_mut(CHUNK)).for_each(|(words, reds)| {
            reds.fill(0.0);
            let (first_red, first) = (words.start * REDS, self.before[words.start] as usize);
            for (node, red) in nodes[first..].iter().zip(self.reds(words)) {
                reds[red - first_red] = *node;
            }
        });
    }
}

/// The graph of the reds, and of `strays` more nodes, with further `edges` (ascending; what ties a pair already grows).
///
/// Without these its weights are short (see `block`). All of them are positive, so that whatever a Laplacian with the
/// rounded ones measures is right to one part in 256. The negative ones of strays, and those of coarser graphs, are there to
/// cancel others.
pub(super) fn reduced_graph(weights: &Weights, nodes: &Nodes, strays: usize, edges: &[Edge]) -> Rows {
    let half = weights.grid.half();
    let reds: Scratch<u32> = nodes.tasks().flat_map(|words| nodes.reds(words)).map(|red| red as u32).collect();
    let count = nodes.len() + strays;
    let kept = if edges.is_empty() { nearest_short } else { |weight| weight };
    Rows::build(count, count, Vec::new, |found, node, row| {
        if let Some(&red) = reds.get(node) {
            let here = ((red as usize / half) as isize, red as usize % half);
            ties(weights, here, found);
            for &((line, k), weight) in found.iter().filter(|tie| tie.0 != here) {
                if let Some(other) = nodes.find(line as usize * half + k) {
                    row.push(other as u32, kept(weight as f32));
                }
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

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Grid;

    /// Red by red, on a grid of several tasks whose rows end within a word.
    #[test]
    fn nodes_are_the_reds_with_a_real_edge() {
        let mut weights = Weights::unset(Grid { height: 130, width: 210 });
        let half = weights.grid.half();
        let is_tied = |red: usize| (red * 2_654_435_761) >> 7 & 7 > 2;
        for red in 0..weights.grid.half_pixels() {
            let tie = if is_tied(red) { 0.5 } else { -0.5 };
            weights.set_red(red / half, red % half, [0.0, tie, 0.0, 0.0]);
        }
        let (nodes, reds) = (Nodes::new(&weights), weights.grid.half_pixels());
        let expected: Vec<usize> = (0..reds).filter(|&red| is_tied(red)).collect();
        assert!(nodes.len() == expected.len() && reds > CHUNK && !half.is_multiple_of(REDS));
        for red in 0..reds {
            assert_eq!(nodes.find(red), expected.binary_search(&red).ok(), "red {red}");
        }
        let values: Vec<f32> = (0..reds).map(|red| 1.0 + red as f32).collect();
        let [mut gathered, mut scattered] = [vec![7.0; nodes.len()], vec![7.0; reds]];
        nodes.gather(&values, &mut gathered);
        assert!(gathered.iter().zip(&expected).all(|(&value, &red)| value == values[red]));
        nodes.scatter(&gathered, &mut scattered);
        for red in 0..reds {
            assert_eq!(scattered[red], if is_tied(red) { values[red] } else { 0.0 }, "red {red}");
        }
    }
}
