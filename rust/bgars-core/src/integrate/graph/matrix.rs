//! Sparse matrices by rows.

use rayon::prelude::*;

use super::{CHUNK, SETUP_CHUNK};

/// A sparse matrix by rows. As a graph: row i holds the neighbours of node i and the weights of the edges to them; the
/// diagonal of its Laplacian is the sum of a row.
#[derive(Debug, Default)]
pub(in crate::integrate) struct Rows {
    /// Where each row starts, and the end.
    starts: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f32>,
    width: usize,
}

/// The rows of one task.
#[derive(Debug, Default)]
pub(super) struct Part {
    lengths: Vec<u32>,
    columns: Vec<u32>,
    values: Vec<f32>,
    /// Where the row begins that is being filled in.
    row_start: usize,
}

impl Part {
    /// A further entry of the row.
    pub fn push(&mut self, column: u32, value: f32) {
        self.columns.push(column);
        self.values.push(value);
    }

    /// Adds to the row's entry in a column, which may be a further one.
    pub fn add(&mut self, column: u32, value: f32) {
        match self.columns[self.row_start..].iter().position(|&known| known == column) {
            Some(at) => self.values[self.row_start + at] += value,
            None => self.push(column, value),
        }
    }

    fn end_row(&mut self) {
        self.lengths.push((self.columns.len() - self.row_start) as u32);
        self.row_start = self.columns.len();
    }
}

impl Rows {
    /// `count` rows, each filled in by `fill` with a task's own memory.
    pub(super) fn build<M>(
        count: usize,
        width: usize,
        memory: impl Fn() -> M + Send + Sync,
        fill: impl Fn(&mut M, usize, &mut Part) + Send + Sync,
    ) -> Self {
        let parts: Vec<Part> = (0..count.div_ceil(SETUP_CHUNK))
            .into_par_iter()
            .map_init(memory, |memory, chunk| {
                let mut part = Part::default();
                for row in chunk * SETUP_CHUNK..((chunk + 1) * SETUP_CHUNK).min(count) {
                    fill(memory, row, &mut part);
                    part.end_row();
                }
                part
            })
            .collect();
        let mut rows = Self::empty(count, width, parts.iter().map(|part| part.columns.len()).sum());
        for part in parts {
            let mut end = rows.columns.len() as u32;
            rows.starts.extend(part.lengths.iter().map(|length| {
                end += length;
                end
            }));
            rows.columns.extend_from_slice(&part.columns);
            rows.values.extend_from_slice(&part.values);
        }
        rows
    }

    /// No rows yet, and room for as many.
    fn empty(rows: usize, width: usize, entries: usize) -> Self {
        let mut starts = Vec::with_capacity(rows + 1);
        starts.push(0);
        Self { starts, columns: Vec::with_capacity(entries), values: Vec::with_capacity(entries), width }
    }

    /// A matrix from the entries of each row.
    pub fn from_lists(rows: &[Vec<(usize, f64)>], width: usize) -> Self {
        let mut found = Self::empty(rows.len(), width, rows.iter().map(Vec::len).sum());
        for row in rows {
            found.columns.extend(row.iter().map(|entry| entry.0 as u32));
            found.values.extend(row.iter().map(|entry| entry.1 as f32));
            found.starts.push(found.columns.len() as u32);
        }
        found
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    pub fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Rows that are not empty.
    pub fn rows_with_entries(&self) -> usize {
        self.starts.windows(2).filter(|ends| ends[0] < ends[1]).count()
    }

    /// Columns and values of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> (&[u32], &[f32]) {
        let span = self.starts[row] as usize..self.starts[row + 1] as usize;
        (&self.columns[span.clone()], &self.values[span])
    }

    /// The entries of a row.
    #[inline(always)]
    pub fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        let (columns, values) = self.row(row);
        columns.iter().map(|&column| column as usize).zip(values.iter().copied())
    }

    /// Sum of a row: as a graph, the diagonal of the Laplacian.
    pub fn sum(&self, row: usize) -> f64 {
        self.row(row).1.iter().map(|&value| f64::from(value)).sum()
    }

    pub fn transpose(&self) -> Self {
        let mut starts = vec![0u32; self.width + 1];
        for &column in &self.columns {
            starts[column as usize + 1] += 1;
        }
        for column in 0..self.width {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut columns = vec![0; self.entries()];
        let mut values = vec![0.0; self.entries()];
        for row in 0..self.len() {
            for (column, value) in self.pairs(row) {
                let place = next[column] as usize;
                columns[place] = row as u32;
                values[place] = value;
                next[column] += 1;
            }
        }
        Self { starts, columns, values, width: self.len() }
    }

    /// `out = A x`.
    pub fn multiply(&self, x: &[f32], out: &mut [f32]) {
        Self::each(out, |row| self.pairs(row).map(|(column, value)| value * x[column]).sum());
    }

    /// `out = x + A y`.
    pub fn multiply_add(&self, y: &[f32], x: &[f32], out: &mut [f32]) {
        Self::each(out, |row| x[row] + self.pairs(row).map(|(column, value)| value * y[column]).sum::<f32>());
    }

    /// `out = b - L x` with the Laplacian `L` of the graph.
    pub fn residual(&self, b: &[f32], x: &[f32], out: &mut [f32]) {
        Self::each(out, |row| {
            let here = x[row];
            b[row] + self.pairs(row).map(|(column, weight)| weight * (x[column] - here)).sum::<f32>()
        });
    }

    /// Sets each element by its index, on all threads.
    fn each(out: &mut [f32], value: impl Fn(usize) -> f32 + Sync) {
        out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
            for (offset, out) in out.iter_mut().enumerate() {
                *out = value(chunk * CHUNK + offset);
            }
        });
    }
}
