//! The material of balls of known shape, by robust least squares.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::material::{Lobe, Material};
use super::samples::Samples;
use super::scale::bend_slope;

/// Scale of the Cauchy loss in bent grey levels.
pub const LOSS_SCALE: f64 = 3.0;

/// Pixels of one parallel task: sums are made in this order whatever the number of threads.
const CHUNK: usize = 128;

/// A step that lowers the cost by less than this share is the last.
const TOLERANCE: f64 = 1e-6;

/// Standard deviation of a light's brightness against the rig's.
const GAIN_SPREAD: f64 = 0.05;

/// Weight of the priors, in observations.
const PRIOR_WEIGHT: f64 = 1.0;

/// Products of losses' arguments are turned into a logarithm before they overflow.
const LARGE: f64 = 1e200;

/// A fitted material.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Debug)]
pub struct MaterialFit {
    pub material: Material,
    /// Mean loss an observation, `log(1 + (r / 3)^2)` with `r` in bent grey levels.
    pub cost: f64,
    /// Standard errors in the order of [`parameter_names`].
    pub standard_errors: Vec<f64>,
}

/// Which parameters are free, beside diffuse light, ambient level, strengths and roughness.
#[derive(Clone, Copy, Debug)]
pub struct Free {
    pub grazing: bool,
    pub tails_and_gains: bool,
}

impl Free {
    /// Only what is always free.
    pub const NOTHING: Self = Self { grazing: false, tails_and_gains: false };
}

/// Names of the parameters of a material with so many lobes, in the order of [`MaterialFit::standard_errors`].
#[must_use]
pub fn parameter_names(lobes: usize, lights: usize) -> Vec<String> {
    let mut names = vec!["diffuse".into(), "grazing".into(), "ambient".into()];
    for lobe in 1..=lobes {
        names.extend([format!("strength_{lobe}"), format!("roughness_{lobe}"), format!("tail_{lobe}")]);
    }
    names.extend((0..lights).map(|light| format!("gain_{light}")));
    names
}

/// Positions of the parameters in the vector that is fitted; strengths, roughness and diffuse light by their logarithms.
const DIFFUSE: usize = 0;
const GRAZING: usize = 1;
const AMBIENT: usize = 2;
const FIRST_LOBE: usize = 3;

/// Parameters of a lobe.
const PER_LOBE: usize = 3;

/// The lower triangle of `J^T W J`, `J^T W r` and the loss.
struct Normal {
    matrix: DMatrix<f64>,
    vector: DVector<f64>,
    loss: f64,
}

/// What observations add up to, light by light: each light has its own gain, and no part in those of the others.
struct Sums {
    /// Of each light the weighted products of a row with itself; see [`Sums::row`].
    products: Vec<Vec<f64>>,
    /// Derivatives by what all lights have in common, by the light's gain, and the residual.
    row: Vec<f64>,
    loss: f64,
    /// Product of the `1 + (r / 3)^2` that are not in `loss` yet: one logarithm for many.
    factor: f64,
}

impl Sums {
    fn new(common: usize, lights: usize) -> Self {
        let width = common + 2;
        Self { products: vec![vec![0.0; width * width]; lights], row: vec![0.0; width], loss: 0.0, factor: 1.0 }
    }

    fn close(&mut self) {
        self.loss += self.factor.ln();
        self.factor = 1.0;
    }

    /// Adds the row, so weighted, to the products of a light.
    fn add_row(&mut self, light: usize, weight: f64) {
        let width = self.row.len();
        for (products, &left) in self.products[light].chunks_exact_mut(width).zip(&self.row) {
            let left = left * weight;
            for (product, &right) in products.iter_mut().zip(&self.row) {
                *product += left * right;
            }
        }
    }

    fn add(&mut self, other: &Self) {
        for (sum, more) in self.products.iter_mut().flatten().zip(other.products.iter().flatten()) {
            *sum += more;
        }
        self.loss += other.loss;
    }

    fn normal(&self) -> Normal {
        let width = self.row.len();
        let common = width - 2;
        let size = common + self.products.len();
        let mut normal = Normal { matrix: DMatrix::zeros(size, size), vector: DVector::zeros(size), loss: self.loss };
        for (light, products) in self.products.iter().enumerate() {
            let place = |index: usize| if index < common { index } else { common + light };
            for i in 0..=common {
                for j in 0..=i {
                    normal.matrix[(place(i), place(j))] += products[i * width + j];
                }
                normal.vector[place(i)] += products[i * width + width - 1];
            }
        }
        normal
    }
}

