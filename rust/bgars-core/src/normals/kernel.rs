//! The loop over pixels: radiometry, choice of lights, least squares.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::confidence::confidence;
use super::robust::{self, RobustFilter, RobustScratch};
use super::solve::SubsetSolver;
use super::specular::specular_filter;
use super::{Method, NormalMap};
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

/// Pixels between two calls of the progress callback.
const BAND_PIXELS: usize = 1 << 19;

/// Estimates the normal of every pixel that `mask` allows.
///
/// # Inputs
/// `stack` one image a light, `lights` and `radiometry` for the same number of lights, `mask` `height * width` values
/// (`None`: every pixel), `keep_sets` whether to return the kept lights too. `progress` is called with the fraction done
/// and stops the work by [`ControlFlow::Break`].
///
/// # Method
/// See the [module](super). A pixel whose kept lights are coplanar, whose solution is zero, or whose normal would face
/// away from the camera has no solution: NaN, `mask` false.
///
/// # Errors
/// Mismatched counts or lengths, an empty mask, values that are not finite inside the mask, [`Error::Cancelled`].
///
/// # Examples
/// ```
/// use bgars_core::{ImageStack, Lights, Radiometry, normals::{Method, estimate}};
/// let s = 0.5f64.sqrt();
/// let lights = Lights::directional(&[[s, 0.0, s], [0.0, s, s], [-s, 0.0, s], [0.0, -s, s]])?;
/// let images = [100u8, 100, 100, 100]; // one pixel, facing the camera
/// let stack = ImageStack::new(&images, 4, 1, 1)?;
/// let map = estimate(&stack, &lights, &Radiometry::linear(4, 255.0), None, Method::Lambertian, false, &mut |_| {
///     std::ops::ControlFlow::Continue(())
/// })?;
/// assert!((map.normals[2] - 1.0).abs() < 1e-6);
/// assert!((map.albedo[0] - 100.0 / 255.0 / 0.5f32.sqrt()).abs() < 1e-6);
/// # Ok::<(), bgars_core::Error>(())
/// ```
///
/// # Cost
/// O(L log L) a pixel, rayon over rows; the same bits for any number of threads.
pub fn estimate<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
    method: Method,
    keep_sets: bool,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<NormalMap> {
    check(stack, lights, radiometry, mask, method)?;
    let kernel = Kernel::new(stack, lights, radiometry, mask, method);
    let (height, width) = (stack.height(), stack.width());
    let pixels = stack.pixels();
    let mut map = NormalMap {
        normals: vec![f32::NAN; pixels * 3],
        albedo: vec![f32::NAN; pixels],
        mask: vec![false; pixels],
        confidence: vec![0.0; pixels],
        lights_kept: vec![0; pixels],
        kept_sets: vec![false; if keep_sets { pixels * stack.lights() } else { 0 }],
    };
    // An empty vector has no rows to hand out: one unused row then serves as many empty slices.
    let set_width = if keep_sets { width * stack.lights() } else { 0 };
    let band_rows = (BAND_PIXELS / width.max(1)).max(1);
    for first_row in (0..height).step_by(band_rows) {
        let rows = first_row..(first_row + band_rows).min(height);
        let band = rows.start * width..rows.end * width;
        let row_results: Vec<RowOut<'_>> = RowOut::split(&mut map, band, width, set_width);
        row_results.into_par_iter().enumerate().for_each_init(
            || Scratch::new(lights),
            |scratch, (row, mut out)| kernel.row(first_row + row, &mut out, scratch),
        );
        if progress(rows.end as f64 / height as f64).is_break() {
            return Err(Error::Cancelled);
        }
    }
    Ok(map)
}

