//! From circles and images to the normals of the balls.

use rayon::prelude::*;

use super::anchor::{Circle, pixel_centre};
use super::ball::{Ball, BallPixel, BallWork, Scratch};
use super::choose::best_material;
use super::fit::MaterialFit;
use super::material::Material;
use super::observe::Reader;
use super::residuals::BallResiduals;
use super::samples::Samples;
use super::scale::bend;
use super::spread::Spread;
use super::variation::ball_materials;
use crate::{ImageStack, Lights, Pixel, Radiometry, Result};

/// Pixels that a material is fitted on, in all and at least of each ball.
const FIT_PIXELS: usize = 3000;

/// Pixels of a ball that the residuals are learnt on, at most.
const RESIDUAL_PIXELS: usize = 1200;

/// Pixels that spread and expectation are learnt on, in all.
const LEARNING_PIXELS: usize = 4000;

/// Smallest n_z of pixels that a material is fitted on.
const FIT_MIN_N_Z: f64 = 0.2;

/// Standard deviation of a bent level before anything is known.
const FIRST_SIGMA: f32 = 2.0;

/// Smallest standard deviation of a bent level.
const MIN_SIGMA: f32 = 0.05;

/// Standard deviation of a ball's normals from its circle's: before anything is known, and its limits.
const FIRST_PRIOR_DEG: f32 = 1.0;
const PRIOR_LIMITS_DEG: (f32, f32) = (0.4, 5.0);

/// Share of a normal distribution within one standard deviation.
const ONE_SIGMA: f32 = 0.683;

/// Fewest pixels that say anything about a ball.
const ENOUGH_PIXELS: usize = 20;

/// Limits of the factor between true and stated errors.
const CALIBRATION_LIMITS: (f32, f32) = (0.5, 4.0);

/// Pixels whose data fix the normal as well as this tell how far a ball is from its sphere.
const TELLING_DEG: f32 = 1.0;

/// Learning the residuals must lower the left-out cost by this share.
const EVIDENCE: f64 = 0.15;

/// What was found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The material of all balls.
    pub fit: MaterialFit,
    /// True where each ball has a material of its own.
    pub varied: bool,
    /// True where residuals were learnt from the other balls.
    pub corrected: bool,
    /// Standard deviation of each ball's normals from its circle's, in degrees.
    pub prior_deg: Vec<f32>,
    /// The normals of each ball.
    pub balls: Vec<Vec<BallPixel>>,
}

/// Estimates the normals of all pixels inside the circles.
pub fn estimate_balls<P: Pixel>(
    stack: &ImageStack<'_, P>,
    lights: &Lights,
    radiometry: &Radiometry<'_, P>,
    circles: &[Circle],
) -> Result<Outcome> {
    radiometry.check(stack)?;
    let reader = Reader::new(stack, radiometry);
    let inside: Vec<Vec<usize>> = circles.iter().map(|circle| inside(circle, reader.size())).collect();
    let balls = circles.len();
    let clip = reader.clip_levels(0);
    let few = samples(&reader, lights, circles, &inside, &clip, (FIT_PIXELS / balls).max(100));
    let fit = best_material(&few);
    let many = samples(&reader, lights, circles, &inside, &clip, RESIDUAL_PIXELS);
    let materials = ball_materials(&many, &fit.material, balls);
    let varied = materials.iter().any(|material| *material != fit.material);
    let mut known: Vec<Ball> = circles
        .iter()
        .zip(&materials)
        .map(|(&circle, material)| Ball {
            circle,
            material: material.clone(),
            correction: None,
            prior_rad: FIRST_PRIOR_DEG.to_radians(),
            deviation_rad: FIRST_PRIOR_DEG.to_radians(),
        })
        .collect();
    let corrected = learn_residuals(&many, &materials, &mut known);
    let bent_clip: Vec<f32> = clip.iter().map(|&level| bend(level) as f32).collect();
    let job = Job { reader: &reader, lights, clip: &bent_clip, inside: &inside };
    let mut spread = Spread::constant(FIRST_SIGMA);
    for _ in 0..2 {
        spread = job.learn_spread(&known, &spread);
    }
    spread = job.learn_deviations(&mut known, &spread);
    if std::env::var_os("BGARS_DEBUG").is_some() {
        eprintln!("{spread:?} varied {varied} corrected {corrected}");
    }
    let balls = job.run(&known, &spread, 1);
    Ok(Outcome {
        fit,
        varied,
        corrected,
        prior_deg: known.iter().map(|ball| ball.prior_rad.to_degrees()).collect(),
        balls,
    })
}

