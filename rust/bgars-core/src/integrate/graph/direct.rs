//! The coarsest graph, solved directly.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::matrix::Rows;

/// The pseudo-inverse of a small graph's Laplacian by Cholesky factorisation.
#[derive(Debug)]
pub(super) struct Direct {
    len: usize,
    /// The nodes with edges by connected component; the value of any other is free.
    components: Vec<Vec<u32>>,
    factor: Option<Cholesky<f64, Dyn>>,
}

impl Direct {
    pub fn new(graph: &Rows) -> Self {
        let components = components(graph);
        let nodes = components.concat();
        let mut place = vec![None; graph.len()];
        for (here, &node) in nodes.iter().enumerate() {
            place[node as usize] = Some(here);
        }
        let mut matrix = DMatrix::<f64>::zeros(nodes.len(), nodes.len());
        for (here, &node) in nodes.iter().enumerate() {
            for (other, weight) in graph.pairs(node as usize) {
                let weight = f64::from(weight);
                matrix[(here, here)] += weight;
                if let Some(there) = place[other] {
                    // Half from either end, so that rounding cannot make it asymmetric.
                    matrix[(here, there)] -= 0.5 * weight;
                    matrix[(there, here)] -= 0.5 * weight;
                }
            }
        }
        // The constant of a component is free: its first node is tied to zero, which makes the matrix definite.
        let mut first = 0;
        for component in &components {
            matrix[(first, first)] *= 2.0;
            first += component.len();
        }
        Self { len: graph.len(), components, factor: Cholesky::new(matrix) }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    /// `x = L^+ b`: of each component, the right side without its mean, and the solution of mean zero.
    ///
    /// A right side is consistent but for rounding. Were that rounding kept, its constant would outgrow all else in `x` once
    /// the residual of a large smooth surface is small.
    pub fn solve(&self, b: &[f32], x: &mut [f32]) {
        x.fill(0.0);
        let Some(factor) = &self.factor else { return };
        let nodes = || self.components.iter().flatten().map(|&node| node as usize);
        let mut vector = DVector::from_iterator(nodes().count(), nodes().map(|node| f64::from(b[node])));
        self.remove_means(vector.as_mut_slice());
        factor.solve_mut(&mut vector);
        self.remove_means(vector.as_mut_slice());
        for (node, &value) in nodes().zip(&vector) {
            x[node] = value as f32;
        }
    }

    /// Subtracts from the values of each component their mean.
    fn remove_means(&self, mut values: &mut [f64]) {
        for component in &self.components {
            let (here, rest) = values.split_at_mut(component.len());
            let mean = here.iter().sum::<f64>() / here.len() as f64;
            for value in &mut *here {
                *value -= mean;
            }
            values = rest;
        }
    }
}

/// The nodes with edges by connected component.
fn components(graph: &Rows) -> Vec<Vec<u32>> {
    // Nodes without edges are in none.
    let mut seen: Vec<bool> = (0..graph.len()).map(|node| graph.values(node).next().is_none()).collect();
    let mut components = Vec::new();
    for first in 0..graph.len() {
        if seen[first] {
            continue;
        }
        seen[first] = true;
        let mut component = vec![first as u32];
        let mut next = 0;
        while let Some(&node) = component.get(next) {
            for (other, _) in graph.pairs(node as usize) {
                if !seen[other] {
                    seen[other] = true;
                    component.push(other as u32);
                }
            }
            next += 1;
        }
        components.push(component);
    }
    components
}
