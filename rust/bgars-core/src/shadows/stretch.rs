//! Linear least squares of the stretches of one shadow's edge, with Cauchy weights the second time.
//!
//! The model of the pixels, and what its coefficients mean, stands in `python/bgars/inspection/shadow_edges.py`.

use nalgebra::{SMatrix, SVector};

/// Cauchy weights at 2.5 standard deviations.
const CAUCHY: f64 = 2.5;
/// What they make the formula of least squares too small by, for Gaussian noise: the square root of
/// (E[psi^2] / E[psi']^2) over (E[w r^2] / E[w]^2) (Huber 1981, section 7.6).
const CAUCHY_FACTOR: f64 = 1.10;
const MIN_PIXELS: f64 = 12.0;
const RIDGE: f64 = 1e-9;
const MAX_GROWTH: f64 = 0.3;

/// Numbers that [`Stretch::numbers`] gives.
pub const STRETCH_FIELDS: usize = 14;

/// Columns at most: shadow level, lit level, displacement, change of spread.
pub(super) const COLUMNS: usize = 4;

/// A usable pixel near an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
    /// Columns of the model; the last one is 0 where it has three.
    pub columns: [f64; COLUMNS],
    pub value: f64,
    pub texture: f64,
    /// Signed distance to the edge over its spread, and in pixels.
    pub scaled: f64,
    pub across_px: f64,
    /// Which line across the edge it lies on.
    pub line: usize,
    /// Weight, from the second round on.
    pub weight: f64,
}

/// A line across the edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Of the tangent point on the terminator.
    pub angle_rad: f64,
    /// Way of the light from the tangent point, over the slope of D.
    pub way_px: f64,
    pub spread_px: f64,
}

/// What was fitted to one stretch.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stretch {
    /// Shadow level, lit level, displacement and change of spread, both times the contrast.
    pub solution: [f64; COLUMNS],
    /// Their standard uncertainties.
    pub deviation: [f64; COLUMNS],
    /// Mean texture of the board.
    pub texture: f64,
    /// Relative growth of the texture per pixel across the edge, outward.
    pub growth: f64,
    /// Means over the lines, weighted by what they say about the displacement: angle, way and spread.
    pub mean: [f64; 3],
    /// Whether it has pixels enough.
    pub looked_at: bool,
}

impl Stretch {
    /// Everything in a row, in the order of the fields; `looked_at` as 1 or 0.
    #[must_use]
    pub fn numbers(&self) -> [f64; STRETCH_FIELDS] {
        let mut numbers = [0.0; STRETCH_FIELDS];
        numbers[..4].copy_from_slice(&self.solution[..4]);
        numbers[4..8].copy_from_slice(&self.deviation[..4]);
        numbers[8] = self.texture;
        numbers[9] = self.growth;
        numbers[10..13].copy_from_slice(&self.mean);
        numbers[13] = f64::from(u8::from(self.looked_at));
        numbers
    }
}

/// Pixels of one stretch, and whether any line of it was looked at.
pub(super) struct Part<'a> {
    pub pixels: &'a mut [Pixel],
    pub present: bool,
}

