//! The loop over pixels: radiometry, choice of lights, least squares.

use std::ops::{ControlFlow, Range};

use nalgebra::Vector3;
use rayon::prelude::*;

use super::checks::{check, check_finite};
use super::confidence::confidence;
use super::cutoff::LANES;
use super::lane_solve::{Choice, LaneSolver};
use super::lanes::{self, Input, Left};
use super::out::{Out, task_pixels};
use super::overview::Brought;
use super::robust::{self, RobustFilter, RobustScratch};
use super::robust_lanes::RobustLanes;
use super::solve::{Solution, SubsetSolver};
use super::specular::specular_filter;
use super::{Method, NormalMap, NormalMapMut, own_scale};
use crate::{Error, ImageStack, Lights, Pixel, Radiometry, Result};

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
/// From a megapixel on, AVX-512 writes past the caches what begins on a cache line (64 bytes), which takes two thirds of the time
/// or less; most allocators do not lay a `Vec` so.
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
    out: NormalMapMut<'_>,
) -> Result<()> {
    check(stack, lights, radiometry, mask, method)?;
    out.check(stack.pixels(), stack.lights())?;
    let out = Out::of(out);
    if own_scale::serves(stack, radiometry, mask, method) {
        let draft = Kernel::new(stack, lights, radiometry, own_scale::sampled(stack), mask, method);
        if draft.lanes.is_some() {
            return own_scale::estimate(draft, out, progress);
        }
    }
    let kernel = Kernel::new(stack, lights, radiometry, radiometry.full_scale_of(stack), mask, method);
    let mut checked = P::CODES.is_some();
    let work = |(first, out): &mut (usize, Out<'_>), scratch: &mut Scratch<P>| {
        let left = kernel.lanes(*first, out, scratch);
        kernel.rest(*first, &left, out, scratch);
        left.finite
    };
    kernel.in_bands(&mut kernel.tasks(out), &work, &mut |finite, done| {
        if !checked && finite.contains(&false) {
            // Perhaps nothing is wrong inside the mask.
            check_finite(stack, mask)?;
            checked = true;
        }
        if progress(done).is_break() { Err(Error::Cancelled) } else { Ok(()) }
    })
}

/// A gap in the grey levels of the images from one in grey levels of 255.
pub(super) fn gap(threshold: f32, full_scale: f32) -> f32 {
    threshold * full_scale / 255.0
}

/// Everything a pixel's work reads.
pub(super) struct Kernel<'a, P> {
    pub stack: &'a ImageStack<'a, P>,
    pub lights: &'a Lights,
    pub radiometry: &'a Radiometry<'a, P>,
    /// In grey levels.
    pub full_scale: f32,
    mask: Option<&'a [bool]>,
    pub method: Method,
    /// Whether `full_scale` is not known yet, only that it is not less: the albedo stays in grey levels.
    pub is_draft: bool,
    robust: Option<RobustFilter>,
    solver: SubsetSolver,
    /// The fast kernel, where it can serve.
    lanes: Option<LaneSolver>,
    /// The images.
    planes: Vec<&'a [P]>,
    /// 1 / intensity of each light.
    scales: Vec<f32>,
    /// Full scale in the unit of the scaled values: its mean over the lights.
    scaled_full_scale: f64,
}

/// Memory of one thread, reused from pixel to pixel.
pub(super) struct Scratch<P> {
    /// Images that are brought together.
    memory: Vec<Brought<P>>,
    values: Vec<f32>,
    clipped: Vec<bool>,
    kept: Vec<bool>,
    directions: Vec<Vector3<f64>>,
    order: Vec<usize>,
    robust: RobustScratch,
}

