//! What is left of each light's grey levels near a rim when the rim's model is taken out: the silhouettes' normal equations.

use std::f64::consts::{FRAC_PI_4, TAU};

use multiversion::multiversion;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use super::bands::Circle;
use super::profiles::{ANGLES, PROFILES, STEPS_PER_PX};

/// Board, step, root, ramp inside, ramp outside, board along the rim, step along the rim.
pub const BASIS: usize = 7;
/// Derivatives by the radius: of the four profiles, and of the step along the rim.
pub const SLOPES: usize = 5;
const LANES: usize = 8;
/// Added to the diagonal, as a share of the trace: a sector without pixels outside the rim knows no board.
const RIDGE: f64 = 1e-6;
const LEAST_RIDGE: f64 = 1e-9;

/// Pixels near rims by ball and sector, padded to equal number: see [`super::bands`].
#[derive(Clone, Copy, Debug)]
pub struct RimPixels<'a> {
    /// Rows relative to the ball's anchor.
    pub rows: &'a [f32],
    /// Columns relative to the ball's anchor.
    pub cols: &'a [f32],
    /// Roots of the weights, 0 for padding.
    pub weights: &'a [f32],
    /// Grey levels times `weights`, light after light.
    pub levels: &'a [f32],
    /// Number of lights.
    pub lights: usize,
    /// Sectors of a ball.
    pub sectors: usize,
    /// Places of a sector.
    pub most: usize,
}

/// Normal equations of what the basis leaves, ball after ball, sector after sector.
#[derive(Debug, PartialEq)]
pub struct Eliminated {
    /// Products of slopes and lights with each other, `(SLOPES + lights)` squared a sector.
    pub rest: Vec<f64>,
    /// Coefficients of the lights in the basis, `BASIS * lights` a sector.
    pub coefficients: Vec<f64>,
}

/// Takes the basis out of slopes and lights, by least squares in each sector.
///
/// # Inputs
/// `circles` relative to the anchors of the pixels' balls, one a ball; `table` of [`super::profiles`] with the same `blur_px`.
///
/// # Method
/// The block elimination of a least-squares problem that is linear in the basis (Golub and Pereyra 1973): with the Gram
/// matrix `[[A, B], [B', C]]` of basis and others, `rest` is `C - B' A^-1 B` and the coefficients are `A^-1 B`. Sums are
/// in f64: what the basis leaves on metal is a millionth of them.
///
/// # Examples
/// ```
/// use bgars_core::rims::{BASIS, Circle, RimPixels, SLOPES, bands, eliminate, profiles};
/// let circle = Circle { row_px: 0.0, col_px: 0.0, radius_px: 20.0 };
/// let band = bands(&[circle], &[[4.0, 4.0]], 1, 4);
/// // A light that reads 7 everywhere is all board.
/// let levels: Vec<f32> = band.weights.iter().map(|weight| 7.0 * weight).collect();
/// let pixels = RimPixels {
///     rows: &band.rows, cols: &band.cols, weights: &band.weights, levels: &levels, lights: 1, sectors: 4, most: band.most,
/// };
/// let left = eliminate(pixels, &[circle], 0.3, &profiles(0.3, 9.0));
/// assert!((left.coefficients[0] - 7.0).abs() < 0.01);
/// let squares: f32 = levels.iter().map(|level| level * level).sum();
/// assert!(left.rest[(SLOPES + 1) * (SLOPES + 1) - 1] < 1e-4 * f64::from(squares) / 4.0);
/// assert_eq!(left.coefficients.len(), 4 * BASIS);
/// ```
#[must_use]
pub fn eliminate(pixels: RimPixels<'_>, circles: &[Circle], blur_px: f64, table: &[[f32; PROFILES]]) -> Eliminated {
    let RimPixels { lights, sectors, most, .. } = pixels;
    let others = SLOPES + lights;
    let mut rest = vec![0.0; circles.len() * sectors * others * others];
    let mut coefficients = vec![0.0; circles.len() * sectors * BASIS * lights];
    let width = most.next_multiple_of(LANES);
    let scratch = || Scratch { columns: vec![0.0; (BASIS + others) * width], gram: vec![0.0; (BASIS + others).pow(2)] };
    let tangents = &std::array::from_fn(|angle| ((angle as f64 + 0.5) * (FRAC_PI_4 / (ANGLES - 1) as f64)).tan());
    if most > 0 && lights > 0 {
        let work = rest.par_chunks_mut(others * others).zip(coefficients.par_chunks_mut(BASIS * lights));
        work.enumerate().with_min_len(sectors).for_each_init(scratch, |scratch, (place, (rest, coefficients))| {
            let rim =
                Rim { circle: circles[place / sectors], sector: place % sectors, sectors, blur_px, table, tangents };
            let used = scratch.fill(pixels, place, &rim);
            multiply(&scratch.columns, width, used.next_multiple_of(LANES), &mut scratch.gram);
            scratch.take_out(rest, coefficients);
        });
    }
    Eliminated { rest, coefficients }
}

/// The model of one sector's rim.
struct Rim<'a> {
    circle: Circle,
    sector: usize,
    sectors: usize,
    blur_px: f64,
    table: &'a [[f32; PROFILES]],
    /// Of the angles halfway between the directions of the table.
    tangents: &'a [f64; ANGLES - 1],
}

