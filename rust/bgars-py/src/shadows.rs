//! `draw_shadows`, `measure_edges`, `edge_rows`, `edge_products`, `normal_distribution`.

use std::ops::ControlFlow;

use bgars_core::normal_distribution::{self as distribution, FEW_VALUES};
use bgars_core::shadows::model::{Ball, Board, Lamp};
use bgars_core::shadows::{
    COLUMNS, EdgeSettings, Edges, LightState, Margins, STRETCH_FIELDS, Silhouettes, Stretch, TERMS, WAVES,
};
use bgars_core::{ImageStack, Lights, Pixel, Radiometry, shadows};
use numpy::{
    PyArray2, PyArray3, PyArray4, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::capture::{Capture, Work};
use crate::convert::{
    array2, array3, array4, check_count, check_most, check_room, rows, slice2, slice3, slice4, triples,
};
use crate::errors::InputError;
use crate::progress::on_threads;

/// What throws shadows, in pixels: balls (N, 5), lights (L, 3), whether those are positions, the board's coefficients.
#[derive(FromPyObject)]
pub struct Casters<'py> {
    balls: PyReadonlyArray2<'py, f64>,
    lights: PyReadonlyArray2<'py, f64>,
    near: bool,
    board: [f64; 5],
}

impl Casters<'_> {
    fn balls(&self) -> PyResult<Vec<Ball>> {
        Ok(rows::<f64, 5>(&self.balls, "balls")?.iter().copied().map(Ball::from).collect())
    }

    fn lamps(&self) -> PyResult<Vec<Lamp>> {
        Ok(triples(&self.lights, "lights")?.iter().map(|&vector| Lamp { vector, near: self.near }).collect())
    }
}

/// hidden (rows, cols), count (L, rows, cols).
type Maps<'py> = (Bound<'py, PyArray2<bool>>, Bound<'py, PyArray3<u8>>);

#[pyfunction]
#[pyo3(signature = (casters, *, shape, step, silhouette_margin_px, shadow_margin_px, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn draw_shadows<'py>(
    py: Python<'py>,
    casters: Casters<'py>,
    shape: [usize; 2],
    step: usize,
    silhouette_margin_px: f64,
    shadow_margin_px: f64,
    threads: Option<i64>,
) -> PyResult<Maps<'py>> {
    let (balls, lamps, board) = (casters.balls()?, casters.lamps()?, Board(casters.board));
    let margins = Margins { silhouette_px: silhouette_margin_px, shadow_px: shadow_margin_px };
    check_count("step", step)?;
    check_room::<u8>(&[lamps.len() + 1, shape[0].div_ceil(step), shape[1].div_ceil(step)])?;
    let map = on_threads(py, threads, || Ok(shadows::draw_shadows(&balls, &lamps, &board, shape, step, margins)))?;
    Ok((array2(py, map.hidden, [map.rows, map.cols])?, array3(py, map.count, [lamps.len(), map.rows, map.cols])?))
}

/// The attributes of `bgars.inspection.shadow_edges.EdgeSettings` and of the lines across an edge.
#[derive(FromPyObject)]
pub struct Lines<'py> {
    spread_px: f64,
    lamp_spread_rad: Vec<f64>,
    reach_px: Vec<f64>,
    limit: Vec<f64>,
    profiles: PyReadonlyArray4<'py, f64>,
    stride_px: usize,
    coarse: bool,
}

/// stretches (N, L * S, fields), noise (N, L).
type Measured<'py> = (Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>);

#[pyfunction]
#[pyo3(signature = (capture, casters, settings, *, angles_rad, sectors, gains, step, hidden, count, mask, threads))]
#[allow(clippy::too_many_arguments, clippy::needless_pass_by_value)]
pub fn measure_edges<'py>(
    py: Python<'py>,
    capture: Capture<'py>,
    casters: Casters<'py>,
    settings: Lines<'py>,
    angles_rad: Vec<f64>,
    sectors: usize,
    gains: PyReadonlyArray2<'py, f32>,
    step: usize,
    hidden: PyReadonlyArray2<'py, bool>,
    count: PyReadonlyArray3<'py, u8>,
    mask: Option<PyReadonlyArray2<'py, bool>>,
    threads: Option<i64>,
) -> PyResult<Measured<'py>> {
    let (balls, lamps, board) = (casters.balls()?, casters.lamps()?, Board(casters.board));
    let (balls_count, lights) = (balls.len(), lamps.len());
    let silhouettes = Silhouettes {
        step,
        cols: hidden.shape()[1],
        hidden: slice2(&hidden, "hidden")?,
        count: slice3(&count, "count")?,
        mask: mask.as_ref().map(|mask| slice2(mask, "mask")).transpose()?,
    };
    let gains = slice2(&gains, "gains")?;
    let Lines { spread_px, lamp_spread_rad, reach_px, limit, profiles, stride_px, coarse } = settings;
    let (nodes, curves) = (profiles.shape()[2], slice4(&profiles, "profiles")?.as_chunks().0.to_vec());
    let settings = EdgeSettings {
        spread_px,
        lamp_spread_rad,
        reach_px,
        limit,
        profiles: curves,
        nodes,
        stride_px,
        coarse,
        angles_rad,
        sectors,
    };
    for (name, count) in [("stride_px", settings.stride_px), ("sectors", settings.sectors), ("step", step)] {
        check_count(name, count)?;
    }
    check_room::<Stretch>(&[balls_count, lights, sectors])?;
    let lines = settings.angles_rad.len();
    if [&settings.lamp_spread_rad, &settings.reach_px, &settings.limit].iter().any(|values| values.len() != lines) {
        return Err(InputError::new_err(
            "lamp_spread_rad, reach_px, limit: must have one value for each of angles_rad",
        ));
    }
    let least = if coarse { 0 } else { 2 };
    if settings.nodes < least || profiles.shape() != [lights, lines, settings.nodes, 2] {
        return Err(InputError::new_err("profiles: must have shape (lights, angles_rad, at least 2, 2)"));
    }
    check_most("reach_px", settings.reach_px.iter().copied())?;
    let job = Job { silhouettes, balls, lamps, board, gains, settings };
    let edges = capture.work(py, threads, None, job)?;
    let numbers = edges.stretches.iter().flat_map(Stretch::numbers).collect();
    let shape = [balls_count, lights * sectors, STRETCH_FIELDS];
    Ok((array3(py, numbers, shape)?, array2(py, edges.noise, [balls_count, lights])?))
}

