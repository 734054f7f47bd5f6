//! Progress to a Python callback, and Ctrl-C from it, while the GIL is released.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// Time between two looks at Python.
const INTERVAL: Duration = Duration::from_millis(100);

/// Calls back at most every 100 ms; remembers the exception that stopped the work.
pub struct Reporter {
    callback: Option<Py<PyAny>>,
    last: Instant,
    pub error: Option<PyErr>,
}

impl Reporter {
    pub fn new(callback: Option<Py<PyAny>>) -> Self {
        Self { callback, last: Instant::now(), error: None }
    }

    /// Looks for Ctrl-C and calls the callback with `args`, if it is time to.
    pub fn tick<A>(&mut self, args: A) -> ControlFlow<()>
    where
        A: for<'py> pyo3::call::PyCallArgs<'py>,
    {
        if self.last.elapsed() < INTERVAL {
            return ControlFlow::Continue(());
        }
        let outcome = Python::attach(|py| {
            py.check_signals()?;
            if let Some(callback) = &self.callback {
                callback.call1(py, args)?;
            }
            Ok(())
        });
        self.last = Instant::now();
        match outcome {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.error = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// The exception raised in the callback, else the core's own error.
    pub fn resolve<T>(self, outcome: bgars_core::Result<T>) -> PyResult<T> {
        outcome.map_err(|error| self.error.unwrap_or_else(|| crate::errors::to_python(error)))
    }
}