impl Rim<'_> {
    /// Basis and slopes at a pixel.
    fn at(&self, x: f64, y: f64, middle: (f64, f64)) -> [f64; BASIS + SLOPES] {
        let distance = (x * x + y * y).sqrt();
        // The mean distance of the points of a pixel is a little more than that of its centre, across the direction.
        let spread = 1.0 / 24.0 + 0.5 * self.blur_px * self.blur_px;
        let shapes = self.shapes(self.circle.radius_px - distance - spread / distance.max(0.5), x.abs(), y.abs());
        let (sine, cosine) = middle;
        let along = (y * cosine - x * sine) / (self.circle.radius_px * (TAU / self.sectors as f64 / 2.0));
        let [step, root, inside, outside, d_step, d_root, d_inside, d_outside] = shapes;
        [1.0, step, root, inside, outside, along, along * step, d_step, d_root, d_inside, d_outside, along * d_step]
    }

    /// Profiles and their derivatives, linear between the depths of the table: with the nearest one circles move by jumps,
    /// which weak rims amplify.
    fn shapes(&self, depth_px: f64, ax: f64, ay: f64) -> [f64; PROFILES] {
        let depths = self.table.len() / ANGLES;
        let angle = self.tangents.iter().filter(|tangent| ax.min(ay) > **tangent * ax.max(ay)).count();
        let place = (depth_px * STEPS_PER_PX + (depths / 2) as f64).clamp(0.0, (depths - 1) as f64);
        let below = place as usize;
        let table = &self.table[angle * depths..][..depths];
        let (low, high) = (&table[below], &table[(below + 1).min(depths - 1)]);
        let part = place - below as f64;
        std::array::from_fn(|shape| {
            let (low, high) = (f64::from(low[shape]), f64::from(high[shape]));
            low + part * (high - low)
        })
    }
}

/// Room for one sector: columns of basis, slopes and lights one after the other, and their products.
struct Scratch {
    columns: Vec<f64>,
    gram: Vec<f64>,
}

impl Scratch {
    /// Writes the columns of the pixels that have weight; how many they are.
    fn fill(&mut self, pixels: RimPixels<'_>, place: usize, rim: &Rim<'_>) -> usize {
        let RimPixels { rows, cols, weights, levels, lights, most, .. } = pixels;
        let width = most.next_multiple_of(LANES);
        let middle = ((rim.sector as f64 + 0.5) * (TAU / rim.sectors as f64)).sin_cos();
        let mut used = 0;
        for at in place * most..(place + 1) * most {
            let weight = f64::from(weights[at]);
            if weight <= 0.0 {
                continue;
            }
            let x = f64::from(cols[at]) - rim.circle.col_px;
            let y = rim.circle.row_px - f64::from(rows[at]);
            for (column, value) in rim.at(x, y, middle).into_iter().enumerate() {
                self.columns[column * width + used] = weight * value;
            }
            for light in 0..lights {
                self.columns[(BASIS + SLOPES + light) * width + used] = f64::from(levels[light * rows.len() + at]);
            }
            used += 1;
        }
        for column in self.columns.chunks_exact_mut(width) {
            column[used..used.next_multiple_of(LANES)].fill(0.0);
        }
        used
    }

    /// Eliminates the basis from the products.
    fn take_out(&self, rest: &mut [f64], coefficients: &mut [f64]) {
        let lights = coefficients.len() / BASIS;
        let others = SLOPES + lights;
        let size = BASIS + others;
        let mut basis = SMatrix::<f64, BASIS, BASIS>::from_fn(|i, j| self.gram[i.min(j) * size + i.max(j)]);
        let ridge = RIDGE * basis.trace() + LEAST_RIDGE;
        for diagonal in 0..BASIS {
            basis[(diagonal, diagonal)] += ridge;
        }
        // Positive definite by its ridge; of numbers that are none nothing is known.
        let Some(factors) = basis.cholesky() else {
            rest.fill(0.0);
            return;
        };
        for column in 0..others {
            let right = SVector::<f64, BASIS>::from_fn(|row, _| self.gram[row * size + BASIS + column]);
            let solved = factors.solve(&right);
            for other in 0..=column {
                let product: f64 = (0..BASIS).map(|row| self.gram[row * size + BASIS + other] * solved[row]).sum();
                let left = self.gram[(BASIS + other) * size + BASIS + column] - product;
                rest[other * others + column] = left;
                rest[column * others + other] = left;
            }
            if column >= SLOPES {
                for row in 0..BASIS {
                    coefficients[row * lights + column - SLOPES] = solved[row];
                }
            }
        }
    }
}

/// Products of columns with each other, those at or above the diagonal.
#[multiversion(targets("x86_64+avx2+fma"))]
fn multiply(columns: &[f64], width: usize, used: usize, gram: &mut [f64]) {
    let size = columns.len() / width;
    for i in 0..size {
        let first = &columns[i * width..][..used];
        for j in i..size {
            let second = &columns[j * width..][..used];
            let mut sums = [0.0; LANES];
            for (a, b) in first.chunks_exact(LANES).zip(second.chunks_exact(LANES)) {
                for lane in 0..LANES {
                    sums[lane] += a[lane] * b[lane];
                }
            }
            gram[i * size + j] = sums.iter().sum();
        }
    }
}
