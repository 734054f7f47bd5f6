//! Gauss-Seidel in chunks: sweeps that do not depend on the threads.
//!
//! Each chunk of nodes is swept by itself and takes its neighbours in other chunks as they were before. With half the weight of
//! the edges to other chunks added to the diagonal the sweep converges on every graph (l1 smoothers: Baker, Falgout, Kolev,
//! Yang 2011), so that forward and backward sweep make the V-cycle symmetric and positive definite.

use rayon::prelude::*;

use super::CHUNK;
use super::block::{BLOCK, Opened, from_short, to_short};
use super::matrix::Rows;

#[derive(Debug)]
pub(super) struct Smoother {
    /// Rounded down to short values (see `block`): a larger diagonal converges, too.
    inverse_diagonal: Vec<u16>,
}

impl Smoother {
    pub fn new(graph: &Rows) -> Self {
        let inverse = |node: usize| {
            let chunk = node / CHUNK;
            let away = graph.pairs(node).filter(|(other, _)| other / CHUNK != chunk);
            let away: f64 = away.map(|(_, weight)| f64::from(weight.abs())).sum();
            let diagonal = graph.sum(node) + 0.5 * away;
            if diagonal > 0.0 { to_short((1.0 / diagonal) as f32) } else { 0 }
        };
        Self { inverse_diagonal: (0..graph.len()).into_par_iter().map(inverse).collect() }
    }

    /// `x = (D + L)^-1 b`, chunk by chunk: one sweep up the nodes, from zero.
    pub fn forward_from_zero(&self, graph: &Rows, b: &[f32], x: &mut [f32]) {
        let chunks = graph.chunks().zip(x.par_chunks_mut(CHUNK)).enumerate();
        let memory = || (Opened::default(), vec![0.0; CHUNK + 1]);
        chunks.for_each_init(memory, |(opened, swept), (chunk, (blocks, x))| {
            let first = chunk * CHUNK;
            let swept = &mut swept[..=CHUNK];
            // Zero for the nodes still to come, and at the end for those of other chunks: no question about each neighbour.
            swept.fill(0.0);
            for (at, block) in blocks.iter().enumerate() {
                let block = block.open(opened);
                for offset in at * BLOCK..((at + 1) * BLOCK).min(x.len()) {
                    let node = first + offset;
                    // Each weight by itself is divided: the node swept just before is waited for as short as can be.
                    let inverse = from_short(self.inverse_diagonal[node]);
                    let mut sum = inverse * b[node];
                    for (other, weight) in block.pairs(offset % BLOCK) {
                        sum += (inverse * weight) * swept[other.wrapping_sub(first).min(CHUNK)];
                    }
                    swept[offset] = sum;
                }
            }
            x.copy_from_slice(&swept[..x.len()]);
        });
    }

    /// One sweep down the nodes, from `before` to `x`.
    pub fn backward(&self, graph: &Rows, b: &[f32], before: &[f32], x: &mut [f32]) {
        let chunks = graph.chunks().zip(x.par_chunks_mut(CHUNK)).enumerate();
        let memory = || (Opened::default(), Vec::new());
        chunks.for_each_init(memory, |(opened, swept), (chunk, (blocks, x))| {
            let first = chunk * CHUNK;
            // The chunk, and around it what is never swept here: nearly all neighbours are in one place.
            let start = first.saturating_sub(CHUNK / 2);
            swept.clear();
            swept.extend_from_slice(&before[start..(first + CHUNK + CHUNK / 2).min(before.len())]);
            for (at, block) in blocks.iter().enumerate().rev() {
                let block = block.open(opened);
                for offset in (at * BLOCK..((at + 1) * BLOCK).min(x.len())).rev() {
                    let node = first + offset;
                    let (here, inverse) = (before[node], from_short(self.inverse_diagonal[node]));
                    let mut sum = inverse * b[node];
                    for (other, weight) in block.pairs(offset % BLOCK) {
                        let value = swept.get(other.wrapping_sub(start)).unwrap_or_else(|| &before[other]);
                        sum += (inverse * weight) * (value - here);
                    }
                    swept[node - start] = here + sum;
                }
            }
            x.copy_from_slice(&swept[first - start..][..x.len()]);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nodes in a ring with chords, some to other chunks and far away.
    fn graph(count: usize) -> Rows {
        let mut rows = vec![Vec::new(); count];
        let mut tie = |a: usize, b: usize| {
            let weight = 0.5 + ((a * 7 + b * 13) % 11) as f64;
            rows[a].push((b, weight));
            rows[b].push((a, weight));
        };
        for node in 0..count {
            tie(node, (node + 1) % count);
            if node % 3 == 0 && node + 50 < count {
                tie(node, node + 50);
            }
            if node % 40 == 0 && node + 3 * CHUNK < count {
                tie(node, node + 3 * CHUNK);
            }
        }
        Rows::from_lists(&rows, count)
    }

    /// Node by node, each neighbour by the question where it is.
    #[test]
    fn sweeps_take_what_was_swept_in_the_chunk_and_what_was_before_elsewhere() {
        let count = 4 * CHUNK + 77;
        let graph = graph(count);
        let smoother = Smoother::new(&graph);
        let number = |node: usize, seed: usize| ((node * 37 + seed) % 101) as f32 - 50.0;
        let [b, before]: [Vec<f32>; 2] = [3, 71].map(|seed| (0..count).map(|node| number(node, seed)).collect());
        let [mut forward, mut backward] = [vec![7.0; count], vec![7.0; count]];
        smoother.forward_from_zero(&graph, &b, &mut forward);
        smoother.backward(&graph, &b, &before, &mut backward);
        let [mut up, mut down] = [vec![0.0f64; count], before.iter().copied().map(f64::from).collect::<Vec<_>>()];
        let inverse = |node: usize| f64::from(from_short(smoother.inverse_diagonal[node]));
        for node in 0..count {
            let swept = graph.pairs(node).filter(|&(other, _)| other / CHUNK == node / CHUNK && other < node);
            let sum: f64 = swept.map(|(other, weight)| f64::from(weight) * up[other]).sum();
            up[node] = inverse(node) * (f64::from(b[node]) + sum);
        }
        for node in (0..count).rev() {
            let here = f64::from(before[node]);
            let value =
                |other: usize| if other / CHUNK == node / CHUNK { down[other] } else { f64::from(before[other]) };
            let sum: f64 = graph.pairs(node).map(|(other, weight)| f64::from(weight) * (value(other) - here)).sum();
            down[node] = here + inverse(node) * (f64::from(b[node]) + sum);
        }
        for node in 0..count {
            assert!(
                (f64::from(forward[node]) - up[node]).abs() < 1e-4,
                "up, {node}: {} for {}",
                forward[node],
                up[node]
            );
            assert!(
                (f64::from(backward[node]) - down[node]).abs() < 1e-4,
                "down, {node}: {} for {}",
                backward[node],
                down[node]
            );
        }
    }
}
