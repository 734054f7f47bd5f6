//! Shadows of spheroids on a board: where they fall ([`model`]), what they cover ([`draw_shadows`]), where their edges
//! really are ([`measure_edges`]), and how far those are from predicted ones ([`edge_rows`]).
//!
//! Everything is in pixels: x right, y up, origin at the image centre; heights are above the board.

mod edges;
mod equations;
mod map;
pub mod model;
mod stretch;

pub use edges::{EdgeSettings, Edges, Silhouettes, measure_edges};
pub use equations::{COLUMNS, LightState, TERMS, WAVES, edge_products, edge_rows};
pub use map::{Margins, ShadowMap, draw_shadows};
pub use stretch::{STRETCH_FIELDS, Stretch};
