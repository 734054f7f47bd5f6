//! The standard normal distribution function, from a table.
//!
//! Callers need the density anyway; with it, the distribution costs one look-up.

use std::sync::LazyLock;

/// Beyond it the function is 0 or 1 to 1e-10.
const LIMIT: f64 = 6.5;
/// Nodes a unit: half a step from one, the fifth term of Taylor's series is below 1e-12.
const NODES: usize = 64;
const INV_SQRT_2PI: f64 = 0.398_942_280_401_432_7;

/// Values at nodes from -LIMIT to LIMIT.
static TABLE: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let half = (LIMIT * NODES as f64) as i32;
    (-half..=half).map(|node| series(f64::from(node) / NODES as f64)).collect()
});

/// The distribution at `x`, whose density there is `density`, by the cubic through values and slopes of two nodes.
#[inline]
pub(super) fn distribution(x: f64, density: f64) -> f64 {
    if x.abs() >= LIMIT {
        return if x > 0.0 { 1.0 } else { 0.0 };
    }
    // Taylor's series about `x`, whose density is known, taken at the nearest node.
    let place = (x + LIMIT) * NODES as f64;
    let node = place.round();
    let way = (place - node) / NODES as f64;
    let third = (x * x - 1.0) / 6.0;
    let fourth = (3.0 * x - x * x * x) / 24.0;
    TABLE[node as usize] + density * way * (1.0 + way * (0.5 * x + way * (third - way * fourth)))
}

/// The density at `x`.
#[inline]
pub(super) fn density(x: f64) -> f64 {
    INV_SQRT_2PI * (-0.5 * x * x).exp()
}

/// Abramowitz & Stegun (1964), 26.2.11: `Phi(x) = 1/2 + phi(x) sum x^(2n+1) / (1 3 5 ... (2n+1))`.
fn series(x: f64) -> f64 {
    const TERMS: usize = 80;
    let mut term = x;
    let mut sum = x;
    for n in 1..TERMS {
        term *= x * x / (2 * n + 1) as f64;
        sum += term;
    }
    0.5 + density(x) * sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_the_tables() {
        // Abramowitz & Stegun, table 26.1.
        for (x, expected) in
            [(0.0, 0.5), (1.0, 0.841_344_746_068_543), (2.5, 0.993_790_334_674_224), (-3.0, 0.001_349_898_031_630)]
        {
            approx::assert_abs_diff_eq!(distribution(x, density(x)), expected, epsilon = 1e-12);
        }
    }

    #[test]
    fn between_nodes_the_error_is_small() {
        for step in -700..=700 {
            let x = f64::from(step) * 0.009_37;
            approx::assert_abs_diff_eq!(distribution(x, density(x)), series(x).clamp(0.0, 1.0), epsilon = 1e-10);
        }
    }
}
