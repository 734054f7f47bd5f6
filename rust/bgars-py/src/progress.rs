//! Long work beside Python: on its own threads, watched from the calling one for Ctrl-C and progress.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use pyo3::call::PyCallArgs;
use pyo3::prelude::*;

use crate::errors::to_python;
use crate::pool::pool;

/// Time between two looks at Python.
const INTERVAL: Duration = Duration::from_millis(100);

/// Runs `work` without the GIL, on at most `threads` threads (`None`: as many as `RAYON_NUM_THREADS` says, else one a core).
///
/// `work` reports its state as the arguments of `callback`, which is called at most every 100 ms, from the calling thread:
/// only there can Python deliver Ctrl-C. An exception, from the callback or from Ctrl-C, stops the work and is raised.
pub fn watched<T, A, W>(py: Python<'_>, threads: Option<i64>, callback: Option<&Py<PyAny>>, work: W) -> PyResult<T>
where
    T: Send,
    A: for<'py> PyCallArgs<'py> + Send,
    W: FnOnce(&mut dyn FnMut(A) -> ControlFlow<()>) -> bgars_core::Result<T> + Send,
{
    let pool = pool(threads)?;
    let cancelled = AtomicBool::new(false);
    let state = Mutex::new(None);
    let mut report = |arguments: A| {
        *state.lock().unwrap_or_else(PoisonError::into_inner) = Some(arguments);
        if cancelled.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let (mut raised, mut outcome) = (None, None);
    py.detach(|| {
        pool.in_place_scope(|scope| {
            let (sender, receiver) = channel();
            let outcome = &mut outcome;
            // On a thread of the pool: from outside, each parallel loop would wake it up anew.
            scope.spawn(move |_| {
                *outcome = Some(work(&mut report));
                // The receiver waits until the sender is gone, whatever it sent.
                drop(sender);
            });
            while receiver.recv_timeout(INTERVAL) == Err::<(), _>(RecvTimeoutError::Timeout) {
                let arguments = state.lock().unwrap_or_else(PoisonError::into_inner).take();
                // After an exception the work only has to end: nobody is told of its progress any more.
                if raised.is_none()
                    && let Err(error) = look_at_python(callback, arguments)
                {
                    cancelled.store(true, Ordering::Relaxed);
                    raised = Some(error);
                }
            }
        });
    });
    match raised {
        Some(error) => Err(error),
        // A panic of the work has gone on from its scope.
        None => outcome.expect("the scope ends after the work").map_err(to_python),
    }
}

/// [`watched`] for work that reports nothing; Ctrl-C is raised when it is done.
pub fn on_threads<T: Send>(
    py: Python<'_>,
    threads: Option<i64>,
    work: impl FnOnce() -> bgars_core::Result<T> + Send,
) -> PyResult<T> {
    watched::<T, (f64,), _>(py, threads, None, |_| work())
}

fn look_at_python<A: for<'py> PyCallArgs<'py>>(callback: Option<&Py<PyAny>>, arguments: Option<A>) -> PyResult<()> {
    Python::attach(|py| {
        py.check_signals()?;
        if let (Some(callback), Some(arguments)) = (callback, arguments) {
            callback.call1(py, arguments)?;
        }
        Ok(())
    })
}
