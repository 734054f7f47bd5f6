//! Vectors of whatever the processor has, SSE2 or NEON, through the crate `wide`.

use std::ops::{Add, Div, Mul, Sub};

use wide::{f32x8, f64x4};

use super::packed::chunked;
use super::subset_sums::SubsetSums;
use super::{Arithmetic, Packed, ROW, RowTable, Vector, first};

const WIDTH: usize = 8;

macro_rules! portable {
    ($(#[$doc:meta])* $vector:ident($raw:ident), $number:ty, $width:literal, |$floats:ident| $widen:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $vector($raw);

        portable!(@operator $vector, Add add);
        portable!(@operator $vector, Sub sub);
        portable!(@operator $vector, Mul mul);

        impl Arithmetic for $vector {
            type Number = $number;
            const WIDTH: usize = $width;

            #[inline(always)]
            fn splat(value: $number) -> Self {
                Self($raw::splat(value))
            }

            #[inline(always)]
            fn load(from: &[$number]) -> Self {
                Self($raw::new(first(from)))
            }

            #[inline(always)]
            fn write(self, to: &mut [$number]) {
                to[..$width].copy_from_slice(&self.0.to_array());
            }

            #[inline(always)]
            fn times_plus(self, factor: Self, term: Self) -> Self {
                if cfg!(target_arch = "aarch64") {
                    Self(self.0.mul_add(factor.0, term.0))
                } else {
                    self * factor + term
                }
            }
        }

        impl Packed for $vector {
            chunked!($number, $width, |$floats| $widen);

            #[inline(always)]
            fn after_last_of(self, before: Self) -> Self {
                let (before, numbers) = (before.0.to_array(), self.0.to_array());
                let mut shifted = [before[$width - 1]; $width];
                shifted[1..].copy_from_slice(&numbers[..$width - 1]);
                Self($raw::new(shifted))
            }

            #[inline(always)]
            fn before_first_of(self, next: Self) -> Self {
                let (numbers, next) = (self.0.to_array(), next.0.to_array());
                let mut shifted = [next[0]; $width];
                shifted[..$width - 1].copy_from_slice(&numbers[1..]);
                Self($raw::new(shifted))
            }

            #[inline(always)]
            fn magnitude(self) -> Self {
                Self(self.0.abs())
            }

            #[inline(always)]
            fn widen_positive(from: &[f32; $width]) -> Self {
                Self(Self::widen(from).0.fast_max($raw::ZERO))
            }

            #[inline(always)]
            fn where_positive(self, other: Self) -> Self {
                Self(self.0 & other.0.simd_gt($raw::ZERO))
            }

            #[inline(always)]
            fn over(self, divisor: Self) -> Self {
                Self((self.0 / divisor.0) & divisor.0.simd_gt($raw::ZERO))
            }

            #[inline(always)]
            fn sum(self) -> f64 {
                self.0.to_array().map(f64::from).iter().sum()
            }
        }
    };
    (@operator $vector:ident, $trait:ident $method:ident) => {
        impl $trait for $vector {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0))
            }
        }
    };
}

portable!(
    /// Eight floats.
    Portable(f32x8), f32, 8, |from| Self::load(from)
);
portable!(@operator Portable, Div div);
portable!(
    /// Four doubles.
    PortableDouble(f64x4), f64, 4, |from| Self(f64x4::new(from.map(f64::from)))
);

impl Portable {
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f32) -> Self {
        Self(f32x8::new(std::array::from_fn(value)))
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
    fn interleaved(vectors: [Self; 3]) -> [Self; 3] {
        let planes = vectors.map(|vector| vector.0.to_array());
        let value = |at: usize| planes[at % 3][at / 3];
        [0, WIDTH, 2 * WIDTH].map(|first| Self::from_fn(|lane| value(first + lane)))
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, term: Self) -> Self {
        self.times_plus(factor, Self::splat(0.0) - term)
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
    fn either(a: f32x8, b: f32x8) -> f32x8 {
        a | b
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        let sign = f32x8::splat(-0.0);
        Self((other.0 & sign) | (self.0 & !sign))
    }

    #[inline(always)]
    fn all(mask: f32x8) -> bool {
        mask.all()
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
    fn rows(bytes: &[u8], table: &RowTable) -> [Self; ROW] {
        let bytes: [u8; WIDTH] = first(bytes);
        std::array::from_fn(|entry| Self::from_fn(|lane| table.row(bytes[lane])[entry]))
    }

    #[inline(always)]
    fn sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>) -> [Self; ENTRIES] {
        let bytes: [u8; WIDTH] = first(bytes);
        let mut found = [Self::splat(0.0); ENTRIES];
        let [of_first, of_second, of_third] = &sums.of_three;
        for (((found, of_first), of_second), of_third) in found.iter_mut().zip(of_first).zip(of_second).zip(of_third) {
            *found = Self::from_fn(|lane| of_first[usize::from(bytes[lane] % 8)])
                + Self::from_fn(|lane| of_second[usize::from(bytes[lane] >> 3) % 8])
                + Self::from_fn(|lane| of_third[usize::from(bytes[lane] >> 6)]);
        }
        found
    }
}
