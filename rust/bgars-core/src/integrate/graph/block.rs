//! A few rows of a sparse matrix, in little memory.

use std::ops::Range;

/// Rows that one task sets up, which takes a hundred times as long as to multiply by them. Their columns lie near each other.
pub(super) const BLOCK: usize = 1 << 6;

/// Stands for a column too far from the others of its block.
const FAR: u16 = u16::MAX;

/// [`BLOCK`] rows; the last block of a matrix may have empty ones too many.
#[derive(Debug)]
pub(super) struct Block {
    ends: Ends,
    first_column: u32,
    /// The column of each entry, counted from the first, or [`FAR`].
    columns: Box<[u16]>,
    values: Values,
    /// The entries that are far, ascending, and their columns.
    far: Box<[(u32, u32)]>,
}

/// Where each row ends.
#[derive(Debug)]
enum Ends {
    Short(Box<[u16; BLOCK]>),
    Long(Box<[u32; BLOCK]>),
}

/// The values of a block, in half the memory where nothing is lost by it.
#[derive(Debug)]
enum Values {
    /// The upper halves of numbers whose lower halves are zero.
    Short(Box<[u16]>),
    Long(Box<[f32]>),
}

/// Bits of a number that a short value has.
const SHORT_BITS: u32 = u16::BITS;

/// The nearest number that needs 16 bits: as `f32`, but with 8 binary digits.
pub(super) fn nearest_short(value: f32) -> f32 {
    let half = (1 << (SHORT_BITS - 1)) - 1 + (value.to_bits() >> SHORT_BITS & 1);
    f32::from_bits((value.to_bits() + half) >> SHORT_BITS << SHORT_BITS)
}

/// A number above 0 rounded down to its short value.
pub(super) fn to_short(value: f32) -> u16 {
    (value.to_bits() >> SHORT_BITS) as u16
}

/// The number of a short value.
#[inline(always)]
pub(super) fn from_short(upper_half: u16) -> f32 {
    f32::from_bits(u32::from(upper_half) << SHORT_BITS)
}

impl Values {
    fn new(values: &[f32]) -> Self {
        if values.iter().all(|&value| from_short(to_short(value)).to_bits() == value.to_bits()) {
            Self::Short(values.iter().map(|&value| to_short(value)).collect())
        } else {
            Self::Long(values.into())
        }
    }

    #[inline(always)]
    fn at(&self, entry: usize) -> f32 {
        match self {
            Self::Short(values) => from_short(values[entry]),
            Self::Long(values) => values[entry],
        }
    }
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
        self.ends.resize(BLOCK, entries);
        let ends = match u16::try_from(entries) {
            Ok(_) => Ends::Short(Box::new(std::array::from_fn(|row| self.ends[row] as u16))),
            Err(_) => Ends::Long(Box::new(std::array::from_fn(|row| self.ends[row]))),
        };
        let first_column = first_column(&self.columns);
        let near = |column: u32| column.checked_sub(first_column).filter(|&offset| offset < u32::from(FAR));
        let block = Block {
            ends,
            first_column,
            columns: self.columns.iter().map(|&column| near(column).map_or(FAR, |offset| offset as u16)).collect(),
            values: Values::new(&self.values),
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
        let end = |row: usize| match &self.ends {
            Ends::Short(ends) => ends[row] as usize,
            Ends::Long(ends) => ends[row] as usize,
        };
        row.checked_sub(1).map_or(0, end)..end(row)
    }

    /// The first column of those that are not far.
    pub fn least_column(&self) -> Option<u32> {
        let least = self.columns.iter().copied().min().filter(|&least| least != FAR);
        least.map(|least| self.first_column + u32::from(least))
    }

    pub fn entries(&self) -> usize {
        self.columns.len()
    }

    /// Rows that are not empty.
    pub fn rows_with_entries(&self) -> usize {
        (0..BLOCK).filter(|&row| !self.span(row).is_empty()).count()
    }

    /// The values of a row.
    #[inline(always)]
    pub fn values(&self, row: usize) -> impl Iterator<Item = f32> {
        self.span(row).map(|entry| self.values.at(entry))
    }

