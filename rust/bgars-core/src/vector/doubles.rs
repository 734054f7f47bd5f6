//! Vectors of `f64`: what linear algebra needs.

#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{
    __m256d, __m512d, _mm256_add_pd, _mm256_fmadd_pd, _mm256_mul_pd, _mm256_set1_pd, _mm256_sub_pd, _mm512_add_pd,
    _mm512_fmadd_pd, _mm512_mul_pd, _mm512_set1_pd, _mm512_sub_pd,
};
use std::ops::{Add, Mul, Sub};

use wide::f64x4;

use super::{Packed, first};

#[cfg(target_arch = "x86_64")]
macro_rules! here {
    ($call:expr) => {{
        // SAFETY: the types are named only where their instructions are compiled in (see `Packed`).
        #[allow(unsafe_code)]
        unsafe {
            $call
        }
    }};
}

#[cfg(target_arch = "x86_64")]
macro_rules! double {
    ($(#[$doc:meta])* $vector:ident($raw:ty), $width:literal, $splat:ident, $add:ident, $sub:ident, $mul:ident, $fused:ident) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $vector($raw);

        super::operators!($vector, $add, $sub, $mul);

        impl Packed for $vector {
            type Number = f64;
            const WIDTH: usize = $width;

            #[inline(always)]
            fn splat(value: f64) -> Self {
                Self(here!($splat(value)))
            }

            #[inline(always)]
            fn load(from: &[f64]) -> Self {
                Self(bytemuck::must_cast(first::<_, $width>(from)))
            }

            #[inline(always)]
            fn write(self, to: &mut [f64]) {
                to[..$width].copy_from_slice(&bytemuck::must_cast::<_, [f64; $width]>(self.0));
            }

            #[inline(always)]
            fn times_plus(self, factor: Self, term: Self) -> Self {
                Self(here!($fused(self.0, factor.0, term.0)))
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
double!(
    /// Eight doubles of AVX-512.
    Avx512Double(__m512d), 8, _mm512_set1_pd, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_fmadd_pd
);
#[cfg(target_arch = "x86_64")]
double!(
    /// Four doubles of AVX2 with fused products.
    Avx2Double(__m256d), 4, _mm256_set1_pd, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_fmadd_pd
);

/// Four doubles on whatever the processor has.
#[derive(Clone, Copy)]
pub(crate) struct PortableDouble(f64x4);

macro_rules! operator {
    ($trait:ident $method:ident) => {
        impl $trait for PortableDouble {
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

impl Packed for PortableDouble {
    type Number = f64;
    const WIDTH: usize = 4;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(f64x4::splat(value))
    }

    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Self(f64x4::new(first(from)))
    }

    #[inline(always)]
    fn write(self, to: &mut [f64]) {
        to[..Self::WIDTH].copy_from_slice(&self.0.to_array());
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, term: Self) -> Self {
        self * factor + term
    }
}
