//! The fast kernel: blocks of 64 pixels, for distant lights.
//!
//! Plain loops over the lanes of a block, which the compiler turns into the vector instructions of the processor it runs on.

use std::ops::Range;

use multiversion::multiversion;

use super::ahead::{Ahead, blocks_on};
use super::cutoff::{LANES, Lanes, are_sorted};
use super::finish::Finished;
use super::gather::should_bring;
use super::kept::Kept;
use super::lane_solve::{BYTE_LIGHTS, Careful, Choice, LaneSolver, Readings, raise, solve, solve_sums};
use super::out::{Block, Out};
use super::overview::{Brought, Copies, Overview, SumsAndExtremes, SumsAndLargest};
use super::stretches::Stretches;
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
    /// What the albedo is multiplied by.
    pub per_full_scale: f32,
    /// Whether to collect what a later full scale is to be judged by: [`Left::largest`] and [`Left::cuts`].
    pub is_draft: bool,
}

/// What the lanes found, and what they leave to others.
pub(super) struct Left {
    /// True where all that was read is finite.
    pub finite: bool,
    /// Blocks that leave pixels to the careful kernel, by their first pixel of the image, and which.
    pub careful: Vec<(usize, Careful)>,
    /// The largest value, 0 where none is above; of a draft.
    pub largest: f32,
    /// Blocks that cut between sorted values, by their first pixel of the image, and the smallest step that was cut; of a draft.
    pub cuts: Vec<(usize, f32)>,
}

impl Left {
    pub fn nothing() -> Self {
        Self { finite: true, careful: Vec::new(), largest: 0.0, cuts: Vec::new() }
    }

    /// The pixels of [`Self::careful`].
    pub fn careful_pixels(&self) -> impl Iterator<Item = usize> {
        self.careful
            .iter()
            .flat_map(|&(first, lanes)| (first..first + LANES).filter(move |pixel| lanes >> (pixel - first) & 1 == 1))
    }
}

/// Where the keys of the blocks come from, and the loop over these. Each has a compiled function of its own: in one for all, the
/// loop over eight images is slower by 1 to 3 % (`benches/results.tsv`).
pub(super) trait Source<K: Pixel> {
    /// Works on the blocks of `pixels`.
    fn work<'a, V: Vector>(
        self,
        task: &mut Task<'_, K>,
        pixels: &Range<usize>,
        blocks: impl Iterator<Item = Block<'a>>,
    );
}

/// Eight images as they lie. Loops over lights are written out then, and bounds are not asked for.
struct Eight<'a, K>(&'a [&'a [K]; BYTE_LIGHTS]);

impl<K: Pixel> Source<K> for Eight<'_, K> {
    #[inline(always)]
    fn work<'a, V: Vector>(
        self,
        task: &mut Task<'_, K>,
        pixels: &Range<usize>,
        blocks: impl Iterator<Item = Block<'a>>,
    ) {
        let [a, b, c, d, e, f, g, h] = self.0.map(|plane| blocks_of(plane, pixels));
        let keys = a.iter().zip(b).zip(c).zip(d).zip(e).zip(f).zip(g).zip(h);
        for (number, (out, (((((((a, b), c), d), e), f), g), h))) in blocks.zip(keys).enumerate() {
            let keys = [a, b, c, d, e, f, g, h];
            let ahead = Ahead::Fetch(&keys, blocks_on::<K>(BYTE_LIGHTS));
            task.block::<V>(number, Reads::Keys { keys: &keys, ahead, overview: None }, out);
        }
    }
}

/// Images as they lie.
struct AsTheyLie<'a, K>(&'a [&'a [K]]);

impl<K: Pixel> Source<K> for AsTheyLie<'_, K> {
    #[inline(always)]
    fn work<'a, V: Vector>(
        self,
        task: &mut Task<'_, K>,
        pixels: &Range<usize>,
        blocks: impl Iterator<Item = Block<'a>>,
    ) {
        let images: Vec<&[Lanes<K>]> = self.0.iter().map(|plane| blocks_of(plane, pixels)).collect();
        let blocks_on = blocks_on::<K>(images.len());
        let mut keys: Vec<&Lanes<K>> = Vec::with_capacity(images.len());
        for (number, out) in blocks.enumerate() {
            keys.clear();
            keys.extend(images.iter().map(|blocks| &blocks[number]));
            let ahead = Ahead::Fetch(&keys, blocks_on);
            task.block::<V>(number, Reads::Keys { keys: &keys, ahead, overview: None }, out);
        }
    }
}

/// Keys that are computed from the images.
struct Made<'a, K>(&'a Make<'a, K>);

