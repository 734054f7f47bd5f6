//! Eight floats of AVX2 with fused products.

use std::arch::x86_64::{
    __m128, __m256, __m256i, _CMP_GT_OQ, _mm_cvtsi64_si128, _mm256_add_pd, _mm256_add_ps, _mm256_alignr_epi8,
    _mm256_and_ps, _mm256_and_si256, _mm256_andnot_ps, _mm256_blend_ps, _mm256_blendv_ps, _mm256_castps128_ps256,
    _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32, _mm256_cvtepi32_ps, _mm256_cvtepu8_epi32,
    _mm256_cvtepu16_epi32, _mm256_cvtps_pd, _mm256_div_ps, _mm256_fmadd_ps, _mm256_fmsub_ps, _mm256_insertf128_ps,
    _mm256_max_ps, _mm256_movemask_ps, _mm256_mul_ps, _mm256_or_ps, _mm256_permute2f128_ps, _mm256_permutevar8x32_ps,
    _mm256_set1_epi32, _mm256_set1_ps, _mm256_setzero_ps, _mm256_shuffle_ps, _mm256_sqrt_ps, _mm256_srli_epi32,
    _mm256_sub_ps, _mm256_unpackhi_ps, _mm256_unpacklo_ps,
};

use super::packed::chunked;
use super::row_table::{FIRST_TWO, LAST_TWO, QUARTER};
use super::subset_sums::SubsetSums;
use super::{Arithmetic, Packed, ROW, RowTable, Vector, first};

/// Eight floats.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

const WIDTH: usize = 8;

/// The upper half of one vector and the lower half of another.
const HALVES: i32 = 0x21;

/// The lower halves of two vectors.
const LOWER_HALVES: i32 = 0x20;

/// The upper halves of two vectors.
const UPPER_HALVES: i32 = 0x31;

/// The lower half of one vector and the upper half of another, in place.
const UPPER_HALF: i32 = 0xf0;

/// Calls intrinsics where they are compiled in.
macro_rules! here {
    ($call:expr) => {{
        // SAFETY: the type is named only where AVX2 and FMA are compiled in (see `Vector`), and none touches memory.
        #[allow(unsafe_code)]
        unsafe {
            $call
        }
    }};
}

super::operators!(Avx2, _mm256_add_ps, _mm256_sub_ps, _mm256_mul_ps, _mm256_div_ps);

/// Eight bytes as integers.
#[inline(always)]
fn widened(bytes: &[u8]) -> __m256i {
    here!(_mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(first(bytes)))))
}

impl Arithmetic for Avx2 {
    type Number = f32;
    const WIDTH: usize = WIDTH;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(here!(_mm256_set1_ps(value)))
    }

    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        Self(bytemuck::must_cast(first::<_, WIDTH>(from)))
    }

    #[inline(always)]
    fn write(self, to: &mut [f32]) {
        to[..WIDTH].copy_from_slice(&bytemuck::must_cast::<_, [f32; WIDTH]>(self.0));
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, term: Self) -> Self {
        Self(here!(_mm256_fmadd_ps(self.0, factor.0, term.0)))
    }
}

impl Packed for Avx2 {
    chunked!(f32, WIDTH, |from| Self::load(from));

    #[inline(always)]
    fn after_last_of(self, before: Self) -> Self {
        let middle = here!(_mm256_permute2f128_ps::<HALVES>(before.0, self.0));
        Self(here!(bytemuck::must_cast(_mm256_alignr_epi8::<12>(
            bytemuck::must_cast(self.0),
            bytemuck::must_cast(middle)
        ))))
    }

    #[inline(always)]
    fn before_first_of(self, next: Self) -> Self {
        let middle = here!(_mm256_permute2f128_ps::<HALVES>(self.0, next.0));
        Self(here!(bytemuck::must_cast(_mm256_alignr_epi8::<4>(
            bytemuck::must_cast(middle),
            bytemuck::must_cast(self.0)
        ))))
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Self(here!(_mm256_andnot_ps(_mm256_set1_ps(-0.0), self.0)))
    }

    #[inline(always)]
    fn widen_positive(from: &[f32; WIDTH]) -> Self {
        Self(here!(_mm256_max_ps(Self::load(from).0, _mm256_setzero_ps())))
    }

    #[inline(always)]
    fn where_positive(self, other: Self) -> Self {
        Self(here!(_mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(other.0, _mm256_setzero_ps()), self.0)))
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        let above = here!(_mm256_cmp_ps::<_CMP_GT_OQ>(divisor.0, _mm256_setzero_ps()));
        Self(here!(_mm256_and_ps(above, _mm256_div_ps(self.0, divisor.0))))
    }

    #[inline(always)]
    fn sum(self) -> f64 {
        let [lower, upper] = bytemuck::must_cast::<__m256, [__m128; 2]>(self.0);
        let sums: [f64; 4] = bytemuck::must_cast(here!(_mm256_add_pd(_mm256_cvtps_pd(lower), _mm256_cvtps_pd(upper))));
        (sums[0] + sums[2]) + (sums[1] + sums[3])
    }
}

impl Vector for Avx2 {
    type Mask = __m256;

    #[inline(always)]
    fn from_bytes(from: &[u8]) -> Self {
        Self(here!(_mm256_cvtepi32_ps(widened(from))))
    }

