//! Vectors of `f64` by their intrinsics: what linear algebra needs.

use std::arch::x86_64::{
    __m256d, __m512d, _CMP_GT_OQ, _mm_max_ps, _mm_setzero_ps, _mm256_add_pd, _mm256_and_pd, _mm256_andnot_pd,
    _mm256_cmp_pd, _mm256_cvtps_pd, _mm256_div_pd, _mm256_fmadd_pd, _mm256_max_ps, _mm256_mul_pd,
    _mm256_permute2f128_pd, _mm256_set1_pd, _mm256_setzero_pd, _mm256_setzero_ps, _mm256_shuffle_pd, _mm256_sub_pd,
    _mm512_abs_pd, _mm512_add_pd, _mm512_alignr_epi64, _mm512_cmp_pd_mask, _mm512_cvtps_pd, _mm512_fmadd_pd,
    _mm512_maskz_div_pd, _mm512_maskz_mov_pd, _mm512_mul_pd, _mm512_reduce_add_pd, _mm512_set1_pd, _mm512_setzero_pd,
    _mm512_sub_pd,
};

use super::packed::chunked;
use super::{Arithmetic, Packed, first};

/// The upper half of one vector and the lower half of another.
const HALVES: i32 = 0x21;
/// Every second number of one vector and of another, in turn: an odd place of the first, an even one of the second.
const ODD_EVEN: i32 = 0b0101;

macro_rules! here {
    ($call:expr) => {{
        // SAFETY: the types are named only where their instructions are compiled in (see `Packed`).
        #[allow(unsafe_code)]
        unsafe {
            $call
        }
    }};
}

/// A type by its intrinsics; what takes more than one is written for `x` and `y`.
macro_rules! double {
    (
        $(#[$doc:meta])* $vector:ident($raw:ty), $width:literal, $splat:ident, $add:ident, $sub:ident, $mul:ident,
        $fused:ident, $convert:ident, $floats_max:ident, $floats_zero:ident,
        |$x:ident, $y:ident| after_last_of $after:expr, before_first_of $before:expr,
        magnitude $magnitude:expr, where_positive $where_positive:expr, over $over:expr, sum $sum:expr
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy)]
        pub(crate) struct $vector($raw);

        super::operators!($vector, $add, $sub, $mul);

        impl Arithmetic for $vector {
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

        impl Packed for $vector {
            chunked!(f64, $width, |from| Self(here!($convert(bytemuck::must_cast(*from)))));

            /// Half a vector is enough before they are widened.
            #[inline(always)]
            fn widen_positive(from: &[f32; $width]) -> Self {
                Self(here!($convert($floats_max(bytemuck::must_cast(*from), $floats_zero()))))
            }

            #[inline(always)]
            fn after_last_of(self, before: Self) -> Self {
                let ($x, $y) = (before.0, self.0);
                Self(here!($after))
            }

            #[inline(always)]
            fn before_first_of(self, next: Self) -> Self {
                let ($x, $y) = (self.0, next.0);
                Self(here!($before))
            }

            #[inline(always)]
            fn magnitude(self) -> Self {
                let $x = self.0;
                Self(here!($magnitude))
            }

            #[inline(always)]
            fn where_positive(self, other: Self) -> Self {
                let ($x, $y) = (self.0, other.0);
                Self(here!($where_positive))
            }

            #[inline(always)]
            fn over(self, divisor: Self) -> Self {
                let ($x, $y) = (self.0, divisor.0);
                Self(here!($over))
            }

            #[inline(always)]
            fn sum(self) -> f64 {
                let $x = self.0;
                $sum
            }
        }
    };
}

double!(
    /// Eight doubles of AVX-512.
    Avx512Double(__m512d), 8, _mm512_set1_pd, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_fmadd_pd,
    _mm512_cvtps_pd, _mm256_max_ps, _mm256_setzero_ps,
    |x, y| after_last_of bytemuck::must_cast(_mm512_alignr_epi64::<7>(bytemuck::must_cast(y), bytemuck::must_cast(x))),
    before_first_of bytemuck::must_cast(_mm512_alignr_epi64::<1>(bytemuck::must_cast(y), bytemuck::must_cast(x))),
    magnitude _mm512_abs_pd(x),
    where_positive _mm512_maskz_mov_pd(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(y, _mm512_setzero_pd()), x),
    over _mm512_maskz_div_pd(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(y, _mm512_setzero_pd()), x, y),
    sum here!(_mm512_reduce_add_pd(x))
);
double!(
    /// Four doubles of AVX2 with fused products.
    Avx2Double(__m256d), 4, _mm256_set1_pd, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_fmadd_pd,
    _mm256_cvtps_pd, _mm_max_ps, _mm_setzero_ps,
    |x, y| after_last_of _mm256_shuffle_pd::<ODD_EVEN>(_mm256_permute2f128_pd::<HALVES>(x, y), y),
    before_first_of _mm256_shuffle_pd::<ODD_EVEN>(x, _mm256_permute2f128_pd::<HALVES>(x, y)),
    magnitude _mm256_andnot_pd(_mm256_set1_pd(-0.0), x),
    where_positive _mm256_and_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(y, _mm256_setzero_pd()), x),
    over _mm256_and_pd(_mm256_cmp_pd::<_CMP_GT_OQ>(y, _mm256_setzero_pd()), _mm256_div_pd(x, y)),
    sum {
        let [a, b, c, d]: [f64; 4] = bytemuck::must_cast(x);
        (a + c) + (b + d)
    }
);
