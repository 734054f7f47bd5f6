//! Jacobi-preconditioned conjugate gradient (Hestenes and Stiefel 1952) from the last surface, as published.

use multiversion::multiversion;
use rayon::prelude::*;

use super::band::Scaled;
use super::frame::Frame;
use super::normal_equations::NormalEquations;
use super::number::Number;
use super::rows::Steps;
use super::sweep::{Products, Vectors, sweep};
use crate::memory::Aligned;

/// The memory of a solver in numbers of type `T`, used again from system to system.
pub(super) struct Jacobi<'a, T: Number> {
    scaled: Scaled<'a, T>,
    vectors: Vectors<T>,
    /// `D^-1/2`, framed.
    roots: Aligned<f64>,
}

/// Why an iteration ended.
#[derive(Clone, Copy, PartialEq, Eq)]
enum End {
    /// As far as it was to go.
    Asked,
    /// Products that are positive were not, by rounding.
    Rounding,
}

impl<'a, T: Number> Jacobi<'a, T> {
    /// For systems in a frame.
    pub fn new(frame: &'a Frame) -> Self {
        Self { scaled: Scaled::new(frame), vectors: Vectors::new(frame), roots: frame.zeros() }
    }

    /// Brings `z` (framed) closer to the solution of a system.
    ///
    /// Stops when the norm of the residual is at most `target`, or after `max_iters`; `each`, called every other iteration, may
    /// stop it by `false`. Returns the iterations and that norm.
    pub fn improve(
        &mut self,
        system: &NormalEquations,
        z: &mut [f64],
        target: f64,
        max_iters: usize,
        mut each: impl FnMut() -> bool,
    ) -> (usize, f64) {
        let (mut iterations, mut before) = (0, f64::INFINITY);
        loop {
            let (taken, norm, end) = self.run(system, z, target, max_iters - iterations, &mut each);
            iterations += taken;
            // The true residual goes on where rounding has left nothing of the products, as long as it helps.
            if end == End::Asked || iterations == max_iters || !(norm < before) {
                return (iterations, norm);
            }
            before = norm;
        }
    }

    /// [`Self::improve`] as far as the products carry.
    fn run(
        &mut self,
        system: &NormalEquations,
        z: &mut [f64],
        target: f64,
        max_iters: usize,
        each: &mut impl FnMut() -> bool,
    ) -> (usize, f64, End) {
        self.begin(system, z);
        let Self { scaled, vectors, roots } = self;
        let mut steps = Steps::default();
        let mut iterations = 0;
        let (norm, end, ahead) = loop {
            let now = sweep(scaled, steps, vectors);
            let norm = now.r_d_r.max(0.0).sqrt();
            if norm <= target || iterations >= max_iters || !each() {
                break (norm, End::Asked, 0.0);
            }
            if !(now.p_v > 0.0) {
                break (norm, End::Rounding, 0.0);
            }
            let (a0, norm_between) = first_step(&now);
            iterations += 1;
            let is_asked = norm_between <= target || iterations == max_iters;
            if let Some(next) = both_steps(&now, a0).filter(|_| !is_asked) {
                iterations += 1;
                steps = next;
            } else {
                break (norm_between, if is_asked { End::Asked } else { End::Rounding }, a0);
            }
        };
        let frame = scaled.frame;
        frame.rows_mut(z).enumerate().for_each(|(row, z)| {
            for span in frame.columns(row) {
                let x = vectors.x_ahead(frame, row, span.clone(), T::of(ahead));
                for ((z, x), root) in z[span.clone()].iter_mut().zip(x).zip(&roots[frame.start(row) + span.start..]) {
                    *z += x.to_f64() * root;
                }
            }
        });
        (iterations, norm, end)
    }

    /// Scales the system to a diagonal of ones, `D^-1/2 A D^-1/2`, and starts at the residual of `z`.
    fn begin(&mut self, system: &NormalEquations, z: &[f64]) {
        let Self { scaled, vectors, roots } = self;
        let frame = scaled.frame;
        frame.rows_mut(roots).enumerate().for_each(|(row, roots)| {
            for span in frame.columns(row) {
                inverse_roots(&system.diagonal[frame.start(row) + span.start..], &mut roots[span]);
            }
        });
        vectors.begin(scaled, |at, out| scale_span(system, roots, z, at, frame.stride(), out));
    }
}

/// `1 / sqrt(d)`, 0 for a pixel without edges.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn inverse_roots(diagonal: &[f64], roots: &mut [f64]) {
    for (root, &d) in roots.iter_mut().zip(diagonal) {
        *root = if d > 0.0 { d.sqrt().recip() } else { 0.0 };
    }
}

/// Part of a row of `-C`, where `D^-1/2 A D^-1/2 = I - C`, to the right and below, of D, and of `D^-1/2 (b - A z)`; its first
/// pixel lies `at`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn scale_span<'a, T: Number>(
    system: &'a NormalEquations,
    roots: &'a [f64],
    z: &'a [f64],
    at: usize,
    stride: usize,
    [right, below, diagonal, r]: [&mut [T]; 4],
) {
    let n = right.len();
    let around = |array: &'a [f64]| [at, at - 1, at + 1, at - stride, at + stride].map(|at| &array[at..at + n]);
    let ([root, _, root_right, _, root_below], [z, z_left, z_right, z_up, z_down]) = (around(roots), around(z));
    let ([tie_right, tie_left, ..], [tie_down, _, _, tie_up, _]) = (around(&system.right), around(&system.below));
    let ([d, ..], [source, ..]) = (around(&system.diagonal), around(&system.source));
    for k in 0..n {
        right[k] = T::of(-tie_right[k] * root[k] * root_right[k]);
    }
    for k in 0..n {
        below[k] = T::of(-tie_down[k] * root[k] * root_below[k]);
    }
    for k in 0..n {
        diagonal[k] = T::of(d[k]);
    }
    for k in 0..n {
        let along = tie_right[k] * (z_right[k] - z[k]) - tie_left[k] * (z[k] - z_left[k]);
        let across = tie_down[k] * (z_down[k] - z[k]) - tie_up[k] * (z[k] - z_up[k]);
        r[k] = T::of((source[k] + (along + across)) * root[k]);
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A system with holes, islands and edges of any weight between 0 and 1.
    fn system(height: usize, width: usize) -> (Frame, NormalEquations) {
        let number = |seed: usize| ((seed * 2_654_435_761) >> 7) % 1000;
        let used = |row: usize, col: usize| number(row * width + col) >= 150;
        let mask: Vec<bool> = (0..height * width).map(|at| used(at / width, at % width)).collect();
        let frame = Frame::new(&mask, width);
        let [mut right, mut below, mut diagonal, mut source] = std::array::from_fn(|_| frame.zeros());
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
        let mut system = NormalEquations::new(&frame);
        (system.right, system.below, system.diagonal, system.source) = (right, below, diagonal, source);
        (frame, system)
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
            r.iter().zip(&system.diagonal[..]).map(|(r, &d)| if d > 0.0 { r / d } else { 0.0 }).collect()
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
                let (iterations, _) =
                    Jacobi::<f64>::new(&frame).improve(&system, &mut fast, tolerance * norm, max_iters, || true);
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
        Jacobi::<f32>::new(&frame).improve(&system, &mut z, 1e-6, 100, || true);
        assert!(z.iter().zip(&system.diagonal[..]).all(|(z, &d)| d > 0.0 || *z == 0.0));
        assert!(z.iter().any(|z| *z != 0.0));
    }
}
