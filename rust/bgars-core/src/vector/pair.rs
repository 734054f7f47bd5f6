//! Two vectors side by side: while the results of one are waited for, the other goes on.

use std::ops::{Add, Div, Mul, Sub};

use bytemuck::NoUninit;

use super::spread::Spread;
use super::subset_sums::SubsetSums;
use super::{Arithmetic, ROW, RowTable, Vector};

/// The first half of the floats, and the second.
#[derive(Clone, Copy)]
pub(crate) struct Pair<V>(V, V);

macro_rules! operator {
    ($trait:ident $method:ident) => {
        impl<V: Vector> $trait for Pair<V> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0), self.1.$method(other.1))
            }
        }
    };
}
operator!(Add add);
operator!(Sub sub);
operator!(Mul mul);
operator!(Div div);

impl<V: Vector> Arithmetic for Pair<V> {
    type Number = f32;
    const WIDTH: usize = 2 * V::WIDTH;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        let half = V::splat(value);
        Self(half, half)
    }

    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        Self(V::load(from), V::load(&from[V::WIDTH..]))
    }

    #[inline(always)]
    fn write(self, to: &mut [f32]) {
        self.0.write(to);
        self.1.write(&mut to[V::WIDTH..]);
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, term: Self) -> Self {
        Self(self.0.times_plus(factor.0, term.0), self.1.times_plus(factor.1, term.1))
    }
}

impl<V: Vector> Vector for Pair<V> {
    type Mask = (V::Mask, V::Mask);
    const STREAMS: bool = V::STREAMS;
    const HOLDS_BLOCKS: bool = V::HOLDS_BLOCKS;

    #[inline(always)]
    fn repeated(number: &Spread) -> Self {
        let half = V::repeated(number);
        Self(half, half)
    }

    #[inline(always)]
    fn from_bytes(from: &[u8]) -> Self {
        Self(V::from_bytes(from), V::from_bytes(&from[V::WIDTH..]))
    }

    #[inline(always)]
    fn from_words(from: &[u16]) -> Self {
        Self(V::from_words(from), V::from_words(&from[V::WIDTH..]))
    }

    #[inline(always)]
    fn stream(self, to: &mut [f32]) {
        self.0.stream(to);
        self.1.stream(&mut to[V::WIDTH..]);
    }

    #[inline(always)]
    fn stream_block<T: NoUninit, const N: usize>(from: &[T; N], to: &mut [T; N]) {
        V::stream_block(from, to);
    }

    #[inline(always)]
    fn interleaved([x, y, z]: [Self; 3]) -> [Self; 3] {
        let [a, b, c] = V::interleaved([x.0, y.0, z.0]);
        let [d, e, f] = V::interleaved([x.1, y.1, z.1]);
        [Self(a, b), Self(c, d), Self(e, f)]
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, term: Self) -> Self {
        Self(self.0.times_minus(factor.0, term.0), self.1.times_minus(factor.1, term.1))
    }

    #[inline(always)]
    fn root(self) -> Self {
        Self(self.0.root(), self.1.root())
    }

    #[inline(always)]
    fn inverse_root(self) -> Self {
        Self(self.0.inverse_root(), self.1.inverse_root())
    }

    #[inline(always)]
    fn is_over(self, other: Self) -> Self::Mask {
        (self.0.is_over(other.0), self.1.is_over(other.1))
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        Self(self.0.at_least(other.0), self.1.at_least(other.1))
    }

    #[inline(always)]
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        (V::both(a.0, b.0), V::both(a.1, b.1))
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        Self(self.0.with_sign_of(other.0), self.1.with_sign_of(other.1))
    }

    #[inline(always)]
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        (V::either(a.0, b.0), V::either(a.1, b.1))
    }

    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        V::any(V::either(mask.0, mask.1))
    }

    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        V::all(V::both(mask.0, mask.1))
    }

    #[inline(always)]
    fn pick(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(V::pick(mask.0, yes.0, no.0), V::pick(mask.1, yes.1, no.1))
    }

    #[inline(always)]
    fn bits(mask: Self::Mask) -> u64 {
        V::bits(mask.0) | V::bits(mask.1) << V::WIDTH
    }

    #[inline(always)]
    fn flags(bits: u64) -> [bool; u64::BITS as usize] {
        V::flags(bits)
    }

    #[inline(always)]
    fn where_bit(self, bytes: &[u8], bit: usize) -> Self {
        Self(self.0.where_bit(bytes, bit), self.1.where_bit(&bytes[V::WIDTH..], bit))
    }

    #[inline(always)]
    fn rows(bytes: &[u8], table: &RowTable) -> [Self; ROW] {
        let (first, second) = (V::rows(bytes, table), V::rows(&bytes[V::WIDTH..], table));
        let mut rows = [Self::splat(0.0); ROW];
        for ((row, first), second) in rows.iter_mut().zip(first).zip(second) {
            *row = Self(first, second);
        }
        rows
    }

    #[inline(always)]
    fn sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>) -> [Self; ENTRIES] {
        let (first, second) = (V::sums_of(bytes, sums), V::sums_of(&bytes[V::WIDTH..], sums));
        let mut found = [Self::splat(0.0); ENTRIES];
        for ((found, first), second) in found.iter_mut().zip(first).zip(second) {
            *found = Self(first, second);
        }
        found
    }
}
