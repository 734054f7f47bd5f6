//! Silhouettes of balls: edges around a centre, the pixels around each rim, what a rim looks like there, and the normal
//! equations of its fit. The fit itself is Python's (`python/bgars/balls/rim_fit.py`).

mod bands;
mod edges;
mod eliminate;
mod profiles;

pub use bands::{Bands, Circle, bands};
pub use edges::{Planes, ring_edges};
pub use eliminate::{BASIS, Eliminated, RimPixels, SLOPES, eliminate};
pub use profiles::{ANGLES, PROFILES, STEPS_PER_PX, profiles};
