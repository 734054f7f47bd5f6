//! Sparse matrices by rows.

use std::ops::Range;

use rayon::prelude::*;

use super::CHUNK;

/// Rows that one task sets up, which takes a hundred times as long as to multiply by them. Their columns lie near each other.
pub(super) const BLOCK: usize = 1 << 6;

/// Stands for a column too far from the others of its block.
const FAR: u16 = u16::MAX;

/// A sparse matrix by rows. As a graph: row i holds the neighbours of node i and the weights of the edges to them; the
/// diagonal of its Laplacian is the sum of a row.
///
/// Large ones are half of the memory of an integration, hence 16 bits a column, and blocks that stay where a task made them.
#[derive(Debug)]
pub(in crate::integrate) struct Rows {
    blocks: Vec<Block>,
    count: usize,
    width: usize,
}

/// [`BLOCK`] rows; the last block of a matrix may have empty ones too many.
#[derive(Debug)]
pub(in crate::integrate) struct Block {
    /// Where each row starts, and the end.
    starts: [u32; BLOCK + 1],
    first_column: u32,
    /// The column of each entry, counted from the first, or [`FAR`].
    columns: Box<[u16]>,
    values: Box<[f32]>,
    /// The entries that are far, ascending, and their columns.
    far: Box<[(u32, u32)]>,
}

/// A block with its columns written out.
pub(super) struct OpenBlock<'a> {
    block: &'a Block,
    columns: &'a [u32],
}

/// Rows of a block that is being filled in.
#[derive(Debug, Default)]
pub(super) struct Part {
    columns: Vec<u32>,
    values: Vec<f32>,
    ends: Vec<u32>,
}

impl Part {
    /// A further entry of the row.
    pub fn push(&mut self, column: u32, value: f32) {
        self.columns.push(column);
        self.values.push(value);
    }

    /// Adds to the row's entry in a column, which may be a further one.
    pub fn add(&mut self, column: u32, value: f32) {
        let start = self.ends.last().map_or(0, |&end| end as usize);
        match self.columns[start..].iter().position(|&known| known == column) {
            Some(at) => self.values[start + at] += value,
            None => self.push(column, value),
        }
    }

    fn end_row(&mut self) {
        self.ends.push(self.columns.len() as u32);
    }

    /// The rows as a block; none are left.
    fn take(&mut self) -> Block {
        let entries = self.columns.len() as u32;
        let starts = std::array::from_fn(|row| if row == 0 { 0 } else { *self.ends.get(row - 1).unwrap_or(&entries) });
        let first_column = first_column(&self.columns);
        let near = |column: u32| column.checked_sub(first_column).filter(|&offset| offset < u32::from(FAR));
        let block = Block {
            starts,
            first_column,
            columns: self.columns.iter().map(|&column| near(column).map_or(FAR, |offset| offset as u16)).collect(),
            values: self.values.as_slice().into(),
            far: (0..).zip(self.columns.iter().copied()).filter(|entry| near(entry.1).is_none()).collect(),
        };
        self.columns.clear();
        self.values.clear();
        self.ends.clear();
        block
    }
}

/// The column from which all others of a block can be counted; failing that, most of them.
fn first_column(columns: &[u32]) -> u32 {
    let (least, most) = columns.iter().fold((u32::MAX, 0), |(least, most), &at| (least.min(at), most.max(at)));
    if columns.is_empty() || most - least < u32::from(FAR) {
        return least;
    }
    let mut sorted = columns.to_vec();
    let middle = sorted.len() / 2;
    sorted.select_nth_unstable(middle).1.saturating_sub(u32::from(FAR) / 2)
}

impl Block {
    #[inline(always)]
    fn span(&self, row: usize) -> Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// Writes the columns out to `memory`, for a pass over all rows.
    pub(super) fn open<'a>(&'a self, memory: &'a mut Vec<u32>) -> OpenBlock<'a> {
        memory.clear();
        memory.extend(self.columns.iter().map(|&column| self.first_column + u32::from(column)));
        for &(entry, column) in &self.far {
            memory[entry as usize] = column;
        }
        OpenBlock { block: self, columns: memory }
    }

    #[cold]
    fn far_column(&self, entry: usize) -> u32 {
        let at = self.far.partition_point(|&(known, _)| (known as usize) < entry);
        self.far[at].1
    }
}

impl<'a> OpenBlock<'a> {
    /// Columns and values of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> (&'a [u32], &'a [f32]) {
        let span = self.block.span(row);
        (&self.columns[span.clone()], &self.block.values[span])
    }

    /// The entries of a row.
    #[inline(always)]
    pub fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        pairs(self.row(row))
    }
}

