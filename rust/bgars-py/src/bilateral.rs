//! `integrate_bilateral`.

use bgars_core::integrate::{
    BilateralParams, BilateralSurface, Field, Pinhole, Setting, integrate_bilateral as integrate,
};
use numpy::{PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::convert::{array2, slice2, slice3};
use crate::errors::InputError;
use crate::progress::{Done, watched};

#[pyfunction]
#[pyo3(signature = (normals, mask, weights, regions, *, camera, k, max_iters, tolerance, setting, threads, progress))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
pub fn integrate_bilateral<'py>(
    py: Python<'py>,
    normals: PyReadonlyArray3<'py, f32>,
    mask: PyReadonlyArray2<'py, bool>,
    weights: Option<PyReadonlyArray2<'py, f32>>,
    regions: Option<PyReadonlyArray2<'py, i32>>,
    camera: Option<(f64, f64, f64, f64)>,
    k: f64,
    max_iters: usize,
    tolerance: f64,
    setting: &str,
    threads: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let setting = match setting {
        "compatible" => Setting::Compatible,
        "converged" => Setting::Converged,
        _ => return Err(InputError::new_err(format!("setting: unknown setting {setting:?}"))),
    };
    let params = BilateralParams { k, max_iters, tolerance, setting };
    let camera = camera.map(|(f_x_px, f_y_px, c_x_px, c_y_px)| Pinhole { f_x_px, f_y_px, c_x_px, c_y_px });
    let shape = [mask.shape()[0], mask.shape()[1]];
    let normals = slice3(&normals, "normals")?;
    let mask = slice2(&mask, "mask")?;
    let weights = weights.as_ref().map(|weights| slice2(weights, "weights")).transpose()?;
    let regions = regions.as_ref().map(|regions| slice2(regions, "regions")).transpose()?;
    let field = Field { normals, mask, weights, regions, width: shape[1] };
    let surface = watched(py, threads, progress.as_ref(), |report| {
        integrate(field, camera, &params, &mut |state| report(Done::Iteration(state.iteration, state.residual)))
    })?;
    as_dict(py, surface, shape)
}

fn as_dict(py: Python<'_>, surface: BilateralSurface, shape: [usize; 2]) -> PyResult<Bound<'_, PyDict>> {
    let parts: Vec<_> = surface.components.iter().map(|part| (part.pixels, part.first_row, part.first_col)).collect();
    let dict = PyDict::new(py);
    dict.set_item("height", array2(py, surface.height, shape)?)?;
    dict.set_item("rightward", array2(py, surface.rightward, shape)?)?;
    dict.set_item("upward", array2(py, surface.upward, shape)?)?;
    dict.set_item("labels", array2(py, surface.labels, shape)?)?;
    dict.set_item("components", parts)?;
    dict.set_item("energies", surface.energies)?;
    dict.set_item("converged", surface.converged)?;
    dict.set_item("inner_iterations", surface.inner_iterations)?;
    dict.set_item("residual", surface.residual)?;
    Ok(dict)
}
