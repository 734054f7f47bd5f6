//! The robust filter on many pixels at once, in `f32`: up to 8 distant lights.
//!
//! The same windows and costs as [`super::robust_filter`]. Where rounding could decide between two windows, the pixel is
//! left to the careful kernel, so that both keep the same lights.

use multiversion::{multiversion, target::target_cfg_f};

use super::cutoff::{LANES, Lanes};
use super::fused::{add_product, dot};
use super::lane_solve::{BYTE_LIGHTS, Careful};
use super::ranked::{CLIPPED, Ranked, Row, WIDTH};
use super::robust::{DROPPED_WEIGHT, MIN_DETERMINANT, RobustFilter, cost_factor, prior_squares};
use super::symmetric::ENTRIES;

/// Costs that differ by less than this share are left to the careful kernel; rounding makes up to 0.6 % in the window that
/// conditions worst.
const TIE: f32 = 0.02;

/// The same for a determinant, a median and `n_z` beside their limits.
const NEAR: f32 = 0.01;

/// Cost of a window that is none.
const NONE: f32 = f32::INFINITY;

/// Sums of a window: the Gram matrix, then `L^T I`.
const SUMS: usize = ENTRIES + 3;

/// Windows of eight lights.
const MAX_WINDOWS: usize = 21;

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct RobustLanes {
    /// Larger first.
    windows: Vec<Window>,
    /// Values up to this are black.
    black: f32,
    full_scale: f32,
    /// Squared residuals that every fit is taken to have.
    prior: f32,
}

/// Some ranks of the sorted values.
#[derive(Clone, Copy, Debug)]
struct Window {
    first: usize,
    end: usize,
    /// A bit a rank.
    span: u32,
    /// Cost of a squared residual, before the facet's brightness is looked at.
    factor: f32,
    /// No facet costs less.
    least: f32,
    /// The window with the same first rank and one rank less.
    shorter: Option<usize>,
}

/// [`RobustLanes::choose`] in a function of its own, so that the loop that calls it for one choice stays small for the others.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512vl+avx512dq+fma", "x86_64+avx2+fma"))]
pub(super) fn choose(
    robust: &RobustLanes,
    directions: &[[f32; 3]],
    values: &[Lanes<f32>; BYTE_LIGHTS],
    clipped: &Lanes<u8>,
    bits: &mut Lanes<u8>,
) -> Careful {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        robust.choose::<true>(directions, values, clipped, bits)
    } else {
        robust.choose::<false>(directions, values, clipped, bits)
    }
}

impl RobustLanes {
    /// `None` for more lights than ranks that are tried one by one.
    pub fn new(filter: &RobustFilter, lights: usize, full_scale: f64) -> Option<Self> {
        if lights > BYTE_LIGHTS {
            return None;
        }
        let noise = filter.noise(full_scale);
        let prior = prior_squares(noise);
        let windows = filter.windows().iter().map(|&(first, end)| {
            let factor = cost_factor(end - first, lights);
            Window {
                first,
                end,
                span: (first..end).fold(0, |span, rank| span | 1 << rank),
                factor: factor as f32,
                // Brightness b divides by sqrt(b) up to full scale, and multiplies beyond it.
                least: (factor * prior / full_scale.sqrt()) as f32,
                shorter: filter.windows().iter().position(|&other| other == (first, end - 1)),
            }
        });
        let black = (2.0 * noise) as f32;
        Some(Self {
            windows: windows.collect(),
            black: if f64::from(black) > 2.0 * noise { black.next_down() } else { black },
            full_scale: full_scale as f32,
            prior: prior as f32,
        })
    }

