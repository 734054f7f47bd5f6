//! The shape that all balls have in common: spheres, unless one material explains them far better as something flatter.

use super::anchor::Shape;
use super::fit::{Free, LOSS_SCALE, MaterialFit, fit_from};
use super::material::Material;
use super::samples::Samples;
use super::scale::bend;

/// Step of the search for the ratio of a shape.
const STEP: f64 = 0.04;

/// Ratios that are tried: below half, nobody would call it a ball.
const RATIOS: (f64, f64) = (0.4, 1.2);

/// Steps of a material's fit under another shape, from that under the shape beside it.
const FIT_STEPS: usize = 20;

/// Independent values in which a misfit of all balls can show itself: nine harmonics of the light's direction up to the second
/// order, which is all that a smooth reflectance passes (Basri, Jacobs 2003), times the six polynomials of a place on the ball up
/// to the second. More pixels, balls and lights show the same misfit again; noise is new at each.
const INDEPENDENT: f64 = 54.0;

/// Standard deviation of the ratio that is reckoned with before the light is looked at: what is seen of solder balls is round
/// within 1 %, twice this.
pub const PRIOR: f64 = 0.005;

/// A ratio so many standard uncertainties from 1 is believed ...
const SIGNIFICANT: f64 = 3.0;

/// ... if it lowers the loss by this share, as a second lobe must: lights that all stand higher than said look much the same.
pub const EVIDENCE: f64 = 0.15;

/// What stands on the circles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CommonShape {
    #[allow(missing_docs)] // the type says it
    pub shape: Shape,
    /// Standard uncertainty of its ratio.
    pub u_ratio: f64,
}

/// The place of the least loss of a family of shapes.
struct Best {
    ratio: f64,
    loss: f64,
    /// That of spheres.
    loss_of_spheres: f64,
    /// Standard uncertainty of the ratio: where what misfit adds to the loss is higher by a share of `1 / INDEPENDENT`.
    sigma: f64,
}

/// The shape under which one material explains the balls best, if that is not a sphere by far.
///
/// # Method
/// The ratio of a cap is walked downhill in the loss of the material, which is fitted anew at each step; a parabola through the last
/// three gives the minimum and, by its curvature, the uncertainty. A ratio that is not believed stays 1, and its uncertainty holds what
/// light and prior together say it is off. One that is believed competes with that of an ellipsoid.
///
/// `samples(shape)`: the same pixels, in pairs of neighbours, with the normals of a shape.
/// `u_radius`: standard uncertainty of the radii over the radii. A circle that is too small and a cap lower than half a ball have the
/// same normals: the ratio is that of both, and so is its uncertainty.
pub fn common_shape(samples: &dyn Fn(Shape) -> Samples, material: &Material, u_radius: f64) -> CommonShape {
    let prior = PRIOR.hypot(u_radius);
    let free = Free { grazing: material.grazing != 0.0, tails_and_gains: true };
    let Some(cap) = least(samples, material, free, Shape::Cap) else {
        return CommonShape { shape: Shape::SPHERE, u_ratio: prior };
    };
    let is_better = cap.loss < (1.0 - EVIDENCE) * cap.loss_of_spheres;
    if !is_better || (cap.ratio - 1.0).abs() <= SIGNIFICANT * cap.sigma {
        let (prior, sigma) = (prior * prior, cap.sigma * cap.sigma);
        let off = (cap.ratio - 1.0) * prior / (prior + sigma);
        let u_ratio = (off * off + prior * sigma / (prior + sigma)).sqrt();
        return CommonShape { shape: Shape::SPHERE, u_ratio };
    }
    match least(samples, material, free, Shape::Ellipsoid) {
        Some(other) if other.loss < cap.loss => {
            CommonShape { shape: Shape::Ellipsoid(other.ratio), u_ratio: other.sigma }
        }
        _ => CommonShape { shape: Shape::Cap(cap.ratio), u_ratio: cap.sigma },
    }
}

/// The least loss of a family; `None` where the loss says nothing.
fn least(
    samples: &dyn Fn(Shape) -> Samples,
    material: &Material,
    free: Free,
    family: fn(f64) -> Shape,
) -> Option<Best> {
    let at = |ratio: f64, start: &Material| (ratio, fit_from(&samples(family(ratio)), start, free, FIT_STEPS));
    // The material comes from other pixels: first it has to arrive.
    let mut middle = at(1.0, &at(1.0, material).1.material);
    let loss_of_spheres = middle.1.cost;
    let [mut below, mut above] = [1.0 - STEP, 1.0 + STEP].map(|ratio| at(ratio, &middle.1.material));
    while below.1.cost < middle.1.cost && below.0 > RATIOS.0 {
        let next = at(below.0 - STEP, &below.1.material);
        (below, middle, above) = (next, below, middle);
    }
    while above.1.cost < middle.1.cost && above.0 < RATIOS.1 {
        let next = at(above.0 + STEP, &above.1.material);
        (below, middle, above) = (middle, above, next);
    }
    let first = Best { loss_of_spheres, ..vertex(&below, &middle, &above)? };
    // Once more, half as wide: the loss flattens away from its minimum.
    let narrow = STEP / 2.0;
    let middle = at(first.ratio, &middle.1.material);
    let [below, above] = [first.ratio - narrow, first.ratio + narrow].map(|ratio| at(ratio, &middle.1.material));
    let best = vertex(&below, &middle, &above).unwrap_or(first);
    let samples = samples(family(best.ratio));
    let independent =
        1.0 / (shared(&samples, &middle.1.material) / INDEPENDENT + 1.0 / samples.values.len().max(1) as f64);
    let sigma = best.sigma * (INDEPENDENT / independent).sqrt();
    Some(Best { loss_of_spheres, sigma, ..best })
}

/// The share of the residuals that the neighbours of each pair have in common: what is no noise.
fn shared(samples: &Samples, material: &Material) -> f64 {
    let lights = samples.lights;
    // The influence of Cauchy's loss, so that a few large residuals do not speak for all.
    let influence = |pixel: usize, light: usize| {
        let index = pixel * lights + light;
        let predicted = bend(samples.brightness(index, light, material)).min(samples.clip[light]);
        let residual = samples.values[index] - predicted;
        residual / (1.0 + (residual / LOSS_SCALE).powi(2))
    };
    let (mut products, mut squares) = (0.0, 1e-12);
    for pixel in (0..samples.len().saturating_sub(1)).step_by(2) {
        for light in 0..lights {
            let (left, right) = (influence(pixel, light), influence(pixel + 1, light));
            products += left * right;
            squares += 0.5 * (left * left + right * right);
        }
    }
    (products / squares).clamp(0.0, 1.0)
}

/// The parabola through three ratios that are equally far apart.
fn vertex(below: &(f64, MaterialFit), middle: &(f64, MaterialFit), above: &(f64, MaterialFit)) -> Option<Best> {
    let step = middle.0 - below.0;
    let bend = below.1.cost + above.1.cost - 2.0 * middle.1.cost;
    if bend.is_nan() || bend <= 0.0 {
        return None;
    }
    let shift = (0.5 * (below.1.cost - above.1.cost) / bend).clamp(-1.0, 1.0);
    let loss = (middle.1.cost - 0.5 * bend * shift * shift).max(0.0);
    // The loss is that of the minimum plus (ratio - minimum)^2 times half the curvature.
    let half_curvature = 0.5 * bend / (step * step);
    let sigma = (loss / (INDEPENDENT * half_curvature)).sqrt();
    Some(Best { ratio: middle.0 + shift * step, loss, loss_of_spheres: loss, sigma })
}
