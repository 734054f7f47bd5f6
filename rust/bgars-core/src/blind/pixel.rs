//! What becomes of one pixel: which facet it gets, and how far that can be trusted.

use nalgebra::Vector3;

use super::facet::{self, Facet, Pull, equations, tangents};
use super::lobe::Material;
use super::observation::{Kind, Observation, SCALE};
use crate::normals::{confidence_of, misfit_freedom};

/// Fewest lights within the noise that speak for the robust filter, whatever the number of lights.
const MIN_MATCHED: usize = 4;

/// Differences up to so many noise levels count as a match.
const MATCH_LEVELS: f64 = 1.5;

/// Standard error of the direction from which on a normal is the neighbours', not measured, degrees.
const MAX_ERROR_DEG: f64 = 30.0;

/// Residual that a fit is assumed to have at least: the scale of its loss, 2 % of the pixel's mean value or a grey level of 255.
/// A misfit below it is not seen: the loss takes all lights for good ones.
const PRIOR_RESIDUAL: f64 = 0.02;

/// Unknowns of a pixel: two of the direction, and the albedo.
const UNKNOWNS: f64 = 3.0;

/// Lights that are reckoned with at least: below, nothing is over that a misfit could show itself in.
const LEAST_LIGHTS: f64 = 2.2;

/// Residuals up to so many times the scale of the loss: the light was used.
const USED: f64 = 3.0;

/// Where the normal of a pixel comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Source {
    #[default]
    Material,
    Matte,
    RobustFilter,
}

impl Source {
    /// The material of a facet, where the other one is `material`.
    pub fn material(self, material: &Material) -> &Material {
        if self == Self::Matte { &Material::MATTE } else { material }
    }
}

/// The facet of least cost over the starts, under both materials or only under the one that stands beside the start.
pub(super) fn best_facet(
    observation: &Observation,
    material: &Material,
    starts: &[(Vector3<f64>, Option<Source>)],
    pull: Option<&Pull>,
    max_iters: usize,
) -> (Facet, Source) {
    let mut best: Option<(Facet, Source)> = None;
    for (start, only) in starts {
        for (candidate, source) in [(material, Source::Material), (&Material::MATTE, Source::Matte)] {
            if only.is_some_and(|only| only != source) {
                continue;
            }
            let facet = facet::fit(observation, candidate, start, None, pull, max_iters);
            if best.is_none_or(|(least, _)| facet.cost < least.cost) {
                best = Some((facet, source));
            }
        }
    }
    best.unwrap_or((Facet { normal: Vector3::z(), log_albedo: 0.0, cost: f64::INFINITY }, Source::Matte))
}

/// True where the robust filter's facet `scaled` (rho n) matches at least half of the lights within the noise, four or
/// more, while the fit misses more than a quarter: then the fit's material is not the pixel's.
pub(super) fn filter_knows_better(
    observation: &Observation,
    scaled: &Vector3<f64>,
    facet: &Facet,
    material: &Material,
) -> bool {
    let albedo = facet.log_albedo.exp();
    let (mut by_filter, mut by_fit) = (0, 0);
    for (index, light) in observation.lights.iter().enumerate() {
        let matches = |model: f64| {
            let difference = model - observation.values[index];
            difference.abs() <= MATCH_LEVELS * observation.noise
                || observation.kinds[index] == Kind::Clipped && difference > 0.0
        };
        let black = observation.kinds[index] == Kind::Black;
        by_filter += usize::from(!black && matches(scaled.dot(&light.direction)));
        by_fit += usize::from(matches(albedo * material.shade(&facet.normal, light)));
    }
    let lights = observation.lights.len();
    by_filter >= MIN_MATCHED && 2 * by_filter >= lights && 4 * by_fit <= 3 * lights
}

/// How far a facet can be trusted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trust {
    /// `1 / (1 + (s / 5 deg)^2)` with `s` the standard error of the direction.
    pub confidence: f32,
    /// False where the data leave the normal to its neighbours.
    pub measured: bool,
}

/// The trust in a facet, and the lights it used (written to `used`).
///
/// s^2 = sigma^2 (C_11 + C_22), C the inverse of the normal equations with robust weights scaled to 1 at no residual. Of the
/// weighted mean squared residual, sigma^2 takes what noise explains (and its own standard deviation) for noise, and the rest, with
/// a 2 % prior, for a misfit of the model, of which more is hidden than seen ([`misfit_freedom`]).
pub(super) fn trust(observation: &Observation, material: &Material, facet: &Facet, used: &mut [bool]) -> Trust {
    let frame = tangents(&facet.normal);
    let albedo = facet.log_albedo.exp();
    let (mut squares, mut weights, mut lights) = (0.0, 1e-9, 0.0);
    for (index, used) in used.iter_mut().enumerate() {
        let model = albedo * material.shade(&facet.normal, &observation.lights[index]);
        let ratio = observation.residual(index, model) / SCALE;
        // A clipped value that the model exceeds has no residual whatever the normal is: no witness of it.
        let is_witness = observation.kinds[index] != Kind::Clipped || ratio < 0.0;
        let share = if is_witness { observation.share(index) } else { 0.0 };
        let weight = share / (1.0 + ratio * ratio);
        squares += weight * (ratio * SCALE).powi(2);
        weights += weight;
        lights += share;
        *used = ratio.abs() <= USED;
    }
    let information = equations(observation, material, facet, &frame).matrix * (SCALE * SCALE);
    let noise = (observation.sigma * observation.weight).powi(2);
    let over = (lights - UNKNOWNS).max(LEAST_LIGHTS - 2.0);
    let of_noise = noise * over / lights.max(1.0) * (1.0 + (2.0 / over).sqrt());
    let unexplained = (squares / weights - of_noise).max(0.0);
    let misfit = (lights * unexplained + PRIOR_RESIDUAL * PRIOR_RESIDUAL) / misfit_freedom(lights.max(LEAST_LIGHTS));
    let variance = noise + misfit;
    // The turning part of the covariance.
    let turning = information.try_inverse().map_or(f64::NAN, |inverse| inverse[(0, 0)] + inverse[(1, 1)]);
    if !(turning.is_finite() && turning >= 0.0) {
        return Trust { confidence: 0.0, measured: false };
    }
    let error_deg = (variance * turning).sqrt().to_degrees();
    // Never quite 0: that is what a pixel without a normal has.
    let confidence = confidence_of(error_deg).max(f32::MIN_POSITIVE);
    Trust { confidence, measured: error_deg <= MAX_ERROR_DEG }
}
