//! Sparse matrices by rows.

use rayon::prelude::*;

use super::CHUNK;
use super::block::{BLOCK, Block, Opened, Part, pairs};
use crate::memory::Scratch;

/// A sparse matrix by rows. As a graph: row i holds the neighbours of node i and the weights of the edges to them; the
/// diagonal of its Laplacian is the sum of a row.
///
/// Large ones are half of the memory of an integration, hence blocks that stay where a task made them, with 16 bits a column.
#[derive(Debug)]
pub(in crate::integrate) struct Rows {
    blocks: Vec<Block>,
    count: usize,
    width: usize,
}

impl Rows {
    /// `count` rows, each filled in by `fill` with a task's own memory.
    pub(super) fn build<M>(
        count: usize,
        width: usize,
        memory: impl Fn() -> M + Send + Sync,
        fill: impl Fn(&mut M, usize, &mut Part) + Send + Sync,
    ) -> Self {
        let blocks = (0..count.div_ceil(BLOCK)).into_par_iter().map_init(
            || (memory(), Part::default()),
            |(memory, part), block| {
                for row in block * BLOCK..((block + 1) * BLOCK).min(count) {
                    fill(memory, row, part);
                    part.end_row();
                }
                part.take()
            },
        );
        Self { blocks: blocks.collect(), count, width }
    }

    /// A matrix from the entries of each row.
    pub fn from_lists(rows: &[Vec<(usize, f64)>], width: usize) -> Self {
        let fill = |(): &mut (), row: usize, part: &mut Part| {
            rows[row].iter().for_each(|&(column, value)| part.push(column as u32, value as f32));
        };
        Self::build(rows.len(), width, || (), fill)
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.count
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    pub fn entries(&self) -> usize {
        self.blocks.iter().map(Block::entries).sum()
    }

    /// Rows that are not empty.
    pub fn rows_with_entries(&self) -> usize {
        self.blocks.iter().map(Block::rows_with_entries).sum()
    }

    /// The values of a row.
    #[inline(always)]
    pub fn values(&self, row: usize) -> impl Iterator<Item = f32> {
        self.blocks[row / BLOCK].values(row % BLOCK)
    }

    /// Columns and values of a row.
    #[inline(always)]
    pub fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        self.blocks[row / BLOCK].pairs(row % BLOCK)
    }

    /// Sum of a row: as a graph, the diagonal of the Laplacian.
    pub fn sum(&self, row: usize) -> f64 {
        self.values(row).map(f64::from).sum()
    }

    /// The same by columns.
    pub(super) fn transpose(&self) -> Transpose {
        let mut starts = Scratch::filled(0u32, self.width + 2);
        for (column, _) in (0..self.len()).flat_map(|row| self.pairs(row)) {
            starts[column + 2] += 1;
        }
        for column in 0..self.width {
            starts[column + 2] += starts[column + 1];
        }
        // Each start but the first moves on to the next one, entry by entry.
        let mut entries = Scratch::filled((0, 0.0), self.entries());
        for row in 0..self.len() {
            for (column, value) in self.pairs(row) {
                entries[starts[column + 1] as usize] = (row as u32, value);
                starts[column + 1] += 1;
            }
        }
        Transpose { starts, entries }
    }

    /// `out = A x`.
    pub fn multiply(&self, x: &[f32], out: &mut [f32]) {
        self.each(out, |_, row| pairs(row).map(|(column, value)| value * x[column]).sum());
    }

    /// `out = x + A y`.
    pub fn multiply_add(&self, y: &[f32], x: &[f32], out: &mut [f32]) {
        self.each(out, |at, row| x[at] + pairs(row).map(|(column, value)| value * y[column]).sum::<f32>());
    }

    /// `out = A^T x`, in an order that does not depend on the threads: each task adds up what its rows give to the columns near
    /// each other, and then the tasks' sums follow in turn.
    pub fn multiply_transposed(&self, x: &[f32], out: &mut [f32]) {
        let tasks = self.chunks().zip(x.par_chunks(CHUNK));
        let sum =
            |(opened, near): &mut (Opened, Vec<f32>), (blocks, x)| Columns::of(blocks, self.width, x, opened, near);
        let sums: Vec<Columns> = tasks.map_init(Default::default, sum).collect();
        out.fill(0.0);
        for Columns { first, near, far } in sums {
            for (out, sum) in out[first..].iter_mut().zip(near) {
                *out += sum;
            }
            for (column, value) in far {
                out[column] += value;
            }
        }
    }

    /// `out = b - L x` with the Laplacian `L` of the graph.
    pub fn residual(&self, b: &[f32], x: &[f32], out: &mut [f32]) {
        self.each(out, |at, row| {
            let here = x[at];
            b[at] + pairs(row).map(|(column, weight)| weight * (x[column] - here)).sum::<f32>()
        });
    }

