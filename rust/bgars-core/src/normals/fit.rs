//! Least squares on a block of pixels, in `f32`.
//!
//! Pixels whose equations are too badly conditioned for `f32` are left to the careful kernel.

use nalgebra::{Matrix3, Vector3};

use super::confidence::{HALF_DEG, PRIOR_RESIDUAL, misfit_freedom};
use super::lanes::{GROUP, LANES, Lanes, add_product, dot};
use super::symmetric::{ENTRIES, Symmetric, doubled, entries_at, form, invert, product, products, upper};
use crate::Lights;
use crate::lights::conditioning;

/// Subsets of lights below this [`conditioning`] are solved in `f64`: one refinement in `f32` no longer makes up for rounding.
const MIN_CONDITIONING: f32 = 1e-3;

/// Below this one, they are refined; above, rounding turns a normal by less than 2e-4 degrees (held by
/// `tests/property/test_normals_twin.py`).
const MIN_ROUGH_CONDITIONING: f32 = 0.1;

/// `n_z` below which `f32` cannot say whether a facet faces the camera.
const GRAZING: f32 = 1e-5;

/// Least `rho^2` whose squares stay in the normal range of `f32`, and one over the largest.
const MIN_SQUARE: f32 = 1e-15;

/// The square of the half-way point of the confidence, radians.
const HALF2: f64 = (HALF_DEG * std::f64::consts::PI / 180.0) * (HALF_DEG * std::f64::consts::PI / 180.0);

/// Lights of whose values few sums are formed.
const LARGE_GROUP: usize = 8;

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct Equations {
    /// Unit vectors to the lights.
    pub directions: Vec<[f32; 3]>,
    /// The same with their squares.
    lights: Vec<Light>,
    /// `(L^T L)^-1 L^T` of all lights, a column a light.
    pseudo_inverse: Vec<[f32; 3]>,
    /// The [prior](PRIOR_RESIDUAL) less `L^T L`, [`doubled`]: what is not explained, beside the squares of the values.
    unexplained: Symmetric,
    /// `(tr C) I - C`, `C = (L^T L)^-1`, [`doubled`].
    turning: Symmetric,
    /// Of all lights.
    freedom: f32,
}

/// What a light adds to normal equations.
#[derive(Clone, Copy, Debug)]
struct Light {
    direction: [f32; 3],
    /// `l l^T`.
    outer: Symmetric,
}

/// The normal equations of a block of pixels.
struct Sums {
    /// `L^T L`.
    gram: [Lanes<f32>; ENTRIES],
    /// `L^T I`.
    right: [Lanes<f32>; 3],
    squares: Lanes<f32>,
    counts: Lanes<f32>,
}

/// The least squares of a block of pixels.
#[derive(Clone)]
pub(super) struct Fit {
    /// `g = rho n`, by component.
    scaled: [Lanes<f32>; 3],
    /// Sum of the squared residuals, with the prior.
    unexplained: Lanes<f32>,
    /// `(tr C) |g|^2 - g^T C g`, `C` the inverse in use.
    turning: Lanes<f32>,
    /// Degrees of freedom of the residuals (see [`super::confidence`]), by the square of its half-way point.
    freedom: Lanes<f32>,
    /// Whether `f32` will do.
    usable: Lanes<bool>,
    /// Sum of the squared values: not finite where a value is not.
    squares: Lanes<f32>,
}

/// What is written of a block of pixels.
pub(super) struct Results<'a> {
    /// Unit normals, x y z of each pixel; NaN without solution, like the albedo.
    pub normals: &'a mut [f32; 3 * LANES],
    pub albedo: &'a mut [f32; LANES],
    pub confidence: &'a mut [f32; LANES],
    pub mask: &'a mut [bool; LANES],
}