/// Columns and values, entry by entry.
#[inline(always)]
fn pairs<'a>((columns, values): (&'a [u32], &'a [f32])) -> impl Iterator<Item = (usize, f32)> + use<'a> {
    columns.iter().map(|&column| column as usize).zip(values.iter().copied())
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

    pub fn entries(&self) -> usize {
        self.blocks.iter().map(|block| block.values.len()).sum()
    }

    /// Rows that are not empty.
    pub fn rows_with_entries(&self) -> usize {
        let starts = self.blocks.iter().flat_map(|block| block.starts.windows(2));
        starts.filter(|ends| ends[0] < ends[1]).count()
    }

    /// The values of a row.
    #[inline(always)]
    pub fn values(&self, row: usize) -> &[f32] {
        let block = &self.blocks[row / BLOCK];
        &block.values[block.span(row % BLOCK)]
    }

    /// Columns and values of a row.
    #[inline(always)]
    pub fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        let block = &self.blocks[row / BLOCK];
        let span = block.span(row % BLOCK);
        let entries = span.clone().zip(&block.columns[span.clone()]).zip(&block.values[span]);
        entries.map(move |((entry, &column), &value)| {
            let near = block.first_column + u32::from(column);
            (if column == FAR { block.far_column(entry) } else { near } as usize, value)
        })
    }

    /// Sum of a row: as a graph, the diagonal of the Laplacian.
    pub fn sum(&self, row: usize) -> f64 {
        self.values(row).iter().map(|&value| f64::from(value)).sum()
    }

    pub fn transpose(&self) -> Self {
        let mut starts = vec![0u32; self.width + 1];
        for (column, _) in (0..self.len()).flat_map(|row| self.pairs(row)) {
            starts[column + 1] += 1;
        }
        for column in 0..self.width {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0.0); self.entries()];
        for row in 0..self.len() {
            for (column, value) in self.pairs(row) {
                entries[next[column] as usize] = (row as u32, value);
                next[column] += 1;
            }
        }
        Self::build(
            self.width,
            self.len(),
            || (),
            |(), column, part| {
                let span = starts[column] as usize..starts[column + 1] as usize;
                entries[span].iter().for_each(|&(row, value)| part.push(row, value));
            },
        )
    }

    /// `out = A x`.
    pub fn multiply(&self, x: &[f32], out: &mut [f32]) {
        self.each(out, |_, row| pairs(row).map(|(column, value)| value * x[column]).sum());
    }

    /// `out = x + A y`.
    pub fn multiply_add(&self, y: &[f32], x: &[f32], out: &mut [f32]) {
        self.each(out, |at, row| x[at] + pairs(row).map(|(column, value)| value * y[column]).sum::<f32>());
    }

    /// `out = b - L x` with the Laplacian `L` of the graph.
    pub fn residual(&self, b: &[f32], x: &[f32], out: &mut [f32]) {
        self.each(out, |at, row| {
            let here = x[at];
            b[at] + pairs(row).map(|(column, weight)| weight * (x[column] - here)).sum::<f32>()
        });
    }

    /// The blocks of each task.
    pub fn chunks(&self) -> rayon::slice::Chunks<'_, Block> {
        self.blocks.par_chunks(CHUNK / BLOCK)
    }

    /// Sets each element by its index, and columns and values of its row, on all threads.
    fn each(&self, out: &mut [f32], value: impl Fn(usize, (&[u32], &[f32])) -> f32 + Sync) {
        let chunks = self.chunks().zip(out.par_chunks_mut(CHUNK)).enumerate();
        chunks.for_each_init(Vec::new, |memory, (chunk, (blocks, out))| {
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
        let far: usize = rows.blocks.iter().map(|block| block.far.len()).sum();
        assert!((1..rows.entries() / 2).contains(&far), "{far} far");
        let back = |rows: &Rows, row: usize| -> Vec<(usize, f64)> {
            rows.pairs(row).map(|(column, value)| (column, f64::from(value))).collect()
        };
        for (row, list) in lists.iter().enumerate() {
            assert_eq!(&back(&rows, row), list);
        }
        let transpose = rows.transpose();
        let entries: usize = (0..WIDTH).map(|column| transpose.pairs(column).count()).sum();
        assert_eq!(entries, rows.entries());
        for (row, list) in lists.iter().enumerate() {
            for &(column, value) in list {
                assert!(back(&transpose, column).contains(&(row, value)), "{row}, {column}");
            }
        }
    }
}
