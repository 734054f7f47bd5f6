//! The coarsest graph, solved directly.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::matrix::Rows;

/// The inverse of a small graph's Laplacian by Cholesky factorisation.
#[derive(Debug)]
pub(super) struct Direct {
    len: usize,
    /// The nodes with edges; the value of any other is free.
    nodes: Vec<u32>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl Direct {
    pub fn new(graph: &Rows) -> Self {
        let nodes: Vec<u32> = (0..graph.len() as u32).filter(|&node| !graph.row(node as usize).0.is_empty()).collect();
        let place = |node: usize| nodes.binary_search(&(node as u32)).ok();
        let mut matrix = DMatrix::<f64>::zeros(nodes.len(), nodes.len());
        for (here, &node) in nodes.iter().enumerate() {
            for (other, weight) in graph.pairs(node as usize) {
                let weight = f64::from(weight);
                matrix[(here, here)] += weight;
                if let Some(there) = place(other) {
                    // Half from either end, so that rounding cannot make it asymmetric.
                    matrix[(here, there)] -= 0.5 * weight;
                    matrix[(there, here)] -= 0.5 * weight;
                }
            }
        }
        // The constant of a component is free: one of its nodes is tied to zero, and nothing else changes.
        for first in first_of_components(&matrix) {
            matrix[(first, first)] *= 2.0;
        }
        Self { len: graph.len(), factor: Cholesky::new(matrix), nodes }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// `x = L^-1 b`.
    pub fn solve(&self, b: &[f32], x: &mut [f32]) {
        x.fill(0.0);
        let Some(factor) = &self.factor else { return };
        let values = self.nodes.iter().map(|&node| f64::from(b[node as usize]));
        let mut vector = DVector::from_iterator(self.nodes.len(), values);
        factor.solve_mut(&mut vector);
        for (&node, &value) in self.nodes.iter().zip(&vector) {
            x[node as usize] = value as f32;
        }
    }
}

/// The first node of each connected component.
fn first_of_components(matrix: &DMatrix<f64>) -> Vec<usize> {
    let n = matrix.nrows();
    let mut seen = vec![false; n];
    let mut firsts = Vec::new();
    for first in 0..n {
        if seen[first] {
            continue;
        }
        firsts.push(first);
        seen[first] = true;
        let mut open = vec![first];
        while let Some(node) = open.pop() {
            for other in 0..n {
                if !seen[other] && matrix[(node, other)] != 0.0 {
                    seen[other] = true;
                    open.push(other);
                }
            }
        }
    }
    firsts
}
