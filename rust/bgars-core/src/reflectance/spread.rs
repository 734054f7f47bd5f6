//! How far observations lie from a fitted model, by their level.

/// Bins of bent levels.
const BINS: usize = 16;

/// Observations that a bin needs to speak for itself.
const ENOUGH: usize = 40;

/// Standard deviation of the bent levels as a function of the level.
#[derive(Clone, Debug, PartialEq)]
pub struct Spread {
    top: f32,
    sigma: [f32; BINS],
}

impl Spread {
    /// The same for every level.
    #[must_use]
    pub fn constant(sigma: f32) -> Self {
        Self { top: 1.0, sigma: [sigma; BINS] }
    }

    /// From (bent level, residual) pairs: 1.4826 times the median of |residual| in each bin, at least `floor`.
    #[must_use]
    pub fn from_residuals(pairs: &[(f32, f32)], floor: f32) -> Self {
        let top = pairs.iter().fold(1.0f32, |top, pair| top.max(pair.0));
        let mut bins: Vec<Vec<f32>> = vec![Vec::new(); BINS];
        for &(level, residual) in pairs {
            bins[bin(level, top)].push(residual.abs());
        }
        let all: Vec<f32> = pairs.iter().map(|pair| pair.1.abs()).collect();
        let overall = median(all);
        let mut sigma = [0.0; BINS];
        for (sigma, values) in sigma.iter_mut().zip(bins) {
            let middle = if values.len() >= ENOUGH { median(values) } else { overall };
            *sigma = (1.4826 * middle).max(floor);
        }
        Self { top, sigma }
    }

    /// All standard deviations times `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f32) -> Self {
        Self { top: self.top, sigma: self.sigma.map(|sigma| sigma * factor) }
    }

    /// Standard deviation at a bent level, linear between the bins' middles.
    #[must_use]
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

fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
