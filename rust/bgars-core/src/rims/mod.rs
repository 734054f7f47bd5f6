//! Silhouettes of balls: edges around a centre, the pixels around each rim, and what a rim looks like there. The fit itself is
//! Python's (`python/bgars/balls/rim_fit.py`).

mod bands;
mod edges;
mod profiles;

pub use bands::{Bands, Circle, bands};
pub use edges::{Planes, ring_edges};
pub use profiles::{ANGLES, PROFILES, STEPS_PER_PX, profiles};
