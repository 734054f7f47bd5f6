//! `triangulate`, `vertex_normals`.

use bgars_core::{mesh, vertex_normals as normals};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array_of_triples, slice2, triples};
use crate::progress::on_threads;

/// vertices (N, 3), faces (M, 3), pixel of each vertex (N,).
type Arrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u32>>, Bound<'py, PyArray1<u32>>);

#[pyfunction]
#[pyo3(signature = (height_px, mask, pitch, *, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn triangulate<'py>(
    py: Python<'py>,
    height_px: PyReadonlyArray2<'py, f32>,
    mask: PyReadonlyArray2<'py, bool>,
    pitch: f64,
    threads: Option<i64>,
) -> PyResult<Arrays<'py>> {
    let width = mask.shape()[1];
    let height_px = slice2(&height_px, "height_px")?;
    let mask = slice2(&mask, "mask")?;
    let mesh = on_threads(py, threads, || mesh::triangulate(height_px, mask, width, pitch))?;
    Ok((array_of_triples(py, mesh.vertices)?, array_of_triples(py, mesh.faces)?, PyArray1::from_vec(py, mesh.pixels)))
}

#[pyfunction]
#[pyo3(signature = (vertices, faces, *, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn vertex_normals<'py>(
    py: Python<'py>,
    vertices: PyReadonlyArray2<'py, f64>,
    faces: PyReadonlyArray2<'py, i64>,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let vertices = triples(&vertices, "vertices")?;
    let faces = triples(&faces, "faces")?;
    let normals = on_threads(py, threads, || normals::vertex_normals(vertices, faces))?;
    array_of_triples(py, normals)
}
