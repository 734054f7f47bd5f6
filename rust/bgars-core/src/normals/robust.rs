//! The robust filter: the window of sorted values that a Lambertian facet explains best. Most pixels take the same rule in `f32`,
//! many at once, in `windows.rs`; this is the careful kernel that near ties are left to.

use nalgebra::{Matrix3, Vector3};

use super::solve::inverse;
use super::specular::sort_lights;

/// Most steps that the sorted values are cut into: up to 8 lights every window is tried, beyond that every eighth part.
const MAX_STEPS: usize = 8;

/// Fewest lights that fix a normal.
const MIN_KEPT: usize = 3;

/// A window must hold at least one light in this many.
const MIN_SHARE: usize = 3;

/// Smallest `det(L^T L)` of a window: three neighbours of a ring of eight at 65 degrees just pass.
pub(super) const MIN_DETERMINANT: f64 = 3e-3;

/// Cost of a dropped light that the fit cannot explain, relative to a kept light's.
pub(super) const DROPPED_WEIGHT: f64 = 0.1;

/// Fits that the noise level is worth: keeps a fit of three lights, which has no residual, from looking perfect.
const PRIOR_FITS: f64 = 0.7;

/// Standard deviation of a value, of full scale: one grey level of 255.
pub(super) const NOISE: f64 = 1.0 / 255.0;

/// Power of (all lights / kept lights): what dropping a light costs.
const DROPPING_POWER: i32 = 4;

/// Marks the lights that the robust filter keeps at one pixel.
///
/// # Inputs
/// `values` linear, one a light, divided by the light's intensity; `clipped` true for values at the saturation level;
/// `directions` unit vectors; `full_scale` the saturation level in the unit of `values`.
///
/// # Method
/// Shadows are among the darkest values and highlights among the brightest, so the diffuse values are a *window* of the
/// sorted ones. Each window of at least 3 lights and a third of them all is fitted by least squares, `g = rho n`, and judged
/// by what a Lambertian facet with that `g` would show under *every* light:
///
/// 1. A kept light costs its squared residual.
/// 2. A dropped light that is *darker* than predicted costs a tenth of its squared difference: highlights add light, so a
///    dropped bright light is no evidence against the fit, but a missing one is. A light dropped as dark must be black
///    (2 noise levels), whatever was predicted: a cast shadow has no light, while inter-reflection does.
/// 3. The mean cost a degree of freedom, with 0.7 of the squared noise as prior, times (lights / kept)^4, over sqrt(rho):
///    a bigger window and a brighter facet are preferred when they explain the values as well.
/// 4. At most half the lights are highlights: a facet darker than the median of the values is taken only where no other
///    window exists; one brighter than full scale pays (rho / full scale)^2.
///
/// The window of the least cost wins, the larger first; a facet that faces away from the camera is none. Where no window
/// fixes a normal, every light is kept.
///
/// # Examples
/// ```
/// use bgars_core::normals::robust_filter;
/// let s = 0.5f64.sqrt();
/// let ring = [[s, 0.0, s], [0.5, 0.5, s], [0.0, s, s], [-0.5, 0.5, s], [-s, 0.0, s], [-0.5, -0.5, s]];
/// // A facet toward the camera of 100 grey levels; light 1 makes a highlight, light 3 is in a cast shadow.
/// let values = [70.7, 180.0, 70.7, 0.0, 70.7, 70.7];
/// let kept = robust_filter(&values, &[false; 6], &ring, 255.0);
/// assert_eq!(kept, [true, false, true, false, true, true]);
/// ```
///
/// # Cost
/// At most 21 windows of O(L) each, after a sort.
#[must_use]
pub fn robust_filter(values: &[f32], clipped: &[bool], directions: &[[f64; 3]], full_scale: f32) -> Vec<bool> {
    let directions: Vec<Vector3<f64>> = directions.iter().map(|&direction| Vector3::from(direction)).collect();
    let pixel = Pixel { values, clipped, directions: &directions, full_scale: f64::from(full_scale) };
    let mut kept = vec![true; values.len()];
    choose(&windows(values.len()), &pixel, &mut RobustScratch::default(), &mut kept);
    kept
}

/// One pixel, as the filter sees it.
pub(super) struct Pixel<'a> {
    /// Linear values at unit light intensity.
    pub values: &'a [f32],
    /// True for values at the saturation level.
    pub clipped: &'a [bool],
    /// Unit vectors to the lights.
    pub directions: &'a [Vector3<f64>],
    /// Saturation level in the unit of the values.
    pub full_scale: f64,
}

/// Memory of one thread, reused from pixel to pixel: everything in the order of the sorted values.
#[derive(Debug, Default)]
pub(super) struct RobustScratch {
    order: Vec<usize>,
    ranked: Vec<Ranked>,
    /// `L^T L` and `L^T I` of all ranks below each.
    sums: Vec<(Matrix3<f64>, Vector3<f64>)>,
}

/// A light in its rank.
#[derive(Clone, Copy, Debug)]
struct Ranked {
    direction: Vector3<f64>,
    value: f64,
    clipped: bool,
}

