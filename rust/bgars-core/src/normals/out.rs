//! What the kernels write to: the result, divided among the tasks.

use std::ops::Range;

use super::NormalMapMut;
use super::cutoff::{LANES, Lanes};
use crate::stream;

/// Fewest and most pixels of one task: to begin one, and to wait for what it streamed, costs as long as 200 pixels.
const TASK_PIXELS: [usize; 2] = [1 << 13, 1 << 16];

/// Tasks for each thread: all are to end together.
const TASKS: usize = 32;

/// Pixels of one task of so many, whole blocks. What comes out is the same for any number.
pub(super) fn task_pixels(pixels: usize) -> usize {
    let [least, most] = TASK_PIXELS;
    (pixels / (TASKS * rayon::current_num_threads())).clamp(least, most).next_multiple_of(LANES)
}

/// What a task writes: the pixels from its first one on.
pub(super) struct Out<'a> {
    pub normals: &'a mut [f32],
    pub albedo: &'a mut [f32],
    pub mask: &'a mut [bool],
    pub confidence: &'a mut [f32],
    pub measured: &'a mut [bool],
    pub lights_kept: &'a mut [u16],
    /// Empty unless asked for.
    pub kept_sets: &'a mut [bool],
    /// Write past the caches.
    pub streamed: bool,
}

impl<'a> Out<'a> {
    /// A band of pixels as tasks of so many.
    pub fn split(map: &'a mut NormalMapMut<'_>, band: &Range<usize>, task_pixels: usize) -> Vec<Self> {
        let streamed = map.albedo.len() >= stream::MIN_PIXELS;
        let set_lights = map.kept_sets.len() / map.albedo.len();
        let mut kept_sets = &mut map.kept_sets[band.start * set_lights..band.end * set_lights];
        let mut tasks = Vec::with_capacity(band.len().div_ceil(task_pixels));
        let scalars = map.normals[band.start * 3..band.end * 3]
            .chunks_mut(task_pixels * 3)
            .zip(map.albedo[band.clone()].chunks_mut(task_pixels))
            .zip(map.mask[band.clone()].chunks_mut(task_pixels))
            .zip(map.confidence[band.clone()].chunks_mut(task_pixels))
            .zip(map.measured[band.clone()].chunks_mut(task_pixels))
            .zip(map.lights_kept[band.clone()].chunks_mut(task_pixels));
        for (((((normals, albedo), mask), confidence), measured), lights_kept) in scalars {
            let (task_sets, rest) = std::mem::take(&mut kept_sets).split_at_mut(albedo.len() * set_lights);
            kept_sets = rest;
            tasks.push(Self {
                normals,
                albedo,
                mask,
                confidence,
                measured,
                lights_kept,
                kept_sets: task_sets,
                streamed,
            });
        }
        tasks
    }

    /// The whole blocks, one after the other, and beside them the kept sets of all pixels.
    pub fn blocks(&mut self) -> (impl Iterator<Item = Block<'_>>, &mut [bool]) {
        let streamed = self.streamed;
        let arrays = (self.normals.as_chunks_mut().0.iter_mut())
            .zip(self.albedo.as_chunks_mut().0)
            .zip(self.mask.as_chunks_mut().0)
            .zip(self.confidence.as_chunks_mut().0)
            .zip(self.measured.as_chunks_mut().0)
            .zip(self.lights_kept.as_chunks_mut().0);
        let blocks = arrays.map(move |(((((normals, albedo), mask), confidence), measured), lights_kept)| Block {
            normals,
            albedo,
            mask,
            confidence,
            measured,
            lights_kept,
            streamed,
        });
        (blocks, self.kept_sets)
    }

    /// Marks pixels as not asked for.
    pub fn clear(&mut self, span: Range<usize>) {
        self.lights_kept[span.clone()].fill(0);
        let lights = self.kept_sets.len() / self.albedo.len();
        self.kept_sets[span.start * lights..span.end * lights].fill(false);
        self.reject(span);
    }

    /// Marks pixels as without solution.
    pub fn reject(&mut self, span: Range<usize>) {
        self.normals[span.start * 3..span.end * 3].fill(f32::NAN);
        self.albedo[span.clone()].fill(f32::NAN);
        self.confidence[span.clone()].fill(0.0);
        self.mask[span.clone()].fill(false);
        self.measured[span].fill(false);
    }
}

/// What is written of a block of pixels.
pub(super) struct Block<'a> {
    /// Unit normals, x y z of each pixel; NaN without solution, like the albedo.
    pub normals: &'a mut [f32; 3 * LANES],
    pub albedo: &'a mut Lanes<f32>,
    pub mask: &'a mut Lanes<bool>,
    pub confidence: &'a mut Lanes<f32>,
    pub measured: &'a mut Lanes<bool>,
    pub lights_kept: &'a mut Lanes<u16>,
    /// Past the caches.
    pub streamed: bool,
}

impl Block<'_> {
    /// Marks pixels as not asked for.
    pub fn clear(&mut self, span: Range<usize>) {
        let Block { normals, albedo, mask, confidence, measured, lights_kept, streamed } = self;
        let (normals, albedo, confidence) = (&mut normals[..], &mut albedo[..], &mut confidence[..]);
        let (mask, measured, lights_kept) = (&mut mask[..], &mut measured[..], &mut lights_kept[..]);
        let kept_sets = &mut [];
        let streamed = *streamed;
        Out { normals, albedo, mask, confidence, measured, lights_kept, kept_sets, streamed }.clear(span);
    }
}
