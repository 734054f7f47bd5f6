//! A row of numbers for every byte.

/// Numbers of a row.
pub const ROW: usize = 8;

/// Numbers that a vector of 128 bits holds.
#[cfg(target_arch = "x86_64")]
pub(super) const QUARTER: usize = 4;

/// In each 128 bits, the first two values of both vectors: how a shuffle names its places.
#[cfg(target_arch = "x86_64")]
pub(super) const FIRST_TWO: i32 = 0b0100_0100;

/// In each 128 bits, the last two values of both vectors.
#[cfg(target_arch = "x86_64")]
pub(super) const LAST_TWO: i32 = 0b1110_1110;

/// The rows of all bytes, 8 KiB.
#[derive(Debug)]
#[repr(align(64))] // a cache line
pub struct RowTable([[f32; ROW]; 1 << 8]);

impl RowTable {
    /// Of rows from byte 0 on; of bytes beyond these, zeros.
    pub fn new(rows: impl Iterator<Item = [f32; ROW]>) -> Self {
        let mut table = [[0.0; ROW]; 1 << 8];
        for (place, row) in table.iter_mut().zip(rows) {
            *place = row;
        }
        Self(table)
    }

    /// The row of a byte.
    #[inline(always)]
    pub(super) fn row(&self, byte: u8) -> &[f32; ROW] {
        &self.0[usize::from(byte)]
    }

    /// A half of the row of a byte.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(super) fn half(&self, byte: u8, half: usize) -> [f32; QUARTER] {
        self.row(byte).as_chunks().0[half]
    }
}