    /// Columns and values of a row.
    #[inline(always)]
    pub fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        let span = self.span(row);
        span.clone().zip(&self.columns[span]).map(|(entry, &column)| {
            let near = self.first_column + u32::from(column);
            (if column == FAR { self.far_column(entry) } else { near } as usize, self.values.at(entry))
        })
    }

    /// Writes the rows out to `memory`, for a pass over all of them.
    pub fn open<'a>(&'a self, memory: &'a mut Opened) -> OpenBlock<'a> {
        let Opened { starts, columns, values } = memory;
        match &self.ends {
            Ends::Short(ends) => {
                for (start, &end) in starts[1..].iter_mut().zip(&ends[..]) {
                    *start = u32::from(end);
                }
            }
            Ends::Long(ends) => starts[1..].copy_from_slice(&ends[..]),
        }
        columns.clear();
        columns.extend(self.columns.iter().map(|&column| self.first_column + u32::from(column)));
        for &(entry, column) in &self.far {
            columns[entry as usize] = column;
        }
        let values = match &self.values {
            Values::Short(short) => {
                values.clear();
                values.extend(short.iter().map(|&short| from_short(short)));
                values
            }
            Values::Long(values) => &values[..],
        };
        OpenBlock { starts, columns, values }
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

/// Memory to write a block out.
pub(super) struct Opened {
    starts: [u32; BLOCK + 1],
    columns: Vec<u32>,
    values: Vec<f32>,
}

impl Default for Opened {
    fn default() -> Self {
        Self { starts: [0; BLOCK + 1], columns: Vec::new(), values: Vec::new() }
    }
}

/// A block written out.
pub(super) struct OpenBlock<'a> {
    /// Where each row starts, and the end.
    starts: &'a [u32; BLOCK + 1],
    columns: &'a [u32],
    values: &'a [f32],
}

impl<'a> OpenBlock<'a> {
    /// Columns and values of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> (&'a [u32], &'a [f32]) {
        let span = self.starts[row] as usize..self.starts[row + 1] as usize;
        (&self.columns[span.clone()], &self.values[span])
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

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;

    /// Rows of so many entries each, the same value everywhere.
    fn rows_of(entries: u32, value: f32) -> Block {
        let mut part = Part::default();
        for _ in 0..BLOCK {
            (0..entries).for_each(|column| part.push(column, value));
            part.end_row();
        }
        part.take()
    }

    #[test]
    fn short_or_long_a_block_reads_the_same() {
        // 66,000 ends are more than 16 bits; 257 is an odd number of 9 bits.
        for (entries, value, is_short) in
            [(3, 256.0, [true, true]), (1_100, -0.375, [false, true]), (3, 257.0, [true, false])]
        {
            let block = rows_of(entries, value);
            let [ends, values] = [matches!(block.ends, Ends::Short(_)), matches!(block.values, Values::Short(_))];
            assert_eq!([ends, values], is_short, "{entries} times {value}");
            let mut memory = Opened::default();
            let open = block.open(&mut memory);
            for row in [0, 1, BLOCK - 1] {
                let expected: Vec<_> = (0..entries as usize).map(|column| (column, value)).collect();
                assert_eq!(block.pairs(row).collect::<Vec<_>>(), expected);
                assert_eq!(open.pairs(row).collect::<Vec<_>>(), expected);
                assert!(block.values(row).eq(expected.iter().map(|pair| pair.1)));
            }
        }
    }

    #[test]
    fn the_nearest_short_value_has_eight_digits() {
        for (value, nearest) in
            [(256.0, 256.0), (257.0, 256.0), (259.0, 260.0), (258.0, 258.0), (-1.001, -1.0), (0.0, 0.0)]
        {
            assert_eq!(nearest_short(value), nearest);
        }
        for k in 1..5_000 {
            let value = 1e-6 * k as f32;
            let nearest = nearest_short(value);
            assert_eq!(from_short(to_short(nearest)), nearest);
            assert!((nearest - value).abs() <= value / 256.0 && from_short(to_short(value)) <= value);
        }
    }
}
