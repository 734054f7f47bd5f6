//! Large arrays on large pages, and arrays of numbers on memory that is used again.
//!
//! A fresh array of an image costs a page fault every 4 KiB, which can take longer than the work on it. Asked for large pages
//! (2 MiB), Linux faults 512 times less often; elsewhere, and where they are turned off, nothing changes.

use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use rayon::prelude::*;

/// `len` zeros, on large pages where there are enough of them.
pub fn zeros<T: bytemuck::Zeroable + Clone>(len: usize) -> Vec<T> {
    let mut zeros = vec![T::zeroed(); len];
    prefer_large_pages(&mut zeros);
    zeros
}

/// Numbers that start at a cache line: a load of a whole vector then touches one line, not two.
///
/// The memory of all but small arrays is used again by the next of the same size. But for the last few the system is told
/// meanwhile that it may take the pages whenever it wants (`MADV_FREE`), so that they stand in nobody's way.
#[derive(Debug)]
pub(crate) struct Aligned<T: Reused> {
    memory: Vec<T>,
    start: usize,
    len: usize,
    /// [`ERA`] at its beginning.
    era: usize,
}

/// What gives the allocator's free pages back to the system.
static GIVE_BACK: OnceLock<fn()> = OnceLock::new();

/// Has `give_back` called, once a large graph is set up, to give the allocator's free pages back to the system: the solve needs
/// others at once, and an allocator that keeps them would hold both. Without it, or with what was set first, all is as before.
pub fn give_back_by(give_back: fn()) {
    // Who was first stays.
    let _ = GIVE_BACK.set(give_back);
}

/// Gives them back, if the program has said how.
pub(crate) fn give_back_free_pages() {
    if let Some(give_back) = GIVE_BACK.get() {
        give_back();
    }
}

/// How often everything was forgotten.
static ERA: AtomicUsize = AtomicUsize::new(0);

/// Uses none of the arrays again that there are now, for some may hold NaN or infinity: memory of any content is read beside
/// what was written, times zero, and must be finite.
pub(crate) fn forget() {
    ERA.fetch_add(1, Ordering::SeqCst);
    *f32::waiting() = Waiting::new();
    *f64::waiting() = Waiting::new();
    *u64::waiting() = Waiting::new();
}

impl<T: Reused> Aligned<T> {
    pub fn zeros(len: usize) -> Self {
        let (mut aligned, is_fresh) = Self::new(len);
        if !is_fresh {
            /// Numbers that a task clears.
            const BLOCK: usize = 1 << 14;
            aligned.par_chunks_mut(BLOCK).for_each(|block| block.fill(T::zeroed()));
        }
        aligned
    }

    /// Numbers of any value, to be written before they are read.
    pub fn any(len: usize) -> Self {
        Self::new(len).0
    }

    /// Gives it up, and its pages to the system at once.
    pub fn release(mut self) {
        #[cfg(target_os = "linux")]
        advise(&mut self.memory, libc::MADV_DONTNEED);
        #[cfg(not(target_os = "linux"))]
        std::mem::take(&mut self.memory);
    }

    /// An array, and whether it holds zeros.
    fn new(len: usize) -> (Self, bool) {
        /// Bytes.
        const CACHE_LINE: usize = 64;
        let room = len + CACHE_LINE / size_of::<T>();
        let kept = if Waiting::<T>::keeps(room) { T::waiting().take(room) } else { None };
        let is_fresh = kept.is_none();
        let memory = kept.unwrap_or_else(|| zeros(room));
        let start = memory.as_ptr().align_offset(CACHE_LINE).min(room - len);
        (Self { memory, start, len, era: ERA.load(Ordering::SeqCst) }, is_fresh)
    }
}

impl<T: Reused> Drop for Aligned<T> {
    fn drop(&mut self) {
        if self.era == ERA.load(Ordering::SeqCst) && Waiting::<T>::keeps(self.memory.len()) {
            // Freed after the lock: that takes long.
            let gone = T::waiting().give_back(std::mem::take(&mut self.memory));
            drop(gone);
        }
    }
}

impl<T: Reused> Deref for Aligned<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        &self.memory[self.start..self.start + self.len]
    }
}

