//! What the kernels write to: the result, divided among the tasks.

use std::ops::Range;

use super::NormalMapMut;
use super::cutoff::{LANES, Lanes};
use super::lane_solve::BYTE_LIGHTS;
use crate::stream;

/// Fewest pixels of one task.
const MIN_TASK_PIXELS: usize = 1 << 13;

/// Most pixels of one task of up to eight lights, and of more: to begin one, to fetch its first pixels, and to wait for what it
/// streamed, costs as long as a thousand pixels of eight lights.
const MAX_TASK_PIXELS: [usize; 2] = [1 << 18, 1 << 16];

/// Tasks for each of several threads: all are to end together.
const TASKS: usize = 32;

/// Pixels of one task of so many, whole blocks. What comes out is the same for any number.
pub(super) fn task_pixels(pixels: usize, lights: usize) -> usize {
    let [of_few, of_many] = MAX_TASK_PIXELS;
    let most = if lights <= BYTE_LIGHTS { of_few } else { of_many };
    let threads = rayon::current_num_threads();
    let tasks = if threads == 1 { 1 } else { TASKS * threads };
    (pixels / tasks).clamp(MIN_TASK_PIXELS, most).next_multiple_of(LANES)
}

/// What a task writes: the pixels from its first one on.
pub(super) struct Out<'a> {
    pub normals: &'a mut [f32],
    pub albedo: &'a mut [f32],
    pub mask: &'a mut [bool],
    pub confidence: &'a mut [f32],
    /// Empty where it is not wanted.
    pub measured: &'a mut [bool],
    pub lights_kept: &'a mut [u16],
    /// Empty unless asked for.
    pub kept_sets: &'a mut [bool],
    /// Write past the caches.
    pub streamed: bool,
}

impl<'a> Out<'a> {
    /// All of a result.
    pub fn of(map: NormalMapMut<'a>) -> Self {
        let streamed = map.albedo.len() >= stream::MIN_PIXELS;
        let NormalMapMut { normals, albedo, mask, confidence, measured, lights_kept, kept_sets } = map;
        Self { normals, albedo, mask, confidence, measured, lights_kept, kept_sets, streamed }
    }

    /// As tasks of so many pixels.
    pub fn split(mut self, task_pixels: usize) -> Vec<Self> {
        let mut tasks = Vec::with_capacity(self.albedo.len().div_ceil(task_pixels));
        while !self.albedo.is_empty() {
            tasks.push(self.take(task_pixels.min(self.albedo.len())));
        }
        tasks
    }

    /// The same, borrowed for less long.
    pub fn reborrow(&mut self) -> Out<'_> {
        let Self { normals, albedo, mask, confidence, measured, lights_kept, kept_sets, streamed } = self;
        Out { normals, albedo, mask, confidence, measured, lights_kept, kept_sets, streamed: *streamed }
    }

    /// The first pixels, so many of them; the others stay.
    pub fn take(&mut self, pixels: usize) -> Self {
        macro_rules! first {
            ($array:ident, $count:expr) => {
                self.$array.split_off_mut(..$count).expect("no more than there are")
            };
        }
        let set_lights = self.kept_sets.len() / self.albedo.len();
        Self {
            normals: first!(normals, pixels * 3),
            albedo: first!(albedo, pixels),
            mask: first!(mask, pixels),
            confidence: first!(confidence, pixels),
            measured: first!(measured, pixels.min(self.measured.len())),
            lights_kept: first!(lights_kept, pixels),
            kept_sets: first!(kept_sets, pixels * set_lights),
            streamed: self.streamed,
        }
    }

    /// The whole blocks, one after the other, and beside them the kept sets of all pixels.
    pub fn blocks(&mut self) -> (impl Iterator<Item = Block<'_>>, &mut [bool]) {
        let streamed = self.streamed;
        let mut measured = self.measured.as_chunks_mut().0.iter_mut();
        let arrays = (self.normals.as_chunks_mut().0.iter_mut())
            .zip(self.albedo.as_chunks_mut().0)
            .zip(self.mask.as_chunks_mut().0)
            .zip(self.confidence.as_chunks_mut().0)
            .zip(self.lights_kept.as_chunks_mut().0);
        let blocks = arrays.map(move |((((normals, albedo), mask), confidence), lights_kept)| Block {
            normals,
            albedo,
            mask,
            confidence,
            measured: measured.next(),
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
        if let Some(measured) = self.measured.get_mut(span) {
            measured.fill(false);
        }
    }
}

/// What is written of a block of pixels.
pub(super) struct Block<'a> {
    /// Unit normals, x y z of each pixel; NaN without solution, like the albedo.
    pub normals: &'a mut [f32; 3 * LANES],
    pub albedo: &'a mut Lanes<f32>,
    pub mask: &'a mut Lanes<bool>,
    pub confidence: &'a mut Lanes<f32>,
    pub measured: Option<&'a mut Lanes<bool>>,
    pub lights_kept: &'a mut Lanes<u16>,
    /// Past the caches.
    pub streamed: bool,
}

impl Block<'_> {
    /// Marks pixels as not asked for.
    pub fn clear(&mut self, span: Range<usize>) {
        let Block { normals, albedo, mask, confidence, measured, lights_kept, streamed } = self;
        let (normals, albedo, confidence) = (&mut normals[..], &mut albedo[..], &mut confidence[..]);
        let (mask, lights_kept) = (&mut mask[..], &mut lights_kept[..]);
        let measured = measured.as_mut().map_or(&mut [][..], |measured| &mut measured[..]);
        let kept_sets = &mut [];
        let streamed = *streamed;
        Out { normals, albedo, mask, confidence, measured, lights_kept, kept_sets, streamed }.clear(span);
    }
}
