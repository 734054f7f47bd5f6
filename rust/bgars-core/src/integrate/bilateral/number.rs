//! What the inner solver of the compatible setting counts in.

use std::ops::{AddAssign, Sub};

use super::super::checkerboard::Real;
#[cfg(target_arch = "x86_64")]
use crate::vector::{Avx2, Avx2Double, Avx512, Avx512Double};
use crate::vector::{Packed, Portable, PortableDouble};

/// A number of the inner solver.
pub(super) trait Number: Real + Sub<Output = Self> + AddAssign {
    /// As many as AVX-512 works on at once.
    #[cfg(target_arch = "x86_64")]
    type Avx512: Packed<Number = Self>;
    /// The same of AVX2.
    #[cfg(target_arch = "x86_64")]
    type Avx2: Packed<Number = Self>;
    /// The same of any processor.
    type Portable: Packed<Number = Self>;

    /// Rounded from `f64`.
    fn of(value: f64) -> Self;
}

impl Number for f32 {
    #[cfg(target_arch = "x86_64")]
    type Avx512 = Avx512;
    #[cfg(target_arch = "x86_64")]
    type Avx2 = Avx2;
    type Portable = Portable;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
}

impl Number for f64 {
    #[cfg(target_arch = "x86_64")]
    type Avx512 = Avx512Double;
    #[cfg(target_arch = "x86_64")]
    type Avx2 = Avx2Double;
    type Portable = PortableDouble;

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
}
