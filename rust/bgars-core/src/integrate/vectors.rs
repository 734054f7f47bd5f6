//! Vectors of faer as slices.

use faer::{MatMut, MatRef};

/// A vector from faer, as a slice.
pub(super) fn slice(x: MatRef<'_, f64>) -> &[f64] {
    x.col(0).try_as_col_major().expect("faer hands over contiguous vectors").as_slice()
}

/// The same, to write.
pub(super) fn slice_mut(x: MatMut<'_, f64>) -> &mut [f64] {
    x.col_mut(0).try_as_col_major_mut().expect("faer hands over contiguous vectors").as_slice_mut()
}