impl<K: Pixel> Source<K> for Made<'_, K> {
    #[inline(always)]
    fn work<'a, V: Vector>(self, task: &mut Task<'_, K>, _: &Range<usize>, blocks: impl Iterator<Item = Block<'a>>) {
        let mut made = vec![[K::ZERO; LANES]; task.solver.lights()];
        for (number, out) in blocks.enumerate() {
            (self.0)(&task.pixels(number), &mut made);
            let keys: Vec<_> = made.iter().collect();
            task.block::<V>(number, Reads::Keys { keys: &keys, ahead: Ahead::Nothing, overview: None }, out);
        }
    }
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
    per_full_scale: f32,
    is_draft: bool,
    /// `None` where nothing is subtracted.
    offsets: Option<&'a Offsets<'a>>,
    /// `None` where clipped lights are as good as others.
    clips: Option<&'a Clips<'a>>,
}

/// Works on the blocks of `pixels` (of the whole image), to which `out` belongs; the pixels behind the last whole one are left.
/// `memory` is for images that are brought together.
pub(super) fn run<P: Pixel>(
    solver: &LaneSolver,
    input: &Input<'_, P>,
    pixels: Range<usize>,
    out: &mut Out<'_>,
    memory: &mut Vec<Brought<P>>,
) -> Left {
    let Input { planes, radiometry, scales, mask, per_full_scale, is_draft } = *input;
    let plain = radiometry.is_plain();
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
    let offsets: Option<&Offsets<'_>> = if plain && radiometry.has_offsets() { Some(&load_offsets) } else { None };
    let common = Common { mask, per_full_scale, is_draft, offsets, clips };
    if !plain {
        let make = |block: &Range<usize>, keys: &mut [Lanes<f32>]| {
            let mut offsets = [0.0; LANES];
            load_offsets(block, &mut offsets);
            for ((key, plane), &scale) in keys.iter_mut().zip(planes).zip(scales) {
                for ((key, &code), &offset) in key.iter_mut().zip(&plane[block.clone()]).zip(&offsets) {
                    *key = (radiometry.linearise(code) - offset) * scale;
                }
            }
        };
        return run_blocks(solver, Made(&make), common, pixels, out);
    }
    if let Ok(planes) = planes.try_into() {
        run_blocks(solver, Eight(planes), common, pixels, out)
    } else if matches!(solver.choice, Choice::All) && planes.len() > BYTE_LIGHTS {
        run_stretches::<P, SumsAndLargest>(solver, planes, memory, common, pixels, out)
    } else if !should_bring(planes) {
        run_blocks(solver, AsTheyLie(planes), common, pixels, out)
    } else if are_sorted::<P>(planes.len()) {
        run_stretches::<P, Copies>(solver, planes, memory, common, pixels, out)
    } else {
        run_stretches::<P, SumsAndExtremes<P>>(solver, planes, memory, common, pixels, out)
    }
}

/// [`run`] on many images, of whose blocks `O` is found first.
fn run_stretches<P: Pixel, O: Overview<P>>(
    solver: &LaneSolver,
    planes: &[&[P]],
    memory: &mut Vec<Brought<P>>,
    common: Common<'_>,
    pixels: Range<usize>,
    out: &mut Out<'_>,
) -> Left {
    if common.offsets.is_some() {
        run_blocks(solver, Stretches::<P, O, true>::new(planes, memory), common, pixels, out)
    } else {
        run_blocks(solver, Stretches::<P, O, false>::new(planes, memory), common, pixels, out)
    }
}

/// The hot loop, compiled for several instruction sets; one call a task.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq+fma", "x86_64+avx2+fma"))]
fn run_blocks<K: Pixel, S: Source<K>>(
    solver: &LaneSolver,
    source: S,
    common: Common<'_>,
    pixels: Range<usize>,
    out: &mut Out<'_>,
) -> Left {
    #[cfg(target_arch = "x86_64")]
    {
        if multiversion::target::target_cfg_f!(target_feature = "avx512f") {
            return run_with::<K, S, Pair<Avx512>>(solver, source, common, &pixels, out);
        }
        if multiversion::target::target_cfg_f!(target_feature = "avx2") {
            return run_with::<K, S, Pair<Avx2>>(solver, source, common, &pixels, out);
        }
    }
    run_with::<K, S, Portable>(solver, source, common, &pixels, out)
}

#[inline(always)]
fn run_with<K: Pixel, S: Source<K>, V: Vector>(
    solver: &LaneSolver,
    source: S,
    common: Common<'_>,
    pixels: &Range<usize>,
    out: &mut Out<'_>,
) -> Left {
    out.streamed &= V::STREAMS;
    let streamed = out.streamed;
    let (blocks, sets) = out.blocks();
    let mut task = Task::new(solver, common, pixels.start, sets);
    source.work::<V>(&mut task, pixels, blocks);
    let Task { mut left, largest, .. } = task;
    left.largest = largest.into_iter().fold(0.0, f32::max);
    if streamed {
        stream::finish();
    }
    left
}

