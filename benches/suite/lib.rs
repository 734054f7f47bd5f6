//! What the benches share. The package `bgars-suite` exists for its `tests/*.rs` and `benches/*.rs`; it has no other code.

#![allow(clippy::unwrap_used, clippy::missing_panics_doc)]

pub mod balls;
pub mod files;
pub mod masks;
pub mod slits;
pub mod stacks;

use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, SamplingMode};

/// Threads that every bench is run with.
pub const THREADS: [usize; 2] = [1, 2];

/// Runs `work` on a pool of its own: what a user gets who sets `RAYON_NUM_THREADS`.
pub fn on_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// Few and short samples: the benches say what is faster than what, and have to end.
pub fn keep_short(group: &mut BenchmarkGroup<'_, WallTime>) {
    group
        .sample_size(10)
        .sampling_mode(SamplingMode::Flat)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800));
}
