//! The pixel types that the kernels take as they come from the camera.

/// A grey level: `u8`, `u16` or `f32`.
pub trait Pixel: Copy + Send + Sync + std::fmt::Debug + 'static {
    /// Number of different codes of an integer type (the size of a response table); `None` for floats.
    const CODES: Option<usize>;

    /// The value as a float, in the pixel's own grey levels.
    fn to_f32(self) -> f32;

    /// The code of an integer pixel, an index into a response table; 0 for floats.
    fn code(self) -> usize;
}

macro_rules! pixel {
    ($type:ty, $codes:expr, $code:expr) => {
        impl Pixel for $type {
            const CODES: Option<usize> = $codes;

            #[inline(always)]
            fn to_f32(self) -> f32 {
                f32::from(self)
            }

            #[inline(always)]
            fn code(self) -> usize {
                $code(self)
            }
        }
    };
}

pixel!(u8, Some(1 << 8), usize::from);
pixel!(u16, Some(1 << 16), usize::from);
pixel!(f32, None, no_code);

fn no_code(_: f32) -> usize {
    0
}
