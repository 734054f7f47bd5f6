//! The material of a capture, fitted together with the unknown normals and albedos of a sample of its pixels.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::facet::{self, Equations, Facet, equations, linearised, robust_weight, tangents};
use super::lobe::Material;
use super::observation::Observation;

/// Most steps of the joint fit.
const MAX_STEPS: usize = 30;

/// Tries of a step with growing damping.
const MAX_TRIES: usize = 6;

/// About so many pixels of the sample tell which start is best.
const SCREENED_PIXELS: usize = 600;

/// Steps between two looks whether a pixel's first start has become the better one.
const RESTART_EVERY: usize = 5;

/// Pixels of one task; fixed, so that sums are the same for any number of threads.
const TASK_PIXELS: usize = 64;

/// Largest change of a parameter (logarithms of strength and roughness; tail) in a step.
const MAX_CHANGE: f64 = 0.4;

/// Step of the derivatives over the parameters.
const DIFFERENCE: f64 = 1e-3;

/// Lower bound of the roughness: a narrower lobe is seen by too few pixels to be told from noise on free normals.
const LEAST_ROUGHNESS: f64 = 0.1;

/// Bounds of strength, roughness and tail. A lobe of more than ten times the diffuse part is not told from a missing
/// diffuse part on free normals: the fit would fall into that hole (a metal explains everything by mirrors).
const BOUNDS: [(f64, f64); 3] = [(0.007, 10.0), (LEAST_ROUGHNESS, 1.0), (0.0, 1.0)];

/// Starts: strength and roughness.
const STARTS: [(f64, f64); 4] = [(0.3, 0.3), (2.0, 0.25), (0.3, 0.12), (8.0, 0.3)];

/// One pixel of the sample, with the normals that its fit starts from.
#[derive(Clone, Debug)]
pub(super) struct Specimen {
    pub observation: Observation,
    pub starts: [Vector3<f64>; 2],
}

/// The better of the fits from both starts.
fn fit_from_starts(specimen: &Specimen, material: &Material, max_iters: usize) -> Facet {
    let [first, second] =
        specimen.starts.map(|start| facet::fit(&specimen.observation, material, &start, None, None, max_iters));
    if second.cost < first.cost { second } else { first }
}

/// Mean cost of the fitted sample under a material.
#[derive(Clone, Copy, Debug)]
struct Fitted {
    material: Material,
    mean_cost: f64,
}

/// Fits the material to a sample: to a part of it from several starts, to all of it from the one of least cost.
///
/// Gauss-Newton over (ln strength, ln roughness, tail) with the three unknowns of each pixel eliminated (Schur complement,
/// as in bundle adjustment: Triggs et al. 2000, section 6.1), robustly weighted; after each step the pixels are fitted anew.
pub(super) fn fit(sample: &[Specimen]) -> Material {
    let step = sample.len().div_ceil(SCREENED_PIXELS).max(1);
    let screened: Vec<Specimen> = sample.iter().step_by(step).cloned().collect();
    let mut best: Option<Fitted> = None;
    for (strength, roughness) in STARTS {
        let fitted = fit_from(&screened, Material { strength, roughness, tail: 0.5 });
        if best.is_none_or(|best| fitted.mean_cost < best.mean_cost) {
            best = Some(fitted);
        }
    }
    best.map_or(Material::MATTE, |best| fit_from(sample, best.material).material)
}

