//! Everything that can go wrong, with the numbers that say why.

use std::path::PathBuf;

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, Error>;

/// One variant a rule; each carries the argument, the rule and the offending value.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Reflectance needs something to learn the material from.
    #[error("reflectance: needs circles of balls to fit the material on, or a material that was fitted before")]
    NoMaterial,
    /// Photometric stereo needs three equations a pixel.
    #[error("light_directions: at least 3 lights are needed, got {count}")]
    TooFewLights {
        /// Number of lights given.
        count: usize,
    },
    /// One image a light.
    #[error("images and light_directions: {images} images but {lights} lights; they must be equal in number")]
    LightCountMismatch {
        /// Number of images.
        images: usize,
        /// Number of lights.
        lights: usize,
    },
    /// All lights in one plane (or nearly so) leave one direction of the normal free.
    #[error(
        "light_directions: the lights are rank-deficient (parallel or in one plane): their conditioning \
         27 det(L^T L) / tr(L^T L)^3 is {conditioning:.1e}, at least {limit:.0e} is needed"
    )]
    RankDeficientLights {
        /// `27 det(L^T L) / tr(L^T L)^3`, 1 for evenly spread lights and 0 for coplanar ones.
        conditioning: f64,
        /// The smallest accepted value.
        limit: f64,
    },
    /// A light vector that is not a finite unit vector.
    #[error("light_directions[{index}]: must be a finite unit vector, got length {length:.4}")]
    NotUnitDirection {
        /// Light index.
        index: usize,
        /// Euclidean length found.
        length: f64,
    },
    /// A near light on or below the board plane, or not finite.
    #[error("light_positions[{index}]: must be finite and above the board plane (z > 0), got z = {z}")]
    LightBelowBoard {
        /// Light index.
        index: usize,
        /// Its z coordinate, in pixels.
        z: f64,
    },
    /// An intensity that is zero, negative or not finite.
    #[error("light_intensities[{index}]: must be finite and above 0, got {value}")]
    BadIntensity {
        /// Light index.
        index: usize,
        /// Value found.
        value: f64,
    },
    /// A buffer whose length does not fit its shape.
    #[error("{argument}: expected {expected} elements, got {actual}")]
    LengthMismatch {
        /// Name of the argument.
        argument: &'static str,
        /// Elements the shape asks for.
        expected: usize,
        /// Elements found.
        actual: usize,
    },
    /// A mask without a single pixel to use.
    #[error("mask: no pixel to use (all False)")]
    EmptyMask,
    /// A number outside its range.
    #[error("{argument}: must be {rule}, got {value}")]
    OutOfRange {
        /// Name of the argument.
        argument: &'static str,
        /// What is accepted.
        rule: &'static str,
        /// Value found.
        value: f64,
    },
    /// NaN or infinity in an image pixel that is to be used.
    #[error(
        "images[{image}]: {count} pixels inside the mask are not finite (first at row {row}, column {col}); mask them out"
    )]
    NonFinitePixel {
        /// Image index.
        image: usize,
        /// Row of the first such pixel.
        row: usize,
        /// Column of the first such pixel.
        col: usize,
        /// How many there are in that image.
        count: usize,
    },
    /// A normal inside the mask that is NaN, faces away from the camera, or is far from length 1.
    #[error(
        "normals: at row {row}, column {col} inside the mask: must be {rule}, got ({}, {}, {}); mask such pixels out",
        normal[0], normal[1], normal[2]
    )]
    BadNormal {
        /// Row of the first such pixel.
        row: usize,
        /// Column of the first such pixel.
        col: usize,
        /// What it must be.
        rule: &'static str,
        /// The normal found.
        normal: [f32; 3],
    },
    /// Most normals are seen from behind.
    #[error(
        "normals: {count} of {pixels} face away from the camera; check the axes (y up, z toward the camera) and the camera"
    )]
    LooksAway {
        /// Pixels inside the mask whose normal looks away.
        count: usize,
        /// Pixels inside the mask.
        pixels: usize,
    },
    /// A weight inside the mask that is negative or not finite.
    #[error("weights: at row {row}, column {col}: must be finite and >= 0, got {value}")]
    BadWeight {
        /// Row of the first such pixel.
        row: usize,
        /// Column of the first such pixel.
        col: usize,
        /// Value found.
        value: f64,
    },
    /// The solver stopped at its iteration limit.
    #[error(
        "integration did not converge: relative residual {residual:.2e} after {iterations} iterations (asked for \
         {tolerance:.1e}); raise max_iters or the tolerance"
    )]
    NoConvergence {
        /// Iterations done.
        iterations: usize,
        /// Relative residual reached.
        residual: f64,
        /// Relative residual asked for.
        tolerance: f64,
    },
    /// Work memory that the system does not give.
    #[error("out of memory: {bytes} bytes of work memory are not available; integrate a smaller part of the image")]
    OutOfMemory {
        /// Bytes asked for.
        bytes: usize,
    },
    /// The progress callback asked to stop.
    #[error("cancelled")]
    Cancelled,
    /// A file that cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file that is not the image it claims to be.
    #[error("{}: cannot be decoded as an image ({reason})", path.display())]
    Decode {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        reason: String,
    },
    /// A valid image of a kind this crate does not decode.
    #[error("{}: this kind of image is not supported here ({reason})", path.display())]
    UnsupportedImage {
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        reason: String,
    },
    /// An image header that claims more pixels than allowed; nothing was allocated for it.
    #[error(
        "{}: the header claims {width} x {height} pixels = {megapixels:.0} megapixels, more than the limit of \
         {limit_megapixels} (max_megapixels)",
        path.display()
    )]
    ImageTooLarge {
        /// The file.
        path: PathBuf,
        /// Claimed width in pixels.
        width: u32,
        /// Claimed height in pixels.
        height: u32,
        /// Claimed size in megapixels.
        megapixels: f64,
        /// The limit in megapixels.
        limit_megapixels: f64,
    },
    /// Images of one stack must agree in size and depth.
    #[error("{}: is {actual}, but the first image of the stack ({}) is {expected}; all must be alike", path.display(), first.display())]
    StackMismatch {
        /// The file that differs.
        path: PathBuf,
        /// The first file of the stack.
        first: PathBuf,
        /// What the first file is.
        expected: String,
        /// What this file is.
        actual: String,
    },
}
