//! Normals of shiny balls by their reflectance: the highlights are information, once the material is known.

mod anchor;
mod ball;
mod cells;
mod choose;
mod disc;
mod estimate;
mod fit;
mod flat_top;
mod material;
mod observe;
mod odd;
mod refine;
mod regions;
mod residuals;
mod samples;
mod scale;
mod spread;
mod table;
mod variation;

pub use anchor::Circle;
pub use estimate::{Findings, MAX_LOSS, MIN_LIGHTS, Request, estimate_into};
pub use fit::{MaterialFit, parameter_names};
pub use flat_top::FlatTop;
pub use material::{Facet, Lobe, Masking, Material};
