//! The fast kernel: blocks of 64 pixels, for distant lights.
//!
//! Plain loops over the lanes of a block, which the compiler turns into the vector instructions of the processor it runs on.

use std::ops::Range;

use bytemuck::NoUninit;
use multiversion::multiversion;

use super::cutoff::{LANES, Lanes};
use super::finish::{Finished, Spare};
use super::kept::Kept;
use super::lane_solve::{BYTE_LIGHTS, Choice, LaneSolver, Readings, solve};
use super::out::Out;
#[cfg(target_arch = "x86_64")]
use crate::vector::{Avx2, Avx512, Pair};
use crate::vector::{Portable, Vector};
use crate::{Pixel, Radiometry, stream};

/// How far ahead the images are fetched: as many streams as lights are more than processors follow by themselves.
const BLOCKS_AHEAD: usize = 16;

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
    /// The images as they are.
    Images(&'a [&'a [K]]),
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
    /// `None` where clipped lights are as good as others.
    clips: Option<&'a Clips<'a>>,
}

/// Works on `pixels` (of the whole image).
#[allow(clippy::float_cmp)] // intensities that are 1 by default
pub(super) fn run<P: Pixel>(solver: &LaneSolver, input: &Input<'_, P>, pixels: Range<usize>, sink: &mut Sink<'_, '_>) {
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
    let common = Common { mask, full_scale: radiometry.full_scale, clips };
    if plain {
        let offsets: Option<&Offsets<'_>> = if has_offsets { Some(&load_offsets) } else { None };
        run_blocks(solver, &Source::Images(planes), offsets, common, pixels, sink);
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
        run_blocks(solver, &Source::Made(&make), None, common, pixels, sink);
    }
}

/// The hot loop, compiled for several instruction sets; one call a task.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq+fma", "x86_64+avx2+fma"))]
fn run_blocks<K: Pixel>(
    solver: &LaneSolver,
    source: &Source<'_, K>,
    offsets: Option<&Offsets<'_>>,
    common: Common<'_>,
    pixels: Range<usize>,
    sink: &mut Sink<'_, '_>,
) {
    #[cfg(target_arch = "x86_64")]
    {
        if multiversion::target::target_cfg_f!(target_feature = "avx512f") {
            return run_lights::<K, Pair<Avx512>>(solver, source, offsets, common, pixels, sink);
        }
        if multiversion::target::target_cfg_f!(target_feature = "avx2") {
            return run_lights::<K, Pair<Avx2>>(solver, source, offsets, common, pixels, sink);
        }
    }
    run_lights::<K, Portable>(solver, source, offsets, common, pixels, sink);
}

/// Compiled for eight lights once more: loops over lights are written out then.
#[inline(always)]
fn run_lights<K: Pixel, V: Vector>(
    solver: &LaneSolver,
    source: &Source<'_, K>,
    offsets: Option<&Offsets<'_>>,
    common: Common<'_>,
    pixels: Range<usize>,
    sink: &mut Sink<'_, '_>,
) {
    if solver.lights() == BYTE_LIGHTS {
        run_blocks_with::<K, V>(solver, BYTE_LIGHTS, source, offsets, common, pixels, sink);
    } else {
        run_blocks_with::<K, V>(solver, solver.lights(), source, offsets, common, pixels, sink);
    }
}