impl Equations {
    /// `None` where blocks cannot serve: near lights, or lights that are badly conditioned even together.
    pub fn new(lights: &Lights) -> Option<Self> {
        let Lights::Directional(directions) = lights else { return None };
        let gram = directions.iter().fold(Matrix3::zeros(), |gram, light| gram + light * light.transpose());
        let inverse = gram.try_inverse().filter(|_| conditioning(&gram) >= f64::from(MIN_CONDITIONING))?;
        let single = |vector: &Vector3<f64>| [vector.x as f32, vector.y as f32, vector.z as f32];
        let prior = Matrix3::identity() * (PRIOR_RESIDUAL * PRIOR_RESIDUAL);
        Some(Self {
            directions: directions.iter().map(single).collect(),
            lights: directions
                .iter()
                .map(|light| Light { direction: single(light), outer: upper(&(light * light.transpose())) })
                .collect(),
            pseudo_inverse: directions.iter().map(|light| single(&(inverse * light))).collect(),
            unexplained: doubled(upper(&(prior - gram))),
            turning: doubled(upper(&(Matrix3::identity() * inverse.trace() - inverse))),
            freedom: (misfit_freedom(directions.len() as f64) * HALF2) as f32,
        })
    }

    /// Every light of every pixel is kept: one matrix for all.
    #[inline(always)]
    pub fn fit_all<const FMA: bool>(&self, values: &[Lanes<f32>], fit: &mut Fit) {
        let Fit { scaled: [x, y, z], squares, unexplained, turning, freedom, usable } = fit;
        for sum in [&mut *x, &mut *y, &mut *z, &mut *squares] {
            *sum = Lanes::of(0.0);
        }
        let (groups, rest) = values.as_chunks::<LARGE_GROUP>();
        let (columns, rest_columns) = self.pseudo_inverse.as_chunks::<LARGE_GROUP>();
        for (values, columns) in groups.iter().zip(columns) {
            add_up::<FMA, LARGE_GROUP>(values, columns, [x, y, z, squares]);
        }
        for (value, column) in rest.iter().zip(rest_columns) {
            add_up::<FMA, 1>(std::array::from_ref(value), std::array::from_ref(column), [x, y, z, squares]);
        }
        (*freedom, *usable) = (Lanes::of(self.freedom), Lanes::of(true));
        for lane in 0..LANES {
            let products = products([x[lane], y[lane], z[lane]]);
            // |I|^2 - |L g|^2; what rounding leaves is far below the prior of 2 %.
            unexplained[lane] = squares[lane] + form::<FMA>(self.unexplained, &products);
            turning[lane] = form::<FMA>(self.turning, &products);
        }
    }

    /// Some lights of some pixels are dropped: the normal equations of each pixel. `weights` 1 for a light that is kept, else 0.
    #[inline(always)]
    pub fn fit_kept<const FMA: bool>(&self, values: &[Lanes<f32>], weights: &[Lanes<f32>], fit: &mut Fit) {
        let mut sums = Sums::ZERO;
        let (groups, rest) = values.as_chunks::<GROUP>();
        let (weight_groups, rest_weights) = weights.as_chunks::<GROUP>();
        let (lights, rest_lights) = self.lights.as_chunks::<GROUP>();
        for ((values, weights), lights) in groups.iter().zip(weight_groups).zip(lights) {
            sums.add::<FMA, GROUP>(values, weights, lights);
        }
        for ((value, weight), light) in rest.iter().zip(rest_weights).zip(rest_lights) {
            sums.add::<FMA, 1>(std::array::from_ref(value), std::array::from_ref(weight), std::array::from_ref(light));
        }
        let Sums { gram, right, squares, counts } = &sums;
        let (mut inverse, mut refined) = ([Lanes::of(0.0); ENTRIES], [Lanes::of(0.0); 3]);
        let (mut rough, [mut explained, mut fine]) = (false, [Lanes::of(0.0); 2]);
        for lane in 0..LANES {
            let (matrix, conditioning) = invert::<FMA>(entries_at(gram, lane));
            let right = [right[0][lane], right[1][lane], right[2][lane]];
            let scaled = product::<FMA>(&matrix, right);
            explained[lane] = dot::<FMA>(scaled, right);
            for axis in 0..3 {
                refined[axis][lane] = scaled[axis];
            }
            for entry in 0..ENTRIES {
                inverse[entry][lane] = matrix[entry];
            }
            // Written so that NaN is unusable.
            fit.usable[lane] = conditioning > MIN_CONDITIONING;
            let is_fine = conditioning > MIN_ROUGH_CONDITIONING;
            fine[lane] = if is_fine { 0.0 } else { 1.0 };
            rough |= !is_fine;
        }
        if rough {
            self.refine::<FMA>(values, weights, &inverse, &fine, &mut refined);
        }
        for lane in 0..LANES {
            let scaled = [refined[0][lane], refined[1][lane], refined[2][lane]];
            let matrix = entries_at(&inverse, lane);
            let square = dot::<FMA>(scaled, scaled);
            let prior = (PRIOR_RESIDUAL * PRIOR_RESIDUAL) as f32 * square;
            fit.unexplained[lane] = squares[lane] - explained[lane] + prior;
            let turning = form::<FMA>(doubled(matrix), &products(scaled));
            fit.turning[lane] = (matrix[0] + matrix[3] + matrix[5]) * square - turning;
            fit.freedom[lane] = freedom(counts[lane]);
        }
        (fit.scaled, fit.squares) = (refined, *squares);
    }

