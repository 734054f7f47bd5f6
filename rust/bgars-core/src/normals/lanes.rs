//! Blocks of pixels, worked on together.
//!
//! The one SIMD style of the crate: a quantity of a block is an array, a step is a loop over its lanes, and the compiler turns
//! these loops into the vector instructions that the calling function is compiled for. No closures in them: these are compiled for
//! any processor, and where a compiler does not inline one, the loop is lost.

use std::ops::{Deref, DerefMut};

/// Pixels of a block.
pub(super) const LANES: usize = 64;

/// Numbers side by side. Aligned, or every other vector would lie across two cache lines.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(super) struct Vector<T, const N: usize>(pub [T; N]);

/// One quantity of a block.
pub(super) type Lanes<T> = Vector<T, LANES>;

impl<T: Copy, const N: usize> Vector<T, N> {
    /// The same everywhere.
    pub const fn of(value: T) -> Self {
        Self([value; N])
    }
}

impl<T, const N: usize> Deref for Vector<T, N> {
    type Target = [T; N];

    #[inline(always)]
    fn deref(&self) -> &[T; N] {
        &self.0
    }
}

impl<T, const N: usize> DerefMut for Vector<T, N> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T; N] {
        &mut self.0
    }
}

/// Lights that are taken together in a loop over lanes: their sums stay in registers meanwhile.
pub(super) const GROUP: usize = 4;

/// `sum + a b`, in one rounding where the processor has an instruction for it; without one, `mul_add` would be a call.
#[inline(always)]
pub(crate) fn add_product<const FMA: bool>(sum: f32, a: f32, b: f32) -> f32 {
    if FMA { a.mul_add(b, sum) } else { sum + a * b }
}

/// `a^T b`.
#[inline(always)]
pub(super) fn dot<const FMA: bool>([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    add_product::<FMA>(add_product::<FMA>(a * x, b, y), c, z)
}
