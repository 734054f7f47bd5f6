//! Vectors of numbers, for the loops where a compiler's own vectors cost a factor of two.
//!
//! One body of code, written against [`Packed`] or [`Vector`], is compiled for each instruction set inside a function that enables it.

mod arithmetic;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "x86_64")]
mod doubles;
#[cfg(target_arch = "x86_64")]
mod interleaved;
mod one;
mod packed;
#[cfg(any(target_arch = "x86_64", test))]
mod pair;
mod portable;
mod row_table;
pub mod spread;
pub mod subset_sums;
#[cfg(test)]
mod tests;

use std::ops::Div;

use bytemuck::NoUninit;

/// Operators of a vector by its intrinsics; `here!` says why they may be called.
#[cfg(target_arch = "x86_64")]
macro_rules! operators {
    ($vector:ident, $add:ident, $sub:ident, $mul:ident $(, $div:ident)?) => {
        super::operators!(@one $vector, Add add $add);
        super::operators!(@one $vector, Sub sub $sub);
        super::operators!(@one $vector, Mul mul $mul);
        $(super::operators!(@one $vector, Div div $div);)?
    };
    (@one $vector:ident, $trait:ident $method:ident $call:ident) => {
        impl std::ops::$trait for $vector {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(here!($call(self.0, other.0)))
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
use operators;

pub(crate) use arithmetic::Arithmetic;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) use avx512::Avx512;
#[cfg(target_arch = "x86_64")]
pub(crate) use doubles::{Avx2Double, Avx512Double};
pub(crate) use one::One;
pub(crate) use packed::Packed;
#[cfg(any(target_arch = "x86_64", test))]
pub(crate) use pair::Pair;
pub(crate) use portable::{Portable, PortableDouble};
pub use row_table::{ROW, RowTable};
use spread::Spread;
use subset_sums::SubsetSums;

/// Floats, with what an image asks of them.
pub trait Vector: Arithmetic<Number = f32> + Div<Output = Self> {
    /// True or false for each value.
    type Mask: Copy;
    /// Whether [`Self::stream`] is more than [`Arithmetic::write`]: parts of a cache line that are streamed one by one, between
    /// other lines, are written to memory one by one.
    const STREAMS: bool = false;
    /// Whether registers hold as many bytes as a block has pixels, and are as many as 24 keys of each pixel want.
    const HOLDS_BLOCKS: bool = false;

    /// The same number everywhere, from memory.
    #[inline(always)]
    fn repeated(number: &Spread) -> Self {
        Self::load(&number.0)
    }
    /// Bytes as floats.
    fn from_bytes(from: &[u8]) -> Self;
    /// Words of 16 bits as floats.
    fn from_words(from: &[u16]) -> Self;
    /// Writes the values; past the caches where supported and aligned ([`crate::stream::finish`] must follow).
    #[inline(always)]
    fn stream(self, to: &mut [f32]) {
        self.write(to);
    }
    /// Copies values of any type, past the caches where supported, aligned, and whole registers ([`crate::stream::finish`] must follow).
    #[inline(always)]
    fn stream_block<T: NoUninit, const N: usize>(from: &[T; N], to: &mut [T; N]) {
        *to = *from;
    }
    /// `x[0] y[0] z[0] x[1] ...` in three vectors.
    fn interleaved(vectors: [Self; 3]) -> [Self; 3];

    /// `self factor - term`, in one rounding where [`Arithmetic::times_plus`] is.
    fn times_minus(self, factor: Self, term: Self) -> Self;
    /// Square root.
    fn root(self) -> Self;
    /// One over the square root, within `2^-22` of its size, of numbers from 1e-30 to 1e30; NaN of negative ones, NaN or infinite of zero.
    #[inline(always)]
    fn inverse_root(self) -> Self {
        Self::splat(1.0) / self.root()
    }
    /// `self > other`; false for NaN.
    fn is_over(self, other: Self) -> Self::Mask;
    /// The larger of both; `other` where one is NaN.
    fn at_least(self, other: Self) -> Self;
    /// The size of its own, the sign of the other.
    fn with_sign_of(self, other: Self) -> Self;
    /// True where both are.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// True where one of them is.
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// True where some value is.
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        Self::bits(mask) != 0
    }
    /// True where every value is.
    fn all(mask: Self::Mask) -> bool;
    /// `yes` where the mask is true, `no` elsewhere.
    fn pick(mask: Self::Mask, yes: Self, no: Self) -> Self;
    /// Bit k: value k of the mask.
    fn bits(mask: Self::Mask) -> u64;
    /// Flag k: bit k.
    #[inline(always)]
    fn flags(bits: u64) -> [bool; u64::BITS as usize] {
        flags_by_eights(bits)
    }
    /// The value where bit `bit` of its byte is set, 0 elsewhere.
    fn where_bit(self, bytes: &[u8], bit: usize) -> Self;
    /// For each byte its row of the table: the first numbers of all rows, the second, and so on.
    fn rows(bytes: &[u8], table: &RowTable) -> [Self; ROW];
    /// For each byte, the sums over the elements whose bits are set.
    fn sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>) -> [Self; ENTRIES];
}

/// A flag for every bit, from the lowest on.
///
/// By eights: to shift each of 64 by a number of its own, and to pack what comes out, is what vector instructions are slow at.
#[inline(always)]
fn flags_by_eights(bits: u64) -> [bool; u64::BITS as usize] {
    /// The lowest bit of every byte.
    const LOWEST: u64 = u64::from_ne_bytes([1; 8]);
    /// Bit k of byte k.
    const OWN: u64 = u64::from_le_bytes([1, 2, 4, 8, 16, 32, 64, 128]);
    let mut eights = [[0; 8]; 8];
    for (eight, byte) in eights.iter_mut().zip(bits.to_le_bytes()) {
        // In every byte a bit of its own, then carried to the highest place, then moved to the lowest.
        let own = (u64::from(byte) * LOWEST) & OWN;
        *eight = (((own + (128 * LOWEST - OWN)) >> 7) & LOWEST).to_le_bytes();
    }
    let bytes: [u8; u64::BITS as usize] = bytemuck::must_cast(eights);
    bytes.map(|byte| byte != 0)
}

/// The first values of a slice.
#[inline(always)]
fn first<T: Copy + Default, const N: usize>(values: &[T]) -> [T; N] {
    let mut first = [T::default(); N];
    first.copy_from_slice(&values[..N]);
    first
}
