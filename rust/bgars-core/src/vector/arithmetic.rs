//! What is computed number by number, in either precision.

use std::ops::{Add, Mul, Sub};

/// `WIDTH` numbers that are worked on at once. Slices hold at least as many; of longer ones the first count.
///
/// A type may be named only where its instructions are there: in a function compiled for them.
pub trait Arithmetic: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// `f32` or `f64`.
    type Number: Copy;
    /// Numbers in a vector.
    const WIDTH: usize;

    /// The same number everywhere.
    fn splat(value: Self::Number) -> Self;
    /// Numbers of a slice.
    fn load(from: &[Self::Number]) -> Self;
    /// Writes the numbers.
    fn write(self, to: &mut [Self::Number]);
    /// `self factor + term`, in one rounding where the processor does so at no cost.
    fn times_plus(self, factor: Self, term: Self) -> Self;
}
