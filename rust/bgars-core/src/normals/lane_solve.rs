//! Least squares on a block of pixels at once, in `f32`.
//!
//! A subset of lights whose equations are too badly conditioned for `f32` is left to the careful kernel, pixel by pixel.

use nalgebra::{Matrix3, Vector3};

use super::cutoff::{LANES, Lanes, cutoffs};
use super::gram::{BYTE_LIGHTS, ENTRIES, GramTables};
use super::kept::Kept;
use super::robust_lanes::{self, RobustLanes};
use crate::lights::conditioning;
use crate::{Lights, Pixel};

/// Subsets of lights below this [`conditioning`] are solved in `f64`: one refinement in `f32` no longer makes up for rounding.
const MIN_LANE_CONDITIONING: f64 = 1e-3;

/// Below this one, they are refined; above, rounding turns a normal by less than 2e-4 degrees (held by
/// `tests/property/test_normals_twin.py`).
const MIN_ROUGH_CONDITIONING: f32 = 0.1;

/// What a block of pixels leaves undone: bit k is set where pixel k wants the careful solver.
pub(super) type Careful = u64;

/// Which lights a block keeps.
#[derive(Debug)]
pub(super) enum Choice {
    /// All of them.
    All,
    /// Up to the first gap of the sorted values, in linear grey levels.
    UpToGap(f32),
    /// The window that a Lambertian facet explains best.
    Window(RobustLanes),
}

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct LaneSolver {
    pub choice: Choice,
    /// Unit vectors to the lights.
    directions: Vec<[f32; 3]>,
    /// `(L^T L)^-1 L^T`, a column a light.
    pseudo_inverse: Vec<[f32; 3]>,
    /// `(L^T L)^-1` of all lights.
    all: [f32; ENTRIES],
    /// `L^T L` of all lights.
    gram: [f32; ENTRIES],
    /// `L^T L` of any lights, a table for every eight of them.
    tables: Vec<GramTables>,
}

impl LaneSolver {
    /// `None` where the lanes cannot serve: near lights, or lights that are badly conditioned even together.
    pub fn new(lights: &Lights, choice: Choice) -> Option<Self> {
        let Lights::Directional(directions) = lights else { return None };
        let gram = directions.iter().fold(Matrix3::zeros(), |gram, light| gram + light * light.transpose());
        let exact = gram.try_inverse().filter(|_| conditioning(&gram) >= MIN_LANE_CONDITIONING)?;
        let pseudo_inverse = directions.iter().map(|light| single(&(exact * light))).collect();
        let directions: Vec<[f32; 3]> = directions.iter().map(single).collect();
        let tables = directions.chunks(BYTE_LIGHTS).map(GramTables::new).collect();
        Some(Self { choice, directions, pseudo_inverse, all: upper(&exact), gram: upper(&gram), tables })
    }

