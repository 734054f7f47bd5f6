//! Normals from a light stack: choose the lights of each pixel, then least squares on them.
//!
//! For the kept lights K of a pixel, `rho n = (L_K^T L_K)^-1 L_K^T I_K` (Woodham 1980). The methods differ in K only:
//! all lights ([`Method::Lambertian`]), the sorted-gap filter ([`Method::SpecularFilter`]), or the best window of sorted
//! values ([`Method::RobustFilter`]).

mod blocks;
mod checks;
mod confidence;
mod cutoff;
mod estimate;
mod fit;
mod lanes;
mod ranked;
mod robust;
mod solve;
mod specular;
mod symmetric;
mod windows;

use std::ops::Range;

use crate::Result;
use crate::error::check_length;

pub(crate) use checks::check_finite;
pub(crate) use confidence::{confidence_of, misfit_freedom};
pub use estimate::{estimate, estimate_into};
pub(crate) use lanes::add_product;
pub use robust::robust_filter;
pub(crate) use solve::solve;
pub use specular::specular_filter;

/// Which lights of a pixel enter its least squares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// All of them.
    Lambertian,
    /// The published sorted-gap filter; see [`specular_filter`].
    SpecularFilter {
        /// Gap in grey levels of 255 over which the rest of the sorted values is dropped.
        threshold: f32,
    },
    /// The best window of sorted values; see [`robust_filter`].
    RobustFilter,
}

/// What [`estimate`] found; every array is row-major over `height * width` pixels.
#[derive(Clone, Debug, Default)]
pub struct NormalMap {
    /// Unit normals, 3 values a pixel, `n_z > 0`; NaN where `mask` is false.
    pub normals: Vec<f32>,
    /// Length of the least-squares solution over full scale; NaN where `mask` is false.
    pub albedo: Vec<f32>,
    /// True where the pixel was asked for and has a solution.
    pub mask: Vec<bool>,
    /// Trust in (0, 1]: `1 / (1 + (s / 5 deg)^2)` with `s` the standard error of the direction; 0 where `mask` is false.
    pub confidence: Vec<f32>,
    /// True where the normal was measured, not filled in from a prior.
    pub measured: Vec<bool>,
    /// Number of lights kept; 0 for a pixel that was not asked for.
    pub lights_kept: Vec<u16>,
    /// The kept lights themselves, `lights` values a pixel; empty unless asked for.
    pub kept_sets: Vec<bool>,
}

/// The arrays of a [`NormalMap`], wherever they are, to be written.
#[allow(missing_docs)] // as there
#[derive(Debug)]
pub struct NormalMapMut<'a> {
    pub normals: &'a mut [f32],
    pub albedo: &'a mut [f32],
    pub mask: &'a mut [bool],
    pub confidence: &'a mut [f32],
    /// 1 value a pixel; or empty, for methods that fill nothing in (all but the blind one): it would be `mask` again.
    pub measured: &'a mut [bool],
    pub lights_kept: &'a mut [u16],
    /// `lights` values a pixel, or empty: not wanted.
    pub kept_sets: &'a mut [bool],
}

impl NormalMap {
    /// Zeros for so many pixels; `set_lights` is the number of lights of the kept sets, 0 without these.
    #[must_use]
    pub fn zeros(pixels: usize, set_lights: usize) -> Self {
        Self {
            normals: vec![0.0; pixels * 3],
            albedo: vec![0.0; pixels],
            mask: vec![false; pixels],
            confidence: vec![0.0; pixels],
            measured: vec![false; pixels],
            lights_kept: vec![0; pixels],
            kept_sets: vec![false; pixels * set_lights],
        }
    }

    /// The arrays, to be written.
    pub fn as_mut(&mut self) -> NormalMapMut<'_> {
        NormalMapMut {
            normals: &mut self.normals,
            albedo: &mut self.albedo,
            mask: &mut self.mask,
            confidence: &mut self.confidence,
            measured: &mut self.measured,
            lights_kept: &mut self.lights_kept,
            kept_sets: &mut self.kept_sets,
        }
    }
}

