//! What one pass over many images finds of each block of pixels, before the blocks are worked on.
//!
//! A few images at a time, a stretch of blocks of each: block by block, all images would be many short reads, and memory is slow
//! at these. It is waited for all the same, and what is computed meanwhile costs little.

use std::borrow::Borrow;
use std::ops::Range;

use super::ahead::Ahead;
use super::cutoff::{Extremes, LANES, Lanes};
use super::lanes::Reads;
use super::sums::BlockSums;
use crate::vector::Vector;
use crate::vector::spread::Spread;
use crate::{Pixel, stream};

/// What is found of a block.
pub(super) trait Overview<K: Pixel>: Clone {
    /// Of no image.
    const NOTHING: Self;
    /// Whether the images are asked for once more, and are brought together.
    const BRINGS: bool;

    /// Takes in some more images; `offset` is subtracted for the sums. Where images are brought together, `memory` begins with their
    /// place.
    fn take_in<V: Vector, const COUNT: usize>(
        &mut self,
        keys: &[&Lanes<K>; COUNT],
        offset: Option<&Lanes<f32>>,
        vectors: &[[Spread; 3]; COUNT],
        memory: &mut [Brought<K>],
    );

    /// What the work on the block reads; `keys` are empty where images are not brought together.
    fn reads<'a>(&'a self, keys: &'a [&'a Lanes<K>]) -> Reads<'a, K>;
}

/// All that is asked of pixels that keep every light.
#[derive(Clone)]
#[repr(align(64))]
pub(super) struct SumsAndLargest {
    pub sums: BlockSums,
    /// The largest key of each pixel, no offset subtracted; of floats alone.
    pub largest: Lanes<f32>,
}

impl<K: Pixel> Overview<K> for SumsAndLargest {
    const NOTHING: Self = Self { sums: BlockSums::ZERO, largest: [0.0; LANES] };
    const BRINGS: bool = false;

    #[inline(always)]
    fn take_in<V: Vector, const COUNT: usize>(
        &mut self,
        keys: &[&Lanes<K>; COUNT],
        offset: Option<&Lanes<f32>>,
        vectors: &[[Spread; 3]; COUNT],
        _: &mut [Brought<K>],
    ) {
        self.sums.add::<K, V, COUNT>(keys, offset, vectors);
        if K::CODES.is_none() {
            for step in 0..LANES / V::WIDTH {
                let at = step * V::WIDTH;
                let mut largest = V::load(&self.largest[at..]);
                for light in 0..COUNT {
                    largest = K::load::<V>(&keys[light][at..]).at_least(largest);
                }
                largest.write(&mut self.largest[at..]);
            }
        }
    }

    #[inline(always)]
    fn reads<'a>(&'a self, _: &'a [&'a Lanes<K>]) -> Reads<'a, K> {
        Reads::Sums(self)
    }
}

/// What is asked of pixels that may drop lights: the sums serve where they do not.
#[derive(Clone)]
#[repr(align(64))]
pub(super) struct SumsAndExtremes<K> {
    pub sums: BlockSums,
    pub extremes: Extremes<K, LANES>,
}

impl<K: Pixel> Overview<K> for SumsAndExtremes<K> {
    const NOTHING: Self = Self { sums: BlockSums::ZERO, extremes: Extremes::NOTHING };
    const BRINGS: bool = true;

    #[inline(always)]
    fn take_in<V: Vector, const COUNT: usize>(
        &mut self,
        keys: &[&Lanes<K>; COUNT],
        offset: Option<&Lanes<f32>>,
        vectors: &[[Spread; 3]; COUNT],
        memory: &mut [Brought<K>],
    ) {
        self.sums.add::<K, V, COUNT>(keys, offset, vectors);
        // Not of the keys themselves: a compiler knows that nothing else is where these are.
        self.extremes.see(bring(keys, memory));
    }

    #[inline(always)]
    fn reads<'a>(&'a self, keys: &'a [&'a Lanes<K>]) -> Reads<'a, K> {
        Reads::Keys { keys, ahead: Ahead::Nothing, overview: Some(self) }
    }
}

