//! Colour images as they are stored: normal maps as people hold them.

use std::path::Path;

use image::{DynamicImage, ImageDecoder};

use super::decode::{bits_of, open, read_header, translate};
use crate::{Error, Result};

/// A decoded colour image.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Debug, PartialEq)]
pub struct ColorImage {
    /// Codes of the file, or its floats; `channels` values a pixel, row-major.
    pub data: Vec<f32>,
    pub height: usize,
    pub width: usize,
    /// 3, or 4 with alpha.
    pub channels: usize,
    /// Bits a channel: 8, 16 or 32 (floats).
    pub bits: u16,
}

/// Reads a colour image of 8 or 16 bits or floats a channel, with its alpha where it has one.
///
/// # Errors
/// Names the file; grey images are refused.
pub fn read_color(path: &Path, max_megapixels: f64) -> Result<ColorImage> {
    read_header(path, max_megapixels)?;
    let decoder = open(path, max_megapixels)?;
    let color = decoder.color_type();
    if !color.has_color() {
        let reason = format!("expected an RGB image, got {color:?}");
        return Err(Error::Decode { path: path.to_path_buf(), reason });
    }
    let image = DynamicImage::from_decoder(decoder).map_err(|error| translate(path, error))?;
    let (height, width) = (image.height() as usize, image.width() as usize);
    let data = match image {
        DynamicImage::ImageRgb8(image) => widen(image.into_raw()),
        DynamicImage::ImageRgba8(image) => widen(image.into_raw()),
        DynamicImage::ImageRgb16(image) => widen(image.into_raw()),
        DynamicImage::ImageRgba16(image) => widen(image.into_raw()),
        other if color.has_alpha() => other.into_rgba32f().into_raw(),
        other => other.into_rgb32f().into_raw(),
    };
    Ok(ColorImage { data, height, width, channels: usize::from(color.channel_count()), bits: bits_of(color) })
}

fn widen<T: Into<f32>>(codes: Vec<T>) -> Vec<f32> {
    codes.into_iter().map(Into::into).collect()
}
