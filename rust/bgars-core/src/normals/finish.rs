//! From the least squares of some pixels to what the result holds.

use bytemuck::NoUninit;

use super::confidence::HALF_DEG;
use super::cutoff::{LANES, Lanes};
use super::lane_solve::Careful;
use super::out::Block;
use crate::stream;
use crate::vector::Vector;

/// `n_z` below which `f32` cannot say whether a facet faces the camera.
const GRAZING: f32 = 1e-5;

/// Least `rho^2` that leaves residuals and inverses in the normal range of `f32`, and one over the largest `|rho n|^2`.
const MIN_SQUARE: f32 = 1e-30;

/// The smallest float above zero.
const LEAST: f32 = f32::from_bits(1);

/// The least squares of some pixels.
#[derive(Clone, Copy)]
pub(super) struct Facets<V> {
    /// `g = rho n`, by component.
    pub scaled: [V; 3],
    /// `|I|^2`.
    pub values_square: V,
    /// `|g|^2`.
    pub square: V,
    /// `rho = |g|`.
    pub length: V,
    /// `1 / rho`.
    pub inverse: V,
    /// With the [prior](super::confidence::PRIOR_RESIDUAL).
    pub squared_residuals: V,
    /// `|g|^2 tr C - g^T C g`, `C` the inverse in use.
    pub turning: V,
    /// From [`freedom`].
    pub freedom: V,
}

/// Degrees of freedom of the residuals of so many kept lights (see [`super::confidence`]), by the square of its half-way point.
#[inline(always)]
pub(super) fn freedom<V: Vector>(kept: V) -> V {
    /// The square of the half-way point, radians.
    const HALF2: f64 = (HALF_DEG * std::f64::consts::PI / 180.0) * (HALF_DEG * std::f64::consts::PI / 180.0);
    kept.times_minus(V::splat(HALF2 as f32), V::splat((2.0 * HALF2) as f32))
}

/// What is still to be written of a block of pixels.
pub(super) struct Finished {
    /// True where every pixel keeps all lights.
    pub keep_all: bool,
    /// How many lights each pixel keeps, where not all do.
    pub kept: Lanes<u16>,
    /// Bit k is set where pixel k has a solution.
    pub valid: u64,
    /// Bit k is set where pixel k wants the careful kernel.
    pub careful: Careful,
    /// False where a value is NaN or infinite, and perhaps where squares leave the range of floats.
    pub finite: bool,
    /// The smallest step from a kept value to the next one, over the pixels, where it is sought and not all are kept.
    pub least_cut: f32,
}

impl Finished {
    pub fn new() -> Self {
        Self { keep_all: true, kept: [0; LANES], valid: 0, careful: 0, finite: true, least_cut: 0.0 }
    }