/// Pixels inside a circle.
fn inside(circle: &Circle, (height, width): (usize, usize)) -> Vec<usize> {
    let (rows, cols) = circle.window(height, width);
    rows.flat_map(|row| cols.clone().map(move |col| (row, col)))
        .filter(|&(row, col)| {
            let (x, y) = pixel_centre(row, col, height, width);
            circle.normal(x, y).is_some()
        })
        .map(|(row, col)| row * width + col)
        .collect()
}

/// Some pixels of each ball with the normals of its circle.
fn samples<P: Pixel>(
    reader: &Reader<'_, '_, P>,
    lights: &Lights,
    circles: &[Circle],
    inside: &[Vec<usize>],
    clip: &[f64],
    of_each: usize,
) -> Samples {
    let mut samples = Samples::new(clip);
    let mut bent = vec![0.0; reader.lights()];
    let (height, width) = reader.size();
    for (ball, (circle, pixels)) in circles.iter().zip(inside).enumerate() {
        for &pixel in spaced(pixels, of_each) {
            let (x, y) = pixel_centre(pixel / width, pixel % width, height, width);
            if let Some(normal) = circle.normal(x, y).filter(|normal| normal.z > FIT_MIN_N_Z) {
                reader.read(pixel, &mut bent);
                samples.push(ball, circle, normal, &bent, lights);
            }
        }
    }
    samples
}

/// About `count` of the values, evenly spaced.
fn spaced(values: &[usize], count: usize) -> impl Iterator<Item = &usize> {
    let step = (values.len() as f64 / count as f64).max(1.0);
    let taken = (values.len() as f64 / step) as usize;
    (0..taken).map(move |index| &values[(index as f64 * step) as usize])
}

/// Gives each ball what the others show beyond their materials, where that helps balls that had no part in it.
fn learn_residuals(samples: &Samples, materials: &[Material], known: &mut [Ball]) -> bool {
    let residuals = BallResiduals::new(samples, materials);
    let corrections: Vec<_> = (0..known.len()).into_par_iter().map(|ball| residuals.without(ball)).collect();
    let (mut without, mut with) = (0.0, 0.0);
    for pixel in (0..samples.len()).step_by((samples.len() / LEARNING_PIXELS).max(1)) {
        let ball = samples.balls[pixel];
        for light in 0..samples.lights {
            let index = pixel * samples.lights + light;
            let predicted = bend(samples.brightness(index, light, &materials[ball]));
            let shift = f64::from(corrections[ball].at(super::disc::to_disc(&samples.normals[pixel]), light).0);
            let loss = |predicted: f64| {
                ((samples.values[index] - predicted.min(samples.clip[light])) / super::fit::LOSS_SCALE).powi(2).ln_1p()
            };
            without += loss(predicted);
            with += loss(predicted + shift);
        }
    }
    if std::env::var_os("BGARS_DEBUG").is_some() {
        eprintln!("residuals {without} -> {with}");
    }
    if with > (1.0 - EVIDENCE) * without {
        return false;
    }
    for (ball, correction) in known.iter_mut().zip(corrections) {
        ball.correction = Some(correction);
    }
    true
}

/// What all balls share while they are estimated.
struct Job<'a, 'b, 'c, P> {
    reader: &'a Reader<'b, 'c, P>,
    lights: &'a Lights,
    clip: &'a [f32],
    inside: &'a [Vec<usize>],
}

