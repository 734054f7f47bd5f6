//! The threads that work: pools by their number of threads, kept for later calls.

use std::num::NonZero;
use std::sync::{Arc, Mutex};
use std::{mem, process, thread};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::InputError;

/// Most threads that an argument may ask for.
const MAX_THREADS: usize = 1024;

/// Pools that are kept, at most; the one that was not used for longest goes first.
const MAX_POOLS: usize = 4;

/// Pools of earlier calls, the one used last behind, and the process that has their threads: a fork has none of them.
struct Pools {
    process: u32,
    pools: Vec<Arc<ThreadPool>>,
}

/// Tried, never waited for: a fork may have been made while another thread held it.
static POOLS: Mutex<Pools> = Mutex::new(Pools { process: 0, pools: Vec::new() });

/// A pool of as many threads as asked for; `None`: as many as `RAYON_NUM_THREADS` says, else one a core.
///
/// The default is a pool of this process, too, not rayon's own, whose threads a fork would wait for in vain.
///
/// # Errors
/// A number that cannot be had.
pub fn pool(threads: Option<i64>) -> PyResult<Arc<ThreadPool>> {
    let count = match threads {
        Some(threads) => usize::try_from(threads)
            .ok()
            .filter(|count| (1..=MAX_THREADS).contains(count))
            .ok_or_else(|| InputError::new_err(format!("threads: must be 1 to {MAX_THREADS}, got {threads}")))?,
        None => default_count(),
    };
    let Ok(mut kept) = POOLS.try_lock() else { return started(count) };
    if kept.process != process::id() {
        // The threads of the process before: nobody can tell them to end.
        mem::forget(mem::take(&mut kept.pools));
        kept.process = process::id();
    }
    let place = kept.pools.iter().position(|pool| pool.current_num_threads() == count);
    let pool = match place {
        Some(place) => kept.pools.remove(place),
        None => started(count)?,
    };
    kept.pools.push(Arc::clone(&pool));
    if kept.pools.len() > MAX_POOLS {
        kept.pools.remove(0);
    }
    Ok(pool)
}

fn started(count: usize) -> PyResult<Arc<ThreadPool>> {
    let pool = ThreadPoolBuilder::new().num_threads(count).build();
    pool.map(Arc::new).map_err(|error| InputError::new_err(format!("threads: cannot start {count} of them: {error}")))
}

/// What rayon would take of itself.
fn default_count() -> usize {
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|value| value.parse().ok()).filter(|&count| count > 0);
    asked.unwrap_or_else(|| thread::available_parallelism().map_or(1, NonZero::get))
}
