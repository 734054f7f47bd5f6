//! Photometric stereo for shiny parts: one camera, several lights, one image a light.
//!
//! The data flows one way:
//! [`ImageStack`] + [`Lights`] -> [`normals::estimate`] -> [`integrate::integrate`] -> [`mesh::triangulate`].
//!
//! Conventions: image arrays are row-major and indexed `[row, col]`; world axes are x right (+col), **y up (-row)**,
//! z toward the camera; light directions point from the surface to the light; lengths are pixels unless a name says `_um`.

#![forbid(unsafe_code)]

pub mod assignment;
pub mod blind;
mod components;
pub mod error;
pub mod integrate;
pub mod io;
pub mod lights;
mod median;
pub mod mesh;
pub mod normal_distribution;
pub mod normals;
pub mod pixel;
pub mod radiometry;
mod readings;
pub mod reflectance;
pub mod rims;
pub mod shadows;
pub mod stack;
pub mod vertex_normals;

pub use error::{Error, Result};
pub use lights::Lights;
pub use pixel::Pixel;
pub use radiometry::Radiometry;
pub use stack::ImageStack;
