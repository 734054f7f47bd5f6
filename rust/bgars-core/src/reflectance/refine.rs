//! The normal of one pixel from its signature.

use multiversion::{multiversion, target::target_cfg_f};

use super::table::{GROUP, Group, Signatures};
use crate::normals::add_product;

/// Steps of the minimisation at most.
const MAX_STEPS: usize = 12;

/// A step shorter than this (units of the disc, about radian / 1.4) is the last: the next would be a tenth of it.
const SMALL_STEP: f32 = 3e-4;

/// Residuals of so many standard deviations have half their weight.
pub const LOSS_SCALE: f32 = 3.0;

/// A minimum whose mean cost a light is below this is believed without a search.
const GOOD_COST: f32 = 2.0;

/// Coarse nodes closer than this to the best are the same valley.
const VALLEY: f32 = 0.15;

/// Bent grey levels at which a light counts no more in the search: coarse nodes are some levels apart.
const SEARCH_CLIP: f32 = 30.0;

/// Products of losses' arguments are turned into a logarithm before they overflow: one more group of lights stays below the
/// largest number.
const LARGE: f64 = 1e100;

/// Largest radius on the disc: n_z = 0.03.
const MAX_RADIUS: f32 = 0.985;

/// One pixel's observations in groups of lights; lanes without a light have weight 0.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Bent grey levels.
    pub bent: Vec<Group>,
    /// One over the standard deviation, 0 for lanes without a light.
    pub weight: Vec<Group>,
    /// Bent level at which a light clips.
    pub clip: Vec<Group>,
}

/// Where a normal is expected, and how firmly.
#[derive(Clone, Copy, Debug)]
pub struct Prior {
    /// On the disc.
    pub point: [f32; 2],
    /// One over the standard deviation on the disc; 0 for none.
    pub weight: f32,
}

#[derive(Clone, Copy, Debug)]
pub struct Minimum {
    /// On the disc.
    pub point: [f32; 2],
    /// `sum 9 log(1 + (r / 3)^2)`, the prior's part in it.
    pub cost: f32,
    /// The data's part of the cost.
    pub data_cost: f32,
    /// `J^T W J` of the data: aa, ab, bb.
    pub information: [f32; 3],
    /// The same of the prior: aa and bb.
    pub prior_information: f32,
}

impl Minimum {
    /// The expected normal of a pixel that is not looked at.
    pub fn unseen(point: [f32; 2], weight: f32) -> Self {
        Self { point, cost: 0.0, data_cost: 0.0, information: [0.0; 3], prior_information: weight * weight }
    }
}

/// Cost and its derivatives at one place.
#[derive(Clone, Copy)]
struct State {
    /// The data's part of the cost is `9 log` of this: places are compared without logarithms.
    factor: f64,
    /// What is not in `factor` any more, so that it stays small.
    log: f64,
    /// The prior's part.
    prior_factor: f32,
    gradient: [f32; 2],
    information: [f32; 3],
    prior_information: f32,
}

impl State {
    fn data_cost(&self) -> f32 {
        LOSS_SCALE * LOSS_SCALE * (self.log + self.factor.ln()) as f32
    }

    fn cost(&self) -> f32 {
        self.data_cost() + LOSS_SCALE * LOSS_SCALE * self.prior_factor.ln()
    }

    /// True where the cost is below that of another place.
    #[inline(always)]
    fn is_below(&self, other: &Self) -> bool {
        if self.log == 0.0 && other.log == 0.0 {
            self.factor * f64::from(self.prior_factor) < other.factor * f64::from(other.prior_factor)
        } else {
            self.cost() < other.cost()
        }
    }
}

/// The sum of eight numbers, in pairs: three steps of a vector instead of eight of a number.
#[inline(always)]
fn sum([a, b, c, d, e, f, g, h]: Group) -> f32 {
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}

