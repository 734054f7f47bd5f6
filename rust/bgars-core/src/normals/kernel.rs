//! The loop over pixels: radiometry, choice of lights, least squares.

use std::ops::{BitAnd, ControlFlow, Range};

use nalgebra::Vector3;
use rayon::prelude::*;

use super::confidence::confidence;
use super::cutoff::{LANES, Lanes};
use super::lane_solve::{Choice, LaneSolver};
use super::lanes::{self, Input, Sink};
use super::out::{Out, task_pixels};
use super::robust::{self, RobustFilter, RobustScratch};
use super::robust_lanes::RobustLanes;
use super::solve::{Solution, SubsetSolver};
use super::specular::specular_filter;
use super::{Method, NormalMap, NormalMapMut};
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

/// Pixels between two calls of the progress callback.
const BAND_PIXELS: usize = 1 << 19;

/// The same for the fast kernel.
const LANE_BAND_PIXELS: usize = 1 << 22;

/// Pixels that are looked through for NaN at a time.
const FINITE_BLOCK: usize = 1 << 14;

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

/// [`estimate`] into memory that is there already: on a line that measures one part after the other, this saves the operating
/// system's handing out of fresh pages, which takes as long as the estimate. After an error the content means nothing.
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
    let pixels = stack.pixels();
    let band_pixels = if kernel.lanes.is_some() { LANE_BAND_PIXELS } else { BAND_PIXELS };
    let task_pixels = task_pixels(pixels.min(band_pixels));
    let mut checked = P::CODES.is_some();
    for start in (0..pixels).step_by(band_pixels) {
        let band = start..(start + band_pixels).min(pixels);
        let tasks = Out::split(&mut out, &band, task_pixels);
        let tasks = tasks.into_par_iter().enumerate().map_init(
            || (Scratch::new(lights), Vec::new()),
            |(scratch, memory), (task, mut out)| {
                let first = start + task * task_pixels;
                kernel.task(first..first + out.albedo.len(), &mut out, scratch, memory)
            },
        );
        let finite = tasks.reduce(|| true, BitAnd::bitand);
        if !finite && !checked {
            // Perhaps nothing is wrong inside the mask.
            check_finite(stack, mask)?;
            checked = true;
        }
        if progress(band.end as f64 / pixels as f64).is_break() {
            return Err(Error::Cancelled);
        }
    }
    Ok(())
}

/// A gap in the grey levels of the images from one in grey levels of 255.
fn gap(threshold: f32, full_scale: f32) -> f32 {
    threshold * full_scale / 255.0
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
    Ok(())
}

/// Refuses NaN and infinity in pixels that are to be used.
pub(crate) fn check_finite<P: Pixel>(stack: &ImageStack<'_, P>, mask: Option<&[bool]>) -> Result<()> {
    for image in 0..stack.lights() {
        let plane = stack.plane(image);
        // Nearly always all is well, and that shows quickly.
        let all_finite = |block: &[P]| block.iter().fold(true, |finite, pixel| finite & pixel.to_f32().is_finite());
        if plane.par_chunks(FINITE_BLOCK).all(all_finite) {
            continue;
        }
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
    /// The fast kernel, where it can serve.
    lanes: Option<LaneSolver>,
    /// The images.
    planes: Vec<&'a [P]>,
    /// 1 / intensity of each light.
    scales: Vec<f32>,
    /// Full scale in the unit of the scaled values: its mean over the lights.
    full_scale: f64,
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
        let choice = match method {
            Method::Lambertian => Some(Choice::All),
            Method::SpecularFilter { threshold } => Some(Choice::UpToGap(gap(threshold, radiometry.full_scale))),
            Method::RobustFilter(_) => robust
                .as_ref()
                .and_then(|robust| RobustLanes::new(robust, lights.len(), full_scale))
                .map(Choice::Window),
        };
        let lanes = choice.and_then(|choice| LaneSolver::new(lights, choice));
        let planes = (0..stack.lights()).map(|light| stack.plane(light)).collect();
        Self { stack, lights, radiometry, mask, method, robust, solver, lanes, planes, scales, full_scale }
    }

    /// Works on a range of pixels; true where all that was read is finite.
    fn task(
        &self,
        mut pixels: Range<usize>,
        out: &mut Out<'_>,
        scratch: &mut Scratch,
        memory: &mut Vec<Lanes<P>>,
    ) -> bool {
        let first = pixels.start;
        let mut finite = true;
        let careful = &mut |pixel: usize, out: &mut Out<'_>| self.pixel(pixel, pixel - first, out, scratch);
        if let Some(solver) = &self.lanes {
            let input =
                Input { planes: &self.planes, radiometry: self.radiometry, scales: &self.scales, mask: self.mask };
            finite = lanes::run(solver, &input, pixels.clone(), &mut Sink { out, careful }, memory);
            pixels.start = pixels.end - pixels.len() % LANES;
        }
        for pixel in pixels {
            if self.mask.is_none_or(|mask| mask[pixel]) {
                finite &= P::CODES.is_some() || self.planes.iter().all(|plane| plane[pixel].to_f32().is_finite());
                careful(pixel, out);
            } else {
                out.clear(pixel - first..pixel - first + 1);
            }
        }
        finite
    }

    /// The careful kernel: one pixel in `f64`, written to place `at`.
    fn pixel(&self, pixel: usize, at: usize, out: &mut Out<'_>, scratch: &mut Scratch) {
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
        let solution = self.solver.solve(&scratch.values, &scratch.directions, &scratch.kept).filter(facing);
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
        out.albedo[at] = (albedo / f64::from(self.radiometry.full_scale)) as f32;
        out.confidence[at] =
            confidence(&scaled, &solution.inverse, squared_residuals, usize::from(out.lights_kept[at]));
        out.mask[at] = true;
        out.measured[at] = true;
    }

    /// The pixel's values in linear grey levels at unit light intensity, its clipped lights, and near lights' directions.
    fn load(&self, pixel: usize, scratch: &mut Scratch) {
        let offset = self.radiometry.offset(pixel);
        for light in 0..self.stack.lights() {
            let code = self.planes[light][pixel];
            scratch.clipped[light] = code.to_f32() >= self.radiometry.saturation;
            scratch.values[light] = (self.radiometry.linearise(code) - offset) * self.scales[light];
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
                let gap = gap(threshold, self.radiometry.full_scale);
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
