//! Whole stacks of image files in memory of their own: tests and benches have no arrays to decode into.

use std::path::PathBuf;

use bgars_core::Result;
use bgars_core::io::decode::{Color, StackMut, StackPlan, StackType};

/// Pixels of a stack, image after image.
#[derive(Clone, Debug)]
pub enum StackData {
    /// 8-bit grey levels.
    U8(Vec<u8>),
    /// 16-bit grey levels.
    U16(Vec<u16>),
    /// Linear values of colour images, in the grey levels of their files.
    F32(Vec<f32>),
}

/// A decoded stack and what its files were.
#[derive(Clone, Debug)]
pub struct DecodedStack {
    /// `paths.len() * height * width` values.
    pub data: StackData,
    /// Rows of an image.
    pub height: usize,
    /// Columns of an image.
    pub width: usize,
    /// True when response and gains are in the values already (colour files).
    pub linear: bool,
    /// Bits a channel of the files (8, 16 or 32).
    pub bits: u16,
}

/// Decodes files of equal size and depth to one stack, grey values as they are stored.
///
/// # Inputs
/// `paths` one file an image; `color` for colour files; `max_megapixels` bounds what a header may claim, checked before
/// anything is allocated.
///
/// # Errors
/// Those of [`StackPlan`].
pub fn decode_stack(paths: &[PathBuf], color: &Color<'_>, max_megapixels: f64) -> Result<DecodedStack> {
    let plan = StackPlan::new(paths, color, max_megapixels)?;
    let data = match plan.kind {
        StackType::U8 => {
            let mut data = vec![Default::default(); plan.values()];
            plan.decode_into(StackMut::U8(&mut data))?;
            StackData::U8(data)
        }
        StackType::U16 => {
            let mut data = vec![Default::default(); plan.values()];
            plan.decode_into(StackMut::U16(&mut data))?;
            StackData::U16(data)
        }
        StackType::F32 => {
            let mut data = vec![Default::default(); plan.values()];
            plan.decode_into(StackMut::F32(&mut data))?;
            StackData::F32(data)
        }
    };
    Ok(DecodedStack { data, height: plan.height, width: plan.width, linear: plan.linear, bits: plan.bits })
}
