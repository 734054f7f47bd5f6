//! What a material does not explain, learnt from the other balls: inter-reflections above all.

use rayon::prelude::*;

use super::cells::{CellSums, CellTable, left_out};
use super::disc::to_disc;
use super::fit::LOSS_SCALE;
use super::material::Material;
use super::samples::Samples;
use super::scale::bend;

/// Learning the residuals must lower the left-out cost by this share.
const EVIDENCE: f64 = 0.05;

/// Pixels that the left-out cost is taken over, about.
const JUDGED_PIXELS: usize = 4000;

/// For each ball, what to add to the bent level of each light, by what the others show beyond their materials; `None`
/// where that does not help balls that had no part in it.
pub fn learnt_corrections(samples: &Samples, materials: &[Material]) -> Option<Vec<CellTable>> {
    let balls = materials.len();
    let tables: Vec<Vec<f32>> =
        (0..balls).into_par_iter().map(|ball| ball_residuals(samples, ball, &materials[ball])).collect();
    let corrections = left_out(samples.lights, &tables);
    let (mut without, mut with) = (0.0, 0.0);
    let mut shifts = vec![0.0; samples.lights];
    for pixel in (0..samples.len()).step_by((samples.len() / JUDGED_PIXELS).max(1)) {
        let ball = samples.balls[pixel];
        let point = to_disc(&samples.normals[pixel]);
        shifts.fill(0.0);
        corrections[ball].add_middle(point, &mut shifts);
        for (light, &shift) in shifts.iter().enumerate() {
            let index = pixel * samples.lights + light;
            let predicted = bend(samples.brightness(index, light, &materials[ball]));
            let loss = |predicted: f64| {
                ((samples.values[index] - predicted.min(samples.clip[light])) / LOSS_SCALE).powi(2).ln_1p()
            };
            without += loss(predicted);
            with += loss(predicted + f64::from(shift));
        }
    }
    (with < (1.0 - EVIDENCE) * without).then_some(corrections)
}

/// Smoothed mean residual of one ball in each cell and light.
fn ball_residuals(samples: &Samples, ball: usize, material: &Material) -> Vec<f32> {
    let lights = samples.lights;
    let mut sums = CellSums::new(lights);
    for pixel in (0..samples.len()).filter(|&pixel| samples.balls[pixel] == ball) {
        let point = to_disc(&samples.normals[pixel]);
        for light in 0..lights {
            let index = pixel * lights + light;
            let predicted = bend(samples.brightness(index, light, material));
            let (seen, clip) = (samples.values[index], samples.clip[light]);
            // Clipped as predicted says nothing.
            if seen < clip || predicted < clip {
                sums.add(point, light, (seen - predicted.min(clip)) as f32);
            }
        }
    }
    sums.means()
}
