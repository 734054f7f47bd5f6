//! What stays the same from one re-weighting to the next: normals and trust, cropped to the mask.

use multiversion::multiversion;
use rayon::prelude::*;

use super::super::checkerboard::{Crop, Grid};
use super::super::field::to_unit;
use super::super::real::Real;
use super::super::settings::Field;
use super::super::stencil::{EdgeRow, Stencil};
use super::camera::Pinhole;
use super::settings::Setting;

/// Weights of the differences to the right and upward; the opposite ones have the rest.
pub(super) type Shares = [Vec<f64>; 2];

/// The pixels of the box, row-major; numbers of pixels outside the mask are zero.
#[derive(Debug)]
pub(super) struct Pixels {
    pub crop: Crop,
    /// Components of the normals along x and y.
    pub n: [Vec<f64>; 2],
    /// Factors of the differences along x and y.
    pub g: [Vec<f64>; 2],
    /// How much each pixel is trusted, times `unit`.
    pub trust: Vec<f64>,
    /// Brings the weights of edges, trust times factor squared, to the size of 1.
    pub unit: f64,
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
        let weights = (&trust, &g_x, &g_y).into_par_iter().map(|(trust, g_x, g_y)| trust * (g_x * g_x).max(g_y * g_y));
        let unit = to_unit(weights.reduce(|| 0.0, f64::max));
        trust.par_iter_mut().for_each(|trust| *trust *= unit);
        Self { crop, n: [n_x, n_y], g: [g_x, g_y], trust, unit, ties: [tied_right, tied_below], mask }
    }

    /// Pixels of the box.
    pub fn len(&self) -> usize {
        self.mask.len()
    }

    /// True for a pixel of the mask.
    pub fn used(&self, pixel: usize) -> bool {
        self.mask[pixel]
    }

    /// A map of the box as one of the image, of `pixels` pixels in rows of `width`; NaN outside the mask.
    pub fn whole(&self, pixels: usize, width: usize, value: impl Fn(usize) -> f64 + Sync) -> Vec<f32> {
        let mut whole = vec![f32::NAN; pixels];
        let (crop, box_width) = (self.crop, self.crop.grid.width);
        whole.par_chunks_mut(width).enumerate().for_each(|(row, whole)| {
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
struct Edges<'a> {
    pixels: &'a Pixels,
    /// Weight of each pixel's difference ahead.
    share: &'a [f64],
    /// Least share of a side.
    least: f64,
    axis: usize,
}

impl Edges<'_> {
    /// Sets the edges of a row.
    fn set_row<W: Real>(&self, row: usize, weight: &mut [f64], edges: &mut EdgeRow<W>) {
        let Grid { height, width } = self.pixels.crop.grid;
        edges.clear();
        // Nothing ties a pixel to one that is not there: not the last row, nor the last column.
        let (end, stride) = if self.axis == 0 { (width - 1, 1) } else { (width, width) };
        if self.axis == 1 && row + 1 == height {
            return;
        }
        edges_of(self, row * width, stride, &mut weight[..end], &mut edges.push[..end]);
        for (rounded, weight) in edges.weight[..end].iter_mut().zip(weight) {
            *rounded = W::nearest(*weight);
        }
    }
}

/// Operator and right side of the normal equations for the shares of a surface, none of them taken below `least`.
pub(super) fn assemble<W: Real>(pixels: &Pixels, shares: &Shares, least: f64) -> (Stencil<W>, [Vec<f64>; 2]) {
    let grid = pixels.crop.grid;
    let rows_of = || {
        let mut weight = vec![0.0; grid.width];
        move |row: usize, right: &mut EdgeRow<W>, below: &mut EdgeRow<W>| {
            for (axis, edges) in [right, below].into_iter().enumerate() {
                Edges { pixels, share: &shares[axis], least, axis }.set_row(row, &mut weight, edges);
            }
        }
    };
    let mut right = [(); 2].map(|()| vec![0.0; grid.half_pixels()]);
    let stencil = Stencil::from_edges(grid, rows_of, Some(&mut right));
    (stencil, right)
}

/// Weights and pushes of the edges from the pixels from `first` on, to those `stride` further.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn edges_of(edges: &Edges<'_>, first: usize, stride: usize, weight: &mut [f64], push: &mut [f64]) {
    let Edges { pixels: Pixels { n, g, trust, ties, .. }, share, least, axis } = edges;
    let (count, least, most) = (weight.len(), *least, 1.0 - least);
    let push = &mut push[..count];
    let [[trust_a, share_a, n_a, g_a], [trust_b, share_b, n_b, g_b]] = [first, first + stride]
        .map(|first| [&trust[..], share, &n[*axis], &g[*axis]].map(|numbers| &numbers[first..][..count]));
    let tied = &ties[*axis][first..][..count];
    // Ahead is to the right and up: the edge is ahead of its left pixel, and of its lower one.
    let (flip, turn, sign) = if *axis == 0 { (0.0, 1.0, -1.0) } else { (1.0, -1.0, 1.0) };
    for k in 0..count {
        let (ahead_a, ahead_b) = (share_a[k].max(least).min(most), share_b[k].max(least).min(most));
        let pull_a = tied[k] * trust_a[k] * (flip + turn * ahead_a) * g_a[k];
        let pull_b = tied[k] * trust_b[k] * ((1.0 - flip) - turn * ahead_b) * g_b[k];
        weight[k] = pull_a * g_a[k] + pull_b * g_b[k];
        push[k] = sign * (pull_a * n_a[k] + pull_b * n_b[k]);
    }
}
