//! Symmetric 3 x 3 matrices of many pixels at once, by the entries of the upper triangle: xx, xy, xz, yy, yz, zz.

use nalgebra::Matrix3;

use crate::vector::Vector;
use crate::vector::spread::Spread;

/// Entries of the upper triangle.
pub(super) const ENTRIES: usize = 6;

/// Rows and columns of these.
const UPPER: [(usize, usize); ENTRIES] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

/// `a^T b`.
#[inline(always)]
pub(super) fn dot<V: Vector>([a, b, c]: [V; 3], [x, y, z]: [V; 3]) -> V {
    c.times_plus(z, b.times_plus(y, a * x))
}

/// A matrix times a vector.
#[inline(always)]
fn product<V: Vector>([xx, xy, xz, yy, yz, zz]: [V; ENTRIES], vector: [V; 3]) -> [V; 3] {
    [dot([xx, xy, xz], vector), dot([xy, yy, yz], vector), dot([xz, yz, zz], vector)]
}

/// The products of the components of a vector: xx, xy, xz, yy, yz, zz. Every quadratic form of it is a sum of these.
#[derive(Clone, Copy)]
pub(super) struct Monomials<V>([V; ENTRIES]);

impl<V: Vector> Monomials<V> {
    #[inline(always)]
    pub fn of([x, y, z]: [V; 3]) -> Self {
        Self([x * x, x * y, x * z, y * y, y * z, z * z])
    }

    /// `v^T v`.
    #[inline(always)]
    pub fn square(&self) -> V {
        let [xx, _, _, yy, _, zz] = self.0;
        xx + yy + zz
    }

    /// `z^2`.
    #[inline(always)]
    pub fn z_square(&self) -> V {
        self.0[5]
    }

    /// `v^T A v`.
    #[inline(always)]
    pub fn form(&self, [xx, xy, xz, yy, yz, zz]: [V; ENTRIES]) -> V {
        let [first, second, third, fourth, fifth, sixth] = self.0;
        let mixed = dot([xy, xz, yz], [second, third, fifth]);
        dot([xx, yy, zz], [first, fourth, sixth]) + (mixed + mixed)
    }

    /// `start + v^T A v`.
    #[inline(always)]
    pub fn added_to(&self, start: V, Form([xx, xy, xz, yy, yz, zz]): &Form) -> V {
        let [first, second, third, fourth, fifth, sixth] = self.0;
        let begun = third
            .times_plus(V::repeated(xz), second.times_plus(V::repeated(xy), first.times_plus(V::repeated(xx), start)));
        begun + dot([fourth, fifth, sixth], [V::repeated(yy), V::repeated(yz), V::repeated(zz)])
    }
}

/// A quadratic form that is the same for all pixels: the factors of the [products](Monomials), of mixed ones twice the entry.
#[derive(Debug)]
pub(super) struct Form([Spread; ENTRIES]);

impl Form {
    /// `v^T A v`.
    pub fn new(matrix: &Matrix3<f64>) -> Self {
        let factors = matrix + matrix.transpose() - Matrix3::from_diagonal(&matrix.diagonal());
        Self(UPPER.map(|entry| Spread::new(factors[entry] as f32)))
    }
}

/// The inverse of a Gram matrix: `scale` times its cofactors. `determinant / largest` is its conditioning.
pub(super) struct Inverse<V> {
    pub cofactors: [V; ENTRIES],
    pub scale: V,
    pub determinant: V,
    /// The largest determinant at this trace.
    pub largest: V,
}

impl<V: Vector> Inverse<V> {
    #[inline(always)]
    pub fn of([xx, xy, xz, yy, yz, zz]: [V; ENTRIES]) -> Self {
        let cofactors = [
            minor(yy, zz, yz, yz),
            minor(xz, yz, xy, zz),
            minor(xy, yz, xz, yy),
            minor(xx, zz, xz, xz),
            minor(xy, xz, xx, yz),
            minor(xx, yy, xy, xy),
        ];
        let determinant = dot([xx, xy, xz], [cofactors[0], cofactors[1], cofactors[2]]);
        let third = (xx + yy + zz) * V::splat(1.0 / 3.0);
        let scale = V::splat(1.0) / determinant;
        Self { cofactors, scale, determinant, largest: third * third * third }
    }

    /// The inverse times a vector.
    #[inline(always)]
    pub fn product(&self, vector: [V; 3]) -> [V; 3] {
        // The division meanwhile goes on.
        let [x, y, z] = product(self.cofactors, vector);
        [x * self.scale, y * self.scale, z * self.scale]
    }
}

/// `a b - c d`.
#[inline(always)]
fn minor<V: Vector>(a: V, b: V, c: V, d: V) -> V {
    a.times_minus(b, c * d)
}

/// `l l^T`.
pub(super) fn outer(&[x, y, z]: &[f32; 3]) -> [f32; ENTRIES] {
    [x * x, x * y, x * z, y * y, y * z, z * z]
}
