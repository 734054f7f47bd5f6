//! The threads that work: the common ones of the process, or those that a call asks for.

use std::sync::{Arc, LazyLock, Mutex};
use std::{mem, process};

use pyo3::prelude::*;
use rayon::{Scope, ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::errors::InputError;
use crate::places::Places;

/// Most threads that an argument may ask for.
const MAX_THREADS: usize = 1024;

/// Threads that are kept for later calls, at most; those that were not used for longest go first.
const MOST_KEPT: usize = 256;

/// Threads for a call.
pub struct Pool {
    /// `None`: the common ones.
    own: Option<Own>,
    /// Where its threads run.
    places: Arc<Places>,
}

/// Threads that a call asked for by their number.
struct Own {
    threads: ThreadPool,
    places: Arc<Places>,
    /// Whose they are: a fork has none of them.
    process: u32,
}

/// Those of earlier calls, the ones used last behind. To start threads anew takes as long as a small image, and those of the call
/// before, which still end, want the processors of the new ones.
///
/// Tried, never waited for: a fork may have been made while another thread held it.
static KEPT: Mutex<Vec<Own>> = Mutex::new(Vec::new());

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
        let own = match Own::kept(count) {
            Some(own) => own,
            None => Own::started(count)
                .map_err(|error| InputError::new_err(format!("threads: cannot start {threads} of them: {error}")))?,
        };
        let places = Arc::clone(&own.places);
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
        let count = self.own.as_ref().map_or_else(rayon::current_num_threads, Own::count);
        self.places.begin(count);
        match &self.own {
            Some(own) => own.threads.in_place_scope(op),
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

impl Drop for Pool {
    fn drop(&mut self) {
        if let Some(own) = self.own.take() {
            own.keep();
        }
    }
}

impl Own {
    fn started(count: usize) -> Result<Self, ThreadPoolBuildError> {
        let places = Arc::default();
        let threads = builder(&places).num_threads(count).build()?;
        Ok(Self { threads, places, process: process::id() })
    }

    /// So many threads of an earlier call, if there are any and nobody uses them.
    fn kept(count: usize) -> Option<Self> {
        let mut kept = KEPT.try_lock().ok()?;
        let place = kept.iter().rposition(|own| own.is_here() && own.count() == count)?;
        Some(kept.remove(place))
    }

    /// For a later call.
    fn keep(self) {
        let mut ended = Vec::new();
        if let Ok(mut kept) = KEPT.try_lock() {
            kept.push(self);
            while kept.iter().map(Self::count).sum::<usize>() > MOST_KEPT {
                ended.push(kept.remove(0));
            }
        }
        for own in ended {
            if !own.is_here() {
                // Threads that a fork does not have cannot be told to end.
                mem::forget(own);
            }
        }
    }

    fn count(&self) -> usize {
        self.threads.current_num_threads()
    }

    fn is_here(&self) -> bool {
        self.process == process::id()
    }
}

/// Of threads whose places are known.
fn builder(places: &Arc<Places>) -> ThreadPoolBuilder {
    let places = Arc::clone(places);
    ThreadPoolBuilder::new().start_handler(move |index| places.enter(index))
}
