//! A number as a vector of itself, for rows that are no multiple of any other.

use std::ops::{Add, Mul, Sub};

use super::packed::chunked;
use super::{Arithmetic, Packed};

/// One number.
#[derive(Clone, Copy)]
pub(crate) struct One<T>(T);

macro_rules! one {
    ($number:ty) => {
        impl Add for One<$number> {
            type Output = Self;

            #[inline(always)]
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }

        impl Sub for One<$number> {
            type Output = Self;

            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }

        impl Mul for One<$number> {
            type Output = Self;

            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                Self(self.0 * other.0)
            }
        }

        impl Arithmetic for One<$number> {
            type Number = $number;
            const WIDTH: usize = 1;

            #[inline(always)]
            fn splat(value: $number) -> Self {
                Self(value)
            }

            #[inline(always)]
            fn load(from: &[$number]) -> Self {
                Self(from[0])
            }

            #[inline(always)]
            fn write(self, to: &mut [$number]) {
                to[0] = self.0;
            }

            #[inline(always)]
            fn times_plus(self, factor: Self, term: Self) -> Self {
                self * factor + term
            }
        }

        impl Packed for One<$number> {
            chunked!($number, 1, |from| Self(<$number>::from(from[0])));

            #[inline(always)]
            fn after_last_of(self, before: Self) -> Self {
                before
            }

            #[inline(always)]
            fn before_first_of(self, next: Self) -> Self {
                next
            }

            #[inline(always)]
            fn magnitude(self) -> Self {
                Self(self.0.abs())
            }

            #[inline(always)]
            fn widen_positive(from: &[f32; 1]) -> Self {
                Self(Self::widen(from).0.max(0.0))
            }

            #[inline(always)]
            fn where_positive(self, other: Self) -> Self {
                Self(if other.0 > 0.0 { self.0 } else { 0.0 })
            }

            #[inline(always)]
            fn over(self, divisor: Self) -> Self {
                Self(if divisor.0 > 0.0 { self.0 / divisor.0 } else { 0.0 })
            }

            #[inline(always)]
            fn sum(self) -> f64 {
                f64::from(self.0)
            }
        }
    };
}
one!(f32);
one!(f64);
