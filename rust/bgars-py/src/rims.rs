//! Binding of `bgars_core::rims`.

use bgars_core::rims::{ANGLES, Circle, PROFILES, Planes, bands, profiles, ring_edges as edges};
use numpy::{PyArray3, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array3, slice2, slice3, triples};
use crate::errors::InputError;
use crate::progress::on_threads;

/// An array (N, sectors, P).
type Padded<'py> = Bound<'py, PyArray3<f32>>;

#[pyfunction]
#[pyo3(signature = (blur_px, reach_px, *, threads))]
pub fn rim_profiles(py: Python<'_>, blur_px: f64, reach_px: f64, threads: Option<i64>) -> PyResult<Padded<'_>> {
    let table = on_threads(py, threads, || Ok(profiles(blur_px, reach_px)))?;
    let depths = table.len() / ANGLES;
    array3(py, table.into_flattened(), [ANGLES, depths, PROFILES])
}

#[pyfunction]
#[pyo3(signature = (circles, depths, *, every, sectors, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn rim_bands<'py>(
    py: Python<'py>,
    circles: PyReadonlyArray2<'py, f64>,
    depths: PyReadonlyArray2<'py, f64>,
    every: usize,
    sectors: usize,
    threads: Option<i64>,
) -> PyResult<(Padded<'py>, Padded<'py>, Padded<'py>)> {
    let rows = triples(&circles, "circles")?.iter();
    let circles: Vec<Circle> = rows.map(|&[row_px, col_px, radius_px]| Circle { row_px, col_px, radius_px }).collect();
    let depths: Vec<[f64; 2]> = slice2(&depths, "depths")?.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect();
    if every == 0 || sectors == 0 || depths.len() != circles.len() {
        return Err(InputError::new_err("depths: must be one pair a circle, every and sectors at least 1"));
    }
    let finite = circles.iter().all(|circle| (circle.row_px + circle.col_px + circle.radius_px).is_finite());
    if !finite || !depths.as_flattened().iter().all(|depth| depth.is_finite()) {
        return Err(InputError::new_err("circles, depths: must be finite"));
    }
    let found = on_threads(py, threads, || Ok(bands(&circles, &depths, every, sectors)))?;
    let shape = [circles.len(), sectors, found.most];
    Ok((array3(py, found.rows, shape)?, array3(py, found.cols, shape)?, array3(py, found.weights, shape)?))
}

#[pyfunction]
#[pyo3(signature = (images, centres, radii_px, *, directions, rank, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn ring_edges<'py>(
    py: Python<'py>,
    images: PyReadonlyArray3<'py, f32>,
    centres: PyReadonlyArray2<'py, f64>,
    radii_px: PyReadonlyArray2<'py, f64>,
    directions: usize,
    rank: usize,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let &[lights, height, width] = images.shape() else { unreachable!("a stack has three axes") };
    let &[count, rings] = radii_px.shape() else { unreachable!("two axes") };
    if centres.shape() != [count, 2] || lights * height * width == 0 {
        return Err(InputError::new_err("centres: must have shape (N, 2) beside radii_px (N, R), and images pixels"));
    }
    let planes = Planes { values: slice3(&images, "images")?, lights, height, width };
    let centres: Vec<[f64; 2]> = slice2(&centres, "centres")?.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect();
    let radii = slice2(&radii_px, "radii_px")?;
    let found = on_threads(py, threads, || Ok(edges(planes, &centres, radii, directions, rank)))?;
    array3(py, found, [count, directions, rings])
}
