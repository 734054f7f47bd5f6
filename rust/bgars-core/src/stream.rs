//! Writes past the caches, for results that are larger than these.
//!
//! An ordinary store first reads the cache line that it overwrites. A kernel that writes more than it reads loses half of its
//! memory rate that way; a streaming store does not read. Safe Rust has no word for it.

/// Arrays of at least this many pixels are streamed: nothing of them would be left in the caches anyway.
pub(crate) const MIN_PIXELS: usize = 1 << 20;

/// Copies `from` to `to`, past the caches where the processor and the place allow it; [`finish`] must follow, on the same
/// thread, before another thread reads.
///
/// # Panics
/// When the lengths differ.
#[inline(always)]
pub(crate) fn copy<T: bytemuck::NoUninit>(from: &[T], to: &mut [T]) {
    assert_eq!(from.len(), to.len());
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{__m128i, __m256i, __m512i};
        let (bytes, place) = (size_of_val(from), to.as_mut_ptr().cast::<u8>());
        let fits = |width: usize| bytes.is_multiple_of(width) && (place as usize).is_multiple_of(width);
        let source = from.as_ptr().cast::<u8>();
        // SAFETY: both slices are `bytes` long, a multiple of the vector; the source has no uninitialised bytes (NoUninit); the
        // place is aligned, borrowed mutably, and gets bytes of its own type; the processor has the instructions.
        #[allow(unsafe_code)]
        unsafe {
            if fits(size_of::<__m512i>()) && is_x86_feature_detected!("avx512f") {
                return copy_avx512(source, place, bytes);
            } else if fits(size_of::<__m256i>()) && is_x86_feature_detected!("avx") {
                return copy_avx(source, place, bytes);
            } else if fits(size_of::<__m128i>()) {
                return copy_sse2(source, place, bytes);
            }
        }
    }
    to.copy_from_slice(from);
}

/// Defines a copy by vectors of one width.
#[cfg(target_arch = "x86_64")]
macro_rules! copy_by {
    ($name:ident, $feature:literal, $vector:ident, $load:ident, $stream:ident) => {
        /// # Safety
        /// Both places hold `bytes` bytes, a multiple of the vector; the second is aligned to it.
        #[target_feature(enable = $feature)]
        #[inline]
        #[allow(unsafe_code)]
        unsafe fn $name(from: *const u8, to: *mut u8, bytes: usize) {
            use std::arch::x86_64::{$load, $stream, $vector};
            for start in (0..bytes).step_by(size_of::<$vector>()) {
                // SAFETY: the caller's.
                unsafe { $stream(to.add(start).cast(), $load(from.add(start).cast())) };
            }
        }
    };
}
#[cfg(target_arch = "x86_64")]
copy_by!(copy_avx512, "avx512f", __m512i, _mm512_loadu_si512, _mm512_stream_si512);
#[cfg(target_arch = "x86_64")]
copy_by!(copy_avx, "avx", __m256i, _mm256_loadu_si256, _mm256_stream_si256);
#[cfg(target_arch = "x86_64")]
copy_by!(copy_sse2, "sse2", __m128i, _mm_loadu_si128, _mm_stream_si128);

/// Has the processor fetch the array that lies so many arrays further on, if there is one, while it works on something else.
#[inline(always)]
pub(crate) fn prefetch<T, const N: usize>(values: &[T; N], arrays: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        /// Bytes of a cache line.
        const LINE: usize = 64;
        let ahead = std::ptr::from_ref(values).wrapping_add(arrays).cast::<i8>();
        for line in 0..size_of::<[T; N]>().div_ceil(LINE) {
            // SAFETY: a hint, which may name any address and reads nothing into the program. SSE is part of x86_64.
            #[allow(unsafe_code, unused_unsafe)]
            unsafe {
                _mm_prefetch::<_MM_HINT_T0>(ahead.wrapping_add(line * LINE));
            }
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, arrays);
}

/// Makes streamed writes visible to other threads in order.
#[inline]
pub(crate) fn finish() {
    #[cfg(target_arch = "x86_64")]
    // SAFETY: SSE2, part of x86_64; a fence touches no memory.
    #[allow(unsafe_code, unused_unsafe)]
    unsafe {
        std::arch::x86_64::_mm_sfence();
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    #[test]
    fn streamed_values_arrive_at_every_alignment() {
        let from: Vec<f32> = (0..64).map(|value| value as f32).collect();
        for (start, len) in [(0, 64), (1, 32), (3, 61), (4, 4), (5, 0)] {
            let mut to = vec![-1.0f32; 80];
            super::copy(&from[..len], &mut to[start..start + len]);
            super::finish();
            assert_eq!(to[start..start + len], from[..len]);
            assert!(to[..start].iter().chain(&to[start + len..]).all(|&value| value == -1.0));
        }
    }
}