impl<T: Reused> DerefMut for Aligned<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.memory[self.start..self.start + self.len]
    }
}

/// Memory for a short while. The pages of a large one go back to the system with it, whatever the allocator would keep.
#[derive(Debug)]
pub(crate) struct Scratch<T: bytemuck::Zeroable + Copy>(Vec<T>);

impl<T: bytemuck::Zeroable + Copy> Scratch<T> {
    pub fn filled(value: T, len: usize) -> Self {
        let mut memory = Vec::with_capacity(len);
        prefer_large_pages(memory.spare_capacity_mut());
        memory.resize(len, value);
        Self(memory)
    }
}

impl<T: bytemuck::Zeroable + Copy> FromIterator<T> for Scratch<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T: bytemuck::Zeroable + Copy> Drop for Scratch<T> {
    fn drop(&mut self) {
        /// Smallest array whose pages are not kept, in bytes.
        const MIN_BYTES: usize = 4 << 20;
        if size_of_val(&self.0[..]) >= MIN_BYTES {
            #[cfg(target_os = "linux")]
            advise(&mut self.0, libc::MADV_DONTNEED);
        }
    }
}

impl<T: bytemuck::Zeroable + Copy> Deref for Scratch<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: bytemuck::Zeroable + Copy> DerefMut for Scratch<T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

/// Arrays that wait for the next of their size, the longest waiting first.
pub(crate) struct Waiting<T> {
    arrays: Vec<Vec<T>>,
    /// How many of them, the first ones, have lent their pages.
    lent: usize,
}

impl<T: Reused> Waiting<T> {
    /// Most arrays of a type that wait: those of two large integrations.
    const ARRAYS: usize = 256;

    /// Smallest array that waits, in bytes; smaller ones are the allocator's. That keeps pages for each thread and size: where
    /// chance deals the arrays out to threads, the first calls of a process go on taking pages, a large one of which can cost
    /// a third of an integration of a megapixel.
    const MIN_BYTES: usize = 1 << 14;

    /// Bytes of a type that wait with their pages: to lend these, and to mark them anew when they are written again, took a
    /// twentieth of an integration of a megapixel.
    const HELD_BYTES: usize = 64 << 20;

    const fn new() -> Self {
        Self { arrays: Vec::new(), lent: 0 }
    }

    /// True for arrays long enough to wait; the others need not ask, and lock nothing.
    const fn keeps(len: usize) -> bool {
        len * size_of::<T>() >= Self::MIN_BYTES
    }

    /// An array of this length that was given back, if there is one.
    fn take(&mut self, len: usize) -> Option<Vec<T>> {
        // The last one given back may still be in a cache.
        let index = self.arrays.iter().rposition(|memory| memory.len() == len)?;
        self.lent -= usize::from(index < self.lent);
        Some(self.arrays.remove(index))
    }

    /// Keeps an array for the next of its length; returns those that can no longer be kept.
    fn give_back(&mut self, memory: Vec<T>) -> Vec<Vec<T>> {
        let mut gone = Vec::new();
        self.arrays.push(memory);
        while self.held_bytes() > Self::HELD_BYTES {
            if lend_pages(&mut self.arrays[self.lent]) {
                self.lent += 1;
            } else {
                gone.push(self.arrays.remove(self.lent));
            }
        }
        if self.arrays.len() > Self::ARRAYS {
            self.lent = self.lent.saturating_sub(1);
            gone.push(self.arrays.remove(0));
        }
        gone
    }

    /// Of the arrays that have not lent their pages.
    fn held_bytes(&self) -> usize {
        self.arrays[self.lent..].iter().map(|memory| size_of_val(&memory[..])).sum()
    }
}

/// A number whose arrays are used again.
pub(crate) trait Reused: bytemuck::Zeroable + Copy + Send + Sync + 'static {
    fn waiting() -> MutexGuard<'static, Waiting<Self>>;
}

macro_rules! reused {
    ($($number:ty)*) => {$(
        impl Reused for $number {
            fn waiting() -> MutexGuard<'static, Waiting<Self>> {
                static WAITING: Mutex<Waiting<$number>> = Mutex::new(Waiting::new());
                WAITING.lock().unwrap_or_else(PoisonError::into_inner)
            }
        }
    )*};
}
reused!(f32 f64 u64);

