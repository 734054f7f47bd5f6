//! Least squares on a block of pixels at once, in `f32`.
//!
//! A subset of lights whose equations are too badly conditioned for `f32` is left to the careful kernel, pixel by pixel.

use nalgebra::{Matrix3, Vector3};

use super::ahead::Ahead;
use super::confidence::PRIOR_RESIDUAL;
use super::cutoff::{LANES, Lanes, cutoffs, cutoffs_from};
use super::finish::{Facets, Finished, all_bits, freedom, freedoms, inverse_length};
use super::finite::{are_finite, is_finite};
use super::kept::Kept;
use super::out::Block;
use super::overview::{SumsAndExtremes, SumsAndLargest};
use super::robust_lanes::{self, RobustLanes};
use super::sums::Sums;
use super::symmetric::{
    ENTRIES, Inverse, PrincipalAxes, PrincipalForm, dot, dot_less, form, inverse_row, outer, spread,
};
use crate::lights::conditioning;
use crate::vector::spread::Spread;
use crate::vector::subset_sums::SubsetSums;
use crate::vector::{RowTable, Vector};
use crate::{Lights, Pixel};

/// Subsets of lights below this [`conditioning`] are solved in `f64`: one refinement in `f32` no longer makes up for rounding.
const MIN_LANE_CONDITIONING: f64 = 1e-3;

/// Below this one, they are refined; above, rounding turns a normal by less than 2e-4 degrees (held by
/// `tests/property/test_normals_twin.py`).
const MIN_ROUGH_CONDITIONING: f32 = 0.1;

/// Lights in one byte of kept bits.
pub(super) const BYTE_LIGHTS: usize = 8;

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
    /// The same, as whole vectors.
    spread_directions: Vec<[Spread; 3]>,
    /// Of `L^T L` of all lights.
    axes: PrincipalAxes,
    /// `(L^T L)^-1 L^T` of all lights along these axes, a column a light.
    pub pseudo_inverse: Vec<[Spread; 3]>,
    /// Of the [prior](PRIOR_RESIDUAL) less `L^T L`: what is not explained, beside the squares of the values.
    unexplained: PrincipalForm,
    /// Of `(tr C) I - C`, `C = (L^T L)^-1`.
    turning: PrincipalForm,
    /// Of all lights.
    freedom: Spread,
    /// `(L^T L)^-1` of any of up to eight lights; `None` for more, and where all are kept.
    inverses: Option<RowTable>,
    /// `L^T L` of any lights, a table for every eight of them; for where there are no inverses.
    grams: Vec<SubsetSums<ENTRIES>>,
}

impl LaneSolver {
    /// `None` where the lanes cannot serve: near lights, or lights that are badly conditioned even together.
    pub fn new(lights: &Lights, choice: Choice) -> Option<Self> {
        let Lights::Directional(directions) = lights else { return None };
        let gram = directions.iter().fold(Matrix3::zeros(), |gram, light| gram + light * light.transpose());
        let exact = gram.try_inverse().filter(|_| conditioning(&gram) >= MIN_LANE_CONDITIONING)?;
        let axes = PrincipalAxes::of(&gram);
        let column = |light| single(&axes.along(&(exact * light))).map(Spread::new);
        let pseudo_inverse = directions.iter().map(column).collect();
        let chosen = !matches!(choice, Choice::All);
        let inverses = (chosen && directions.len() <= BYTE_LIGHTS).then(|| inverses_of(directions));
        let directions: Vec<[f32; 3]> = directions.iter().map(single).collect();
        let spread_directions = directions.iter().map(|light| light.map(Spread::new)).collect();
        let grams = directions
            .chunks(BYTE_LIGHTS)
            .map(|lights| SubsetSums::new(&lights.iter().map(outer).collect::<Vec<_>>()))
            .collect();
        let unexplained = PrincipalForm::new(axes.values.map(|value| PRIOR_RESIDUAL * PRIOR_RESIDUAL - value));
        let turning = PrincipalForm::new(axes.values.map(|value| exact.trace() - 1.0 / value));
        let freedom = Spread::new(freedom(directions.len()));
        Some(Self {
            choice,
            directions,
            spread_directions,
            axes,
            pseudo_inverse,
            unexplained,
            turning,
            freedom,
            inverses,
            grams,
        })
    }

