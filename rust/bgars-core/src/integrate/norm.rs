//! Sums over vectors, in an order that does not depend on the threads.

use multiversion::multiversion;
use rayon::prelude::*;

/// Numbers that are summed up by themselves.
const PART: usize = 1 << 13;
/// Sums in flight.
const LANES: usize = 8;

/// Euclidean norm.
pub(super) fn norm(values: &[f64]) -> f64 {
    let squares: Vec<f64> = values.par_chunks(PART).map(|part| sum_of(part, |value| value * value)).collect();
    squares.iter().sum::<f64>().sqrt()
}

/// Sum of some numbers.
pub(super) fn sum(values: &[f64]) -> f64 {
    sum_of(values, |value| value)
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn sum_of<F: Fn(f64) -> f64>(values: &[f64], term: F) -> f64 {
    let (lanes, rest) = values.as_chunks::<LANES>();
    let mut sums = [0.0; LANES];
    for values in lanes {
        for (sum, &value) in sums.iter_mut().zip(values) {
            *sum += term(value);
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&value| term(value)).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn norms_and_sums_are_those_of_the_numbers() {
        let values: Vec<f64> = (0..3 * PART + 5).map(|k| (k as f64 * 0.1).sin()).collect();
        let (squares, plain) = (values.iter().map(|value| value * value).sum::<f64>(), values.iter().sum::<f64>());
        assert!((norm(&values) - squares.sqrt()).abs() < 1e-9 * squares.sqrt());
        assert!((sum(&values) - plain).abs() < 1e-9);
        assert!(norm(&[]).abs() < f64::MIN_POSITIVE);
    }
}