    /// The blocks of each task.
    pub(super) fn chunks(&self) -> rayon::slice::Chunks<'_, Block> {
        self.blocks.par_chunks(CHUNK / BLOCK)
    }

    /// Sets each element by its index, and columns and values of its row, on all threads.
    fn each(&self, out: &mut [f32], value: impl Fn(usize, (&[u32], &[f32])) -> f32 + Sync) {
        let chunks = self.chunks().zip(out.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each_init(Opened::default, |memory, (chunk, (blocks, out))| {
            let firsts = (chunk * CHUNK..).step_by(BLOCK);
            for ((first, block), out) in firsts.zip(blocks).zip(out.chunks_mut(BLOCK)) {
                let block = block.open(memory);
                for (row, out) in out.iter_mut().enumerate() {
                    *out = value(first + row, block.row(row));
                }
            }
        });
    }
}

/// The columns of a matrix, for a short while.
pub(super) struct Transpose {
    /// Where each column starts, and the end.
    starts: Scratch<u32>,
    /// Rows and values, column by column.
    entries: Scratch<(u32, f32)>,
}

impl Transpose {
    /// Rows and values of a column.
    pub fn column(&self, column: usize) -> &[(u32, f32)] {
        &self.entries[self.starts[column] as usize..self.starts[column + 1] as usize]
    }
}

/// What the rows of a task give to the columns.
struct Columns {
    /// The first of those near each other.
    first: usize,
    /// Their sums.
    near: Box<[f32]>,
    /// Single values of others.
    far: Vec<(usize, f32)>,
}

impl Columns {
    /// Most columns that are near each other: several rows of a wide image.
    const MOST: usize = 1 << 14;

    /// By how many there come to be more.
    const STEP: usize = 1 << 8;

    /// `opened` and `near` are memory of the task.
    fn of(blocks: &[Block], width: usize, x: &[f32], opened: &mut Opened, near: &mut Vec<f32>) -> Self {
        let first = blocks.iter().filter_map(Block::least_column).min().unwrap_or(0) as usize;
        let most = Self::MOST.min(width - first);
        near.clear();
        let mut far = Vec::new();
        for (block, x) in blocks.iter().zip(x.chunks(BLOCK)) {
            let block = block.open(opened);
            for (row, &x) in x.iter().enumerate() {
                for (column, value) in block.pairs(row) {
                    let at = column.wrapping_sub(first);
                    if at >= near.len() {
                        if at >= most {
                            far.push((column, value * x));
                            continue;
                        }
                        near.resize((at + Self::STEP).min(most), 0.0);
                    }
                    near[at] += value * x;
                }
            }
        }
        Self { first, near: near.as_slice().into(), far }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;

    /// Rows with entries near each other, some of them far away, and empty rows.
    #[test]
    fn near_and_far_columns_come_out_as_they_went_in() {
        const WIDTH: usize = 1 << 20;
        let lists: Vec<Vec<(usize, f64)>> = (0..1_000)
            .map(|row| {
                let near = (0..row % 7).map(|k| row * 900 + k * 300);
                let far = (row % 50 == 3).then_some(WIDTH - 1 - row);
                let columns = near.chain(far).chain((row % 90 == 5).then_some(row));
                columns.enumerate().map(|(k, column)| (column, (row + k) as f64)).collect()
            })
            .collect();
        let rows = Rows::from_lists(&lists, WIDTH);
        let far: usize = rows.blocks.iter().map(Block::far_entries).sum();
        assert!((1..rows.entries() / 2).contains(&far), "{far} far");
        let back = |rows: &Rows, row: usize| -> Vec<(usize, f64)> {
            rows.pairs(row).map(|(column, value)| (column, f64::from(value))).collect()
        };
        for (row, list) in lists.iter().enumerate() {
            assert_eq!(&back(&rows, row), list);
        }
        let transpose = rows.transpose();
        let entries: usize = (0..WIDTH).map(|column| transpose.column(column).len()).sum();
        assert_eq!(entries, rows.entries());
        let x: Vec<f32> = (0..lists.len()).map(|row| (row % 17) as f32).collect();
        let [mut fast, mut slow] = [vec![7.0; WIDTH], vec![7.0; WIDTH]];
        rows.multiply_transposed(&x, &mut fast);
        for (column, slow) in slow.iter_mut().enumerate() {
            *slow = transpose.column(column).iter().map(|&(row, value)| x[row as usize] * value).sum();
        }
        assert!(fast == slow && slow.iter().any(|&sum| sum > 0.0), "sums of whole numbers are exact");
        for (row, list) in lists.iter().enumerate() {
            for &(column, value) in list {
                assert!(transpose.column(column).contains(&(row as u32, value as f32)), "{row}, {column}");
            }
        }
    }
}
