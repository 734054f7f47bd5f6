//! Plain arrays under the names that [`crate::integrate`] knows, until it has its own.

use std::ops::{Deref, DerefMut};

/// Zeros.
pub(crate) fn zeros<T: Default + Clone>(len: usize) -> Vec<T> {
    vec![T::default(); len]
}

/// Numbers.
#[derive(Debug)]
pub(crate) struct Aligned<T>(Vec<T>);

impl<T: Reused> Aligned<T> {
    pub fn zeros(len: usize) -> Self {
        Self(zeros(len))
    }

    /// Numbers to be written before they are read.
    pub fn any(len: usize) -> Self {
        Self::zeros(len)
    }

    /// Gives it up.
    pub fn release(self) {}
}

/// Memory for a short while.
#[derive(Debug)]
pub(crate) struct Scratch<T>(Vec<T>);

impl<T: Clone> Scratch<T> {
    pub fn filled(value: T, len: usize) -> Self {
        Self(vec![value; len])
    }
}

impl<T> FromIterator<T> for Scratch<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

macro_rules! slices {
    ($($name:ident)*) => {$(
        impl<T> Deref for $name<T> {
            type Target = [T];

            #[inline(always)]
            fn deref(&self) -> &[T] {
                &self.0
            }
        }

        impl<T> DerefMut for $name<T> {
            #[inline(always)]
            fn deref_mut(&mut self) -> &mut [T] {
                &mut self.0
            }
        }
    )*};
}
slices!(Aligned Scratch);

/// A number of such arrays.
pub(crate) trait Reused: Default + Copy + Send + Sync + 'static {}
impl Reused for f32 {}
impl Reused for f64 {}
impl Reused for u64 {}
