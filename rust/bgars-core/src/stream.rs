//! Writes past the caches, for results that are larger than these.
//!
//! An ordinary store first reads the cache line that it overwrites. A kernel that writes more than it reads loses half of its
//! memory rate that way; a streaming store does not read. Safe Rust has no word for it.

/// Arrays of at least this many pixels are streamed: nothing of them would be left in the caches anyway.
pub(crate) const MIN_PIXELS: usize = 1 << 20;

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
