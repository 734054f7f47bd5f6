//! Large arrays on large pages, and arrays that start at a cache line.
//!
//! A fresh array of an image costs a page fault every 4 KiB, which can take longer than the work on it. Asked for large pages
//! (2 MiB), Linux faults 512 times less often; elsewhere, and where they are turned off, nothing changes.

use std::ops::{Deref, DerefMut};

/// `len` zeros, on large pages where there are enough of them.
pub fn zeros<T: bytemuck::Zeroable + Clone>(len: usize) -> Vec<T> {
    let mut zeros = vec![T::zeroed(); len];
    prefer_large_pages(&mut zeros);
    zeros
}

/// Numbers that start at a cache line: a load of a whole vector then touches one line, not two.
#[derive(Debug)]
pub(crate) struct Aligned<T> {
    memory: Vec<T>,
    start: usize,
    len: usize,
}

impl<T: bytemuck::Zeroable + Clone> Aligned<T> {
    pub fn zeros(len: usize) -> Self {
        /// Bytes.
        const CACHE_LINE: usize = 64;
        let memory: Vec<T> = zeros(len + CACHE_LINE / size_of::<T>());
        let start = memory.as_ptr().align_offset(CACHE_LINE).min(memory.len() - len);
        Self { memory, start, len }
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        &self.memory[self.start..self.start + self.len]
    }
}

impl<T> DerefMut for Aligned<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.memory[self.start..self.start + self.len]
    }
}

/// Asks for large pages under memory that has not been touched yet.
pub(crate) fn prefer_large_pages<T>(memory: &mut [T]) {
    #[cfg(target_os = "linux")]
    {
        /// Smallest array for which it pays, in bytes.
        const MIN_BYTES: usize = 4 << 20;
        const PAGE: usize = 4096;
        let bytes = std::mem::size_of_val(memory);
        if bytes < MIN_BYTES {
            return;
        }
        let start = memory.as_mut_ptr() as usize;
        let first_page = start.next_multiple_of(PAGE);
        // SAFETY: the pages lie inside an array that is borrowed mutably, and the advice changes no content.
        #[allow(unsafe_code)]
        unsafe {
            libc::madvise(first_page as *mut libc::c_void, start + bytes - first_page, libc::MADV_HUGEPAGE);
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = memory;
}