/// Refuses what the kernel cannot work on.
fn check<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
    method: Method,
) -> Result<()> {
    if lights.len() != stack.lights() {
        return Err(Error::LightCountMismatch { images: stack.lights(), lights: lights.len() });
    }
    radiometry.check(stack)?;
    if let Some(mask) = mask
        && mask.len() != stack.pixels()
    {
        return Err(Error::LengthMismatch { argument: "mask", expected: stack.pixels(), actual: mask.len() });
    }
    if stack.pixels() == 0 || mask.is_some_and(|mask| !mask.contains(&true)) {
        return Err(Error::EmptyMask);
    }
    match method {
        Method::Lambertian => {}
        Method::SpecularFilter { threshold } => {
            if !(threshold.is_finite() && threshold > 0.0) {
                return Err(Error::OutOfRange {
                    argument: "threshold",
                    rule: "finite and above 0 (grey levels of 255)",
                    value: f64::from(threshold),
                });
            }
        }
        Method::RobustFilter(params) => params.check()?,
    }
    if P::CODES.is_none() {
        check_finite(stack, mask)?;
    }
    Ok(())
}

/// Refuses NaN and infinity in pixels that are to be used.
fn check_finite<P: Pixel>(stack: &ImageStack<'_, P>, mask: Option<&[bool]>) -> Result<()> {
    for image in 0..stack.lights() {
        let plane = stack.plane(image);
        let bad = |&pixel: &usize| !plane[pixel].to_f32().is_finite() && mask.is_none_or(|mask| mask[pixel]);
        let count = (0..plane.len()).into_par_iter().filter(bad).count();
        if let Some(first) = if count > 0 { (0..plane.len()).find(bad) } else { None } {
            let (row, col) = (first / stack.width(), first % stack.width());
            return Err(Error::NonFinitePixel { image, row, col, count });
        }
    }
    Ok(())
}

/// Everything a pixel's work reads.
struct Kernel<'a, P> {
    stack: &'a ImageStack<'a, P>,
    lights: &'a Lights,
    radiometry: &'a Radiometry<'a, P>,
    mask: Option<&'a [bool]>,
    method: Method,
    robust: Option<RobustFilter>,
    solver: SubsetSolver,
    /// 1 / intensity of each light.
    scales: Vec<f32>,
    /// Full scale in the unit of the scaled values: its mean over the lights.
    full_scale: f64,
}

/// What a row writes.
struct RowOut<'a> {
    normals: &'a mut [f32],
    albedo: &'a mut [f32],
    mask: &'a mut [bool],
    confidence: &'a mut [f32],
    lights_kept: &'a mut [u16],
    kept_sets: &'a mut [bool],
}

impl<'a> RowOut<'a> {
    /// The rows of a band of pixels.
    fn split(map: &'a mut NormalMap, band: std::ops::Range<usize>, width: usize, set_width: usize) -> Vec<Self> {
        let lights = set_width / width;
        let mut kept_sets = &mut map.kept_sets[band.start * lights..band.end * lights];
        let mut rows = Vec::with_capacity(band.len() / width);
        let scalars = map.normals[band.start * 3..band.end * 3]
            .chunks_mut(width * 3)
            .zip(map.albedo[band.clone()].chunks_mut(width))
            .zip(map.mask[band.clone()].chunks_mut(width))
            .zip(map.confidence[band.clone()].chunks_mut(width))
            .zip(map.lights_kept[band].chunks_mut(width));
        for ((((normals, albedo), mask), confidence), lights_kept) in scalars {
            let (row_sets, rest) = std::mem::take(&mut kept_sets).split_at_mut(set_width);
            kept_sets = rest;
            rows.push(Self { normals, albedo, mask, confidence, lights_kept, kept_sets: row_sets });
        }
        rows
    }
}

/// Memory of one thread, reused from pixel to pixel.
struct Scratch {
    values: Vec<f32>,
    clipped: Vec<bool>,
    kept: Vec<bool>,
    directions: Vec<Vector3<f64>>,
    order: Vec<usize>,
    robust: RobustScratch,
}

impl Scratch {
    fn new(lights: &Lights) -> Self {
        let count = lights.len();
        Self {
            values: vec![0.0; count],
            clipped: vec![false; count],
            kept: vec![false; count],
            directions: (0..count).map(|light| lights.at(light, 0.0, 0.0).0).collect(),
            order: Vec::with_capacity(count),
            robust: RobustScratch::default(),
        }
    }
}

