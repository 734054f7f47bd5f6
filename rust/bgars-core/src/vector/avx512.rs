//! Sixteen floats of AVX-512.

use std::arch::x86_64::{
    __m256, __m512, __m512i, _CMP_GT_OQ, _mm256_castps_pd, _mm512_abs_ps, _mm512_add_pd, _mm512_add_ps,
    _mm512_alignr_epi32, _mm512_castpd_ps, _mm512_castps_pd, _mm512_castps256_ps512, _mm512_cmp_ps_mask,
    _mm512_cvtepi32_ps, _mm512_cvtepu8_epi32, _mm512_cvtepu16_epi32, _mm512_cvtps_pd, _mm512_div_ps, _mm512_fmadd_ps,
    _mm512_fmsub_ps, _mm512_fnmadd_ps, _mm512_insertf64x4, _mm512_loadu_si512, _mm512_mask_blend_ps,
    _mm512_maskz_div_ps, _mm512_maskz_mov_ps, _mm512_maskz_set1_epi8, _mm512_max_ps, _mm512_mul_ps,
    _mm512_permutex2var_ps, _mm512_permutexvar_ps, _mm512_reduce_add_pd, _mm512_rsqrt14_ps, _mm512_set1_epi32,
    _mm512_set1_ps, _mm512_setzero_ps, _mm512_shuffle_f32x4, _mm512_shuffle_ps, _mm512_sqrt_ps, _mm512_srli_epi32,
    _mm512_stream_ps, _mm512_stream_si512, _mm512_sub_epi32, _mm512_sub_ps, _mm512_ternarylogic_epi32,
    _mm512_test_epi32_mask, _mm512_unpackhi_ps, _mm512_unpacklo_ps,
};

use bytemuck::NoUninit;

use super::packed::chunked;
use super::row_table::{FIRST_TWO, LAST_TWO, QUARTER};
use super::subset_sums::SubsetSums;
use super::{Arithmetic, Packed, ROW, RowTable, Vector, first, interleaved};

/// Sixteen floats.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(__m512);

const WIDTH: usize = 16;

/// Calls intrinsics where they are compiled in.
macro_rules! here {
    ($call:expr) => {{
        // SAFETY: the type is named only where AVX-512F, BW and DQ are compiled in (see `Vector`), and what stores stays
        // within a slice of WIDTH values (or a block) and is aligned.
        #[allow(unsafe_code)]
        unsafe {
            $call
        }
    }};
}

super::operators!(Avx512, _mm512_add_ps, _mm512_sub_ps, _mm512_mul_ps, _mm512_div_ps);

/// Sixteen bytes as integers.
#[inline(always)]
fn widened(bytes: &[u8]) -> __m512i {
    here!(_mm512_cvtepu8_epi32(bytemuck::must_cast(first::<_, WIDTH>(bytes))))
}

impl Arithmetic for Avx512 {
    type Number = f32;
    const WIDTH: usize = WIDTH;

    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self(here!(_mm512_set1_ps(value)))
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
        Self(here!(_mm512_fmadd_ps(self.0, factor.0, term.0)))
    }
}

impl Packed for Avx512 {
    chunked!(f32, WIDTH, |from| Self::load(from));

    #[inline(always)]
    fn after_last_of(self, before: Self) -> Self {
        Self(here!(bytemuck::must_cast(_mm512_alignr_epi32::<15>(
            bytemuck::must_cast(self.0),
            bytemuck::must_cast(before.0)
        ))))
    }

    #[inline(always)]
    fn before_first_of(self, next: Self) -> Self {
        Self(here!(bytemuck::must_cast(_mm512_alignr_epi32::<1>(
            bytemuck::must_cast(next.0),
            bytemuck::must_cast(self.0)
        ))))
    }

    #[inline(always)]
    fn magnitude(self) -> Self {
        Self(here!(_mm512_abs_ps(self.0)))
    }

    #[inline(always)]
    fn widen_positive(from: &[f32; WIDTH]) -> Self {
        Self(here!(_mm512_max_ps(Self::load(from).0, _mm512_setzero_ps())))
    }

