//! 16-bit RGB images: normal maps as they are written.

use std::path::Path;

use image::{ImageBuffer, ImageFormat, Rgb};

use super::decode::translate;
use crate::{Error, Result};

/// Writes a 16-bit RGB PNG.
///
/// # Errors
/// Wrong length, or whatever writing the file reports.
pub fn write_png16(path: &Path, data: &[u16], height: usize, width: usize) -> Result<()> {
    let mismatch = || Error::LengthMismatch { argument: "rgb", expected: height * width * 3, actual: data.len() };
    let (columns, rows) =
        (u32::try_from(width).map_err(|_| mismatch())?, u32::try_from(height).map_err(|_| mismatch())?);
    let buffer = ImageBuffer::<Rgb<u16>, _>::from_raw(columns, rows, data).ok_or_else(mismatch)?;
    buffer.save_with_format(path, ImageFormat::Png).map_err(|error| match error {
        image::ImageError::IoError(source) => Error::Io { path: path.to_path_buf(), source },
        other => translate(path, other),
    })
}