/// Tells the system that it may take the pages of an array whose content nobody needs; they then read as zeros. False where
/// it cannot be told.
fn lend_pages<T: bytemuck::Zeroable>(memory: &mut [T]) -> bool {
    #[cfg(target_os = "linux")]
    {
        advise(memory, libc::MADV_FREE)
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = memory;
        false
    }
}

/// Asks for large pages under memory that has not been touched yet.
pub(crate) fn prefer_large_pages<T>(memory: &mut [T]) {
    /// Smallest array for which it pays, in bytes: that of a large page.
    const MIN_BYTES: usize = 2 << 20;
    if size_of_val(memory) >= MIN_BYTES {
        #[cfg(target_os = "linux")]
        advise(memory, libc::MADV_HUGEPAGE);
    }
}

/// Gives the system an advice on the whole pages inside an array; true where it takes it.
#[cfg(target_os = "linux")]
fn advise<T>(memory: &mut [T], advice: libc::c_int) -> bool {
    const PAGE: usize = 4096;
    let start = memory.as_mut_ptr() as usize;
    let first_page = start.next_multiple_of(PAGE);
    let end = (start + size_of_val(memory)) / PAGE * PAGE;
    if end <= first_page {
        return false;
    }
    // SAFETY: the pages lie inside an array that is borrowed mutably. `MADV_HUGEPAGE` changes no content; `MADV_FREE` and
    // `MADV_DONTNEED` turn it into zeros, which is asked for numbers that may be zero alone.
    #[allow(unsafe_code)]
    let answer = unsafe { libc::madvise(first_page as *mut libc::c_void, end - first_page, advice) };
    answer == 0
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_was_there_is_used_again_after_forgetting() {
        // A length that no other test has.
        const LEN: usize = 1_234_569;
        let [mut dropped, mut held] = [Aligned::<f32>::zeros(LEN), Aligned::<f32>::zeros(LEN)];
        dropped.fill(f32::NAN);
        held.fill(f32::NAN);
        drop(dropped);
        forget();
        drop(held);
        assert!(Aligned::<f32>::any(LEN).iter().all(|number| *number == 0.0));
    }

    #[test]
    fn zeros_are_zeros_on_used_memory() {
        // A length that no other test has.
        const LEN: usize = 1_234_567;
        for _ in 0..3 {
            let mut numbers = Aligned::<f64>::zeros(LEN);
            assert_eq!(numbers.as_ptr().align_offset(64), 0);
            assert!(numbers.iter().all(|&number| number == 0.0));
            numbers.fill(7.0);
        }
        let again = Aligned::<f64>::any(LEN);
        assert!(again.iter().all(|&number| number == 7.0 || number == 0.0));
        #[cfg(target_os = "linux")]
        assert!(f64::waiting().arrays.iter().all(|memory| memory.len() != again.memory.len()));
    }

    #[test]
    fn the_longest_waiting_lend_their_pages_and_go_first() {
        const THIRD: usize = Waiting::<f32>::HELD_BYTES / size_of::<f32>() / 3;
        let mut waiting = Waiting::new();
        for lent in [0, 0, 0, 1, 2] {
            assert!(waiting.give_back(zeros::<f32>(THIRD)).is_empty());
            #[cfg(target_os = "linux")]
            assert_eq!(waiting.lent, lent);
            assert!(waiting.held_bytes() <= Waiting::<f32>::HELD_BYTES);
        }
        let left: Vec<usize> = std::iter::from_fn(|| waiting.take(THIRD).map(|_| waiting.lent)).collect();
        #[cfg(target_os = "linux")]
        assert_eq!(left, [2, 2, 2, 1, 0]);
        assert!(!left.is_empty() && waiting.take(THIRD).is_none());

        let gone: usize = (0..Waiting::<f32>::ARRAYS + 3).map(|len| waiting.give_back(vec![0.0; len]).len()).sum();
        assert_eq!((gone, waiting.arrays.len(), waiting.arrays[0].len()), (3, Waiting::<f32>::ARRAYS, 3));
    }
}
