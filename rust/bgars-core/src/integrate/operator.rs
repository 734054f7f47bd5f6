//! The normal equations as a stencil: a weighted graph Laplacian on the pixels of the mask.

use std::sync::atomic::{AtomicBool, Ordering};

use faer::dyn_stack::{MemStack, StackReq};
use faer::matrix_free::LinOp;
use faer::{MatMut, MatRef, Par};
use rayon::prelude::*;

use super::Difference;

/// Smallest n_z of an edge: a normal seen edge-on has no finite slope.
const MIN_N_Z: f64 = 1e-3;

/// `M^T M` on a full grid; pixels outside the mask have no edges, so their rows are zero.
#[derive(Debug)]
pub(super) struct Laplacian<'a> {
    width: usize,
    /// Weight of the edge from each pixel to its right neighbour; 0 where there is none.
    right: Vec<f64>,
    /// Weight of the edge from each pixel to the one below; 0 where there is none.
    below: Vec<f64>,
    /// Sum of the weights of a pixel's edges.
    pub diagonal: Vec<f64>,
    /// Set to make the solver stop; see [`LinOp::apply`] below.
    cancelled: &'a AtomicBool,
}

/// The pixels to integrate over, their normals and how much each is trusted.
#[derive(Clone, Copy)]
pub(super) struct Field<'a> {
    pub normals: &'a [f32],
    pub mask: &'a [bool],
    pub weights: Option<&'a [f32]>,
    pub width: usize,
}

impl Field<'_> {
    /// Weight of the edge `a -> b` and the height step `z_b - z_a` it asks for times that weight.
    ///
    /// `step` is the component of the normal along the edge with the sign of `b - a`; `n_z^2` is the weight that the paper's
    /// rows `n_z dz = -n_x` imply.
    #[inline]
    fn edge(&self, a: usize, b: usize, axis: usize, sign: f64, difference: Difference, lead: usize) -> (f64, f64) {
        let component = |pixel: usize, axis: usize| f64::from(self.normals[pixel * 3 + axis]);
        let (along, n_z) = match difference {
            Difference::Trapezoid => {
                (f64::midpoint(component(a, axis), component(b, axis)), f64::midpoint(component(a, 2), component(b, 2)))
            }
            Difference::Forward => (component(lead, axis), component(lead, 2)),
        };
        let n_z = n_z.max(MIN_N_Z);
        let trust = self.weights.map_or(1.0, |weights| (f64::from(weights[a]) * f64::from(weights[b])).sqrt());
        (trust * n_z * n_z, -trust * n_z * along * sign)
    }
}

impl<'a> Laplacian<'a> {
    /// The operator and its right side `M^T v` (zero outside the mask).
    pub fn new(field: Field<'_>, difference: Difference, cancelled: &'a AtomicBool) -> (Self, Vec<f64>) {
        let Field { mask, width, .. } = field;
        let pixels = mask.len();
        let mut right = vec![0.0; pixels];
        let mut below = vec![0.0; pixels];
        let mut diagonal = vec![0.0; pixels];
        let mut divergence = vec![0.0; pixels];
        for pixel in (0..pixels).filter(|&pixel| mask[pixel]) {
            let mut add = |a: usize, b: usize, (weight, push): (f64, f64)| {
                diagonal[a] += weight;
                diagonal[b] += weight;
                divergence[a] -= push;
                divergence[b] += push;
                weight
            };
            let neighbour = pixel + 1;
            if neighbour % width != 0 && mask[neighbour] {
                right[pixel] = add(pixel, neighbour, field.edge(pixel, neighbour, 0, 1.0, difference, pixel));
            }
            let neighbour = pixel + width;
            if neighbour < pixels && mask[neighbour] {
                // y grows upward: the forward difference starts at the lower pixel.
                below[pixel] = add(pixel, neighbour, field.edge(pixel, neighbour, 1, -1.0, difference, neighbour));
            }
        }
        (Self { width, right, below, diagonal, cancelled }, divergence)
    }

    /// `out = A x`, one row of pixels a task.
    pub fn multiply(&self, out: &mut [f64], x: &[f64]) {
        let width = self.width;
        out.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
            let start = row * width;
            for (col, out) in out.iter_mut().enumerate() {
                let pixel = start + col;
                let mut sum = self.diagonal[pixel] * x[pixel];
                if col > 0 {
                    sum -= self.right[pixel - 1] * x[pixel - 1];
                }
                if col + 1 < width {
                    sum -= self.right[pixel] * x[pixel + 1];
                }
                if row > 0 {
                    sum -= self.below[pixel - width] * x[pixel - width];
                }
                if pixel + width < x.len() {
                    sum -= self.below[pixel] * x[pixel + width];
                }
                *out = sum;
            }
        });
    }
}

/// The only column of a vector handed over by faer, as a slice.
pub(super) fn column(x: MatRef<'_, f64>) -> &[f64] {
    x.col(0).try_as_col_major().expect("faer hands over contiguous vectors").as_slice()
}

/// The same, to write.
pub(super) fn column_mut(x: MatMut<'_, f64>) -> &mut [f64] {
    x.col_mut(0).try_as_col_major_mut().expect("faer hands over contiguous vectors").as_slice_mut()
}

impl LinOp<f64> for Laplacian<'_> {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        self.diagonal.len()
    }

    fn ncols(&self) -> usize {
        self.diagonal.len()
    }

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        let (out, rhs) = (column_mut(out), column(rhs));
        if self.cancelled.load(Ordering::Relaxed) {
            // faer's solver has no way to stop early, but it gives up on an operator that is not positive definite.
            for (out, rhs) in out.iter_mut().zip(rhs) {
                *out = -rhs;
            }
        } else {
            self.multiply(out, rhs);
        }
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}
