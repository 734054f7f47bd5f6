//! Normals of shiny balls by their reflectance: the highlights are information, once the material is known.

mod anchor;
mod ball;
mod ball_normal;
mod ball_pixels;
mod cells;
mod choose;
mod disc;
mod estimate;
mod fit;
mod flat_top;
mod left_out;
mod material;
mod observe;
mod odd;
mod refine;
mod regions;
mod residuals;
mod samples;
mod scale;
mod shape;
mod spread;
mod table;
mod variation;

pub use anchor::{Circle, Shape};
pub use estimate::{Findings, MAX_LOSS, MIN_LIGHTS, Request, estimate_into};
pub use fit::{MaterialFit, parameter_names};
pub use flat_top::FlatTop;
pub use left_out::LeftOut;
pub use material::{Facet, Lobe, Masking, Material};
pub use shape::CommonShape;