    /// Writes the pixels from `at` on to their block; facets seen from the side, and values far from 1, are left to the careful kernel.
    #[inline(always)]
    pub fn write<V: Vector>(&mut self, at: usize, facets: &Facets<V>, per_full_scale: f32, block: &mut Block<'_>) {
        let zero = V::splat(0.0);
        let Facets { scaled: [x, y, z], square, mut length, mut inverse, squared_residuals, turning, freedom, .. } =
            *facets;
        let in_range = V::both(square.is_over(V::splat(MIN_SQUARE)), V::splat(1.0 / MIN_SQUARE).is_over(square));
        let mut n_z = z * inverse;
        // All seen from the front, and of a size whose square is in the range of floats; false for NaN.
        let usual = V::all(V::both(in_range, n_z.is_over(V::splat(GRAZING))));
        let mut valid = all_bits::<V>();
        if !usual {
            let size = x.at_least(zero - x) + y.at_least(zero - y) + z.at_least(zero - z);
            let is_zero = V::bits(V::splat(LEAST).is_over(size));
            let sound = V::bits(V::both(in_range, n_z.at_least(zero - n_z).is_over(V::splat(GRAZING))));
            self.careful |= (all_bits::<V>() & !(sound | is_zero)) << at;
            // NaN spreads into everything that is computed from it.
            let (faces, nan) = (z.is_over(zero), V::splat(f32::NAN));
            (length, inverse, n_z) =
                (V::pick(faces, length, nan), V::pick(faces, inverse, nan), V::pick(faces, n_z, nan));
            valid = V::bits(faces);
        }
        let inverse2 = inverse * inverse;
        let streamed = block.streamed;
        let normals = &mut block.normals[3 * at..3 * (at + V::WIDTH)];
        let [first, second, third] = V::interleaved([x * inverse, y * inverse, n_z]);
        put(first, normals, streamed);
        put(second, &mut normals[V::WIDTH..], streamed);
        put(third, &mut normals[2 * V::WIDTH..], streamed);
        put(length * V::splat(per_full_scale), &mut block.albedo[at..], streamed);
        // See `confidence`: over themselves and the squared standard error.
        let (variance, turning) = (squared_residuals * inverse2, turning * inverse2);
        let mut certainty = freedom / variance.times_plus(turning, freedom);
        if !usual {
            certainty = V::pick(z.is_over(zero), certainty, zero);
        }
        put(certainty, &mut block.confidence[at..], streamed);
        self.valid |= valid << at;
    }
    /// Mask and counts of a block, and what its unused pixels say.
    #[inline(always)]
    pub fn write_counts(&self, all_lights: &Lanes<u16>, used: Option<&[bool]>, out: &mut Block<'_>) {
        static ALL_VALID: Lanes<bool> = [true; LANES];
        let spread;
        // Nearly always all of them, and then nothing has to be spread.
        let valid = if self.valid == u64::MAX {
            &ALL_VALID
        } else {
            spread = flags(self.valid);
            &spread
        };
        let kept = if self.keep_all { all_lights } else { &self.kept };
        store(kept, out.lights_kept, out.streamed);
        store(valid, out.mask, out.streamed);
        store(valid, out.measured, out.streamed);
        if let Some(used) = used {
            for (lane, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
                out.clear(lane..lane + 1);
            }
        }
    }
}

/// Copies a block, past the caches if they say so.
#[inline(always)]
fn store<T: NoUninit, const N: usize>(block: &[T; N], out: &mut [T; N], streamed: bool) {
    if streamed {
        stream::copy(block, out);
    } else {
        *out = *block;
    }
}

/// Writes a vector to the caches or past them.
#[inline(always)]
fn put<V: Vector>(vector: V, to: &mut [f32], streamed: bool) {
    if V::STREAMS && streamed {
        vector.stream(to);
    } else {
        vector.write(to);
    }
}

/// A flag for every bit, from the lowest on.
///
/// By eights: to shift each of 64 by a number of its own, and to pack what comes out, is what vector instructions are slow at.
#[inline(always)]
fn flags(bits: u64) -> Lanes<bool> {
    /// The lowest bit of every byte.
    const LOWEST: u64 = u64::from_ne_bytes([1; 8]);
    /// Bit k of byte k.
    const OWN: u64 = u64::from_le_bytes([1, 2, 4, 8, 16, 32, 64, 128]);
    let mut eights = [[0; 8]; LANES / 8];
    for (eight, byte) in eights.iter_mut().zip(bits.to_le_bytes()) {
        // In every byte a bit of its own, then carried to the highest place, then moved to the lowest.
        let own = (u64::from(byte) * LOWEST) & OWN;
        *eight = (((own + (128 * LOWEST - OWN)) >> 7) & LOWEST).to_le_bytes();
    }
    let bytes: Lanes<u8> = bytemuck::must_cast(eights);
    bytes.map(|byte| byte != 0)
}

/// A bit for every value of a vector.
#[inline(always)]
pub(super) fn all_bits<V: Vector>() -> u64 {
    (1 << V::WIDTH) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_the_bits() {
        let bytes = (0..=u8::MAX).map(|byte| u64::from(byte) * 0x0101_0101_0101_0101);
        for bits in bytes.chain((0..64).map(|bit| 1 << bit)).chain([0x0123_4567_89ab_cdef, !0x0123_4567_89ab_cdef]) {
            for (lane, flag) in flags(bits).into_iter().enumerate() {
                assert_eq!(flag, bits >> lane & 1 == 1, "bit {lane} of {bits:#x}");
            }
        }
    }
}