    #[inline(always)]
    fn where_positive(self, other: Self) -> Self {
        let above = here!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>(other.0, _mm512_setzero_ps()));
        Self(here!(_mm512_maskz_mov_ps(above, self.0)))
    }

    #[inline(always)]
    fn over(self, divisor: Self) -> Self {
        let above = here!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>(divisor.0, _mm512_setzero_ps()));
        Self(here!(_mm512_maskz_div_ps(above, self.0, divisor.0)))
    }

    #[inline(always)]
    fn sum(self) -> f64 {
        let [lower, upper] = bytemuck::must_cast::<__m512, [__m256; 2]>(self.0);
        here!(_mm512_reduce_add_pd(_mm512_add_pd(_mm512_cvtps_pd(lower), _mm512_cvtps_pd(upper))))
    }
}

impl Vector for Avx512 {
    type Mask = u16;
    const STREAMS: bool = true;
    const HOLDS_BLOCKS: bool = true;

    #[inline(always)]
    fn from_bytes(from: &[u8]) -> Self {
        Self(here!(_mm512_cvtepi32_ps(widened(from))))
    }

    #[inline(always)]
    fn from_words(from: &[u16]) -> Self {
        Self(here!(_mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(bytemuck::must_cast(first::<_, WIDTH>(from))))))
    }

    #[inline(always)]
    fn stream(self, to: &mut [f32]) {
        let to = &mut to[..WIDTH];
        if to.as_ptr().addr().is_multiple_of(size_of::<Self>()) {
            here!(_mm512_stream_ps(to.as_mut_ptr(), self.0));
        } else {
            self.write(to);
        }
    }

    #[inline(always)]
    fn stream_block<T: NoUninit, const N: usize>(from: &[T; N], to: &mut [T; N]) {
        let (bytes, place) = (size_of::<[T; N]>(), to.as_mut_ptr().cast::<u8>());
        if bytes.is_multiple_of(size_of::<Self>()) && place.addr().is_multiple_of(size_of::<Self>()) {
            let source = from.as_ptr().cast::<u8>();
            for at in (0..bytes).step_by(size_of::<Self>()) {
                // Both blocks hold `bytes`, initialised ones (NoUninit); the place gets bytes of its own type.
                here!(_mm512_stream_si512(place.add(at).cast(), _mm512_loadu_si512(source.add(at).cast())));
            }
        } else {
            *to = *from;
        }
    }

    #[inline(always)]
    fn interleaved([x, y, z]: [Self; 3]) -> [Self; 3] {
        const PLACES: [[[i32; WIDTH]; 2]; 3] = interleaved::places();
        let mut mixed = [x; 3];
        for ([x_y, with_z], mixed) in PLACES.into_iter().zip(&mut mixed) {
            let x_y = here!(_mm512_permutex2var_ps(x.0, bytemuck::must_cast(x_y), y.0));
            *mixed = Self(here!(_mm512_permutex2var_ps(x_y, bytemuck::must_cast(with_z), z.0)));
        }
        mixed
    }

    #[inline(always)]
    fn times_minus(self, factor: Self, term: Self) -> Self {
        Self(here!(_mm512_fmsub_ps(self.0, factor.0, term.0)))
    }

    #[inline(always)]
    fn root(self) -> Self {
        Self(here!(_mm512_sqrt_ps(self.0)))
    }

    /// By a rough inverse of 14 bits and a step of Newton's method: roots and divisions are slow, and all else waits for them.
    #[inline(always)]
    fn inverse_root(self) -> Self {
        /// One of the exponent, whose place is behind the bits of the fraction.
        const EXPONENT: i32 = 1 << (f32::MANTISSA_DIGITS - 1);
        let inverse = Self(here!(_mm512_rsqrt14_ps(self.0)));
        // Halved in its exponent: multiplications have enough to do.
        let half = here!(_mm512_sub_epi32(bytemuck::must_cast(inverse.0), _mm512_set1_epi32(EXPONENT)));
        let half = bytemuck::must_cast(half);
        let half_error = Self(here!(_mm512_fnmadd_ps((self * inverse).0, half, _mm512_set1_ps(0.5))));
        inverse.times_plus(half_error, inverse)
    }

    #[inline(always)]
    fn is_over(self, other: Self) -> u16 {
        here!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0))
    }

    #[inline(always)]
    fn at_least(self, other: Self) -> Self {
        Self(here!(_mm512_max_ps(self.0, other.0)))
    }

    #[inline(always)]
    fn both(a: u16, b: u16) -> u16 {
        a & b
    }

    #[inline(always)]
    fn either(a: u16, b: u16) -> u16 {
        a | b
    }

    #[inline(always)]
    fn with_sign_of(self, other: Self) -> Self {
        /// By the bits of three numbers: the second's where the third's is set, the first's elsewhere.
        const SECOND_WHERE_THIRD: i32 = 0b1101_1000;
        Self(here!(bytemuck::must_cast(_mm512_ternarylogic_epi32::<SECOND_WHERE_THIRD>(
            bytemuck::must_cast(self.0),
            bytemuck::must_cast(other.0),
            _mm512_set1_epi32(i32::MIN)
        ))))
    }

    #[inline(always)]
    fn all(mask: u16) -> bool {
        mask == u16::MAX
    }

    #[inline(always)]
    fn pick(mask: u16, yes: Self, no: Self) -> Self {
        Self(here!(_mm512_mask_blend_ps(mask, no.0, yes.0)))
    }

    #[inline(always)]
    fn bits(mask: u16) -> u64 {
        u64::from(mask)
    }

    #[inline(always)]
    fn flags(bits: u64) -> [bool; u64::BITS as usize] {
        let bytes: [u8; u64::BITS as usize] = bytemuck::must_cast(here!(_mm512_maskz_set1_epi8(bits, 1)));
        bytes.map(|byte| byte != 0)
    }

    #[inline(always)]
    fn where_bit(self, bytes: &[u8], bit: usize) -> Self {
        let mask = here!(_mm512_test_epi32_mask(widened(bytes), _mm512_set1_epi32(1 << bit)));
        Self(here!(_mm512_maskz_mov_ps(mask, self.0)))
    }

    #[inline(always)]
    fn rows(bytes: &[u8], table: &RowTable) -> [Self; ROW] {
        /// The first and the third quarter of both vectors.
        const EVEN: i32 = 0b10_00_10_00;
        /// The second and the fourth.
        const ODD: i32 = 0b11_01_11_01;
        /// The rows of two pixels, one behind the other.
        #[inline(always)]
        fn two(first: u8, second: u8, table: &RowTable) -> __m512 {
            let first: __m256 = bytemuck::must_cast(*table.row(first));
            let second: __m256 = bytemuck::must_cast(*table.row(second));
            here!(_mm512_castpd_ps(_mm512_insertf64x4::<1>(
                _mm512_castps_pd(_mm512_castps256_ps512(first)),
                _mm256_castps_pd(second)
            )))
        }
        /// Of eight pixels, entry k in the even quarters of vector k, entry 4 + k in its odd ones.
        #[inline(always)]
        fn eight(bytes: [u8; WIDTH / 2], table: &RowTable) -> [__m512; QUARTER] {
            let (a, b) = (two(bytes[0], bytes[4], table), two(bytes[1], bytes[5], table));
            let (c, d) = (two(bytes[2], bytes[6], table), two(bytes[3], bytes[7], table));
            let (a_b, more_a_b) = here!((_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b)));
            let (c_d, more_c_d) = here!((_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d)));
            here!([
                _mm512_shuffle_ps::<FIRST_TWO>(a_b, c_d),
                _mm512_shuffle_ps::<LAST_TWO>(a_b, c_d),
                _mm512_shuffle_ps::<FIRST_TWO>(more_a_b, more_c_d),
                _mm512_shuffle_ps::<LAST_TWO>(more_a_b, more_c_d),
            ])
        }
        let [first, second] = bytemuck::must_cast::<[u8; WIDTH], [[u8; WIDTH / 2]; 2]>(first(bytes));
        let (first, second) = (eight(first, table), eight(second, table));
        let mut rows = [Self::splat(0.0); ROW];
        for entry in 0..QUARTER {
            rows[entry] = Self(here!(_mm512_shuffle_f32x4::<EVEN>(first[entry], second[entry])));
            rows[QUARTER + entry] = Self(here!(_mm512_shuffle_f32x4::<ODD>(first[entry], second[entry])));
        }
        rows
    }

    #[inline(always)]
    fn sums_of<const ENTRIES: usize>(bytes: &[u8], sums: &SubsetSums<ENTRIES>) -> [Self; ENTRIES] {
        // A permutation looks at the lowest four bits alone.
        let first = widened(bytes);
        let second = here!(_mm512_srli_epi32::<4>(first));
        let mut found = [Self::splat(0.0); ENTRIES];
        let [of_first, of_second] = &sums.of_four;
        for ((found, of_first), of_second) in found.iter_mut().zip(of_first).zip(of_second) {
            *found = Self(here!(_mm512_permutexvar_ps(first, Self::load(of_first).0)))
                + Self(here!(_mm512_permutexvar_ps(second, Self::load(of_second).0)));
        }
        found
    }
}
