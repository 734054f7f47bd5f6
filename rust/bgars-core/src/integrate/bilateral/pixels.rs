//! What stays the same from one re-weighting to the next: normals and trust, cropped to the mask.

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
        let place = |pixel: usize| (pixel / width + crop.row) * field.width + crop.col + pixel % width;
        let mask: Vec<bool> = (0..height * width).map(|pixel| field.mask[place(pixel)]).collect();
        let each = |value: &(dyn Fn(usize) -> f64 + Sync)| -> Vec<f64> {
            mask.par_iter().enumerate().map(|(pixel, &used)| if used { value(place(pixel)) } else { 0.0 }).collect()
        };
        let normal = |at: usize| -> [f64; 3] { std::array::from_fn(|axis| f64::from(field.normals[3 * at + axis])) };
        let slants = |at: usize| match (camera, setting) {
            (None, _) => [normal(at)[2]; 2],
            (Some(camera), Setting::Compatible) => {
                camera.published_slants(normal(at), at / field.width, at % field.width)
            }
            (Some(camera), Setting::Converged) => camera.slants(normal(at), at / field.width, at % field.width),
        };
        let number = |at: usize| field.regions.map_or(0, |regions| regions[at]);
        let tied = |at: usize, other: usize, inside: bool| {
            f64::from(u8::from(inside && field.mask[other] && number(other) == number(at)))
        };
        let n = [0, 1].map(|axis| each(&|at| normal(at)[axis]));
        let g = [0, 1].map(|axis| each(&|at| slants(at)[axis]));
        let ties = [
            each(&|at| tied(at, at + 1, at % field.width + 1 < crop.col + width)),
            each(&|at| tied(at, at + field.width, at / field.width + 1 < crop.row + height)),
        ];
        let mut trust = each(&|at| field.weights.map_or(1.0, |weights| f64::from(weights[at])));
        let weights =
            (&trust, &g[0], &g[1]).into_par_iter().map(|(trust, g_x, g_y)| trust * (g_x * g_x).max(g_y * g_y));
        let unit = to_unit(weights.reduce(|| 0.0, f64::max));
        trust.par_iter_mut().for_each(|trust| *trust *= unit);
        Self { crop, n, g, trust, unit, ties, mask }
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

/// Operator and right side of the normal equations for the shares of a surface, none of them taken below `least`.
pub(super) fn assemble<W: Real>(pixels: &Pixels, shares: &Shares, least: f64) -> (Stencil<W>, [Vec<f64>; 2]) {
    let Pixels { n, g, trust, ties, .. } = pixels;
    let grid = pixels.crop.grid;
    // Weight and push of the edge from pixel a to the right (axis 0) or down (1), to pixel b.
    let edge = |axis: usize, a: usize, b: usize| {
        let [ahead_a, ahead_b] = [a, b].map(|pixel| shares[axis][pixel].clamp(least, 1.0 - least));
        // Ahead is to the right and up: the edge is ahead of its left pixel, and of its lower one.
        let (share_a, share_b, sign) =
            if axis == 0 { (ahead_a, 1.0 - ahead_b, -1.0) } else { (1.0 - ahead_a, ahead_b, 1.0) };
        let pull = |pixel: usize, share: f64| ties[axis][a] * trust[pixel] * share * g[axis][pixel];
        let (pull_a, pull_b) = (pull(a, share_a), pull(b, share_b));
        (pull_a * g[axis][a] + pull_b * g[axis][b], sign * (pull_a * n[axis][a] + pull_b * n[axis][b]))
    };
    let rows_of = || {
        |row: usize, right: &mut EdgeRow<W>, below: &mut EdgeRow<W>| {
            for (axis, (edges, stride)) in [(right, 1), (below, grid.width)].into_iter().enumerate() {
                edges.clear();
                // Nothing ties a pixel to one that is not there.
                for col in (0..grid.width).filter(|col| ties[axis][row * grid.width + col] > 0.0) {
                    let (weight, push) = edge(axis, row * grid.width + col, row * grid.width + col + stride);
                    (edges.weight[col], edges.push[col]) = (W::nearest(weight), push);
                }
            }
        }
    };
    let mut right = [(); 2].map(|()| vec![0.0; grid.half_pixels()]);
    let stencil = Stencil::from_edges(grid, rows_of, Some(&mut right));
    (stencil, right)
}
