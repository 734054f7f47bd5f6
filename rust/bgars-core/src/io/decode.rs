//! Image files to a stack, files in parallel.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use image::{ColorType, DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader, Limits};
use rayon::prelude::*;

use crate::error::check_length;
use crate::{Error, Result};

/// The most that a decoder asks for, RGBA of `f32`, in bytes a megapixel; what a header claims is checked before.
const MAX_PIXEL_BYTES: f64 = 16e6;

/// How a colour pixel becomes one value; always on linear values, never with a hidden gamma.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Rec. 709 luminance: 0.2126 R + 0.7152 G + 0.0722 B.
    Luminance,
    /// (R + G + B) / 3.
    Mean,
    Red,
    Green,
    Blue,
}

impl Channel {
    /// Weights of red, green and blue.
    #[must_use]
    pub fn weights(self) -> [f32; 3] {
        match self {
            Self::Luminance => [0.2126, 0.7152, 0.0722],
            Self::Mean => [1.0 / 3.0; 3],
            Self::Red => [1.0, 0.0, 0.0],
            Self::Green => [0.0, 1.0, 0.0],
            Self::Blue => [0.0, 0.0, 1.0],
        }
    }
}

/// What the colour of a stack needs before it is one value a pixel.
#[derive(Clone, Debug)]
pub struct Color<'a> {
    /// The combination of the channels.
    pub channel: Channel,
    /// Inverse response by code, applied to each channel; `None` for a linear camera.
    pub response: Option<&'a [f32]>,
    /// Factor of each channel of each image (1 / intensity); `None` for 1.
    pub gains: Option<&'a [[f32; 3]]>,
}

impl Color<'_> {
    /// True when the combined values do not fit the file's own integer type.
    fn needs_float(&self) -> bool {
        self.response.is_some() || self.gains.is_some()
    }
}

/// What a header says.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    width: u32,
    height: u32,
    bits: u16,
    has_color: bool,
}

impl Header {
    fn describe(self) -> String {
        let kind = if self.has_color { "colour" } else { "grey" };
        format!("{} x {} pixels, {} bit {kind}", self.width, self.height, self.bits)
    }
}

/// Bits a channel.
pub(super) fn bits_of(color: ColorType) -> u16 {
    color.bits_per_pixel() / u16::from(color.channel_count())
}

/// Where the pixels of a stack go, image after image.
#[allow(missing_docs)] // as of a [`StackType`]
#[derive(Debug)]
pub enum StackMut<'a> {
    U8(&'a mut [u8]),
    U16(&'a mut [u16]),
    F32(&'a mut [f32]),
}

/// The type of a stack's values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StackType {
    /// 8-bit grey levels.
    U8,
    /// 16-bit grey levels.
    U16,
    /// Linear values of colour images, in the grey levels of their files.
    F32,
}

/// What the headers of some files promise; nothing is decoded yet.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Debug)]
pub struct StackPlan<'a> {
    paths: &'a [PathBuf],
    color: &'a Color<'a>,
    max_megapixels: f64,
    pub height: usize,
    pub width: usize,
    pub kind: StackType,
    /// True when response and gains will be in the values (colour files).
    pub linear: bool,
    /// Bits a channel of the files (8, 16 or 32).
    pub bits: u16,
}

