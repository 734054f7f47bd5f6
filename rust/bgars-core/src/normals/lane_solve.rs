//! Least squares on a block of pixels at once, in `f32`.
//!
//! A subset of lights whose equations are too badly conditioned for `f32` is left to the careful kernel, pixel by pixel.

use nalgebra::{Matrix3, Vector3};

use super::cutoff::{LANES, Lanes, cutoffs};
use super::solve::MAX_TABLE_LIGHTS;
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

/// The six entries of a symmetric inverse, padded to a power of two; all zero where it is not to be used.
type Inverse = [f32; 8];

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
    /// The inverse for every subset (bit k: light k); empty for more than 12 lights.
    table: Vec<Inverse>,
}

impl LaneSolver {
    /// `None` where the lanes cannot serve: near lights, or lights that are badly conditioned even together.
    pub fn new(lights: &Lights, choice: Choice) -> Option<Self> {
        let Lights::Directional(directions) = lights else { return None };
        let gram = directions.iter().fold(Matrix3::zeros(), |gram, light| gram + light * light.transpose());
        let exact = gram.try_inverse().filter(|_| conditioning(&gram) >= MIN_LANE_CONDITIONING)?;
        let of_subset = |subset: usize| {
            let lights = directions.iter().enumerate().filter(|(light, _)| subset >> light & 1 == 1);
            inverse(&lights.fold(Matrix3::zeros(), |gram, (_, light)| gram + light * light.transpose()))
        };
        let tabulated = directions.len() <= MAX_TABLE_LIGHTS && matches!(choice, Choice::UpToGap(_));
        Some(Self {
            choice,
            directions: directions.iter().map(single).collect(),
            pseudo_inverse: directions.iter().map(|light| single(&(exact * light))).collect(),
            all: upper(&exact),
            gram: upper(&gram),
            table: if tabulated { (0..1 << directions.len()).map(of_subset).collect() } else { Vec::new() },
        })
    }
}

/// The least squares of a block.
pub(super) struct Solutions {
    /// `rho n`, by component.
    pub scaled: [Lanes<f32>; 3],
    pub squared_residuals: Lanes<f32>,
    /// `tr C - n^T C n`, `C` the inverse in use.
    pub turning: Lanes<f32>,
    pub kept: Lanes<u16>,
    pub careful: Careful,
}

