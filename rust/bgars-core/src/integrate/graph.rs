//! A graph Laplacian stored by rows, where coarse pixels are split into their connected parts.

use std::ops::Range;

use rayon::prelude::*;

use super::checkerboard::{Colour, Grid, TASK};
use super::real::Real;

/// Unknowns that one task works on: each has its own number of edges.
const PART: usize = TASK / 4;

/// The unknowns of one colour, in the order of their pixels, and their edges to those of the other colour.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// Where the edges of each unknown begin, and the end.
    pub starts: Vec<u32>,
    /// The neighbour of each edge, and its weight.
    pub ends: Vec<u32>,
    pub weights: Vec<f32>,
    /// The column of each unknown's pixel.
    pub cols: Vec<u32>,
    /// The first unknown of each row of pixels, and the end.
    pub rows: Vec<u32>,
}

impl Part {
    pub fn len(&self) -> usize {
        self.cols.len()
    }

    pub fn edges(&self, unknown: usize) -> Range<usize> {
        self.starts[unknown] as usize..self.starts[unknown + 1] as usize
    }
}

/// Reds and blacks.
#[derive(Debug)]
pub(super) struct Graph {
    pub grid: Grid,
    pub parts: [Part; 2],
}

impl Graph {
    pub fn has_edges(&self) -> bool {
        self.parts.iter().any(|part| !part.ends.is_empty())
    }

    /// As [`super::stencil::Stencil::update`].
    pub fn update<T: Real>(
        &self,
        colour: Colour,
        neighbours: &[T],
        input: &[T],
        values: &mut [T],
        set: impl Fn(&mut T, T, T, T) + Sync,
    ) {
        let part = &self.parts[colour as usize];
        each(values, |unknown, value| {
            let edges = part.edges(unknown);
            let (mut sum, mut diagonal) = (T::default(), T::default());
            for (&end, &weight) in part.ends[edges.clone()].iter().zip(&part.weights[edges]) {
                sum += T::from(weight) * neighbours[end as usize];
                diagonal += T::from(weight);
            }
            set(value, sum, diagonal, input[unknown]);
        });
    }
}

/// Sets every value by its place, on all threads where that is worth waking them: a W-cycle visits small graphs often.
pub(super) fn each<T: Send>(values: &mut [T], set: impl Fn(usize, &mut T) + Sync) {
    let set_all = |(task, values): (usize, &mut [T])| {
        values.iter_mut().enumerate().for_each(|(k, value)| set(task * PART + k, value));
    };
    if values.len() <= PART {
        set_all((0, values));
    } else {
        values.par_chunks_mut(PART).enumerate().for_each(set_all);
    }
}
