//! Constants in memory as whole registers, which arithmetic takes as operands.

/// Floats of the widest register.
pub(super) const WIDEST: usize = 16;

/// A number as often as the widest register holds.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))] // a cache line
pub struct Spread(pub(super) [f32; WIDEST]);

impl Spread {
    /// Of a number.
    #[must_use]
    pub fn new(value: f32) -> Self {
        Self([value; WIDEST])
    }
}
