//! What stays the same from one re-weighting to the next: normals and trust, cropped to the mask.

use rayon::prelude::*;

use super::super::checkerboard::Grid;
use super::super::operator::Field;
use super::camera::Pinhole;
use crate::memory::zeros;

/// The bounding box of the mask, its first row and column in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crop {
    pub row: usize,
    pub col: usize,
    pub grid: Grid,
}

impl Crop {
    /// The smallest box around a mask that has at least one pixel.
    fn around(mask: &[bool], width: usize) -> Self {
        let used = |row: &[bool]| row.contains(&true);
        let rows: Vec<&[bool]> = mask.chunks(width).collect();
        let top = rows.iter().position(|row| used(row)).unwrap_or(0);
        let bottom = rows.iter().rposition(|row| used(row)).unwrap_or(0);
        let (mut left, mut right) = (width, 0);
        for row in &rows[top..=bottom] {
            left = left.min(row.iter().position(|&used| used).unwrap_or(width));
            right = right.max(row.iter().rposition(|&used| used).map_or(0, |col| col + 1));
        }
        Self { row: top, col: left, grid: Grid { height: bottom + 1 - top, width: right - left } }
    }
}

/// One pixel; all zero outside the mask.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pixel {
    /// Components of the normal along x and y.
    pub n: [f64; 2],
    /// Factors of the differences along x and y.
    pub g: [f64; 2],
    /// How much the pixel is trusted.
    pub trust: f64,
}

/// The pixels of the box, row-major.
#[derive(Debug)]
pub(super) struct Pixels {
    pub crop: Crop,
    pub all: Vec<Pixel>,
    /// The region of each pixel, [`OUTSIDE`] outside the mask.
    regions: Vec<i64>,
}

/// Region of what is not in the mask.
const OUTSIDE: i64 = i64::MIN;

impl Pixels {
    pub fn new(field: Field<'_>, camera: Option<Pinhole>) -> Self {
        let crop = Crop::around(field.mask, field.width);
        let Grid { height, width } = crop.grid;
        let mut regions = vec![OUTSIDE; height * width];
        let mut all = vec![Pixel::default(); height * width];
        all.par_chunks_mut(width).zip(regions.par_chunks_mut(width)).enumerate().for_each(|(row, (all, regions))| {
            let (row, first) = (row + crop.row, (row + crop.row) * field.width + crop.col);
            for (k, pixel) in all.iter_mut().enumerate().filter(|(k, _)| field.mask[first + k]) {
                regions[k] = field.regions.map_or(0, |regions| i64::from(regions[first + k]));
                let normal: [f64; 3] = std::array::from_fn(|axis| f64::from(field.normals[3 * (first + k) + axis]));
                pixel.n = [normal[0], normal[1]];
                pixel.g = camera.map_or([normal[2]; 2], |camera| camera.slants(normal, row, crop.col + k));
                pixel.trust = field.weights.map_or(1.0, |weights| f64::from(weights[first + k]));
            }
        });
        Self { crop, all, regions }
    }

    /// True for a pixel of the mask.
    pub fn used(&self, pixel: usize) -> bool {
        self.regions[pixel] != OUTSIDE
    }

    /// True for two pixels of the mask in one region.
    pub fn joined(&self, a: usize, b: usize) -> bool {
        self.used(a) && self.regions[a] == self.regions[b]
    }

    /// A map of the box as one of the image, of `pixels` pixels in rows of `width`; NaN outside the mask.
    pub fn whole(&self, pixels: usize, width: usize, value: impl Fn(usize) -> f64 + Sync) -> Vec<f32> {
        let mut whole: Vec<f32> = zeros(pixels);
        let (crop, box_width) = (self.crop, self.crop.grid.width);
        whole.par_chunks_mut(width).enumerate().for_each(|(row, whole)| {
            whole.fill(f32::NAN);
            let Some(row) = row.checked_sub(crop.row).filter(|row| *row < crop.grid.height) else { return };
            for k in 0..box_width {
                let pixel = row * box_width + k;
                if self.used(pixel) {
                    whole[crop.col + k] = value(pixel) as f32;
                }
            }
        });
        whole
    }
}