    /// One step of iterative refinement where `wanted` is 1: what corrects the residuals of the lights.
    #[inline(always)]
    fn refine<const FMA: bool>(
        &self,
        values: &[Lanes<f32>],
        weights: &[Lanes<f32>],
        inverse: &[Lanes<f32>; ENTRIES],
        wanted: &Lanes<f32>,
        scaled: &mut [Lanes<f32>; 3],
    ) {
        let mut sums = [Lanes::of(0.0); 3];
        for ((value, weight), direction) in values.iter().zip(weights).zip(&self.directions) {
            for lane in 0..LANES {
                let predicted = dot::<FMA>([scaled[0][lane], scaled[1][lane], scaled[2][lane]], *direction);
                let residual = (value[lane] - predicted) * weight[lane];
                for axis in 0..3 {
                    sums[axis][lane] = add_product::<FMA>(sums[axis][lane], residual, direction[axis]);
                }
            }
        }
        for lane in 0..LANES {
            let matrix = entries_at(inverse, lane);
            let correction = product::<FMA>(&matrix, [sums[0][lane], sums[1][lane], sums[2][lane]]);
            for axis in 0..3 {
                scaled[axis][lane] =
                    if wanted[lane] > 0.0 { scaled[axis][lane] + correction[axis] } else { scaled[axis][lane] };
            }
        }
    }
}

impl Sums {
    const ZERO: Self = Self {
        gram: [Lanes::of(0.0); ENTRIES],
        right: [Lanes::of(0.0); 3],
        squares: Lanes::of(0.0),
        counts: Lanes::of(0.0),
    };

    /// Adds some lights.
    #[inline(always)]
    fn add<const FMA: bool, const COUNT: usize>(
        &mut self,
        values: &[Lanes<f32>; COUNT],
        weights: &[Lanes<f32>; COUNT],
        lights: &[Light; COUNT],
    ) {
        let [xx, xy, xz, yy, yz, zz] = &mut self.gram;
        let [x, y, z] = &mut self.right;
        let (squares, counts) = (&mut self.squares, &mut self.counts);
        for lane in 0..LANES {
            let mut gram = [xx[lane], xy[lane], xz[lane], yy[lane], yz[lane], zz[lane]];
            let mut right = [x[lane], y[lane], z[lane]];
            let (mut square, mut count) = (squares[lane], counts[lane]);
            for light in 0..COUNT {
                let weight = weights[light][lane];
                let value = values[light][lane] * weight;
                for entry in 0..ENTRIES {
                    gram[entry] = add_product::<FMA>(gram[entry], weight, lights[light].outer[entry]);
                }
                for axis in 0..3 {
                    right[axis] = add_product::<FMA>(right[axis], value, lights[light].direction[axis]);
                }
                square = add_product::<FMA>(square, value, value);
                count += weight;
            }
            [xx[lane], xy[lane], xz[lane], yy[lane], yz[lane], zz[lane]] = gram;
            [x[lane], y[lane], z[lane]] = right;
            (squares[lane], counts[lane]) = (square, count);
        }
    }
}