impl<P: Pixel> Job<'_, '_, '_, P> {
    fn learning_pixels(&self, ball: usize) -> impl Iterator<Item = &usize> {
        spaced(&self.inside[ball], (LEARNING_PIXELS / self.inside.len()).max(60))
    }

    fn learn_spread(&self, known: &[Ball], spread: &Spread) -> Spread {
        let pairs: Vec<Vec<(f32, f32)>> = known
            .par_iter()
            .enumerate()
            .map(|(index, ball)| {
                let work = BallWork::new(self.reader, self.lights, ball, spread, self.clip);
                let mut scratch = Scratch::new(self.reader.lights());
                let mut pairs = Vec::new();
                for &pixel in self.learning_pixels(index) {
                    work.residuals(pixel, &mut scratch, &mut pairs);
                }
                pairs
            })
            .collect();
        Spread::from_residuals(&pairs.concat(), MIN_SIGMA)
    }

    /// How far the balls are from their spheres where the data tell, and how much larger than stated the errors are.
    fn learn_deviations(&self, known: &mut [Ball], spread: &Spread) -> Spread {
        for ball in &mut *known {
            ball.prior_rad = f32::INFINITY;
        }
        let found: Vec<Vec<BallPixel>> = known
            .par_iter()
            .enumerate()
            .map(|(index, ball)| {
                let work = BallWork::new(self.reader, self.lights, ball, spread, self.clip);
                let mut scratch = Scratch::new(self.reader.lights());
                let pixels = self.learning_pixels(index).map(|&pixel| work.estimate(pixel, &mut scratch));
                pixels.filter(|p| p.data_error_rad.to_degrees() < TELLING_DEG && p.normal[2] > FIT_MIN_N_Z as f32).collect()
            })
            .collect();
        let factor = calibration(&found);
        let (all, all_error) = deviation(&found.concat(), factor).unwrap_or((FIRST_PRIOR_DEG.to_radians(), 0.0));
        for (ball, found) in known.iter_mut().zip(&found) {
            let (own, error) = deviation(found, factor).unwrap_or((all, all_error));
            let (least, most) = PRIOR_LIMITS_DEG;
            ball.deviation_rad = own;
            ball.prior_rad = own.max(error).clamp(least.to_radians(), most.to_radians());
        }
        spread.scaled(factor)
    }

    fn run(&self, known: &[Ball], spread: &Spread, step: usize) -> Vec<Vec<BallPixel>> {
        known
            .par_iter()
            .enumerate()
            .map(|(index, ball)| {
                let work = BallWork::new(self.reader, self.lights, ball, spread, self.clip);
                let pixels: Vec<usize> = self.inside[index].iter().copied().step_by(step).collect();
                pixels
                    .par_iter()
                    .map_init(|| Scratch::new(self.reader.lights()), |scratch, &pixel| work.estimate(pixel, scratch))
                    .collect()
            })
            .collect()
    }
}

/// By how much errors are larger than stated: the share of a normal distribution's deviations from the circles within one
/// standard error; 1 where too few pixels tell.
fn calibration(found: &[Vec<BallPixel>]) -> f32 {
    let mut ratios: Vec<f32> = found.iter().flatten().map(|p| p.off_circle_rad / p.data_error_rad).collect();
    if ratios.len() < ENOUGH_PIXELS {
        return 1.0;
    }
    let rank = (ONE_SIGMA * ratios.len() as f32) as usize;
    ratios.select_nth_unstable_by(rank, f32::total_cmp).1.clamp(CALIBRATION_LIMITS.0, CALIBRATION_LIMITS.1)
}

/// Root mean square angle of a ball to its sphere, its error removed, and that error; `None` where too few pixels tell.
fn deviation(found: &[BallPixel], factor: f32) -> Option<(f32, f32)> {
    if found.len() < ENOUGH_PIXELS {
        return None;
    }
    let middle = |value: &dyn Fn(&BallPixel) -> f32| {
        let mut values: Vec<f32> = found.iter().map(value).collect();
        *values.select_nth_unstable_by(found.len() / 2, f32::total_cmp).1
    };
    let off2 = middle(&|p| p.off_circle_rad.powi(2));
    let error2 = middle(&|p| p.data_error_rad.powi(2)) * factor * factor;
    // The median of the squared length of a normal vector with two components is ln 2 of its mean.
    Some(((off2 / std::f32::consts::LN_2 - error2).max(0.0).sqrt(), error2.sqrt()))
}