/// Fits all stretches of one shadow, which share one level of noise, by the first `C` columns; returns that noise.
///
/// `robust`: a second time with Cauchy weights. Not where the model is meant to miss single pixels.
pub(super) fn fit<const C: usize>(parts: &mut [Part<'_>], lines: &[Line], robust: bool, out: &mut [Stretch]) -> f64 {
    let freedom_lost = (C * parts.iter().filter(|part| part.present).count()) as f64;
    let mut noise = 0.0;
    for turn in 0..if robust { 2 } else { 1 } {
        let (mut square, mut points) = (0.0, 0.0);
        for (part, stretch) in parts.iter_mut().zip(&mut *out) {
            if turn > 0 {
                let scale = CAUCHY * f64::max(noise, 1e-9);
                for pixel in &mut *part.pixels {
                    let off = residual::<C>(pixel, &stretch.solution) / scale;
                    pixel.weight = 1.0 / (1.0 + off * off);
                }
            }
            (stretch.solution, stretch.deviation) = solve::<C>(part.pixels);
            for pixel in &*part.pixels {
                let off = residual::<C>(pixel, &stretch.solution);
                square += pixel.weight * off * off;
                points += pixel.weight;
            }
        }
        noise = (square / f64::max(points - freedom_lost, 1.0)).sqrt();
    }
    let factor = noise * if robust { CAUCHY_FACTOR } else { 1.0 };
    for (part, stretch) in parts.iter().zip(&mut *out) {
        stretch.deviation = stretch.deviation.map(|deviation| factor * deviation);
        summarise(part, lines, stretch);
        if C == 4 {
            stretch.growth = growth(part.pixels);
        }
    }
    noise
}

fn residual<const C: usize>(pixel: &Pixel, solution: &[f64; COLUMNS]) -> f64 {
    (0..C).fold(pixel.value, |rest, c| rest - solution[c] * pixel.columns[c])
}

/// One round of least squares by the first `C` columns: the solution, and its standard uncertainty for noise of 1.
fn solve<const C: usize>(pixels: &[Pixel]) -> ([f64; COLUMNS], [f64; COLUMNS]) {
    let mut normal = SMatrix::<f64, C, C>::zeros();
    let mut right = SVector::<f64, C>::zeros();
    for pixel in pixels {
        for i in 0..C {
            let weighted = pixel.weight * pixel.columns[i];
            right[i] += weighted * pixel.value;
            for j in 0..=i {
                normal[(i, j)] += weighted * pixel.columns[j];
            }
        }
    }
    let scale = SVector::<f64, C>::from_fn(|i, _| normal[(i, i)].max(1e-30).sqrt());
    let scaled = SMatrix::<f64, C, C>::from_fn(|i, j| {
        let (low, high) = (i.max(j), i.min(j));
        normal[(low, high)] / (scale[i] * scale[j]) + if i == j { RIDGE } else { 0.0 }
    });
    let (mut solution, mut deviation) = ([0.0; COLUMNS], [0.0; COLUMNS]);
    // What is singular in spite of the ridge is not measured, and has no pixels enough.
    let Some(inverse) = scaled.cholesky().map(|factor| factor.inverse()) else { return (solution, deviation) };
    let scaled_solution = inverse * right.component_div(&scale);
    for i in 0..C {
        solution[i] = scaled_solution[i] / scale[i];
        deviation[i] = inverse[(i, i)].max(0.0).sqrt() / scale[i];
    }
    (solution, deviation)
}

fn summarise(part: &Part<'_>, lines: &[Line], stretch: &mut Stretch) {
    let (mut weight, mut texture, mut information, mut mean) = (0.0, 0.0, 0.0, [0.0; 3]);
    for pixel in &*part.pixels {
        weight += pixel.weight;
        texture += pixel.weight * pixel.texture;
        let says = pixel.weight * pixel.columns[2] * pixel.columns[2];
        let line = &lines[pixel.line];
        information += says;
        for (sum, value) in mean.iter_mut().zip([line.angle_rad, line.way_px, line.spread_px]) {
            *sum += says * value;
        }
    }
    stretch.texture = texture / weight.max(1e-9);
    stretch.mean = mean.map(|sum| sum / information.max(1e-30));
    stretch.looked_at = weight >= MIN_PIXELS;
    if information <= 0.0 {
        stretch.solution = [0.0; COLUMNS]; // no contrast: the edge is elsewhere
    }
}

/// A line through the texture near the edge: its slope over its mean.
fn growth(pixels: &[Pixel]) -> f64 {
    let (mut total, mut first, mut level, mut second, mut mixed) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for pixel in pixels {
        let near = (-0.125 * pixel.scaled * pixel.scaled).exp();
        total += near;
        first += near * pixel.across_px;
        level += near * pixel.texture;
        second += near * pixel.across_px * pixel.across_px;
        mixed += near * pixel.across_px * pixel.texture;
    }
    let total = f64::max(total, 1e-9);
    let variance = second - first * first / total;
    if !(variance > 0.0 && level > 0.0) {
        return 0.0;
    }
    let slope = (mixed - first * level / total) / variance.max(1e-9);
    (slope * total / level.max(1e-9)).clamp(-MAX_GROWTH, MAX_GROWTH)
}
