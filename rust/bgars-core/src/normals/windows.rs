//! The robust filter on blocks of pixels, in `f32`, under any number of distant lights.
//!
//! The same windows and costs as [`super::robust_filter`]. Where rounding could decide between two windows, the pixel is
//! left to the careful kernel, so that both keep the same lights.

use super::lanes::{LANES, Lanes, add_product, dot};
use super::ranked::{Ranks, Row, WIDTH};
use super::robust::{self, DROPPED_WEIGHT, MIN_DETERMINANT, NOISE, cost_factor, prior_squares};
use super::symmetric::{adjugate, product};

/// Costs that differ by less than this share are left to the careful kernel; rounding makes up to 0.6 % in the window that
/// conditions worst.
const TIE: f32 = 0.02;

/// The same for a determinant, a median and `n_z` beside their limits.
const NEAR: f32 = 0.01;

/// Cost of a window that is none.
const NONE: f32 = f32::INFINITY;

/// Sums of a window: the upper triangle of `L^T L`, then `L^T I`.
const SUMS: usize = 9;

/// What does not change from pixel to pixel.
#[derive(Debug)]
pub(super) struct WindowFilter {
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
    /// Cost of a squared residual, before the facet's brightness is looked at.
    factor: f32,
    /// No facet of this window or a later one costs less.
    least: f32,
    /// The next shorter window with the same first rank, and its end.
    shorter: Option<(usize, usize)>,
}

impl WindowFilter {
    /// A filter by some windows of so many lights; full scale in the unit of the values that it is to judge.
    pub fn new(windows: &[robust::Window], lights: usize, full_scale: f64) -> Self {
        let noise = NOISE * full_scale;
        let prior = prior_squares(noise);
        let windows = windows.iter().map(|&(first, end)| {
            let factor = cost_factor(end - first, lights);
            let others = windows.iter().enumerate().map(|(index, &(start, end))| (index, start, end));
            let shorter = others.filter(|&(_, start, other)| start == first && other < end).max_by_key(|other| other.2);
            Window {
                first,
                end,
                factor: factor as f32,
                // Brightness b divides by sqrt(b) up to full scale, and multiplies beyond it.
                least: (factor * prior / full_scale.sqrt()) as f32,
                shorter: shorter.map(|(index, _, end)| (index, end)),
            }
        });
        let mut windows: Vec<Window> = windows.collect();
        let mut least = NONE;
        for window in windows.iter_mut().rev() {
            least = window.least.min(least);
            window.least = least;
        }
        let black = (2.0 * noise) as f32;
        Self {
            windows,
            black: if f64::from(black) > 2.0 * noise { black.next_down() } else { black },
            full_scale: full_scale as f32,
            prior: prior as f32,
        }
    }

    /// Writes 1 to `weights` for a light that is kept, else 0; true where the careful kernel is to choose.
    #[inline(always)]
    pub fn choose<const FMA: bool>(
        &self,
        directions: &[[f32; 3]],
        values: &[Lanes<f32>],
        clipped: &[Lanes<bool>],
        weights: &mut [Lanes<f32>],
        memory: &mut Memory,
    ) -> Lanes<bool> {
        let mut careful = Lanes::of(false);
        for first in (0..LANES).step_by(WIDTH) {
            let Memory { ranks, sums } = memory;
            ranks.fill(directions, values, clipped, first);
            self.add_up(ranks, sums);
            let mut best = Best::new();
            for (index, (window, sums)) in self.windows.iter().zip(&*sums).enumerate() {
                if best.beats(window.least) {
                    break;
                }
                self.judge::<FMA>(index as u32, window, sums, ranks, &mut best);
            }
            let (starts, ends) = self.kept(&best, ranks);
            for (weight, ranks) in weights.iter_mut().zip(&ranks.of_lights) {
                for lane in 0..WIDTH {
                    let is_kept = (ranks[lane] >= starts[lane]) & (ranks[lane] < ends[lane]);
                    weight[first + lane] = if is_kept { 1.0 } else { 0.0 };
                }
            }
            for lane in 0..WIDTH {
                careful[first + lane] = !ranks.black[lane] && (best.is_close(lane) || ranks.unsure[lane]);
            }
        }
        careful
    }

    /// First and one past last rank that each pixel keeps.
    #[inline(always)]
    fn kept(&self, best: &Best, ranks: &Ranks) -> (Row<u32>, Row<u32>) {
        let lights = ranks.lights.len();
        let [mut starts, mut ends] = [Row::of(0), Row::of(lights as u32)];
        for lane in 0..WIDTH {
            // No window fits nothing: every light is kept.
            if !ranks.black[lane]
                && let Some(window) = self.windows.get(best.window(lane) as usize)
            {
                (starts[lane], ends[lane]) = (window.first as u32, window.end as u32);
            }
        }
        (starts, ends)
    }

