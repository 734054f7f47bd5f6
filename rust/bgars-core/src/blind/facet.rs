//! One pixel's normal and albedo under a known material, by Levenberg-Marquardt.

use nalgebra::{Matrix3, Vector3};

use super::lobe::Material;
use super::observation::{BLACK_WEIGHT, Kind, Observation, SCALE};

/// Longest turn of the normal in a step, radians.
const MAX_TURN: f64 = 0.3;

/// Turn and change of ln(albedo) below which the fit has converged.
const TOLERANCE: f64 = 1e-3;

/// Tries of a step with growing damping.
const MAX_TRIES: usize = 5;

/// Lowest `n_z` of a fitted normal.
const MIN_N_Z: f64 = 0.01;

/// Smallest albedo, of full scale.
const MIN_ALBEDO: f64 = 1e-6;

/// A product is taken to its logarithm before it overflows.
const HUGE: f64 = 1e200;

/// A facet with its cost.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facet {
    pub normal: Vector3<f64>,
    pub log_albedo: f64,
    /// Sum over lights of `ln(1 + (r / scale)^2)`, and the pull.
    pub cost: f64,
}

/// A normal that the fit is drawn to: adds `strength ln(1 + |n - toward|^2 / width^2)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    pub toward: Vector3<f64>,
    pub strength: f64,
    pub width: f64,
}

/// Normal equations of three unknowns; of a pixel: two turns of the normal and ln albedo, robustly weighted.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Equations {
    pub matrix: Matrix3<f64>,
    pub right: Vector3<f64>,
}

impl Equations {
    /// The inverse of the matrix with its diagonal raised by a share of itself (Marquardt 1963).
    pub fn damped_inverse(&self, damping: f64) -> Option<Matrix3<f64>> {
        let raise = |value: f64| value * damping + 1e-6;
        (self.matrix + Matrix3::from_diagonal(&self.matrix.diagonal().map(raise))).try_inverse()
    }
}

/// Two unit vectors across a normal.
#[inline]
pub(super) fn tangents(normal: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let across = if normal.z.abs() > 0.5 {
        Vector3::new(normal.z, 0.0, -normal.x)
    } else {
        Vector3::new(-normal.y, normal.x, 0.0)
    };
    let first = across.normalize();
    (first, normal.cross(&first))
}

fn turned(normal: &Vector3<f64>, (first, second): &(Vector3<f64>, Vector3<f64>), step: &Vector3<f64>) -> Vector3<f64> {
    let mut sum = normal + first * step.x + second * step.y;
    sum.z = sum.z.max(MIN_N_Z);
    sum.normalize()
}

/// The derivative of one light's residual over (two turns of the normal, ln albedo), and the residual.
#[inline]
pub(super) fn linearised(
    observation: &Observation,
    light: usize,
    material: &Material,
    facet: &Facet,
    (first, second): &(Vector3<f64>, Vector3<f64>),
) -> (Vector3<f64>, f64) {
    let albedo = facet.log_albedo.exp();
    let (value, slope) = material.shade_and_slope(&facet.normal, &observation.lights[light]);
    let residual = observation.residual(light, albedo * value);
    if observation.kinds[light] == Kind::Clipped && residual >= 0.0 {
        return (Vector3::zeros(), 0.0);
    }
    let gain = albedo * observation.weight;
    (Vector3::new(slope.dot(first), slope.dot(second), value) * gain, residual)
}

/// Robust weight of a residual: the derivative of its cost over half its square.
#[inline]
pub(super) fn robust_weight(observation: &Observation, light: usize, residual: f64) -> f64 {
    observation.share(light) / (SCALE * SCALE + residual * residual)
}

/// Cost of a facet: `sum share ln(1 + (r / scale)^2)`, the Cauchy loss, and the pull.
pub(super) fn cost(
    observation: &Observation,
    material: &Material,
    normal: &Vector3<f64>,
    log_albedo: f64,
    pull: Option<&Pull>,
) -> f64 {
    let albedo = log_albedo.exp();
    // The logarithm of a product instead of a sum of logarithms.
    let (mut sum, mut lit, mut black) = (0.0, 1.0, 1.0);
    for light in 0..observation.values.len() {
        let ratio = observation.residual(light, albedo * material.shade(normal, &observation.lights[light])) / SCALE;
        let factor = 1.0 + ratio * ratio;
        if observation.kinds[light] == Kind::Black {
            black *= factor;
        } else {
            lit *= factor;
        }
        if lit > HUGE || black > HUGE {
            sum += lit.ln() + BLACK_WEIGHT * black.ln();
            (lit, black) = (1.0, 1.0);
        }
    }
    sum += lit.ln() + BLACK_WEIGHT * black.ln();
    if let Some(pull) = pull {
        let ratio = (normal - pull.toward).norm_squared() / (pull.width * pull.width);
        sum += pull.strength * ratio.ln_1p();
    }
    sum
}

