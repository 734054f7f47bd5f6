//! The normal distribution function.

use std::f64::consts::FRAC_1_SQRT_2;

use rayon::prelude::*;

/// Values that one thread has worked on before others are awake.
pub const FEW_VALUES: usize = 4096;

/// The share of the standard normal distribution below each value, to full precision in both tails; NaN stays NaN.
///
/// # Examples
/// ```
/// let below = bgars_core::normal_distribution::normal_distribution(&[0.0, -1.0]);
/// assert_eq!(below[0], 0.5);
/// assert!((below[1] - 0.158_655_253_931_457_05).abs() < 1e-16);
/// ```
#[must_use]
pub fn normal_distribution(values: &[f64]) -> Vec<f64> {
    let share = |value: &f64| 0.5 * libm::erfc(-value * FRAC_1_SQRT_2);
    if values.len() <= FEW_VALUES {
        return values.iter().map(share).collect();
    }
    values.par_iter().with_min_len(FEW_VALUES).map(share).collect()
}
