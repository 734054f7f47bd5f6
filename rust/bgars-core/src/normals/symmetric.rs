//! Symmetric 3 x 3 matrices by the entries of their upper triangle.

use nalgebra::Matrix3;

use super::lanes::{Lanes, add_product, dot};

/// Entries: xx, xy, xz, yy, yz, zz.
pub(super) const ENTRIES: usize = 6;

/// Such a matrix.
pub(super) type Symmetric = [f32; ENTRIES];

/// The inverse of a Gram matrix, and its [conditioning](crate::lights::conditioning).
#[inline(always)]
pub(super) fn invert<const FMA: bool>([xx, xy, xz, yy, yz, zz]: Symmetric) -> (Symmetric, f32) {
    let ([a, b, c, d, e, f], determinant) = adjugate::<FMA>([xx, xy, xz, yy, yz, zz]);
    let scale = 1.0 / determinant;
    let third = (xx + yy + zz) * (1.0 / 3.0);
    ([a * scale, b * scale, c * scale, d * scale, e * scale, f * scale], determinant / (third * third * third))
}

/// The adjugate of a matrix, which is its inverse times its determinant, and that.
#[inline(always)]
pub(super) fn adjugate<const FMA: bool>([xx, xy, xz, yy, yz, zz]: Symmetric) -> (Symmetric, f32) {
    let [a, b, c] = [minor::<FMA>(yy, zz, yz, yz), minor::<FMA>(xz, yz, xy, zz), minor::<FMA>(xy, yz, xz, yy)];
    let [d, e, f] = [minor::<FMA>(xx, zz, xz, xz), minor::<FMA>(xy, xz, xx, yz), minor::<FMA>(xx, yy, xy, xy)];
    ([a, b, c, d, e, f], dot::<FMA>([xx, xy, xz], [a, b, c]))
}

/// `a b - c d`.
#[inline(always)]
pub(super) fn minor<const FMA: bool>(a: f32, b: f32, c: f32, d: f32) -> f32 {
    add_product::<FMA>(a * b, -c, d)
}

/// The matrix of one pixel.
#[inline(always)]
pub(super) fn entries_at(matrix: &[Lanes<f32>; ENTRIES], lane: usize) -> Symmetric {
    let [xx, xy, xz, yy, yz, zz] = matrix;
    [xx[lane], xy[lane], xz[lane], yy[lane], yz[lane], zz[lane]]
}

/// A matrix times a vector.
#[inline(always)]
pub(super) fn product<const FMA: bool>(&[xx, xy, xz, yy, yz, zz]: &Symmetric, vector: [f32; 3]) -> [f32; 3] {
    [dot::<FMA>([xx, xy, xz], vector), dot::<FMA>([xy, yy, yz], vector), dot::<FMA>([xz, yz, zz], vector)]
}

/// `v^T A v` by the products of [`products`]; off the diagonal `A` is doubled.
#[inline(always)]
pub(super) fn form<const FMA: bool>([xx, xy, xz, yy, yz, zz]: Symmetric, products: &Symmetric) -> f32 {
    let first = dot::<FMA>([xx, xy, xz], [products[0], products[1], products[2]]);
    first + dot::<FMA>([yy, yz, zz], [products[3], products[4], products[5]])
}

/// The upper triangle of `v v^T`.
#[inline(always)]
pub(super) fn products([x, y, z]: [f32; 3]) -> Symmetric {
    [x * x, x * y, x * z, y * y, y * z, z * z]
}

/// The same matrix with its entries off the diagonal doubled.
#[inline(always)]
pub(super) fn doubled([xx, xy, xz, yy, yz, zz]: Symmetric) -> Symmetric {
    [xx, 2.0 * xy, 2.0 * xz, yy, 2.0 * yz, zz]
}

pub(super) fn upper(matrix: &Matrix3<f64>) -> Symmetric {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place] as f32)
}
