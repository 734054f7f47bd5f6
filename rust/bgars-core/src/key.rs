//! Comparisons of pixels that vectorise; a private supertrait, so that [`crate::Pixel`] stays with its three types.

/// What is sorted: grey levels as they come, or linear values.
pub trait Key: Copy {
    /// Larger than every other.
    const LARGEST: Self;
    /// Smaller than every other.
    const LEAST: Self;
    /// No light.
    const ZERO: Self;

    /// The smaller of both.
    fn least(self, other: Self) -> Self;
    /// The larger of both.
    fn largest(self, other: Self) -> Self;
    /// True when `self` is over `below` by more than `gap`; where it is below, the answer is no.
    fn is_over(self, below: Self, gap: Self) -> bool;
    /// The largest key step that is not over `gap` in values.
    fn gap(gap: f32) -> Self;
}

macro_rules! integer_key {
    ($type:ty) => {
        impl Key for $type {
            const LARGEST: Self = Self::MAX;
            const LEAST: Self = 0;
            const ZERO: Self = 0;

            #[inline(always)]
            fn least(self, other: Self) -> Self {
                self.min(other)
            }

            #[inline(always)]
            fn largest(self, other: Self) -> Self {
                self.max(other)
            }

            #[inline(always)]
            fn is_over(self, below: Self, gap: Self) -> bool {
                self.saturating_sub(below) > gap
            }

            fn gap(gap: f32) -> Self {
                // Steps are whole; a float too large saturates, and then nothing is over it.
                gap as Self
            }
        }
    };
}
integer_key!(u8);
integer_key!(u16);

impl Key for f32 {
    const LARGEST: Self = Self::INFINITY;
    const LEAST: Self = Self::NEG_INFINITY;
    const ZERO: Self = 0.0;

    // Not f32::min and f32::max: these take care of NaN, which costs three instructions instead of one.
    #[inline(always)]
    fn least(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn largest(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn is_over(self, below: Self, gap: Self) -> bool {
        self - below > gap
    }

    fn gap(gap: f32) -> Self {
        gap
    }
}