    /// Their number.
    pub fn lights(&self) -> usize {
        self.directions.len()
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

/// Chooses and solves; with `FMA`, products are added without rounding between, for processors that do so in one step.
///
/// `clipped` has a bit a light.
#[inline(always)]
pub(super) fn solve<K: Pixel, const FMA: bool>(
    solver: &LaneSolver,
    keys: &[&Lanes<K>],
    clipped: &Lanes<u8>,
    kept: &mut Kept<K>,
    offset: Option<&Lanes<f32>>,
    out: &mut Solutions,
) {
    let mut careful = 0;
    let all = match &solver.choice {
        Choice::All => true,
        Choice::UpToGap(gap) => kept.choose(keys, &cutoffs(keys, K::gap(*gap))),
        Choice::Window(robust) => {
            let mut bits = [0; LANES];
            let mut values = [[0.0; LANES]; BYTE_LIGHTS];
            for (values, &&key) in values.iter_mut().zip(keys) {
                for lane in 0..LANES {
                    values[lane] = key[lane].to_f32() - offset.map_or(0.0, |offset| offset[lane]);
                }
            }
            careful = robust_lanes::choose(robust, &solver.directions, &values, clipped, &mut bits);
            kept.choose_bits(keys, &bits)
        }
    };
    if all {
        solve_all::<K, FMA>(solver, keys, offset, out);
    } else {
        solve_kept::<K, FMA>(solver, kept, offset, out);
    }
    out.careful |= careful;
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
fn solve_all<K: Pixel, const FMA: bool>(
    solver: &LaneSolver,
    keys: &[&Lanes<K>],
    offset: Option<&Lanes<f32>>,
    out: &mut Solutions,
) {
    let mut sums = [[0.0f32; LANES]; 4];
    by_chunks!(keys, solver.pseudo_inverse.as_slice(), |keys, columns, _first| {
        let keys = keys.map(|key| *key);
        add_products::<FMA, _>(columns, &mut sums, |light, lane| {
            offset.map_or(keys[light][lane].to_f32(), |offset| keys[light][lane].to_f32() - offset[lane])
        });
    });
    for lane in 0..LANES {
        let [x, y, z, squares] = std::array::from_fn(|sum| sums[sum][lane]);
        // |I|^2 - |L g|^2; what rounding leaves is far below the prior of 2 %.
        let explained = along::<FMA>(solver.gram, [x, y, z]);
        out.squared_residuals[lane] = if squares > explained { squares - explained } else { 0.0 };
        out.along[lane] = along::<FMA>(solver.all, [x, y, z]);
        out.trace[lane] = solver.all[0] + solver.all[3] + solver.all[5];
        [out.scaled[0][lane], out.scaled[1][lane], out.scaled[2][lane]] = [x, y, z];
        out.kept[lane] = keys.len() as u16;
    }
    out.careful = 0;
}

/// Some lights of some lanes are dropped: the normal equations of each lane.
#[inline(always)]
fn solve_kept<K: Pixel, const FMA: bool>(
    solver: &LaneSolver,
    kept: &Kept<K>,
    offset: Option<&Lanes<f32>>,
    out: &mut Solutions,
) {
    let mut gram = [[0.0f32; LANES]; ENTRIES];
    for (tables, bits) in solver.tables.iter().zip(&kept.bits) {
        tables.add(bits, &mut gram);
    }
    let mut sums = [[0.0f32; LANES]; 4];
    by_chunks!(kept.keys.as_slice(), solver.directions.as_slice(), |keys, directions, first| {
        let (keys, bits) = (*keys, kept.bits[first / BYTE_LIGHTS]);
        add_products::<FMA, _>(directions, &mut sums, |light, lane| {
            // A dropped key is zero already, but not less an offset.
            offset.map_or(keys[light][lane].to_f32(), |offset| {
                let is_kept = bits[lane] >> (first % BYTE_LIGHTS + light) & 1 == 1;
                if is_kept { keys[light][lane].to_f32() - offset[lane] } else { 0.0 }
            })
        });
    });
    let [mut unusable, mut rough] = [[0u8; LANES]; 2];
    for lane in 0..LANES {
        let Inverse { entries: inverse, determinant, largest } = inverse_of::<FMA>(&gram, lane);
        let [x, y, z, squares] = std::array::from_fn(|sum| sums[sum][lane]);
        let facet = product::<FMA>(inverse, [x, y, z]);
        let explained = dot::<FMA>(facet, [x, y, z]);
        out.squared_residuals[lane] = if squares > explained { squares - explained } else { 0.0 };
        out.along[lane] = dot::<FMA>(facet, product::<FMA>(inverse, facet));
        out.trace[lane] = inverse[0] + inverse[3] + inverse[5];
        [out.scaled[0][lane], out.scaled[1][lane], out.scaled[2][lane]] = facet;
        // Written so that NaN is unusable.
        unusable[lane] = u8::from(!(determinant > MIN_LANE_CONDITIONING as f32 * largest));
        rough[lane] = u8::from(determinant < MIN_ROUGH_CONDITIONING * largest);
    }
    out.kept = kept.counts();
    if rough.iter().fold(0, |any, rough| any | rough) != 0 {
        refine::<K, FMA>(solver, kept, offset, &gram, &rough, out);
    }
    out.careful = 0;
    if unusable.iter().fold(0, |any, unusable| any | unusable) != 0 {
        for (lane, &unusable) in unusable.iter().enumerate() {
            out.careful |= Careful::from(unusable) << lane;
        }
    }
}

/// One step of iterative refinement in the lanes that ask for it: what the residuals of the lights correct.
#[inline(always)]
fn refine<K: Pixel, const FMA: bool>(
    solver: &LaneSolver,
    kept: &Kept<K>,
    offset: Option<&Lanes<f32>>,
    gram: &[Lanes<f32>; ENTRIES],
    rough: &Lanes<u8>,
    out: &mut Solutions,
) {
    let mut sums = [[0.0f32; LANES]; 4];
    by_chunks!(kept.keys.as_slice(), solver.directions.as_slice(), |keys, directions, first| {
        let (keys, bits) = (*keys, kept.bits[first / BYTE_LIGHTS]);
        add_products::<FMA, _>(directions, &mut sums, |light, lane| {
            let value = keys[light][lane].to_f32() - offset.map_or(0.0, |offset| offset[lane]);
            let residual = value - dot::<FMA>(directions[light], std::array::from_fn(|axis| out.scaled[axis][lane]));
            let is_kept = bits[lane] >> (first % BYTE_LIGHTS + light) & 1 == 1;
            if is_kept { residual } else { 0.0 }
        });
    });
    for lane in 0..LANES {
        let correction =
            product::<FMA>(inverse_of::<FMA>(gram, lane).entries, std::array::from_fn(|axis| sums[axis][lane]));
        for (scaled, correction) in out.scaled.iter_mut().zip(correction) {
            scaled[lane] += if rough[lane] == 1 { correction } else { 0.0 };
        }
    }
}

/// `sums += (vector * value, value^2)` over the lights of a chunk; `value_of` takes the light and the lane.
#[inline(always)]
fn add_products<const FMA: bool, const C: usize>(
    vectors: &[[f32; 3]; C],
    sums: &mut [Lanes<f32>; 4],
    value_of: impl Fn(usize, usize) -> f32,
) {
    for lane in 0..LANES {
        let [mut x, mut y, mut z, mut square] = std::array::from_fn(|sum| sums[sum][lane]);
        for (light, &[a, b, c]) in vectors.iter().enumerate() {
            let value = value_of(light, lane);
            x = add_product::<FMA>(x, a, value);
            y = add_product::<FMA>(y, b, value);
            z = add_product::<FMA>(z, c, value);
            square = add_product::<FMA>(square, value, value);
        }
        [sums[0][lane], sums[1][lane], sums[2][lane], sums[3][lane]] = [x, y, z, square];
    }
}

/// `sum + a b`.
#[inline(always)]
pub(super) fn add_product<const FMA: bool>(sum: f32, a: f32, b: f32) -> f32 {
    if FMA { a.mul_add(b, sum) } else { sum + a * b }
}

#[inline(always)]
pub(super) fn dot<const FMA: bool>([a, b, c]: [f32; 3], [x, y, z]: [f32; 3]) -> f32 {
    add_product::<FMA>(add_product::<FMA>(a * x, b, y), c, z)
}

/// `g^T C g`.
#[inline(always)]
fn along<const FMA: bool>(matrix: [f32; ENTRIES], facet: [f32; 3]) -> f32 {
    dot::<FMA>(facet, product::<FMA>(matrix, facet))
}

/// A symmetric matrix times a vector.
#[inline(always)]
fn product<const FMA: bool>([xx, xy, xz, yy, yz, zz]: [f32; ENTRIES], vector: [f32; 3]) -> [f32; 3] {
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]].map(|row| dot::<FMA>(row, vector))
}

/// The inverse of a Gram matrix; `determinant / largest` is its conditioning.
struct Inverse {
    entries: [f32; ENTRIES],
    determinant: f32,
    /// The largest determinant at this trace.
    largest: f32,
}

#[inline(always)]
fn inverse_of<const FMA: bool>(gram: &[Lanes<f32>; ENTRIES], lane: usize) -> Inverse {
    let [xx, xy, xz, yy, yz, zz] = std::array::from_fn(|entry| gram[entry][lane]);
    let minor = |a: f32, b: f32, c: f32, d: f32| add_product::<FMA>(a * b, -c, d);
    let cofactors = [
        minor(yy, zz, yz, yz),
        minor(xz, yz, xy, zz),
        minor(xy, yz, xz, yy),
        minor(xx, zz, xz, xz),
        minor(xy, xz, xx, yz),
        minor(xx, yy, xy, xy),
    ];
    let determinant = dot::<FMA>([xx, xy, xz], [cofactors[0], cofactors[1], cofactors[2]]);
    let third = (xx + yy + zz) * (1.0 / 3.0);
    let scale = 1.0 / determinant;
    Inverse { entries: cofactors.map(|cofactor| cofactor * scale), determinant, largest: third * third * third }
}

/// The entries of the upper triangle: xx, xy, xz, yy, yz, zz.
fn upper(matrix: &Matrix3<f64>) -> [f32; ENTRIES] {
    [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|entry| matrix[entry] as f32)
}

fn single(vector: &Vector3<f64>) -> [f32; 3] {
    [vector.x as f32, vector.y as f32, vector.z as f32]
}
