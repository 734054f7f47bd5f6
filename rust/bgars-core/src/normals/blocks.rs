//! The fast kernel: blocks of pixels under distant lights.

use std::ops::Range;

use multiversion::{multiversion, target::target_cfg_f};

use super::NormalMapMut;
use super::cutoff::cutoffs;
use super::fit::{Equations, Fit, Results};
use super::lanes::{LANES, Lanes};
use super::source::{AsTheyAre, Images, Linearised, Source};
use super::windows::{Memory, WindowFilter};
use crate::{Lights, Pixel};

/// Which lights a block keeps.
#[derive(Debug)]
pub(super) enum Choice {
    /// All of them.
    All,
    /// Up to the first gap of the sorted keys, in grey levels.
    UpToGap(f32),
    /// The window that a Lambertian facet explains best.
    Window(WindowFilter),
}

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct BlockSolver {
    choice: Choice,
    equations: Equations,
    /// What values are multiplied by to be about 1: a power of two, which rounds nothing.
    value_scale: f32,
    /// What the albedo is multiplied by then.
    albedo_scale: f32,
}

impl BlockSolver {
    /// `None` where blocks cannot serve; see [`Equations::new`].
    pub fn new(lights: &Lights, full_scale: f32, choice: Choice) -> Option<Self> {
        let value_scale = value_scale(full_scale);
        let albedo_scale = 1.0 / (full_scale * value_scale);
        Some(Self { choice, equations: Equations::new(lights)?, value_scale, albedo_scale })
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

/// Works on `pixels` of the image, to which `out` belongs.
pub(super) fn run<P: Pixel>(
    solver: &BlockSolver,
    images: &Images<'_, P>,
    mask: Option<&[bool]>,
    pixels: Range<usize>,
    out: &mut NormalMapMut<'_>,
) -> Left {
    if images.radiometry.is_plain() {
        run_blocks::<P>(solver, &AsTheyAre(images), mask, pixels, out)
    } else {
        run_blocks::<f32>(solver, &Linearised(images), mask, pixels, out)
    }
}

/// The hot loop, compiled for several instruction sets; one call a task.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq+fma", "x86_64+avx2+fma"))]
fn run_blocks<K: Pixel>(
    solver: &BlockSolver,
    source: &dyn Source<K>,
    mask: Option<&[bool]>,
    pixels: Range<usize>,
    out: &mut NormalMapMut<'_>,
) -> Left {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        Work::<K>::new(solver, source).run::<true>(mask, pixels, out)
    } else {
        Work::<K>::new(solver, source).run::<false>(mask, pixels, out)
    }
}

/// The memory of a task.
struct Work<'a, K> {
    solver: &'a BlockSolver,
    source: &'a dyn Source<K>,
    keys: Vec<Lanes<K>>,
    values: Vec<Lanes<f32>>,
    clipped: Vec<Lanes<bool>>,
    windows: Option<Memory>,
    /// 1 for a light that is kept, else 0.
    weights: Vec<Lanes<f32>>,
    /// Where rounding could decide between two windows.
    close: Lanes<bool>,
    fit: Fit,
}

impl<'a, K: Pixel> Work<'a, K> {
    #[inline(always)]
    fn new(solver: &'a BlockSolver, source: &'a dyn Source<K>) -> Self {
        let lights = solver.equations.directions.len();
        let windows = match &solver.choice {
            Choice::Window(filter) => Some(Memory::new(filter, lights)),
            _ => None,
        };
        Self {
            solver,
            source,
            keys: vec![Lanes::of(K::ZERO); lights],
            values: vec![Lanes::of(0.0); lights],
            clipped: vec![Lanes::of(false); if windows.is_some() { lights } else { 0 }],
            windows,
            weights: vec![Lanes::of(1.0); lights],
            close: Lanes::of(false),
            fit: Fit::ZERO,
        }
    }

    #[inline(always)]
    fn run<const FMA: bool>(mut self, mask: Option<&[bool]>, pixels: Range<usize>, out: &mut NormalMapMut<'_>) -> Left {
        let mut left = Left { finite: true, careful: Vec::new() };
        let set_lights = out.set_lights();
        let mut out = out.reborrow();
        let end = pixels.end;
        for first in pixels.step_by(LANES) {
            let block = first..end.min(first + LANES);
            let used = mask.map(|mask| &mask[block.clone()]);
            let mut part = out.take(block.len(), set_lights);
            if used.is_some_and(|used| !used.contains(&true)) {
                part.clear(0..block.len());
                continue;
            }
            if block.len() < LANES {
                for (lane, pixel) in block.enumerate() {
                    if used.is_none_or(|used| used[lane]) {
                        left.careful.push(pixel);
                    } else {
                        part.clear(lane..lane + 1);
                    }
                }
                continue;
            }
            self.load(&block);
            let keep_all = self.choose::<FMA>();
            if keep_all {
                self.solver.equations.fit_all::<FMA>(&self.values, &mut self.fit);
            } else {
                self.solver.equations.fit_kept::<FMA>(&self.values, &self.weights, &mut self.fit);
            }
            left.finite &= K::CODES.is_some() || self.fit.is_finite();
            let mut careful = Lanes::of(false);
            self.write::<FMA>(keep_all, &mut part, &mut careful);
            for (lane, _) in used.unwrap_or_default().iter().enumerate().filter(|(_, used)| !**used) {
                part.clear(lane..lane + 1);
                (careful[lane], self.close[lane]) = (false, false);
            }
            self.leave(&block, &careful, &mut left.careful);
        }
        left
    }

