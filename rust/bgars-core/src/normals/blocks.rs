//! The fast kernel: blocks of pixels under distant lights.

use multiversion::{multiversion, target::target_cfg_f};

use super::cutoff::cutoffs;
use super::fit::{Equations, Fit, Results};
use super::lanes::{LANES, Lanes};
use super::windows::{Memory, WindowFilter};
use super::{NormalMap, NormalMapMut};
use crate::Lights;
use crate::readings::Readings;

/// Which lights a block keeps.
#[derive(Debug)]
pub(super) enum Choice {
    /// All of them.
    All,
    /// Up to the first gap of the sorted values, in grey levels.
    UpToGap(f32),
    /// The window that a Lambertian facet explains best.
    Window(WindowFilter),
}

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct BlockSolver {
    choice: Choice,
    equations: Equations,
    /// 1 / intensity of each light; `None` where the values of the images are in proportion to light but for an offset: they are
    /// then compared as they are.
    scales: Option<Vec<f32>>,
    /// What values are multiplied by to be about 1: a power of two, which rounds nothing.
    value_scale: f32,
    /// What the albedo is multiplied by then.
    albedo_scale: f32,
}

impl BlockSolver {
    /// `None` where blocks cannot serve; see [`Equations::new`].
    pub fn new(lights: &Lights, full_scale: f32, choice: Choice, scales: Option<Vec<f32>>) -> Option<Self> {
        let value_scale = value_scale(full_scale);
        let albedo_scale = 1.0 / (full_scale * value_scale);
        Some(Self { choice, equations: Equations::new(lights)?, scales, value_scale, albedo_scale })
    }
}

/// The power of two that brings full scale to between 1/2 and 2, or 1 where full scale is a number of grey levels.
pub(super) fn value_scale(full_scale: f32) -> f32 {
    if (1.0..=65_535.0).contains(&full_scale) {
        return 1.0;
    }
    full_scale.log2().floor().clamp(-100.0, 100.0).exp2().recip()
}

/// What the blocks found, and what they leave to others.
pub(super) struct Left {
    /// True where all that was read is finite.
    pub finite: bool,
    /// Pixels for the careful kernel.
    pub careful: Vec<usize>,
}

/// Works on some `pixels` of the image; `out` begins with pixel `first`. Compiled for several instruction sets; one call a task.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq+fma", "x86_64+avx2+fma"))]
pub(super) fn run(
    solver: &BlockSolver,
    source: &dyn Readings,
    pixels: &[usize],
    first: usize,
    out: &mut NormalMapMut<'_>,
) -> Left {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        Work::new(solver, source).run::<true>(pixels, first, out)
    } else {
        Work::new(solver, source).run::<false>(pixels, first, out)
    }
}

/// The memory of a task.
struct Work<'a> {
    solver: &'a BlockSolver,
    source: &'a dyn Readings,
    /// What is compared, grey levels or values.
    levels: Vec<Lanes<f32>>,
    offsets: Lanes<f32>,
    values: Vec<Lanes<f32>>,
    clipped: Vec<Lanes<bool>>,
    windows: Option<Memory>,
    /// 1 for a light that is kept, else 0.
    weights: Vec<Lanes<f32>>,
    keep_all: bool,
    /// Where rounding could decide between two windows.
    close: Lanes<bool>,
    fit: Fit,
    /// Pixels for the careful kernel.
    careful: Lanes<bool>,
}

impl<'a> Work<'a> {
    #[inline(always)]
    fn new(solver: &'a BlockSolver, source: &'a dyn Readings) -> Self {
        let lights = solver.equations.directions.len();
        let windows = match &solver.choice {
            Choice::Window(filter) => Some(Memory::new(filter, lights)),
            _ => None,
        };
        Self {
            solver,
            source,
            levels: vec![Lanes::of(0.0); lights],
            offsets: Lanes::of(0.0),
            values: vec![Lanes::of(0.0); lights],
            clipped: vec![Lanes::of(false); if windows.is_some() { lights } else { 0 }],
            windows,
            weights: vec![Lanes::of(1.0); lights],
            keep_all: true,
            close: Lanes::of(false),
            fit: Fit::ZERO,
            careful: Lanes::of(false),
        }
    }

    #[inline(always)]
    fn run<const FMA: bool>(mut self, pixels: &[usize], first: usize, out: &mut NormalMapMut<'_>) -> Left {
        let (blocks, rest) = pixels.as_chunks::<LANES>();
        let mut left = Left { finite: true, careful: Vec::new() };
        let mut spare = NormalMap::zeros(LANES, out.set_lights());
        for block in blocks {
            self.work::<FMA>(block, LANES, first, out, &mut spare, &mut left);
        }
        if let Some(&last) = rest.last() {
            // The last block is filled up with its last pixel: every pixel is worked by the same kernel, whatever a mask leaves out.
            let mut block = [last; LANES];
            block[..rest.len()].copy_from_slice(rest);
            self.work::<FMA>(&block, rest.len(), first, out, &mut spare, &mut left);
        }
        left
    }

