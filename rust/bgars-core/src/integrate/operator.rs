//! The normal equations: a weighted graph Laplacian on the pixels of the mask, its blacks eliminated.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::Difference;
use super::checkerboard::{Grid, Weights};
use super::edges::{Axis, Colours, EdgeRow, each_row, from_edges};
use super::real::greater;

/// Smallest n_z of an edge: a normal seen edge-on has no finite slope.
const MIN_N_Z: f64 = 1e-3;

/// The pixels to integrate over, their normals and how much each is trusted.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// 3 values a pixel (x right, y up, z to the camera), row-major.
    pub normals: &'a [f32],
    /// True = use.
    pub mask: &'a [bool],
    /// Trust in each pixel, at least 0, of which the ratios count; `None`: all alike.
    pub weights: Option<&'a [f32]>,
    /// A number for each pixel: where it differs between neighbours, nothing joins them. `None`: all one.
    pub regions: Option<&'a [i32]>,
    /// Pixels in a row.
    pub width: usize,
}

/// One row of the field with its components apart; pixels outside the mask face the camera and are not trusted.
#[derive(Debug, Default, Clone)]
struct FieldRow {
    along: [Vec<f32>; 2],
    n_z: Vec<f32>,
    /// Square root of the pixel's weight, 0 outside the mask.
    trust: Vec<f64>,
}

impl FieldRow {
    /// `unit` brings the weights to the size of 1.
    fn load(&mut self, field: Field<'_>, unit: f64, row: usize) {
        let span = row * field.width..(row + 1) * field.width;
        let mask = &field.mask[span.clone()];
        let [n_x, n_y] = &mut self.along;
        for component in [&mut *n_x, n_y, &mut self.n_z] {
            component.resize(mask.len(), 0.0);
        }
        self.trust.resize(mask.len(), 0.0);
        let normals = &field.normals[span.start * 3..span.end * 3];
        split_normals(normals, mask, [n_x, n_y, &mut self.n_z], &mut self.trust);
        if let Some(weights) = field.weights {
            for ((trust, &weight), &used) in self.trust.iter_mut().zip(&weights[span]).zip(mask) {
                *trust = if used { (f64::from(weight) * unit).sqrt() } else { 0.0 };
            }
        }
    }
}

/// The components of a row of normals, and 1 in the mask.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn split_normals(normals: &[f32], mask: &[bool], [n_x, n_y, n_z]: [&mut [f32]; 3], inside: &mut [f64]) {
    let (normals, n) = (normals.as_chunks::<3>().0, mask.len());
    let (normals, n_x, n_y, n_z) = (&normals[..n], &mut n_x[..n], &mut n_y[..n], &mut n_z[..n]);
    for k in 0..n {
        let [x, y, z] = normals[k];
        (n_x[k], n_y[k], n_z[k]) = if mask[k] { (x, y, z) } else { (0.0, 0.0, 1.0) };
    }
    for (inside, &used) in inside.iter_mut().zip(mask) {
        *inside = f64::from(u8::from(used));
    }
}

/// A row of the field as an edge sees it: the component along its axis, n_z, trust.
type Ends<'a> = (&'a [f32], &'a [f32], &'a [f64]);

impl EdgeRow {
    /// Edges from pixel k of `a` to pixel k of `b`; `sign` is +1 where the axis grows from `a` to `b`; `lead_is_a` says whose
    /// normal the forward difference takes.
    ///
    /// `n_z^2` is the weight that the paper's rows `n_z dz = -n_x` imply.
    fn join(&mut self, a: Ends<'_>, b: Ends<'_>, sign: f64, difference: Difference, lead_is_a: bool) {
        let normals = match (difference, lead_is_a) {
            (Difference::Trapezoid, _) => [a, b],
            // The mean of a normal with itself.
            (Difference::Forward, true) => [a, a],
            (Difference::Forward, false) => [b, b],
        };
        weigh(normals, [a.2, b.2], sign, &mut self.weight, &mut self.push);
    }