/// The whole blocks of some pixels.
pub(super) fn blocks_of<'a, K>(plane: &'a [K], pixels: &Range<usize>) -> &'a [Lanes<K>] {
    plane[pixels.clone()].as_chunks().0
}

/// What a block reads.
pub(super) enum Reads<'a, K> {
    /// Its pixels in every image, what is to be done meanwhile, and what is known of them.
    Keys { keys: &'a [&'a Lanes<K>], ahead: Ahead<'a, K>, overview: Option<&'a SumsAndExtremes<K>> },
    /// What was summed up over all of them.
    Sums(&'a SumsAndLargest),
}

/// What the blocks of a task share.
///
/// Aligned, and with it the stack of the loop that it lives in: vectors that go there for want of registers would lie across
/// cache lines and pages, which is slow (`benches/results.tsv`).
#[repr(align(64))]
pub(super) struct Task<'a, K> {
    pub solver: &'a LaneSolver,
    common: Common<'a>,
    first_pixel: usize,
    all_lights: Lanes<u16>,
    offset: Lanes<f32>,
    clipped: Lanes<u8>,
    kept: Kept<K>,
    finished: Finished,
    /// The kept lights of all pixels, or none.
    sets: &'a mut [bool],
    /// Lane by lane.
    largest: Lanes<f32>,
    left: Left,
}

impl<'a, K: Pixel> Task<'a, K> {
    fn new(solver: &'a LaneSolver, common: Common<'a>, first_pixel: usize, sets: &'a mut [bool]) -> Self {
        Self {
            solver,
            common,
            first_pixel,
            all_lights: [solver.lights() as u16; LANES],
            offset: [0.0; LANES],
            clipped: [0; LANES],
            kept: Kept::new(solver.lights()),
            finished: Finished::new(),
            sets,
            largest: [0.0; LANES],
            left: Left::nothing(),
        }
    }

    /// The pixels of a block.
    fn pixels(&self, number: usize) -> Range<usize> {
        let first = self.first_pixel + number * LANES;
        first..first + LANES
    }

    /// True where some pixel of a stretch of blocks is asked for.
    pub fn uses(&self, stretch: &Range<usize>) -> bool {
        let pixels = self.pixels(stretch.start).start..self.pixels(stretch.end).start;
        self.common.mask.is_none_or(|mask| mask[pixels].contains(&true))
    }

    /// What is to be subtracted from the keys of a block, if anything is.
    pub fn load_offsets(&self, number: usize, offsets: &mut Lanes<f32>) {
        if let Some(load) = self.common.offsets {
            load(&self.pixels(number), offsets);
        }
    }

    /// Works on a block.
    #[inline(always)]
    pub fn block<V: Vector>(&mut self, number: usize, reads: Reads<'_, K>, mut out: Block<'_>) {
        let pixels = self.pixels(number);
        let used = self.common.mask.map(|mask| &mask[pixels.clone()]);
        // A block that is all in, or all out, needs no look at its pixels.
        let count = used.map_or(LANES, |used| used.iter().map(|&used| usize::from(used)).sum());
        let sets = if self.sets.is_empty() {
            &mut []
        } else {
            let lights = self.solver.lights();
            &mut self.sets[number * LANES * lights..][..LANES * lights]
        };
        if count == 0 {
            out.clear(0..LANES);
            sets.fill(false);
            return;
        }
        let used = used.filter(|_| count < LANES);
        if let (Some(load), Reads::Keys { .. }) = (self.common.offsets, &reads) {
            load(&pixels, &mut self.offset);
        }
        if let Some(mark) = self.common.clips {
            mark(&pixels, &mut self.clipped);
        }
        let offset = self.common.offsets.map(|_| &self.offset);
        let largest = (K::CODES.is_none() && self.common.is_draft).then_some(&mut self.largest);
        let (per_full_scale, finished) = (self.common.per_full_scale, &mut self.finished);
        match reads {
            Reads::Keys { keys, ahead, overview } => {
                let readings = Readings { keys, ahead, overview, clipped: &self.clipped, offset, largest };
                solve::<K, V>(self.solver, readings, &mut self.kept, per_full_scale, finished, &mut out);
            }
            Reads::Sums(sums) => {
                solve_sums::<V>(self.solver, sums, per_full_scale, finished, &mut out);
                if let Some(largest) = largest {
                    raise(largest, &sums.largest);
                }
            }
        }
        self.left.finite &= self.finished.finite;
        self.finished.write_counts::<V>(&self.all_lights, used, &mut out);
        if !sets.is_empty() {
            self.kept.write_sets(used, sets);
        }
        if self.finished.careful != 0 {
            self.left.careful.push((pixels.start, self.finished.careful));
        }
        if K::CODES.is_none() && self.common.is_draft && !self.finished.keep_all {
            self.left.cuts.push((pixels.start, self.finished.least_cut));
        }
    }
}
