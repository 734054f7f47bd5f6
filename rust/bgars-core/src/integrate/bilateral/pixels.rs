//! What stays the same from one re-weighting to the next: normals and trust, cropped to the mask.

use rayon::prelude::*;

use super::super::checkerboard::Grid;
use super::super::operator::Field;
use super::Setting;
use super::camera::Pinhole;
use super::frame::Frame;
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

/// The pixels of the box, row-major; numbers of pixels outside the mask are zero.
#[derive(Debug)]
pub(super) struct Pixels {
    pub crop: Crop,
    /// Components of the normals along x and y.
    pub n: [Vec<f64>; 2],
    /// Factors of the differences along x and y.
    pub g: [Vec<f64>; 2],
    /// How much each pixel is trusted.
    pub trust: Vec<f64>,
    /// 1 where a pixel is joined to its right neighbour, or to the one below, else 0.
    pub ties: [Vec<f64>; 2],
    mask: Vec<bool>,
}

impl Pixels {
    pub fn new(field: Field<'_>, camera: Option<Pinhole>, setting: Setting) -> Self {
        let crop = Crop::around(field.mask, field.width);
        let Grid { height, width } = crop.grid;
        let pixels = height * width;
        let [mut n_x, mut n_y, mut g_x, mut g_y, mut trust] = std::array::from_fn(|_| vec![0.0; pixels]);
        let [mut tied_right, mut tied_below] = std::array::from_fn(|_| vec![0.0; pixels]);
        let mut mask = vec![false; pixels];
        let number = |at: usize| field.regions.map_or(0, |regions| regions[at]);
        let rows = (
            (
                n_x.par_chunks_mut(width),
                n_y.par_chunks_mut(width),
                g_x.par_chunks_mut(width),
                g_y.par_chunks_mut(width),
            ),
            (tied_right.par_chunks_mut(width), tied_below.par_chunks_mut(width)),
            (trust.par_chunks_mut(width), mask.par_chunks_mut(width)),
        );
        let (numbers, ties, others) = rows;
        let rows = numbers.into_par_iter().zip(ties.into_par_iter()).zip(others.into_par_iter()).enumerate();
        rows.for_each(|(row, (((n_x, n_y, g_x, g_y), (tied_right, tied_below)), (trust, mask)))| {
            let (image_row, first) = (row + crop.row, (row + crop.row) * field.width + crop.col);
            for k in (0..width).filter(|k| field.mask[first + k]) {
                let at = first + k;
                let tied = |other: usize| f64::from(u8::from(field.mask[other] && number(other) == number(at)));
                let normal: [f64; 3] = std::array::from_fn(|axis| f64::from(field.normals[3 * at + axis]));
                [n_x[k], n_y[k]] = [normal[0], normal[1]];
                [g_x[k], g_y[k]] = match (camera, setting) {
                    (None, _) => [normal[2]; 2],
                    (Some(camera), Setting::Compatible) => camera.published_slants(normal, image_row, crop.col + k),
                    (Some(camera), Setting::Converged) => camera.slants(normal, image_row, crop.col + k),
                };
                trust[k] = field.weights.map_or(1.0, |weights| f64::from(weights[at]));
                tied_right[k] = if k + 1 < width { tied(at + 1) } else { 0.0 };
                tied_below[k] = if row + 1 < height { tied(at + field.width) } else { 0.0 };
                mask[k] = true;
            }
        });
        Self { crop, n: [n_x, n_y], g: [g_x, g_y], trust, ties: [tied_right, tied_below], mask }
    }

    /// Pixels of the box.
    pub fn len(&self) -> usize {
        self.mask.len()
    }

    /// The frame of the box.
    pub fn frame(&self) -> Frame {
        let Grid { height, width } = self.crop.grid;
        Frame::new(height, width, |row, col| self.used(row * width + col))
    }

    /// True for a pixel of the mask.
    pub fn used(&self, pixel: usize) -> bool {
        self.mask[pixel]
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

/// The edges along an axis: to the right (0), or to the pixel below (1).
#[derive(Debug)]
pub(super) struct Edges<'a> {
    pub pixels: &'a Pixels,
    /// Weight of each pixel's difference ahead.
    pub share: &'a [f64],
    /// Least share of a side.
    pub least: f64,
    pub axis: usize,
}

impl Edges<'_> {
    /// Weights of a row's edges, and how much of the right side each pushes from its first pixel to its second.
    pub fn of_row(&self, row: usize, weight: &mut [f64], push: &mut [f64]) {
        let Pixels { crop: Crop { grid, .. }, n, g, trust, ties, .. } = self.pixels;
        let first = row * grid.width;
        let stride = if self.axis == 0 { 1 } else { grid.width };
        // Without a row below, or right of the last pixel, nothing is tied.
        let edges =
            if first + stride < self.pixels.len() { grid.width.min(self.pixels.len() - first - stride) } else { 0 };
        weight[edges..].fill(0.0);
        push[edges..].fill(0.0);
        let (weight, push) = (&mut weight[..edges], &mut push[..edges]);
        let near = [&trust[first..], &self.share[first..], &n[self.axis][first..], &g[self.axis][first..]]
            .map(|row| &row[..edges]);
        let first_far = first + stride;
        let far =
            [&trust[first_far..], &self.share[first_far..], &n[self.axis][first_far..], &g[self.axis][first_far..]]
                .map(|row| &row[..edges]);
        let tied = &ties[self.axis][first..][..edges];
        // Ahead is to the right and up: the edge is ahead of its left pixel, and of its lower one.
        let (flip, sign) = if self.axis == 0 { (0.0, -1.0) } else { (1.0, 1.0) };
        let turn = 1.0 - 2.0 * flip;
        for k in 0..edges {
            let share = |side: [&[f64]; 4]| side[1][k].max(self.least).min(1.0 - self.least);
            let pull_a = tied[k] * near[0][k] * (flip + turn * share(near)) * near[3][k];
            let pull_b = tied[k] * far[0][k] * ((1.0 - flip) - turn * share(far)) * far[3][k];
            weight[k] = pull_a * near[3][k] + pull_b * far[3][k];
            push[k] = sign * (pull_a * near[2][k] + pull_b * far[2][k]);
        }
    }
}
