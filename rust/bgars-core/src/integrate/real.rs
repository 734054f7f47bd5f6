//! The numbers that kernels count in, and the vectors of them.

use std::ops::{Add, Mul};

use crate::memory::Reused;

use crate::vector::{One, Packed};

/// A floating-point number of a kernel: `f32` in the preconditioner, `f64` in the operator.
pub(super) trait Real:
    Reused + Default + PartialOrd + From<f32> + Add<Output = Self> + Mul<Output = Self>
{
    /// As many as AVX-512 works on at once.
    #[cfg(target_arch = "x86_64")]
    type Avx512: Packed<Number = Self>;
    /// The same of AVX2.
    #[cfg(target_arch = "x86_64")]
    type Avx2: Packed<Number = Self>;
    /// The same of any processor.
    type Portable: Packed<Number = Self>;
    /// A single one.
    type Single: Packed<Number = Self>;

    /// Exactly as `f64`.
    fn to_f64(self) -> f64;
}

macro_rules! real {
    ($type:ty, $avx512:ident, $avx2:ident, $portable:ident) => {
        impl Real for $type {
            #[cfg(target_arch = "x86_64")]
            type Avx512 = crate::vector::$avx512;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = crate::vector::$avx2;
            type Portable = crate::vector::$portable;
            type Single = One<$type>;

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
        }
    };
}
real!(f32, Portable, Portable, Portable);
real!(f64, PortableDouble, PortableDouble, PortableDouble);

/// The greater of two numbers that are none of them NaN: one instruction, where `max` takes three.
#[inline(always)]
pub(super) fn greater<T: PartialOrd>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// Calls `function::<.., V>(..)` with the vectors `V` of a type of numbers in brackets, or of several that the enclosing
/// function is compiled for; where a grid comes first, with single numbers if its rows are too short for any.
macro_rules! on_vectors {
    ([$($number:ty),+], $function:ident $(::<$generic:ty>)? ($($argument:expr),* $(,)?)) => {{
        #[cfg(target_arch = "x86_64")]
        {
            if multiversion::target::target_cfg_f!(target_feature = "avx512f") {
                return on_vectors!(@call Avx512 [$($number),+] $function [$($generic)?] ($($argument),*));
            }
            if multiversion::target::target_cfg_f!(target_feature = "avx2") {
                return on_vectors!(@call Avx2 [$($number),+] $function [$($generic)?] ($($argument),*));
            }
        }
        on_vectors!(@call Portable [$($number),+] $function [$($generic)?] ($($argument),*))
    }};
    (@call $kind:ident [$($number:ty),+] $function:ident [$($generic:ty)?] ($($argument:expr),* $(,)?)) => {
        $function::<$($generic,)? $(<$number as Real>::$kind),+>($($argument),*)
    };
    ($grid:expr, [$($number:ty),+], $function:ident $(::<$generic:ty>)? ($($argument:expr),* $(,)?)) => {{
        if !$grid.has_lanes() {
            return on_vectors!(@call Single [$($number),+] $function [$($generic)?] ($($argument),*));
        }
        on_vectors!([$($number),+], $function $(::<$generic>)? ($($argument),*))
    }};
}
pub(super) use on_vectors;
