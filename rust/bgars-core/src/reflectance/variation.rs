//! Balls of different material: each its own strengths, roughness and ambient light, within what the population allows.

use rayon::prelude::*;

use super::fit::{Free, fit_from};
use super::material::Material;
use super::samples::Samples;
use crate::median::median;

/// Own materials must lower the mean cost by this share.
const EVIDENCE: f64 = 0.15;

/// Balls that tell whether the others need to be looked at, about.
const PILOTS: usize = 12;

/// Pixels of a ball that its material is fitted on.
const BALL_PIXELS: usize = 250;

/// Steps of its fit.
const STEPS: usize = 12;

/// A parameter farther than so many median absolute deviations from the median is not believed.
const GUARD: f64 = 4.0;

/// Deviations smaller than this are believed in any case (natural logarithm; ambient light in units of diffuse light).
const MIN_DEVIATION: f64 = 0.02;

/// A ball's own material, and the cost with that of all and with its own.
struct Fitted {
    material: Material,
    before: f64,
    after: f64,
}

fn median_of(values: impl Iterator<Item = f64>) -> f64 {
    median(&mut values.collect::<Vec<f64>>(), f64::total_cmp)
}

/// One material a ball: its own where the balls differ and its fit is believable, else that of all.
pub fn ball_materials(samples: &Samples, common: &Material, balls: usize) -> Vec<Material> {
    let alike = || vec![common.clone(); balls];
    if balls < 3 {
        return alike();
    }
    let mut counts = vec![0usize; balls];
    for &ball in &samples.balls {
        counts[ball] += 1;
    }
    let fitted = |ball: usize| {
        let own = samples.of_ball(ball, counts[ball].div_ceil(BALL_PIXELS).max(1));
        let before = fit_from(&own, common, Free::NOTHING, 0).cost;
        let fit = fit_from(&own, common, Free::NOTHING, STEPS);
        Fitted { material: fit.material, before, after: fit.cost }
    };
    let pilots: Vec<usize> = (0..balls).step_by(balls.div_ceil(PILOTS)).collect();
    let pilots: Vec<Fitted> = pilots.into_par_iter().map(fitted).collect();
    if median_of(pilots.iter().map(|fit| fit.after)) > (1.0 - EVIDENCE) * median_of(pilots.iter().map(|fit| fit.before))
    {
        return alike();
    }
    let fits: Vec<Fitted> = (0..balls).into_par_iter().map(fitted).collect();
    let parameters: Vec<Vec<f64>> = fits.iter().map(|fit| logarithms(&fit.material, common)).collect();
    let believed: Vec<bool> = (0..balls)
        .map(|ball| {
            (0..parameters[ball].len()).all(|parameter| {
                let values = || parameters.iter().map(|ball| ball[parameter]);
                let middle = median_of(values());
                let limit = GUARD * median_of(values().map(|value| (value - middle).abs())).max(MIN_DEVIATION);
                (parameters[ball][parameter] - middle).abs() <= limit
            })
        })
        .collect();
    fits.into_iter().zip(believed).map(|(own, believed)| if believed { own.material } else { common.clone() }).collect()
}

/// What is free of a ball's material, as it is compared between balls.
fn logarithms(own: &Material, common: &Material) -> Vec<f64> {
    let mut values = vec![(own.diffuse / common.diffuse).ln(), (own.ambient - common.ambient) / common.diffuse];
    for (own, common) in own.lobes.iter().zip(&common.lobes) {
        values.extend([(own.strength / common.strength).ln(), (own.roughness / common.roughness).ln()]);
    }
    values
}
