//! What callers set, and what they get.

use crate::components::Component;

/// How exactly the systems between two re-weightings are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Setting {
    /// As published: Jacobi-preconditioned conjugate gradient to a thousandth, started from the last surface; and one equation
    /// for both focal lengths of a camera, exact where they are equal.
    Compatible,
    /// Multigrid-preconditioned conjugate gradient to a millionth.
    Converged,
}

/// Settings of [`super::integrate_bilateral`]; every limit is set.
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
}

impl Default for BilateralParams {
    fn default() -> Self {
        Self { k: 2.0, max_iters: 150, tolerance: 1e-4, setting: Setting::Converged }
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
