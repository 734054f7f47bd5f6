//! Whether what was read is finite.

use super::cutoff::{LANES, Lanes};
use crate::Pixel;
use crate::vector::Vector;

/// False where a value is NaN or infinite. Asked where the values are at hand: a search of its own reads the images twice.
/// Of many images this light pass also has them in the first cache sooner than the work itself.
#[inline(always)]
pub(super) fn are_finite<K: Pixel, V: Vector>(keys: &[&Lanes<K>]) -> bool {
    /// Sums that need not wait for one another.
    const SUMS: usize = 4;
    let zero = V::splat(0.0);
    let mut sums = [zero; SUMS];
    let (whole, rest) = keys.as_chunks::<SUMS>();
    for step in 0..LANES / V::WIDTH {
        for key in rest {
            // 0 times something finite is 0, else NaN.
            sums[0] = K::load::<V>(&key[step * V::WIDTH..]).times_plus(zero, sums[0]);
        }
    }
    for keys in whole {
        for light in 0..SUMS {
            for step in 0..LANES / V::WIDTH {
                sums[light] = K::load::<V>(&keys[light][step * V::WIDTH..]).times_plus(zero, sums[light]);
            }
        }
    }
    let [a, b, c, d] = sums;
    is_finite((a + b) + (c + d))
}

/// False where one of the values is not.
#[inline(always)]
pub(super) fn is_finite<V: Vector>(values: V) -> bool {
    V::all((values * V::splat(0.0)).is_over(V::splat(-1.0)))
}
