//! Which method a capture is given to: the one that predicts light it has not seen.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::facet;
use super::lobe::Material;
use super::material::Specimen;
use super::observation::{Kind, Observation, SCALE};
use crate::normals::robust_filter;

/// Most lights that are left out in turn at a pixel.
const MAX_LEFT_OUT: usize = 8;

/// Fewest lights for a prediction: four remain.
pub const MIN_LIGHTS: usize = 5;

/// Mean cost of a left-out light under each method; lower is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Predictions {
    /// Least squares on all remaining lights.
    pub lambertian: f64,
    /// Least squares on the lights that the robust filter keeps.
    pub robust_filter: f64,
    /// The fitted material.
    pub reflectance: f64,
}

/// Leaves out one light after the other on every pixel of the sample and predicts it from the rest.
pub(super) fn predictions(sample: &[Specimen], material: &Material) -> Predictions {
    let sums: Vec<([f64; 3], f64)> =
        sample.par_iter().with_min_len(16).map(|specimen| of_pixel(specimen, material)).collect();
    let (mut totals, mut count) = ([0.0; 3], 0.0);
    for (costs, lights) in sums {
        for (total, cost) in totals.iter_mut().zip(costs) {
            *total += cost;
        }
        count += lights;
    }
    let [lambertian, robust_filter, reflectance] = totals.map(|total| total / f64::max(count, 1.0));
    Predictions { lambertian, robust_filter, reflectance }
}

fn of_pixel(specimen: &Specimen, material: &Material) -> ([f64; 3], f64) {
    let observation = &specimen.observation;
    let lights = observation.values.len();
    let step = lights.div_ceil(MAX_LEFT_OUT);
    let mut costs = [0.0; 3];
    let mut count = 0.0;
    for left_out in (0..lights).step_by(step) {
        let rest = observation.without(left_out);
        let light = &observation.lights[left_out];
        let values: Vec<f32> = rest.values.iter().map(|&value| value as f32).collect();
        let clipped: Vec<bool> = rest.kinds.iter().map(|&kind| kind == Kind::Clipped).collect();
        let directions: Vec<[f64; 3]> = rest.lights.iter().map(|light| light.direction.into()).collect();
        let kept = robust_filter(&values, &clipped, &directions, 1.0);
        let all = least_squares(&rest, &vec![true; values.len()]);
        let robust = least_squares(&rest, &kept);
        let lambertian = |scaled: &Vector3<f64>| scaled.dot(&light.direction).max(0.0);
        let start = |scaled: &Vector3<f64>| {
            let mut normal = *scaled;
            normal.z = normal.z.max(0.01 * normal.norm()).max(1e-9);
            normal.normalize()
        };
        let mut best: Option<(f64, f64)> = None;
        for normal in [start(&all), start(&robust)] {
            for candidate in [material, &Material::MATTE] {
                let fitted = facet::fit(&rest, candidate, &normal, None, None, 12);
                if best.is_none_or(|(least, _)| fitted.cost < least) {
                    best = Some((fitted.cost, fitted.log_albedo.exp() * candidate.shade(&fitted.normal, light)));
                }
            }
        }
        let reflectance = best.map_or(0.0, |(_, predicted)| predicted);
        for (cost, predicted) in costs.iter_mut().zip([lambertian(&all), lambertian(&robust), reflectance]) {
            *cost += cost_of(observation, left_out, predicted);
        }
        count += 1.0;
    }
    (costs, count)
}

fn cost_of(observation: &Observation, light: usize, predicted: f64) -> f64 {
    let ratio = observation.residual(light, predicted) / SCALE;
    observation.share(light) * (ratio * ratio).ln_1p()
}

/// `rho n` of the kept lights; zero where they do not fix it.
fn least_squares(observation: &Observation, kept: &[bool]) -> Vector3<f64> {
    let (mut gram, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for ((light, &value), _) in observation.lights.iter().zip(&observation.values).zip(kept).filter(|(_, kept)| **kept)
    {
        gram += light.direction * light.direction.transpose();
        right += light.direction * value;
    }
    gram.try_inverse().map_or_else(Vector3::zeros, |inverse| inverse * right)
}
