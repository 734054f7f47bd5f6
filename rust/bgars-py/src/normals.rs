//! `estimate_normals`.

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMap, NormalMapMut, RobustParams, estimate_into};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry, blind};
use numpy::{
    PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray2, PyReadwriteArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::convert::{Stack, array2, array3, slice_mut, slice2, slice3, triples};
use crate::errors::{InputError, to_python};
use crate::progress::watched;

/// normals (H, W, 3), albedo, mask, confidence, measured, lights_kept (H, W), kept sets (H, W, L).
type Arrays<'py> = (
    Bound<'py, PyArray3<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<bool>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<bool>>,
    Bound<'py, PyArray2<u16>>,
    Option<Bound<'py, PyArray3<bool>>>,
);

/// Zeros on large pages, for `estimate_normals` to write.
#[pyfunction]
pub fn normal_arrays(py: Python<'_>, height: usize, width: usize, set_lights: usize) -> PyResult<Arrays<'_>> {
    let map = NormalMap::zeros(height * width, set_lights);
    let shape = [height, width];
    Ok((
        array3(py, map.normals, [height, width, 3])?,
        array2(py, map.albedo, shape)?,
        array2(py, map.mask, shape)?,
        array2(py, map.confidence, shape)?,
        array2(py, map.measured, shape)?,
        array2(py, map.lights_kept, shape)?,
        (set_lights > 0).then(|| array3(py, map.kept_sets, [height, width, set_lights])).transpose()?,
    ))
}

/// The arrays to write: normals (H, W, 3), albedo, mask, confidence, measured, lights_kept (H, W), and the kept sets (H, W, L).
#[derive(FromPyObject)]
pub struct Outputs<'py> {
    normals: PyReadwriteArray3<'py, f32>,
    albedo: PyReadwriteArray2<'py, f32>,
    mask: PyReadwriteArray2<'py, bool>,
    confidence: PyReadwriteArray2<'py, f32>,
    measured: PyReadwriteArray2<'py, bool>,
    lights_kept: PyReadwriteArray2<'py, u16>,
    kept_sets: Option<PyReadwriteArray3<'py, bool>>,
}

impl Outputs<'_> {
    fn as_map(&mut self) -> PyResult<NormalMapMut<'_>> {
        Ok(NormalMapMut {
            normals: slice_mut(&mut self.normals, "normals")?,
            albedo: slice_mut(&mut self.albedo, "albedo")?,
            mask: slice_mut(&mut self.mask, "mask")?,
            confidence: slice_mut(&mut self.confidence, "confidence")?,
            measured: slice_mut(&mut self.measured, "measured")?,
            lights_kept: slice_mut(&mut self.lights_kept, "lights_kept")?,
            kept_sets: match &mut self.kept_sets {
                Some(sets) => slice_mut(sets, "kept_sets")?,
                None => &mut [],
            },
        })
    }
}

/// An estimator by its name in Python.
enum Estimator {
    Filtered(Method),
    Blind,
}

/// Everything but the images, borrowed from Python.
struct Request<'a> {
    lights: Lights,
    intensities: Vec<f64>,
    response: Option<&'a [f32]>,
    black_level: f32,
    saturation: f32,
    full_scale: f32,
    mask: Option<&'a [bool]>,
    method: Estimator,
    shape: [usize; 3],
}

impl Request<'_> {
    fn run<P: Pixel>(
        &self,
        images: &[P],
        dark: Option<&[P]>,
        report: &mut dyn FnMut((f64,)) -> ControlFlow<()>,
        out: NormalMapMut<'_>,
    ) -> bgars_core::Result<Option<String>> {
        let [lights, height, width] = self.shape;
        let stack = ImageStack::new(images, lights, height, width)?;
        let radiometry = Radiometry {
            response: self.response,
            dark,
            black_level: self.black_level,
            saturation: self.saturation,
            full_scale: self.full_scale,
            intensities: self.intensities.clone(),
        };
        let progress = &mut |done| report((done,));
        match self.method {
            Estimator::Filtered(method) => {
                estimate_into(&stack, &self.lights, &radiometry, self.mask, method, progress, out).map(|()| None)
            }
            Estimator::Blind => {
                let report = blind::estimate_into(&stack, &self.lights, &radiometry, self.mask, progress, out)?;
                Ok(Some(report.to_string()))
            }
        }
    }
}

/// What the method decided and why, where it decides anything.
#[pyfunction]
#[pyo3(signature = (images, *, lights, lights_are_positions, reference_px, intensities, response, dark, black_level,
                    saturation, full_scale, mask, method, threshold, threads, progress, out))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
pub fn estimate_normals<'py>(
    py: Python<'py>,
    images: Stack<'py>,
    lights: PyReadonlyArray2<'py, f64>,
    lights_are_positions: bool,
    reference_px: Vec<f64>,
    intensities: Vec<f64>,
    response: Option<PyReadonlyArray1<'py, f32>>,
    dark: Option<Bound<'py, PyAny>>,
    black_level: f32,
    saturation: f32,
    full_scale: f32,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    method: &str,
    threshold: f32,
    threads: Option<i64>,
    progress: Option<Py<PyAny>>,
    mut out: Outputs<'py>,
) -> PyResult<Option<String>> {
    let vectors = triples(&lights, "lights")?;
    let lights = if lights_are_positions { Lights::near(vectors, &reference_px) } else { Lights::directional(vectors) };
    let shape = match &images {
        Stack::U8(images) => images.shape(),
        Stack::U16(images) => images.shape(),
        Stack::F32(images) => images.shape(),
    };
    let request = Request {
        lights: lights.map_err(to_python)?,
        intensities,
        response: response.as_ref().map(|table| table.as_slice()).transpose()?,
        black_level,
        saturation,
        full_scale,
        mask: mask.as_ref().map(|mask| slice2(mask, "mask")).transpose()?,
        method: match method {
            "lambertian" => Estimator::Filtered(Method::Lambertian),
            "specular-filter" => Estimator::Filtered(Method::SpecularFilter { threshold }),
            "robust-filter" => Estimator::Filtered(Method::RobustFilter(RobustParams::default())),
            "blind" => Estimator::Blind,
            _ => return Err(InputError::new_err(format!("method: unknown method {method:?}"))),
        },
        shape: [shape[0], shape[1], shape[2]],
    };
    let out = out.as_map()?;
    let (dark, progress) = (dark.as_ref(), progress.as_ref());
    match &images {
        Stack::U8(images) => run(py, &request, images, dark, threads, progress, out),
        Stack::U16(images) => run(py, &request, images, dark, threads, progress, out),
        Stack::F32(images) => run(py, &request, images, dark, threads, progress, out),
    }
}

/// Borrows images and dark frame of one dtype and runs without the GIL.
fn run<P: Pixel + numpy::Element>(
    py: Python<'_>,
    request: &Request<'_>,
    images: &PyReadonlyArray3<'_, P>,
    dark: Option<&Bound<'_, PyAny>>,
    threads: Option<i64>,
    progress: Option<&Py<PyAny>>,
    out: NormalMapMut<'_>,
) -> PyResult<Option<String>> {
    let dark: Option<PyReadonlyArray2<'_, P>> = dark.map(PyAnyMethods::extract).transpose()?;
    let dark = dark.as_ref().map(|dark| slice2(dark, "dark")).transpose()?;
    let images = slice3(images, "images")?;
    watched(py, threads, progress, |report| request.run(images, dark, report, out))
}