#[inline(always)]
fn run_blocks_with<K: Pixel, V: Vector>(
    solver: &LaneSolver,
    lights: usize,
    source: &Source<'_, K>,
    offsets: Option<&Offsets<'_>>,
    Common { mask, full_scale, clips }: Common<'_>,
    pixels: Range<usize>,
    sink: &mut Sink<'_, '_>,
) {
    let mut kept = Kept::new(lights);
    let mut copies = vec![[K::ZERO; LANES]; lights];
    let nothing = [K::ZERO; LANES];
    let mut in_place = vec![&nothing; lights];
    // The images in blocks from the task's first on: few bounds are left to be checked then.
    let mut blocks: Vec<&[Lanes<K>]> = Vec::new();
    if let Source::Images(planes) = source {
        blocks.extend(planes.iter().map(|plane| plane[pixels.start..].as_chunks().0));
    }
    let mut offset = [0.0; LANES];
    let mut clipped = [0; LANES];
    let mut finished = Finished::new();
    let all_lights = [lights as u16; LANES];
    let per_full_scale = 1.0 / full_scale;
    sink.out.streamed &= V::STREAMS;
    for (number, first) in pixels.clone().step_by(LANES).enumerate() {
        let block = first..(first + LANES).min(pixels.end);
        let span = first - pixels.start..block.end - pixels.start;
        let used = mask.map(|mask| &mask[block.clone()]);
        // A block that is all in, or all out, needs no look at its pixels.
        let count = used.map_or(block.len(), |used| used.iter().map(|&used| usize::from(used)).sum());
        if count == 0 {
            sink.out.clear(span);
            continue;
        }
        let used = used.filter(|_| count < block.len());
        let copied: Vec<&Lanes<K>>;
        let keys = match source {
            Source::Images(_) if block.len() == LANES => {
                for (key, blocks) in in_place[..lights].iter_mut().zip(&blocks[..lights]) {
                    *key = &blocks[number];
                    stream::prefetch(key, BLOCKS_AHEAD);
                }
                &in_place
            }
            Source::Images(planes) => {
                for (copy, plane) in copies.iter_mut().zip(*planes) {
                    copy[..block.len()].copy_from_slice(&plane[block.clone()]);
                }
                copied = copies.iter().collect();
                &copied
            }
            Source::Made(make) => {
                make(&block, &mut copies);
                copied = copies.iter().collect();
                &copied
            }
        };
        if let Some(load) = offsets {
            load(&block, &mut offset);
        }
        if let Some(mark) = clips {
            mark(&block, &mut clipped);
        }
        let readings = Readings { keys: &keys[..lights], clipped: &clipped, offset: offsets.map(|_| &offset) };
        let mut spare = None;
        let mut place = sink.out.place(&span).unwrap_or_else(|| spare.insert(Spare::new()).place());
        solve::<K, V>(solver, &readings, &mut kept, per_full_scale, &mut finished, &mut place);
        if let Some(spare) = &spare {
            spare.copy_to(&span, sink.out);
        }
        write(&finished, &all_lights, used, span.clone(), sink.out);
        if !sink.out.kept_sets.is_empty() {
            write_sets(&kept, used, span, sink.out);
        }
        if finished.careful != 0 {
            for lane in (0..block.len()).filter(|lane| finished.careful >> lane & 1 == 1) {
                if used.is_none_or(|used| used[lane]) {
                    (sink.careful)(first + lane, sink.out);
                }
            }
        }
    }
    if sink.out.streamed {
        stream::finish();
    }
}

/// Mask and counts of a block, and what its unused pixels say.
#[inline(always)]
fn write(finished: &Finished, all_lights: &Lanes<u16>, used: Option<&[bool]>, span: Range<usize>, out: &mut Out<'_>) {
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
    store(kept, &mut out.lights_kept[span.clone()], out.streamed);
    store(valid, &mut out.mask[span.clone()], out.streamed);
    store(valid, &mut out.measured[span.clone()], out.streamed);
    if let Some(used) = used {
        for (lane, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
            out.clear(span.start + lane..span.start + lane + 1);
        }
    }
}

/// Copies as much of `block` as there is room for; a full block in one go.
#[inline(always)]
fn store<T: NoUninit, const N: usize>(block: &[T; N], out: &mut [T], streamed: bool) {
    match <&mut [T; N]>::try_from(&mut *out) {
        Ok(full) if streamed => stream::copy(block, full),
        Ok(full) => *full = *block,
        Err(_) => out.copy_from_slice(&block[..out.len()]),
    }
}

/// The kept lights themselves; asked for seldom.
#[inline(never)]
fn write_sets<K: Pixel>(kept: &Kept<K>, used: Option<&[bool]>, span: Range<usize>, out: &mut Out<'_>) {
    let lights = out.kept_sets.len() / out.albedo.len();
    for (lane, pixel) in span.enumerate() {
        let here = used.is_none_or(|used| used[lane]);
        for (light, set) in out.kept_sets[pixel * lights..(pixel + 1) * lights].iter_mut().enumerate() {
            *set = here && kept.holds(light, lane);
        }
    }
}