fn fit_from(sample: &[Specimen], start: Material) -> Fitted {
    let mut parameters = bounded(to_parameters(start));
    let start = to_material(&parameters);
    let mut facets = restarted(sample, &start);
    let mut total = sum_of_costs(&facets);
    let mut damping = 1e-3;
    for step in 0..MAX_STEPS {
        let system = reduced_system(sample, &facets, &parameters);
        let mut accepted = None;
        for _ in 0..MAX_TRIES {
            let Some(inverse) = system.damped_inverse(damping) else { break };
            let change = (inverse * system.right).map(|change| change.clamp(-MAX_CHANGE, MAX_CHANGE));
            let next = bounded(parameters + change);
            let material = to_material(&next);
            let refitted: Vec<Facet> = sample
                .par_iter()
                .zip(&facets)
                .with_min_len(TASK_PIXELS)
                .map(|(specimen, at)| {
                    facet::fit(&specimen.observation, &material, &at.normal, Some(at.log_albedo), None, 6)
                })
                .collect();
            let next_total = sum_of_costs(&refitted);
            if next_total < total {
                accepted = Some((next, refitted, next_total));
                break;
            }
            damping = f64::max(damping, 1e-4) * 8.0;
        }
        let Some((next, refitted, next_total)) = accepted else { break };
        let gain = total - next_total;
        let moved = (next - parameters).amax();
        let converging = gain < 1e-4 * total;
        (parameters, facets, total) = (next, refitted, next_total);
        damping *= 0.3;
        if step % RESTART_EVERY == RESTART_EVERY - 1 || converging {
            let fresh = restarted(sample, &to_material(&parameters));
            for (facet, fresh) in facets.iter_mut().zip(fresh) {
                if fresh.cost < facet.cost {
                    *facet = fresh;
                }
            }
            total = sum_of_costs(&facets);
        }
        if converging && moved < 3e-3 {
            break;
        }
    }
    Fitted { material: to_material(&parameters), mean_cost: total / sample.len() as f64 }
}

fn restarted(sample: &[Specimen], material: &Material) -> Vec<Facet> {
    sample.par_iter().with_min_len(TASK_PIXELS).map(|specimen| fit_from_starts(specimen, material, 8)).collect()
}

fn sum_of_costs(facets: &[Facet]) -> f64 {
    facets.iter().map(|facet| facet.cost).sum()
}

fn to_parameters(material: Material) -> Vector3<f64> {
    Vector3::new(material.strength.ln(), material.roughness.ln(), material.tail)
}

fn to_material(parameters: &Vector3<f64>) -> Material {
    Material { strength: parameters.x.exp(), roughness: parameters.y.exp(), tail: parameters.z }
}

fn bounded(parameters: Vector3<f64>) -> Vector3<f64> {
    let [strength, roughness, tail] = BOUNDS;
    Vector3::new(
        parameters.x.clamp(strength.0.ln(), strength.1.ln()),
        parameters.y.clamp(roughness.0.ln(), roughness.1.ln()),
        parameters.z.clamp(tail.0, tail.1),
    )
}

/// The normal equations of the parameters, those of the pixels eliminated.
fn reduced_system(sample: &[Specimen], facets: &[Facet], parameters: &Vector3<f64>) -> Equations {
    let material = to_material(parameters);
    let changed: [Material; 3] = std::array::from_fn(|axis| {
        let mut parameters = *parameters;
        parameters[axis] += DIFFERENCE;
        to_material(&parameters)
    });
    let parts: Vec<Equations> = sample
        .par_chunks(TASK_PIXELS)
        .zip(facets.par_chunks(TASK_PIXELS))
        .map(|(specimens, facets)| {
            let mut part = Equations::default();
            for (specimen, facet) in specimens.iter().zip(facets) {
                add_pixel(&mut part, &specimen.observation, facet, &material, &changed);
            }
            part
        })
        .collect();
    let add =
        |sum: Equations, part: Equations| Equations { matrix: sum.matrix + part.matrix, right: sum.right + part.right };
    parts.into_iter().fold(Equations::default(), add)
}

fn add_pixel(
    sum: &mut Equations,
    observation: &Observation,
    facet: &Facet,
    material: &Material,
    changed: &[Material; 3],
) {
    let frame = tangents(&facet.normal);
    let own = equations(observation, material, facet, &frame);
    let Some(inverse) = own.damped_inverse(1e-3) else { return };
    let gain = facet.log_albedo.exp() * observation.weight;
    let mut coupling = Matrix3::zeros();
    for light in 0..observation.values.len() {
        let (slope, residual) = linearised(observation, light, material, facet, &frame);
        if slope == Vector3::zeros() {
            continue;
        }
        let here = material.shade(&facet.normal, &observation.lights[light]);
        let over = Vector3::from_fn(|axis, _| {
            (changed[axis].shade(&facet.normal, &observation.lights[light]) - here) * gain / DIFFERENCE
        });
        let weight = robust_weight(observation, light, residual);
        sum.matrix += over * over.transpose() * weight;
        sum.right -= over * (weight * residual);
        coupling += over * slope.transpose() * weight;
    }
    sum.matrix -= coupling * inverse * coupling.transpose();
    sum.right -= coupling * (inverse * own.right);
}
