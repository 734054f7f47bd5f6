//! Files: `decode_stack`, `write_ply`, `write_obj`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use bgars_core::Error;
use bgars_core::io::decode::{self, Channel, Color, StackData};
use bgars_core::io::{MeshView, obj, ply, rgb16};
use numpy::{PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array3, slice3, triples};
use crate::errors::{InputError, to_python};

/// Buffer of a mesh file, bytes.
const WRITE_BUFFER: usize = 1 << 20;

#[pyfunction]
#[pyo3(signature = (paths, *, channel, response, gains, max_megapixels))]
#[allow(clippy::needless_pass_by_value)]
pub fn decode_stack<'py>(
    py: Python<'py>,
    paths: Vec<PathBuf>,
    channel: &str,
    response: Option<PyReadonlyArray1<'py, f32>>,
    gains: Option<PyReadonlyArray2<'py, f32>>,
    max_megapixels: f64,
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
    let stack = py.detach(|| decode::decode_stack(&paths, &color, max_megapixels)).map_err(to_python)?;
    let shape = [paths.len(), stack.height, stack.width];
    let array = match stack.data {
        StackData::U8(data) => array3(py, data, shape)?.into_any(),
        StackData::U16(data) => array3(py, data, shape)?.into_any(),
        StackData::F32(data) => array3(py, data, shape)?.into_any(),
    };
    Ok((array, stack.linear, stack.bits))
}

#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn read_rgb16(py: Python<'_>, path: PathBuf, max_megapixels: f64) -> PyResult<Bound<'_, PyArray3<u16>>> {
    let image = py.detach(|| rgb16::read_rgb16(&path, max_megapixels)).map_err(to_python)?;
    array3(py, image.data, [image.height, image.width, 3])
}

#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn write_png16(py: Python<'_>, path: PathBuf, rgb: PyReadonlyArray3<'_, u16>) -> PyResult<()> {
    let (height, width) = (rgb.shape()[0], rgb.shape()[1]);
    let data = slice3(&rgb, "rgb")?;
    py.detach(|| rgb16::write_png16(&path, data, height, width)).map_err(to_python)
}

/// One of the core's mesh writers.
type Writer = fn(MeshView<'_, f64, i64>, &[String], &mut BufWriter<File>) -> std::io::Result<()>;

/// The arrays of a mesh as trimesh keeps them: converting them here, block by block, costs no second copy of the mesh.
struct MeshArrays<'py> {
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    normals: Option<PyReadonlyArray2<'py, f64>>,
    colors: Option<PyReadonlyArray2<'py, u8>>,
}

impl MeshArrays<'_> {
    fn write(&self, py: Python<'_>, path: &Path, comments: &[String], writer: Writer) -> PyResult<()> {
        let mesh = MeshView {
            vertices: triples(&self.vertices, "vertices")?,
            faces: triples(&self.faces, "faces")?,
            normals: self.normals.as_ref().map(|normals| triples(normals, "normals")).transpose()?,
            colors: self.colors.as_ref().map(|colors| triples(colors, "colors")).transpose()?,
        };
        let write = || {
            mesh.check()?;
            let io_error = |source| Error::Io { path: path.to_path_buf(), source };
            let mut out = BufWriter::with_capacity(WRITE_BUFFER, File::create(path).map_err(io_error)?);
            writer(mesh, comments, &mut out).and_then(|()| out.flush()).map_err(io_error)
        };
        py.detach(write).map_err(to_python)
    }
}

#[pyfunction]
#[pyo3(signature = (path, vertices, faces, *, normals=None, colors=None, comments=Vec::new()))]
#[allow(clippy::needless_pass_by_value)]
pub fn write_ply<'py>(
    py: Python<'py>,
    path: PathBuf,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    normals: Option<PyReadonlyArray2<'py, f64>>,
    colors: Option<PyReadonlyArray2<'py, u8>>,
    comments: Vec<String>,
) -> PyResult<()> {
    MeshArrays { vertices, faces, normals, colors }.write(py, &path, &comments, ply::write_ply)
}

#[pyfunction]
#[pyo3(signature = (path, vertices, faces, *, normals=None, colors=None, comments=Vec::new()))]
#[allow(clippy::needless_pass_by_value)]
pub fn write_obj<'py>(
    py: Python<'py>,
    path: PathBuf,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    normals: Option<PyReadonlyArray2<'py, f64>>,
    colors: Option<PyReadonlyArray2<'py, u8>>,
    comments: Vec<String>,
) -> PyResult<()> {
    MeshArrays { vertices, faces, normals, colors }.write(py, &path, &comments, obj::write_obj)
}