/// Nothing: the images are only brought together.
#[derive(Clone)]
pub(super) struct Copies;

impl<K: Pixel> Overview<K> for Copies {
    const NOTHING: Self = Self;
    const BRINGS: bool = true;

    #[inline(always)]
    fn take_in<V: Vector, const COUNT: usize>(
        &mut self,
        keys: &[&Lanes<K>; COUNT],
        _: Option<&Lanes<f32>>,
        _: &[[Spread; 3]; COUNT],
        memory: &mut [Brought<K>],
    ) {
        bring(keys, memory);
    }

    #[inline(always)]
    fn reads<'a>(&'a self, keys: &'a [&'a Lanes<K>]) -> Reads<'a, K> {
        Reads::Keys { keys, ahead: Ahead::Nothing, overview: None }
    }
}

/// A block of an image that is brought together with others; aligned, so that no vector of it lies across cache lines.
#[derive(Clone)]
#[repr(align(64))]
pub(super) struct Brought<K>(pub Lanes<K>);

impl<K> Borrow<Lanes<K>> for Brought<K> {
    #[inline(always)]
    fn borrow(&self) -> &Lanes<K> {
        &self.0
    }
}

/// Copies a block of some images to their place, which `memory` begins with.
#[inline(always)]
fn bring<'a, K: Copy, const COUNT: usize>(
    keys: &[&Lanes<K>; COUNT],
    memory: &'a mut [Brought<K>],
) -> &'a [Brought<K>; COUNT] {
    let places = &mut memory.as_chunks_mut::<COUNT>().0[0];
    for light in 0..COUNT {
        places[light].0 = *keys[light];
    }
    places
}

/// Images that are taken in together, at most.
const AT_ONCE: usize = 8;

/// More than [`AT_ONCE`] images, and what is summed up of them.
pub(super) struct Images<'a, K> {
    /// Their blocks.
    pub blocks: &'a [&'a [Lanes<K>]],
    /// What their values are multiplied by.
    pub vectors: &'a [[Spread; 3]],
    /// To be subtracted from every key of a block, one entry for each block of a stretch; empty where nothing is.
    pub offsets: &'a [Lanes<f32>],
}

impl<K: Pixel> Images<'_, K> {
    /// Looks over a stretch of blocks, one for each overview. Images that are brought together go to `memory`: all of the first
    /// block, then of the second. What is fetched meanwhile: if `OWN`, later blocks of the same images, else the same blocks of
    /// the next ones, and behind the last ones the first of the next stretch.
    #[inline(always)]
    pub fn look_over<V: Vector, O: Overview<K>, const OFFSETS: bool, const OWN: bool>(
        &self,
        stretch: &Range<usize>,
        overviews: &mut [O],
        memory: &mut [Brought<K>],
    ) {
        overviews.fill(O::NOTHING);
        let lights = self.blocks.len();
        // As few passes as can be, and as equal: sums are read and written once in each.
        let passes = lights.div_ceil(AT_ONCE);
        let mut first = 0;
        for pass in 0..passes {
            let count = lights / passes + usize::from(pass < lights % passes);
            match count {
                8 => self.take_in::<V, O, 8, OFFSETS, OWN>(first, stretch, overviews, memory),
                7 => self.take_in::<V, O, 7, OFFSETS, OWN>(first, stretch, overviews, memory),
                6 => self.take_in::<V, O, 6, OFFSETS, OWN>(first, stretch, overviews, memory),
                5 => self.take_in::<V, O, 5, OFFSETS, OWN>(first, stretch, overviews, memory),
                _ => self.take_in::<V, O, 4, OFFSETS, OWN>(first, stretch, overviews, memory),
            }
            first += count;
        }
    }

    /// Takes in a stretch of so many images.
    #[inline(always)]
    fn take_in<V: Vector, O: Overview<K>, const COUNT: usize, const OFFSETS: bool, const OWN: bool>(
        &self,
        first: usize,
        stretch: &Range<usize>,
        overviews: &mut [O],
        memory: &mut [Brought<K>],
    ) {
        let (lights, end) = (self.blocks.len(), first + COUNT);
        let images = &self.blocks[first..].as_chunks::<COUNT>().0[0];
        let vectors = &self.vectors[first..].as_chunks::<COUNT>().0[0];
        // Where one image less follows, the last of these is fetched again.
        let next =
            if end < lights { &self.blocks[end.min(lights - COUNT)..].as_chunks::<COUNT>().0[0] } else { images };
        let first_ones = &self.blocks.as_chunks::<AT_ONCE>().0[0];
        for (at, (block, overview)) in stretch.clone().zip(overviews).enumerate() {
            if OWN {
                for image in images {
                    stream::prefetch(&image[block], blocks_ahead::<K>());
                }
            } else if end < lights {
                for image in next {
                    stream::prefetch(&image[block], 0);
                }
            } else {
                for image in first_ones {
                    stream::prefetch(&image[block], stretch.len());
                }
            }
            let keys = std::array::from_fn(|light| &images[light][block]);
            let memory = if O::BRINGS { &mut memory[at * lights + first..] } else { &mut [] };
            let offset = if OFFSETS { Some(&self.offsets[at]) } else { None };
            overview.take_in::<V, COUNT>(&keys, offset, vectors, memory);
        }
    }
}

