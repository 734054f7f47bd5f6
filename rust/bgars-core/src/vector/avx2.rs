//! Eight floats of AVX2 with fused products.

use std::arch::x86_64::{
    __m256, __m256i, _CMP_GT_OQ, _mm_cvtsi64_si128, _mm256_add_ps, _mm256_alignr_epi8, _mm256_and_ps, _mm256_and_si256,
    _mm256_andnot_ps, _mm256_blend_ps, _mm256_blendv_ps, _mm256_castsi256_ps, _mm256_cmp_ps, _mm256_cmpeq_epi32,
    _mm256_cvtepi32_ps, _mm256_cvtepu8_epi32, _mm256_cvtepu16_epi32, _mm256_div_ps, _mm256_fmadd_ps, _mm256_max_ps,
    _mm256_movemask_ps, _mm256_mul_ps, _mm256_permute2f128_ps, _mm256_permutevar8x32_ps, _mm256_set1_epi32,
    _mm256_set1_ps, _mm256_setzero_ps, _mm256_sqrt_ps, _mm256_srli_epi32, _mm256_stream_ps, _mm256_sub_ps,
};

use super::packed::chunked;
use super::subset_sums::SubsetSums;
use super::{Packed, Vector, first, interleaved};

/// Eight floats.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(__m256);

const WIDTH: usize = 8;

/// The upper half of one vector and the lower half of another.
const HALVES: i32 = 0x21;

/// Calls intrinsics where they are compiled in.
macro_rules! here {
    ($call:expr) => {{
        // SAFETY: the type is named only where AVX2 and FMA are compiled in (see `Vector`), and the one store stays
        // within a slice of WIDTH values and is aligned.
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

impl Packed for Avx2 {
    chunked!(f32, WIDTH, |from| Self::load(from));

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
        self.store(to, false);
    }

    #[inline(always)]
    fn times_plus(self, factor: Self, term: Self) -> Self {
        Self(here!(_mm256_fmadd_ps(self.0, factor.0, term.0)))
    }

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
    fn positive_part(self) -> Self {
        Self(here!(_mm256_max_ps(self.0, _mm256_setzero_ps())))
    }

    #[inline(always)]
    fn where_positive(self, other: Self) -> Self {
        Self(here!(_mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(other.0, _mm256_setzero_ps()), self.0)))
    }

    #[inline(always)]
    fn inverse(self) -> Self {
        let above = here!(_mm256_cmp_ps::<_CMP_GT_OQ>(self.0, _mm256_setzero_ps()));
        Self(here!(_mm256_and_ps(above, _mm256_div_ps(_mm256_set1_ps(1.0), self.0))))
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
    fn store(self, to: &mut [f32], streamed: bool) {
        let to = &mut to[..WIDTH];
        if streamed && to.as_ptr().addr().is_multiple_of(size_of::<Self>()) {
            here!(_mm256_stream_ps(to.as_mut_ptr(), self.0));
        } else {
            to.copy_from_slice(&bytemuck::must_cast::<_, [f32; WIDTH]>(self.0));
        }
    }

    #[inline(always)]
    fn store_interleaved([x, y, z]: [Self; 3], to: &mut [f32], streamed: bool) {
        const PLACES: [[[i32; WIDTH]; 3]; 3] = interleaved::places();
        const FILLED: [[u16; 3]; 3] = interleaved::filled::<WIDTH>();
        macro_rules! store {
            ($vector:literal) => {{
                let x = here!(_mm256_permutevar8x32_ps(x.0, bytemuck::must_cast(PLACES[0][$vector])));
                let y = here!(_mm256_permutevar8x32_ps(y.0, bytemuck::must_cast(PLACES[1][$vector])));
                let z = here!(_mm256_permutevar8x32_ps(z.0, bytemuck::must_cast(PLACES[2][$vector])));
                let mixed = here!(_mm256_blend_ps::<{ FILLED[1][$vector] as i32 }>(x, y));
                let mixed = Self(here!(_mm256_blend_ps::<{ FILLED[2][$vector] as i32 }>(mixed, z)));
                mixed.store(&mut to[$vector * WIDTH..], streamed);
            }};
        }
        store!(0);
        store!(1);
        store!(2);
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
    fn add_sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>, to: &mut [Self; ENTRIES]) {
        // A permutation looks at the lowest three bits alone.
        let first = widened(bytes);
        let groups = here!([first, _mm256_srli_epi32::<3>(first), _mm256_srli_epi32::<6>(first)]);
        for (entry, to) in to.iter_mut().enumerate() {
            for (tables, group) in sums.tables.iter().zip(groups) {
                *to = *to + Self(here!(_mm256_permutevar8x32_ps(Self::load(&tables[entry]).0, group)));
            }
        }
    }
}