    /// Writes the kept lights of a block to `bits` (bit k: light k); what is returned is left to the careful kernel.
    ///
    /// `values` by light, of those that are there; `clipped` has a bit a light.
    #[inline(always)]
    fn choose<const FMA: bool>(
        &self,
        directions: &[[f32; 3]],
        values: &[Lanes<f32>; BYTE_LIGHTS],
        clipped: &Lanes<u8>,
        bits: &mut Lanes<u8>,
    ) -> Careful {
        let mut careful = 0;
        let all = u8::MAX >> (BYTE_LIGHTS - directions.len());
        let mut ranked = Ranked::new();
        let mut sums = [[[0.0; WIDTH]; SUMS]; MAX_WINDOWS];
        for first in (0..LANES).step_by(WIDTH) {
            let medians =
                ranked.fill(directions, |light, lane| values[light][first + lane], |lane| clipped[first + lane]);
            self.add_up(&ranked, &mut sums);
            let mut best = Best::new();
            for (window, sums) in self.windows.iter().zip(&sums) {
                if best.beats(window.least) {
                    break;
                }
                self.judge::<FMA>(window, sums, &ranked, &medians, &mut best);
            }
            let kept = best.kept(&ranked, directions.len());
            let black = ranked.is_black();
            for lane in 0..WIDTH {
                // No window fits nothing: every light is kept.
                bits[first + lane] = if black[lane] { all } else { kept[lane] as u8 };
                careful |= Careful::from(best.is_close(lane) && !black[lane]) << (first + lane);
            }
        }
        careful
    }

    /// The sums of every window, from the small windows to the large.
    #[inline(always)]
    fn add_up(&self, ranked: &Ranked, sums: &mut [[Row<f32>; SUMS]; MAX_WINDOWS]) {
        for (index, window) in self.windows.iter().enumerate().rev() {
            let (mut sum, start) = match window.shorter {
                Some(shorter) => (sums[shorter], window.end - 1),
                None => ([[0.0; WIDTH]; SUMS], window.first),
            };
            for rank in start..window.end {
                let ([x, y, z], values) = (&ranked.directions[rank], &ranked.values[rank]);
                for lane in 0..WIDTH {
                    let (x, y, z, value) = (x[lane], y[lane], z[lane], values[lane]);
                    let terms = [x * x, x * y, x * z, y * y, y * z, z * z, x * value, y * value, z * value];
                    for (sum, term) in sum.iter_mut().zip(terms) {
                        sum[lane] += term;
                    }
                }
            }
            sums[index] = sum;
        }
    }

    /// Fits a window, and keeps it where it is the best so far.
    #[inline(always)]
    fn judge<const FMA: bool>(
        &self,
        window: &Window,
        sums: &[Row<f32>; SUMS],
        ranked: &Ranked,
        medians: &Row<f32>,
        best: &mut Best,
    ) {
        let mut facets = [[0.0f32; WIDTH]; 3];
        let mut determinants = [0.0f32; WIDTH];
        for lane in 0..WIDTH {
            let [xx, xy, xz, yy, yz, zz, x, y, z] = std::array::from_fn(|sum| sums[sum][lane]);
            let minor = |a: f32, b: f32, c: f32, d: f32| add_product::<FMA>(a * b, -c, d);
            let [a, b, c] = [minor(yy, zz, yz, yz), minor(xz, yz, xy, zz), minor(xy, yz, xz, yy)];
            let [d, e, f] = [minor(xx, zz, xz, xz), minor(xy, xz, xx, yz), minor(xx, yy, xy, xy)];
            let determinant = dot::<FMA>([xx, xy, xz], [a, b, c]);
            let scale = 1.0 / determinant;
            facets[0][lane] = dot::<FMA>([a, b, c], [x, y, z]) * scale;
            facets[1][lane] = dot::<FMA>([b, d, e], [x, y, z]) * scale;
            facets[2][lane] = dot::<FMA>([c, e, f], [x, y, z]) * scale;
            determinants[lane] = determinant;
        }
        let [mut residuals, mut unexplained] = [[0.0f32; WIDTH]; 2];
        for rank in 0..ranked.lights {
            let ([x, y, z], values, codes) = (&ranked.directions[rank], &ranked.values[rank], &ranked.codes[rank]);
            let predicted = |lane: usize| {
                dot::<FMA>([x[lane], y[lane], z[lane]], [facets[0][lane], facets[1][lane], facets[2][lane]])
            };
            if (window.first..window.end).contains(&rank) {
                for lane in 0..WIDTH {
                    let difference = values[lane] - predicted(lane);
                    residuals[lane] = add_product::<FMA>(residuals[lane], difference, difference);
                }
                continue;
            }
            let left_as_dark = rank < window.first;
            for lane in 0..WIDTH {
                let predicted = predicted(lane);
                let difference = values[lane] - if predicted > 0.0 { predicted } else { 0.0 };
                let missing = difference < 0.0;
                let counts = if missing { codes[lane] < CLIPPED } else { left_as_dark };
                let counted = if counts && values[lane] > self.black { difference } else { 0.0 };
                unexplained[lane] = add_product::<FMA>(unexplained[lane], counted, counted);
            }
        }
        let (least, per_full_scale) = (MIN_DETERMINANT as f32, 1.0 / self.full_scale);
        let [mut bright, mut dark, mut close] = [[NONE; WIDTH]; 3];
        // Choices one after the other, and not `&&`, which would be branches.
        for lane in 0..WIDTH {
            let facet: [f32; 3] = std::array::from_fn(|axis| facets[axis][lane]);
            let brightness = dot::<FMA>(facet, facet).sqrt();
            let relative = brightness * per_full_scale;
            let penalty = if relative > 1.0 { relative * relative } else { 1.0 };
            let squares = residuals[lane] + DROPPED_WEIGHT as f32 * unexplained[lane] + self.prior;
            let cost = squares * window.factor / brightness.sqrt() * penalty;
            let cost = if cost >= 0.0 { cost } else { 0.0 };
            let side = NEAR * brightness;
            let above_median = brightness - medians[lane];
            // NaN is never sure, and always close.
            let sure = if determinants[lane] > least * (1.0 + NEAR) { cost } else { NONE };
            let sure = if facet[2] > side { sure } else { NONE };
            bright[lane] = if above_median > side { sure } else { NONE };
            dark[lane] = if above_median < -side { sure } else { NONE };
            let near = if determinants[lane] < least * (1.0 - NEAR) { NONE } else { cost };
            let near = if facet[2] < -side { NONE } else { near };
            let near = if bright[lane] < NONE { NONE } else { near };
            close[lane] = if dark[lane] < NONE { NONE } else { near };
        }
        best.bright.take(&bright, &close, window);
        best.dark.take(&dark, &close, window);
    }
}

