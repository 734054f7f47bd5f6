//! `estimate_normals`.

use std::ops::ControlFlow;

use bgars_core::normals::{Method, NormalMap, RobustParams, estimate};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};
use numpy::{PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{Stack, array2, array3, slice2, slice3, triples};
use crate::errors::{InputError, to_python};
use crate::progress::watched;

type Result5<'py> = (
    Bound<'py, PyArray3<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<bool>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<u16>>,
    Option<Bound<'py, PyArray3<bool>>>,
);

/// Everything but the images, borrowed from Python.
struct Request<'a> {
    lights: Lights,
    intensities: Vec<f64>,
    response: Option<&'a [f32]>,
    black_level: f32,
    saturation: f32,
    full_scale: f32,
    mask: Option<&'a [bool]>,
    method: Method,
    keep_sets: bool,
    shape: [usize; 3],
}

impl Request<'_> {
    fn run<P: Pixel>(
        &self,
        images: &[P],
        dark: Option<&[P]>,
        report: &mut dyn FnMut((f64,)) -> ControlFlow<()>,
    ) -> bgars_core::Result<NormalMap> {
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
        estimate(&stack, &self.lights, &radiometry, self.mask, self.method, self.keep_sets, &mut |done| report((done,)))
    }
}

#[pyfunction]
#[pyo3(signature = (images, *, lights, lights_are_positions, reference_px, intensities, response, dark, black_level,
                    saturation, full_scale, mask, method, threshold, keep_sets, threads, progress))]
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
    keep_sets: bool,
    threads: Option<i64>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Result5<'py>> {
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
            "lambertian" => Method::Lambertian,
            "specular-filter" => Method::SpecularFilter { threshold },
            "robust-filter" => Method::RobustFilter(RobustParams::default()),
            _ => return Err(InputError::new_err(format!("method: unknown method {method:?}"))),
        },
        keep_sets,
        shape: [shape[0], shape[1], shape[2]],
    };
    let map = match &images {
        Stack::U8(images) => run(py, &request, images, dark.as_ref(), threads, progress.as_ref()),
        Stack::U16(images) => run(py, &request, images, dark.as_ref(), threads, progress.as_ref()),
        Stack::F32(images) => run(py, &request, images, dark.as_ref(), threads, progress.as_ref()),
    }?;
    let [lights, height, width] = request.shape;
    Ok((
        array3(py, map.normals, [height, width, 3])?,
        array2(py, map.albedo, [height, width])?,
        array2(py, map.mask, [height, width])?,
        array2(py, map.confidence, [height, width])?,
        array2(py, map.lights_kept, [height, width])?,
        keep_sets.then(|| array3(py, map.kept_sets, [height, width, lights])).transpose()?,
    ))
}

/// Borrows images and dark frame of one dtype and runs without the GIL.
fn run<P: Pixel + numpy::Element>(
    py: Python<'_>,
    request: &Request<'_>,
    images: &PyReadonlyArray3<'_, P>,
    dark: Option<&Bound<'_, PyAny>>,
    threads: Option<i64>,
    progress: Option<&Py<PyAny>>,
) -> PyResult<NormalMap> {
    let dark: Option<PyReadonlyArray2<'_, P>> = dark.map(PyAnyMethods::extract).transpose()?;
    let dark = dark.as_ref().map(|dark| slice2(dark, "dark")).transpose()?;
    let images = slice3(images, "images")?;
    watched(py, threads, progress, |report| request.run(images, dark, report))
}