#[inline(always)]
fn evaluate<const FMA: bool>(table: &Signatures, pixel: &Observation, prior: Prior, point: [f32; 2]) -> State {
    let scale2 = LOSS_SCALE * LOSS_SCALE;
    let mut sums = [[0.0f32; GROUP]; 5];
    let (mut factor, mut log) = (1.0, 0.0);
    for group in 0..table.groups() {
        let signature = table.at::<FMA>(point, group);
        let (bent, weight, clip) = (&pixel.bent[group], &pixel.weight[group], &pixel.clip[group]);
        let mut factors = [0.0f32; GROUP];
        for k in 0..GROUP {
            let inside = if signature.value[k] < clip[k] { 1.0 } else { 0.0 };
            let predicted = if signature.value[k] < clip[k] { signature.value[k] } else { clip[k] };
            let r = (bent[k] - predicted) * weight[k];
            factors[k] = add_product::<FMA>(1.0, r * r, 1.0 / scale2);
            let u = inside * weight[k] / factors[k];
            let (ua, ub) = (u * signature.along_a[k], u * signature.along_b[k]);
            let (ja, jb) = (signature.along_a[k] * weight[k], signature.along_b[k] * weight[k]);
            sums[0][k] = add_product::<FMA>(sums[0][k], ua, r);
            sums[1][k] = add_product::<FMA>(sums[1][k], ub, r);
            sums[2][k] = add_product::<FMA>(sums[2][k], ua, ja);
            sums[3][k] = add_product::<FMA>(sums[3][k], ua, jb);
            sums[4][k] = add_product::<FMA>(sums[4][k], ub, jb);
        }
        let [a, b, c, d, e, f, g, h] = factors.map(f64::from);
        factor *= ((a * e) * (c * g)) * ((b * f) * (d * h));
        if factor > LARGE {
            log += factor.ln();
            factor = 1.0;
        }
    }
    let (da, db) = (prior.point[0] - point[0], prior.point[1] - point[1]);
    let prior_factor = 1.0 + (da * da + db * db) * prior.weight * prior.weight / scale2;
    let pull = prior.weight * prior.weight / prior_factor;
    State {
        factor,
        log,
        prior_factor,
        gradient: [sum(sums[0]) + pull * da, sum(sums[1]) + pull * db],
        information: [sum(sums[2]), sum(sums[3]), sum(sums[4])],
        prior_information: pull,
    }
}

/// The deepest minimum that is found from the expected normal, and, where that explains the pixel badly, from the
/// signatures nearest to it.
#[multiversion(targets("x86_64+avx2+fma"))]
pub fn deepest(
    table: &Signatures,
    pixel: &Observation,
    lights: usize,
    prior: Prior,
    distances: &mut Vec<f32>,
) -> Minimum {
    if target_cfg_f!(target_feature = "fma") {
        deepest_by::<true>(table, pixel, lights, prior, distances)
    } else {
        deepest_by::<false>(table, pixel, lights, prior, distances)
    }
}

/// The minimum nearest to the expected normal.
pub fn nearest(table: &Signatures, pixel: &Observation, prior: Prior) -> Minimum {
    minimise::<false>(table, pixel, prior, prior.point)
}

#[inline(always)]
fn deepest_by<const FMA: bool>(
    table: &Signatures,
    pixel: &Observation,
    lights: usize,
    prior: Prior,
    distances: &mut Vec<f32>,
) -> Minimum {
    let mut best = minimise::<FMA>(table, pixel, prior, prior.point);
    if best.cost < GOOD_COST * lights as f32 {
        return best;
    }
    for start in candidates(table, pixel, lights, distances) {
        let other = minimise::<FMA>(table, pixel, prior, start);
        if other.cost < best.cost {
            best = other;
        }
    }
    best
}