/// The best window of each pixel, and what came close to it.
struct Best {
    /// Among facets not darker than the median, and among the darker ones.
    bright: Front,
    dark: Front,
}

/// The least cost so far, its window, and the next.
struct Front {
    cost: Row<f32>,
    next: Row<f32>,
    span: Row<u32>,
}

impl Front {
    fn new() -> Self {
        Self { cost: [NONE; WIDTH], next: [NONE; WIDTH], span: [0; WIDTH] }
    }

    /// Takes the costs of a window (infinite: none) where they are sure, and where they can only come close.
    #[inline(always)]
    fn take(&mut self, sure: &Row<f32>, close: &Row<f32>, window: &Window) {
        for lane in 0..WIDTH {
            let (least, sure, close) = (self.cost[lane], sure[lane], close[lane]);
            let better = sure < least;
            let behind = if better { least } else { sure };
            let behind = if close < behind { close } else { behind };
            self.next[lane] = if behind < self.next[lane] { behind } else { self.next[lane] };
            self.cost[lane] = if better { sure } else { least };
            self.span[lane] = if better { window.span } else { self.span[lane] };
        }
    }
}

impl Best {
    fn new() -> Self {
        Self { bright: Front::new(), dark: Front::new() }
    }

    /// True where no window of at least this cost can be the best, or come close, at any pixel.
    #[inline(always)]
    fn beats(&self, least: f32) -> bool {
        self.bright.cost.iter().all(|&cost| cost * (1.0 + TIE) < least)
    }

    /// True where a second window comes close, or none was found.
    #[inline(always)]
    fn is_close(&self, lane: usize) -> bool {
        let any_bright = self.bright.next[lane] < NONE || self.bright.cost[lane] < NONE;
        let front = if any_bright { &self.bright } else { &self.dark };
        front.next[lane] <= front.cost[lane] * (1.0 + TIE)
    }

