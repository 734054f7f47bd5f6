//! From circles and images to the normals of the balls.

use rayon::prelude::*;

use super::anchor::{Circle, pixel_centre};
use super::ball::{Ball, BallPixel, BallWork, Scratch};
use super::choose::best_material;
use super::fit::MaterialFit;
use super::flat_top::flat_top;
use super::material::Material;
use super::observe::Reader;
use super::odd::odd_places;
use super::residuals::learnt_corrections;
use super::samples::Samples;
use super::scale::bend;
use super::spread::{Residual, Spread};
use super::variation::ball_materials;
use crate::{ImageStack, Lights, Pixel, Radiometry, Result};

/// Pixels that a material is fitted on, in all and at least of each ball.
const FIT_PIXELS: usize = 3000;

/// Pixels of a ball that the residuals are learnt on, at most.
const RESIDUAL_PIXELS: usize = 1200;

/// Pixels of a ball that tell where it is no sphere.
const ODD_PIXELS: usize = 600;

/// Pixels that spread and expectation are learnt on, in all.
const LEARNING_PIXELS: usize = 4000;

/// Smallest n_z of pixels that a material is fitted on.
const FIT_MIN_N_Z: f64 = 0.2;
fn fmn() -> f64 { std::env::var("FMN").map_or(FIT_MIN_N_Z, |v| v.parse().unwrap()) }

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
    let materials = if std::env::var_os("SAME").is_some() { vec![fit.material.clone(); balls] } else { ball_materials(&many, &fit.material, balls) };
    let varied = materials.iter().any(|material| *material != fit.material);
    let mut known: Vec<Ball> = circles
        .iter()
        .zip(&materials)
        .map(|(&circle, material)| Ball {
            circle,
            material: material.clone(),
            correction: None,
            odd: None,
            flat: None,
            prior_rad: FIRST_PRIOR_DEG.to_radians(),
            deviation_rad: FIRST_PRIOR_DEG.to_radians(),
        })
        .collect();
    let corrections = learnt_corrections(&many, &materials);
    let corrected = corrections.is_some();
    for (ball, correction) in known.iter_mut().zip(corrections.into_iter().flatten()) {
        ball.correction = Some(correction);
    }
    let bent_clip: Vec<f32> = clip.iter().map(|&level| bend(level) as f32).collect();
    let job = Job { reader: &reader, lights, clip: &bent_clip, inside: &inside };
    let mut spread = Spread::constant(FIRST_SIGMA);
    for _ in 0..2 {
        spread = job.learn_spread(&known, &spread);
    }
    spread = job.learn_deviations(&mut known, &spread);
    if std::env::var_os("BGARS_DEBUG").is_some() {
        for (i, b) in known.iter().enumerate() { if b.flat.is_some() { eprintln!("flat {i} {:?}", b.flat); } if let Some(o) = &b.odd { eprintln!("odd {i} {} {:?}", o.middle.iter().filter(|v| **v != 0.0).count()/2, o.middle.iter().copied().fold(0.0, f32::max)); } }
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
            if let Some(normal) = circle.normal(x, y).filter(|normal| normal.z > if of_each < RESIDUAL_PIXELS { fmn() } else { 0.1 }) {
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
        let residuals: Vec<Vec<Residual>> = known
            .par_iter()
            .enumerate()
            .map(|(index, ball)| {
                let work = BallWork::new(self.reader, self.lights, ball, spread, self.clip);
                let mut scratch = Scratch::new(self.reader.lights());
                let mut residuals = Vec::new();
                for &pixel in self.learning_pixels(index) {
                    work.residuals(pixel, &mut scratch, &mut residuals);
                }
                residuals
            })
            .collect();
        Spread::from_residuals(&residuals.concat(), MIN_SIGMA)
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
                spaced(&self.inside[index], ODD_PIXELS).map(|&pixel| work.estimate(pixel, &mut scratch)).collect()
            })
            .collect();
        for ((ball, found), odd) in known.iter_mut().zip(&found).zip(odd_places(&found)) {
            ball.flat = flat_top(found);
            ball.odd = odd.filter(|_| ball.flat.is_none());
        }
        let tells =
            |p: &&BallPixel| p.data_error_rad.to_degrees() < TELLING_DEG && p.normal[2] > FIT_MIN_N_Z as f32;
        let found: Vec<Vec<BallPixel>> =
            found.iter().map(|pixels| pixels.iter().filter(tells).copied().collect()).collect();
        let factor = calibration(&found);
        let (all, all_error) = deviation(&found.concat(), factor).unwrap_or((FIRST_PRIOR_DEG.to_radians(), 0.0));
        for (ball, found) in known.iter_mut().zip(&found) {
            let (own, error) = deviation(found, factor).unwrap_or((all, all_error));
            let (least, most) = PRIOR_LIMITS_DEG;
            ball.deviation_rad = own;
            ball.prior_rad = if std::env::var_os("DATAONLY").is_some() { 100.0 } else { own.max(error).clamp(least.to_radians(), most.to_radians()) };
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
