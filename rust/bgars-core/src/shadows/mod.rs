//! Shadows of spheroids on a board: where they fall ([`model`]), what they cover ([`draw_shadows`]), and where their edges
//! really are ([`measure_edges`]).
//!
//! Everything is in pixels: x right, y up, origin at the image centre; heights are above the board.

mod edges;
mod map;
pub mod model;
mod stretch;

pub use edges::{EdgeSettings, Edges, Silhouettes, measure_edges};
pub use map::{Margins, ShadowMap, draw_shadows};
pub use stretch::{STRETCH_FIELDS, Stretch};
