//! Binding of `bgars_core::reflectance`.

use std::ops::ControlFlow;

use bgars_core::reflectance::{Circle, Outcome, estimate_balls};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::capture::{Capture, Work};
use crate::convert::{array_of_triples, triples};

struct Estimate<'a> {
    circles: &'a [Circle],
}

impl Work for Estimate<'_> {
    type Output = Outcome;

    fn run<P: Pixel>(
        self,
        stack: &ImageStack<'_, P>,
        lights: &Lights,
        radiometry: &Radiometry<'_, P>,
        _report: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> bgars_core::Result<Outcome> {
        estimate_balls(stack, lights, radiometry, self.circles)
    }
}

type Found<'py> =
    (Bound<'py, PyArray1<u64>>, Bound<'py, PyArray2<f32>>, Bound<'py, PyArray1<f32>>, Bound<'py, PyArray1<f32>>, String);

#[pyfunction]
#[pyo3(signature = (capture, circles, *, threads))]
pub fn reflectance_balls<'py>(
    py: Python<'py>,
    capture: Capture<'py>,
    circles: PyReadonlyArray2<'py, f64>,
    threads: Option<i64>,
) -> PyResult<Found<'py>> {
    let circles: Vec<Circle> = triples(&circles, "circles")?
        .iter()
        .map(|&[x_px, y_px, radius_px]| Circle { x_px, y_px, radius_px })
        .collect();
    let outcome = capture.work(py, threads, None, Estimate { circles: &circles })?;
    let pixels = || outcome.balls.iter().flatten();
    Ok((
        PyArray1::from_vec(py, pixels().map(|p| p.pixel as u64).collect()),
        array_of_triples(py, pixels().map(|p| p.normal).collect())?,
        PyArray1::from_vec(py, pixels().map(|p| p.error_rad).collect()),
        PyArray1::from_vec(py, pixels().map(|p| p.data_error_rad).collect()),
        format!("{:?} {} {} {:?}", outcome.fit, outcome.varied, outcome.corrected, outcome.prior_deg),
    ))
}
