//! Which method a capture is given to: the one that predicts light it has not seen.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::lobe::Material;
use super::material::Specimen;
use super::observation::{Kind, Observation, SCALE};
use super::pixel::best_facet;
use crate::normals::{robust_filter, solve};

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
        let directions: Vec<Vector3<f64>> = rest.lights.iter().map(|light| light.direction).collect();
        let components: Vec<[f64; 3]> = directions.iter().map(|&direction| direction.into()).collect();
        let kept = robust_filter(&values, &clipped, &components, 1.0);
        let [all, robust] = [&vec![true; values.len()], &kept]
            .map(|kept| solve(&values, &directions, kept).map_or_else(Vector3::zeros, |found| found.scaled_normal));
        let lambertian = |scaled: &Vector3<f64>| scaled.dot(&light.direction).max(0.0);
        let start = |scaled: &Vector3<f64>| {
            let mut normal = *scaled;
            normal.z = normal.z.max(0.01 * normal.norm()).max(1e-9);
            normal.normalize()
        };
        let starts = [(start(&all), None), (start(&robust), None)];
        let (fitted, source) = best_facet(&rest, material, &starts, None, 12);
        let reflectance = fitted.log_albedo.exp() * source.material(material).shade(&fitted.normal, light);
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
