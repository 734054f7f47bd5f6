//! The normal equations of a field of normals: its edges and the system that they make.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::Crop;
use super::checks::check;
use super::settings::{Difference, Field, Params};
use super::stencil::{EdgeRow, Stencil};
use super::system::System;
use crate::Result;

/// Smallest n_z of an edge: a normal seen edge-on has no finite slope.
const MIN_N_Z: f64 = 1e-3;

/// One row of the field with its components apart; pixels outside the mask face the camera and are not trusted.
#[derive(Default)]
struct FieldRow {
    along: [Vec<f32>; 2],
    n_z: Vec<f32>,
    /// Square root of the pixel's weight, 0 outside the mask.
    trust: Vec<f64>,
}

impl FieldRow {
    /// `unit` brings the weights to the size of 1.
    fn load(&mut self, field: Field<'_>, crop: Crop, unit: f64, row: usize) {
        let first = (crop.row + row) * field.width + crop.col;
        let width = crop.grid.width;
        let trust = |pixel: usize| field.weights.map_or(1.0, |weights| (f64::from(weights[pixel]) * unit).sqrt());
        let Self { along: [n_x, n_y], n_z, trust: trusts } = self;
        for component in [&mut *n_x, n_y, n_z] {
            component.resize(width, 0.0);
        }
        trusts.resize(width, 0.0);
        let normals = field.normals[3 * first..3 * (first + width)].as_chunks::<3>().0;
        for (k, (&[x, y, z], &used)) in normals.iter().zip(&field.mask[first..first + width]).enumerate() {
            (n_x[k], n_y[k], n_z[k]) = if used { (x, y, z) } else { (0.0, 0.0, 1.0) };
            trusts[k] = if used { trust(first + k) } else { 0.0 };
        }
    }
}

/// A row of the field as an edge sees it: the component along its axis, n_z, trust.
type Ends<'a> = (&'a [f32], &'a [f32], &'a [f64]);

/// Edges from pixel k of `a` to pixel k of `b`; `sign` is +1 where the axis grows from `a` to `b`; `lead_is_a` says whose
/// normal the forward difference takes.
///
/// `n_z^2` is the weight that the paper's rows `n_z dz = -n_x` imply.
fn join(edges: &mut EdgeRow<f32>, [a, b]: [Ends<'_>; 2], sign: f64, difference: Difference, lead_is_a: bool) {
    let normals = match (difference, lead_is_a) {
        (Difference::Trapezoid, _) => [a, b],
        // The mean of a normal with itself.
        (Difference::Forward, true) => [a, a],
        (Difference::Forward, false) => [b, b],
    };
    weigh(normals, [a.2, b.2], sign, &mut edges.weight, &mut edges.push);
}

/// Takes away the edges between regions: from pixel k of the image to pixel k + `stride`, k counted from `first`.
fn cut(edges: &mut EdgeRow<f32>, field: Field<'_>, first: usize, stride: usize) {
    let Some(regions) = field.regions else { return };
    for (k, (weight, push)) in edges.weight.iter_mut().zip(&mut edges.push).enumerate() {
        let (a, b) = (first + k, first + k + stride);
        if b < regions.len() && regions[a] != regions[b] {
            (*weight, *push) = (0.0, 0.0);
        }
    }
}

/// Weight and push of the edges between the pixels of two rows, from the mean of two rows of normals.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn weigh([c, d]: [Ends<'_>; 2], trust: [&[f64]; 2], sign: f64, weight: &mut [f32], push: &mut [f64]) {
    let edges = trust[0].len().min(trust[1].len());
    let [c_along, c_z, d_along, d_z] = [c.0, c.1, d.0, d.1].map(|values| &values[..edges]);
    let [a_trust, b_trust] = trust.map(|values| &values[..edges]);
    let (weight, push) = (&mut weight[..edges], &mut push[..edges]);
    for k in 0..edges {
        // Twice the means; halves of them change no digit.
        let along = f64::from(c_along[k]) + f64::from(d_along[k]);
        let n_z = (f64::from(c_z[k]) + f64::from(d_z[k])).max(2.0 * MIN_N_Z);
        let trusted = a_trust[k] * b_trust[k] * n_z;
        weight[k] = (0.25 * (trusted * n_z)) as f32;
        push[k] = (-0.25 * sign) * (trusted * along);
    }
}

fn largest(weights: &[f32], mask: &[bool]) -> f64 {
    let inside = weights.par_iter().zip(mask).map(|(&weight, &used)| if used { weight } else { 0.0 });
    f64::from(inside.reduce(|| 0.0, f32::max))
}

/// The power of four that brings a weight near 1. Tolerances and the range of `f32` then mean the same for weights of any size,
/// and no digit of them or of their roots changes.
pub(super) fn to_unit(weight: f64) -> f64 {
    if weight > 0.0 { 4f64.powf(-(weight.log2() / 2.0).floor()) } else { 1.0 }
}

/// Weights and right side `M^T v` of a field within the bounding box of its mask.
pub(super) fn assemble(field: Field<'_>, crop: Crop, difference: Difference) -> System {
    let unit = field.weights.map_or(1.0, |weights| to_unit(largest(weights, field.mask)));
    let rows_of = || {
        let (mut rows, mut loaded) = (<[FieldRow; 2]>::default(), None);
        move |row: usize, right: &mut EdgeRow<f32>, below: &mut EdgeRow<f32>| {
            let first = (crop.row + row) * field.width + crop.col;
            if loaded != Some(row) {
                rows[0].load(field, crop, unit, row);
            }
            let FieldRow { along, n_z, trust } = &rows[0];
            let ends = [(&along[0][..], &n_z[..], &trust[..]), (&along[0][1..], &n_z[1..], &trust[1..])];
            join(right, ends, 1.0, difference, true);
            cut(right, field, first, 1);
            if row + 1 == crop.grid.height {
                below.clear();
                return;
            }
            rows[1].load(field, crop, unit, row + 1);
            let ends = rows.each_ref().map(|row| (&row.along[1][..], &row.n_z[..], &row.trust[..]));
            // y grows upward: the forward difference starts at the lower pixel.
            join(below, ends, -1.0, difference, false);
            cut(below, field, first, field.width);
            rows.swap(0, 1);
            loaded = Some(row + 1);
        }
    };
    let mut right = [(); 2].map(|()| vec![0.0; crop.grid.half_pixels()]);
    let stencil = Stencil::from_edges(crop.grid, rows_of, Some(&mut right));
    System::reduce(stencil, right)
}

impl System {
    /// The system of a field; see [`super::integrate`] for the arguments.
    ///
    /// # Errors
    /// Those of [`super::integrate`] that concern the input.
    pub fn new(
        normals: &[f32],
        mask: &[bool],
        width: usize,
        weights: Option<&[f32]>,
        difference: Difference,
    ) -> Result<Self> {
        let field = Field { normals, mask, weights, regions: None, width };
        check(field, &Params { difference, ..Params::default() })?;
        Ok(assemble(field, field.whole(), difference))
    }
}
