//! Writes past the caches, for results that are larger than these.
//!
//! An ordinary store first reads the cache line that it overwrites. A kernel that writes more than it reads loses half of its
//! memory rate that way; a streaming store does not read. This module holds the one instruction that safe Rust has no word for.

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
        use std::arch::x86_64::{__m128i, _mm_loadu_si128, _mm_stream_si128};
        const WORD: usize = size_of::<__m128i>();
        let bytes = size_of_val(from);
        let place = to.as_mut_ptr().cast::<__m128i>();
        if place.is_aligned() && bytes.is_multiple_of(WORD) {
            let source = from.as_ptr().cast::<__m128i>();
            // SAFETY: both slices are `bytes` long; the source has no uninitialised bytes (NoUninit) and is read without
            // alignment; the place is aligned, borrowed mutably, and gets bytes of its own type. SSE2 is part of x86_64.
            #[allow(unsafe_code)]
            let move_word =
                |word: usize| unsafe { _mm_stream_si128(place.add(word), _mm_loadu_si128(source.add(word))) };
            let words = bytes / WORD;
            // By cache lines, which saves most of the counting.
            for line in 0..words / 4 {
                (4 * line..4 * line + 4).for_each(move_word);
            }
            (words / 4 * 4..words).for_each(move_word);
            return;
        }
    }
    to.copy_from_slice(from);
}

/// Has the processor fetch the cache line of `values[index]`, if there is one, while it works on something else.
#[inline(always)]
pub(crate) fn prefetch<T>(values: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(value) = values.get(index) {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        // SAFETY: a hint about memory that is borrowed; it reads nothing into the program. SSE is part of x86_64.
        #[allow(unsafe_code, unused_unsafe)]
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(value).cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, index);
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