impl<P> Scratch<P> {
    fn new(lights: &Lights) -> Self {
        let count = lights.len();
        Self {
            memory: Vec::new(),
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
    pub fn new(
        stack: &'a ImageStack<'a, P>,
        lights: &'a Lights,
        radiometry: &'a Radiometry<'a, P>,
        full_scale: f32,
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
        let scaled_full_scale = f64::from(full_scale) * mean_scale;
        let choice = match method {
            Method::Lambertian => Some(Choice::All),
            Method::SpecularFilter { threshold } => Some(Choice::UpToGap(gap(threshold, full_scale))),
            Method::RobustFilter(_) => robust
                .as_ref()
                .and_then(|robust| RobustLanes::new(robust, lights.len(), scaled_full_scale))
                .map(Choice::Window),
        };
        let lanes = choice.and_then(|choice| LaneSolver::new(lights, choice));
        let planes = (0..stack.lights()).map(|light| stack.plane(light)).collect();
        Self {
            stack,
            lights,
            radiometry,
            full_scale,
            mask,
            method,
            is_draft: false,
            robust,
            solver,
            lanes,
            planes,
            scales,
            scaled_full_scale,
        }
    }

    /// The result as tasks, by their first pixel.
    pub fn tasks<'o>(&self, out: Out<'o>) -> Vec<(usize, Out<'o>)> {
        let task_pixels = task_pixels(self.stack.pixels().min(self.band_pixels()), self.stack.lights());
        (0..).step_by(task_pixels).zip(out.split(task_pixels)).collect()
    }

    /// Works on tasks in parallel, band by band; `done` gets what a band gave and the fraction done, and can end it all.
    pub fn in_bands<T: Send, R: Send>(
        &self,
        tasks: &mut [T],
        work: &(impl Fn(&mut T, &mut Scratch<P>) -> R + Sync),
        done: &mut dyn FnMut(Vec<R>, f64) -> Result<()>,
    ) -> Result<()> {
        let bands = self.stack.pixels().div_ceil(self.band_pixels());
        let (count, mut begun) = (tasks.len(), 0);
        for tasks in tasks.chunks_mut(count.div_ceil(bands)) {
            begun += tasks.len();
            let tasks = tasks.par_iter_mut();
            let given = tasks.map_init(|| Scratch::new(self.lights), |scratch, task| work(task, scratch)).collect();
            done(given, begun as f64 / count as f64)?;
        }
        Ok(())
    }

    /// Pixels between two calls of the progress callback.
    fn band_pixels(&self) -> usize {
        /// Of the careful kernel.
        const CAREFUL: usize = 1 << 19;
        /// Of the fast one.
        const LANES: usize = 1 << 22;
        if self.lanes.is_some() { LANES } else { CAREFUL }
    }

    /// The fast kernel on the pixels of `out`, of which `first` is the first one's number.
    pub fn lanes(&self, first: usize, out: &mut Out<'_>, scratch: &mut Scratch<P>) -> Left {
        let pixels = first..first + out.albedo.len();
        let mut left = Left::nothing();
        if let Some(solver) = &self.lanes {
            let input = Input {
                planes: &self.planes,
                radiometry: self.radiometry,
                scales: &self.scales,
                mask: self.mask,
                per_full_scale: if self.is_draft { 1.0 } else { 1.0 / self.full_scale },
                is_draft: self.is_draft,
            };
            left = lanes::run(solver, &input, pixels.clone(), out, &mut scratch.memory);
        }
        if P::CODES.is_none() {
            for pixel in self.behind_the_lanes(pixels).filter(|&pixel| self.uses(pixel)) {
                for value in self.planes.iter().map(|plane| plane[pixel].to_f32()) {
                    left.finite &= value.is_finite();
                    left.largest = left.largest.max(value);
                }
            }
        }
        left
    }

    /// What the fast kernel has left, by the careful one.
    pub fn rest(&self, first: usize, left: &Left, out: &mut Out<'_>, scratch: &mut Scratch<P>) {
        for pixel in left.careful_pixels().filter(|&pixel| self.uses(pixel)) {
            self.pixel(pixel, pixel - first, out, scratch);
        }
        for pixel in self.behind_the_lanes(first..first + out.albedo.len()) {
            if self.uses(pixel) {
                self.pixel(pixel, pixel - first, out, scratch);
            } else {
                out.clear(pixel - first..pixel - first + 1);
            }
        }
    }

    /// The pixels behind the last whole block; all of them where the fast kernel does not serve.
    fn behind_the_lanes(&self, pixels: Range<usize>) -> Range<usize> {
        let count = if self.lanes.is_some() { pixels.len() % LANES } else { pixels.len() };
        pixels.end - count..pixels.end
    }

    fn uses(&self, pixel: usize) -> bool {
        self.mask.is_none_or(|mask| mask[pixel])
    }

    /// The careful kernel: one pixel in `f64`, written to place `at`.
    fn pixel(&self, pixel: usize, at: usize, out: &mut Out<'_>, scratch: &mut Scratch<P>) {
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
        out.albedo[at] = (albedo / f64::from(self.full_scale)) as f32;
        out.confidence[at] =
            confidence(&scaled, &solution.inverse, squared_residuals, usize::from(out.lights_kept[at]));
        out.mask[at] = true;
        if let Some(measured) = out.measured.get_mut(at) {
            *measured = true;
        }
    }

    /// The pixel's values in linear grey levels at unit light intensity, its clipped lights, and near lights' directions.
    fn load(&self, pixel: usize, scratch: &mut Scratch<P>) {
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

    fn choose(&self, scratch: &mut Scratch<P>) {
        match (self.method, &self.robust) {
            (Method::SpecularFilter { threshold }, _) => {
                let gap = gap(threshold, self.full_scale);
                specular_filter(&scratch.values, gap, &mut scratch.order, &mut scratch.kept);
            }
            (Method::RobustFilter(_), Some(filter)) => {
                let pixel = robust::Pixel {
                    values: &scratch.values,
                    clipped: &scratch.clipped,
                    directions: &scratch.directions,
                    full_scale: self.scaled_full_scale,
                };
                filter.choose(&pixel, &self.solver, &mut scratch.robust, &mut scratch.kept);
            }
            _ => scratch.kept.fill(true),
        }
    }
}