/// How many blocks ahead the same images are fetched: where they crowd, a first cache holds few bytes of each.
#[inline(always)]
fn blocks_ahead<K>() -> usize {
    /// Of an image.
    const MOST_BYTES: usize = 1 << 10;
    const MOST_BLOCKS: usize = 8;
    (MOST_BYTES / size_of::<Lanes<K>>()).min(MOST_BLOCKS)
}

#[cfg(test)]
mod tests {
    use super::super::cutoff::{Cutoffs, cutoffs, cutoffs_from};
    use super::super::sums::Sums;
    use super::*;
    use crate::vector::{Arithmetic, Portable};

    /// Steep here, flat there: gaps of up to 900 cut somewhere and nowhere.
    fn images<K: Pixel>(lights: usize, blocks: usize, key: impl Fn(u16) -> K) -> Vec<Vec<Lanes<K>>> {
        let value = |light: usize, at: usize| key(((light * 977 + at * 31) % 4096 * (at % 7)) as u16);
        let block = |light: usize, block: usize| std::array::from_fn(|lane| value(light, block * LANES + lane));
        (0..lights).map(|light| (0..blocks).map(|at| block(light, at)).collect()).collect()
    }

    fn vectors(lights: usize) -> Vec<[Spread; 3]> {
        (0..lights).map(|light| [0, 1, 2].map(|axis| Spread::new((light * 3 + axis) as f32 / 7.0 - 1.0))).collect()
    }

    /// `[x, y, z, squares]` of a block, bit by bit.
    fn bits(sums: impl Fn(usize) -> Sums<Portable>) -> Vec<[u32; 4]> {
        let mut all = vec![[0; 4]; LANES];
        for at in (0..LANES).step_by(Portable::WIDTH) {
            let Sums { vector: [x, y, z], squares } = sums(at);
            for (entry, sum) in [x, y, z, squares].into_iter().enumerate() {
                let mut values = [0.0; Portable::WIDTH];
                sum.write(&mut values);
                (0..Portable::WIDTH).for_each(|lane| all[at + lane][entry] = values[lane].to_bits());
            }
        }
        all
    }

