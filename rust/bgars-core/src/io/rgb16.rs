//! 16-bit RGB images, for normal maps.

use std::path::Path;

use image::{DynamicImage, ImageBuffer, ImageFormat, Rgb};

use super::decode::{check_size, open, translate};
use crate::{Error, Result};

/// A decoded RGB image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb16 {
    /// Three values a pixel, row-major; 8-bit files are scaled to 16 bits (x 257).
    pub data: Vec<u16>,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
}

/// Reads an RGB image of 8 or 16 bits a channel.
///
/// # Errors
/// Names the file; grey images are refused.
pub fn read_rgb16(path: &Path, max_megapixels: f64) -> Result<Rgb16> {
    check_size(path, max_megapixels)?;
    let image = DynamicImage::from_decoder(open(path, max_megapixels)?).map_err(|error| translate(path, error))?;
    if !image.color().has_color() {
        let reason = format!("expected an RGB image, got {:?}", image.color());
        return Err(Error::Decode { path: path.to_path_buf(), reason });
    }
    let (height, width) = (image.height() as usize, image.width() as usize);
    Ok(Rgb16 { data: image.into_rgb16().into_raw(), height, width })
}

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
