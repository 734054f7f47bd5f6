//! Binding of `bgars_core::rims`.

use bgars_core::rims::{
    ANGLES, BASIS, Circle, PROFILES, Planes, RimPixels, SLOPES, STEPS_PER_PX, bands, eliminate, profiles,
    ring_edges as edges,
};
use numpy::{PyArray3, PyArray4, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::convert::{array3, array4, check_count, check_most, check_room, rows, slice2, slice3, slice4, triples};
use crate::errors::InputError;
use crate::progress::on_threads;

/// An array (N, sectors, P).
type Padded<'py> = Bound<'py, PyArray3<f32>>;

#[pyfunction]
#[pyo3(signature = (blur_px, reach_px, *, threads))]
pub fn rim_profiles(py: Python<'_>, blur_px: f64, reach_px: f64, threads: Option<i64>) -> PyResult<Padded<'_>> {
    check_most("blur_px", [blur_px])?;
    check_most("reach_px", [reach_px])?;
    check_room::<f32>(&[ANGLES, 2 * (reach_px * STEPS_PER_PX).ceil() as usize + 1, PROFILES])?;
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
    let circles = circles_of(&circles)?;
    let depths = rows::<f64, 2>(&depths, "depths")?;
    if every == 0 || depths.len() != circles.len() {
        return Err(InputError::new_err("depths: must be one pair a circle, and every at least 1"));
    }
    check_count("sectors", sectors)?;
    check_most("depths", depths.iter().flat_map(|depths| depths.map(f64::abs)))?;
    check_most(
        "circles",
        circles.iter().flat_map(|circle| [circle.row_px, circle.col_px, circle.radius_px].map(f64::abs)),
    )?;
    check_room::<usize>(&[circles.len(), sectors])?;
    let found = on_threads(py, threads, || Ok(bands(&circles, depths, every, sectors)))?;
    let shape = [circles.len(), sectors, found.most];
    Ok((array3(py, found.rows, shape)?, array3(py, found.cols, shape)?, array3(py, found.weights, shape)?))
}

/// Pixels near rims: the attributes of `bgars.balls.rim_pixels.RimPixels`.
#[derive(FromPyObject)]
pub struct Pixels<'py> {
    row: PyReadonlyArray3<'py, f32>,
    col: PyReadonlyArray3<'py, f32>,
    weight: PyReadonlyArray3<'py, f32>,
    levels: PyReadonlyArray4<'py, f32>,
}

/// Normal equations (N, sectors, 5 + L, 5 + L) and coefficients (N, sectors, 7, L).
type Eliminated<'py> = (Bound<'py, PyArray4<f64>>, Bound<'py, PyArray4<f64>>);

#[pyfunction]
#[pyo3(signature = (pixels, circles, table, *, blur_px, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn eliminate_rims<'py>(
    py: Python<'py>,
    pixels: Pixels<'py>,
    circles: PyReadonlyArray2<'py, f64>,
    table: PyReadonlyArray3<'py, f32>,
    blur_px: f64,
    threads: Option<i64>,
) -> PyResult<Eliminated<'py>> {
    let circles = circles_of(&circles)?;
    let shape = pixels.row.shape();
    let &[lights, balls, sectors, most] = pixels.levels.shape() else { unreachable!("four axes") };
    let alike =
        [pixels.col.shape(), pixels.weight.shape(), &[balls, sectors, most]].iter().all(|other| *other == shape);
    if !alike
        || circles.len() != balls
        || table.shape()[0] != ANGLES
        || table.shape()[1] == 0
        || table.shape()[2] != PROFILES
    {
        return Err(InputError::new_err("pixels, circles, table: must be of one band and of rim_profiles"));
    }
    let pixels = RimPixels {
        rows: slice3(&pixels.row, "row")?,
        cols: slice3(&pixels.col, "col")?,
        weights: slice3(&pixels.weight, "weight")?,
        levels: slice4(&pixels.levels, "levels")?,
        lights,
        sectors,
        most,
    };
    let table = slice3(&table, "table")?.as_chunks().0;
    let others = SLOPES + lights;
    check_room::<f64>(&[balls, sectors, others, others])?;
    let left = on_threads(py, threads, || Ok(eliminate(pixels, &circles, blur_px, table)))?;
    Ok((
        array4(py, left.rest, [balls, sectors, others, others])?,
        array4(py, left.coefficients, [balls, sectors, BASIS, lights])?,
    ))
}

fn circles_of(circles: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Circle>> {
    let rows = triples(circles, "circles")?.iter();
    Ok(rows.map(|&[row_px, col_px, radius_px]| Circle { row_px, col_px, radius_px }).collect())
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
    check_count("directions", directions)?;
    check_room::<f32>(&[count, directions, rings])?;
    let planes = Planes { values: slice3(&images, "images")?, lights, height, width };
    let centres = rows(&centres, "centres")?;
    let radii = slice2(&radii_px, "radii_px")?;
    let found = on_threads(py, threads, || Ok(edges(planes, centres, radii, directions, rank)))?;
    array3(py, found, [count, directions, rings])
}
