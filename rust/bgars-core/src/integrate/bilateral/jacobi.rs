//! Jacobi-preconditioned conjugate gradient (Hestenes and Stiefel 1952) on the scaled reds, as published, at half the work.

use multiversion::multiversion;
use rayon::prelude::*;

use super::super::checkerboard::Weights;
use super::scaled::{Number, Scaled, dot};

/// Elements of a vector that one task updates.
const BLOCK: usize = 1 << 13;

/// Adds to `x` an approximate solution of `S d = residual`, in numbers of type `T`.
///
/// Stops when the norm of the residual (unscaled) is at most `target`, or after `max_iters`; `each` may stop it by `false`.
/// Returns the iterations and that norm.
pub(super) fn correct<T: Number>(
    weights: &Weights,
    residual: &[f64],
    x: &mut [f64],
    target: f64,
    max_iters: usize,
    mut each: impl FnMut() -> bool,
) -> (usize, f64) {
    let system = Scaled::<T>::new(weights);
    let root = |red: usize| system.diagonal[red].sqrt();
    let diagonal = system.pad(|red| system.diagonal[red]);
    let mut r = system.pad(|red| if system.diagonal[red] > 0.0 { residual[red] / root(red) } else { 0.0 });
    let mut p = r.clone();
    let [mut d, mut q] = [vec![T::default(); r.len()], vec![T::default(); r.len()]];
    let (mut r_r, mut norm) = squares(&r, &diagonal);
    let mut iterations = 0;
    while norm > target && iterations < max_iters {
        let p_q = system.multiply(&p, &mut q);
        if !(p_q > 0.0) || !each() {
            break;
        }
        let alpha = r_r / p_q;
        let (next, next_norm) = step(&mut d, &mut r, &p, &q, &diagonal, T::of(alpha), T::of(-alpha));
        let beta = T::of(next / r_r);
        p.par_chunks_mut(BLOCK).zip(r.par_chunks(BLOCK)).for_each(|(p, r)| turn(p, r, beta));
        (r_r, norm) = (next, next_norm);
        iterations += 1;
    }
    system.each_red(&d, |red, d| {
        if system.diagonal[red] > 0.0 {
            x[red] += d / root(red);
        }
    });
    (iterations, norm)
}

/// `<r, r>` and the unscaled norm.
fn squares<T: Number>(r: &[T], diagonal: &[T]) -> (f64, f64) {
    let weighted: f64 = r.iter().zip(diagonal).map(|(r, d)| (*d * *r).to_f64() * r.to_f64()).sum();
    (r.chunks(BLOCK).map(|r| dot(r, r)).sum(), weighted.sqrt())
}

/// `d += alpha p`, `r -= alpha q`; returns `<r, r>` and the unscaled norm of r, summed in an order without threads.
fn step<T: Number>(d: &mut [T], r: &mut [T], p: &[T], q: &[T], diagonal: &[T], alpha: T, minus: T) -> (f64, f64) {
    let blocks = (d.par_chunks_mut(BLOCK), r.par_chunks_mut(BLOCK), p.par_chunks(BLOCK), q.par_chunks(BLOCK));
    let sums: Vec<(f64, f64)> = blocks
        .into_par_iter()
        .zip(diagonal.par_chunks(BLOCK))
        .map(|((d, r, p, q), diagonal)| step_block(d, r, p, q, diagonal, alpha, minus))
        .collect();
    let (square, weighted) = sums.iter().fold((0.0, 0.0), |sum, block| (sum.0 + block.0, sum.1 + block.1));
    (square, weighted.sqrt())
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn step_block<T: Number>(d: &mut [T], r: &mut [T], p: &[T], q: &[T], diagonal: &[T], alpha: T, minus: T) -> (f64, f64) {
    const LANES: usize = 16;
    let n = d.len();
    let (r, p, q, diagonal) = (&mut r[..n], &p[..n], &q[..n], &diagonal[..n]);
    let [mut squares, mut weighted] = [[T::default(); LANES]; 2];
    let whole = n - n % LANES;
    for start in (0..whole).step_by(LANES) {
        let (d, r) = (&mut d[start..start + LANES], &mut r[start..start + LANES]);
        let (p, q, diagonal) = (&p[start..start + LANES], &q[start..start + LANES], &diagonal[start..start + LANES]);
        for lane in 0..LANES {
            d[lane] += alpha * p[lane];
            r[lane] += minus * q[lane];
            let square = r[lane] * r[lane];
            squares[lane] += square;
            weighted[lane] += diagonal[lane] * square;
        }
    }
    let sum = |lanes: [T; LANES]| lanes.iter().map(|lane| lane.to_f64()).sum::<f64>();
    let (mut square, mut unscaled) = (sum(squares), sum(weighted));
    for k in whole..n {
        d[k] += alpha * p[k];
        r[k] += minus * q[k];
        square += (r[k] * r[k]).to_f64();
        unscaled += (diagonal[k] * r[k] * r[k]).to_f64();
    }
    (square, unscaled)
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn turn<T: Number>(p: &mut [T], r: &[T], beta: T) {
    for (p, r) in p.iter_mut().zip(r) {
        *p = *r + beta * *p;
    }
}
