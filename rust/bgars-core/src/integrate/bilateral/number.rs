//! What the inner solver of the compatible setting counts in.

use std::ops::{AddAssign, Sub};

use super::super::real::Real;

/// A number of the inner solver.
pub(super) trait Number: Real + Sub<Output = Self> + AddAssign {
    /// Whether rounding can part the residual of a long solve from the true one.
    const DRIFTS: bool;

    /// Rounded from `f64`.
    fn of(value: f64) -> Self;
}

impl Number for f32 {
    const DRIFTS: bool = true;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
}

impl Number for f64 {
    const DRIFTS: bool = false;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
}
