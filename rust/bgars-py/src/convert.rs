//! The only file that knows numpy: arrays to slices without a copy, vectors to arrays without a copy.

use numpy::ndarray::Dimension;
use numpy::{
    Element, PyArray1, PyArray2, PyArray3, PyArray4, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray,
    PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4, PyReadwriteArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyMemoryError;
use pyo3::prelude::*;

use crate::errors::InputError;

/// Longest way in pixels, or number of parts of a circle, that an argument may ask for: no image is as wide.
pub const MOST: usize = 1 << 16;

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

/// The elements of an array in C order; the Python side has brought it there.
///
/// `as_slice` alone takes Fortran order, too, and would hand the elements over in the order of memory.
fn elements<'a, T: Element, D: Dimension>(array: &'a PyReadonlyArray<'_, T, D>, name: &str) -> PyResult<&'a [T]> {
    if !array.is_c_contiguous() {
        return Err(not_c_order(name));
    }
    refuse_other_bools(array, name)?;
    array.as_slice().map_err(|_| not_c_order(name))
}

fn not_c_order(name: &str) -> PyErr {
    InputError::new_err(format!("{name}: must be C-contiguous"))
}

/// A bool is one of two bytes: what `view(bool)` makes of others must not reach Rust as one.
fn refuse_other_bools<T: Element, D: Dimension>(array: &PyReadonlyArray<'_, T, D>, name: &str) -> PyResult<()> {
    let is_bool = array.dtype().is_equiv_to(&numpy::dtype::<bool>(array.py()));
    if is_bool && array.len() > 0 {
        let bytes = array.call_method1("view", ("u1",))?;
        if bytes.call_method0("max")?.extract::<u8>()? > 1 {
            return Err(InputError::new_err(format!("{name}: a bool must be 0 or 1, got other bytes")));
        }
    }
    Ok(())
}

/// Refuses a number that is not between 0 and [`MOST`], NaN among them.
pub fn check_most(name: &str, values: impl IntoIterator<Item = f64>) -> PyResult<()> {
    match values.into_iter().find(|value| !(0.0..=MOST as f64).contains(value)) {
        Some(value) => Err(InputError::new_err(format!("{name}: must be 0 to {MOST}, got {value}"))),
        None => Ok(()),
    }
}

/// Refuses a count that is not between 1 and [`MOST`].
pub fn check_count(name: &str, count: usize) -> PyResult<()> {
    if (1..=MOST).contains(&count) {
        return Ok(());
    }
    Err(InputError::new_err(format!("{name}: must be 1 to {MOST}, got {count}")))
}

/// Refuses results of so many elements along each axis that the system has no memory for, before anything is made of them.
pub fn check_room<T>(shape: &[usize]) -> PyResult<()> {
    let bytes = shape.iter().try_fold(size_of::<T>(), |bytes, &count| bytes.checked_mul(count));
    if bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok()) {
        return Ok(());
    }
    Err(PyMemoryError::new_err(format!("out of memory: a result of shape {shape:?} does not fit")))
}

/// Elements of two dimensions.
pub fn slice2<'a, T: Element>(array: &'a PyReadonlyArray2<'_, T>, name: &str) -> PyResult<&'a [T]> {
    elements(array, name)
}

/// The same for three dimensions.
pub fn slice3<'a, T: Element>(array: &'a PyReadonlyArray3<'_, T>, name: &str) -> PyResult<&'a [T]> {
    elements(array, name)
}

/// The same for four dimensions.
pub fn slice4<'a, T: Element>(array: &'a PyReadonlyArray4<'_, T>, name: &str) -> PyResult<&'a [T]> {
    elements(array, name)
}

/// The elements of an array in C order, to be written.
pub fn slice_mut<'a, T: Element, D: Dimension>(
    array: &'a mut PyReadwriteArray<'_, T, D>,
    name: &str,
) -> PyResult<&'a mut [T]> {
    if !array.is_c_contiguous() {
        return Err(not_c_order(name));
    }
    array.as_slice_mut().map_err(|_| not_c_order(name))
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
