//! The fast kernel: blocks of 64 pixels, for distant lights.
//!
//! Plain loops over the lanes of a block, which the compiler turns into the vector instructions of the processor it runs on.

use std::ops::Range;

use bytemuck::NoUninit;
use multiversion::multiversion;

use super::cutoff::{LANES, Lanes};
use super::finish::Finished;
use super::gather::{are_crowded, bring, stretch_blocks};
use super::kept::Kept;
use super::lane_solve::{BYTE_LIGHTS, Careful, Choice, LaneSolver, Readings, solve};
use super::out::{Block, Out};
#[cfg(target_arch = "x86_64")]
use crate::vector::{Avx2, Avx512, Pair};
use crate::vector::{Portable, Vector};
use crate::{Pixel, Radiometry, stream};

/// What every block reads.
pub(super) struct Input<'a, P> {
    /// The images.
    pub planes: &'a [&'a [P]],
    pub radiometry: &'a Radiometry<'a, P>,
    /// 1 / intensity of each light.
    pub scales: &'a [f32],
    pub mask: Option<&'a [bool]>,
}

/// What every block writes to, and who does what the lanes leave over.
pub(super) struct Sink<'a, 'b> {
    /// The pixels of the task alone.
    pub out: &'a mut Out<'b>,
    /// Called with a pixel of the image; must write all of it.
    pub careful: &'a mut dyn FnMut(usize, &mut Out<'b>),
}

/// Where the keys of a block come from.
enum Source<'a, K> {
    /// The images as they are, and where they are brought together if they crowd.
    Images(&'a [&'a [K]], &'a mut Vec<Lanes<K>>),
    /// Computed from them.
    Made(&'a Make<'a, K>),
}

/// Computes the keys of a block.
type Make<'a, K> = dyn Fn(&Range<usize>, &mut [Lanes<K>]) + 'a;

/// What is to be subtracted from the keys of a block.
type Offsets<'a> = dyn Fn(&Range<usize>, &mut Lanes<f32>) + 'a;

/// Marks the clipped lights of a block, a bit a light.
type Clips<'a> = dyn Fn(&Range<usize>, &mut Lanes<u8>) + 'a;

/// What is asked beside the keys.
#[derive(Clone, Copy)]
struct Common<'a> {
    mask: Option<&'a [bool]>,
    full_scale: f32,
    /// `None` where nothing is subtracted.
    offsets: Option<&'a Offsets<'a>>,
    /// `None` where clipped lights are as good as others.
    clips: Option<&'a Clips<'a>>,
}

/// Works on the blocks of `pixels` (of the whole image); the pixels behind the last whole one are left. True where all that
/// was read is finite.
#[allow(clippy::float_cmp)] // intensities that are 1 by default
pub(super) fn run<P: Pixel>(
    solver: &LaneSolver,
    input: &Input<'_, P>,
    pixels: Range<usize>,
    sink: &mut Sink<'_, '_>,
    memory: &mut Vec<Lanes<P>>,
) -> bool {
    let Input { planes, radiometry, scales, mask } = *input;
    let plain = radiometry.response.is_none() && scales.iter().all(|&scale| scale == 1.0);
    let has_offsets = radiometry.dark.is_some() || radiometry.black_level != 0.0;
    let load_offsets = |block: &Range<usize>, offsets: &mut Lanes<f32>| {
        for (offset, pixel) in offsets.iter_mut().zip(block.clone()) {
            *offset = radiometry.offset(pixel);
        }
    };
    let mark_clipped = |block: &Range<usize>, clipped: &mut Lanes<u8>| {
        *clipped = [0; LANES];
        for (light, plane) in planes.iter().enumerate() {
            for (clipped, code) in clipped.iter_mut().zip(&plane[block.clone()]) {
                *clipped |= u8::from(code.to_f32() >= radiometry.saturation) << light;
            }
        }
    };
    let clips: Option<&Clips<'_>> = if let Choice::Window(_) = solver.choice { Some(&mark_clipped) } else { None };
    let offsets: Option<&Offsets<'_>> = if plain && has_offsets { Some(&load_offsets) } else { None };
    let common = Common { mask, full_scale: radiometry.full_scale, offsets, clips };
    if plain {
        run_blocks(solver, &mut Source::Images(planes, memory), common, pixels, sink)
    } else {
        let make = |block: &Range<usize>, keys: &mut [Lanes<f32>]| {
            let mut offsets = [0.0; LANES];
            load_offsets(block, &mut offsets);
            for ((key, plane), &scale) in keys.iter_mut().zip(planes).zip(scales) {
                for ((key, &code), &offset) in key.iter_mut().zip(&plane[block.clone()]).zip(&offsets) {
                    *key = (radiometry.linearise(code) - offset) * scale;
                }
            }
        };
        run_blocks(solver, &mut Source::Made(&make), common, pixels, sink)
    }
}

