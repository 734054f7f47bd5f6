//! A stack of images, one a light, borrowed as it lies in memory.

use crate::{Error, Pixel, Result};

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
    /// [`Error::LengthMismatch`] when the length does not fit the shape.
    ///
    /// # Examples
    /// ```
    /// let stack = bgars_core::ImageStack::new(&[0u8; 24], 3, 2, 4)?;
    /// assert_eq!(stack.plane(2).len(), 8);
    /// # Ok::<(), bgars_core::Error>(())
    /// ```
    pub fn new(data: &'a [P], lights: usize, height: usize, width: usize) -> Result<Self> {
        let expected = lights * height * width;
        if data.len() != expected {
            return Err(Error::LengthMismatch { argument: "images", expected, actual: data.len() });
        }
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
