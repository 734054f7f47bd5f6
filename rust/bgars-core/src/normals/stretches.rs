//! The loop over many images: a stretch of blocks is looked over, then its blocks are worked on.

use std::marker::PhantomData;
use std::ops::Range;

use super::cutoff::{LANES, Lanes};
use super::gather::{are_crowded, stretch_blocks};
use super::lanes::{Source, Task, blocks_of};
use super::out::Block;
use super::overview::{Brought, Images, Overview};
use crate::Pixel;
use crate::vector::Vector;

/// Many images, of whose blocks `O` is found first; if `OFFSETS`, something is subtracted from the keys.
pub(super) struct Stretches<'a, K, O, const OFFSETS: bool> {
    planes: &'a [&'a [K]],
    memory: &'a mut Vec<Brought<K>>,
    overview: PhantomData<O>,
}

impl<'a, K, O, const OFFSETS: bool> Stretches<'a, K, O, OFFSETS> {
    /// `memory` is for images that are brought together.
    pub fn new(planes: &'a [&'a [K]], memory: &'a mut Vec<Brought<K>>) -> Self {
        Self { planes, memory, overview: PhantomData }
    }
}

impl<K: Pixel, O: Overview<K>, const OFFSETS: bool> Source<K> for Stretches<'_, K, O, OFFSETS> {
    #[inline(always)]
    fn work<'a, V: Vector>(
        self,
        task: &mut Task<'_, K>,
        pixels: &Range<usize>,
        mut blocks: impl Iterator<Item = Block<'a>>,
    ) {
        let images: Vec<&[Lanes<K>]> = self.planes.iter().map(|plane| blocks_of(plane, pixels)).collect();
        let fetches_own = O::BRINGS || are_crowded(self.planes);
        let (count, brought) = (pixels.len() / LANES, if O::BRINGS { self.planes.len() } else { 0 });
        let at_once = stretch_blocks::<K>(brought).min(count.max(1));
        let mut overviews = vec![O::NOTHING; at_once];
        let mut offsets = vec![[0.0; LANES]; if OFFSETS { at_once } else { 0 }];
        self.memory.resize(at_once * brought, Brought([K::ZERO; LANES]));
        for first in (0..count).step_by(at_once) {
            let stretch = first..count.min(first + at_once);
            let overviews = &mut overviews[..stretch.len()];
            // Of a stretch that is not asked for, no block reads what is left there from the one before.
            if task.uses(&stretch) {
                for (block, offset) in stretch.clone().zip(&mut offsets) {
                    task.load_offsets(block, offset);
                }
                let images = Images { blocks: &images, vectors: &task.solver.pseudo_inverse, offsets: &offsets };
                if fetches_own {
                    images.look_over::<V, O, OFFSETS, true>(&stretch, overviews, self.memory);
                } else {
                    images.look_over::<V, O, OFFSETS, false>(&stretch, overviews, self.memory);
                }
            }
            let mut keys = Vec::with_capacity(brought);
            for ((at, overview), out) in overviews.iter().enumerate().zip(blocks.by_ref()) {
                keys.clear();
                keys.extend(self.memory[at * brought..][..brought].iter().map(|block| &block.0));
                task.block::<V>(first + at, overview.reads(&keys), out);
            }
        }
    }
}
