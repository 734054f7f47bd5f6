//! A stack of images, one a light, borrowed as it lies in memory.

use rayon::prelude::*;

use crate::error::check_length;
use crate::{Pixel, Result};

/// `lights` planes of `height * width` pixels, row-major, plane after plane.
#[derive(Clone, Copy, Debug)]
pub struct ImageStack<'a, P> {
    data: &'a [P],
    lights: usize,
    height: usize,
    width: usize,
}

impl<'a, P: Pixel> ImageStack<'a, P> {
    /// Borrows `data` of shape `(lights, height, width)`.
    ///
    /// # Errors
    /// [`crate::Error::LengthMismatch`] when the length does not fit the shape.
    pub fn new(data: &'a [P], lights: usize, height: usize, width: usize) -> Result<Self> {
        check_length("images", lights * height * width, data.len())?;
        Ok(Self { data, lights, height, width })
    }

    /// Number of images, one a light.
    #[must_use]
    pub fn lights(&self) -> usize {
        self.lights
    }

    /// Rows of an image.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// Columns of an image.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Pixels of one image.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.height * self.width
    }

    /// Image of light `light`, `height * width` pixels.
    ///
    /// # Panics
    /// When `light` is out of range.
    #[must_use]
    #[inline]
    pub fn plane(&self, light: usize) -> &'a [P] {
        let pixels = self.pixels();
        &self.data[light * pixels..(light + 1) * pixels]
    }
}

impl<P: Pixel> ImageStack<'_, P> {
    /// The largest value that is finite, 0 where none is above; of many values each thread looks through a part.
    #[must_use]
    pub fn largest_finite(&self) -> f32 {
        if !self.is_large() {
            return largest_finite(self.data);
        }
        self.data.par_chunks(FEW_VALUES).map(largest_finite).reduce(|| 0.0, f32::max)
    }

    /// True where it pays to share the search for the largest value among threads.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.data.len() > FEW_VALUES
    }
}

/// Values that one thread has seen before others are awake.
const FEW_VALUES: usize = 1 << 19;

fn largest_finite<P: Pixel>(values: &[P]) -> f32 {
    // The bits of numbers that are not negative are in their order, those of NaN beyond infinity's.
    let finite = |bits: i32| if bits < f32::INFINITY.to_bits() as i32 { bits } else { 0 };
    let largest = values.iter().fold(0, |largest, value| finite(value.to_f32().to_bits() as i32).max(largest));
    f32::from_bits(largest as u32)
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;

    /// In blocks of vectors and in what is left of them, among several tasks.
    #[test]
    fn the_largest_is_found_wherever_it_lies() {
        for count in [203, 2 * FEW_VALUES + 3] {
            let mut values = vec![-1.0; count];
            let largest = |values: &[f32]| ImageStack::new(values, 1, 1, count).unwrap().largest_finite();
            assert_eq!(largest(&values), 0.0);
            for (rank, place) in [0, 77, 127, 128, count / 2, count - 1].into_iter().enumerate() {
                values[place] = 1.0 + rank as f32;
                values[(place + 9) % count] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][rank % 3];
                assert_eq!(largest(&values), 1.0 + rank as f32, "{place} of {count}");
            }
        }
    }
}
