//! How far observations lie from a fitted model, by their level.

use crate::median::median;

/// Bins of bent levels.
const BINS: usize = 16;

/// Observations that a bin needs to speak for itself.
const ENOUGH: usize = 40;

/// One light at one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Residual {
    pub level: f32,
    /// Observed minus predicted.
    pub size: f32,
}

/// Standard deviation of the bent levels as a function of the level.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    top: f32,
    sigma: [f32; BINS],
}

impl Spread {
    /// The same for every level.
    pub fn constant(sigma: f32) -> Self {
        Self { top: 1.0, sigma: [sigma; BINS] }
    }

    /// From residuals: 1.4826 times the median of their sizes in each bin of levels, at least `floor`.
    pub fn from_residuals(residuals: &[Residual], floor: f32) -> Self {
        let top = residuals.iter().fold(1.0f32, |top, residual| top.max(residual.level));
        let mut bins: Vec<Vec<f32>> = vec![Vec::new(); BINS];
        for residual in residuals {
            bins[bin(residual.level, top)].push(residual.size.abs());
        }
        let mut sizes: Vec<f32> = residuals.iter().map(|residual| residual.size.abs()).collect();
        let overall = median(&mut sizes, f32::total_cmp);
        let mut sigma = [0.0; BINS];
        for (sigma, mut sizes) in sigma.iter_mut().zip(bins) {
            let middle = if sizes.len() >= ENOUGH { median(&mut sizes, f32::total_cmp) } else { overall };
            *sigma = (1.4826 * middle).max(floor);
        }
        Self { top, sigma }
    }

    /// All standard deviations times `factor`.
    pub fn scaled(&self, factor: f32) -> Self {
        Self { top: self.top, sigma: self.sigma.map(|sigma| sigma * factor) }
    }

    /// Standard deviation at a bent level, linear between the bins' middles.
    #[inline]
    pub fn at(&self, level: f32) -> f32 {
        let position = (level / self.top * BINS as f32 - 0.5).clamp(0.0, (BINS - 1) as f32);
        let below = (position as usize).min(BINS - 2);
        let fraction = position - below as f32;
        self.sigma[below] + fraction * (self.sigma[below + 1] - self.sigma[below])
    }
}

fn bin(level: f32, top: f32) -> usize {
    ((level / top * BINS as f32) as usize).min(BINS - 1)
}
