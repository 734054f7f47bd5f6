//! Binding of `bgars_core::assignment`.

use bgars_core::assignment::assignment as assign;
use numpy::{PyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::slice2;
use crate::errors::InputError;

#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn assignment<'py>(py: Python<'py>, costs: PyReadonlyArray2<'py, f64>) -> PyResult<Bound<'py, PyArray1<usize>>> {
    let &[rows, columns] = costs.shape() else { unreachable!("two axes") };
    let costs = slice2(&costs, "costs")?;
    if rows != columns || costs.iter().any(|cost| !cost.is_finite()) {
        return Err(InputError::new_err("costs: must be square and finite"));
    }
    Ok(PyArray1::from_vec(py, py.detach(|| assign(costs, rows))))
}