/// Rows (N, L, S, columns) of the points (N, L, S).
#[pyfunction]
#[pyo3(signature = (x, y, casters, *, turns, shifts_px, waves_px))]
#[allow(clippy::needless_pass_by_value)]
pub fn edge_rows<'py>(
    py: Python<'py>,
    x: PyReadonlyArray3<'py, f64>,
    y: PyReadonlyArray3<'py, f64>,
    casters: Casters<'py>,
    turns: PyReadonlyArray2<'py, f64>,
    shifts_px: PyReadonlyArray2<'py, f64>,
    waves_px: [f64; WAVES],
) -> PyResult<Bound<'py, PyArray4<f64>>> {
    let (balls, lamps, board) = (casters.balls()?, casters.lamps()?, Board(casters.board));
    let (turns, shifts) = (rows::<f64, 6>(&turns, "turns")?, rows::<f64, 2>(&shifts_px, "shifts_px")?);
    let shape = [balls.len(), lamps.len(), x.shape()[2]];
    if x.shape() != shape || y.shape() != shape || turns.len() != lamps.len() || shifts.len() != lamps.len() {
        return Err(InputError::new_err(format!(
            "x, y, turns, shifts_px: must fit the {} balls and {} lights of casters",
            balls.len(),
            lamps.len()
        )));
    }
    let lights: Vec<_> = (lamps.into_iter().zip(turns).zip(shifts))
        .map(|((lamp, &[a, b, c, d, e, f]), &shift)| LightState { lamp, ways: [[a, b, c], [d, e, f]], shift })
        .collect();
    let places = [slice3(&x, "x")?, slice3(&y, "y")?];
    let rows = py.detach(|| shadows::edge_rows(places, &balls, &lights, &board, waves_px));
    array4(py, rows.into_flattened(), [shape[0], shape[1], shape[2], COLUMNS])
}

/// Products (N, L, T + 1, T + 1) of the rows of `edge_rows`, weighted (N, L, S).
#[pyfunction]
#[allow(clippy::needless_pass_by_value)]
pub fn edge_products<'py>(
    py: Python<'py>,
    rows: PyReadonlyArray4<'py, f64>,
    weights: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray4<f64>>> {
    let [balls, lights, points] = [rows.shape()[0], rows.shape()[1], rows.shape()[2]];
    if rows.shape()[3] != COLUMNS || points == 0 || weights.shape() != [balls, lights, points] {
        return Err(InputError::new_err("rows, weights: must have shapes (N, L, S, columns) and (N, L, S)"));
    }
    let (rows, weights) = (slice4(&rows, "rows")?.as_chunks().0, slice3(&weights, "weights")?);
    let products = py.detach(|| shadows::edge_products(rows, weights, points));
    array4(py, products, [balls, lights, TERMS + 1, TERMS + 1])
}

#[pyfunction]
#[pyo3(signature = (values, *, threads))]
#[allow(clippy::needless_pass_by_value)]
pub fn normal_distribution<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f64>,
    threads: Option<i64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let [rows, cols] = [values.shape()[0], values.shape()[1]];
    let values = slice2(&values, "values")?;
    let work = || distribution::normal_distribution(values);
    let shares = if values.len() <= FEW_VALUES { py.detach(work) } else { on_threads(py, threads, || Ok(work()))? };
    array2(py, shares, [rows, cols])
}

/// Everything but the images; the lights are those of the casters, as refined so far.
struct Job<'a> {
    silhouettes: Silhouettes<'a>,
    balls: Vec<Ball>,
    lamps: Vec<Lamp>,
    board: Board,
    gains: &'a [f32],
    settings: EdgeSettings,
}

impl Work for Job<'_> {
    type Output = Edges;

    fn run<P: Pixel>(
        self,
        stack: &ImageStack<'_, P>,
        _: &Lights,
        radiometry: &Radiometry<'_, P>,
        _: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> bgars_core::Result<Edges> {
        radiometry.check(stack)?;
        let Self { silhouettes, balls, lamps, board, gains, settings } = self;
        let Silhouettes { step, cols, hidden, count, mask } = silhouettes;
        let cells = stack.height().div_ceil(step) * cols;
        for (argument, expected, actual) in [
            ("casters.lights", stack.lights(), lamps.len()),
            ("hidden", stack.height().div_ceil(step) * stack.width().div_ceil(step), hidden.len()),
            ("hidden", cells, hidden.len()),
            ("count", lamps.len() * cells, count.len()),
            ("mask", stack.pixels(), mask.map_or(stack.pixels(), <[bool]>::len)),
            ("gains", balls.len() * lamps.len(), gains.len()),
        ] {
            if expected != actual {
                return Err(bgars_core::Error::LengthMismatch { argument, expected, actual });
            }
        }
        Ok(shadows::measure_edges(stack, radiometry, silhouettes, &balls, &lamps, &board, gains, &settings))
    }
}
