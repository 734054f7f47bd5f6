//! Smooth tables on the disc of normals: what each ball shows there, and what the other balls say about one.

use crate::median::median;

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

/// The tables of all balls.
#[derive(Clone, Debug)]
pub struct Population {
    channels: usize,
    balls: usize,
    /// `balls` values for each cell and channel; NaN where a ball shows nothing.
    values: Vec<f32>,
}

impl Population {
    /// From the means of each ball.
    pub fn new(channels: usize, balls: &[Vec<f32>]) -> Self {
        let mut values = vec![f32::NAN; SIDE * SIDE * channels * balls.len()];
        for (ball, table) in balls.iter().enumerate() {
            for (cell, &value) in table.iter().enumerate() {
                values[cell * balls.len() + ball] = value;
            }
        }
        Self { channels, balls: balls.len(), values }
    }

    /// Median and spread of the balls but one; zero where too few have seen a cell.
    pub fn without(&self, ball: usize) -> CellTable {
        let cells = SIDE * SIDE * self.channels;
        let mut table = CellTable { channels: self.channels, middle: vec![0.0; cells], sigma: vec![0.0; cells] };
        let mut others = Vec::with_capacity(self.balls);
        for (cell, values) in self.values.chunks_exact(self.balls).enumerate() {
            others.clear();
            others.extend(
                values.iter().enumerate().filter(|(other, value)| *other != ball && value.is_finite()).map(|(_, &v)| v),
            );
            if others.len() >= MIN_BALLS {
                let middle = median(&mut others, f32::total_cmp);
                for value in &mut others {
                    *value = (*value - middle).abs();
                }
                table.middle[cell] = middle;
                table.sigma[cell] = 1.4826 * median(&mut others, f32::total_cmp);
            }
        }
        table
    }
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
    /// Middle and spread at a place of the disc, bilinear.
    pub fn at(&self, point: [f64; 2], channel: usize) -> (f32, f32) {
        let position = |v: f64| ((v + 1.0) * 0.5 * (SIDE - 1) as f64).clamp(0.0, (SIDE - 1) as f64 - 1e-6);
        let (col, row) = (position(point[0]), position(point[1]));
        let (c, r) = (col as usize, row as usize);
        let (fc, fr) = ((col - c as f64) as f32, (row - r as f64) as f32);
        let mut sums = (0.0, 0.0);
        for (dr, wr) in [(0, 1.0 - fr), (1, fr)] {
            for (dc, wc) in [(0, 1.0 - fc), (1, fc)] {
                let cell = ((r + dr) * SIDE + c + dc) * self.channels + channel;
                sums.0 += wr * wc * self.middle[cell];
                sums.1 += wr * wc * self.sigma[cell];
            }
        }
        sums
    }
}
