//! From the least squares of some pixels to what the result holds.

use bytemuck::NoUninit;

use super::confidence::{HALF_DEG, HIDDEN_MISFIT, MISFIT_MODES, misfit_freedom};
use super::cutoff::{LANES, Lanes};
use super::lane_solve::Careful;
use super::out::Block;
use crate::vector::Vector;

/// `n_z` below which `f32` cannot say whether a facet faces the camera.
const GRAZING: f32 = 1e-5;

/// Least `rho^2` that leaves residuals and inverses in the normal range of `f32`, and one over the largest `|rho n|^2`.
const MIN_SQUARE: f32 = 1e-30;

/// The same for their squares.
const MIN_PLAIN_SQUARE: f32 = 1e-15;

/// The square of the half-way point of the confidence, radians.
const HALF2: f64 = (HALF_DEG * std::f64::consts::PI / 180.0) * (HALF_DEG * std::f64::consts::PI / 180.0);

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
    /// `1 / rho`, and not a number where the facet faces away: nothing that is computed from it is one, and no branch is needed.
    pub inverse: V,
    /// Sum of the squared residuals with the [prior](super::confidence::PRIOR_RESIDUAL). Or less than zero, if the next one is,
    /// too: only their product is asked for.
    pub unexplained: V,
    /// `(tr C) |g|^2 - g^T C g`, `C` the inverse in use.
    pub turning: V,
    /// From [`freedom`].
    pub freedom: V,
}

/// Degrees of freedom of the residuals of so many kept lights (see [`super::confidence`]), by the square of its half-way point.
pub(super) fn freedom(kept: usize) -> f32 {
    (misfit_freedom(kept as f64) * HALF2) as f32
}

/// [`freedom`] of many pixels.
#[inline(always)]
pub(super) fn freedoms<V: Vector>(kept: V) -> V {
    let (one, most) = (HALF2 / HIDDEN_MISFIT, V::splat((HALF2 * (MISFIT_MODES + 1.0) / HIDDEN_MISFIT) as f32));
    most - (most - kept.times_minus(V::splat(one as f32), V::splat((2.0 * one) as f32))).at_least(V::splat(0.0))
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

/// `1 / rho`; see [`Facets::inverse`].
#[inline(always)]
pub(super) fn inverse_length<V: Vector>(square: V, [_, _, z]: [V; 3]) -> V {
    square.with_sign_of(z).inverse_root()
}

impl Finished {
    pub fn new() -> Self {
        Self { keep_all: true, kept: [0; LANES], valid: 0, careful: 0, finite: true, least_cut: 0.0 }
    }

    /// Writes the pixels from `at` on to their block; facets seen from the side, and values far from 1, are left to the careful kernel.
    /// Values far from 1 are not looked for where none can be (`any_size` false).
    #[inline(always)]
    pub fn write<V: Vector>(
        &mut self,
        at: usize,
        facets: &Facets<V>,
        per_full_scale: f32,
        any_size: bool,
        block: &mut Block<'_>,
    ) {
        let zero = V::splat(0.0);
        let Facets { scaled: [x, y, z], square, inverse, mut unexplained, mut turning, freedom, .. } = *facets;
        let (z2, least) = (z * z, square * V::splat(GRAZING * GRAZING));
        let mut unit = square;
        // What is zero is not seen from the side.
        let is_unusual =
            if any_size { !V::all(is_sound(square, z2, least, MIN_PLAIN_SQUARE)) } else { V::any(least.is_over(z2)) };
        if is_unusual {
            let sound = is_sound(square, z2, least, MIN_SQUARE);
            let size = x.at_least(zero - x) + y.at_least(zero - y) + z.at_least(zero - z);
            let is_zero = V::bits(V::splat(LEAST).is_over(size));
            self.careful |= (all_bits::<V>() & !(V::bits(sound) | is_zero)) << at;
            if any_size {
                let inverse2 = inverse * inverse;
                (unexplained, turning, unit) = (unexplained * inverse2, turning * inverse2, unit * inverse2);
            }
        }
        let faces = z.is_over(zero);
        let streamed = block.streamed;
        let normals = &mut block.normals[3 * at..3 * (at + V::WIDTH)];
        let [first, second, third] = V::interleaved([x * inverse, y * inverse, z * inverse]);
        put(first, normals, streamed);
        put(second, &mut normals[V::WIDTH..], streamed);
        put(third, &mut normals[2 * V::WIDTH..], streamed);
        put(square * inverse * V::splat(per_full_scale), &mut block.albedo[at..], streamed);
        // See `confidence`: over themselves and the squared standard error, which rounding could make less than zero.
        let freedom = freedom * unit * unit;
        let certainty = (freedom / unexplained.times_plus(turning, freedom)).at_least(zero);
        put(V::pick(faces, certainty, zero), &mut block.confidence[at..], streamed);
        self.valid |= V::bits(faces) << at;
    }

    /// Mask and counts of a block, and what its unused pixels say.
    #[inline(always)]
    pub fn write_counts<V: Vector>(&self, all_lights: &Lanes<u16>, used: Option<&[bool]>, out: &mut Block<'_>) {
        let valid = &V::flags(self.valid);
        let kept = if self.keep_all { all_lights } else { &self.kept };
        store::<V, _, _>(kept, out.lights_kept, out.streamed);
        store::<V, _, _>(valid, out.mask, out.streamed);
        if let Some(measured) = &mut out.measured {
            store::<V, _, _>(valid, measured, out.streamed);
        }
        if let Some(used) = used {
            for (lane, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
                out.clear(lane..lane + 1);
            }
        }
    }
}

/// True where `f32` can be trusted: by `|g|^2`, `g_z^2`, the least that this may be, and the least of `|g|^2`; false for NaN.
#[inline(always)]
fn is_sound<V: Vector>(square: V, z2: V, least: V, min_square: f32) -> V::Mask {
    V::both(in_range(square, min_square), z2.is_over(least))
}

/// True where a square is neither below the least one nor above one over it; false for NaN.
#[inline(always)]
fn in_range<V: Vector>(square: V, min: f32) -> V::Mask {
    V::both(square.is_over(V::splat(min)), V::splat(1.0 / min).is_over(square))
}

/// Copies a block to the caches or past them.
#[inline(always)]
fn store<V: Vector, T: NoUninit, const N: usize>(block: &[T; N], out: &mut [T; N], streamed: bool) {
    if V::STREAMS && streamed {
        V::stream_block(block, out);
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

/// A bit for every value of a vector.
#[inline(always)]
pub(super) fn all_bits<V: Vector>() -> u64 {
    (1 << V::WIDTH) - 1
}
