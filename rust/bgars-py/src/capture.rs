//! A capture as Python hands it over, and work on it whatever its dtype.

use std::ops::ControlFlow;

use bgars_core::{ImageStack, Lights, Pixel, Radiometry, lights};
use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{Stack, array_of_triples, slice2, slice3, triples};
use crate::errors::to_python;
use crate::progress::{Done, on_threads, watched};

/// The attributes of `bgars.records.kernel_capture.KernelCapture`.
#[derive(FromPyObject)]
pub struct Capture<'py> {
    images: Stack<'py>,
    lights: PyReadonlyArray2<'py, f64>,
    lights_are_positions: bool,
    reference_px: Vec<f64>,
    intensities: Vec<f64>,
    response: Option<PyReadonlyArray1<'py, f32>>,
    dark: Option<Bound<'py, PyAny>>,
    black_level: f32,
    saturation: f32,
    full_scale: Option<f32>,
}

/// Work on a capture of any dtype; the argument of `report` is the fraction done.
pub trait Work: Send {
    /// What it gives.
    type Output: Send;

    /// Does the work, without the GIL.
    fn run<P: Pixel>(
        self,
        stack: &ImageStack<'_, P>,
        lights: &Lights,
        radiometry: &Radiometry<'_, P>,
        report: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> bgars_core::Result<Self::Output>;
}

impl Capture<'_> {
    /// Runs `work` on its own threads; see [`watched`].
    pub fn work<W: Work>(
        &self,
        py: Python<'_>,
        threads: Option<i64>,
        progress: Option<&Py<PyAny>>,
        work: W,
    ) -> PyResult<W::Output> {
        match &self.images {
            Stack::U8(images) => self.work_on(py, images, threads, progress, work),
            Stack::U16(images) => self.work_on(py, images, threads, progress, work),
            Stack::F32(images) => self.work_on(py, images, threads, progress, work),
        }
    }

    /// Borrows images and dark frame of one dtype and runs without the GIL.
    fn work_on<P: Pixel + numpy::Element, W: Work>(
        &self,
        py: Python<'_>,
        images: &PyReadonlyArray3<'_, P>,
        threads: Option<i64>,
        progress: Option<&Py<PyAny>>,
        work: W,
    ) -> PyResult<W::Output> {
        let dark: Option<PyReadonlyArray2<'_, P>> = self.dark.as_ref().map(PyAnyMethods::extract).transpose()?;
        let dark = dark.as_ref().map(|dark| slice2(dark, "dark")).transpose()?;
        let vectors = triples(&self.lights, "lights")?;
        let lights = if self.lights_are_positions {
            Lights::near(vectors, &self.reference_px)
        } else {
            Lights::directional(vectors)
        };
        let lights = lights.map_err(to_python)?;
        let &[count, height, width] = images.shape() else { unreachable!("a stack has three axes") };
        let images = slice3(images, "images")?;
        let radiometry = Radiometry {
            response: self.response.as_ref().map(|table| table.as_slice()).transpose()?,
            dark,
            black_level: self.black_level,
            saturation: self.saturation,
            full_scale: self.full_scale,
            intensities: self.intensities.clone(),
        };
        watched(py, threads, progress, move |report| {
            let stack = ImageStack::new(images, count, height, width)?;
            work.run(&stack, &lights, &radiometry, &mut |done| report(Done::Fraction(done)))
        })
    }
}

#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn unit_directions<'py>(
    py: Python<'py>,
    directions: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let unit = lights::unit_directions(triples(&directions, "light_directions")?).map_err(to_python)?;
    array_of_triples(py, unit.into_iter().map(Into::into).collect())
}

#[pyfunction]
#[pyo3(signature = (pixels, *, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn float_full_scale(py: Python<'_>, pixels: PyReadonlyArray3<'_, f32>, threads: Option<i64>) -> PyResult<f32> {
    let &[count, height, width] = pixels.shape() else { unreachable!("a stack has three axes") };
    let pixels = slice3(&pixels, "pixels")?;
    let stack = ImageStack::new(pixels, count, height, width).map_err(to_python)?;
    let unknown = Radiometry { full_scale: None, ..Radiometry::linear(count, f32::INFINITY) };
    if stack.is_large() {
        on_threads(py, threads, || Ok(unknown.full_scale_of(&stack)))
    } else {
        Ok(py.detach(|| unknown.full_scale_of(&stack)))
    }
}
