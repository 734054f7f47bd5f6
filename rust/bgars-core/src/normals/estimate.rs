//! The loop over pixels: radiometry, choice of lights, least squares.

use std::ops::{ControlFlow, Range};

use nalgebra::Vector3;
use rayon::prelude::*;

use super::blocks::{self, BlockSolver, Choice, Left, value_scale};
use super::checks::{check, check_finite};
use super::confidence::confidence;
use super::robust::{self, RobustScratch};
use super::solve::{Solution, solve};
use super::specular::specular_filter;
use super::windows::WindowFilter;
use super::{Method, NormalMap, NormalMapMut};
use crate::readings::{Capture, Readings};
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

/// Pixels of one task. What comes out is the same for any number.
const TASK_PIXELS: usize = 1 << 13;

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
/// O(L log L) a pixel, rayon over blocks of pixels; the same bits for any number of threads.
pub fn estimate<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
    method: Method,
    keep_sets: bool,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<NormalMap> {
    let mut map = NormalMap::zeros(stack.pixels(), if keep_sets { stack.lights() } else { 0 });
    estimate_into(stack, lights, radiometry, mask, method, progress, map.as_mut())?;
    Ok(map)
}

/// [`estimate`] into memory that is there already. After an error the content means nothing.
///
/// # Errors
/// Those of [`estimate`], and arrays of another length than the image needs.
pub fn estimate_into<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    mask: Option<&[bool]>,
    method: Method,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    mut out: NormalMapMut<'_>,
) -> Result<()> {
    let capture = Capture { stack, radiometry };
    check(&capture, lights, mask, method)?;
    out.check(stack.pixels(), stack.lights(), false)?;
    let kernel = Kernel::new(&capture, radiometry.is_plain(), lights, mask, method);
    let mut checked = P::CODES.is_some();
    let set_lights = out.set_lights();
    for first in (0..stack.pixels()).step_by(BAND_PIXELS) {
        let end = stack.pixels().min(first + BAND_PIXELS);
        let finite = kernel.band(first..end, out.take(end - first, set_lights));
        if !finite && !checked {
            // Perhaps nothing is wrong inside the mask.
            check_finite(stack, mask)?;
            checked = true;
        }
        if progress(end as f64 / stack.pixels() as f64).is_break() {
            return Err(Error::Cancelled);
        }
    }
    Ok(())
}

/// A gap in the grey levels of the images from one in grey levels of 255.
fn gap(threshold: f32, full_scale: f32) -> f32 {
    threshold * full_scale / 255.0
}

/// Everything a pixel's work reads.
struct Kernel<'a> {
    source: &'a dyn Readings,
    lights: &'a Lights,
    /// 1 / intensity of each light.
    scales: Vec<f32>,
    /// In grey levels.
    full_scale: f32,
    mask: Option<&'a [bool]>,
    method: Method,
    /// Those of the robust filter; none for other methods.
    windows: Vec<robust::Window>,
    /// The fast kernel, where it can serve.
    blocks: Option<BlockSolver>,
    /// Full scale in the unit of the scaled values: its mean over the lights.
    scaled_full_scale: f64,
}

/// Memory of one thread, reused from pixel to pixel.
struct Scratch {
    values: Vec<f32>,
    clipped: Vec<bool>,
    kept: Vec<bool>,
    directions: Vec<Vector3<f64>>,
    order: Vec<usize>,
    robust: RobustScratch,
    pixels: Vec<usize>,
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
            pixels: Vec::with_capacity(TASK_PIXELS),
        }
    }
}

impl<'a> Kernel<'a> {
    fn new(
        source: &'a dyn Readings,
        is_plain: bool,
        lights: &'a Lights,
        mask: Option<&'a [bool]>,
        method: Method,
    ) -> Self {
        let windows = if method == Method::RobustFilter { robust::windows(lights.len()) } else { Vec::new() };
        let full_scale = source.full_scale();
        let scales: Vec<f32> = source.intensities().iter().map(|intensity| (1.0 / intensity) as f32).collect();
        let mean_scale = scales.iter().map(|&scale| f64::from(scale)).sum::<f64>() / scales.len() as f64;
        let scaled_full_scale = f64::from(full_scale) * mean_scale;
        let choice = match method {
            Method::Lambertian => Choice::All,
            Method::SpecularFilter { threshold } => Choice::UpToGap(gap(threshold, full_scale)),
            Method::RobustFilter => {
                let full_scale = scaled_full_scale * f64::from(value_scale(full_scale));
                Choice::Window(WindowFilter::new(&windows, lights.len(), full_scale))
            }
        };
        let blocks = BlockSolver::new(lights, full_scale, choice, (!is_plain).then(|| scales.clone()));
        Self { source, lights, scales, full_scale, mask, method, windows, blocks, scaled_full_scale }
    }

