//! The only file that knows numpy: arrays to slices without a copy, vectors to arrays without a copy.

use numpy::ndarray::Dimension;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3,
    PyReadonlyArray4, PyReadwriteArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors::InputError;

/// A light stack of one of the accepted dtypes, shape (L, H, W).
#[derive(FromPyObject)]
pub enum Stack<'py> {
    #[pyo3(transparent)]
    U8(PyReadonlyArray3<'py, u8>),
    #[pyo3(transparent)]
    U16(PyReadonlyArray3<'py, u16>),
    #[pyo3(transparent)]
    F32(PyReadonlyArray3<'py, f32>),
}

/// The elements of a C-contiguous array; the Python side has made it contiguous.
pub fn slice2<'a, T: Element>(array: &'a PyReadonlyArray2<'_, T>, name: &str) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| InputError::new_err(format!("{name}: must be C-contiguous")))
}

/// The same for three dimensions.
pub fn slice3<'a, T: Element>(array: &'a PyReadonlyArray3<'_, T>, name: &str) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| InputError::new_err(format!("{name}: must be C-contiguous")))
}

/// The same for four dimensions.
pub fn slice4<'a, T: Element>(array: &'a PyReadonlyArray4<'_, T>, name: &str) -> PyResult<&'a [T]> {
    array.as_slice().map_err(|_| InputError::new_err(format!("{name}: must be C-contiguous")))
}

/// The elements of a C-contiguous array, to be written.
pub fn slice_mut<'a, T: Element, D: Dimension>(
    array: &'a mut PyReadwriteArray<'_, T, D>,
    name: &str,
) -> PyResult<&'a mut [T]> {
    array.as_slice_mut().map_err(|_| InputError::new_err(format!("{name}: must be C-contiguous")))
}

/// Rows of `N` values, shape (rows, N).
pub fn rows<'a, T: Element, const N: usize>(array: &'a PyReadonlyArray2<'_, T>, name: &str) -> PyResult<&'a [[T; N]]> {
    let (rows, columns) = (array.shape()[0], array.shape()[1]);
    if columns != N {
        return Err(InputError::new_err(format!("{name}: must have shape (N, {N}), got ({rows}, {columns})")));
    }
    Ok(slice2(array, name)?.as_chunks().0)
}

/// Rows of three, shape (N, 3).
pub fn triples<'a, T: Element>(array: &'a PyReadonlyArray2<'_, T>, name: &str) -> PyResult<&'a [[T; 3]]> {
    rows(array, name)
}

/// An array of shape (H, W).
pub fn array2<T: Element>(py: Python<'_>, data: Vec<T>, shape: [usize; 2]) -> PyResult<Bound<'_, PyArray2<T>>> {
    PyArray1::from_vec(py, data).reshape(shape)
}

/// An array of shape (A, B, C).
pub fn array3<T: Element>(py: Python<'_>, data: Vec<T>, shape: [usize; 3]) -> PyResult<Bound<'_, PyArray3<T>>> {
    PyArray1::from_vec(py, data).reshape(shape)
}

/// An array of shape (A, B, C, D).
pub fn array4<T: Element>(py: Python<'_>, data: Vec<T>, shape: [usize; 4]) -> PyResult<Bound<'_, PyArray4<T>>> {
    PyArray1::from_vec(py, data).reshape(shape)
}

/// An array of shape (N, 3) from rows of three.
pub fn array_of_triples<T: Element>(py: Python<'_>, data: Vec<[T; 3]>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let rows = data.len();
    array2(py, data.into_flattened(), [rows, 3])
}
