//! Symmetric 3 x 3 matrices of many pixels at once, by the entries of the upper triangle: xx, xy, xz, yy, yz, zz.

use nalgebra::Matrix3;

use crate::lights::conditioning;
use crate::vector::spread::Spread;
use crate::vector::{ROW, Vector};

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

/// `v^T A v`.
#[inline(always)]
pub(super) fn form<V: Vector>([xx, xy, xz, yy, yz, zz]: [V; ENTRIES], [x, y, z]: [V; 3]) -> V {
    let (of_x, of_y) = (z.times_plus(xz, y * xy), z * yz);
    dot([x.times_plus(xx, of_x + of_x), y.times_plus(yy, of_y + of_y), z * zz], [x, y, z])
}

/// A quadratic form that is the same for all pixels: the factors of the squares and products of components, of products
/// twice the entry.
#[derive(Debug)]
pub(super) struct Form([Spread; ENTRIES]);

impl Form {
    /// `v^T A v`.
    pub fn new(matrix: &Matrix3<f64>) -> Self {
        let factors = matrix + matrix.transpose() - Matrix3::from_diagonal(&matrix.diagonal());
        Self(UPPER.map(|entry| Spread::new(factors[entry] as f32)))
    }

    /// `start + v^T A v`.
    #[inline(always)]
    pub fn added_to<V: Vector>(&self, start: V, [x, y, z]: [V; 3]) -> V {
        let Self([xx, xy, xz, yy, yz, zz]) = self;
        let of_x = z.times_plus(V::repeated(xz), y.times_plus(V::repeated(xy), x * V::repeated(xx)));
        let of_y = z.times_plus(V::repeated(yz), y * V::repeated(yy));
        let of_z = z * V::repeated(zz);
        z.times_plus(of_z, y.times_plus(of_y, x.times_plus(of_x, start)))
    }
}

/// The inverse of a Gram matrix.
pub(super) struct Inverse<V> {
    pub entries: [V; ENTRIES],
    /// See [`crate::lights::conditioning`].
    pub conditioning: V,
}

impl<V: Vector> Inverse<V> {
    /// From the matrix itself.
    #[inline(always)]
    pub fn of([xx, xy, xz, yy, yz, zz]: [V; ENTRIES]) -> Self {
        let mut entries = [
            minor(yy, zz, yz, yz),
            minor(xz, yz, xy, zz),
            minor(xy, yz, xz, yy),
            minor(xx, zz, xz, xz),
            minor(xy, xz, xx, yz),
            minor(xx, yy, xy, xy),
        ];
        let determinant = dot([xx, xy, xz], [entries[0], entries[1], entries[2]]);
        let scale = V::splat(1.0) / determinant;
        for entry in &mut entries {
            *entry = *entry * scale;
        }
        let third = (xx + yy + zz) * V::splat(1.0 / 3.0);
        Self { entries, conditioning: determinant / (third * third * third) }
    }

    /// From a row of [`inverse_row`].
    #[inline(always)]
    pub fn of_row([xx, xy, xz, yy, yz, zz, conditioning, _]: [V; ROW]) -> Self {
        Self { entries: [xx, xy, xz, yy, yz, zz], conditioning }
    }

    /// The inverse times a vector.
    #[inline(always)]
    pub fn product(&self, vector: [V; 3]) -> [V; 3] {
        product(self.entries, vector)
    }
}

/// The inverse of a Gram matrix and its conditioning, to be kept; zeros of a matrix whose conditioning is below `least`.
pub(super) fn inverse_row(gram: &Matrix3<f64>, least: f64) -> [f32; ROW] {
    let mut row = [0.0; ROW];
    let conditioning = conditioning(gram);
    if let Some(inverse) = gram.try_inverse().filter(|_| conditioning >= least) {
        for (place, entry) in row.iter_mut().zip(UPPER) {
            *place = inverse[entry] as f32;
        }
        row[ENTRIES] = conditioning as f32;
    }
    row
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
