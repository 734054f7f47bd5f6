//! Jacobi-preconditioned conjugate gradient (Hestenes and Stiefel 1952) from the last surface, as published.

use rayon::prelude::*;

use super::frame::{Aligned, Frame};
use super::normal_equations::NormalEquations;
use super::number::Number;
use super::sweep::{Products, Scaled, Steps, Vectors, sweep};

/// Brings `z` (framed) closer to the solution of a system, in numbers of type `T`.
///
/// Stops when the norm of the residual is at most `target`, or after `max_iters`; `each`, called every other iteration, may stop
/// it by `false`. Returns the iterations and that norm.
pub(super) fn improve<T: Number>(
    frame: &Frame,
    system: &NormalEquations,
    z: &mut [f64],
    target: f64,
    max_iters: usize,
    mut each: impl FnMut() -> bool,
) -> (usize, f64) {
    let roots = inverse_roots(&system.diagonal);
    let r = scaled_residual::<T>(frame, system, &roots, z);
    let scaled = scale(frame, system, &roots);
    let mut vectors = Vectors { x: frame.zeros(), p: frame.zeros(), next: [frame.zeros(), frame.zeros()], r };
    vectors.p.copy_from_slice(&vectors.r);
    let mut steps = Steps::default();
    let mut iterations = 0;
    let norm = loop {
        let now = sweep(&scaled, steps, &mut vectors);
        let norm = now.r_d_r.max(0.0).sqrt();
        if norm <= target || iterations >= max_iters || !(now.p_v > 0.0) || !each() {
            break norm;
        }
        let (a0, norm_between) = first_step(&now);
        iterations += 1;
        if let Some(next) = both_steps(&now, a0).filter(|_| norm_between > target && iterations < max_iters) {
            iterations += 1;
            steps = next;
        } else {
            let a0 = T::of(a0);
            vectors.x.par_iter_mut().zip(vectors.p.par_iter()).for_each(|(x, p)| *x += a0 * *p);
            break norm_between;
        }
    };
    z.par_iter_mut().zip(vectors.x.par_iter()).zip(&roots).for_each(|((z, x), root)| *z += x.to_f64() * root);
    (iterations, norm)
}

/// Length of the step along p, and the norm of the unscaled residual after it.
fn first_step(now: &Products) -> (f64, f64) {
    let a0 = now.r_r / now.p_v;
    (a0, (now.r_d_r - 2.0 * a0 * now.r_d_v + a0 * a0 * now.v_d_v).max(0.0).sqrt())
}

/// The two iterations from here, by their products alone; `None` where rounding leaves nothing of one.
fn both_steps(now: &Products, a0: f64) -> Option<Steps> {
    // r1 = r - a0 v; p1 = r1 + b0 p; A p1 = u - a0 w + b0 v.
    let r1_r1 = now.r_r - 2.0 * a0 * now.r_v + a0 * a0 * now.v_v;
    let b0 = r1_r1 / now.r_r;
    let r1_v = now.r_v - a0 * now.v_v;
    let r1_a_r1 = now.r_u - 2.0 * a0 * now.u_v + a0 * a0 * now.v_w;
    let p1_a_p1 = b0 * b0 * now.p_v + 2.0 * b0 * r1_v + r1_a_r1;
    let a1 = r1_r1 / p1_a_p1;
    let (a_r1_v, a_r1_squared) = (now.u_v - a0 * now.v_w, now.u_u - 2.0 * a0 * now.u_w + a0 * a0 * now.w_w);
    let a_p1_squared = b0 * b0 * now.v_v + 2.0 * b0 * a_r1_v + a_r1_squared;
    let r2_r2 = r1_r1 - 2.0 * a1 * (r1_a_r1 + b0 * r1_v) + a1 * a1 * a_p1_squared;
    let b1 = r2_r2 / r1_r1;
    (r1_r1 > 0.0 && p1_a_p1 > 0.0 && r2_r2 >= 0.0).then_some(Steps { a0, b0, a1, b1 })
}

/// `1 / sqrt(d)`, 0 for a pixel without edges.
fn inverse_roots(diagonal: &[f64]) -> Vec<f64> {
    diagonal.par_iter().with_min_len(1 << 13).map(|&d| if d > 0.0 { d.sqrt().recip() } else { 0.0 }).collect()
}

/// `D^-1/2 (b - A z)`.
fn scaled_residual<T: Number>(frame: &Frame, system: &NormalEquations, roots: &[f64], z: &[f64]) -> Aligned<T> {
    let (stride, mut residual) = (frame.stride(), frame.zeros::<T>());
    residual[frame.start(0)..].par_chunks_mut(stride).take(frame.height).enumerate().for_each(|(row, residual)| {
        let (lo, hi) = frame.span(row as isize);
        let start = frame.start(row);
        for k in lo..hi {
            let i = start + k;
            let along = system.right[i] * (z[i + 1] - z[i]) - system.right[i - 1] * (z[i] - z[i - 1]);
            let across = system.below[i] * (z[i + stride] - z[i]) - system.below[i - stride] * (z[i] - z[i - stride]);
            residual[k] = T::of((system.source[i] + (along + across)) * roots[i]);
        }
    });
    residual
}

