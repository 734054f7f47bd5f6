//! The numbers that operators work on.

use std::ops::{Add, AddAssign, Div, Mul, Sub};

/// `f32` in the preconditioner, `f64` outside of it.
pub(super) trait Real:
    Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + From<f32>
    + Add<Output = Self>
    + AddAssign
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The nearest number to one of `f64`.
    fn nearest(value: f64) -> Self;

    /// `self / diagonal`, zero for an unknown without edges. No branch: it runs in vectors.
    #[inline(always)]
    fn over(self, diagonal: Self) -> Self {
        self / if diagonal > Self::default() { diagonal } else { Self::from(f32::INFINITY) }
    }
}

impl Real for f32 {
    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value as f32
    }
}

impl Real for f64 {
    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value
    }
}
