//! Eight floats on whatever the processor has: two vectors of SSE2 or NEON, through the crate `wide`.

use std::ops::{Add, Div, Mul, Sub};

use wide::f32x8;

use super::packed::chunked;
use super::subset_sums::{GROUP, SubsetSums};
use super::{Packed, Vector, first};

/// Eight floats.
#[derive(Clone, Copy)]
pub(crate) struct Portable(f32x8);

const WIDTH: usize = 8;

macro_rules! operator {
    ($trait:ident $method:ident) => {
        impl $trait for Portable {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}
operator!(Add add);
operator!(Sub sub);
operator!(Mul mul);
operator!(Div div);

impl Portable {
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f32) -> Self {
        Self(f32x8::new(std::array::from_fn(value)))
    }
}

impl Packed for Portable {
    chunked!(f32, WIDTH, |from| Self::load(from));

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(f32x8::splat(value))
    }

    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        Self(f32x8::new(first(from)))
    }

    #[inline(always)]
    fn write(self, to: &mut [f32]) {
        self.store(to, false);
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, term: Self) -> Self {
        if cfg!(target_arch = "aarch64") { Self(self.0.mul_add(factor.0, term.0)) } else { self * factor + term }
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Self(self.0.abs())
    }

    #[inline(always)]
    fn positive_part(self) -> Self {
        Self(self.0.fast_max(f32x8::ZERO))
    }

    #[inline(always)]
    fn where_positive(self, other: Self) -> Self {
        Self(self.0 & other.0.simd_gt(f32x8::ZERO))
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        Self((f32x8::ONE / self.0) & self.0.simd_gt(f32x8::ZERO))
    }
}

impl Vector for Portable {
    type Mask = f32x8;

    #[inline(always)]
    fn from_bytes(from: &[u8]) -> Self {
        Self(f32x8::new(first::<_, WIDTH>(from).map(f32::from)))
    }

    #[inline(always)]
    fn from_words(from: &[u16]) -> Self {
        Self(f32x8::new(first::<_, WIDTH>(from).map(f32::from)))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32], _streamed: bool) {
        to[..WIDTH].copy_from_slice(&self.0.to_array());
    }

    #[inline(always)]
    fn store_interleaved(vectors: [Self; 3], to: &mut [f32], _streamed: bool) {
        let planes = vectors.map(|vector| vector.0.to_array());
        for (lane, triple) in to[..3 * WIDTH].as_chunks_mut::<3>().0.iter_mut().enumerate() {
            *triple = planes.map(|plane| plane[lane]);
        }
    }

    #[inline(always)]
    fn root(self) -> Self {
        Self(self.0.sqrt())
    }

    #[inline(always)]
    fn is_over(self, other: Self) -> f32x8 {
        self.0.simd_gt(other.0)
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        Self::pick(self.is_over(other), self, other)
    }

    #[inline(always)]
    fn both(a: f32x8, b: f32x8) -> f32x8 {
        a & b
    }

    #[inline(always)]
    fn pick(mask: f32x8, yes: Self, no: Self) -> Self {
        Self(mask.bitselect(yes.0, no.0))
    }

    #[inline(always)]
    fn bits(mask: f32x8) -> u64 {
        u64::from(mask.to_bitmask())
    }

    #[inline(always)]
    fn where_bit(self, bytes: &[u8], bit: usize) -> Self {
        let (values, bytes) = (self.0.to_array(), &bytes[..WIDTH]);
        Self::from_fn(|lane| if bytes[lane] >> bit & 1 == 1 { values[lane] } else { 0.0 })
    }

    #[inline(always)]
    fn add_sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>, to: &mut [Self; ENTRIES]) {
        let bytes: [u8; WIDTH] = first(bytes);
        for (entry, to) in to.iter_mut().enumerate() {
            for (group, tables) in sums.tables.iter().enumerate() {
                *to = *to
                    + Self::from_fn(|lane| tables[entry][usize::from(bytes[lane] >> (GROUP * group)) % (1 << GROUP)]);
            }
        }
    }
}