impl Fit {
    pub const ZERO: Self = Self {
        scaled: [Lanes::of(0.0); 3],
        unexplained: Lanes::of(0.0),
        turning: Lanes::of(0.0),
        freedom: Lanes::of(0.0),
        usable: Lanes::of(false),
        squares: Lanes::of(0.0),
    };

    /// True where every value was.
    #[inline(always)]
    pub fn is_finite(&self) -> bool {
        let mut finite = true;
        for square in &*self.squares {
            finite &= *square < f32::INFINITY;
        }
        finite
    }

    /// Results from the fit; facets seen from the side, and values far from 1, are left to the careful kernel: true in `careful`.
    #[inline(always)]
    pub fn finish<const FMA: bool>(&self, albedo_scale: f32, results: &mut Results<'_>, careful: &mut Lanes<bool>) {
        let [x, y, z] = &self.scaled;
        let mut unit = [Lanes::of(0.0); 3];
        let mut all_sound = true;
        for lane in 0..LANES {
            let scaled = [x[lane], y[lane], z[lane]];
            let square = dot::<FMA>(scaled, scaled);
            let faces = scaled[2] > 0.0;
            let inverse = if faces { 1.0 / square.sqrt() } else { f32::NAN };
            for axis in 0..3 {
                unit[axis][lane] = scaled[axis] * inverse;
            }
            results.albedo[lane] = square * inverse * albedo_scale;
            // See `confidence`: over the squared standard error and itself, which rounding could make less than zero.
            let freedom = self.freedom[lane] * square * square;
            let certainty = freedom / add_product::<FMA>(freedom, self.unexplained[lane], self.turning[lane]);
            results.confidence[lane] = if faces & (certainty > 0.0) { certainty } else { 0.0 };
            results.mask[lane] = faces;
            let in_range = (square > MIN_SQUARE) & (square < 1.0 / MIN_SQUARE);
            let sound = self.usable[lane] & in_range & (scaled[2] * scaled[2] > square * (GRAZING * GRAZING));
            careful[lane] = !sound;
            all_sound &= sound;
        }
        if !all_sound {
            for lane in 0..LANES {
                // What is zero has no solution either way.
                careful[lane] &= (x[lane] != 0.0) | (y[lane] != 0.0) | (z[lane] != 0.0);
            }
        }
        for lane in 0..LANES {
            for axis in 0..3 {
                results.normals[3 * lane + axis] = unit[axis][lane];
            }
        }
    }
}

/// Adds `column value` and `value^2` of some lights.
#[inline(always)]
fn add_up<const FMA: bool, const COUNT: usize>(
    values: &[Lanes<f32>; COUNT],
    columns: &[[f32; 3]; COUNT],
    [x, y, z, squares]: [&mut Lanes<f32>; 4],
) {
    for lane in 0..LANES {
        let [mut a, mut b, mut c, mut square] = [x[lane], y[lane], z[lane], squares[lane]];
        for light in 0..COUNT {
            let (value, column) = (values[light][lane], columns[light]);
            a = add_product::<FMA>(a, value, column[0]);
            b = add_product::<FMA>(b, value, column[1]);
            c = add_product::<FMA>(c, value, column[2]);
            square = add_product::<FMA>(square, value, value);
        }
        (x[lane], y[lane], z[lane], squares[lane]) = (a, b, c, square);
    }
}

/// Degrees of freedom of so many kept lights, as [`misfit_freedom`] says.
#[inline(always)]
fn freedom(kept: f32) -> f32 {
    let (one, most) = (misfit_freedom(3.0) * HALF2, misfit_freedom(f64::INFINITY) * HALF2);
    let freedom = (kept - 2.0) * one as f32;
    if freedom < most as f32 { freedom } else { most as f32 }
}