/// Fits a material from a start.
///
/// # Method
/// Levenberg-Marquardt on `sum log(1 + (r / 3)^2)`, `r` the difference of observed and predicted level, both bent by
/// `asinh(0.03 I) / 0.03` and both clipped, weights renewed at every step.
pub fn fit_from(samples: &Samples, start: &Material, free: Free, max_steps: usize) -> MaterialFit {
    let mut material = start.clone();
    let mut normal = normal_equations(samples, &material);
    let mut damping = 1e-3;
    for _ in 0..max_steps {
        let Some(step) = damped_step(&normal, &material, free, damping) else { break };
        let candidate = moved(&material, &step);
        let next = normal_equations(samples, &candidate);
        let (before, after) = (total(&normal, &material), total(&next, &candidate));
        if after < before {
            material = candidate;
            normal = next;
            damping = (damping * 0.3).max(1e-9);
            if before - after < TOLERANCE * before {
                break;
            }
        } else {
            damping *= 8.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    let observations = (samples.values.len() as f64).max(1.0);
    MaterialFit {
        cost: normal.loss / observations,
        standard_errors: standard_errors(&normal, &material, free, observations),
        material,
    }
}

fn total(normal: &Normal, material: &Material) -> f64 {
    normal.loss + PRIOR_WEIGHT * material.gains.iter().map(|gain| ((gain - 1.0) / GAIN_SPREAD).powi(2)).sum::<f64>()
}

fn normal_equations(samples: &Samples, material: &Material) -> Normal {
    let zeros = || Sums::new(FIRST_LOBE + PER_LOBE * material.lobes.len(), samples.lights);
    let chunks: Vec<Sums> = (0..samples.len().div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            let mut sums = zeros();
            for pixel in chunk * CHUNK..((chunk + 1) * CHUNK).min(samples.len()) {
                for light in 0..samples.lights {
                    add_observation(samples, material, pixel * samples.lights + light, light, &mut sums);
                }
            }
            sums.close();
            sums
        })
        .collect();
    let mut sums = zeros();
    for chunk in &chunks {
        sums.add(chunk);
    }
    sums.normal()
}

fn add_observation(samples: &Samples, material: &Material, index: usize, light: usize, sums: &mut Sums) {
    let facet = &samples.facets[index];
    let scale = material.gains[light] * samples.irradiance[index];
    let lambert = material.diffuse * facet.n_dot_l.max(0.0);
    let grazing = facet.grazing() - 1.0;
    let diffuse = lambert * (1.0 + material.grazing * grazing);
    let common = sums.row.len() - 2;
    sums.row[DIFFUSE] = scale * diffuse;
    sums.row[GRAZING] = scale * lambert * grazing;
    sums.row[AMBIENT] = 1.0;
    let mut sum_of_parts = diffuse;
    for (lobe, row) in material.lobes.iter().zip(sums.row[FIRST_LOBE..common].chunks_exact_mut(PER_LOBE)) {
        // By the logarithm of the strength the derivative is the value.
        let slopes = facet.specular(lobe, material.masking).map(|slope| lobe.strength * slope);
        row.copy_from_slice(&slopes.map(|slope| scale * slope));
        sum_of_parts += slopes[0];
    }
    let level = scale * sum_of_parts + material.ambient;
    let bent = super::scale::bend(level);
    let residual = samples.values[index] - bent.min(samples.clip[light]);
    let ratio = (residual / LOSS_SCALE).powi(2);
    sums.factor *= 1.0 + ratio;
    if sums.factor > LARGE {
        sums.close();
    }
    if bent >= samples.clip[light] {
        return;
    }
    let slope = bend_slope(level);
    sums.row[common] = level - material.ambient;
    for derivative in &mut sums.row[..=common] {
        *derivative *= slope;
    }
    sums.row[common + 1] = residual;
    sums.add_row(light, 1.0 / (LOSS_SCALE * LOSS_SCALE * (1.0 + ratio)));
}

/// True for the parameters that are fitted, in their order.
fn is_free(material: &Material, free: Free, index: usize) -> bool {
    let gains = FIRST_LOBE + PER_LOBE * material.lobes.len();
    match index {
        DIFFUSE | AMBIENT => true,
        GRAZING => free.grazing,
        _ => index < gains && (index - FIRST_LOBE) % PER_LOBE < 2 || free.tails_and_gains,
    }
}

/// The normal equations with the priors and without the fixed parameters.
fn reduced(normal: &Normal, material: &Material, free: Free) -> (Vec<usize>, DMatrix<f64>, DVector<f64>) {
    let gains = FIRST_LOBE + PER_LOBE * material.lobes.len();
    let kept: Vec<usize> = (0..normal.vector.len()).filter(|&index| is_free(material, free, index)).collect();
    let mut matrix = normal.matrix.select_rows(&kept).select_columns(&kept);
    let mut vector = normal.vector.select_rows(&kept);
    for (i, &index) in kept.iter().enumerate().filter(|(_, index)| **index >= gains) {
        let weight = PRIOR_WEIGHT / (GAIN_SPREAD * GAIN_SPREAD);
        // Gains move by their logarithm.
        let gain = material.gains[index - gains];
        matrix[(i, i)] += weight * gain * gain;
        vector[i] += weight * (1.0 - gain) * gain;
    }
    (kept, matrix, vector)
}

fn damped_step(normal: &Normal, material: &Material, free: Free, damping: f64) -> Option<Vec<f64>> {
    let (kept, mut matrix, vector) = reduced(normal, material, free);
    let largest = (0..kept.len()).map(|i| matrix[(i, i)]).fold(0.0, f64::max);
    for i in 0..kept.len() {
        matrix[(i, i)] += damping * matrix[(i, i)] + 1e-12 * largest;
    }
    let solution = matrix.cholesky()?.solve(&vector);
    let mut step = vec![0.0; normal.vector.len()];
    for (&index, &value) in kept.iter().zip(solution.iter()) {
        step[index] = value;
    }
    step.iter().all(|value| value.is_finite()).then_some(step)
}

/// A material moved by a step, within what is possible.
fn moved(material: &Material, step: &[f64]) -> Material {
    let by = |value: f64, step: f64| value * step.clamp(-1.0, 1.0).exp();
    let lobes: Vec<Lobe> = material
        .lobes
        .iter()
        .zip(step[FIRST_LOBE..].chunks_exact(PER_LOBE))
        .map(|(lobe, step)| Lobe {
            strength: by(lobe.strength, step[0]).clamp(1e-3, 1e6),
            roughness: by(lobe.roughness, step[1]).clamp(0.02, 1.0),
            tail: (lobe.tail + step[2].clamp(-0.3, 0.3)).clamp(0.0, 1.0),
        })
        .collect();
    let gains = FIRST_LOBE + PER_LOBE * lobes.len();
    Material {
        diffuse: by(material.diffuse, step[DIFFUSE]).clamp(1e-3, 1e5),
        grazing: (material.grazing + step[GRAZING].clamp(-0.3, 0.3)).clamp(-1.0, 2.0),
        ambient: material.ambient + step[AMBIENT].clamp(-10.0, 10.0),
        lobes,
        masking: material.masking,
        gains: material.gains.iter().zip(&step[gains..]).map(|(&gain, &step)| by(gain, step)).collect(),
    }
}

fn standard_errors(normal: &Normal, material: &Material, free: Free, observations: f64) -> Vec<f64> {
    let (kept, matrix, _) = reduced(normal, material, free);
    let mut errors = vec![0.0; normal.vector.len()];
    // The loss of an observation near zero is r^2 / 9: twice the mean loss estimates the variance of r / 3.
    let variance = (normal.loss / observations).max(1e-12);
    if let Some(covariance) = matrix.cholesky().map(|cholesky| cholesky.inverse()) {
        for (i, &index) in kept.iter().enumerate() {
            errors[index] = (variance * covariance[(i, i)]).max(0.0).sqrt() * parameter_scale(material, index);
        }
    }
    errors
}

/// From the unit in which a parameter is fitted to its own: logarithms become relative.
fn parameter_scale(material: &Material, index: usize) -> f64 {
    let gains = FIRST_LOBE + PER_LOBE * material.lobes.len();
    match index {
        DIFFUSE => material.diffuse,
        GRAZING | AMBIENT => 1.0,
        _ if index >= gains => material.gains[index - gains],
        _ => {
            let lobe = &material.lobes[(index - FIRST_LOBE) / PER_LOBE];
            [lobe.strength, lobe.roughness, 1.0][(index - FIRST_LOBE) % PER_LOBE]
        }
    }
}
