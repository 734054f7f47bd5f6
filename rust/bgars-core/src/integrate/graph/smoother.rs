//! Gauss-Seidel in chunks: sweeps that do not depend on the threads.
//!
//! Each chunk of nodes is swept by itself and takes its neighbours in other chunks as they were before. With half the weight of
//! the edges to other chunks added to the diagonal the sweep converges on every graph (l1 smoothers: Baker, Falgout, Kolev,
//! Yang 2011), so that forward and backward sweep make the V-cycle symmetric and positive definite.

use rayon::prelude::*;

use super::CHUNK;
use super::block::BLOCK;
use super::matrix::Rows;

#[derive(Debug)]
pub(super) struct Smoother {
    inverse_diagonal: Vec<f32>,
}

impl Smoother {
    pub fn new(graph: &Rows) -> Self {
        let inverse = |node: usize| {
            let chunk = node / CHUNK;
            let away = graph.pairs(node).filter(|(other, _)| other / CHUNK != chunk);
            let away: f64 = away.map(|(_, weight)| f64::from(weight.abs())).sum();
            let diagonal = graph.sum(node) + 0.5 * away;
            if diagonal > 0.0 { (1.0 / diagonal) as f32 } else { 0.0 }
        };
        Self { inverse_diagonal: (0..graph.len()).into_par_iter().map(inverse).collect() }
    }

    /// `x = (D + L)^-1 b`, chunk by chunk: one sweep up the nodes, from zero.
    pub fn forward_from_zero(&self, graph: &Rows, b: &[f32], x: &mut [f32]) {
        let chunks = graph.chunks().zip(x.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each_init(Vec::new, |memory, (chunk, (blocks, x))| {
            let first = chunk * CHUNK;
            for (at, block) in blocks.iter().enumerate() {
                let block = block.open(memory);
                for offset in at * BLOCK..((at + 1) * BLOCK).min(x.len()) {
                    let node = first + offset;
                    let mut sum = b[node];
                    for (other, weight) in block.pairs(offset % BLOCK) {
                        if (first..node).contains(&other) {
                            sum += weight * x[other - first];
                        }
                    }
                    x[offset] = sum * self.inverse_diagonal[node];
                }
            }
        });
    }

    /// One sweep down the nodes, from `before` to `x`.
    pub fn backward(&self, graph: &Rows, b: &[f32], before: &[f32], x: &mut [f32]) {
        let chunks = graph.chunks().zip(x.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each_init(Vec::new, |memory, (chunk, (blocks, x))| {
            let first = chunk * CHUNK;
            let end = first + x.len();
            for (at, block) in blocks.iter().enumerate().rev() {
                let block = block.open(memory);
                for offset in (at * BLOCK..((at + 1) * BLOCK).min(x.len())).rev() {
                    let node = first + offset;
                    let here = before[node];
                    let mut sum = b[node];
                    for (other, weight) in block.pairs(offset % BLOCK) {
                        let value = if (node..end).contains(&other) { x[other - first] } else { before[other] };
                        sum += weight * (value - here);
                    }
                    x[offset] = here + sum * self.inverse_diagonal[node];
                }
            }
        });
    }
}