    /// Their number.
    pub fn lights(&self) -> usize {
        self.directions.len()
    }
}

/// What a block of pixels reads.
pub(super) struct Readings<'a, K> {
    pub keys: &'a [&'a Lanes<K>],
    /// What is to be done meanwhile.
    pub ahead: Ahead<'a, K>,
    /// What is known of the keys, and of the sums over all of them less the offset.
    pub overview: Option<&'a SumsAndExtremes<K>>,
    /// A bit a light.
    pub clipped: &'a Lanes<u8>,
    /// To be subtracted from every key.
    pub offset: Option<&'a Lanes<f32>>,
    /// To be raised to the keys, where their largest is wanted.
    pub largest: Option<&'a mut Lanes<f32>>,
}

/// Chooses and solves.
#[inline(always)]
pub(super) fn solve<K: Pixel, V: Vector>(
    solver: &LaneSolver,
    readings: Readings<'_, K>,
    kept: &mut Kept<K>,
    per_full_scale: f32,
    out: &mut Finished,
    block: &mut Block<'_>,
) {
    let Readings { keys, ahead, overview, clipped, offset, largest } = readings;
    (out.careful, out.valid) = (0, 0);
    (out.keep_all, out.finite) = (true, true);
    let parts = ahead.parts(LANES / V::WIDTH);
    ahead.part(0, parts);
    if K::CODES.is_none() && (keys.len() > BYTE_LIGHTS || matches!(solver.choice, Choice::Window(_))) {
        out.finite = match overview {
            Some(overview) => overview.sums.are_finite::<V>(),
            None => are_finite::<K, V>(keys),
        };
    }
    match &solver.choice {
        Choice::All => {
            if let Some(largest) = largest {
                for key in keys {
                    raise(largest, key);
                }
            }
        }
        Choice::UpToGap(gap) => {
            let cutoffs = match overview {
                Some(overview) => cutoffs_from(keys, K::gap(*gap), &overview.extremes),
                None => cutoffs(keys, K::gap(*gap), V::HOLDS_BLOCKS),
            };
            if K::CODES.is_none() {
                // Of up to eight lights, no sum holds one that is dropped.
                out.finite &= cutoffs.brightest.iter().all(|key| key.to_f32() < f32::INFINITY);
            }
            let is_draft = largest.is_some();
            if let Some(largest) = largest {
                raise(largest, &cutoffs.brightest);
            }
            if cutoffs.keep_all {
                kept.keep_all();
            } else {
                kept.choose(keys, &cutoffs.largest);
                if is_draft {
                    out.least_cut = cutoffs.least_cut(keys);
                }
                (out.kept, out.keep_all) = (kept.counts(keys.len()), false);
            }
        }
        Choice::Window(robust) => {
            let mut bits = [0; LANES];
            let mut values = [[0.0; LANES]; BYTE_LIGHTS];
            for (values, &&key) in values.iter_mut().zip(keys) {
                for lane in 0..LANES {
                    values[lane] = key[lane].to_f32() - offset.map_or(0.0, |offset| offset[lane]);
                }
            }
            out.careful = robust_lanes::choose(robust, &solver.directions, &values, clipped, &mut bits);
            kept.choose_bits(keys, bits);
            (out.kept, out.keep_all) = (kept.counts(keys.len()), false);
        }
    }
    ahead.part(1, parts);
    // Sums of whole numbers are zero or far from it.
    let any_size = K::CODES.is_none() || offset.is_some();
    let mut squares = V::splat(0.0);
    for step in 0..LANES / V::WIDTH {
        let at = step * V::WIDTH;
        ahead.part(2 + step, parts);
        let facets = if out.keep_all || kept.are_whole(keys.len(), at, V::WIDTH) {
            let sums = match overview {
                Some(overview) => overview.sums.load::<V>(at),
                None => sum_all::<K, V>(solver, keys, offset, at),
            };
            solve_all(solver, sums)
        } else {
            let (facets, unusable) = solve_kept::<K, V>(solver, kept, keys.len(), offset, at, &out.kept);
            out.careful |= unusable << at;
            facets
        };
        squares = facets.values_square + squares;
        out.write(at, &facets, per_full_scale, any_size, block);
    }
    out.finite &= K::CODES.is_some() || is_finite(squares);
}