impl<'a, P: Pixel> Kernel<'a, P> {
    fn new(
        stack: &'a ImageStack<'a, P>,
        lights: &'a Lights,
        radiometry: &'a Radiometry<'a, P>,
        mask: Option<&'a [bool]>,
        method: Method,
    ) -> Self {
        let solver = match lights {
            Lights::Directional(directions) => SubsetSolver::with_table(directions),
            Lights::Near { .. } => SubsetSolver::without_table(),
        };
        let robust = match method {
            Method::RobustFilter(params) => Some(RobustFilter::new(params, lights.len())),
            _ => None,
        };
        let scales: Vec<f32> = radiometry.intensities.iter().map(|intensity| (1.0 / intensity) as f32).collect();
        let mean_scale = scales.iter().map(|&scale| f64::from(scale)).sum::<f64>() / scales.len() as f64;
        let full_scale = f64::from(radiometry.full_scale) * mean_scale;
        Self { stack, lights, radiometry, mask, method, robust, solver, scales, full_scale }
    }

    fn row(&self, row: usize, out: &mut RowOut<'_>, scratch: &mut Scratch) {
        let width = self.stack.width();
        let lights = self.stack.lights();
        for col in 0..width {
            let pixel = row * width + col;
            if self.mask.is_some_and(|mask| !mask[pixel]) {
                continue;
            }
            self.load(row, col, scratch);
            self.choose(scratch);
            out.lights_kept[col] = scratch.kept.iter().filter(|&&kept| kept).count() as u16;
            if !out.kept_sets.is_empty() {
                out.kept_sets[col * lights..(col + 1) * lights].copy_from_slice(&scratch.kept);
            }
            let Some(solution) = self.solver.solve(&scratch.values, &scratch.directions, &scratch.kept) else {
                continue;
            };
            let scaled = solution.scaled_normal;
            let albedo = scaled.norm();
            if !(albedo.is_finite() && albedo > 0.0 && scaled.z > 0.0) {
                continue;
            }
            let squared_residuals: f64 = (0..lights)
                .filter(|&light| scratch.kept[light])
                .map(|light| (f64::from(scratch.values[light]) - scratch.directions[light].dot(&scaled)).powi(2))
                .sum();
            let normal = scaled / albedo;
            out.normals[col * 3..col * 3 + 3].copy_from_slice(&[normal.x as f32, normal.y as f32, normal.z as f32]);
            out.albedo[col] = (albedo / f64::from(self.radiometry.full_scale)) as f32;
            out.confidence[col] =
                confidence(&scaled, &solution.inverse, squared_residuals, usize::from(out.lights_kept[col]));
            out.mask[col] = true;
        }
    }

    /// The pixel's values in linear grey levels at unit light intensity, its clipped lights, and near lights' directions.
    fn load(&self, row: usize, col: usize, scratch: &mut Scratch) {
        let pixel = row * self.stack.width() + col;
        let offset = self.radiometry.offset(pixel);
        for light in 0..self.stack.lights() {
            let code = self.stack.plane(light)[pixel];
            scratch.clipped[light] = code.to_f32() >= self.radiometry.saturation;
            scratch.values[light] = (self.radiometry.linearise(code) - offset) * self.scales[light];
        }
        if let Lights::Near { .. } = self.lights {
            let x_px = col as f64 + 0.5 - self.stack.width() as f64 / 2.0;
            let y_px = self.stack.height() as f64 / 2.0 - row as f64 - 0.5;
            for light in 0..self.stack.lights() {
                let (direction, falloff) = self.lights.at(light, x_px, y_px);
                scratch.directions[light] = direction;
                scratch.values[light] /= falloff as f32;
            }
        }
    }

    fn choose(&self, scratch: &mut Scratch) {
        match (self.method, &self.robust) {
            (Method::SpecularFilter { threshold }, _) => {
                let gap = threshold * self.radiometry.full_scale / 255.0;
                specular_filter(&scratch.values, gap, &mut scratch.order, &mut scratch.kept);
            }
            (Method::RobustFilter(_), Some(filter)) => {
                let pixel = robust::Pixel {
                    values: &scratch.values,
                    clipped: &scratch.clipped,
                    directions: &scratch.directions,
                    full_scale: self.full_scale,
                };
                filter.choose(&pixel, &self.solver, &mut scratch.robust, &mut scratch.kept);
            }
            _ => scratch.kept.fill(true),
        }
    }
}
