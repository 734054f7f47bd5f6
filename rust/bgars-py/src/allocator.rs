//! The allocator of the compiled half, and how long it keeps pages that are free.

use std::ffi::{c_int, c_long};

/// It keeps pages that are free for the next call: with the system's allocator a call on a quarter of a megapixel spent a
/// fifth of its time on page faults.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// Milliseconds: parts on a line may come this far apart. Of itself the allocator gives pages back after one second.
const KEPT_MS: c_long = 20_000;

/// `mi_option_purge_delay` of mimalloc.h, a number that the crate does not name.
const PURGE_DELAY: c_int = 15;

/// Keeps free pages between calls for [`KEPT_MS`], unless the environment says otherwise (`MIMALLOC_PURGE_DELAY`).
pub fn keep_free_pages() {
    // SAFETY: sets a number that the allocator reads when memory is freed; mimalloc allows it at any time.
    #[allow(unsafe_code)]
    unsafe {
        libmimalloc_sys::mi_option_set_default(PURGE_DELAY, KEPT_MS);
    }
}

/// Gives all free pages back at once: a long call need not hold what it no longer works on.
pub fn give_free_pages_back() {
    // SAFETY: pages that hold nothing alone, and mimalloc allows it at any time, on any thread.
    #[allow(unsafe_code)]
    unsafe {
        libmimalloc_sys::mi_collect(true);
    }
}