/// Solves where every light of every pixel is kept and summed up.
#[inline(always)]
pub(super) fn solve_sums<V: Vector>(
    solver: &LaneSolver,
    sums: &SumsAndLargest,
    per_full_scale: f32,
    out: &mut Finished,
    block: &mut Block<'_>,
) {
    (out.careful, out.valid) = (0, 0);
    out.keep_all = true;
    let mut squares = V::splat(0.0);
    for step in 0..LANES / V::WIDTH {
        let at = step * V::WIDTH;
        let facets = solve_all(solver, sums.sums.load::<V>(at));
        squares = facets.values_square + squares;
        out.write(at, &facets, per_full_scale, true, block);
    }
    out.finite = is_finite(squares);
}

/// Raises the largest values so far to these.
#[inline(always)]
pub(super) fn raise<K: Pixel>(largest: &mut Lanes<f32>, values: &Lanes<K>) {
    for lane in 0..LANES {
        let value = values[lane].to_f32();
        largest[lane] = if value > largest[lane] { value } else { largest[lane] };
    }
}

// Below, arrays are spelled out and nothing is a closure: a compiler does not inline these into code for other instructions.

/// Sums over every light, which fit [`solve_all`].
#[inline(always)]
fn sum_all<K: Pixel, V: Vector>(
    solver: &LaneSolver,
    keys: &[&Lanes<K>],
    offset: Option<&Lanes<f32>>,
    at: usize,
) -> Sums<V> {
    if let Some(offset) = offset {
        let (offset, mut sums) = (V::load(&offset[at..]), Sums::zero());
        for (key, column) in keys.iter().zip(&solver.pseudo_inverse) {
            sums.add(K::load::<V>(&key[at..]) - offset, column);
        }
        sums
    } else {
        Sums::of(keys, &solver.pseudo_inverse[..keys.len()], at)
    }
}

/// Every light of every pixel is kept: one matrix for all.
#[inline(always)]
fn solve_all<V: Vector>(solver: &LaneSolver, sums: Sums<V>) -> Facets<V> {
    let Sums { vector: along, squares } = sums;
    let [x2, y2, z2] = [along[0] * along[0], along[1] * along[1], along[2] * along[2]];
    // First what is waited for longest.
    let square = (x2 + y2) + z2;
    let scaled = solver.axes.back(along);
    Facets {
        scaled,
        values_square: squares,
        square,
        inverse: inverse_length(square, scaled),
        // |I|^2 - |L g|^2; what rounding leaves is far below the prior of 2 %.
        unexplained: solver.unexplained.and(squares, [x2, y2, z2]),
        turning: solver.turning.of([x2, y2, z2]),
        freedom: V::repeated(&solver.freedom),
    }
}

