//! Sparse matrices by rows.

use rayon::prelude::*;

use super::CHUNK;

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

/// The rows of one task, to be joined.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub lengths: Vec<u32>,
    pub columns: Vec<u32>,
    pub values: Vec<f32>,
}

impl Part {
    /// Ends the row that began where the last one ended.
    pub fn end_row(&mut self, before: usize) {
        self.lengths.push((self.columns.len() - before) as u32);
    }

    pub fn push(&mut self, column: u32, value: f32) {
        self.columns.push(column);
        self.values.push(value);
    }
}

impl Rows {
    /// Joins the rows of all tasks, in order.
    pub(super) fn join(parts: Vec<Part>, width: usize) -> Self {
        let rows: usize = parts.iter().map(|part| part.lengths.len()).sum();
        let entries: usize = parts.iter().map(|part| part.columns.len()).sum();
        let mut starts = Vec::with_capacity(rows + 1);
        let mut columns = Vec::with_capacity(entries);
        let mut values = Vec::with_capacity(entries);
        let mut end = 0;
        starts.push(0);
        for part in parts {
            starts.extend(part.lengths.iter().map(|length| {
                end += length;
                end
            }));
            columns.extend_from_slice(&part.columns);
            values.extend_from_slice(&part.values);
        }
        Self { starts, columns, values, width }
    }

    /// A matrix from the entries of each row.
    pub fn from_lists(rows: &[Vec<(usize, f64)>], width: usize) -> Self {
        let mut part = Part::default();
        for row in rows {
            let before = part.columns.len();
            for &(column, value) in row {
                part.push(column as u32, value as f32);
            }
            part.end_row(before);
        }
        Self::join(vec![part], width)
    }

    /// The graph with further `edges` (from, to, weight; ascending), and nodes up to `len`.
    pub fn with_edges(self, edges: &[(u32, u32, f64)], len: usize) -> Self {
        let most = self.entries() + edges.len();
        let mut starts = Vec::with_capacity(len + 1);
        let mut columns: Vec<u32> = Vec::with_capacity(most);
        let mut values: Vec<f32> = Vec::with_capacity(most);
        starts.push(0);
        let mut rest = edges;
        for row in 0..len {
            let before = columns.len();
            if row < self.len() {
                let (own_columns, own_values) = self.row(row);
                columns.extend_from_slice(own_columns);
                values.extend_from_slice(own_values);
            }
            while let Some((&(_, to, weight), later)) = rest.split_first().filter(|(edge, _)| edge.0 as usize == row) {
                if let Some(place) = columns[before..].iter().position(|&column| column == to) {
                    values[before + place] += weight as f32;
                } else {
                    columns.push(to);
                    values.push(weight as f32);
                }
                rest = later;
            }
            starts.push(columns.len() as u32);
        }
        Self { starts, columns, values, width: len }
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