    /// Works on the first `count` pixels of a block.
    #[inline(always)]
    fn work<const FMA: bool>(
        &mut self,
        block: &[usize; LANES],
        count: usize,
        first: usize,
        out: &mut NormalMapMut<'_>,
        spare: &mut NormalMap,
        left: &mut Left,
    ) {
        self.load(block);
        self.choose::<FMA>();
        if self.keep_all {
            self.solver.equations.fit_all::<FMA>(&self.values, &mut self.fit);
        } else {
            self.solver.equations.fit_kept::<FMA>(&self.values, &self.weights, &mut self.fit);
        }
        left.finite &= self.fit.is_finite();
        if count == LANES && block[LANES - 1] - block[0] == LANES - 1 {
            self.write::<FMA>(block[0] - first, out);
        } else {
            self.write::<FMA>(0, &mut spare.as_mut());
            for (lane, pixel) in block[..count].iter().enumerate() {
                out.copy_pixel(pixel - first, spare, lane);
            }
        }
        left.careful.extend((0..count).filter(|&lane| self.careful[lane] || self.close[lane]).map(|lane| block[lane]));
    }

    /// Levels and values of a block.
    #[inline(always)]
    fn load(&mut self, pixels: &[usize; LANES]) {
        if !self.source.has_no_offsets() {
            for lane in 0..LANES {
                self.offsets[lane] = self.source.offset(pixels[lane]);
            }
        }
        let value_scale = self.solver.value_scale;
        for light in 0..self.levels.len() {
            let (level, value) = (&mut self.levels[light], &mut self.values[light]);
            self.source.levels(light, pixels, &mut **level);
            if let Some(scales) = &self.solver.scales {
                for lane in 0..LANES {
                    level[lane] = (level[lane] - self.offsets[lane]) * scales[light];
                    value[lane] = level[lane] * value_scale;
                }
            } else {
                for lane in 0..LANES {
                    value[lane] = (level[lane] - self.offsets[lane]) * value_scale;
                }
            }
        }
        for (light, clipped) in self.clipped.iter_mut().enumerate() {
            self.source.clipped(light, pixels, &mut **clipped);
        }
    }

    /// Chooses the lights of a block.
    #[inline(always)]
    fn choose<const FMA: bool>(&mut self) {
        match &self.solver.choice {
            Choice::All => {}
            Choice::UpToGap(gap) => {
                let cutoffs = cutoffs(&self.levels, *gap);
                self.keep_all = cutoffs.keep_all;
                if !cutoffs.keep_all {
                    for (weight, level) in self.weights.iter_mut().zip(&self.levels) {
                        for lane in 0..LANES {
                            weight[lane] = if level[lane] > cutoffs.largest[lane] { 0.0 } else { 1.0 };
                        }
                    }
                }
            }
            Choice::Window(filter) => {
                let Some(memory) = &mut self.windows else { return };
                let directions = &self.solver.equations.directions;
                self.close = filter.choose::<FMA>(directions, &self.values, &self.clipped, &mut self.weights, memory);
                self.keep_all = false;
            }
        }
    }

    /// Results of a block, from place `at` on.
    #[inline(always)]
    fn write<const FMA: bool>(&mut self, at: usize, out: &mut NormalMapMut<'_>) {
        let (lights, places) = (self.values.len(), at..at + LANES);
        let mask = &mut out.mask[places.clone()];
        if let (Ok(normals), Ok(albedo), Ok(confidence), Ok(mask), Ok(lights_kept)) = (
            (&mut out.normals[3 * at..3 * places.end]).try_into(),
            (&mut out.albedo[places.clone()]).try_into(),
            (&mut out.confidence[places.clone()]).try_into(),
            <&mut [bool; LANES]>::try_from(&mut *mask),
            <&mut [u16; LANES]>::try_from(&mut out.lights_kept[places.clone()]),
        ) {
            let mut results = Results { normals, albedo, confidence, mask };
            self.fit.finish::<FMA>(self.solver.albedo_scale, &mut results, &mut self.careful);
            let mut kept = Lanes::of(lights as u16);
            if !self.keep_all {
                kept = Lanes::of(0);
                for weight in &self.weights {
                    for lane in 0..LANES {
                        kept[lane] += u16::from(weight[lane] > 0.0);
                    }
                }
            }
            *lights_kept = kept.0;
        }
        if let Some(measured) = out.measured.get_mut(places) {
            measured.copy_from_slice(mask);
        }
        let sets = out.kept_sets.chunks_exact_mut(lights).skip(at).take(LANES);
        for (lane, set) in sets.enumerate() {
            for (kept, weight) in set.iter_mut().zip(&self.weights) {
                *kept = self.keep_all || weight[lane] > 0.0;
            }
        }
    }
}
