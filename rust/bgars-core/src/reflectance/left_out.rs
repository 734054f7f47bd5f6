//! What the material of the balls predicts of a light that it was not shown.

use rayon::prelude::*;

use super::anchor::Circle;
use super::ball::{Ball, BallWork, Scratch};
use super::material::Material;
use super::observe::Reader;
use super::samples::spaced;
use super::scale::unbend;
use super::spread::Spread;
use super::table::Signatures;
use crate::Lights;

/// Pixels that lights are left out at, about; balls that they are taken from at most; lights at each.
const PIXELS: usize = 500;
const BALLS: usize = 25;
const LIGHTS: usize = 8;

/// Standard deviation of a bent level: the loss of the material's fit is then the pixel's.
const SIGMA: f32 = 1.0;

/// A light that was left out at a pixel, in linear grey levels of 255 at unit intensity of the light.
#[derive(Clone, Copy, Debug)]
pub struct LeftOut {
    /// Predicted less seen; 0 where a clipped value was predicted to be brighter.
    pub difference: f32,
    /// Seen.
    pub value: f32,
    /// Mean of all lights at the pixel.
    pub mean: f32,
}

/// Leaves one light after the other out at some pixels of the balls: the normal comes from the others and the weak pull to the
/// circle's. Without what was learnt from the residuals of the other balls: where all balls have the same wrong shape, these would
/// say that it is right.
pub fn left_out(
    reader: &Reader<'_>,
    lights: &Lights,
    clip: &[f32],
    material: &Material,
    circles: &[Circle],
    pixels: &[Vec<usize>],
) -> Vec<LeftOut> {
    let spread = Spread::constant(SIGMA);
    let near = matches!(lights, Lights::Near { .. });
    let common = (!near).then(|| Ball::new(Circle::NOWHERE, material.clone(), None).signatures(lights));
    let every = circles.len().div_ceil(BALLS).max(1);
    let taken: Vec<usize> = (0..circles.len()).step_by(every).collect();
    let of_each = (PIXELS / taken.len().max(1)).max(1);
    let of_ball = |&index: &usize| {
        let ball = Ball::new(circles[index], material.clone(), None);
        let own: Option<Signatures> = near.then(|| ball.signatures(lights));
        let Some(table) = own.as_ref().or(common.as_ref()) else { return Vec::new() };
        let work = BallWork { reader, ball: &ball, table, spread: &spread, clip };
        let mut scratch = Scratch::new(reader.lights());
        let mut found = Vec::new();
        for &pixel in spaced(&pixels[index], of_each) {
            of_pixel(&work, pixel, &mut scratch, &mut found);
        }
        found
    };
    taken.par_iter().map(of_ball).collect::<Vec<_>>().concat()
}

fn of_pixel(work: &BallWork<'_>, pixel: usize, scratch: &mut Scratch, found: &mut Vec<LeftOut>) {
    let mut bent = vec![0.0; work.reader.lights()];
    work.reader.read(pixel, &mut bent);
    let linear = |bent: f32| unbend(f64::from(bent)) as f32;
    let mean = bent.iter().map(|&level| linear(level)).sum::<f32>() / bent.len() as f32;
    for light in (0..bent.len()).step_by(bent.len().div_ceil(LIGHTS)) {
        let predicted = work.predicted(pixel, light, scratch);
        let value = linear(bent[light]);
        let mut difference = linear(predicted) - value;
        if bent[light] >= work.clip[light] {
            difference = difference.min(0.0);
        }
        found.push(LeftOut { difference, value, mean });
    }
}
