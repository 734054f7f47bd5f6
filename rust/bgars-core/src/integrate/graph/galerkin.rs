//! The edges of the next coarser graph: `P^T L P` for the Laplacian `L` of a graph.

use rayon::prelude::*;

use super::CHUNK;
use super::matrix::{Part, Rows};

/// The coarser graph. Its Laplacian's rows add up to zero as those of `L` do, so the diagonal need not be kept.
pub(super) fn coarser_graph(graph: &Rows, prolongation: &Rows, restriction: &Rows) -> Rows {
    let n = restriction.len();
    let parts = (0..n.div_ceil(CHUNK))
        .into_par_iter()
        .map_init(
            || vec![u32::MAX; n],
            |place, chunk| {
                let mut part = Part::default();
                let mut row: Vec<(u32, f64)> = Vec::new();
                for coarse in chunk * CHUNK..((chunk + 1) * CHUNK).min(n) {
                    let mut add = |other: usize, value: f64| {
                        if place[other] == u32::MAX {
                            place[other] = row.len() as u32;
                            row.push((other as u32, value));
                        } else {
                            row[place[other] as usize].1 += value;
                        }
                    };
                    for (fine, share) in restriction.pairs(coarse) {
                        let share = f64::from(share);
                        for (other, weight) in graph.pairs(fine) {
                            for (to, part) in prolongation.pairs(other) {
                                add(to, share * f64::from(weight) * f64::from(part));
                            }
                        }
                        let diagonal = graph.sum(fine);
                        for (to, part) in prolongation.pairs(fine) {
                            add(to, -share * diagonal * f64::from(part));
                        }
                    }
                    let before = part.columns.len();
                    for &(other, weight) in &row {
                        place[other as usize] = u32::MAX;
                        if other as usize != coarse && weight != 0.0 {
                            part.push(other, weight as f32);
                        }
                    }
                    part.end_row(before);
                    row.clear();
                }
                part
            },
        )
        .collect();
    Rows::join(parts, n)
}
