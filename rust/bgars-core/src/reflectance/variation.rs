//! Balls of different material: each its own strengths, roughness and ambient light, within what the population allows.

use rayon::prelude::*;

use super::fit::{Free, fit_from};
use super::material::Material;
use super::samples::Samples;

/// Own materials must lower the mean cost by this share.
const EVIDENCE: f64 = 0.15;

/// Pixels of a ball that its material is fitted on.
const BALL_PIXELS: usize = 250;

/// Steps of its fit.
const STEPS: usize = 12;

/// A parameter farther than so many median absolute deviations from the median is not believed.
const GUARD: f64 = 4.0;

/// Deviations smaller than this are believed in any case (natural logarithm; ambient light in units of diffuse light).
const MIN_DEVIATION: f64 = 0.02;

/// One material a ball: its own where the balls differ and its fit is believable, else that of all.
#[must_use]
pub fn ball_materials(samples: &Samples, common: &Material, balls: usize) -> Vec<Material> {
    let alike = || vec![common.clone(); balls];
    if balls < 3 {
        return alike();
    }
    let free = Free::NOTHING;
    let mut counts = vec![0usize; balls];
    for &ball in &samples.balls {
        counts[ball] += 1;
    }
    let fits: Vec<(Material, f64, f64)> = (0..balls)
        .into_par_iter()
        .map(|ball| {
            let own = samples.of_ball(ball, counts[ball].div_ceil(BALL_PIXELS).max(1));
            let before = fit_from(&own, common, free, 0).cost;
            let fit = fit_from(&own, common, free, STEPS);
            (fit.material, before, fit.cost)
        })
        .collect();
    let median_of = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let mut before: Vec<f64> = fits.iter().map(|fit| fit.1).collect();
    let mut after: Vec<f64> = fits.iter().map(|fit| fit.2).collect();
    if median_of(&mut after) > (1.0 - EVIDENCE) * median_of(&mut before) {
        return alike();
    }
    let parameters: Vec<Vec<f64>> = fits.iter().map(|fit| logarithms(&fit.0, common)).collect();
    let believed: Vec<bool> = (0..balls)
        .map(|ball| {
            (0..parameters[ball].len()).all(|parameter| {
                let mut values: Vec<f64> = parameters.iter().map(|ball| ball[parameter]).collect();
                let middle = median_of(&mut values);
                let mut deviations: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
                let limit = GUARD * median_of(&mut deviations).max(MIN_DEVIATION);
                (parameters[ball][parameter] - middle).abs() <= limit
            })
        })
        .collect();
    fits.into_iter().zip(believed).map(|((own, _, _), believed)| if believed { own } else { common.clone() }).collect()
}

/// What is free of a ball's material, as it is compared between balls.
fn logarithms(own: &Material, common: &Material) -> Vec<f64> {
    let mut values = vec![(own.diffuse / common.diffuse).ln(), (own.ambient - common.ambient) / common.diffuse];
    for (own, common) in own.lobes.iter().zip(&common.lobes) {
        values.extend([(own.strength / common.strength).ln(), (own.roughness / common.roughness).ln()]);
    }
    values
}
