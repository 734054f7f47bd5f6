//! `integrate_normals`.

use bgars_core::integrate::{Difference, Field, Params, integrate_into, usable};
use numpy::{PyArray2, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array2, slice_mut, slice2, slice3};
use crate::errors::InputError;
use crate::progress::{Done, on_threads, watched};

/// components (pixels, first row, first column), iterations, residual.
type Found = (Vec<(usize, usize, usize)>, usize, f64);

/// Writes to `height_px` and `labels`.
#[pyfunction]
#[pyo3(signature = (normals, mask, weights, regions, *, height_px, labels, difference, relative_tolerance,
                    absolute_tolerance, max_iters, threads, progress))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
pub fn integrate_normals<'py>(
    py: Python<'py>,
    normals: PyReadonlyArray3<'py, f32>,
    mask: PyReadonlyArray2<'py, bool>,
    weights: Option<PyReadonlyArray2<'py, f32>>,
    regions: Option<PyReadonlyArray2<'py, i32>>,
    mut height_px: PyReadwriteArray2<'py, f32>,
    mut labels: PyReadwriteArray2<'py, i32>,
    difference: &str,
    relative_tolerance: f64,
    absolute_tolerance: f64,
    max_iters: usize,
    threads: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Found> {
    let difference = match difference {
        "trapezoid" => Difference::Trapezoid,
        "forward" => Difference::Forward,
        _ => return Err(InputError::new_err(format!("difference: unknown scheme {difference:?}"))),
    };
    let params = Params { difference, relative_tolerance, absolute_tolerance, max_iters };
    let shape = [mask.shape()[0], mask.shape()[1]];
    let normals = slice3(&normals, "normals")?;
    let mask = slice2(&mask, "mask")?;
    let weights = weights.as_ref().map(|weights| slice2(weights, "weights")).transpose()?;
    let regions = regions.as_ref().map(|regions| slice2(regions, "regions")).transpose()?;
    let field = Field { normals, mask, weights, regions, width: shape[1] };
    let height_px = slice_mut(&mut height_px, "height_px")?;
    let labels = slice_mut(&mut labels, "labels")?;
    let fit = watched(py, threads, progress.as_ref(), |report| {
        integrate_into(
            field,
            &params,
            &mut |state| report(Done::Iteration(state.iteration, state.residual)),
            height_px,
            labels,
        )
    })?;
    let components = fit.components.iter().map(|part| (part.pixels, part.first_row, part.first_col)).collect();
    Ok((components, fit.iterations, fit.residual))
}

#[pyfunction]
#[pyo3(signature = (normals, *, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn usable_normals<'py>(
    py: Python<'py>,
    normals: PyReadonlyArray3<'py, f32>,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<bool>>> {
    let shape = [normals.shape()[0], normals.shape()[1]];
    let normals = slice3(&normals, "normals")?;
    let mask = on_threads(py, threads, || Ok(usable(normals)))?;
    array2(py, mask, shape)
}
