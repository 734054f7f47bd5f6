//! Sums over the lights.

use std::borrow::Borrow;

use super::cutoff::{LANES, Lanes};
use super::finite::is_finite;
use crate::Pixel;
use crate::vector::Vector;
use crate::vector::spread::Spread;

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

/// [`Sums`] of a block of pixels, in memory.
#[derive(Clone)]
pub(super) struct BlockSums {
    vector: [Lanes<f32>; 3],
    squares: Lanes<f32>,
}

impl BlockSums {
    pub const ZERO: Self = Self { vector: [[0.0; LANES]; 3], squares: [0.0; LANES] };

    /// Adds those of some images, of whose keys `offset` is subtracted.
    #[inline(always)]
    pub fn add<K: Pixel, V: Vector, const COUNT: usize>(
        &mut self,
        keys: &[&Lanes<K>; COUNT],
        offset: Option<&Lanes<f32>>,
        vectors: &[[Spread; 3]; COUNT],
    ) {
        for step in 0..LANES / V::WIDTH {
            let at = step * V::WIDTH;
            let mut sums = self.load::<V>(at);
            for light in 0..COUNT {
                let value = K::load::<V>(&keys[light][at..]);
                let value = if let Some(offset) = offset { value - V::load(&offset[at..]) } else { value };
                sums.add(value, &vectors[light]);
            }
            for axis in 0..3 {
                sums.vector[axis].write(&mut self.vector[axis][at..]);
            }
            sums.squares.write(&mut self.squares[at..]);
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

    /// False where a value is NaN or infinite, or so large that sums of squares are.
    #[inline(always)]
    pub fn are_finite<V: Vector>(&self) -> bool {
        let mut squares = V::splat(0.0);
        for step in 0..LANES / V::WIDTH {
            squares = V::load(&self.squares[step * V::WIDTH..]) + squares;
        }
        is_finite(squares)
    }
}