    /// Takes away the edges between regions: from pixel k of the image to pixel k + `stride`, k counted from `first`.
    fn cut(&mut self, field: Field<'_>, first: usize, stride: usize) {
        let Some(regions) = field.regions else { return };
        for (k, (weight, push)) in self.weight.iter_mut().zip(&mut self.push).enumerate() {
            let (a, b) = (first + k, first + k + stride);
            if b < regions.len() && regions[a] != regions[b] {
                (*weight, *push) = (0.0, 0.0);
            }
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
        let n_z = greater(f64::from(c_z[k]) + f64::from(d_z[k]), 2.0 * MIN_N_Z);
        let trusted = a_trust[k] * b_trust[k] * n_z;
        weight[k] = (0.25 * (trusted * n_z)) as f32;
        push[k] = (-0.25 * sign) * (trusted * along);
    }
}

/// The last two rows of a field that were asked for.
#[derive(Default)]
struct FieldRows {
    rows: [FieldRow; 2],
    loaded: [Option<usize>; 2],
}

impl FieldRows {
    fn load(&mut self, field: Field<'_>, unit: f64, row: usize) {
        if self.loaded[row % 2] != Some(row) {
            self.rows[row % 2].load(field, unit, row);
            self.loaded[row % 2] = Some(row);
        }
    }
}

/// The largest weight in the mask.
fn largest(weights: &[f32], mask: &[bool]) -> f64 {
    let inside = weights.par_iter().zip(mask).map(|(&weight, &used)| if used { weight } else { 0.0 });
    f64::from(inside.reduce(|| 0.0, f32::max))
}

/// The power of four that brings a weight near 1. Tolerances and the range of `f32` then mean the same for weights of any size,
/// and no digit of them or of their roots changes.
pub(super) fn to_unit(weight: f64) -> f64 {
    if weight > 0.0 { 4f64.powf(-(weight.log2() / 2.0).floor()) } else { 1.0 }
}

/// The edges of a field.
#[derive(Clone, Copy)]
pub(super) struct FieldEdges<'a> {
    field: Field<'a>,
    difference: Difference,
    /// What brings the weights of the field to the size of 1.
    unit: f64,
}

impl<'a> FieldEdges<'a> {
    pub fn new(field: Field<'a>, difference: Difference) -> Self {
        let unit = field.weights.map_or(1.0, |weights| to_unit(largest(weights, field.mask)));
        Self { field, difference, unit }
    }

    /// Weights and right side `M^T v`; both zero outside the mask.
    pub fn assemble(&self) -> (Weights, Colours) {
        from_edges(self.grid(), || self.joiner())
    }

    /// Some rows of that right side, made anew.
    pub fn right_side(&self, rows: Range<usize>, colours: [&mut [f64]; 2]) {
        each_row(self.grid(), self.joiner(), rows, colours, |_, _| ());
    }

    fn grid(&self) -> Grid {
        Grid { height: self.field.mask.len() / self.field.width, width: self.field.width }
    }

    /// Sets the edges of one row after another.
    fn joiner(&self) -> impl FnMut(Axis, usize, &mut EdgeRow) + use<'a> {
        let Self { field, difference, unit } = *self;
        let width = field.width;
        let mut rows = FieldRows::default();
        move |axis: Axis, row: usize, edges: &mut EdgeRow| {
            rows.load(field, unit, row);
            let FieldRow { along, n_z, trust } = &rows.rows[row % 2];
            match axis {
                Axis::Right => {
                    let (a, b) = ((&along[0][..], &n_z[..], &trust[..]), (&along[0][1..], &n_z[1..], &trust[1..]));
                    edges.join(a, b, 1.0, difference, true);
                    edges.cut(field, row * width, 1);
                }
                Axis::Below => {
                    rows.load(field, unit, row + 1);
                    let [upper, lower] = [&rows.rows[row % 2], &rows.rows[(row + 1) % 2]];
                    let a = (&upper.along[1][..], &upper.n_z[..], &upper.trust[..]);
                    // y grows upward: the forward difference starts at the lower pixel.
                    edges.join(a, (&lower.along[1], &lower.n_z, &lower.trust), -1.0, difference, false);
                    edges.cut(field, row * width, width);
                }
            }
        }
    }
}

/// Weights and right side of a field, as by [`FieldEdges::assemble`].
pub(super) fn assemble(field: Field<'_>, difference: Difference) -> (Weights, Colours) {
    FieldEdges::new(field, difference).assemble()
}
