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

    /// Rounded to `f32`.
    fn to_f32(self) -> f32;

    /// Exactly as `f64`.
    fn to_f64(self) -> f64;

    /// Numbers as floats: as they are, or rounded into `memory`.
    fn floats<'a>(numbers: &'a [Self], memory: &'a mut [f32]) -> &'a [f32];
}

macro_rules! real {
    ($type:ty, $avx512:ident, $avx2:ident, $portable:ident, |$numbers:ident, $memory:ident| $floats:expr) => {
        impl Real for $type {
            #[cfg(target_arch = "x86_64")]
            type Avx512 = crate::vector::$avx512;
            #[cfg(target_arch = "x86_64")]
            type Avx2 = crate::vector::$avx2;
            type Portable = crate::vector::$portable;
            type Single = One<$type>;

            #[inline(always)]
            #[allow(clippy::unnecessary_cast)]
            fn to_f32(self) -> f32 {
                self as f32
            }

            #[inline(always)]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }

            #[inline(always)]
            fn floats<'a>($numbers: &'a [Self], $memory: &'a mut [f32]) -> &'a [f32] {
                $floats
            }
        }
    };
}
real!(f32, Avx512, Avx2, Portable, |numbers, _memory| numbers);
real!(f64, Avx512Double, Avx2Double, PortableDouble, |numbers, memory| {
    let memory = &mut memory[..numbers.len()];
    for (float, number) in memory.iter_mut().zip(numbers) {
        *float = *number as f32;
    }
    memory
});

/// The lesser of two numbers that are none of them NaN: one instruction, where `min` takes three.
#[inline(always)]
pub(super) fn lesser<T: PartialOrd>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The greater of two, likewise.
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