    /// The sums of every window, from the small windows to the large.
    #[inline(always)]
    fn add_up(&self, ranks: &Ranks, sums: &mut [[Row<f32>; SUMS]]) {
        for (index, window) in self.windows.iter().enumerate().rev() {
            let (mut sum, start) = match window.shorter {
                Some((shorter, end)) => (sums[shorter], end),
                None => ([Row::of(0.0); SUMS], window.first),
            };
            for light in &ranks.lights[start..window.end] {
                for lane in 0..WIDTH {
                    let [x, y, z] = [light.direction[0][lane], light.direction[1][lane], light.direction[2][lane]];
                    let value = light.value[lane];
                    let terms = [x * x, x * y, x * z, y * y, y * z, z * z, x * value, y * value, z * value];
                    for index in 0..SUMS {
                        sum[index][lane] += terms[index];
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
        index: u32,
        window: &Window,
        sums: &[Row<f32>; SUMS],
        ranks: &Ranks,
        best: &mut Best,
    ) {
        let (facets, determinants) = fit::<FMA>(sums);
        let [residuals, unexplained] = self.residuals::<FMA>(window, &facets, ranks);
        let (least, per_full_scale) = (MIN_DETERMINANT as f32, 1.0 / self.full_scale);
        let [mut bright, mut dark, mut close] = [Row::of(NONE); 3];
        // Choices one after the other, and not `&&`, which would be branches.
        for lane in 0..WIDTH {
            let facet = [facets[0][lane], facets[1][lane], facets[2][lane]];
            let brightness = dot::<FMA>(facet, facet).sqrt();
            let relative = brightness * per_full_scale;
            let penalty = if relative > 1.0 { relative * relative } else { 1.0 };
            let squares = residuals[lane] + DROPPED_WEIGHT as f32 * unexplained[lane] + self.prior;
            let cost = squares * window.factor / brightness.sqrt() * penalty;
            let cost = if cost >= 0.0 { cost } else { 0.0 };
            let side = NEAR * brightness;
            let above_median = brightness - ranks.medians[lane];
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
        best.bright.take(&bright, &close, index);
        best.dark.take(&dark, &close, index);
    }

    /// Squared residuals of the window's lights, and of those that are dropped and not explained.
    #[inline(always)]
    fn residuals<const FMA: bool>(&self, window: &Window, facets: &[Row<f32>; 3], ranks: &Ranks) -> [Row<f32>; 2] {
        let [mut residuals, mut unexplained] = [Row::of(0.0f32); 2];
        for light in &ranks.lights[window.first..window.end] {
            for lane in 0..WIDTH {
                let difference = light.value[lane] - light.predicted::<FMA>(facets, lane);
                residuals[lane] = add_product::<FMA>(residuals[lane], difference, difference);
            }
        }
        for (lights, left_as_dark) in [(&ranks.lights[..window.first], true), (&ranks.lights[window.end..], false)] {
            for light in lights {
                for lane in 0..WIDTH {
                    let predicted = light.predicted::<FMA>(facets, lane);
                    let difference = light.value[lane] - if predicted > 0.0 { predicted } else { 0.0 };
                    let counts = if difference < 0.0 { light.clipped[lane] == 0 } else { left_as_dark };
                    let counted = if counts & (light.value[lane] > self.black) { difference } else { 0.0 };
                    unexplained[lane] = add_product::<FMA>(unexplained[lane], counted, counted);
                }
            }
        }
        [residuals, unexplained]
    }
}

/// `rho n` by least squares, and `det(L^T L)`.
#[inline(always)]
fn fit<const FMA: bool>(sums: &[Row<f32>; SUMS]) -> ([Row<f32>; 3], Row<f32>) {
    let (mut facets, mut determinants) = ([Row::of(0.0f32); 3], Row::of(0.0f32));
    for lane in 0..WIDTH {
        let gram = [sums[0][lane], sums[1][lane], sums[2][lane], sums[3][lane], sums[4][lane], sums[5][lane]];
        let (adjugate, determinant) = adjugate::<FMA>(gram);
        let facet = product::<FMA>(&adjugate, [sums[6][lane], sums[7][lane], sums[8][lane]]);
        let scale = 1.0 / determinant;
        for axis in 0..3 {
            facets[axis][lane] = facet[axis] * scale;
        }
        determinants[lane] = determinant;
    }
    (facets, determinants)
}

/// What a task needs for the filter.
pub(super) struct Memory {
    ranks: Ranks,
    sums: Vec<[Row<f32>; SUMS]>,
}

impl Memory {
    pub fn new(filter: &WindowFilter, lights: usize) -> Self {
        Self { ranks: Ranks::new(lights), sums: vec![[Row::of(0.0); SUMS]; filter.windows.len()] }
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
    window: Row<u32>,
}

impl Front {
    fn new() -> Self {
        Self { cost: Row::of(NONE), next: Row::of(NONE), window: Row::of(u32::MAX) }
    }

    /// Takes the costs of a window (infinite: none) where they are sure, and where they can only come close.
    #[inline(always)]
    fn take(&mut self, sure: &Row<f32>, close: &Row<f32>, window: u32) {
        for lane in 0..WIDTH {
            let (least, sure, close) = (self.cost[lane], sure[lane], close[lane]);
            let better = sure < least;
            let behind = if better { least } else { sure };
            let behind = if close < behind { close } else { behind };
            self.next[lane] = if behind < self.next[lane] { behind } else { self.next[lane] };
            self.cost[lane] = if better { sure } else { least };
            self.window[lane] = if better { window } else { self.window[lane] };
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
        let mut beaten = true;
        for lane in 0..WIDTH {
            beaten &= self.bright.cost[lane] * (1.0 + TIE) < least;
        }
        beaten
    }

    /// True where a second window comes close, or none was found.
    #[inline(always)]
    fn is_close(&self, lane: usize) -> bool {
        let any_bright = self.bright.next[lane] < NONE || self.bright.cost[lane] < NONE;
        let front = if any_bright { &self.bright } else { &self.dark };
        front.next[lane] <= front.cost[lane] * (1.0 + TIE)
    }

    /// The number of the best window.
    #[inline(always)]
    fn window(&self, lane: usize) -> u32 {
        if self.bright.cost[lane] < NONE { self.bright.window[lane] } else { self.dark.window[lane] }
    }
}
