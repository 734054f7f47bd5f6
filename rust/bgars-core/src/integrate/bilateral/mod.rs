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
//! alternates, with the multigrid of least squares or, as published, with `jacobi`.

mod camera;
mod jacobi;
mod pixels;
mod reweigh;
mod settings;
mod solve;

pub use camera::Pinhole;
pub use settings::{BilateralParams, BilateralSurface, Setting};
pub use solve::integrate_bilateral;