    #[inline(always)]
    fn from_words(from: &[u16]) -> Self {
        Self(here!(_mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(bytemuck::must_cast(first::<_, WIDTH>(from))))))
    }

    #[inline(always)]
    fn interleaved([x, y, z]: [Self; 3]) -> [Self; 3] {
        /// A shuffle's places: two of the first vector, then two of the second, in each half.
        const fn places([a, b, c, d]: [i32; 4]) -> i32 {
            a | b << 2 | c << 4 | d << 6
        }
        // Within each half: x0 x2 y0 y2, y1 y3 z1 z3, z0 z2 x1 x3, and from these x0 y0 z0 x1, y1 z1 x2 y2, z2 x3 y3 z3.
        let x_y = here!(_mm256_shuffle_ps::<{ places([0, 2, 0, 2]) }>(x.0, y.0));
        let y_z = here!(_mm256_shuffle_ps::<{ places([1, 3, 1, 3]) }>(y.0, z.0));
        let z_x = here!(_mm256_shuffle_ps::<{ places([0, 2, 1, 3]) }>(z.0, x.0));
        let first = here!(_mm256_shuffle_ps::<{ places([0, 2, 0, 2]) }>(x_y, z_x));
        let second = here!(_mm256_shuffle_ps::<{ places([0, 2, 1, 3]) }>(y_z, x_y));
        let third = here!(_mm256_shuffle_ps::<{ places([1, 3, 1, 3]) }>(z_x, y_z));
        [
            Self(here!(_mm256_permute2f128_ps::<LOWER_HALVES>(first, second))),
            Self(here!(_mm256_blend_ps::<UPPER_HALF>(third, first))),
            Self(here!(_mm256_permute2f128_ps::<UPPER_HALVES>(second, third))),
        ]
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, term: Self) -> Self {
        Self(here!(_mm256_fmsub_ps(self.0, factor.0, term.0)))
    }

    #[inline(always)]
    fn root(self) -> Self {
        Self(here!(_mm256_sqrt_ps(self.0)))
    }

    #[inline(always)]
    fn is_over(self, other: Self) -> __m256 {
        here!(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0))
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        Self(here!(_mm256_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn both(a: __m256, b: __m256) -> __m256 {
        here!(_mm256_and_ps(a, b))
    }

    #[inline(always)]
    fn either(a: __m256, b: __m256) -> __m256 {
        here!(_mm256_or_ps(a, b))
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        let sign = here!(_mm256_set1_ps(-0.0));
        Self(here!(_mm256_or_ps(_mm256_andnot_ps(sign, self.0), _mm256_and_ps(sign, other.0))))
    }

    #[inline(always)]
    fn all(mask: __m256) -> bool {
        here!(_mm256_movemask_ps(mask)) == (1 << WIDTH) - 1
    }

    #[inline(always)]
    fn pick(mask: __m256, yes: Self, no: Self) -> Self {
        Self(here!(_mm256_blendv_ps(no.0, yes.0, mask)))
    }

    #[inline(always)]
    fn bits(mask: __m256) -> u64 {
        here!(_mm256_movemask_ps(mask)) as u64
    }

    #[inline(always)]
    fn where_bit(self, bytes: &[u8], bit: usize) -> Self {
        let bit = here!(_mm256_set1_epi32(1 << bit));
        let mask = here!(_mm256_cmpeq_epi32(_mm256_and_si256(widened(bytes), bit), bit));
        Self(here!(_mm256_and_ps(_mm256_castsi256_ps(mask), self.0)))
    }

    #[inline(always)]
    fn rows(bytes: &[u8], table: &RowTable) -> [Self; ROW] {
        /// Half of the rows of two pixels, four apart.
        #[inline(always)]
        fn halves(bytes: [u8; WIDTH], table: &RowTable, pixel: usize, half: usize) -> __m256 {
            let lower = bytemuck::must_cast(table.half(bytes[pixel], half));
            let upper = bytemuck::must_cast(table.half(bytes[pixel + WIDTH / 2], half));
            here!(_mm256_insertf128_ps::<1>(_mm256_castps128_ps256(lower), upper))
        }
        let bytes = first(bytes);
        let mut rows = [Self::splat(0.0); ROW];
        for (half, rows) in rows.as_chunks_mut::<QUARTER>().0.iter_mut().enumerate() {
            let (a, b) = (halves(bytes, table, 0, half), halves(bytes, table, 1, half));
            let (c, d) = (halves(bytes, table, 2, half), halves(bytes, table, 3, half));
            let (a_b, more_a_b) = here!((_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b)));
            let (c_d, more_c_d) = here!((_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d)));
            rows[0] = Self(here!(_mm256_shuffle_ps::<FIRST_TWO>(a_b, c_d)));
            rows[1] = Self(here!(_mm256_shuffle_ps::<LAST_TWO>(a_b, c_d)));
            rows[2] = Self(here!(_mm256_shuffle_ps::<FIRST_TWO>(more_a_b, more_c_d)));
            rows[3] = Self(here!(_mm256_shuffle_ps::<LAST_TWO>(more_a_b, more_c_d)));
        }
        rows
    }

    #[inline(always)]
    fn sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>) -> [Self; ENTRIES] {
        // A permutation looks at the lowest three bits alone.
        let first = widened(bytes);
        let (second, third) = here!((_mm256_srli_epi32::<3>(first), _mm256_srli_epi32::<6>(first)));
        let mut found = [Self::splat(0.0); ENTRIES];
        let [of_first, of_second, of_third] = &sums.of_three;
        for (((found, of_first), of_second), of_third) in found.iter_mut().zip(of_first).zip(of_second).zip(of_third) {
            *found = Self(here!(_mm256_permutevar8x32_ps(Self::load(of_first).0, first)))
                + Self(here!(_mm256_permutevar8x32_ps(Self::load(of_second).0, second)))
                + Self(here!(_mm256_permutevar8x32_ps(Self::load(of_third).0, third)));
        }
        found
    }
}