/// Levenberg-Marquardt from one start.
#[inline(always)]
fn minimise<const FMA: bool>(table: &Signatures, pixel: &Observation, prior: Prior, start: [f32; 2]) -> Minimum {
    let mut point = into_disc(start);
    let mut state = evaluate::<FMA>(table, pixel, prior, point);
    let mut damping = 1e-2f32;
    for _ in 0..MAX_STEPS {
        let [haa, hab, hbb] = state.information;
        let (haa, hbb) = (haa + state.prior_information, hbb + state.prior_information);
        let extra = damping * (haa + hbb) * 0.5 + 1e-6;
        let (haa, hbb) = (haa + extra, hbb + extra);
        let determinant = haa * hbb - hab * hab;
        let [ga, gb] = state.gradient;
        let step = [(hbb * ga - hab * gb) / determinant, (haa * gb - hab * ga) / determinant];
        let length = (step[0] * step[0] + step[1] * step[1]).sqrt();
        if !length.is_finite() {
            // One light alone fixes one direction, so firmly that the damping is lost in rounding.
            damping = (damping * 6.0).max(1e-3);
            continue;
        }
        let shorten = (0.2 / length.max(1e-12)).min(1.0);
        let next = into_disc([point[0] + shorten * step[0], point[1] + shorten * step[1]]);
        let next_state = evaluate::<FMA>(table, pixel, prior, next);
        if next_state.is_below(&state) {
            point = next;
            state = next_state;
            damping *= 0.2;
            if length < SMALL_STEP {
                break;
            }
        } else {
            if length < SMALL_STEP {
                break;
            }
            damping = (damping * 6.0).max(1e-3);
        }
    }
    Minimum {
        point,
        cost: state.cost(),
        data_cost: state.data_cost(),
        information: state.information,
        prior_information: state.prior_information,
    }
}

#[inline(always)]
fn into_disc([a, b]: [f32; 2]) -> [f32; 2] {
    let radius = (a * a + b * b).sqrt();
    if radius > MAX_RADIUS { [a * MAX_RADIUS / radius, b * MAX_RADIUS / radius] } else { [a, b] }
}

/// The coarse nodes nearest to a pixel: the best, and the best outside its valley.
#[inline(always)]
fn candidates(table: &Signatures, pixel: &Observation, lights: usize, distances: &mut Vec<f32>) -> [[f32; 2]; 2] {
    let (points, values) = table.coarse();
    distances.clear();
    distances.resize(points.len(), 0.0);
    for light in 0..lights {
        let (group, lane) = (light / GROUP, light % GROUP);
        let (bent, clip) = (pixel.bent[group][lane], pixel.clip[group][lane]);
        let nodes = &values[light * points.len()..(light + 1) * points.len()];
        for (distance, &value) in distances.iter_mut().zip(nodes) {
            *distance += (bent - value.min(clip)).abs().min(SEARCH_CLIP);
        }
    }
    let mut best = (f32::INFINITY, 0);
    for (index, &distance) in distances.iter().enumerate() {
        if distance < best.0 {
            best = (distance, index);
        }
    }
    let first = points[best.1];
    let mut second = (f32::INFINITY, best.1);
    for (index, (&distance, point)) in distances.iter().zip(points).enumerate() {
        let (da, db) = (point[0] - first[0], point[1] - first[1]);
        if distance < second.0 && da * da + db * db > VALLEY * VALLEY {
            second = (distance, index);
        }
    }
    [first, points[second.1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_light_that_tells_all_it_can_leaves_a_normal() {
        // Its information is so large and so one-sided that the determinant of the normal equations is lost in rounding.
        let table = Signatures::tabulate(1, |normal, levels| levels.fill((900.0 * normal.x) as f32));
        for weight in [1e2, 1e5, 1e9, 1e15] {
            let lane = |value: f32| {
                let mut group = [0.0; GROUP];
                group[0] = value;
                vec![group]
            };
            let pixel = Observation { bent: lane(-300.0), weight: lane(weight), clip: vec![[f32::INFINITY; GROUP]] };
            let prior = Prior { point: [0.4, 0.3], weight: 0.0 };
            for found in [nearest(&table, &pixel, prior), deepest(&table, &pixel, 1, prior, &mut Vec::new())] {
                assert!(found.point.iter().all(|value| value.is_finite()), "weight {weight}: {found:?}");
            }
        }
    }
}
