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

/// Many images, of whose blocks `O` is found first.
pub(super) struct Stretches<'a, K, O> {
    planes: &'a [&'a [K]],
    memory: &'a mut Vec<Brought<K>>,
    overview: PhantomData<O>,
}

impl<'a, K, O> Stretches<'a, K, O> {
    /// `memory` is for images that are brought together.
    pub fn new(planes: &'a [&'a [K]], memory: &'a mut Vec<Brought<K>>) -> Self {
        Self { planes, memory, overview: PhantomData }
    }
}

impl<K: Pixel, O: Overview<K>> Source<K> for Stretches<'_, K, O> {
    #[inline(always)]
    fn work<'a, V: Vector>(
        self,
        task: &mut Task<'_, K>,
        pixels: &Range<usize>,
        mut blocks: impl Iterator<Item = Block<'a>>,
    ) {
        let images: Vec<&[Lanes<K>]> = self.planes.iter().map(|plane| blocks_of(plane, pixels)).collect();
        let fetches_own = O::BRINGS || are_crowded(self.planes);
        let images = Images { blocks: &images, vectors: &task.solver.pseudo_inverse };
        let (count, brought) = (pixels.len() / LANES, if O::BRINGS { self.planes.len() } else { 0 });
        let at_once = stretch_blocks::<K>(brought).min(count.max(1));
        let mut overviews = vec![O::NOTHING; at_once];
        self.memory.resize(at_once * brought, Brought([K::ZERO; LANES]));
        for first in (0..count).step_by(at_once) {
            let stretch = first..count.min(first + at_once);
            let overviews = &mut overviews[..stretch.len()];
            if task.uses(&stretch) {
                if fetches_own {
                    images.look_over::<V, O, true>(&stretch, overviews, self.memory);
                } else {
                    images.look_over::<V, O, false>(&stretch, overviews, self.memory);
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
