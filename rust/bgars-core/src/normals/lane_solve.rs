//! Least squares on a block of pixels at once, in `f32`.
//!
//! A subset of lights whose equations are too badly conditioned for `f32` is left to the careful kernel, pixel by pixel.

use nalgebra::{Matrix3, Vector3};

use super::cutoff::{LANES, Lanes, cutoffs};
use crate::lights::conditioning;
use crate::{Lights, Pixel};

/// Subsets of lights below this [`conditioning`] are solved in `f64`: one refinement in `f32` no longer makes up for rounding.
const MIN_LANE_CONDITIONING: f64 = 1e-3;

/// What a block of pixels leaves undone: bit k is set where pixel k wants the careful solver.
pub(super) type Careful = u64;

/// Which lights a block keeps.
#[derive(Clone, Copy, Debug)]
pub(super) enum Choice {
    /// All of them.
    All,
    /// Up to the first gap of the sorted values, in linear grey levels.
    UpToGap(f32),
}

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct LaneSolver {
    pub choice: Choice,
    /// Unit vectors to the lights.
    directions: Vec<[f32; 3]>,
    /// `(L^T L)^-1 L^T`, a column a light.
    pseudo_inverse: Vec<[f32; 3]>,
    all: [f32; 6],
    /// `L^T L` of all lights: xx, xy, xz, yy, yz, zz.
    gram: [f32; 6],
}

impl LaneSolver {
    /// `None` where the lanes cannot serve: near lights, or lights that are badly conditioned even together.
    pub fn new(lights: &Lights, choice: Choice) -> Option<Self> {
        let Lights::Directional(directions) = lights else { return None };
        let gram = directions.iter().fold(Matrix3::zeros(), |gram, light| gram + light * light.transpose());
        let exact = gram.try_inverse().filter(|_| conditioning(&gram) >= MIN_LANE_CONDITIONING)?;
        Some(Self {
            choice,
            directions: directions.iter().map(single).collect(),
            pseudo_inverse: directions.iter().map(|light| single(&(exact * light))).collect(),
            all: upper(&exact),
            gram: upper(&gram),
        })
    }
}

/// The least squares of a block.
pub(super) struct Solutions {
    /// `rho n`, by component.
    pub scaled: [Lanes<f32>; 3],
    pub squared_residuals: Lanes<f32>,
    /// `tr C`, `C` the inverse in use.
    pub trace: Lanes<f32>,
    /// `g^T C g` of `g = rho n`.
    pub along: Lanes<f32>,
    pub kept: Lanes<u16>,
    pub careful: Careful,
}

impl Solutions {
    pub fn new() -> Self {
        let zeros = [0.0; LANES];
        Self { scaled: [zeros; 3], squared_residuals: zeros, trace: zeros, along: zeros, kept: [0; LANES], careful: 0 }
    }
}

/// Chooses and solves; `keys` of a length known to the compiler are unrolled. `masks` is scratch of the same length.
#[inline(always)]
pub(super) fn solve<K: Pixel>(
    solver: &LaneSolver,
    keys: &[Lanes<K>],
    masks: &mut [Lanes<u8>],
    offset: Option<&Lanes<f32>>,
    out: &mut Solutions,
) {
    match solver.choice {
        Choice::All => solve_all(solver, keys, offset, out),
        Choice::UpToGap(gap) => {
            let cutoffs = cutoffs(keys, K::gap(gap));
            let mut kept_by_all = 1;
            for (mask, key) in masks.iter_mut().zip(keys) {
                for lane in 0..LANES {
                    mask[lane] = u8::from(is_kept(key[lane], cutoffs[lane]));
                    kept_by_all &= mask[lane];
                }
            }
            if kept_by_all == 1 {
                solve_all(solver, keys, offset, out);
            } else {
                solve_kept(solver, keys, masks, offset, out);
            }
        }
    }
}

/// The linear value of a light in one lane.
#[inline(always)]
fn value<K: Pixel>(key: K, offset: Option<&Lanes<f32>>, lane: usize) -> f32 {
    offset.map_or(key.to_f32(), |offset| key.to_f32() - offset[lane])
}

/// Calls `$body` for the lights by eights, then fours, then one by one: `$keys`, `$vectors` are arrays of that size, over
/// which the compiler unrolls, and `$first` is the first light.
macro_rules! by_chunks {
    ($all_keys:expr, $all_vectors:expr, |$keys:ident, $vectors:ident, $first:ident| $body:expr) => {{
        let (mut keys_left, mut vectors_left) = ($all_keys, $all_vectors);
        let mut $first = 0;
        by_chunks!(@size 8, keys_left, vectors_left, $keys, $vectors, $first, $body);
        by_chunks!(@size 4, keys_left, vectors_left, $keys, $vectors, $first, $body);
        by_chunks!(@size 1, keys_left, vectors_left, $keys, $vectors, $first, $body);
        let _ = ($first, keys_left, vectors_left);
    }};
    (@size $size:literal, $keys_left:ident, $vectors_left:ident, $keys:ident, $vectors:ident, $first:ident, $body:expr) => {
        while let (Some(($keys, keys_rest)), Some(($vectors, vectors_rest))) =
            ($keys_left.split_first_chunk::<$size>(), $vectors_left.split_first_chunk::<$size>())
        {
            $body;
            ($keys_left, $vectors_left) = (keys_rest, vectors_rest);
            $first += $size;
        }
    };
}

