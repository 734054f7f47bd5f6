//! Files: `decode_stack`, `write_mesh`, `write_height`.

use std::path::{Path, PathBuf};

use bgars_core::io::decode::{Channel, Color, StackMut, StackPlan, StackType};
use bgars_core::io::{HeightSource, MeshFormat, MeshView, color, rgb16, write_mesh_file};
use bgars_core::mesh::HeightMesh;
use numpy::{PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array3, slice_mut, slice2, slice3, triples};
use crate::errors::{InputError, to_python};
use crate::progress::on_threads;

/// A stack to be written.
#[derive(FromPyObject)]
enum OwnStack<'py> {
    #[pyo3(transparent)]
    U8(PyReadwriteArray3<'py, u8>),
    #[pyo3(transparent)]
    U16(PyReadwriteArray3<'py, u16>),
    #[pyo3(transparent)]
    F32(PyReadwriteArray3<'py, f32>),
}

/// What numpy calls a type.
fn numpy_name(kind: StackType) -> &'static str {
    match kind {
        StackType::U8 => "uint8",
        StackType::U16 => "uint16",
        StackType::F32 => "float32",
    }
}

/// `allocate(shape, dtype)` makes the array, once the headers are read.
#[pyfunction]
#[pyo3(signature = (paths, *, channel, response, gains, max_megapixels, threads, allocate))]
#[allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]
pub fn decode_stack<'py>(
    py: Python<'py>,
    paths: Vec<PathBuf>,
    channel: &str,
    response: Option<PyReadonlyArray1<'py, f32>>,
    gains: Option<PyReadonlyArray2<'py, f32>>,
    max_megapixels: f64,
    threads: Option<i64>,
    allocate: Bound<'py, PyAny>,
) -> PyResult<(Bound<'py, PyAny>, bool, u16)> {
    let channel = match channel {
        "luminance" => Channel::Luminance,
        "mean" => Channel::Mean,
        "red" => Channel::Red,
        "green" => Channel::Green,
        "blue" => Channel::Blue,
        _ => return Err(InputError::new_err(format!("channel: unknown channel {channel:?}"))),
    };
    let color = Color {
        channel,
        response: response.as_ref().map(|table| table.as_slice()).transpose()?,
        gains: gains.as_ref().map(|gains| triples(gains, "gains")).transpose()?,
    };
    if color.gains.is_some_and(|gains| gains.len() != paths.len()) {
        return Err(InputError::new_err("gains: must have one row a file"));
    }
    let plan = on_threads(py, threads, || StackPlan::new(&paths, &color, max_megapixels))?;
    if plan.linear && plan.bits <= 16 && color.response.is_some_and(|table| table.len() < 1 << plan.bits) {
        return Err(InputError::new_err(format!("response: must have an entry for each code of {} bits", plan.bits)));
    }
    let array = allocate.call1(((paths.len(), plan.height, plan.width), numpy_name(plan.kind)))?;
    let mut out: OwnStack<'py> = array.extract()?;
    let out = match &mut out {
        OwnStack::U8(out) => StackMut::U8(slice_mut(out, "stack")?),
        OwnStack::U16(out) => StackMut::U16(slice_mut(out, "stack")?),
        OwnStack::F32(out) => StackMut::F32(slice_mut(out, "stack")?),
    };
    on_threads(py, threads, || plan.decode_into(out))?;
    Ok((array, plan.linear, plan.bits))
}

/// (H, W, 3 or 4) codes as they are stored, and bits a channel.
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn read_color(py: Python<'_>, path: PathBuf, max_megapixels: f64) -> PyResult<(Bound<'_, PyArray3<f32>>, u16)> {
    let image = py.detach(|| color::read_color(&path, max_megapixels)).map_err(to_python)?;
    Ok((array3(py, image.data, [image.height, image.width, image.channels])?, image.bits))
}

#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn write_png16(py: Python<'_>, path: PathBuf, rgb: PyReadonlyArray3<'_, u16>) -> PyResult<()> {
    let (height, width) = (rgb.shape()[0], rgb.shape()[1]);
    let data = slice3(&rgb, "rgb")?;
    py.detach(|| rgb16::write_png16(&path, data, height, width)).map_err(to_python)
}

/// The format of a mesh file, by its suffix.
fn mesh_format(path: &Path) -> PyResult<MeshFormat> {
    match path.extension().and_then(|suffix| suffix.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("ply") => Ok(MeshFormat::Ply),
        Some("obj") => Ok(MeshFormat::Obj),
        _ => Err(InputError::new_err(format!("path: must end in .ply or .obj, got {}", path.display()))),
    }
}

/// Vertices and faces as trimesh keeps them: converting them here, piece by piece, costs no second copy of the mesh.
#[pyfunction]
#[pyo3(signature = (path, vertices, faces, *, normals, colors, comments, threads))]
#[allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]
pub fn write_mesh<'py>(
    py: Python<'py>,
    path: PathBuf,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    normals: Option<PyReadonlyArray2<'py, f64>>,
    colors: Option<PyReadonlyArray2<'py, u8>>,
    comments: Vec<String>,
    threads: Option<i64>,
) -> PyResult<()> {
    let format = mesh_format(&path)?;
    let mesh = MeshView {
        vertices: triples(&vertices, "vertices")?,
        faces: triples(&faces, "faces")?,
        normals: normals.as_ref().map(|normals| triples(normals, "normals")).transpose()?,
        colors: colors.as_ref().map(|colors| triples(colors, "colors")).transpose()?,
    };
    on_threads(py, threads, || {
        mesh.check()?;
        write_mesh_file(&mesh, format, &comments, &path)
    })
}

#[pyfunction]
#[pyo3(signature = (path, height_px, mask, pitch, *, normals, grey, comments, threads))]
#[allow(clippy::needless_pass_by_value, clippy::too_many_arguments)]
pub fn write_height<'py>(
    py: Python<'py>,
    path: PathBuf,
    height_px: PyReadonlyArray2<'py, f32>,
    mask: PyReadonlyArray2<'py, bool>,
    pitch: f64,
    normals: Option<PyReadonlyArray3<'py, f32>>,
    grey: Option<PyReadonlyArray2<'py, u8>>,
    comments: Vec<String>,
    threads: Option<i64>,
) -> PyResult<()> {
    let format = mesh_format(&path)?;
    let width = mask.shape()[1];
    let (height_px, mask) = (slice2(&height_px, "height_px")?, slice2(&mask, "mask")?);
    let normals = normals.as_ref().map(|normals| slice3(normals, "normals")).transpose()?;
    let grey = grey.as_ref().map(|grey| slice2(grey, "grey")).transpose()?;
    let mesh = on_threads(py, threads, || HeightMesh::new(height_px, mask, width, pitch))?;
    if mesh.face_count() == 0 {
        let vertices = mesh.vertex_count();
        let message =
            format!("height: no three neighbouring pixels are valid ({vertices} in all), so there is no face to write");
        return Err(InputError::new_err(message));
    }
    on_threads(py, threads, || {
        let normals = normals.map(|normals| normals.as_chunks().0);
        write_mesh_file(&HeightSource::new(mesh, normals, grey)?, format, &comments, &path)
    })
}
