//! Symmetric 3 x 3 matrices of many pixels at once, by the entries of the upper triangle: xx, xy, xz, yy, yz, zz.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

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

/// `a^T b - term`.
#[inline(always)]
pub(super) fn dot_less<V: Vector>([a, b, c]: [V; 3], [x, y, z]: [V; 3], term: V) -> V {
    c.times_plus(z, b.times_plus(y, a.times_minus(x, term)))
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

/// The principal axes of a Gram matrix: along them quadratic forms of it and its inverse are sums of three squares.
#[derive(Debug)]
pub(super) struct PrincipalAxes {
    /// What the matrix is along each of them.
    pub values: [f64; 3],
    /// The axes, as columns.
    columns: Matrix3<f64>,
    /// The same by rows, for vectors; `None` where they are those of the camera, as for rings of evenly spaced lights.
    rows: Option<[[Spread; 3]; 3]>,
}

impl PrincipalAxes {
    pub fn of(gram: &Matrix3<f64>) -> Self {
        let beside = gram - Matrix3::from_diagonal(&gram.diagonal());
        // Below what `f32` can tell.
        if beside.amax() <= f64::from(f32::EPSILON) * gram.trace() {
            return Self { values: gram.diagonal().into(), columns: Matrix3::identity(), rows: None };
        }
        let SymmetricEigen { eigenvectors: columns, eigenvalues } = gram.symmetric_eigen();
        let row = |row| std::array::from_fn(|axis| Spread::new(columns[(row, axis)] as f32));
        Self { values: eigenvalues.into(), columns, rows: Some(std::array::from_fn(row)) }
    }

    /// A vector by its components along the axes.
    pub fn along(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        self.columns.tr_mul(vector)
    }

    /// Back from [`Self::along`].
    #[inline(always)]
    pub fn back<V: Vector>(&self, along: [V; 3]) -> [V; 3] {
        let Some([x, y, z]) = &self.rows else { return along };
        [dot(spread(x), along), dot(spread(y), along), dot(spread(z), along)]
    }
}

/// `v^T A v` by the squares of `v` along the principal axes of `A`.
#[derive(Debug)]
pub(super) struct PrincipalForm([Spread; 3]);

impl PrincipalForm {
    /// Of what `A` is along the axes.
    pub fn new(values: [f64; 3]) -> Self {
        Self(values.map(|value| Spread::new(value as f32)))
    }

    /// The form.
    #[inline(always)]
    pub fn of<V: Vector>(&self, squares: [V; 3]) -> V {
        dot(spread(&self.0), squares)
    }

    /// The form and `more`.
    #[inline(always)]
    pub fn and<V: Vector>(&self, more: V, [x2, y2, z2]: [V; 3]) -> V {
        let [x, y, z] = &self.0;
        z2.times_plus(V::repeated(z), y2.times_plus(V::repeated(y), x2.times_plus(V::repeated(x), more)))
    }
}

/// The same vector everywhere.
#[inline(always)]
pub(super) fn spread<V: Vector>([x, y, z]: &[Spread; 3]) -> [V; 3] {
    [V::repeated(x), V::repeated(y), V::repeated(z)]
}

/// The inverse of a Gram matrix.
pub(super) struct Inverse<V> {
    pub entries: [V; ENTRIES],
    /// See [`crate::lights::conditioning`].
    pub conditioning: V,
    /// Of so many lights, see [`super::finish::freedom`].
    pub freedom: V,
}

impl<V: Vector> Inverse<V> {
    /// From the matrix itself, and the freedom.
    #[inline(always)]
    pub fn of([xx, xy, xz, yy, yz, zz]: [V; ENTRIES], freedom: V) -> Self {
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
        Self { entries, conditioning: determinant / (third * third * third), freedom }
    }

    /// From a row of [`inverse_row`].
    #[inline(always)]
    pub fn of_row([xx, xy, xz, yy, yz, zz, conditioning, freedom]: [V; ROW]) -> Self {
        Self { entries: [xx, xy, xz, yy, yz, zz], conditioning, freedom }
    }

    /// The inverse times a vector.
    #[inline(always)]
    pub fn product(&self, vector: [V; 3]) -> [V; 3] {
        product(self.entries, vector)
    }
}

/// The inverse of a Gram matrix, its conditioning and the freedom, to be kept; zeros of a matrix whose conditioning is below `least`.
pub(super) fn inverse_row(gram: &Matrix3<f64>, least: f64, freedom: f32) -> [f32; ROW] {
    let mut row = [0.0; ROW];
    let conditioning = conditioning(gram);
    if let Some(inverse) = gram.try_inverse().filter(|_| conditioning >= least) {
        for (place, entry) in row.iter_mut().zip(UPPER) {
            *place = inverse[entry] as f32;
        }
        row[ENTRIES] = conditioning as f32;
        row[ENTRIES + 1] = freedom;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{Arithmetic, Portable};

    /// A ring, whose axes are the camera's, and lights here and there.
    #[test]
    fn along_principal_axes_forms_are_sums_of_squares() {
        let ring = |light: usize| {
            let azimuth = light as f64 * std::f64::consts::FRAC_PI_4;
            Vector3::new(azimuth.cos(), azimuth.sin(), 1.0).normalize()
        };
        let anywhere = |light: usize| {
            let number = |seed: usize| (seed * 37 % 11) as f64 / 11.0;
            Vector3::new(number(light + 1) - 0.4, number(light + 5) - 0.7, 0.5).normalize()
        };
        let vector = Vector3::new(0.3, -0.8, 0.6);
        for (lights, turned) in [(&ring as &dyn Fn(usize) -> Vector3<f64>, false), (&anywhere, true)] {
            let gram = (0..8).map(lights).fold(Matrix3::zeros(), |gram, light| gram + light * light.transpose());
            let axes = PrincipalAxes::of(&gram);
            assert_eq!(axes.rows.is_some(), turned);
            let along = axes.along(&vector);
            let of_squares = |values: [f64; 3]| along.component_mul(&along).dot(&Vector3::from(values));
            approx::assert_relative_eq!(of_squares(axes.values), vector.dot(&(gram * vector)), epsilon = 1e-12);
            let inverse = gram.try_inverse().unwrap();
            let inverses = axes.values.map(f64::recip);
            approx::assert_relative_eq!(of_squares(inverses), vector.dot(&(inverse * vector)), epsilon = 1e-12);
            let back = axes.back([along.x, along.y, along.z].map(|component| Portable::splat(component as f32)));
            let squares = [along.x, along.y, along.z].map(|value| Portable::splat((value * value) as f32));
            for values in [axes.values, inverses] {
                let form = PrincipalForm::new(values);
                for (found, more) in [(form.of(squares), 0.0), (form.and(Portable::splat(2.5), squares), 2.5)] {
                    let mut numbers = [0.0; Portable::WIDTH];
                    found.write(&mut numbers);
                    approx::assert_relative_eq!(f64::from(numbers[0]), of_squares(values) + more, epsilon = 1e-5);
                }
            }
            for (found, expected) in back.into_iter().zip(&vector) {
                let mut numbers = [0.0; Portable::WIDTH];
                found.write(&mut numbers);
                approx::assert_relative_eq!(f64::from(numbers[0]), *expected, epsilon = 1e-6);
            }
        }
    }
}
