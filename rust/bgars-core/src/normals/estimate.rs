//! The loop over pixels: radiometry, choice of lights, least squares.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use rayon::prelude::*;

use super::blocks::{self, BlockSolver, Choice, Left, value_scale};
use super::checks::{check, check_finite};
use super::confidence::confidence;
use super::lanes::LANES;
use super::robust::{self, RobustFilter, RobustScratch};
use super::solve::{Solution, solve};
use super::source::Images;
use super::specular::specular_filter;
use super::windows::WindowFilter;
use super::{Method, NormalMap, NormalMapMut};
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

/// Pixels of one task. What comes out is the same for any number.
const TASK_PIXELS: usize = 1 << 13;

/// Tasks with one pixel in so many to estimate, or fewer, have these gathered.
const SPARSE: usize = 4;

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
    check(stack, lights, radiometry, mask, method)?;
    out.check(stack.pixels(), stack.lights())?;
    let kernel = Kernel::new(stack, lights, radiometry, mask, method);
    let mut checked = P::CODES.is_some();
    let set_lights = out.set_lights();
    for first in (0..stack.pixels()).step_by(BAND_PIXELS) {
        let end = stack.pixels().min(first + BAND_PIXELS);
        let tasks: Vec<_> = (first..end)
            .step_by(TASK_PIXELS)
            .map(|first| (first, out.take(TASK_PIXELS.min(end - first), set_lights)))
            .collect();
        let finite = tasks
            .into_par_iter()
            .map_init(|| Scratch::new(lights), |scratch, (first, mut out)| kernel.task(first, &mut out, scratch))
            .reduce(|| true, |a, b| a & b);
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
struct Kernel<'a, P> {
    stack: &'a ImageStack<'a, P>,
    lights: &'a Lights,
    images: Images<'a, P>,
    /// In grey levels.
    full_scale: f32,
    mask: Option<&'a [bool]>,
    method: Method,
    robust: Option<RobustFilter>,
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
        let robust = (method == Method::RobustFilter).then(|| RobustFilter::new(lights.len()));
        let full_scale = radiometry.full_scale_of(stack);
        let scales: Vec<f32> = radiometry.intensities.iter().map(|intensity| (1.0 / intensity) as f32).collect();
        let mean_scale = scales.iter().map(|&scale| f64::from(scale)).sum::<f64>() / scales.len() as f64;
        let scaled_full_scale = f64::from(full_scale) * mean_scale;
        let choice = match (method, &robust) {
            (Method::SpecularFilter { threshold }, _) => Choice::UpToGap(gap(threshold, full_scale)),
            (_, Some(robust)) => {
                let full_scale = scaled_full_scale * f64::from(value_scale(full_scale));
                Choice::Window(WindowFilter::new(robust, lights.len(), full_scale))
            }
            _ => Choice::All,
        };
        let blocks = BlockSolver::new(lights, full_scale, choice);
        let planes = (0..stack.lights()).map(|light| stack.plane(light)).collect();
        let images = Images { planes, radiometry, scales };
        Self { stack, lights, images, full_scale, mask, method, robust, blocks, scaled_full_scale }
    }

    /// The pixels of `out`, of which `first` is the first one's number; false where something that was read is not finite.
    fn task(&self, first: usize, out: &mut NormalMapMut<'_>, scratch: &mut Scratch) -> bool {
        let pixels = first..first + out.albedo.len();
        if let Some(solver) = &self.blocks {
            let used: Vec<usize> = pixels.clone().filter(|&pixel| self.mask.is_some_and(|mask| mask[pixel])).collect();
            if self.mask.is_some() && SPARSE * used.len() <= pixels.len() {
                return self.few(solver, first, used, out, scratch);
            }
            let Left { mut finite, careful } = blocks::run(solver, &self.images, self.mask, pixels, out);
            for pixel in careful {
                self.pixel(pixel, pixel - first, out, scratch);
                finite &= scratch.values.iter().all(|value| value.is_finite());
            }
            return finite;
        }
        let mut finite = true;
        for pixel in pixels {
            if self.uses(pixel) {
                self.pixel(pixel, pixel - first, out, scratch);
                finite &= scratch.values.iter().all(|value| value.is_finite());
            } else {
                out.clear(pixel - first..pixel - first + 1);
            }
        }
        finite
    }

    /// Few pixels of a task: gathered, so that no block is worked on for the sake of one of them.
    fn few(
        &self,
        solver: &BlockSolver,
        first: usize,
        mut used: Vec<usize>,
        out: &mut NormalMapMut<'_>,
        scratch: &mut Scratch,
    ) -> bool {
        out.clear(0..out.albedo.len());
        let Some(&last) = used.last() else { return true };
        used.resize(used.len().next_multiple_of(LANES), last);
        let gather = |plane: &[P]| -> Vec<P> { used.iter().map(|&pixel| plane[pixel]).collect() };
        let planes: Vec<Vec<P>> = self.images.planes.iter().map(|plane| gather(plane)).collect();
        let dark = self.images.radiometry.dark.map(gather);
        let radiometry = Radiometry { dark: dark.as_deref(), ..self.images.radiometry.clone() };
        let images = Images {
            planes: planes.iter().map(Vec::as_slice).collect(),
            radiometry: &radiometry,
            scales: self.images.scales.clone(),
        };
        let mut map = NormalMap::zeros(used.len(), out.set_lights());
        let Left { finite, careful } = blocks::run(solver, &images, None, 0..used.len(), &mut map.as_mut());
        for (index, &pixel) in used.iter().enumerate() {
            out.copy_pixel(pixel - first, &map, index);
        }
        for index in careful {
            self.pixel(used[index], used[index] - first, out, scratch);
        }
        finite
    }

    fn uses(&self, pixel: usize) -> bool {
        self.mask.is_none_or(|mask| mask[pixel])
    }

    /// The careful kernel: one pixel in `f64`, written to place `at`.
    fn pixel(&self, pixel: usize, at: usize, out: &mut NormalMapMut<'_>, scratch: &mut Scratch) {
        let lights = self.stack.lights();
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
        let offset = self.images.radiometry.offset(pixel);
        for light in 0..self.stack.lights() {
            let code = self.images.planes[light][pixel];
            scratch.clipped[light] = code.to_f32() >= self.images.radiometry.saturation;
            scratch.values[light] = (self.images.radiometry.linearise(code) - offset) * self.images.scales[light];
        }
        if let Lights::Near { .. } = self.lights {
            let (row, col) = (pixel / self.stack.width(), pixel % self.stack.width());
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
                let gap = gap(threshold, self.full_scale);
                specular_filter(&scratch.values, gap, &mut scratch.order, &mut scratch.kept);
            }
            (Method::RobustFilter, Some(filter)) => {
                let pixel = robust::Pixel {
                    values: &scratch.values,
                    clipped: &scratch.clipped,
                    directions: &scratch.directions,
                    full_scale: self.scaled_full_scale,
                };
                filter.choose(&pixel, &mut scratch.robust, &mut scratch.kept);
            }
            _ => scratch.kept.fill(true),
        }
    }
}