    /// Keys and values of a block.
    #[inline(always)]
    fn load(&mut self, block: &Range<usize>) {
        self.source.keys(block, &mut self.keys);
        let (scale, mut offset) = (self.solver.value_scale, Lanes::of(0.0));
        #[allow(clippy::float_cmp)] // 1 or another power of two
        let is_one = scale == 1.0;
        if self.source.offset(block, &mut offset) {
            for (value, key) in self.values.iter_mut().zip(&self.keys) {
                for lane in 0..LANES {
                    value[lane] = (key[lane].to_f32() - offset[lane]) * scale;
                }
            }
        } else {
            for (value, key) in self.values.iter_mut().zip(&self.keys) {
                for lane in 0..LANES {
                    let key = key[lane].to_f32();
                    value[lane] = if is_one { key } else { key * scale };
                }
            }
        }
        self.source.clipped(block, &mut self.clipped);
    }

    /// Chooses the lights of a block; true where every pixel keeps all of them.
    #[inline(always)]
    fn choose<const FMA: bool>(&mut self) -> bool {
        match &self.solver.choice {
            Choice::All => true,
            Choice::UpToGap(gap) => {
                let cutoffs = cutoffs(&self.keys, K::gap(*gap));
                if !cutoffs.keep_all {
                    for (weight, key) in self.weights.iter_mut().zip(&self.keys) {
                        for lane in 0..LANES {
                            let is_over = key[lane].is_over(cutoffs.largest[lane], K::ZERO);
                            weight[lane] = if is_over { 0.0 } else { 1.0 };
                        }
                    }
                }
                cutoffs.keep_all
            }
            Choice::Window(filter) => {
                let Some(memory) = &mut self.windows else { return true };
                let directions = &self.solver.equations.directions;
                self.close = filter.choose::<FMA>(directions, &self.values, &self.clipped, &mut self.weights, memory);
                false
            }
        }
    }

    /// Results of a block.
    #[inline(always)]
    fn write<const FMA: bool>(&self, keep_all: bool, out: &mut NormalMapMut<'_>, careful: &mut Lanes<bool>) {
        let lights = self.values.len();
        if let (Ok(normals), Ok(albedo), Ok(confidence), Ok(mask), Ok(lights_kept)) = (
            (&mut *out.normals).try_into(),
            (&mut *out.albedo).try_into(),
            (&mut *out.confidence).try_into(),
            <&mut [bool; LANES]>::try_from(&mut *out.mask),
            <&mut [u16; LANES]>::try_from(&mut *out.lights_kept),
        ) {
            let mut results = Results { normals, albedo, confidence, mask };
            self.fit.finish::<FMA>(self.solver.albedo_scale, &mut results, careful);
            if let Ok(measured) = (&mut *out.measured).try_into() {
                let measured: &mut [bool; LANES] = measured;
                *measured = *mask;
            }
            let mut kept = Lanes::of(lights as u16);
            if !keep_all {
                kept = Lanes::of(0);
                for weight in &self.weights {
                    for lane in 0..LANES {
                        kept[lane] += u16::from(weight[lane] > 0.0);
                    }
                }
            }
            *lights_kept = kept.0;
        }
        for (lane, set) in out.kept_sets.chunks_exact_mut(lights).enumerate() {
            for (kept, weight) in set.iter_mut().zip(&self.weights) {
                *kept = keep_all || weight[lane] > 0.0;
            }
        }
    }

    /// The pixels that want the careful kernel.
    #[inline(always)]
    fn leave(&self, block: &Range<usize>, careful: &Lanes<bool>, left: &mut Vec<usize>) {
        let mut any = false;
        for lane in 0..LANES {
            any |= careful[lane] | self.close[lane];
        }
        if any {
            for (lane, pixel) in block.clone().enumerate() {
                if careful[lane] || self.close[lane] {
                    left.push(pixel);
                }
            }
        }
    }
}