/// Some lights of some pixels are dropped: the normal equations of each pixel, and a bit where these are no use.
#[inline(always)]
fn solve_kept<K: Pixel, V: Vector>(
    solver: &LaneSolver,
    kept: &Kept<K>,
    lights: usize,
    offset: Option<&Lanes<f32>>,
    at: usize,
    counts: &Lanes<u16>,
) -> (Facets<V>, Careful) {
    let (keys, directions) = (&kept.keys[..lights], &solver.spread_directions[..lights]);
    // Before the inverses: these wait for other parts of the processor, and for where the bits were just written.
    let sums = if let Some(offset) = offset {
        let (offset, mut sums) = (V::load(&offset[at..]), Sums::zero());
        for (light, (key, direction)) in keys.iter().zip(directions).enumerate() {
            // A dropped key is zero already, but not less an offset.
            let value = K::load::<V>(&key[at..]) - offset;
            sums.add(value.where_bit(&kept.bits[light / BYTE_LIGHTS][at..], light % BYTE_LIGHTS), direction);
        }
        sums
    } else {
        Sums::of(keys, directions, at)
    };
    let inverse = if let Some(inverses) = &solver.inverses {
        Inverse::of_row(V::rows(&kept.bits[0][at..], inverses))
    } else {
        let mut gram = V::sums_of(&kept.bits[0][at..], &solver.grams[0]);
        for (sums, bits) in solver.grams.iter().zip(&kept.bits).skip(1) {
            for (entry, more) in gram.iter_mut().zip(V::sums_of(&bits[at..], sums)) {
                *entry = *entry + more;
            }
        }
        Inverse::of(gram, freedoms(V::from_words(&counts[at..])))
    };
    let mut scaled = inverse.product(sums.vector);
    let excess = dot_less(scaled, sums.vector, sums.squares);
    let fine = inverse.conditioning.is_over(V::splat(MIN_ROUGH_CONDITIONING));
    let mut unusable = 0;
    if !V::all(fine) {
        // Written so that NaN is unusable.
        let usable = V::bits(inverse.conditioning.is_over(V::splat(MIN_LANE_CONDITIONING as f32)));
        unusable = all_bits::<V>() & !usable;
        // One step of iterative refinement: what corrects the residuals of the lights, here with the other sign.
        let mut excesses = Sums::zero();
        for (light, (key, direction)) in keys.iter().zip(directions).enumerate() {
            let mut value = K::load::<V>(&key[at..]);
            if let Some(offset) = offset {
                value = value - V::load(&offset[at..]);
            }
            let excess = dot_less(scaled, spread(direction), value);
            excesses.add(excess.where_bit(&kept.bits[light / BYTE_LIGHTS][at..], light % BYTE_LIGHTS), direction);
        }
        let correction = inverse.product(excesses.vector);
        for axis in 0..3 {
            scaled[axis] = V::pick(fine, scaled[axis], scaled[axis] - correction[axis]);
        }
    }
    let square = dot(scaled, scaled);
    let trace = inverse.entries[0] + inverse.entries[3] + inverse.entries[5];
    let facets = Facets {
        scaled,
        values_square: sums.squares,
        square,
        inverse: inverse_length(square, scaled),
        // Both with the other sign, which takes fewer subtractions.
        unexplained: square.times_plus(V::splat(-(PRIOR_RESIDUAL * PRIOR_RESIDUAL) as f32), excess),
        turning: form(inverse.entries, scaled) - trace * square,
        freedom: inverse.freedom,
    };
    (facets, unusable)
}

/// The inverses of all subsets of up to eight lights.
fn inverses_of(directions: &[Vector3<f64>]) -> RowTable {
    RowTable::new((0..1usize << directions.len()).map(|subset| {
        let lights = directions.iter().enumerate().filter(|(light, _)| subset >> light & 1 == 1);
        let gram = lights.fold(Matrix3::zeros(), |gram, (_, light)| gram + light * light.transpose());
        inverse_row(&gram, MIN_LANE_CONDITIONING, freedom(subset.count_ones() as usize))
    }))
}

fn single(vector: &Vector3<f64>) -> [f32; 3] {
    [vector.x as f32, vector.y as f32, vector.z as f32]
}