/// Every light of every lane is kept: one matrix for all.
#[inline(always)]
fn solve_all<K: Pixel>(solver: &LaneSolver, keys: &[Lanes<K>], offset: Option<&Lanes<f32>>, out: &mut Solutions) {
    let mut sums = [[0.0f32; LANES]; 4];
    by_chunks!(keys, solver.pseudo_inverse.as_slice(), |keys, columns, _first| add_columns(
        keys, columns, offset, &mut sums
    ));
    for lane in 0..LANES {
        let [x, y, z, squares] = std::array::from_fn(|sum| sums[sum][lane]);
        // |I|^2 - |L g|^2; what rounding leaves is far below the prior of 2 %.
        let explained = along(solver.gram, [x, y, z]);
        out.squared_residuals[lane] = if squares > explained { squares - explained } else { 0.0 };
        out.along[lane] = along(solver.all, [x, y, z]);
        out.trace[lane] = solver.all[0] + solver.all[3] + solver.all[5];
        [out.scaled[0][lane], out.scaled[1][lane], out.scaled[2][lane]] = [x, y, z];
        out.kept[lane] = keys.len() as u16;
    }
    out.careful = 0;
}

/// `sums += (column * value, value^2)` over the lights of a chunk.
#[inline(always)]
fn add_columns<K: Pixel, const C: usize>(
    keys: &[Lanes<K>; C],
    columns: &[[f32; 3]; C],
    offset: Option<&Lanes<f32>>,
    sums: &mut [Lanes<f32>; 4],
) {
    for lane in 0..LANES {
        let [mut x, mut y, mut z, mut square] = std::array::from_fn(|sum| sums[sum][lane]);
        for light in 0..C {
            let value = value(keys[light][lane], offset, lane);
            let [a, b, c] = columns[light];
            x += a * value;
            y += b * value;
            z += c * value;
            square += value * value;
        }
        [sums[0][lane], sums[1][lane], sums[2][lane], sums[3][lane]] = [x, y, z, square];
    }
}

/// Some lights of some lanes are dropped: normal equations of each lane, refined once.
#[inline(always)]
fn solve_kept<K: Pixel>(
    solver: &LaneSolver,
    keys: &[Lanes<K>],
    masks: &[Lanes<u8>],
    offset: Option<&Lanes<f32>>,
    out: &mut Solutions,
) {
    let directions = solver.directions.as_slice();
    out.kept = [0; LANES];
    let mut gram = [[0.0f32; LANES]; 6];
    by_chunks!(masks, directions, |masks, directions, _first| {
        count(masks, &mut out.kept);
        add_gram(masks, directions, &mut gram);
    });
    let inverses = inverses_of(&gram);
    let mut sums = [[0.0f32; LANES]; 3];
    by_chunks!(keys, directions, |keys, directions, first| {
        add_kept(keys, directions, &masks[first..], offset, &mut sums);
    });
    for lane in 0..LANES {
        let [x, y, z] = product(&inverses, &sums, lane);
        [out.scaled[0][lane], out.scaled[1][lane], out.scaled[2][lane]] = [x, y, z];
    }
    // One step of iterative refinement: the residual of each light, and what it corrects.
    let mut corrections = [[0.0f32; LANES]; 3];
    out.squared_residuals = [0.0; LANES];
    by_chunks!(keys, directions, |keys, directions, first| {
        add_residuals(keys, directions, &masks[first..], offset, &mut corrections, out);
    });
    let mut usable = true;
    for lane in 0..LANES {
        let correction = product(&inverses, &corrections, lane);
        let facet: [f32; 3] = std::array::from_fn(|axis| out.scaled[axis][lane] + correction[axis]);
        [out.scaled[0][lane], out.scaled[1][lane], out.scaled[2][lane]] = facet;
        let inverse: [f32; 6] = std::array::from_fn(|entry| inverses[entry][lane]);
        out.along[lane] = along(inverse, facet);
        out.trace[lane] = inverse[0] + inverse[3] + inverse[5];
        usable &= inverse[0] != 0.0;
    }
    out.careful = 0;
    if !usable {
        for lane in 0..LANES {
            out.careful |= Careful::from(inverses[0][lane] == 0.0) << lane;
        }
    }
}

/// True for a light that is kept.
#[inline(always)]
pub(super) fn is_kept<K: Pixel>(key: K, cutoff: K) -> bool {
    !key.is_over(cutoff, K::gap(0.0))
}

/// `counts += 1` for the kept lights of a chunk.
#[inline(always)]
fn count<const C: usize>(masks: &[Lanes<u8>; C], counts: &mut Lanes<u16>) {
    let mut ones = [0u8; LANES];
    for mask in masks {
        for lane in 0..LANES {
            ones[lane] += mask[lane];
        }
    }
    for lane in 0..LANES {
        counts[lane] += u16::from(ones[lane]);
    }
}

