//! A row of the checkerboard, vector by vector.

use super::checkerboard::{DOWN, LEFT, PaddedRow, RIGHT, UP};
use super::spans::Span;
use crate::vector::Packed;

/// The weights of the edges of a row's pixels of one colour: left, right, up, down.
pub(super) struct Sides<'a, V: Packed>(pub [&'a [V::Floats]; 4]);

impl<V: Packed> Sides<'_, V> {
    /// How many vectors there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.0[0].len()
    }

    /// The weights of vector `k`; 0 for virtual edges, which are no part of the system.
    #[inline(always)]
    fn at(&self, side: usize, k: usize) -> V {
        V::widen_positive(&self.0[side][k])
    }

    /// Sums of the weights.
    #[inline(always)]
    pub fn diagonal(&self, k: usize) -> V {
        (self.at(LEFT, k) + self.at(RIGHT, k)) + (self.at(UP, k) + self.at(DOWN, k))
    }
}

/// A row's pixels of one colour, with what is at the far ends of their edges.
pub(super) struct Stencil<'a, V: Packed> {
    sides: Sides<'a, V>,
    near: [&'a [V::Chunk]; 4],
}

impl<'a, V: Packed> Stencil<'a, V> {
    /// `shift` is 0 where the left neighbour of pixel k is pixel k - 1 of the other colour, 1 where it is pixel k.
    #[inline(always)]
    pub fn new(
        sides: Sides<'a, V>,
        [above, here, below]: [PaddedRow<'a, V::Number>; 3],
        span: Span,
        shift: usize,
    ) -> Self {
        let (first, n) = (1 + span.start, sides.len());
        let near = [
            V::chunks(&here[first - 1 + shift..], n),
            V::chunks(&here[first + shift..], n),
            V::chunks(&above[first..], n),
            V::chunks(&below[first..], n),
        ];
        Self { sides, near }
    }

    /// How many vectors there are.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.sides.len()
    }

    /// The weights, those of virtual edges too.
    #[inline(always)]
    pub fn sides(&self) -> [&'a [V::Floats]; 4] {
        self.sides.0
    }

    /// Sums of the weights.
    #[inline(always)]
    pub fn diagonal(&self, k: usize) -> V {
        self.sides.diagonal(k)
    }

    /// Sums of the weights times the neighbours.
    #[inline(always)]
    pub fn sum(&self, k: usize) -> V {
        let mut sum = self.sides.at(LEFT, k) * V::read(&self.near[LEFT][k]);
        for side in [RIGHT, UP, DOWN] {
            sum = self.sides.at(side, k).times_plus(V::read(&self.near[side][k]), sum);
        }
        sum
    }

    /// `term`, and the sums of the weights of all edges, virtual ones too, times the neighbours.
    #[inline(always)]
    pub fn plus_magnitudes(&self, term: V, k: usize) -> V {
        let mut sum = term;
        for side in [LEFT, RIGHT, UP, DOWN] {
            sum = V::widen(&self.sides.0[side][k]).magnitude().times_plus(V::read(&self.near[side][k]), sum);
        }
        sum
    }
}