    /// The lights of the best windows, a bit each.
    #[inline(always)]
    fn kept(&self, ranked: &Ranked, lights: usize) -> Row<u32> {
        let mut kept = [0; WIDTH];
        for rank in 0..lights {
            for lane in 0..WIDTH {
                let bright = self.bright.cost[lane] < NONE;
                let span = if bright { self.bright.span[lane] } else { self.dark.span[lane] };
                kept[lane] |= (span >> rank & 1) << (ranked.codes[rank][lane] & (CLIPPED - 1));
            }
        }
        kept
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use super::super::robust::{RobustParams, robust_filter};
    use super::*;

    /// Numbers in [0, 1).
    struct Random(u32);

    impl Random {
        fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.0 >> 8) as f32 / (1 << 24) as f32
        }
    }

    fn ring(lights: usize, random: &mut Random) -> Vec<[f32; 3]> {
        let light = |light: usize| {
            let (azimuth, elevation) = ((light as f32 + random.next()) / lights as f32 * TAU, 0.3 + random.next());
            let ((y, x), (z, radius)) = (azimuth.sin_cos(), elevation.sin_cos());
            [radius * x, radius * y, z]
        };
        (0..lights).map(light).collect()
    }

    /// Grey levels of a facet with shadows, highlights and noise, or of anything.
    fn values(directions: &[[f32; 3]], random: &mut Random) -> Vec<f32> {
        let anything = random.next() < 0.1;
        let (x, y) = (random.next() - 0.5, random.next() - 0.5);
        let (bright, noise) = (300.0 * random.next(), 4.0 * random.next());
        let (shadows, highlights) = (0.3 * random.next(), 0.3 * random.next());
        let value = |&[a, b, c]: &[f32; 3]| {
            let diffuse = (a * x + b * y + c).max(0.0) * bright * random.next().mul_add(0.01 * noise, 1.0);
            let value = if anything { 255.0 * random.next() } else { diffuse };
            let value = if random.next() < shadows { 0.0 } else { value };
            let value = if random.next() < highlights { value + 400.0 * random.next() } else { value };
            value.min(255.0).round()
        };
        directions.iter().map(value).collect()
    }

    #[test]
    fn every_block_keeps_what_the_slow_filter_keeps() {
        let mut random = Random(7);
        let (mut careful_pixels, mut pixels) = (0, 0);
        for lights in 3..=BYTE_LIGHTS {
            for (round, noise_level) in [1.0, 0.3, 3.0].into_iter().cycle().take(60).enumerate() {
                let directions = ring(lights, &mut random);
                let exact: Vec<[f64; 3]> = directions.iter().map(|direction| direction.map(f64::from)).collect();
                let all: Vec<Vec<f32>> = (0..LANES).map(|_| values(&directions, &mut random)).collect();
                let block: [Lanes<f32>; BYTE_LIGHTS] = std::array::from_fn(|light| {
                    std::array::from_fn(|lane| all[lane].get(light).copied().unwrap_or(0.0))
                });
                let clips = |value: f32| round % 2 == 1 && value >= 255.0;
                let clipped: Lanes<u8> = std::array::from_fn(|lane| {
                    all[lane].iter().rev().fold(0, |bits, &value| bits << 1 | u8::from(clips(value)))
                });
                let params = RobustParams { noise_level };
                let filter = RobustFilter::new(params, lights);
                let lanes = RobustLanes::new(&filter, lights, 255.0).expect("8 lights at most");
                let [mut plain, mut fused] = [[0; LANES]; 2];
                let left = [
                    lanes.choose::<false>(&directions, &block, &clipped, &mut plain),
                    lanes.choose::<true>(&directions, &block, &clipped, &mut fused),
                ];
                pixels += LANES;
                careful_pixels += left[0].count_ones() as usize;
                for lane in 0..LANES {
                    let clipped: Vec<bool> = all[lane].iter().map(|&value| clips(value)).collect();
                    let kept = robust_filter(&all[lane], &clipped, &exact, 255.0, params);
                    let expected = kept.iter().rev().fold(0, |bits, &kept| bits << 1 | u8::from(kept));
                    for (bits, left) in [plain, fused].iter().zip(left) {
                        if left >> lane & 1 == 0 {
                            assert_eq!(bits[lane], expected, "{:?} {clipped:?} {directions:?}", all[lane]);
                        }
                    }
                }
            }
        }
        // Ties are common here: three lights have one window, black ones many equal ones.
        assert!(careful_pixels < pixels / 3, "{careful_pixels} of {pixels} pixels left to the careful kernel");
    }

    #[test]
    fn more_lights_than_a_byte_holds_are_left_to_the_slow_filter() {
        let lights = BYTE_LIGHTS + 1;
        assert!(RobustLanes::new(&RobustFilter::new(RobustParams::DEFAULT, lights), lights, 255.0).is_none());
    }
}
