//! Bilateral integration: one-sided differences, re-weighted so that a surface may jump between two pixels.
//!
//! Cao, Santo, Shi, Okura and Matsushita, "Bilateral Normal Integration", ECCV 2022. With one-sided differences `d+` and `d-`
//! of the height along an axis, both taken in the direction in which the axis grows, the functional is
//!
//! `sum over pixels and axes of w+ (g d+ z + n)^2 + w- (g d- z + n)^2`,
//! `w+ = 1 / (1 + exp(-k ((g d- z)^2 - (g d+ z)^2)))`, `w- = 1 - w+` (their eqs. 11, 14 and 16),
//!
//! minimised by solving for z with the weights held, and again with the weights of that z. `n` is the component of the
//! normal along the axis; `g` is `n_z`, or what `camera` says in perspective, where z is minus the logarithm of the depth.
//! A difference to a pixel outside the mask counts as zero, as published; its term is a constant that only the weights feel.
//!
//! The way through the files: `pixels` holds what does not change, `reweigh` makes the weights of a surface, and `solve`
//! alternates. Inside, `assemble` makes the 5-point system of the weights for the multigrid of least squares; or
//! `normal_equations` makes it in a `frame` for `jacobi`, which takes two iterations in a `sweep`.

mod assemble;
mod band;
mod camera;
mod frame;
mod jacobi;
mod normal_equations;
mod number;
mod pixels;
mod published;
mod renewal;
mod reweigh;
mod rows;
mod scaling;
mod solve;
mod sweep;

pub use camera::Pinhole;
pub use solve::integrate_bilateral;

use super::Component;

/// How exactly the systems between two re-weightings are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// As published: Jacobi-preconditioned conjugate gradient to a thousandth, started from the last surface; and one equation
    /// for both focal lengths of a camera, exact where they are equal.
    Compatible,
    /// Multigrid-preconditioned conjugate gradient to a millionth.
    Converged,
}

/// Numbers of the inner solver's vectors; weights, right side and surface are `f64` always.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// `f64`.
    Double,
    /// `f32` within a solve, which finds the change of the surface only; a residual that rounding leads away is replaced by the
    /// true one. [`Setting::Compatible`] alone has it.
    Single,
}

/// Settings of [`integrate_bilateral`]; every limit is set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BilateralParams {
    /// Sharpness of the sigmoid: at 0 both sides always count alike, above 2 a step of a pixel is a jump.
    pub k: f64,
    /// Most re-weightings. Reaching it is no error: see [`BilateralSurface::converged`].
    pub max_iters: usize,
    /// Stop when the energy changes by less than this times itself.
    pub tolerance: f64,
    /// How exactly the systems are solved.
    pub setting: Setting,
    /// Numbers of the inner solver.
    pub precision: Precision,
}

impl Default for BilateralParams {
    fn default() -> Self {
        Self { k: 2.0, max_iters: 150, tolerance: 1e-4, setting: Setting::Converged, precision: Precision::Double }
    }
}

/// A surface that may jump; without a camera heights in pixels, with one minus the logarithm of the depth.
#[derive(Clone, Debug)]
pub struct BilateralSurface {
    /// Height, row-major, zero mean in each component; NaN outside the mask.
    pub height: Vec<f32>,
    /// Weight of the difference to the right; the one to the left has the rest. 1/2 = smooth, 0 or 1 = a jump. NaN outside.
    pub rightward: Vec<f32>,
    /// The same for the difference upward.
    pub upward: Vec<f32>,
    /// Index of each pixel's component, -1 outside the mask.
    pub labels: Vec<i32>,
    /// The connected components of the mask (4-neighbourhood), in the order of their first pixels.
    pub components: Vec<Component>,
    /// Energy after each re-weighting.
    pub energies: Vec<f64>,
    /// Whether the energy came to rest before the last allowed re-weighting, and the last system was solved.
    pub converged: bool,
    /// Iterations of all inner solves.
    pub inner_iterations: usize,
    /// Largest residual that an inner solve left, relative to its right side.
    pub residual: f64,
}