/// First and one-past-last rank of a window.
pub(super) type Window = (usize, usize);

/// Writes the kept lights of a pixel to `kept`, by one of the [`windows`] of so many lights; see [`robust_filter`].
pub(super) fn choose(windows: &[Window], pixel: &Pixel<'_>, scratch: &mut RobustScratch, kept: &mut [bool]) {
    sort_lights(pixel.values, &mut scratch.order);
    let median = median(pixel.values, &scratch.order);
    // Divided by different intensities, the clipped need not be the brightest.
    scratch.order.sort_by_key(|&light| pixel.clipped[light]);
    rank(pixel, scratch);
    let noise = NOISE * pixel.full_scale;
    let mut best: Option<(bool, f64, Window)> = None;
    for &window in windows {
        let Some(facet) = fit(window, scratch) else { continue };
        let brightness = facet.norm();
        if !(facet.z > 0.0 && brightness.is_finite()) {
            continue;
        }
        let cost = cost(window, &facet, &scratch.ranked, noise) / brightness.sqrt()
            * (brightness / pixel.full_scale).powi(2).max(1.0);
        let too_dark = brightness < median;
        if best.is_none_or(|(dark, least, _)| (too_dark, cost) < (dark, least)) {
            best = Some((too_dark, cost, window));
        }
    }
    let (first, end) = best.map_or((0, kept.len()), |(_, _, window)| window);
    for (rank, &light) in scratch.order.iter().enumerate() {
        kept[light] = (first..end).contains(&rank);
    }
}

/// `rho n` of a window by least squares; `None` where its lights do not fix a normal.
fn fit((first, end): Window, scratch: &RobustScratch) -> Option<Vector3<f64>> {
    let (below, through) = (&scratch.sums[first], &scratch.sums[end]);
    let gram = through.0 - below.0;
    if gram.determinant() > MIN_DETERMINANT { Some(inverse(&gram)? * (through.1 - below.1)) } else { None }
}

/// The windows of so many lights: starts and ends on at most 8 steps, larger first, of equal size the darker first.
pub(super) fn windows(lights: usize) -> Vec<Window> {
    let steps = lights.min(MAX_STEPS);
    // Rounded to the nearest rank; every rank when there are at most 8.
    let edge = |step: usize| (2 * step * lights + steps) / (2 * steps);
    (1..=steps)
        .rev()
        .flat_map(|size| (0..=steps - size).map(move |start| (edge(start), edge(start + size))))
        .filter(|&(first, end)| end - first >= MIN_KEPT && MIN_SHARE * (end - first) >= lights)
        .collect()
}

/// The median of the sorted values; the mean of the two middle ones for an even number.
fn median(values: &[f32], order: &[usize]) -> f64 {
    let middle = values.len() / 2;
    let upper = f64::from(values[order[middle]]);
    if values.len() % 2 == 1 { upper } else { f64::midpoint(f64::from(values[order[middle - 1]]), upper) }
}

/// Fills the scratch with the lights in their ranks and the running sums of their normal equations.
fn rank(pixel: &Pixel<'_>, scratch: &mut RobustScratch) {
    let RobustScratch { order, ranked, sums } = scratch;
    ranked.clear();
    ranked.extend(order.iter().map(|&light| Ranked {
        direction: pixel.directions[light],
        value: f64::from(pixel.values[light]),
        clipped: pixel.clipped[light],
    }));
    sums.clear();
    let mut sum = (Matrix3::zeros(), Vector3::zeros());
    sums.push(sum);
    for light in &*ranked {
        sum.0 += light.direction * light.direction.transpose();
        sum.1 += light.direction * light.value;
        sums.push(sum);
    }
}

/// Cost of a window a degree of freedom, times (lights / kept)^4; see [`robust_filter`].
fn cost((first, end): Window, facet: &Vector3<f64>, ranked: &[Ranked], noise: f64) -> f64 {
    let mut residuals = 0.0;
    let mut unexplained = 0.0;
    for (rank, light) in ranked.iter().enumerate() {
        let predicted = light.direction.dot(facet);
        if (first..end).contains(&rank) {
            residuals += (light.value - predicted).powi(2);
            continue;
        }
        let black = light.value <= 2.0 * noise;
        let difference = light.value - predicted.max(0.0);
        let missing = difference < 0.0 && !light.clipped;
        let left_bright = rank < first && !(light.clipped && difference < 0.0);
        if !black && (missing || left_bright) {
            unexplained += difference * difference;
        }
    }
    (residuals + DROPPED_WEIGHT * unexplained + prior_squares(noise)) * cost_factor(end - first, ranked.len())
}

/// Cost of a squared residual in a window: (lights / kept)^4 a degree of freedom.
pub(super) fn cost_factor(kept: usize, lights: usize) -> f64 {
    let freedom = kept as f64 - MIN_KEPT as f64 + PRIOR_FITS;
    (lights as f64 / kept as f64).powi(DROPPING_POWER) / freedom
}

/// Squared residuals that every fit is taken to have.
pub(super) fn prior_squares(noise: f64) -> f64 {
    PRIOR_FITS * noise * noise
}
