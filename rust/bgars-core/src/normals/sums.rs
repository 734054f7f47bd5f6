//! Sums over the lights.

use std::borrow::Borrow;
use std::ops::Range;

use super::cutoff::{LANES, Lanes};
use crate::vector::Vector;
use crate::vector::spread::Spread;
use crate::{Pixel, stream};

/// Of some pixels.
#[derive(Clone, Copy)]
pub(super) struct Sums<V> {
    /// Of `vector * value`.
    pub vector: [V; 3],
    /// Of `value^2`.
    pub squares: V,
}

impl<V: Vector> Sums<V> {
    #[inline(always)]
    pub fn zero() -> Self {
        Self { vector: [V::splat(0.0); 3], squares: V::splat(0.0) }
    }

    /// Of the keys as they are.
    #[inline(always)]
    pub fn of<K: Pixel, B: Borrow<Lanes<K>>>(keys: &[B], vectors: &[[Spread; 3]], at: usize) -> Self {
        /// Lights whose sums are written out: of 16 instructions a light (AVX2), a loop over single ones takes 7 for itself.
        const AT_ONCE: usize = 4;
        let mut sums = Self::zero();
        let (keys, last_keys) = keys.as_chunks::<AT_ONCE>();
        let (vectors, last_vectors) = vectors.as_chunks::<AT_ONCE>();
        for (keys, vectors) in keys.iter().zip(vectors) {
            for light in 0..AT_ONCE {
                sums.add(K::load::<V>(&keys[light].borrow()[at..]), &vectors[light]);
            }
        }
        for (key, vector) in last_keys.iter().zip(last_vectors) {
            sums.add(K::load::<V>(&key.borrow()[at..]), vector);
        }
        sums
    }

    #[inline(always)]
    pub fn add(&mut self, value: V, vector: &[Spread; 3]) {
        for (sum, factor) in self.vector.iter_mut().zip(vector) {
            *sum = value.times_plus(V::repeated(factor), *sum);
        }
        self.squares = value.times_plus(value, self.squares);
    }
}

/// [`Sums`] of a block of pixels, in memory, and its largest values.
#[derive(Clone)]
pub(super) struct BlockSums {
    vector: [Lanes<f32>; 3],
    squares: Lanes<f32>,
    /// Lane by lane; of floats alone.
    pub largest: Lanes<f32>,
}

impl BlockSums {
    /// Bytes of one image whose blocks are summed up one after the other: a page, which is as far as processors read ahead by
    /// themselves.
    const RUN_BYTES: usize = 1 << 12;

    /// Room for the sums of as many blocks as are summed up at a time.
    pub fn room<K>() -> Vec<Self> {
        let zero = [0.0; LANES];
        vec![Self { vector: [zero; 3], squares: zero, largest: zero }; Self::RUN_BYTES / size_of::<Lanes<K>>()]
    }

    /// Sums up a stretch of blocks, at most as many as there are sums: a few images at a time, the next ones fetched meanwhile, or
    /// their own next blocks where images crowd (see [`super::gather`]). Block by block, all images would be many short reads, and
    /// memory is slow at these.
    #[inline(always)]
    pub fn sum_up<K: Pixel, V: Vector>(
        sums: &mut [Self],
        images: &[&[Lanes<K>]],
        vectors: &[[Spread; 3]],
        stretch: &Range<usize>,
        is_crowded: bool,
    ) {
        for sums in &mut *sums {
            let zero = [0.0; LANES];
            *sums = Self { vector: [zero; 3], squares: zero, largest: zero };
        }
        let mut first = 0;
        while first < images.len() {
            let end = first + part(images.len() - first);
            // Behind the last images come the first ones of the next stretch.
            let (next, blocks_on) = if end < images.len() { (end, 0) } else { (0, sums.len()) };
            let next = &images[next..next + part(images.len() - next)];
            let (images, vectors) = (&images[first..end], &vectors[first..end]);
            let ahead = if is_crowded {
                Ahead { images, blocks_on: few_blocks_ahead::<K>() }
            } else {
                Ahead { images: next, blocks_on }
            };
            match end - first {
                8 => Self::add::<K, V, 8>(sums, images, vectors, stretch, &ahead),
                4 => Self::add::<K, V, 4>(sums, images, vectors, stretch, &ahead),
                _ => Self::add::<K, V, 1>(sums, images, vectors, stretch, &ahead),
            }
            first = end;
        }
    }

    /// Adds a stretch of so many images.
    #[inline(always)]
    fn add<K: Pixel, V: Vector, const COUNT: usize>(
        sums: &mut [Self],
        images: &[&[Lanes<K>]],
        vectors: &[[Spread; 3]],
        stretch: &Range<usize>,
        ahead: &Ahead<'_, K>,
    ) {
        let (images, vectors) = (&images.as_chunks::<COUNT>().0[0], &vectors.as_chunks::<COUNT>().0[0]);
        for (block, block_sums) in stretch.clone().zip(sums) {
            for image in ahead.images {
                stream::prefetch(&image[block], ahead.blocks_on);
            }
            let keys: [&Lanes<K>; COUNT] = std::array::from_fn(|light| &images[light][block]);
            for step in 0..LANES / V::WIDTH {
                let at = step * V::WIDTH;
                let mut sums = block_sums.load::<V>(at);
                let mut largest = V::load(&block_sums.largest[at..]);
                for light in 0..COUNT {
                    let values = K::load::<V>(&keys[light][at..]);
                    sums.add(values, &vectors[light]);
                    if K::CODES.is_none() {
                        largest = values.at_least(largest);
                    }
                }
                for axis in 0..3 {
                    sums.vector[axis].write(&mut block_sums.vector[axis][at..]);
                }
                sums.squares.write(&mut block_sums.squares[at..]);
                largest.write(&mut block_sums.largest[at..]);
            }
        }
    }

    /// The sums of the pixels from `at` on.
    #[inline(always)]
    pub fn load<V: Vector>(&self, at: usize) -> Sums<V> {
        let [x, y, z] = &self.vector;
        Sums {
            vector: [V::load(&x[at..]), V::load(&y[at..]), V::load(&z[at..])],
            squares: V::load(&self.squares[at..]),
        }
    }
}

/// What is fetched while sums are taken.
struct Ahead<'a, K> {
    images: &'a [&'a [Lanes<K>]],
    /// So many blocks behind those that are summed up.
    blocks_on: usize,
}

/// How many of so many images are summed up at a time.
fn part(images: usize) -> usize {
    match images {
        8.. => 8,
        4.. => 4,
        _ => 1,
    }
}

/// How many blocks ahead images are fetched that crowd: a first cache holds few bytes of each.
#[inline(always)]
fn few_blocks_ahead<K>() -> usize {
    /// Of an image.
    const MOST_BYTES: usize = 1 << 10;
    const MOST_BLOCKS: usize = 8;
    (MOST_BYTES / size_of::<Lanes<K>>()).min(MOST_BLOCKS)
}
