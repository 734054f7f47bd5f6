//! What callers set, and what they get.

use std::ops::ControlFlow;

use super::checkerboard::{Crop, Grid};
use crate::components::Component;

/// How the slope of an edge follows from the normals of its two pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// The mean of both normals: second order, no shift.
    Trapezoid,
    /// The normal of the left (lower) pixel alone, as printed in the paper; shifts the surface by half a pixel.
    Forward,
}

/// Settings of [`super::integrate`]; every limit is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Scheme of the edges.
    pub difference: Difference,
    /// Stop when the residual norm is at most this times the norm of the right side.
    pub relative_tolerance: f64,
    /// Stop when the residual norm is at most this times the square root of the number of pixels, in pixels.
    pub absolute_tolerance: f64,
    /// Most iterations before [`crate::Error::NoConvergence`].
    pub max_iters: usize,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            difference: Difference::Trapezoid,
            relative_tolerance: 1e-8,
            absolute_tolerance: 1e-12,
            max_iters: 2_000,
        }
    }
}

/// State of the solver, handed to the progress callback once an iteration.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// Iterations done.
    pub iteration: usize,
    /// Residual norm relative to the right side.
    pub residual: f64,
}

/// Callback of [`super::integrate`]; `Break` stops the solver.
pub type OnProgress<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// What [`super::integrate_into`] says of the surface that it wrote.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The connected components (4-neighbourhood), in the order of their first pixels.
    pub components: Vec<Component>,
    /// Iterations of the conjugate gradient.
    pub iterations: usize,
    /// True residual norm at the end, relative to the right side.
    pub residual: f64,
}

/// A height map in pixels, defined up to one constant a component (chosen so that each has zero mean).
#[allow(missing_docs)] // as of a [`Fit`]
#[derive(Clone, Debug)]
pub struct Surface {
    /// Height in pixels, row-major; NaN outside the mask.
    pub height_px: Vec<f32>,
    /// Index of each pixel's component, -1 outside the mask.
    pub labels: Vec<i32>,
    pub components: Vec<Component>,
    pub iterations: usize,
    pub residual: f64,
}

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

impl Field<'_> {
    /// All of the image.
    pub(super) fn whole(&self) -> Crop {
        let grid = Grid { height: self.mask.len() / self.width, width: self.width };
        Crop { row: 0, col: 0, grid }
    }
}
