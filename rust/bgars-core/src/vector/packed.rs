//! What linear algebra on rows asks of a vector, in either precision.

use super::Arithmetic;

/// Numbers of a row of many.
pub trait Packed: Arithmetic {
    /// The numbers of a vector in memory.
    type Chunk;
    /// As many floats in memory.
    type Floats;

    /// The first `n` vectors of a row: loops over several rows of `n` ask for no bound.
    fn chunks(row: &[Self::Number], n: usize) -> &[Self::Chunk];
    /// The same, to write.
    fn chunks_mut(row: &mut [Self::Number], n: usize) -> &mut [Self::Chunk];
    /// The same of a row of floats.
    fn floats(row: &[f32], n: usize) -> &[Self::Floats];
    /// A vector of a row.
    fn read(from: &Self::Chunk) -> Self;
    /// Writes a vector of a row.
    fn put(self, to: &mut Self::Chunk);
    /// Floats as numbers.
    fn widen(from: &Self::Floats) -> Self;
    /// The same, 0 where below.
    fn widen_positive(from: &Self::Floats) -> Self;

    /// Without its sign.
    fn magnitude(self) -> Self;
    /// 0 where `other` is not above 0.
    fn where_positive(self, other: Self) -> Self;
    /// The numbers one place further on: the last of `before`, then all but the last of `self`.
    fn after_last_of(self, before: Self) -> Self;
    /// The numbers one place back: all but the first of `self`, then the first of `next`.
    fn before_first_of(self, next: Self) -> Self;
    /// `self / divisor`, or 0 where the divisor is not above 0.
    fn over(self, divisor: Self) -> Self;
    /// Sum of the numbers.
    fn sum(self) -> f64;
}

/// The part of [`Packed`] that only moves numbers.
macro_rules! chunked {
    ($number:ty, $width:expr, |$floats:ident| $widen:expr) => {
        type Chunk = [$number; $width];
        type Floats = [f32; $width];

        #[inline(always)]
        fn chunks(row: &[$number], n: usize) -> &[[$number; $width]] {
            &row.as_chunks().0[..n]
        }

        #[inline(always)]
        fn chunks_mut(row: &mut [$number], n: usize) -> &mut [[$number; $width]] {
            &mut row.as_chunks_mut().0[..n]
        }

        #[inline(always)]
        fn floats(row: &[f32], n: usize) -> &[[f32; $width]] {
            &row.as_chunks().0[..n]
        }

        #[inline(always)]
        fn read(from: &[$number; $width]) -> Self {
            Self::load(from)
        }

        #[inline(always)]
        fn put(self, to: &mut [$number; $width]) {
            self.write(to);
        }

        #[inline(always)]
        fn widen($floats: &[f32; $width]) -> Self {
            $widen
        }
    };
}
pub(super) use chunked;