impl<'a> StackPlan<'a> {
    /// Reads the headers of PNG, TIFF, JPEG, BMP and PNM files.
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Decode`], [`Error::UnsupportedImage`] (float grey, palette oddities: let another library try),
    /// [`Error::ImageTooLarge`], [`Error::StackMismatch`], each naming the file.
    pub fn new(paths: &'a [PathBuf], color: &'a Color<'a>, max_megapixels: f64) -> Result<Self> {
        let Some(first_path) = paths.first() else {
            return Err(Error::TooFewLights { count: 0 });
        };
        let headers = paths.par_iter().map(|path| read_header(path, max_megapixels)).collect::<Result<Vec<_>>>()?;
        let first = headers[0];
        for (path, &header) in paths.iter().zip(&headers) {
            if header != first {
                return Err(Error::StackMismatch {
                    path: path.clone(),
                    first: first_path.clone(),
                    expected: first.describe(),
                    actual: header.describe(),
                });
            }
        }
        let linear = first.has_color && color.needs_float();
        let kind = match (first.bits, linear) {
            (8, false) => StackType::U8,
            (16, false) => StackType::U16,
            _ => StackType::F32,
        };
        let (height, width) = (first.height as usize, first.width as usize);
        Ok(Self { paths, color, max_megapixels, height, width, kind, linear, bits: first.bits })
    }

    /// Values of the whole stack.
    #[must_use]
    pub fn values(&self) -> usize {
        self.paths.len() * self.height * self.width
    }

    /// Decodes the files, each on a thread of its own, to `out`: [`values`](Self::values) values of the [`kind`](Self::kind).
    ///
    /// # Errors
    /// [`Error::Io`] and [`Error::Decode`], naming the file, and [`Error::LengthMismatch`].
    ///
    /// # Cost
    /// Grey files are decoded in place. Colour files pass through one image a thread.
    pub fn decode_into(&self, out: StackMut<'_>) -> Result<()> {
        let reader = |index: usize| Reader { path: &self.paths[index], max_megapixels: self.max_megapixels };
        let channel = self.color.channel;
        match out {
            StackMut::U8(out) => self.fill(out, |index, image| reader(index).read_u8(image, channel)),
            StackMut::U16(out) => self.fill(out, |index, image| reader(index).read_u16(image, channel)),
            StackMut::F32(out) => self.fill(out, |index, image| reader(index).read_f32(image, self.color, index)),
        }
    }

    /// Runs `read` on every image's part of `out`, in parallel.
    fn fill<T: Send>(&self, out: &mut [T], read: impl Fn(usize, &mut [T]) -> Result<()> + Sync) -> Result<()> {
        check_length("out", self.values(), out.len())?;
        out.par_chunks_mut((self.height * self.width).max(1)).enumerate().try_for_each(|(index, out)| read(index, out))
    }
}

pub(super) fn open(path: &Path, max_megapixels: f64) -> Result<impl ImageDecoder + use<>> {
    let io_error = |source| Error::Io { path: path.to_path_buf(), source };
    let file = File::open(path).map_err(io_error)?;
    let mut reader = ImageReader::new(BufReader::new(file)).with_guessed_format().map_err(io_error)?;
    if reader.format().is_none() {
        return Err(Error::UnsupportedImage { path: path.to_path_buf(), reason: "unknown file format".to_owned() });
    }
    if reader.format() == Some(ImageFormat::Jpeg) && !jpeg_is_whole(&std::fs::read(path).map_err(io_error)?) {
        let reason = "truncated: the end-of-image marker is missing".to_owned();
        return Err(Error::Decode { path: path.to_path_buf(), reason });
    }
    let mut limits = Limits::default();
    limits.max_alloc = Some((max_megapixels * MAX_PIXEL_BYTES) as u64);
    reader.limits(limits);
    reader.into_decoder().map_err(|error| translate(path, error))
}

/// True when an end-of-image marker follows the last start of scan: the decoder fills what a truncated JPEG lacks with grey
/// and says nothing. (Inside a scan, 0xFF is always followed by 0x00 or a restart marker.)
fn jpeg_is_whole(bytes: &[u8]) -> bool {
    let last = |marker: [u8; 2]| bytes.windows(2).rposition(|pair| pair == marker);
    last([0xFF, 0xDA]).is_some_and(|scan| last([0xFF, 0xD9]).is_some_and(|end| end > scan))
}

/// Refuses a file whose header claims too many pixels.
pub(super) fn read_header(path: &Path, max_megapixels: f64) -> Result<Header> {
    let decoder = open(path, max_megapixels)?;
    let (width, height) = decoder.dimensions();
    let megapixels = f64::from(width) * f64::from(height) / 1e6;
    if megapixels > max_megapixels {
        let limit_megapixels = max_megapixels;
        return Err(Error::ImageTooLarge { path: path.to_path_buf(), width, height, megapixels, limit_megapixels });
    }
    if width == 0 || height == 0 {
        return Err(Error::Decode { path: path.to_path_buf(), reason: format!("{width} x {height} pixels") });
    }
    let color = decoder.color_type();
    Ok(Header { width, height, bits: bits_of(color), has_color: color.has_color() })
}

pub(super) fn translate(path: &Path, error: ImageError) -> Error {
    let path = path.to_path_buf();
    match error {
        ImageError::Unsupported(reason) => Error::UnsupportedImage { path, reason: reason.to_string() },
        // Some end in a line break.
        other => Error::Decode { path, reason: other.to_string().trim_end().to_owned() },
    }
}

/// One file of the stack.
struct Reader<'a> {
    path: &'a Path,
    max_megapixels: f64,
}

/// Reads a file of integers: grey ones in place, colour by the weights of its channels.
macro_rules! integer_reader {
    ($name:ident, $code:ty, $grey:ident, $to_rgb:ident, $to_grey:ident) => {
        fn $name(&self, out: &mut [$code], channel: Channel) -> Result<()> {
            let decoder = open(self.path, self.max_megapixels)?;
            if decoder.color_type() == ColorType::$grey {
                let bytes = bytemuck::cast_slice_mut(out);
                return decoder.read_image(bytes).map_err(|error| translate(self.path, error));
            }
            let image = self.decode(decoder)?;
            if image.color().has_color() {
                let weights = channel.weights();
                for (out, pixel) in out.iter_mut().zip(image.$to_rgb().pixels()) {
                    *out = weigh(pixel.0.map(f32::from), weights).round() as $code;
                }
            } else {
                out.copy_from_slice(&image.$to_grey());
            }
            Ok(())
        }
    };
}

impl Reader<'_> {
    integer_reader!(read_u8, u8, L8, to_rgb8, to_luma8);
    integer_reader!(read_u16, u16, L16, to_rgb16, to_luma16);

    fn read_f32(&self, out: &mut [f32], color: &Color<'_>, index: usize) -> Result<()> {
        let image = self.decode(open(self.path, self.max_megapixels)?)?;
        let mut weights = color.channel.weights();
        if let Some(gains) = color.gains {
            for (weight, gain) in weights.iter_mut().zip(gains[index]) {
                *weight *= gain;
            }
        }
        let linear = |code: u16| color.response.map_or(f32::from(code), |table| table[usize::from(code)]);
        match &image {
            DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
                combine(out, image.to_rgb32f().pixels().map(|pixel| pixel.0), weights);
            }
            _ if bits_of(image.color()) == 8 => {
                let linear = |code: u8| linear(u16::from(code));
                combine(out, image.to_rgb8().pixels().map(|pixel| pixel.0.map(linear)), weights);
            }
            _ => combine(out, image.to_rgb16().pixels().map(|pixel| pixel.0.map(linear)), weights),
        }
        Ok(())
    }

    fn decode(&self, decoder: impl ImageDecoder) -> Result<DynamicImage> {
        DynamicImage::from_decoder(decoder).map_err(|error| translate(self.path, error))
    }
}

/// The weighted sums of the channels of some pixels.
fn combine(out: &mut [f32], pixels: impl Iterator<Item = [f32; 3]>, weights: [f32; 3]) {
    out.iter_mut().zip(pixels).for_each(|(out, pixel)| *out = weigh(pixel, weights));
}

/// The weighted sum of three channels.
#[inline]
fn weigh(channels: [f32; 3], weights: [f32; 3]) -> f32 {
    channels[0] * weights[0] + channels[1] * weights[1] + channels[2] * weights[2]
}
