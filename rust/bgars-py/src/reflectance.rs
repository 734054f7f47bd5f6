//! Binding of `bgars_core::reflectance`.

use std::ops::ControlFlow;

use bgars_core::normals::NormalMapMut;
use bgars_core::reflectance::{
    Circle, Findings, Lobe, Masking, Material, Request, Shape, estimate_into, parameter_names,
};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::capture::{Capture, Work};
use crate::convert::{rows, slice2};
use crate::errors::InputError;
use crate::normals::Outputs;

struct Estimate<'a> {
    request: Request<'a>,
    out: NormalMapMut<'a>,
}

impl Work for Estimate<'_> {
    type Output = Findings;

    fn run<P: Pixel>(
        self,
        stack: &ImageStack<'_, P>,
        lights: &Lights,
        radiometry: &Radiometry<'_, P>,
        report: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> bgars_core::Result<Findings> {
        estimate_into(stack, lights, radiometry, self.request, report, self.out)
    }
}

/// The attributes of `bgars.SurfaceMaterial`.
#[derive(FromPyObject)]
pub struct GivenMaterial {
    diffuse_level: f64,
    grazing: f64,
    ambient_level: f64,
    lobes: Vec<GivenLobe>,
    masking: String,
    gains: Vec<f64>,
}

#[derive(FromPyObject)]
struct GivenLobe {
    strength_level: f64,
    roughness: f64,
    tail: f64,
}

impl GivenMaterial {
    fn material(&self) -> PyResult<Material> {
        let masking = match self.masking.as_str() {
            "smith" => Masking::Smith,
            "cook-torrance" => Masking::CookTorrance,
            other => {
                let message = format!("material.masking: must be smith or cook-torrance, got {other:?}");
                return Err(InputError::new_err(message));
            }
        };
        let lobes = self.lobes.iter();
        Ok(Material {
            diffuse: self.diffuse_level,
            grazing: self.grazing,
            ambient: self.ambient_level,
            lobes: lobes
                .map(|lobe| Lobe { strength: lobe.strength_level, roughness: lobe.roughness, tail: lobe.tail })
                .collect(),
            masking,
            gains: self.gains.clone(),
        })
    }
}

#[pyfunction]
#[pyo3(signature = (capture, *, mask, circles, free, wanted, material, threads, progress, out))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
pub fn estimate_reflectance<'py>(
    py: Python<'py>,
    capture: Capture<'py>,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    circles: PyReadonlyArray2<'py, f64>,
    free: Option<PyReadonlyArray2<'py, bool>>,
    wanted: Option<PyReadonlyArray2<'py, bool>>,
    material: Option<GivenMaterial>,
    threads: Option<i64>,
    progress: Option<Py<PyAny>>,
    mut out: Outputs<'py>,
) -> PyResult<Bound<'py, PyDict>> {
    let circle = |&[x_px, y_px, radius_px, u_radius_px]: &[f64; 4]| Circle {
        x_px,
        y_px,
        radius_px,
        u_radius_px,
        shape: Shape::SPHERE,
    };
    let circles: Vec<Circle> = rows(&circles, "circles")?.iter().map(circle).collect();
    let material = material.map(|given| given.material()).transpose()?;
    let request = Request {
        mask: mask.as_ref().map(|mask| slice2(mask, "mask")).transpose()?,
        circles: &circles,
        free: free.as_ref().map(|free| slice2(free, "free")).transpose()?,
        wanted: wanted.as_ref().map(|wanted| slice2(wanted, "wanted")).transpose()?,
        material: material.as_ref(),
    };
    let out = out.as_map()?;
    let findings = capture.work(py, threads, progress.as_ref(), Estimate { request, out })?;
    described(py, &findings)
}

/// What was found as a dictionary of plain values.
fn described<'py>(py: Python<'py>, findings: &Findings) -> PyResult<Bound<'py, PyDict>> {
    let material = &findings.material;
    let lobes: Vec<(f64, f64, f64)> =
        material.lobes.iter().map(|lobe| (lobe.strength, lobe.roughness, lobe.tail)).collect();
    let found = PyDict::new(py);
    found.set_item("diffuse_level", material.diffuse)?;
    found.set_item("grazing", material.grazing)?;
    found.set_item("ambient_level", material.ambient)?;
    found.set_item("lobes", lobes)?;
    let masking = match material.masking {
        Masking::Smith => "smith",
        Masking::CookTorrance => "cook-torrance",
    };
    found.set_item("masking", masking)?;
    found.set_item("gains", material.gains.clone())?;
    let errors = findings.fit.as_ref().map(|fit| {
        let names = parameter_names(material.lobes.len(), material.gains.len());
        names.into_iter().zip(fit.standard_errors.iter().copied()).collect::<Vec<_>>()
    });
    found.set_item("standard_errors", errors)?;
    found.set_item("loss", findings.loss)?;
    let (shape, ratio) = match findings.shape.shape {
        Shape::Cap(ratio) => (if findings.shape.shape == Shape::SPHERE { "sphere" } else { "cap" }, ratio),
        Shape::Ellipsoid(ratio) => ("ellipsoid", ratio),
    };
    found.set_item("shape", (shape, ratio, findings.shape.u_ratio))?;
    let left_out: Vec<[f32; 3]> =
        findings.left_out.iter().map(|light| [light.difference, light.value, light.mean]).collect();
    found.set_item("left_out", left_out)?;
    found.set_item("accepted", findings.accepted)?;
    found.set_item("own_material", findings.own_material.clone())?;
    found.set_item("residuals_learnt", findings.residuals_learnt)?;
    found.set_item("deviation_deg", findings.deviation_deg.clone())?;
    let flat: Vec<Option<f32>> = findings.flat_tops.iter().map(|flat| flat.map(|flat| flat.radius)).collect();
    found.set_item("flat_radius", flat)?;
    Ok(found)
}
