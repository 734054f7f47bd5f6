//! Grey TIFF straight into the stack: the general decoder of `image` fills a buffer of its own first.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use tiff::decoder::{Decoder, Limits};
use tiff::tags::{SampleFormat, Tag};
use tiff::{ColorType, TiffError};

use crate::{Error, Result};

/// 16 bytes a pixel (RGBA f32) is the most a decoder of this crate asks for; the claim itself is checked in `decode`.
pub(super) fn max_alloc_bytes(max_megapixels: f64) -> usize {
    (max_megapixels * 16e6) as usize
}

/// Reads the grey pixels of a TIFF into `out`, `bits` each; false, and nothing read, when the file is anything else.
///
/// # Errors
/// [`Error::Io`] or [`Error::Decode`], naming the file.
pub(super) fn read_gray_tiff(path: &Path, bits: u8, out: &mut [u8], max_megapixels: f64) -> Result<bool> {
    let io_error = |source| Error::Io { path: path.to_path_buf(), source };
    let mut file = File::open(path).map_err(io_error)?;
    let mut signature = [0; 4];
    let is_tiff = file.read_exact(&mut signature).is_ok() && matches!(&signature, b"II*\0" | b"MM\0*");
    if !is_tiff {
        return Ok(false);
    }
    file.rewind().map_err(io_error)?;
    read(file, bits, out, max_megapixels).map_err(|error| match error {
        TiffError::IoError(source) if source.kind() != std::io::ErrorKind::UnexpectedEof => io_error(source),
        TiffError::UnsupportedError(reason) => {
            Error::UnsupportedImage { path: path.to_path_buf(), reason: reason.to_string() }
        }
        other => Error::Decode { path: path.to_path_buf(), reason: other.to_string() },
    })
}

fn read(file: File, bits: u8, out: &mut [u8], max_megapixels: f64) -> std::result::Result<bool, TiffError> {
    let mut limits = Limits::default();
    limits.decoding_buffer_size = max_alloc_bytes(max_megapixels);
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    let mut decoder = Decoder::new(BufReader::new(file))?.with_limits(limits);
    let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat)?.unwrap_or_default();
    let is_plain = decoder.colortype()? == ColorType::Gray(bits)
        && formats.iter().all(|&format| format == SampleFormat::Uint.to_u16())
        && decoder.image_buffer_layout()?.complete_len == out.len();
    if is_plain {
        decoder.read_image_bytes(out)?;
    }
    Ok(is_plain)
}
