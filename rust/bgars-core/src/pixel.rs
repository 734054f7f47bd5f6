//! The pixel types that the kernels take as they come from the camera.

/// A grey level: `u8`, `u16` or `f32`.
pub trait Pixel: crate::key::Key + Send + Sync + std::fmt::Debug + 'static {
    /// Number of different codes of an integer type (the size of a response table); `None` for floats.
    const CODES: Option<usize>;

    /// The value as a float, in the pixel's own grey levels.
    fn to_f32(self) -> f32;

    /// The code of an integer pixel, an index into a response table; 0 for floats.
    fn code(self) -> usize;
}

impl Pixel for u8 {
    const CODES: Option<usize> = Some(1 << 8);

    #[inline(always)]
    fn to_f32(self) -> f32 {
        f32::from(self)
    }

    #[inline(always)]
    fn code(self) -> usize {
        usize::from(self)
    }
}

impl Pixel for u16 {
    const CODES: Option<usize> = Some(1 << 16);

    #[inline(always)]
    fn to_f32(self) -> f32 {
        f32::from(self)
    }

    #[inline(always)]
    fn code(self) -> usize {
        usize::from(self)
    }
}

impl Pixel for f32 {
    const CODES: Option<usize> = None;

    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }

    #[inline(always)]
    fn code(self) -> usize {
        0
    }
}