    /// The slow twin: every block for itself, all its images at once.
    fn check<K: Pixel + PartialEq + std::fmt::Debug, const OFFSETS: bool, const OWN: bool>(key: impl Fn(u16) -> K) {
        let (mut seen, mut summed) = (Vec::new(), Vec::new());
        // In turn, so that what one task leaves behind meets the next.
        for (lights, blocks) in [(96, 11), (13, 20), (9, 1), (24, 6), (31, 7), (300, 2)] {
            let (images, vectors) = (images(lights, blocks, &key), vectors(lights));
            let blocks_of: Vec<&[Lanes<K>]> = images.iter().map(Vec::as_slice).collect();
            let offsets: Vec<Lanes<f32>> =
                (0..4).map(|at| std::array::from_fn(|lane| (at * 5 + lane) as f32)).collect();
            let looked_at = Images { blocks: &blocks_of, vectors: &vectors, offsets: &offsets };
            let mut memory = vec![Brought([K::LARGEST; LANES]); 4 * lights];
            seen.resize(4, SumsAndExtremes::NOTHING);
            summed.resize(4, <SumsAndLargest as Overview<K>>::NOTHING);
            for first in (0..blocks).step_by(4) {
                let stretch = first..blocks.min(first + 4);
                let count = stretch.len();
                looked_at.look_over::<Portable, SumsAndExtremes<K>, OFFSETS, OWN>(
                    &stretch,
                    &mut seen[..count],
                    &mut memory,
                );
                looked_at.look_over::<Portable, SumsAndLargest, OFFSETS, OWN>(&stretch, &mut summed[..count], &mut []);
                let mut copies = vec![Brought([K::LARGEST; LANES]); count * lights];
                looked_at.look_over::<Portable, Copies, OFFSETS, OWN>(&stretch, &mut vec![Copies; count], &mut copies);
                assert!(copies.iter().zip(&memory).all(|(copy, brought)| copy.0 == brought.0));
                for (at, block) in stretch.enumerate() {
                    let keys: Vec<&Lanes<K>> = images.iter().map(|image| &image[block]).collect();
                    let brought: Vec<&Lanes<K>> = memory[at * lights..][..lights].iter().map(Borrow::borrow).collect();
                    assert_eq!(brought, keys, "{lights} lights, block {block}");
                    let expected = bits(|lane| {
                        let offset = if OFFSETS { Portable::load(&offsets[at][lane..]) } else { Portable::splat(0.0) };
                        let mut sums = Sums::zero();
                        for (key, vector) in keys.iter().zip(&vectors) {
                            sums.add(K::load::<Portable>(&key[lane..]) - offset, vector);
                        }
                        sums
                    });
                    assert_eq!(bits(|lane| seen[at].sums.load(lane)), expected, "{lights} lights, block {block}");
                    assert_eq!(bits(|lane| summed[at].sums.load(lane)), expected, "{lights} lights, block {block}");
                    assert!(seen[at].sums.are_finite::<Portable>());
                    for gap in [10.0, 300.0, 900.0] {
                        let parts = |cutoffs: Cutoffs<K>| (cutoffs.largest, cutoffs.brightest, cutoffs.keep_all);
                        let found = cutoffs_from(&keys, K::gap(gap), &seen[at].extremes);
                        let expected = cutoffs(&keys, K::gap(gap), false);
                        assert_eq!(parts(found), parts(expected), "{lights} lights, gap {gap}");
                    }
                    for lane in (0..LANES).filter(|_| K::CODES.is_none()) {
                        let largest = keys.iter().map(|key| key[lane].to_f32()).fold(0.0, f32::max);
                        assert_eq!(summed[at].largest[lane].to_bits(), largest.to_bits());
                    }
                }
            }
        }
    }

    #[test]
    fn an_overview_is_what_is_found_block_by_block() {
        check::<u8, false, true>(|value| (value / 256) as u8);
        check::<u16, false, true>(|value| value);
        check::<f32, false, true>(f32::from);
        check::<u16, false, false>(|value| value);
        check::<f32, true, false>(f32::from);
        check::<u8, true, true>(|value| (value / 256) as u8);
    }

    #[test]
    fn sums_tell_what_is_not_finite() {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for (light, lane) in [(0, 0), (8, 63), (12, 17)] {
                let mut images = images(13, 1, f32::from);
                images[light][0][lane] = bad;
                let blocks: Vec<&[Lanes<f32>]> = images.iter().map(Vec::as_slice).collect();
                let mut memory = vec![Brought([0.0; LANES]); 13];
                let mut seen = [SumsAndExtremes::NOTHING];
                let looked_at = Images { blocks: &blocks, vectors: &vectors(13), offsets: &[] };
                looked_at.look_over::<Portable, _, false, true>(&(0..1), &mut seen, &mut memory);
                assert!(!seen[0].sums.are_finite::<Portable>(), "{bad} at light {light}, pixel {lane}");
            }
        }
    }
}
