//! The right side that a restriction starts from, made row by row as it is read.

use crate::integrate::checkerboard::Weights;
use crate::integrate::reduction::{add_blacks, scale_blacks};
use crate::integrate::ring::Ring;
use crate::vector::Packed;

/// The right side of the reds of a grid.
pub(in crate::integrate) enum RightSide<'a> {
    /// In memory.
    Reds(&'a [f32]),
    /// Reds and blacks of the whole grid: the blacks are eliminated, and what that makes of the reds is kept.
    Whole { colours: [&'a [f32]; 2], reduced: &'a mut [f32] },
}

impl RightSide<'_> {
    /// One for each task: `chunk` reds are a task's own.
    pub fn of_tasks(self, chunk: usize, tasks: usize) -> Vec<Self> {
        match self {
            Self::Reds(reds) => (0..tasks).map(|_| Self::Reds(reds)).collect(),
            Self::Whole { colours, reduced } => {
                reduced.chunks_mut(chunk).map(|reduced| Self::Whole { colours, reduced }).collect()
            }
        }
    }

    /// What must be known of a row before the one above it can be made; returns what it adds to `<blacks, D_black^-1 blacks>`.
    #[inline(always)]
    pub fn prepare<V: Packed<Number = f32>>(&self, weights: &Weights, row: isize, memory: &mut Making) -> f64 {
        match self {
            Self::Whole { colours: [_, blacks], .. } if weights.grid.contains(row) => {
                scale_blacks::<V>(weights, blacks, row, weights.spans.at(row), &mut memory.scaled)
            }
            _ => 0.0,
        }
    }

    /// A row along its span, for a task whose rows start at `first`. The row is one of the grid's, and those from one above to
    /// one below it are prepared.
    #[inline(always)]
    pub fn row<'b, V: Packed<Number = f32>>(
        &'b mut self,
        weights: &Weights,
        row: isize,
        first: isize,
        memory: &'b mut Making,
    ) -> &'b [f32] {
        let (half, span) = (weights.grid.half(), weights.spans.at(row));
        let here = |reds: &'b [f32]| &reds[row as usize * half..][span.range()];
        match self {
            Self::Reds(reds) => here(reds),
            Self::Whole { colours: [reds, _], reduced } => {
                let rows = first..first + (reduced.len() / half) as isize;
                let out = if rows.contains(&row) {
                    &mut reduced[(row - first) as usize * half..][span.range()]
                } else {
                    &mut memory.beside[span.range()]
                };
                add_blacks::<V>(weights, row, span, here(reds), &memory.scaled, out);
                out
            }
        }
    }
}

/// Memory to make rows in.
pub(in crate::integrate) struct Making {
    /// `D_black^-1 blacks`.
    scaled: Ring<f32>,
    /// A row beside the task's own.
    beside: Vec<f32>,
}

impl Making {
    pub fn new(n: usize) -> Self {
        Self { scaled: Ring::new(n), beside: vec![0.0; n] }
    }
}
