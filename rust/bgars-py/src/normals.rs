//! `estimate_normals`.

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMapMut, estimate_into};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry, blind};
use numpy::{PyReadonlyArray2, PyReadwriteArray2, PyReadwriteArray3};
use pyo3::prelude::*;

use crate::capture::{Capture, Work};
use crate::convert::{slice_mut, slice2};
use crate::errors::InputError;

/// The arrays to write: normals (H, W, 3), albedo, mask, confidence, measured, lights_kept (H, W), and the kept sets (H, W, L);
/// `measured` may be left out where nothing is filled in.
#[derive(FromPyObject)]
pub struct Outputs<'py> {
    normals: PyReadwriteArray3<'py, f32>,
    albedo: PyReadwriteArray2<'py, f32>,
    mask: PyReadwriteArray2<'py, bool>,
    confidence: PyReadwriteArray2<'py, f32>,
    measured: Option<PyReadwriteArray2<'py, bool>>,
    lights_kept: PyReadwriteArray2<'py, u16>,
    kept_sets: Option<PyReadwriteArray3<'py, bool>>,
}

impl Outputs<'_> {
    /// The arrays as the core writes them.
    pub fn as_map(&mut self) -> PyResult<NormalMapMut<'_>> {
        Ok(NormalMapMut {
            normals: slice_mut(&mut self.normals, "out.normals")?,
            albedo: slice_mut(&mut self.albedo, "out.albedo")?,
            mask: slice_mut(&mut self.mask, "out.mask")?,
            confidence: slice_mut(&mut self.confidence, "out.confidence")?,
            measured: match &mut self.measured {
                Some(measured) => slice_mut(measured, "out.measured")?,
                None => &mut [],
            },
            lights_kept: slice_mut(&mut self.lights_kept, "out.lights_kept")?,
            kept_sets: match &mut self.kept_sets {
                Some(sets) => slice_mut(sets, "out.kept_sets")?,
                None => &mut [],
            },
        })
    }
}

/// An estimator by its name in Python.
enum Estimator {
    LeastSquares(Method),
    Blind,
}

/// The estimate of every pixel by one method; its output says what a method that chooses has decided, and why.
struct Estimate<'a> {
    mask: Option<&'a [bool]>,
    method: Estimator,
    out: NormalMapMut<'a>,
}

impl Work for Estimate<'_> {
    type Output = Option<String>;

    fn run<P: Pixel>(
        self,
        stack: &ImageStack<'_, P>,
        lights: &Lights,
        radiometry: &Radiometry<'_, P>,
        report: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> bgars_core::Result<Option<String>> {
        match self.method {
            Estimator::LeastSquares(method) => {
                estimate_into(stack, lights, radiometry, self.mask, method, report, self.out).map(|()| None)
            }
            Estimator::Blind => {
                let decided = blind::estimate_into(stack, lights, radiometry, self.mask, report, self.out)?;
                Ok(Some(decided.to_string()))
            }
        }
    }
}

#[pyfunction]
#[pyo3(signature = (capture, *, mask, method, threshold, threads, progress, out))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
pub fn estimate_normals<'py>(
    py: Python<'py>,
    capture: Capture<'py>,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    method: &str,
    threshold: f32,
    threads: Option<i64>,
    progress: Option<Py<PyAny>>,
    mut out: Outputs<'py>,
) -> PyResult<Option<String>> {
    let method = match method {
        "lambertian" => Estimator::LeastSquares(Method::Lambertian),
        "specular-filter" => Estimator::LeastSquares(Method::SpecularFilter { threshold }),
        "robust-filter" => Estimator::LeastSquares(Method::RobustFilter),
        "blind" => Estimator::Blind,
        _ => return Err(InputError::new_err(format!("method: unknown method {method:?}"))),
    };
    let mask = mask.as_ref().map(|mask| slice2(mask, "mask")).transpose()?;
    let out = out.as_map()?;
    capture.work(py, threads, progress.as_ref(), Estimate { mask, method, out })
}

/// A comparison of the methods that need no balls.
struct Predict<'a> {
    mask: Option<&'a [bool]>,
}

impl Work for Predict<'_> {
    type Output = Option<(blind::Predictions, f64)>;

    fn run<P: Pixel>(
        self,
        stack: &ImageStack<'_, P>,
        lights: &Lights,
        radiometry: &Radiometry<'_, P>,
        _: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> bgars_core::Result<Self::Output> {
        blind::predict(stack, lights, radiometry, self.mask)
    }
}

#[pyfunction]
#[pyo3(signature = (capture, *, mask, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn predict_left_out<'py>(
    py: Python<'py>,
    capture: Capture<'py>,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    threads: Option<i64>,
) -> PyResult<Option<(f64, f64, f64, f64)>> {
    let mask = mask.as_ref().map(|mask| slice2(mask, "mask")).transpose()?;
    let found = capture.work(py, threads, None, Predict { mask })?;
    Ok(found.map(|(costs, noise)| (costs.lambertian, costs.robust_filter, costs.reflectance, noise)))
}
