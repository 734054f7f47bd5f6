//! Smooth tables on the disc of normals: what each ball shows there, and what the other balls say about one.

use rayon::prelude::*;

/// Cells along the diameter of the disc.
pub const SIDE: usize = 41;

/// Passes of the smoothing filter (1 2 1) / 4.
const SMOOTHINGS: usize = 2;

/// Weight of observations that a cell needs.
const ENOUGH: f32 = 0.2;

/// Balls that must have seen a cell, the one in question left out.
const MIN_BALLS: usize = 4;

/// Sums of what one ball shows in each cell, `channels` values a cell.
#[derive(Clone, Debug)]
pub struct CellSums {
    channels: usize,
    sums: Vec<f32>,
    weights: Vec<f32>,
}

impl CellSums {
    /// Nothing seen yet.
    pub fn new(channels: usize) -> Self {
        Self { channels, sums: vec![0.0; SIDE * SIDE * channels], weights: vec![0.0; SIDE * SIDE * channels] }
    }

    /// Adds a value at a place of the disc.
    pub fn add(&mut self, point: [f64; 2], channel: usize, value: f32) {
        let cell = |v: f64| (((v + 1.0) * 0.5 * (SIDE - 1) as f64).round() as usize).min(SIDE - 1);
        let index = (cell(point[1]) * SIDE + cell(point[0])) * self.channels + channel;
        self.sums[index] += value;
        self.weights[index] += 1.0;
    }

    /// Smoothed means; NaN where too little was seen.
    pub fn means(mut self) -> Vec<f32> {
        for _ in 0..SMOOTHINGS {
            smooth(&mut self.sums, self.channels);
            smooth(&mut self.weights, self.channels);
        }
        let mean = |(&sum, &weight): (&f32, &f32)| if weight > ENOUGH { sum / weight } else { f32::NAN };
        self.sums.iter().zip(&self.weights).map(mean).collect()
    }
}

/// (1 2 1) / 4 along both axes; nothing beyond the edge.
fn smooth(table: &mut [f32], channels: usize) {
    for (stride, across) in [(channels, SIDE * channels), (SIDE * channels, channels)] {
        for line in 0..SIDE {
            for channel in 0..channels {
                let at = |index: usize| line * across + index * stride + channel;
                let mut before = 0.0;
                for index in 0..SIDE {
                    let here = table[at(index)];
                    let after = if index + 1 < SIDE { table[at(index + 1)] } else { 0.0 };
                    table[at(index)] = 0.25 * (before + 2.0 * here + after);
                    before = here;
                }
            }
        }
    }
}

/// For each ball median and spread of what all others show, by the means of each; zero where too few have seen a cell.
pub fn left_out(channels: usize, balls: &[Vec<f32>]) -> Vec<CellTable> {
    let count = balls.len();
    let mut others = vec![(0.0, 0.0); SIDE * SIDE * channels * count];
    others.par_chunks_mut(count.max(1)).enumerate().for_each_init(Sorted::default, |sorted, (cell, others)| {
        let values: Vec<f32> = balls.iter().map(|ball| ball[cell]).collect();
        sorted.write(&values, others);
    });
    (0..count)
        .into_par_iter()
        .map(|ball| {
            let (middle, sigma) = others[ball..].iter().step_by(count).copied().unzip();
            CellTable { channels, middle, sigma }
        })
        .collect()
}

/// What the balls show in one cell, sorted once for all.
#[derive(Default)]
struct Sorted {
    values: Vec<f32>,
    /// Distances of the values to the two that can be the median when one is left out.
    distances: [Vec<f32>; 2],
}

