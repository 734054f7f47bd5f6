//! The core's errors as the package's exceptions.

use bgars_core::Error;
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError};
use pyo3::prelude::*;

mod classes {
    pyo3::import_exception!(bgars.errors, ConvergenceError);
    pyo3::import_exception!(bgars.errors, FileFormatError);
    pyo3::import_exception!(bgars.errors, InputError);
    pyo3::import_exception!(bgars.errors, UnsupportedImageError);
}
pub use classes::InputError;

/// One exception class for each kind of mistake; the message is the core's.
#[allow(clippy::needless_pass_by_value)] // the shape that map_err wants
pub fn to_python(error: Error) -> PyErr {
    let message = error.to_string();
    match error {
        Error::NoConvergence { iterations, residual, .. } => {
            classes::ConvergenceError::new_err((message, iterations, residual))
        }
        Error::OutOfMemory { .. } => PyMemoryError::new_err(message),
        Error::Cancelled => PyKeyboardInterrupt::new_err(message),
        Error::UnsupportedImage { .. } => classes::UnsupportedImageError::new_err(message),
        Error::Io { .. } | Error::Decode { .. } | Error::ImageTooLarge { .. } | Error::StackMismatch { .. } => {
            classes::FileFormatError::new_err(message)
        }
        Error::NoMaterial
        | Error::TooFewLights { .. }
        | Error::LightCountMismatch { .. }
        | Error::RankDeficientLights { .. }
        | Error::NotUnitDirection { .. }
        | Error::LightBelowBoard { .. }
        | Error::BadIntensity { .. }
        | Error::LengthMismatch { .. }
        | Error::EmptyMask
        | Error::OutOfRange { .. }
        | Error::NonFinitePixel { .. }
        | Error::BadNormal { .. }
        | Error::LooksAway { .. }
        | Error::BadWeight { .. } => InputError::new_err(message),
    }
}
