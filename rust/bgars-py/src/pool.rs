//! The threads that work: the common ones of the process, or those that a call asks for.

use std::sync::{Arc, LazyLock};

use pyo3::prelude::*;
use rayon::{Scope, ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::errors::InputError;
use crate::places::Places;

/// Most threads that an argument may ask for.
const MAX_THREADS: usize = 1024;

/// Threads for a call.
pub struct Pool {
    /// `None`: the common ones.
    own: Option<ThreadPool>,
    /// Where its threads run.
    places: Arc<Places>,
}

impl Pool {
    /// As many threads as asked for; `None`: the common ones, as many as `RAYON_NUM_THREADS` says, else one a core.
    ///
    /// # Errors
    /// A number that cannot be had.
    pub fn new(threads: Option<i64>) -> PyResult<Self> {
        let Some(threads) = threads else { return Self::common() };
        let Some(count) = usize::try_from(threads).ok().filter(|count| (1..=MAX_THREADS).contains(count)) else {
            return Err(InputError::new_err(format!("threads: must be 1 to {MAX_THREADS}, got {threads}")));
        };
        let places = Arc::default();
        let own = builder(&places)
            .num_threads(count)
            .build()
            .map_err(|error| InputError::new_err(format!("threads: cannot start {threads} of them: {error}")))?;
        Ok(Self { own: Some(own), places })
    }

    fn common() -> PyResult<Self> {
        static PLACES: LazyLock<Arc<Places>> = LazyLock::new(Arc::default);
        static STARTED: LazyLock<Result<(), ThreadPoolBuildError>> = LazyLock::new(|| builder(&PLACES).build_global());
        if let Err(error) = &*STARTED {
            let rule = "as many as RAYON_NUM_THREADS says, else one a core";
            return Err(InputError::new_err(format!("threads: cannot start the common ones ({rule}): {error}")));
        }
        Ok(Self { own: None, places: Arc::clone(&PLACES) })
    }

    /// Runs `op` on this thread, and what it spawns on threads of the pool, each on processors of its own unless others want these.
    pub fn in_scope<'scope>(&self, op: impl FnOnce(&Scope<'scope>) + 'scope) {
        let count = self.own.as_ref().map_or_else(rayon::current_num_threads, ThreadPool::current_num_threads);
        self.places.begin(count);
        match &self.own {
            Some(pool) => pool.in_place_scope(op),
            None => rayon::in_place_scope(op),
        }
    }

    /// Looks where the threads are to run, as long as a call is short; to be called now and then.
    pub fn look(&self) {
        self.places.look();
    }

    /// Lets the threads run wherever they may, for the rest of a long call.
    pub fn free(&self) {
        self.places.free();
    }
}

/// Of threads whose places are known.
fn builder(places: &Arc<Places>) -> ThreadPoolBuilder {
    let places = Arc::clone(places);
    ThreadPoolBuilder::new().start_handler(move |index| places.enter(index))
}