impl Sorted {
    /// Writes for each of `values` the median of all others and 1.4826 times their median absolute deviation.
    fn write(&mut self, values: &[f32], others: &mut [(f32, f32)]) {
        let seen = |value: &f32| value.is_finite();
        self.values.clear();
        self.values.extend(values.iter().copied().filter(seen));
        if self.values.len() < MIN_BALLS {
            return;
        }
        self.values.sort_unstable_by(f32::total_cmp);
        let lower = (self.values.len() - 1) / 2;
        for (distances, &middle) in self.distances.iter_mut().zip(&self.values[lower..]) {
            distances.clear();
            distances.extend(self.values.iter().map(|value| (value - middle).abs()));
            distances.sort_unstable_by(f32::total_cmp);
        }
        for (value, other) in values.iter().zip(others) {
            let own = Some(*value).filter(seen);
            if self.values.len() - usize::from(own.is_some()) < MIN_BALLS {
                continue;
            }
            let at = median_without(&self.values, own);
            let (middle, distances) = (self.values[at], &self.distances[at - lower]);
            let sigma = distances[median_without(distances, own.map(|own| (own - middle).abs()))];
            *other = (middle, 1.4826 * sigma);
        }
    }
}

/// Place of the median of sorted values, one of them left out if given; the upper of two middle ones.
fn median_without(sorted: &[f32], left_out: Option<f32>) -> usize {
    let Some(left_out) = left_out else { return sorted.len() / 2 };
    let middle = (sorted.len() - 1) / 2;
    let rank = sorted.partition_point(|&value| value < left_out);
    if middle < rank { middle } else { middle + 1 }
}

/// A table on the disc with a spread, `channels` values a cell.
#[derive(Clone, Debug)]
pub struct CellTable {
    channels: usize,
    /// Medians.
    pub middle: Vec<f32>,
    /// 1.4826 times the median absolute deviations.
    pub sigma: Vec<f32>,
}

impl CellTable {
    /// Adds the medians of all channels at a place of the disc, bilinear, to `values`.
    #[inline]
    pub fn add_middle(&self, point: [f64; 2], values: &mut [f32]) {
        self.blend(&self.middle, point, |channel, middle| values[channel] += middle);
    }

    /// Adds the squares of the spreads of all channels.
    #[inline]
    pub fn add_variance(&self, point: [f64; 2], values: &mut [f32]) {
        self.blend(&self.sigma, point, |channel, sigma| values[channel] += sigma * sigma);
    }

    #[inline(always)]
    fn blend(&self, table: &[f32], point: [f64; 2], mut add: impl FnMut(usize, f32)) {
        let position = |v: f64| ((v + 1.0) * 0.5 * (SIDE - 1) as f64).clamp(0.0, (SIDE - 1) as f64 - 1e-6);
        let (col, row) = (position(point[0]), position(point[1]));
        let (c, r) = (col as usize, row as usize);
        let (right, below) = ((col - c as f64) as f32, (row - r as f64) as f32);
        let cell = |row: usize, col: usize| &table[(row * SIDE + col) * self.channels..][..self.channels];
        let corners = cell(r, c).iter().zip(cell(r, c + 1)).zip(cell(r + 1, c).iter().zip(cell(r + 1, c + 1)));
        for (channel, ((a, b), (c, d))) in corners.enumerate() {
            let (above, under) = (a + right * (b - a), c + right * (d - c));
            add(channel, above + below * (under - above));
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;
    use crate::median::median;

    #[test]
    fn what_is_left_out_is_not_counted() {
        assert!(left_out(1, &[]).is_empty());
        for balls in 1..20usize {
            // Repeated values, some far off, and some balls that have seen nothing.
            let of_ball = |ball: usize| match ball * ball % 7 {
                3 => f32::NAN,
                5 => 40.0,
                other => other as f32 - 0.25 * (ball % 3) as f32,
            };
            let tables: Vec<Vec<f32>> = (0..balls).map(|ball| vec![of_ball(ball); SIDE * SIDE]).collect();
            for (ball, table) in left_out(1, &tables).into_iter().enumerate() {
                let others = (0..balls).filter(|&other| other != ball).map(of_ball);
                let mut others: Vec<f32> = others.filter(|value| value.is_finite()).collect();
                let (mut middle, mut sigma) = (0.0, 0.0);
                if others.len() >= MIN_BALLS {
                    middle = median(&mut others, f32::total_cmp);
                    for value in &mut others {
                        *value = (*value - middle).abs();
                    }
                    sigma = 1.4826 * median(&mut others, f32::total_cmp);
                }
                assert_eq!((table.middle[0], table.sigma[0]), (middle, sigma), "ball {ball} of {balls}");
            }
        }
    }
}
