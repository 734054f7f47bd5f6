//! The edges of the next coarser graph: `P^T L P` for the Laplacian `L` of a graph.

use super::matrix::Rows;
use crate::memory::Scratch;

/// A sparse row that is added up entry by entry.
struct SparseSum {
    entries: Vec<(u32, f64)>,
    /// Where each column is among the entries.
    place: Scratch<u32>,
}

impl SparseSum {
    fn new(width: usize) -> Self {
        Self { entries: Vec::new(), place: Scratch::filled(u32::MAX, width) }
    }

    #[inline(always)]
    fn add(&mut self, column: usize, value: f64) {
        if self.place[column] == u32::MAX {
            self.place[column] = self.entries.len() as u32;
            self.entries.push((column as u32, value));
        } else {
            self.entries[self.place[column] as usize].1 += value;
        }
    }

    /// Takes the entries out, one after the other.
    fn drain(&mut self) -> impl Iterator<Item = (usize, f64)> {
        self.entries.drain(..).map(|(column, value)| {
            self.place[column as usize] = u32::MAX;
            (column as usize, value)
        })
    }
}

/// The coarser graph. Its Laplacian's rows add up to zero as those of `L` do, so the diagonal need not be kept.
pub(super) fn coarser_graph(graph: &Rows, prolongation: &Rows) -> Rows {
    let restriction = prolongation.transpose();
    let n = prolongation.width();
    let memory = || (SparseSum::new(graph.len()), SparseSum::new(n));
    Rows::build(n, n, memory, |(fine_row, coarse_row), coarse, row| {
        // -P^T L first: its columns are fewer than its terms.
        for &(fine, share) in restriction.column(coarse) {
            let (fine, share) = (fine as usize, f64::from(share));
            graph.pairs(fine).for_each(|(other, weight)| fine_row.add(other, share * f64::from(weight)));
            fine_row.add(fine, -share * graph.sum(fine));
        }
        for (fine, value) in fine_row.drain() {
            prolongation.pairs(fine).for_each(|(to, share)| coarse_row.add(to, value * f64::from(share)));
        }
        for (other, weight) in coarse_row.drain().filter(|&(other, weight)| other != coarse && weight != 0.0) {
            row.push(other as u32, weight as f32);
        }
    })
}
