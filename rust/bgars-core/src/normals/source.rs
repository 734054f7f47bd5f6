//! Where the keys of a block of pixels come from.

use std::ops::Range;

use super::lanes::Lanes;
use crate::{Pixel, Radiometry};

/// Where the keys of a block come from.
pub(super) trait Source<K> {
    /// The keys of some pixels; other lanes are left.
    fn keys(&self, pixels: &Range<usize>, keys: &mut [Lanes<K>]);
    /// Which lights are clipped.
    fn clipped(&self, pixels: &Range<usize>, clipped: &mut [Lanes<bool>]);
    /// What is to be subtracted from the keys; false where nothing is.
    fn offset(&self, pixels: &Range<usize>, offset: &mut Lanes<f32>) -> bool;
}

/// Images and what is made of them.
pub(super) struct Images<'a, P> {
    /// One a light.
    pub planes: Vec<&'a [P]>,
    pub radiometry: &'a Radiometry<'a, P>,
    /// 1 / intensity of each light.
    pub scales: Vec<f32>,
}

/// Keys as they are in the images.
pub(super) struct AsTheyAre<'a, P>(pub &'a Images<'a, P>);

/// Keys that are linear values at unit intensity.
pub(super) struct Linearised<'a, P>(pub &'a Images<'a, P>);

impl<P: Pixel> Images<'_, P> {
    fn clipped(&self, pixels: &Range<usize>, clipped: &mut [Lanes<bool>]) {
        for (clipped, plane) in clipped.iter_mut().zip(&self.planes) {
            for (clipped, code) in clipped.iter_mut().zip(&plane[pixels.clone()]) {
                *clipped = code.to_f32() >= self.radiometry.saturation;
            }
        }
    }

    fn offset(&self, pixels: &Range<usize>, offset: &mut Lanes<f32>) {
        for (offset, pixel) in offset.iter_mut().zip(pixels.clone()) {
            *offset = self.radiometry.offset(pixel);
        }
    }
}

impl<P: Pixel> Source<P> for AsTheyAre<'_, P> {
    fn keys(&self, pixels: &Range<usize>, keys: &mut [Lanes<P>]) {
        for (key, plane) in keys.iter_mut().zip(&self.0.planes) {
            key.copy_from_slice(&plane[pixels.clone()]);
        }
    }

    fn clipped(&self, pixels: &Range<usize>, clipped: &mut [Lanes<bool>]) {
        self.0.clipped(pixels, clipped);
    }

    fn offset(&self, pixels: &Range<usize>, offset: &mut Lanes<f32>) -> bool {
        let has_offsets = self.0.radiometry.has_offsets();
        if has_offsets {
            self.0.offset(pixels, offset);
        }
        has_offsets
    }
}

impl<P: Pixel> Source<f32> for Linearised<'_, P> {
    fn keys(&self, pixels: &Range<usize>, keys: &mut [Lanes<f32>]) {
        let Images { planes, radiometry, scales } = self.0;
        let mut offsets = Lanes::of(0.0);
        self.0.offset(pixels, &mut offsets);
        for ((key, plane), scale) in keys.iter_mut().zip(planes).zip(scales) {
            for ((key, &code), offset) in key.iter_mut().zip(&plane[pixels.clone()]).zip(&*offsets) {
                *key = (radiometry.linearise(code) - offset) * scale;
            }
        }
    }

    fn clipped(&self, pixels: &Range<usize>, clipped: &mut [Lanes<bool>]) {
        self.0.clipped(pixels, clipped);
    }

    fn offset(&self, _: &Range<usize>, _: &mut Lanes<f32>) -> bool {
        false
    }
}
