//! Long work beside Python: on its own threads, watched from the calling one for Ctrl-C and progress.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::errors::to_python;
use crate::pool::pool;

/// Time between two looks at Python.
const INTERVAL: Duration = Duration::from_millis(100);

/// State of some work: the arguments of the callback.
#[derive(Clone, Copy)]
pub enum Done {
    /// How much of it is done.
    Fraction(f64),
    /// Iterations, and what is left.
    Iteration(usize, f64),
}

/// Called with the state of some work; `Break` stops it.
pub type Report<'a> = &'a mut dyn FnMut(Done) -> ControlFlow<()>;

/// Runs `work` without the GIL, on at most `threads` threads (`None`: as many as `RAYON_NUM_THREADS` says, else one a core).
///
/// `work` reports its state to `callback`, which is called at most every 100 ms, from the calling thread: only there can Python
/// deliver Ctrl-C. An exception, from the callback or from Ctrl-C, stops the work and is raised.
pub fn watched<T: Send>(
    py: Python<'_>,
    threads: Option<i64>,
    callback: Option<&Py<PyAny>>,
    work: impl FnOnce(Report<'_>) -> bgars_core::Result<T> + Send,
) -> PyResult<T> {
    let (pool, mut outcome) = (pool(threads)?, None);
    watch(py, &pool, callback, Box::new(|report: Report<'_>| outcome = Some(work(report))))?;
    // A panic of the work has gone on from its scope.
    outcome.expect("the scope ends after the work").map_err(to_python)
}

/// [`watched`] for any kind of work: compiled once.
fn watch(
    py: Python<'_>,
    pool: &ThreadPool,
    callback: Option<&Py<PyAny>>,
    work: Box<dyn FnOnce(Report<'_>) + Send + '_>,
) -> PyResult<()> {
    let cancelled = AtomicBool::new(false);
    let state = Mutex::new(None);
    let mut report = |done: Done| {
        *state.lock().unwrap_or_else(PoisonError::into_inner) = Some(done);
        if cancelled.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let mut raised = None;
    py.detach(|| {
        pool.in_place_scope(|scope| {
            let (sender, receiver) = channel();
            // On a thread of the pool: from outside, each parallel loop would wake it up anew.
            scope.spawn(move |_| {
                work(&mut report);
                // The receiver waits until the sender is gone, whatever it sent.
                drop(sender);
            });
            while receiver.recv_timeout(INTERVAL) == Err::<(), _>(RecvTimeoutError::Timeout) {
                let done = state.lock().unwrap_or_else(PoisonError::into_inner).take();
                // After an exception the work only has to end: nobody is told of its progress any more.
                if raised.is_none()
                    && let Err(error) = look_at_python(callback, done)
                {
                    cancelled.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
        });
    });
    raised.map_or(Ok(()), Err)
}

/// [`watched`] for work that reports nothing; Ctrl-C is raised when it is done.
pub fn on_threads<T: Send>(
    py: Python<'_>,
    threads: Option<i64>,
    work: impl FnOnce() -> bgars_core::Result<T> + Send,
) -> PyResult<T> {
    watched(py, threads, None, |_| work())
}

fn look_at_python(callback: Option<&Py<PyAny>>, done: Option<Done>) -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        match (callback, done) {
            (Some(callback), Some(Done::Fraction(fraction))) => callback.call1(py, (fraction,)).map(drop),
            (Some(callback), Some(Done::Iteration(count, left))) => callback.call1(py, (count, left)).map(drop),
            _ => Ok(()),
        }
    })
}