impl<'a> NormalMapMut<'a> {
    /// The same arrays, borrowed for less long.
    pub fn reborrow(&mut self) -> NormalMapMut<'_> {
        NormalMapMut {
            normals: self.normals,
            albedo: self.albedo,
            mask: self.mask,
            confidence: self.confidence,
            measured: self.measured,
            lights_kept: self.lights_kept,
            kept_sets: self.kept_sets,
        }
    }

    /// Lights of the kept sets, 0 without these.
    fn set_lights(&self) -> usize {
        self.kept_sets.len() / self.albedo.len().max(1)
    }

    /// The first pixels, so many of them; the others stay.
    #[inline]
    fn take(&mut self, pixels: usize, set_lights: usize) -> NormalMapMut<'a> {
        NormalMapMut {
            normals: take(&mut self.normals, pixels * 3),
            albedo: take(&mut self.albedo, pixels),
            mask: take(&mut self.mask, pixels),
            confidence: take(&mut self.confidence, pixels),
            measured: take(&mut self.measured, pixels),
            lights_kept: take(&mut self.lights_kept, pixels),
            kept_sets: take(&mut self.kept_sets, pixels * set_lights),
        }
    }

    /// Takes over a pixel of another map.
    fn copy_pixel(&mut self, to: usize, from: &NormalMap, index: usize) {
        let lights = self.set_lights();
        self.normals[3 * to..3 * to + 3].copy_from_slice(&from.normals[3 * index..3 * index + 3]);
        self.albedo[to] = from.albedo[index];
        self.mask[to] = from.mask[index];
        self.confidence[to] = from.confidence[index];
        self.lights_kept[to] = from.lights_kept[index];
        self.kept_sets[to * lights..(to + 1) * lights]
            .copy_from_slice(&from.kept_sets[index * lights..(index + 1) * lights]);
        if let Some(measured) = self.measured.get_mut(to) {
            *measured = from.mask[index];
        }
    }

    /// Marks pixels as not asked for.
    fn clear(&mut self, pixels: Range<usize>) {
        let set_lights = self.set_lights();
        self.lights_kept[pixels.clone()].fill(0);
        self.kept_sets[pixels.start * set_lights..pixels.end * set_lights].fill(false);
        self.reject(pixels);
    }

    /// Marks pixels as without solution.
    fn reject(&mut self, pixels: Range<usize>) {
        self.normals[pixels.start * 3..pixels.end * 3].fill(f32::NAN);
        self.albedo[pixels.clone()].fill(f32::NAN);
        self.confidence[pixels.clone()].fill(0.0);
        self.mask[pixels.clone()].fill(false);
        if let Some(measured) = self.measured.get_mut(pixels) {
            measured.fill(false);
        }
    }

    /// Refuses arrays of another length than so many pixels need; `fills_in`: for a method that says what it has measured.
    pub(crate) fn check(&self, pixels: usize, lights: usize, fills_in: bool) -> Result<()> {
        let kept_sets = if self.kept_sets.is_empty() { 0 } else { pixels * lights };
        let measured = if self.measured.is_empty() && !fills_in { 0 } else { pixels };
        for (argument, expected, actual) in [
            ("normals", pixels * 3, self.normals.len()),
            ("albedo", pixels, self.albedo.len()),
            ("mask", pixels, self.mask.len()),
            ("confidence", pixels, self.confidence.len()),
            ("measured", measured, self.measured.len()),
            ("lights_kept", pixels, self.lights_kept.len()),
            ("kept_sets", kept_sets, self.kept_sets.len()),
        ] {
            check_length(argument, expected, actual)?;
        }
        Ok(())
    }
}

/// The first elements of a slice, or all where it has fewer; the others stay.
#[inline]
#[allow(clippy::mut_mut)] // what is left is written back
fn take<'a, T>(slice: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let count = count.min(slice.len());
    let (first, rest) = std::mem::take(slice).split_at_mut(count);
    *slice = rest;
    first
}