/// The hot loop, compiled for several instruction sets; one call a task.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq+fma", "x86_64+avx2+fma"))]
fn run_blocks<K: Pixel>(
    solver: &LaneSolver,
    source: &mut Source<'_, K>,
    common: Common<'_>,
    pixels: Range<usize>,
    sink: &mut Sink<'_, '_>,
) -> bool {
    #[cfg(target_arch = "x86_64")]
    {
        if multiversion::target::target_cfg_f!(target_feature = "avx512f") {
            return run_with::<K, Pair<Avx512>>(solver, source, common, pixels, sink);
        }
        if multiversion::target::target_cfg_f!(target_feature = "avx2") {
            return run_with::<K, Pair<Avx2>>(solver, source, common, pixels, sink);
        }
    }
    run_with::<K, Portable>(solver, source, common, pixels, sink)
}

#[inline(always)]
fn run_with<K: Pixel, V: Vector>(
    solver: &LaneSolver,
    source: &mut Source<'_, K>,
    common: Common<'_>,
    pixels: Range<usize>,
    sink: &mut Sink<'_, '_>,
) -> bool {
    sink.out.streamed &= V::STREAMS;
    let (blocks, sets) = sink.out.blocks();
    let mut task = Task::new(solver, common, pixels.start, sets);
    match source {
        Source::Images(planes, memory) => {
            if let Ok(planes) = <&[&[K]; BYTE_LIGHTS]>::try_from(*planes) {
                // Compiled for eight lights once more: loops over lights are written out then, and bounds are not asked for.
                let [a, b, c, d, e, f, g, h] = planes.map(|plane| blocks_of(plane, &pixels));
                let keys = a.iter().zip(b).zip(c).zip(d).zip(e).zip(f).zip(g).zip(h);
                for (number, (out, (((((((a, b), c), d), e), f), g), h))) in blocks.zip(keys).enumerate() {
                    let keys = [a, b, c, d, e, f, g, h];
                    task.block::<V>(number, &keys, &keys, out);
                }
            } else {
                run_images::<K, V>(&mut task, planes, &pixels, blocks, memory);
            }
        }
        Source::Made(make) => {
            let mut made = vec![[K::ZERO; LANES]; solver.lights()];
            for (number, out) in blocks.enumerate() {
                make(&task.pixels(number), &mut made);
                task.block::<V>(number, &made.iter().collect::<Vec<_>>(), &[], out);
            }
        }
    }
    let Task { careful, finite, .. } = task;
    if sink.out.streamed {
        stream::finish();
    }
    for (first, lanes) in careful {
        for pixel in (first..first + LANES).filter(|pixel| lanes >> (pixel - first) & 1 == 1) {
            if common.mask.is_none_or(|mask| mask[pixel]) {
                (sink.careful)(pixel, sink.out);
            }
        }
    }
    finite
}

/// Works on the blocks of any number of images.
#[inline(always)]
fn run_images<'a, K: Pixel, V: Vector>(
    task: &mut Task<'_, K>,
    planes: &[&[K]],
    pixels: &Range<usize>,
    mut blocks: impl Iterator<Item = Block<'a>>,
    memory: &mut Vec<Lanes<K>>,
) {
    let images: Vec<&[Lanes<K>]> = planes.iter().map(|plane| blocks_of(plane, pixels)).collect();
    let (count, crowded) = (pixels.len() / LANES, are_crowded(planes));
    let at_once = if crowded { stretch_blocks::<K>(images.len()) } else { count.max(1) };
    for first in (0..count).step_by(at_once) {
        let stretch = first..count.min(first + at_once);
        let images = if crowded && task.uses(&stretch) {
            bring(&images, &stretch, memory)
        } else {
            images.iter().map(|blocks| &blocks[stretch.clone()]).collect()
        };
        let mut keys = Vec::with_capacity(images.len());
        for (at, out) in (0..stretch.len()).zip(blocks.by_ref()) {
            keys.clear();
            keys.extend(images.iter().map(|blocks| &blocks[at]));
            // What is brought has no successors.
            let ahead = if crowded { &[][..] } else { &keys };
            task.block::<V>(first + at, &keys, ahead, out);
        }
    }
}

/// The whole blocks of some pixels.
fn blocks_of<'a, K>(plane: &'a [K], pixels: &Range<usize>) -> &'a [Lanes<K>] {
    plane[pixels.clone()].as_chunks().0
}

/// What the blocks of a task share.
struct Task<'a, K> {
    solver: &'a LaneSolver,
    common: Common<'a>,
    first_pixel: usize,
    per_full_scale: f32,
    all_lights: Lanes<u16>,
    offset: Lanes<f32>,
    clipped: Lanes<u8>,
    kept: Kept<K>,
    finished: Finished,
    /// The kept lights of all pixels, or none.
    sets: &'a mut [bool],
    /// True while no value was NaN or infinite.
    finite: bool,
    /// Blocks that leave pixels to the careful kernel, by their first pixel, and which.
    careful: Vec<(usize, Careful)>,
}