/// The weighted normal equations of a facet.
pub(super) fn equations(
    observation: &Observation,
    material: &Material,
    facet: &Facet,
    frame: &(Vector3<f64>, Vector3<f64>),
) -> Equations {
    let Equations { mut matrix, mut right } = Equations::default();
    for light in 0..observation.values.len() {
        let (slope, residual) = linearised(observation, light, material, facet, frame);
        let weight = robust_weight(observation, light, residual);
        matrix += slope * slope.transpose() * weight;
        right -= slope * (weight * residual);
    }
    Equations { matrix, right }
}

/// ln(albedo) of a given normal: the median ratio of value and model, then six steps of re-weighted least squares.
pub(super) fn log_albedo(observation: &Observation, material: &Material, normal: &Vector3<f64>) -> f64 {
    let models: Vec<f64> = observation.lights.iter().map(|light| material.shade(normal, light)).collect();
    let mut ratios: Vec<f64> = (0..models.len())
        .filter(|&light| models[light] > 0.02 && observation.kinds[light] != Kind::Black)
        .map(|light| observation.values[light] / models[light])
        .collect();
    if ratios.is_empty() {
        return MIN_ALBEDO.ln();
    }
    ratios.sort_unstable_by(f64::total_cmp);
    let mut albedo = f64::midpoint(ratios[(ratios.len() - 1) / 2], ratios[ratios.len() / 2]).max(MIN_ALBEDO);
    for _ in 0..6 {
        let (mut above, mut below) = (0.0, 1e-12);
        for (light, model) in models.iter().enumerate() {
            let residual = observation.residual(light, albedo * model);
            if observation.kinds[light] == Kind::Clipped && residual >= 0.0 {
                continue;
            }
            let weight = robust_weight(observation, light, residual);
            above += weight * model * observation.values[light];
            below += weight * model * model;
        }
        albedo = (above / below).max(MIN_ALBEDO);
    }
    albedo.ln()
}

/// Fits a pixel from a start, at most `max_iters` steps.
pub(super) fn fit(
    observation: &Observation,
    material: &Material,
    start: &Vector3<f64>,
    start_log_albedo: Option<f64>,
    pull: Option<&Pull>,
    max_iters: usize,
) -> Facet {
    let log_albedo = start_log_albedo.unwrap_or_else(|| log_albedo(observation, material, start));
    let mut facet = Facet { normal: *start, log_albedo, cost: 0.0 };
    facet.cost = cost(observation, material, &facet.normal, log_albedo, pull);
    let mut damping = 1e-2;
    for _ in 0..max_iters {
        let frame = tangents(&facet.normal);
        let mut system = equations(observation, material, &facet, &frame);
        if let Some(pull) = pull {
            add_pull(&mut system, pull, &facet.normal, &frame);
        }
        let mut moved = f64::INFINITY;
        let mut better = false;
        for _ in 0..MAX_TRIES {
            let Some(inverse) = system.damped_inverse(damping) else { break };
            let mut step = inverse * system.right;
            let turn = step.x.hypot(step.y);
            if turn > MAX_TURN {
                step.x *= MAX_TURN / turn;
                step.y *= MAX_TURN / turn;
            }
            step.z = step.z.clamp(-1.0, 1.0);
            let normal = turned(&facet.normal, &frame, &step);
            let log_albedo = facet.log_albedo + step.z;
            let next = cost(observation, material, &normal, log_albedo, pull);
            if next < facet.cost {
                facet = Facet { normal, log_albedo, cost: next };
                damping = (damping * 0.2).max(1e-6);
                moved = turn.max(step.z.abs());
                better = true;
                break;
            }
            damping *= 8.0;
        }
        if !better || moved < TOLERANCE {
            break;
        }
    }
    facet
}

fn add_pull(system: &mut Equations, pull: &Pull, normal: &Vector3<f64>, frame: &(Vector3<f64>, Vector3<f64>)) {
    let off = normal - pull.toward;
    let weight = pull.strength / (pull.width * pull.width + off.norm_squared());
    for (axis, tangent) in [frame.0, frame.1].iter().enumerate() {
        system.matrix[(axis, axis)] += weight;
        system.right[axis] -= weight * tangent.dot(&off);
    }
}
