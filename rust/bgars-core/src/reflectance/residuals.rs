//! What a material does not explain, learnt from the other balls: inter-reflections above all.

use super::scale::bend;
use super::material::Material;
use super::samples::Samples;
use super::disc::to_disc;
use rayon::prelude::*;

/// Cells along the diameter of the disc of normals.
const SIDE: usize = 41;

/// Passes of the smoothing filter (1 2 1) / 4.
const SMOOTHINGS: usize = 2;

/// Weight of observations that a cell needs.
const ENOUGH: f32 = 0.2;

/// Balls that must have seen a cell, the one that is corrected left out.
const MIN_BALLS: usize = 4;

/// A smooth table on the disc: what to add to the bent level of each light, and its spread from ball to ball.
#[derive(Clone, Debug)]
pub struct Correction {
    lights: usize,
    shift: Vec<f32>,
    sigma: Vec<f32>,
}

/// The residuals of all balls, cell by cell.
#[derive(Clone, Debug)]
pub struct BallResiduals {
    lights: usize,
    balls: usize,
    /// `balls` values for each cell and light; NaN where a ball shows nothing.
    values: Vec<f32>,
}

impl BallResiduals {
    /// Residuals of samples against the material of their ball.
    pub fn new(samples: &Samples, materials: &[Material]) -> Self {
        let (lights, balls) = (samples.lights, materials.len());
        let tables: Vec<Vec<f32>> =
            (0..balls).into_par_iter().map(|ball| ball_table(samples, ball, &materials[ball])).collect();
        let mut values = vec![f32::NAN; SIDE * SIDE * lights * balls];
        for (ball, table) in tables.iter().enumerate() {
            for (cell, &value) in table.iter().enumerate() {
                values[cell * balls + ball] = value;
            }
        }
        Self { lights, balls, values }
    }

    /// What the other balls say about one.
    pub fn without(&self, ball: usize) -> Correction {
        let mut correction = Correction {
            lights: self.lights,
            shift: vec![0.0; SIDE * SIDE * self.lights],
            sigma: vec![0.0; SIDE * SIDE * self.lights],
        };
        let mut others = Vec::with_capacity(self.balls);
        for (cell, values) in self.values.chunks_exact(self.balls).enumerate() {
            others.clear();
            others.extend(
                values.iter().enumerate().filter(|(other, value)| *other != ball && value.is_finite()).map(|(_, &v)| v),
            );
            if others.len() < MIN_BALLS {
                continue;
            }
            let middle = median(&mut others);
            for value in &mut others {
                *value = (*value - middle).abs();
            }
            correction.shift[cell] = middle;
            correction.sigma[cell] = 1.4826 * median(&mut others);
        }
        correction
    }
}

fn median(values: &mut [f32]) -> f32 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}

impl Correction {
    /// Shift and spread of every light at a place of the disc.
    pub fn at(&self, point: [f64; 2], light: usize) -> (f32, f32) {
        let position = |v: f64| ((v + 1.0) * 0.5 * (SIDE - 1) as f64).clamp(0.0, (SIDE - 1) as f64 - 1e-6);
        let (col, row) = (position(point[0]), position(point[1]));
        let (c, r) = (col as usize, row as usize);
        let (fc, fr) = ((col - c as f64) as f32, (row - r as f64) as f32);
        let mut sums = (0.0, 0.0);
        for (dr, wr) in [(0, 1.0 - fr), (1, fr)] {
            for (dc, wc) in [(0, 1.0 - fc), (1, fc)] {
                let cell = ((r + dr) * SIDE + c + dc) * self.lights + light;
                sums.0 += wr * wc * self.shift[cell];
                sums.1 += wr * wc * self.sigma[cell];
            }
        }
        sums
    }
}

/// Smoothed mean residual of one ball in each cell and light.
fn ball_table(samples: &Samples, ball: usize, material: &Material) -> Vec<f32> {
    let lights = samples.lights;
    let mut sums = vec![0.0f32; SIDE * SIDE * lights];
    let mut weights = vec![0.0f32; SIDE * SIDE * lights];
    for pixel in (0..samples.len()).filter(|&pixel| samples.balls[pixel] == ball) {
        let [a, b] = to_disc(&samples.normals[pixel]);
        let cell = |v: f64| (((v + 1.0) * 0.5 * (SIDE - 1) as f64).round() as usize).min(SIDE - 1);
        let place = (cell(b) * SIDE + cell(a)) * lights;
        for light in 0..lights {
            let index = pixel * lights + light;
            let level = samples.brightness(index, light, material);
            if samples.values[index] < samples.clip[light] || bend(level) < samples.clip[light] {
                sums[place + light] += (samples.values[index] - bend(level).min(samples.clip[light])) as f32;
                weights[place + light] += 1.0;
            }
        }
    }
    for _ in 0..SMOOTHINGS {
        smooth(&mut sums, lights);
        smooth(&mut weights, lights);
    }
    sums.iter().zip(&weights).map(|(&sum, &weight)| if weight > ENOUGH { sum / weight } else { f32::NAN }).collect()
}

/// (1 2 1) / 4 along both axes; nothing beyond the edge.
fn smooth(table: &mut [f32], lights: usize) {
    for (stride, across) in [(lights, SIDE * lights), (SIDE * lights, lights)] {
        for line in 0..SIDE {
            for light in 0..lights {
                let at = |index: usize| line * across + index * stride + light;
                let mut before = 0.0;
                for index in 0..SIDE {
                    let here = table[at(index)];
                    let after = if index + 1 < SIDE { table[at(index + 1)] } else { 0.0 };
                    table[at(index)] = 0.25 * (before + 2.0 * here + after);
                    before = here;
                }
            }
        }
    }
}