/// `D^-1/2 A D^-1/2 = I - C`.
fn scale<'a, T: Number>(frame: &'a Frame, system: &NormalEquations, roots: &[f64]) -> Scaled<'a, T> {
    let stride = frame.stride();
    let [mut right, mut below, mut diagonal] = std::array::from_fn(|_| frame.zeros::<T>());
    let first = frame.start(0);
    right[first..]
        .par_chunks_mut(stride)
        .zip(below[first..].par_chunks_mut(stride))
        .zip(diagonal[first..].par_chunks_mut(stride))
        .take(frame.height)
        .enumerate()
        .for_each(|(row, ((right, below), diagonal))| {
            let (lo, hi) = frame.span(row as isize);
            let start = frame.start(row);
            for k in lo..hi {
                let i = start + k;
                right[k] = T::of(system.right[i] * roots[i] * roots[i + 1]);
                below[k] = T::of(system.below[i] * roots[i] * roots[i + stride]);
                diagonal[k] = T::of(system.diagonal[i]);
            }
        });
    Scaled { frame, right, below, diagonal }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A system with holes, islands and edges of any weight between 0 and 1.
    fn system(height: usize, width: usize) -> (Frame, NormalEquations) {
        let number = |seed: usize| ((seed * 2_654_435_761) >> 7) % 1000;
        let used = |row: usize, col: usize| number(row * width + col) >= 150;
        let frame = Frame::new(height, width, used);
        let [mut right, mut below, mut diagonal, mut source] = std::array::from_fn(|_| vec![0.0; frame.len()]);
        let mut join = |a: usize, b: usize, weights: &mut [f64]| {
            weights[a] = number(a * b) as f64 / 1000.0;
            diagonal[a] += weights[a];
            diagonal[b] += weights[a];
            source[a] -= weights[a] * (a as f64).sin();
            source[b] += weights[a] * (a as f64).sin();
        };
        for row in 0..height {
            for col in (0..width).filter(|&col| used(row, col)) {
                let at = frame.start(row) + col;
                if col + 1 < width && used(row, col + 1) {
                    join(at, at + 1, &mut right);
                }
                if row + 1 < height && used(row + 1, col) {
                    join(at, at + frame.stride(), &mut below);
                }
            }
        }
        (frame, NormalEquations { right, below, diagonal, source })
    }

    fn multiply(frame: &Frame, system: &NormalEquations, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        for (weights, step) in [(&system.right, 1), (&system.below, frame.stride())] {
            for (at, weight) in weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0) {
                let pull = weight * (x[at] - x[at + step]);
                out[at] += pull;
                out[at + step] -= pull;
            }
        }
        out
    }

    fn dot(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum()
    }

    /// Preconditioned conjugate gradient as in the textbook.
    fn textbook(frame: &Frame, system: &NormalEquations, x: &mut [f64], target: f64, max_iters: usize) -> usize {
        let precondition = |r: &[f64]| -> Vec<f64> {
            r.iter().zip(&system.diagonal).map(|(r, &d)| if d > 0.0 { r / d } else { 0.0 }).collect()
        };
        let mut r: Vec<f64> = system.source.iter().zip(multiply(frame, system, x)).map(|(b, ax)| b - ax).collect();
        let mut p = precondition(&r);
        let mut r_z = dot(&r, &p);
        for iteration in 0..max_iters {
            if dot(&r, &r).sqrt() <= target {
                return iteration;
            }
            let q = multiply(frame, system, &p);
            let alpha = r_z / dot(&p, &q);
            x.iter_mut().zip(&p).for_each(|(x, p)| *x += alpha * p);
            r.iter_mut().zip(&q).for_each(|(r, q)| *r -= alpha * q);
            let z = precondition(&r);
            let next = dot(&r, &z);
            p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + next / r_z * *p);
            r_z = next;
        }
        max_iters
    }

    #[test]
    fn every_iterate_is_that_of_the_textbook() {
        for (height, width) in [(1, 1), (1, 7), (9, 1), (2, 2), (5, 8), (33, 20), (150, 31), (70, 200)] {
            let (frame, system) = system(height, width);
            let norm = dot(&system.source, &system.source).sqrt();
            let start: Vec<f64> = (0..frame.len())
                .map(|at| if system.diagonal[at] > 0.0 { (at as f64 * 0.1).cos() } else { 0.0 })
                .collect();
            let settings = [(0.0, 1), (0.0, 2), (0.0, 3), (0.0, 8), (1e-1, 500), (1e-3, 500)];
            for (tolerance, max_iters) in settings {
                // As many iterations as pixels end where rounding is all there is.
                let max_iters = max_iters.min(height * width / 4);
                let [mut fast, mut slow] = [start.clone(), start.clone()];
                let (iterations, _) = improve::<f64>(&frame, &system, &mut fast, tolerance * norm, max_iters, || true);
                assert_eq!(
                    iterations,
                    textbook(&frame, &system, &mut slow, tolerance * norm, max_iters),
                    "{height} x {width} to {tolerance}"
                );
                let scale = slow.iter().fold(1.0f64, |most, x| most.max(x.abs()));
                let off = fast.iter().zip(&slow).fold(0.0f64, |most, (fast, slow)| most.max((fast - slow).abs()));
                assert!(off <= 1e-10 * scale, "{height} x {width}, {iterations} iterations: {off:e} of {scale}");
            }
        }
    }

    #[test]
    fn what_is_outside_the_mask_stays_zero() {
        let (frame, system) = system(40, 50);
        let mut z = vec![0.0; frame.len()];
        improve::<f32>(&frame, &system, &mut z, 1e-6, 100, || true);
        assert!(z.iter().zip(&system.diagonal).all(|(z, &d)| d > 0.0 || *z == 0.0));
        assert!(z.iter().any(|z| *z != 0.0));
    }
}