/// `sums += direction * value` over the kept lights of a chunk.
#[inline(always)]
fn add_kept<K: Pixel, const C: usize>(
    keys: &[Lanes<K>; C],
    directions: &[[f32; 3]; C],
    masks: &[Lanes<u8>],
    offset: Option<&Lanes<f32>>,
    sums: &mut [Lanes<f32>; 3],
) {
    let masks = &masks[..C];
    for lane in 0..LANES {
        let [mut x, mut y, mut z] = std::array::from_fn(|sum| sums[sum][lane]);
        for light in 0..C {
            let value = value(keys[light][lane], offset, lane);
            let value = if masks[light][lane] == 1 { value } else { 0.0 };
            let [a, b, c] = directions[light];
            x += a * value;
            y += b * value;
            z += c * value;
        }
        [sums[0][lane], sums[1][lane], sums[2][lane]] = [x, y, z];
    }
}

/// `sums += direction * residual` over the kept lights of a chunk, for the facets in `out`, and the squares to `out`.
#[inline(always)]
fn add_residuals<K: Pixel, const C: usize>(
    keys: &[Lanes<K>; C],
    directions: &[[f32; 3]; C],
    masks: &[Lanes<u8>],
    offset: Option<&Lanes<f32>>,
    sums: &mut [Lanes<f32>; 3],
    out: &mut Solutions,
) {
    let masks = &masks[..C];
    for lane in 0..LANES {
        let [mut x, mut y, mut z] = std::array::from_fn(|sum| sums[sum][lane]);
        let mut square = out.squared_residuals[lane];
        let [u, v, w] = std::array::from_fn(|axis| out.scaled[axis][lane]);
        for light in 0..C {
            let [a, b, c] = directions[light];
            let difference = value(keys[light][lane], offset, lane) - (a * u + b * v + c * w);
            let residual = if masks[light][lane] == 1 { difference } else { 0.0 };
            x += a * residual;
            y += b * residual;
            z += c * residual;
            square += residual * residual;
        }
        [sums[0][lane], sums[1][lane], sums[2][lane]] = [x, y, z];
        out.squared_residuals[lane] = square;
    }
}

/// `gram += direction direction^T` over the kept lights of a chunk.
#[inline(always)]
fn add_gram<const C: usize>(masks: &[Lanes<u8>; C], directions: &[[f32; 3]; C], gram: &mut [Lanes<f32>; 6]) {
    for lane in 0..LANES {
        let mut sums: [f32; 6] = std::array::from_fn(|entry| gram[entry][lane]);
        for (&[a, b, c], mask) in directions.iter().zip(masks) {
            for (sum, product) in sums.iter_mut().zip([a * a, a * b, a * c, b * b, b * c, c * c]) {
                *sum += if mask[lane] == 1 { product } else { 0.0 };
            }
        }
        for (gram, sum) in gram.iter_mut().zip(sums) {
            gram[lane] = sum;
        }
    }
}

/// `g^T C g`.
#[inline(always)]
fn along([xx, xy, xz, yy, yz, zz]: [f32; 6], [x, y, z]: [f32; 3]) -> f32 {
    x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + z * (zz * z)
}

/// A lane's matrix times its vector.
#[inline(always)]
fn product(inverses: &[Lanes<f32>; 6], vectors: &[Lanes<f32>; 3], lane: usize) -> [f32; 3] {
    let [xx, xy, xz, yy, yz, zz] = std::array::from_fn(|entry| inverses[entry][lane]);
    let [x, y, z] = std::array::from_fn(|axis| vectors[axis][lane]);
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

/// The inverses of Gram matrices; zero where they are not to be used.
#[inline(always)]
fn inverses_of(gram: &[Lanes<f32>; 6]) -> [Lanes<f32>; 6] {
    let mut inverses = [[0.0f32; LANES]; 6];
    for lane in 0..LANES {
        let [xx, xy, xz, yy, yz, zz] = std::array::from_fn(|entry| gram[entry][lane]);
        let cofactors = [yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy];
        let determinant = xx * cofactors[0] + xy * cofactors[1] + xz * cofactors[2];
        let third = (xx + yy + zz) / 3.0;
        let usable = determinant > MIN_LANE_CONDITIONING as f32 * (third * third * third);
        let scale = if usable { 1.0 / determinant } else { 0.0 };
        let entries =
            [cofactors[0], cofactors[1], cofactors[2], xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy];
        for (inverse, entry) in inverses.iter_mut().zip(entries) {
            inverse[lane] = entry * scale;
        }
    }
    inverses
}

/// The entries of the upper triangle: xx, xy, xz, yy, yz, zz.
fn upper(matrix: &Matrix3<f64>) -> [f32; 6] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|entry| matrix[entry] as f32)
}

fn single(vector: &Vector3<f64>) -> [f32; 3] {
    [vector.x as f32, vector.y as f32, vector.z as f32]
}
