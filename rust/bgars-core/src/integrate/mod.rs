//! Height from normals: weighted least squares on the edges between neighbouring pixels of any mask.
//!
//! Each edge between two pixels of the mask asks `n_z dz = -n_x` (along x) or `n_z dz = -n_y` (along y, up). The normal
//! equations are a weighted graph Laplacian, a 5-point stencil that is never stored as a matrix.
//!
//! The way through the files, each of which uses those before it alone: `checkerboard` lays the pixels out; `stencil` is the operator
//! on a grid, `graph` the one on the connected parts of its blocks, which `aggregation` and `coarse_grid` make; `multigrid` is the
//! preconditioner of `system`, which `field` makes of normals; `conjugate_gradient` is faer's, and `solve` puts all of it to
//! work.

mod adjacency;
mod aggregation;
mod bilateral;
mod checkerboard;
mod checks;
mod coarse_grid;
mod conjugate_gradient;
mod field;
mod graph;
mod multigrid;
mod norm;
mod real;
mod settings;
mod solve;
mod stencil;
mod system;
mod vectors;

pub use crate::components::Component;
pub use bilateral::{BilateralParams, BilateralSurface, Pinhole, Setting, integrate_bilateral};
pub use multigrid::Multigrid;
pub use settings::{Difference, Field, Fit, OnProgress, Params, Progress, Surface};
pub use solve::{integrate, integrate_into, usable};
pub use system::{Operator, System};
