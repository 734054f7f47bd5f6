//! Sums over vectors, in an order that does not depend on the threads.

use multiversion::multiversion;
use rayon::prelude::*;

/// Numbers that are summed up by themselves.
const PART: usize = 1 << 13;
/// Sums in flight.
const LANES: usize = 8;

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
