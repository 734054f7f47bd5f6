//! A few rows of a sparse matrix, in little memory.

use std::ops::Range;

/// Rows that one task sets up, which takes a hundred times as long as to multiply by them. Their columns lie near each other.
pub(super) const BLOCK: usize = 1 << 6;

/// Stands for a column too far from the others of its block.
const FAR: u16 = u16::MAX;

/// [`BLOCK`] rows; the last block of a matrix may have empty ones too many.
#[derive(Debug)]
pub(super) struct Block {
    /// Where each row starts, and the end.
    starts: [u32; BLOCK + 1],
    first_column: u32,
    /// The column of each entry, counted from the first, or [`FAR`].
    columns: Box<[u16]>,
    values: Box<[f32]>,
    /// The entries that are far, ascending, and their columns.
    far: Box<[(u32, u32)]>,
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

    pub fn end_row(&mut self) {
        self.ends.push(self.columns.len() as u32);
    }

    /// The rows as a block; none are left.
    pub fn take(&mut self) -> Block {
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

    /// The first column of those that are not far.
    pub fn least_column(&self) -> Option<u32> {
        let least = self.columns.iter().copied().min().filter(|&least| least != FAR);
        least.map(|least| self.first_column + u32::from(least))
    }

    pub fn entries(&self) -> usize {
        self.values.len()
    }

    /// Rows that are not empty.
    pub fn rows_with_entries(&self) -> usize {
        self.starts.windows(2).filter(|ends| ends[0] < ends[1]).count()
    }

    /// The values of a row.
    #[inline(always)]
    pub fn values(&self, row: usize) -> &[f32] {
        &self.values[self.span(row)]
    }

    /// Columns and values of a row.
    #[inline(always)]
    pub fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        let span = self.span(row);
        let entries = span.clone().zip(&self.columns[span.clone()]).zip(&self.values[span]);
        entries.map(|((entry, &column), &value)| {
            let near = self.first_column + u32::from(column);
            (if column == FAR { self.far_column(entry) } else { near } as usize, value)
        })
    }

    /// Writes the columns out to `memory`, for a pass over all rows.
    pub fn open<'a>(&'a self, memory: &'a mut Vec<u32>) -> OpenBlock<'a> {
        memory.clear();
        memory.extend(self.columns.iter().map(|&column| self.first_column + u32::from(column)));
        for &(entry, column) in &self.far {
            memory[entry as usize] = column;
        }
        OpenBlock { block: self, columns: memory }
    }

    /// Entries whose column takes as many bits as it needs.
    #[cfg(test)]
    pub fn far_entries(&self) -> usize {
        self.far.len()
    }

    #[cold]
    fn far_column(&self, entry: usize) -> u32 {
        let at = self.far.partition_point(|&(known, _)| (known as usize) < entry);
        self.far[at].1
    }
}

/// A block with its columns written out.
pub(super) struct OpenBlock<'a> {
    block: &'a Block,
    columns: &'a [u32],
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
pub(super) fn pairs<'a>((columns, values): (&'a [u32], &'a [f32])) -> impl Iterator<Item = (usize, f32)> + use<'a> {
    columns.iter().map(|&column| column as usize).zip(values.iter().copied())
}