impl<'a, K: Pixel> Task<'a, K> {
    fn new(solver: &'a LaneSolver, common: Common<'a>, first_pixel: usize, sets: &'a mut [bool]) -> Self {
        Self {
            solver,
            common,
            first_pixel,
            per_full_scale: 1.0 / common.full_scale,
            all_lights: [solver.lights() as u16; LANES],
            offset: [0.0; LANES],
            clipped: [0; LANES],
            kept: Kept::new(solver.lights()),
            finished: Finished::new(),
            sets,
            finite: true,
            careful: Vec::new(),
        }
    }

    /// The pixels of a block.
    fn pixels(&self, number: usize) -> Range<usize> {
        let first = self.first_pixel + number * LANES;
        first..first + LANES
    }

    /// True where some pixel of a stretch of blocks is asked for.
    fn uses(&self, stretch: &Range<usize>) -> bool {
        let pixels = self.pixels(stretch.start).start..self.pixels(stretch.end).start;
        self.common.mask.is_none_or(|mask| mask[pixels].contains(&true))
    }

    /// Works on a block.
    #[inline(always)]
    fn block<V: Vector>(&mut self, number: usize, keys: &[&Lanes<K>], ahead: &[&Lanes<K>], mut out: Block<'_>) {
        let pixels = self.pixels(number);
        let used = self.common.mask.map(|mask| &mask[pixels.clone()]);
        // A block that is all in, or all out, needs no look at its pixels.
        let count = used.map_or(LANES, |used| used.iter().map(|&used| usize::from(used)).sum());
        let sets = if self.sets.is_empty() {
            &mut []
        } else {
            &mut self.sets[number * LANES * keys.len()..][..LANES * keys.len()]
        };
        if count == 0 {
            out.clear(0..LANES);
            sets.fill(false);
            return;
        }
        let used = used.filter(|_| count < LANES);
        if K::CODES.is_none() {
            self.finite &= are_finite::<K, V>(keys);
        }
        if let Some(load) = self.common.offsets {
            load(&pixels, &mut self.offset);
        }
        if let Some(mark) = self.common.clips {
            mark(&pixels, &mut self.clipped);
        }
        let offset = self.common.offsets.map(|_| &self.offset);
        let readings = Readings { keys, ahead, clipped: &self.clipped, offset };
        solve::<K, V>(self.solver, &readings, &mut self.kept, self.per_full_scale, &mut self.finished, &mut out);
        write(&self.finished, &self.all_lights, used, &mut out);
        if !sets.is_empty() {
            write_sets(&self.kept, used, sets);
        }
        if self.finished.careful != 0 {
            self.careful.push((pixels.start, self.finished.careful));
        }
    }
}

/// False where a value is NaN or infinite. Asked here, where the values are at hand: a search of its own reads the images twice.
#[inline(always)]
fn are_finite<K: Pixel, V: Vector>(keys: &[&Lanes<K>]) -> bool {
    let zero = V::splat(0.0);
    let mut sums = zero;
    for key in keys {
        for step in 0..LANES / V::WIDTH {
            // 0 times something finite is 0, else NaN.
            sums = K::load::<V>(&key[step * V::WIDTH..]).times_plus(zero, sums);
        }
    }
    V::all(sums.is_over(V::splat(-1.0)))
}

/// Mask and counts of a block, and what its unused pixels say.
#[inline(always)]
fn write(finished: &Finished, all_lights: &Lanes<u16>, used: Option<&[bool]>, out: &mut Block<'_>) {
    static ALL_VALID: Lanes<bool> = [true; LANES];
    let spread;
    // Nearly always all of them, and then nothing has to be spread.
    let valid = if finished.valid == u64::MAX {
        &ALL_VALID
    } else {
        spread = std::array::from_fn(|lane| finished.valid >> lane & 1 == 1);
        &spread
    };
    let kept = if finished.keep_all { all_lights } else { &finished.kept };
    store(kept, out.lights_kept, out.streamed);
    store(valid, out.mask, out.streamed);
    store(valid, out.measured, out.streamed);
    if let Some(used) = used {
        for (lane, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
            out.clear(lane..lane + 1);
        }
    }
}

/// Copies a block, past the caches if they say so.
#[inline(always)]
fn store<T: NoUninit, const N: usize>(block: &[T; N], out: &mut [T; N], streamed: bool) {
    if streamed {
        stream::copy(block, out);
    } else {
        *out = *block;
    }
}

/// The kept lights themselves; asked for seldom.
#[inline(never)]
fn write_sets<K: Pixel>(kept: &Kept<K>, used: Option<&[bool]>, sets: &mut [bool]) {
    let lights = kept.keys.len();
    for (lane, sets) in sets.chunks_exact_mut(lights).enumerate() {
        let here = used.is_none_or(|used| used[lane]);
        for (light, set) in sets.iter_mut().enumerate() {
            *set = here && kept.holds(light, lane);
        }
    }
}