/// Chooses and solves; `keys` of a length known to the compiler are unrolled. `masks` is scratch of the same length.
#[inline(always)]
pub(super) fn solve<K: Pixel>(
    solver: &LaneSolver,
    keys: &[Lanes<K>],
    masks: &mut [Lanes<u8>],
    offset: Option<&Lanes<f32>>,
) -> Solutions {
    match solver.choice {
        Choice::All => solve_all(solver, keys, offset),
        Choice::UpToGap(gap) => {
            let cutoffs = cutoffs(keys, K::gap(gap));
            let mut kept_by_all = 1;
            for (mask, key) in masks.iter_mut().zip(keys) {
                for lane in 0..LANES {
                    mask[lane] = u8::from(is_kept(key[lane], cutoffs[lane]));
                    kept_by_all &= mask[lane];
                }
            }
            if kept_by_all == 1 { solve_all(solver, keys, offset) } else { solve_kept(solver, keys, masks, offset) }
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
fn solve_all<K: Pixel>(solver: &LaneSolver, keys: &[Lanes<K>], offset: Option<&Lanes<f32>>) -> Solutions {
    let mut sums = [[0.0f32; LANES]; 4];
    by_chunks!(keys, solver.pseudo_inverse.as_slice(), |keys, columns, _first| add_columns(
        keys, columns, offset, &mut sums
    ));
    let [scaled @ .., squares] = sums;
    let [xx, xy, xz, yy, yz, zz] = solver.gram;
    let mut turning = [0.0f32; LANES];
    let mut residuals = [0.0f32; LANES];
    for lane in 0..LANES {
        let [x, y, z] = [scaled[0][lane], scaled[1][lane], scaled[2][lane]];
        // |I|^2 - |L g|^2; what rounding leaves is far below the prior of 2 %.
        let explained = x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + z * (zz * z);
        residuals[lane] = if squares[lane] > explained { squares[lane] - explained } else { 0.0 };
        turning[lane] = turning_of(&solver.all, [x, y, z]);
    }
    let kept = [keys.len() as u16; LANES];
    Solutions { scaled, squared_residuals: residuals, turning, kept, careful: 0 }
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
) -> Solutions {
    let directions = solver.directions.as_slice();
    let mut kept = [0u16; LANES];
    let mut subsets = [0u16; LANES];
    by_chunks!(masks, directions, |masks, _directions, first| count(masks, first, &mut kept, &mut subsets));
    let inverses = if solver.table.is_empty() {
        let mut gram = [[0.0f32; LANES]; 6];
        by_chunks!(masks, directions, |masks, directions, _first| add_gram(masks, directions, &mut gram));
        inverses_of(&gram)
    } else {
        tabulated_inverses(&solver.table, &subsets)
    };
    let mut sums = [[0.0f32; LANES]; 3];
    by_chunks!(keys, directions, |keys, directions, first| {
        add_kept(keys, directions, &masks[first..], offset, &mut sums);
    });
    let mut scaled = product(&inverses, &sums);
    // One step of iterative refinement: the residual of each light, and what it corrects.
    let mut corrections = [[0.0f32; LANES]; 4];
    by_chunks!(keys, directions, |keys, directions, first| {
        add_residuals(keys, directions, &masks[first..], offset, &scaled, &mut corrections);
    });
    let [corrections @ .., squared_residuals] = corrections;
    let correction = product(&inverses, &corrections);
    let mut turning = [0.0f32; LANES];
    let mut careful = 0;
    for lane in 0..LANES {
        for axis in 0..3 {
            scaled[axis][lane] += correction[axis][lane];
        }
        let inverse = std::array::from_fn(|entry| inverses[entry][lane]);
        turning[lane] = turning_of(&inverse, [scaled[0][lane], scaled[1][lane], scaled[2][lane]]);
    }
    let unusable = |lane: usize| inverses[0][lane] == 0.0;
    if (0..LANES).fold(false, |any, lane| any | unusable(lane)) {
        careful = (0..LANES).fold(0, |bits, lane| bits | Careful::from(unusable(lane)) << lane);
    }
    Solutions { scaled, squared_residuals, turning, kept, careful }
}

/// True for a light that is kept.
#[inline(always)]
pub(super) fn is_kept<K: Pixel>(key: K, cutoff: K) -> bool {
    !key.is_over(cutoff, K::gap(0.0))
}

/// The kept lights of a chunk: how many, and which as bits from `first` on (of no use beyond 16 lights).
#[inline(always)]
fn count<const C: usize>(masks: &[Lanes<u8>; C], first: usize, counts: &mut Lanes<u16>, subsets: &mut Lanes<u16>) {
    let [mut bits, mut ones] = [[0u8; LANES]; 2];
    for (light, mask) in masks.iter().enumerate() {
        for lane in 0..LANES {
            ones[lane] += mask[lane];
            bits[lane] |= mask[lane].wrapping_neg() & (1 << light);
        }
    }
    for lane in 0..LANES {
        counts[lane] += u16::from(ones[lane]);
        subsets[lane] |= u16::from(bits[lane]).unbounded_shl(first as u32);
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

/// `sums += (direction * residual, residual^2)` over the kept lights of a chunk, `scaled` being the solution so far.
#[inline(always)]
fn add_residuals<K: Pixel, const C: usize>(
    keys: &[Lanes<K>; C],
    directions: &[[f32; 3]; C],
    masks: &[Lanes<u8>],
    offset: Option<&Lanes<f32>>,
    scaled: &[Lanes<f32>; 3],
    sums: &mut [Lanes<f32>; 4],
) {
    let masks = &masks[..C];
    for lane in 0..LANES {
        let [mut x, mut y, mut z, mut square] = std::array::from_fn(|sum| sums[sum][lane]);
        let [u, v, w] = std::array::from_fn(|axis| scaled[axis][lane]);
        for light in 0..C {
            let [a, b, c] = directions[light];
            let difference = value(keys[light][lane], offset, lane) - (a * u + b * v + c * w);
            let residual = if masks[light][lane] == 1 { difference } else { 0.0 };
            x += a * residual;
            y += b * residual;
            z += c * residual;
            square += residual * residual;
        }
        [sums[0][lane], sums[1][lane], sums[2][lane], sums[3][lane]] = [x, y, z, square];
    }
}

/// `gram += direction direction^T` over the kept lights of a chunk.
#[inline(always)]
fn add_gram<const C: usize>(masks: &[Lanes<u8>; C], directions: &[[f32; 3]; C], gram: &mut [Lanes<f32>; 6]) {
    for lane in 0..LANES {
        let mut sums: [f32; 6] = std::array::from_fn(|entry| gram[entry][lane]);
        for (&[a, b, c], mask) in directions.iter().zip(masks) {
            let weight = f32::from(mask[lane]);
            for (sum, product) in sums.iter_mut().zip([a * a, a * b, a * c, b * b, b * c, c * c]) {
                *sum += weight * product;
            }
        }
        for (gram, sum) in gram.iter_mut().zip(sums) {
            gram[lane] = sum;
        }
    }
}

/// `tr C - n^T C n` of `g = rho n`.
#[inline(always)]
fn turning_of(inverse: &[f32; 6], [x, y, z]: [f32; 3]) -> f32 {
    let [xx, xy, xz, yy, yz, zz] = *inverse;
    let along = x * (xx * x + 2.0 * (xy * y + xz * z)) + y * (yy * y + 2.0 * yz * z) + z * (zz * z);
    (xx + yy + zz) - along / (x * x + y * y + z * z)
}

#[inline(always)]
fn product(inverses: &[Lanes<f32>; 6], vectors: &[Lanes<f32>; 3]) -> [Lanes<f32>; 3] {
    let [xx, xy, xz, yy, yz, zz] = inverses;
    let mut out = [[0.0f32; LANES]; 3];
    for lane in 0..LANES {
        let [x, y, z] = [vectors[0][lane], vectors[1][lane], vectors[2][lane]];
        out[0][lane] = xx[lane] * x + xy[lane] * y + xz[lane] * z;
        out[1][lane] = xy[lane] * x + yy[lane] * y + yz[lane] * z;
        out[2][lane] = xz[lane] * x + yz[lane] * y + zz[lane] * z;
    }
    out
}

/// The inverse of each lane's subset of lights from the table.
#[inline(always)]
fn tabulated_inverses(table: &[Inverse], subsets: &Lanes<u16>) -> [Lanes<f32>; 6] {
    let mut inverses = [[0.0f32; LANES]; 6];
    for lane in 0..LANES {
        let entry = &table[usize::from(subsets[lane])];
        for (inverse, &entry) in inverses.iter_mut().zip(entry) {
            inverse[lane] = entry;
        }
    }
    inverses
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

fn inverse(gram: &Matrix3<f64>) -> Inverse {
    match gram.try_inverse() {
        Some(inverse) if conditioning(gram) >= MIN_LANE_CONDITIONING => {
            let [xx, xy, xz, yy, yz, zz] = upper(&inverse);
            [xx, xy, xz, yy, yz, zz, 0.0, 0.0]
        }
        _ => [0.0; 8],
    }
}

fn single(vector: &Vector3<f64>) -> [f32; 3] {
    [vector.x as f32, vector.y as f32, vector.z as f32]
}
