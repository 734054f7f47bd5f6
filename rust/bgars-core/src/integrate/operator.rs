//! The normal equations: a weighted graph Laplacian on the pixels of the mask, its blacks eliminated.

use rayon::prelude::*;

use super::Difference;
use super::checkerboard::{BAND_ROWS, Grid, Weights, split_row};
use crate::memory::zeros;

/// Smallest n_z of an edge: a normal seen edge-on has no finite slope.
const MIN_N_Z: f64 = 1e-3;

/// The pixels to integrate over, their normals and how much each is trusted.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// 3 values a pixel (x right, y up, z to the camera), row-major.
    pub normals: &'a [f32],
    /// True = use.
    pub mask: &'a [bool],
    /// Trust in each pixel, at least 0; `None`: all alike.
    pub weights: Option<&'a [f32]>,
    /// A number for each pixel: where it differs between neighbours, nothing joins them. `None`: all one.
    pub regions: Option<&'a [i32]>,
    /// Pixels in a row.
    pub width: usize,
}

/// A right side, or a solution, by colour.
#[derive(Debug)]
pub(super) struct Colours {
    pub reds: Vec<f64>,
    pub blacks: Vec<f64>,
}

/// One row of the field with its components apart; pixels outside the mask face the camera and are not trusted.
#[derive(Debug, Default, Clone)]
struct FieldRow {
    along: [Vec<f32>; 2],
    n_z: Vec<f32>,
    /// Square root of the pixel's weight, 0 outside the mask.
    trust: Vec<f64>,
}

/// Weights of the edges from a row's pixels to the next ones, and the height steps these ask for times the weights.
#[derive(Debug, Default, Clone)]
struct EdgeRow {
    weight: Vec<f32>,
    push: Vec<f64>,
}

impl FieldRow {
    fn load(&mut self, field: Field<'_>, row: usize) {
        let span = row * field.width..(row + 1) * field.width;
        let mask = &field.mask[span.clone()];
        self.trust.clear();
        match field.weights {
            Some(weights) => {
                let roots = weights[span.clone()].iter().map(|&weight| f64::from(weight).sqrt());
                self.trust.extend(roots.zip(mask).map(|(root, &used)| if used { root } else { 0.0 }));
            }
            None => self.trust.extend(mask.iter().map(|&used| f64::from(u8::from(used)))),
        }
        let normals = &field.normals[span.start * 3..span.end * 3];
        let component = |axis: usize, outside: f32| {
            normals.chunks_exact(3).zip(mask).map(move |(normal, &used)| if used { normal[axis] } else { outside })
        };
        for (axis, along) in self.along.iter_mut().enumerate() {
            along.clear();
            along.extend(component(axis, 0.0));
        }
        self.n_z.clear();
        self.n_z.extend(component(2, 1.0));
    }
}

impl EdgeRow {
    /// Edges from pixel k of `a` to pixel k of `b`; `sign` is +1 where the axis grows from `a` to `b`; `lead_is_a` says whose
    /// normal the forward difference takes.
    ///
    /// `n_z^2` is the weight that the paper's rows `n_z dz = -n_x` imply.
    #[allow(clippy::too_many_arguments)]
    fn join(
        &mut self,
        a: (&[f32], &[f32], &[f64]),
        b: (&[f32], &[f32], &[f64]),
        sign: f64,
        difference: Difference,
        lead_is_a: bool,
    ) {
        let edges = a.2.len().min(b.2.len());
        self.weight.clear();
        self.weight.resize(a.2.len(), 0.0);
        self.push.clear();
        self.push.resize(a.2.len(), 0.0);
        let (share_a, share_b) = match (difference, lead_is_a) {
            (Difference::Trapezoid, _) => (0.5, 0.5),
            (Difference::Forward, true) => (1.0, 0.0),
            (Difference::Forward, false) => (0.0, 1.0),
        };
        for k in 0..edges {
            let along = share_a * f64::from(a.0[k]) + share_b * f64::from(b.0[k]);
            let n_z = (share_a * f64::from(a.1[k]) + share_b * f64::from(b.1[k])).max(MIN_N_Z);
            let trust = a.2[k] * b.2[k];
            self.weight[k] = (trust * n_z * n_z) as f32;
            self.push[k] = -sign * trust * n_z * along;
        }
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

    fn clear(&mut self, width: usize) {
        self.weight.clear();
        self.weight.resize(width, 0.0);
        self.push.clear();
        self.push.resize(width, 0.0);
    }
}

/// Weights and right side `M^T v` of a field; both zero outside the mask.
pub(super) fn assemble(field: Field<'_>, difference: Difference) -> (Weights, Colours) {
    let width = field.width;
    let grid = Grid { height: field.mask.len() / width, width };
    let half = grid.half();
    let mut weights = Weights::zeros(grid);
    let mut right = Colours { reds: zeros(grid.half_pixels()), blacks: zeros(grid.half_pixels()) };
    let bands = weights
        .bands_mut()
        .zip(right.reds.par_chunks_mut(BAND_ROWS * half))
        .zip(right.blacks.par_chunks_mut(BAND_ROWS * half))
        .enumerate();
    bands.for_each(|(band, ((mut sides, reds), blacks))| {
        let first = band * BAND_ROWS;
        let rows = reds.len() / half;
        let [mut here, mut next] = [FieldRow::default(), FieldRow::default()];
        let [mut above, mut along, mut below] = [EdgeRow::default(), EdgeRow::default(), EdgeRow::default()];
        let join_rows = |upper: &FieldRow, lower: &FieldRow, edges: &mut EdgeRow| {
            // y grows upward: the forward difference starts at the lower pixel.
            edges.join(
                (&upper.along[1], &upper.n_z, &upper.trust),
                (&lower.along[1], &lower.n_z, &lower.trust),
                -1.0,
                difference,
                false,
            );
        };
        here.load(field, first);
        above.clear(width);
        if first > 0 {
            next.load(field, first - 1);
            join_rows(&next, &here, &mut above);
            above.cut(field, (first - 1) * width, width);
        }
        let mut left = vec![0.0f32; width];
        let mut unused = vec![0.0f32; half];
        let mut divergence = vec![0.0f64; width];
        for offset in 0..rows {
            let row = first + offset;
            along.join(
                (&here.along[0], &here.n_z, &here.trust),
                (&here.along[0][1..], &here.n_z[1..], &here.trust[1..]),
                1.0,
                difference,
                true,
            );
            along.cut(field, row * width, 1);
            if row + 1 < grid.height {
                next.load(field, row + 1);
                join_rows(&here, &next, &mut below);
                below.cut(field, row * width, width);
            } else {
                below.clear(width);
            }
            left[1..].copy_from_slice(&along.weight[..width - 1]);
            let pixels = [&left, &along.weight, &above.weight, &below.weight];
            for (side, pixels) in sides.iter_mut().zip(pixels) {
                split_row(row, pixels, &mut side[offset * (half + 1)..][..half], &mut unused);
            }
            for k in 0..width {
                divergence[k] = (above.push[k] - below.push[k]) - along.push[k];
            }
            for k in 1..width {
                divergence[k] += along.push[k - 1];
            }
            let span = offset * half..(offset + 1) * half;
            split_row(row, &divergence, &mut reds[span.clone()], &mut blacks[span]);
            std::mem::swap(&mut above, &mut below);
            std::mem::swap(&mut here, &mut next);
        }
    });
    (weights, right)
}