    /// The pixels of `out`; false where something that was read is not finite.
    fn band(&self, pixels: Range<usize>, mut out: NormalMapMut<'_>) -> bool {
        let set_lights = out.set_lights();
        let tasks: Vec<_> = pixels
            .clone()
            .step_by(TASK_PIXELS)
            .map(|first| (first, out.take(TASK_PIXELS.min(pixels.end - first), set_lights)))
            .collect();
        tasks
            .into_par_iter()
            .map_init(|| Scratch::new(self.lights), |scratch, (first, mut out)| self.task(first, &mut out, scratch))
            .reduce(|| true, |a, b| a & b)
    }

    /// The same for one task, of which `first` is the first pixel's number.
    fn task(&self, first: usize, out: &mut NormalMapMut<'_>, scratch: &mut Scratch) -> bool {
        let pixels = first..first + out.albedo.len();
        let mut used = std::mem::take(&mut scratch.pixels);
        used.clear();
        match self.mask {
            None => used.extend(pixels),
            Some(mask) => {
                used.extend(pixels.filter(|&pixel| mask[pixel]));
                out.clear(0..out.albedo.len());
            }
        }
        let (mut finite, careful) = match &self.blocks {
            Some(solver) => {
                let Left { finite, careful } = blocks::run(solver, self.source, &used, first, out);
                scratch.pixels = used;
                (finite, careful)
            }
            None => (true, used),
        };
        for pixel in careful {
            self.pixel(pixel, pixel - first, out, scratch);
            finite &= scratch.values.iter().all(|value| value.is_finite());
        }
        finite
    }

    /// The careful kernel: one pixel in `f64`, written to place `at`.
    fn pixel(&self, pixel: usize, at: usize, out: &mut NormalMapMut<'_>, scratch: &mut Scratch) {
        let lights = self.lights.len();
        self.load(pixel, scratch);
        self.choose(scratch);
        out.lights_kept[at] = scratch.kept.iter().filter(|&&kept| kept).count() as u16;
        if !out.kept_sets.is_empty() {
            out.kept_sets[at * lights..(at + 1) * lights].copy_from_slice(&scratch.kept);
        }
        let facing = |solution: &Solution| {
            let albedo = solution.scaled_normal.norm();
            albedo.is_finite() && albedo > 0.0 && solution.scaled_normal.z > 0.0
        };
        let solution = solve(&scratch.values, &scratch.directions, &scratch.kept).filter(facing);
        let Some(solution) = solution else {
            out.reject(at..at + 1);
            return;
        };
        let scaled = solution.scaled_normal;
        let albedo = scaled.norm();
        let squared_residuals: f64 = (0..lights)
            .filter(|&light| scratch.kept[light])
            .map(|light| (f64::from(scratch.values[light]) - scratch.directions[light].dot(&scaled)).powi(2))
            .sum();
        let normal = scaled / albedo;
        out.normals[at * 3..at * 3 + 3].copy_from_slice(&[normal.x as f32, normal.y as f32, normal.z as f32]);
        out.albedo[at] = (albedo / f64::from(self.full_scale)) as f32;
        out.confidence[at] =
            confidence(&scaled, &solution.inverse, squared_residuals, usize::from(out.lights_kept[at]));
        out.mask[at] = true;
        if let Some(measured) = out.measured.get_mut(at) {
            *measured = true;
        }
    }

    /// The pixel's values in linear grey levels at unit light intensity, its clipped lights, and near lights' directions.
    fn load(&self, pixel: usize, scratch: &mut Scratch) {
        let offset = self.source.offset(pixel);
        let (x_px, y_px) = self.source.centre(pixel);
        for light in 0..self.lights.len() {
            scratch.clipped[light] = self.source.is_clipped(light, pixel);
            scratch.values[light] = (self.source.level(light, pixel) - offset) * self.scales[light];
            if let Lights::Near { .. } = self.lights {
                let (direction, falloff) = self.lights.at(light, x_px, y_px);
                scratch.directions[light] = direction;
                scratch.values[light] /= falloff as f32;
            }
        }
    }

    fn choose(&self, scratch: &mut Scratch) {
        match self.method {
            Method::SpecularFilter { threshold } => {
                let gap = gap(threshold, self.full_scale);
                specular_filter(&scratch.values, gap, &mut scratch.order, &mut scratch.kept);
            }
            Method::RobustFilter => {
                let pixel = robust::Pixel {
                    values: &scratch.values,
                    clipped: &scratch.clipped,
                    directions: &scratch.directions,
                    full_scale: self.scaled_full_scale,
                };
                robust::choose(&self.windows, &pixel, &mut scratch.robust, &mut scratch.kept);
            }
            Method::Lambertian => scratch.kept.fill(true),
        }
    }
}
