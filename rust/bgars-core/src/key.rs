//! Comparisons of pixels that vectorise; a private supertrait, so that [`crate::Pixel`] stays with its three types.

use crate::vector::Vector;

/// What is sorted: grey levels as they come, or linear values.
pub trait Key: Copy {
    /// Bits as wide as a key, so that loops over both take the same vectors.
    type Bits: Copy + std::ops::Add<Output = Self::Bits> + From<u8>;
    /// Smaller than every other.
    const LEAST: Self;
    /// Larger than every other.
    const LARGEST: Self;
    /// What a dropped light counts as in a sum.
    const ZERO: Self;

    /// Values of a slice as floats.
    fn load<V: Vector>(from: &[Self]) -> V;
    /// The smaller of both.
    fn least(self, other: Self) -> Self;
    /// The larger of both.
    fn largest(self, other: Self) -> Self;
    /// True when `self` is over `below` by more than `gap`; `below` is at most `self`, or the answer is no.
    fn is_over(self, below: Self, gap: Self) -> bool;
    /// The largest of the keys that are not over `cutoff` by more than `gap`, or `cutoff` where none is larger; of 1, 2, 4 or 8 keys.
    fn reached<const COUNT: usize>(keys: [Self; COUNT], cutoff: Self, gap: Self) -> Self;
    /// The largest key step that is not over `gap` in values.
    fn gap(gap: f32) -> Self;
    /// The lowest byte.
    fn byte(bits: Self::Bits) -> u8;
}

macro_rules! integer_key {
    ($type:ty, $load:ident) => {
        impl Key for $type {
            type Bits = Self;
            const LEAST: Self = 0;
            const LARGEST: Self = Self::MAX;
            const ZERO: Self = 0;

            #[inline(always)]
            fn load<V: Vector>(from: &[Self]) -> V {
                V::$load(from)
            }

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

            #[inline(always)]
            fn reached<const COUNT: usize>(keys: [Self; COUNT], cutoff: Self, gap: Self) -> Self {
                let limit = cutoff.saturating_add(gap);
                // How far below the limit they are; what is over it wraps around and is farther than all that is not.
                let nearest = best(keys.map(|key| limit.wrapping_sub(key)), Self::min);
                limit - nearest.min(limit - cutoff)
            }

            fn gap(gap: f32) -> Self {
                // Steps are whole; a float too large saturates, and then nothing is over it.
                gap as Self
            }

            #[inline(always)]
            fn byte(bits: Self) -> u8 {
                bits as u8
            }
        }
    };
}
integer_key!(u8, from_bytes);
integer_key!(u16, from_words);

impl Key for f32 {
    type Bits = u32;

    const LEAST: Self = Self::NEG_INFINITY;
    const LARGEST: Self = Self::INFINITY;
    const ZERO: Self = 0.0;

    #[inline(always)]
    fn load<V: Vector>(from: &[Self]) -> V {
        V::load(from)
    }

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

    #[inline(always)]
    fn reached<const COUNT: usize>(keys: [Self; COUNT], cutoff: Self, gap: Self) -> Self {
        let within = keys.map(|key| if key.is_over(cutoff, gap) { Self::LEAST } else { key });
        cutoff.largest(best(within, Self::largest))
    }

    fn gap(gap: f32) -> Self {
        gap
    }

    #[inline(always)]
    fn byte(bits: u32) -> u8 {
        bits as u8
    }
}

/// One of 1, 2, 4 or 8 keys, by the choice between two. Pair by pair, not one after the other: none waits for long.
#[inline(always)]
fn best<K: Copy, const COUNT: usize>(mut keys: [K; COUNT], better: impl Fn(K, K) -> K) -> K {
    const { assert!(COUNT.is_power_of_two() && COUNT <= 8, "others would be passed over") };
    for half in [4, 2, 1] {
        if half < COUNT {
            for place in 0..half {
                keys[place] = better(keys[place], keys[place + half]);
            }
        }
    }
    keys[0]
}
