//! Everything that can go wrong, with the numbers that say why.

use std::path::PathBuf;

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// One variant a rule; each carries the argument, the rule and the offending value, which its message names.
#[allow(missing_docs)] // the messages say it
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error("reflectance: needs circles of balls to fit the material on, or a material that was fitted before")]
    NoMaterial,
    #[error("light_directions: at least 3 lights are needed, got {count}")]
    TooFewLights { count: usize },
    #[error("images and light_directions: {images} images but {lights} lights; they must be equal in number")]
    LightCountMismatch { images: usize, lights: usize },
    #[error(
        "light_directions: the lights are rank-deficient (parallel or in one plane): their conditioning \
         27 det(L^T L) / tr(L^T L)^3 is {conditioning:.1e}, at least {limit:.0e} is needed"
    )]
    RankDeficientLights { conditioning: f64, limit: f64 },
    #[error("light_directions[{index}]: must be a finite unit vector, got length {length:.4}")]
    NotUnitDirection { index: usize, length: f64 },
    #[error("light_positions[{index}]: must be finite and above the board plane (z > 0), got z = {z}")]
    LightBelowBoard { index: usize, z: f64 },
    #[error("light_intensities[{index}]: must be finite and above 0, got {value}")]
    BadIntensity { index: usize, value: f64 },
    #[error("{argument}: expected {expected} elements, got {actual}")]
    LengthMismatch { argument: &'static str, expected: usize, actual: usize },
    #[error("mask: no pixel to use (all False)")]
    EmptyMask,
    #[error("{argument}: must be {rule}, got {value}")]
    OutOfRange { argument: &'static str, rule: &'static str, value: f64 },
    #[error(
        "images[{image}]: {count} pixels inside the mask are not finite (first at row {row}, column {col}); mask them out"
    )]
    NonFinitePixel { image: usize, row: usize, col: usize, count: usize },
    #[error(
        "normals: at row {row}, column {col} inside the mask: must be {rule}, got ({}, {}, {}); mask such pixels out",
        normal[0], normal[1], normal[2]
    )]
    BadNormal { row: usize, col: usize, rule: &'static str, normal: [f32; 3] },
    #[error(
        "normals: {count} of {pixels} face away from the camera; check the axes (y up, z toward the camera) and the camera"
    )]
    LooksAway { count: usize, pixels: usize },
    #[error("weights: at row {row}, column {col}: must be finite and >= 0, got {value}")]
    BadWeight { row: usize, col: usize, value: f64 },
    #[error(
        "integration did not converge: relative residual {residual:.2e} after {iterations} iterations (asked for \
         {tolerance:.1e}); raise max_iters or the tolerance"
    )]
    NoConvergence { iterations: usize, residual: f64, tolerance: f64 },
    #[error("out of memory: {bytes} bytes of work memory are not available; integrate a smaller part of the image")]
    OutOfMemory { bytes: usize },
    #[error("cancelled")]
    Cancelled,
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: cannot be decoded as an image ({reason})", path.display())]
    Decode { path: PathBuf, reason: String },
    #[error("{}: this kind of image is not supported here ({reason})", path.display())]
    UnsupportedImage { path: PathBuf, reason: String },
    #[error(
        "{}: the header claims {width} x {height} pixels = {megapixels:.0} megapixels, more than the limit of \
         {limit_megapixels} (max_megapixels)",
        path.display()
    )]
    ImageTooLarge { path: PathBuf, width: u32, height: u32, megapixels: f64, limit_megapixels: f64 },
    #[error("{}: is {actual}, but the first image of the stack ({}) is {expected}; all must be alike", path.display(), first.display())]
    StackMismatch { path: PathBuf, first: PathBuf, expected: String, actual: String },
}

/// Refuses an array of another length than expected.
pub(crate) fn check_length(argument: &'static str, expected: usize, actual: usize) -> Result<()> {
    if expected == actual { Ok(()) } else { Err(Error::LengthMismatch { argument, expected, actual }) }
}

/// Refuses a number for which its rule does not hold.
pub(crate) fn check_rule(argument: &'static str, rule: &'static str, value: f64, holds: bool) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::OutOfRange { argument, rule, value }) }
}
