//! Rows of numbers under the names that [`crate::integrate`] knows, until it has its own.

use std::ops::{Add, Mul, Sub};

/// `WIDTH` numbers that are worked on at once.
pub(crate) trait Packed: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// `f32` or `f64`.
    type Number: Copy;
    /// The numbers of a vector in memory.
    type Chunk;
    /// As many floats in memory.
    type Floats;
    /// Numbers in a vector.
    const WIDTH: usize;

    /// The same number everywhere.
    fn splat(value: Self::Number) -> Self;
    /// Writes the numbers.
    fn write(self, to: &mut [Self::Number]);
    /// `self factor + term`.
    fn times_plus(self, factor: Self, term: Self) -> Self;
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

/// A row of numbers.
#[derive(Clone, Copy)]
pub(crate) struct Numbers<T, const N: usize>([T; N]);

pub(crate) type One<T> = Numbers<T, 1>;
pub(crate) type Portable = Numbers<f32, 16>;
pub(crate) type PortableDouble = Numbers<f64, 8>;

macro_rules! operator {
    ($number:ty, $trait:ident $method:ident) => {
        impl<const N: usize> $trait for Numbers<$number, N> {
            type Output = Self;

            #[inline(always)]
            fn $method(mut self, other: Self) -> Self {
                for lane in 0..N {
                    self.0[lane] = self.0[lane].$method(other.0[lane]);
                }
                self
            }
        }
    };
}

macro_rules! packed {
    ($number:ty) => {
        operator!($number, Add add);
        operator!($number, Sub sub);
        operator!($number, Mul mul);

        impl<const N: usize> Packed for Numbers<$number, N> {
            type Number = $number;
            type Chunk = [$number; N];
            type Floats = [f32; N];
            const WIDTH: usize = N;

            #[inline(always)]
            fn splat(value: $number) -> Self {
                Self([value; N])
            }

            #[inline(always)]
            fn write(self, to: &mut [$number]) {
                to[..N].copy_from_slice(&self.0);
            }

            #[inline(always)]
            fn times_plus(self, factor: Self, term: Self) -> Self {
                self * factor + term
            }

            #[inline(always)]
            fn chunks(row: &[$number], n: usize) -> &[[$number; N]] {
                &row.as_chunks().0[..n]
            }

            #[inline(always)]
            fn chunks_mut(row: &mut [$number], n: usize) -> &mut [[$number; N]] {
                &mut row.as_chunks_mut().0[..n]
            }

            #[inline(always)]
            fn floats(row: &[f32], n: usize) -> &[[f32; N]] {
                &row.as_chunks().0[..n]
            }

            #[inline(always)]
            fn read(from: &[$number; N]) -> Self {
                Self(*from)
            }

            #[inline(always)]
            fn put(self, to: &mut [$number; N]) {
                *to = self.0;
            }

            #[inline(always)]
            fn widen(from: &[f32; N]) -> Self {
                Self(from.map(<$number>::from))
            }

            #[inline(always)]
            fn widen_positive(from: &[f32; N]) -> Self {
                Self(from.map(|number| <$number>::from(if number > 0.0 { number } else { 0.0 })))
            }

            #[inline(always)]
            fn magnitude(self) -> Self {
                Self(self.0.map(<$number>::abs))
            }

            #[inline(always)]
            fn where_positive(self, other: Self) -> Self {
                Self(std::array::from_fn(|lane| if other.0[lane] > 0.0 { self.0[lane] } else { 0.0 }))
            }

            #[inline(always)]
            fn after_last_of(self, before: Self) -> Self {
                Self(std::array::from_fn(|lane| if lane == 0 { before.0[N - 1] } else { self.0[lane - 1] }))
            }

            #[inline(always)]
            fn before_first_of(self, next: Self) -> Self {
                Self(std::array::from_fn(|lane| if lane == N - 1 { next.0[0] } else { self.0[lane + 1] }))
            }

            #[inline(always)]
            fn over(self, divisor: Self) -> Self {
                Self(self.0).zip(divisor, |a, b| if b > 0.0 { a / b } else { 0.0 })
            }

            #[inline(always)]
            fn sum(self) -> f64 {
                self.0.iter().map(|&number| f64::from(number)).sum()
            }
        }

        impl<const N: usize> Numbers<$number, N> {
            #[inline(always)]
            fn zip(self, other: Self, f: impl Fn($number, $number) -> $number) -> Self {
                Self(std::array::from_fn(|lane| f(self.0[lane], other.0[lane])))
            }
        }
    };
}
packed!(f32);
packed!(f64);
