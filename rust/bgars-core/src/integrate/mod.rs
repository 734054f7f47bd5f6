//! Height from normals: weighted least squares on the edges between neighbouring pixels of any mask.
//!
//! Each edge between two pixels of the mask asks `n_z dz = -n_x` (along x) or `n_z dz = -n_y` (along y, up). The normal
//! equations are a weighted graph Laplacian, a 5-point stencil that is never stored as a matrix.
//!
//! The way through the files: `operator` makes `edges` of the normals, these the system on a `checkerboard`; `reduction`
//! eliminates every other pixel; `conjugate_gradient` solves for the rest (`settle` says what is left, and ends it),
//! preconditioned by `multigrid`, whose grids come from `coarsen` (after `fill` has closed the smallest holes, and `stops` has
//! led lanes across; `edge_bits` tell where) and talk to each other by `transfer`. What a coarser grid cannot hold, nor lead
//! around (`detours`), is found by `lost`; it goes as `strays` to the `graph` that takes over from the last grid.

mod bilateral;
mod checkerboard;
mod coarsen;
mod components;
mod conjugate_gradient;
mod detours;
mod edge_bits;
mod edges;
mod fill;
mod graph;
mod lost;
mod multigrid;
mod operator;
mod places;
mod real;
mod reduction;
mod residual;
mod ring;
mod settle;
mod solve;
mod spans;
mod stencil;
mod steps;
mod stops;
mod strays;
mod system;
mod transfer;

pub use bilateral::{BilateralParams, BilateralSurface, Pinhole, Precision, Setting, integrate_bilateral};
pub use components::Component;
pub use operator::Field;
pub use solve::{integrate, integrate_field, integrate_into, usable};
pub use system::{Operator, System, VCycle};

use std::ops::ControlFlow;

/// How the slope of an edge follows from the normals of its two pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Difference {
    /// The mean of both normals: second order, no shift.
    Trapezoid,
    /// The normal of the left (lower) pixel alone, as printed in the paper; shifts the surface by half a pixel.
    Forward,
}

/// Settings of [`integrate`]; every limit is set.
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

/// Callback of [`integrate`]; `Break` stops the solver.
pub type OnProgress<'a> = &'a mut dyn FnMut(Progress) -> ControlFlow<()>;

/// What [`integrate_into`] says of the surface that it wrote.
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
#[derive(Clone, Debug)]
pub struct Surface {
    /// Height in pixels, row-major; NaN outside the mask.
    pub height_px: Vec<f32>,
    /// Index of each pixel's component, -1 outside the mask.
    pub labels: Vec<i32>,
    /// The connected components (4-neighbourhood), in the order of their first pixels.
    pub components: Vec<Component>,
    /// Iterations of the conjugate gradient.
    pub iterations: usize,
    /// True residual norm at the end, relative to the right side.
    pub residual: f64,
}
