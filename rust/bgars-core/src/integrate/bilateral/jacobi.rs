//! Jacobi-preconditioned conjugate gradient (Hestenes and Stiefel 1952) from the last surface, as published.

use rayon::prelude::*;

use super::band::Scaled;
use super::frame::{Frame, LANES};
use super::normal_equations::NormalEquations;
use super::number::Number;
use super::renewal::Watch;
use super::rows::{P, R, Steps, VECTORS, X};
use super::scaling::{inverse_roots, put_residuals, scale_ties};
use super::sweep::{Products, Vectors, sweep};
use crate::memory::Aligned;

/// The memory of a solver in numbers of type `T`, used again from system to system.
pub(super) struct Jacobi<'a, T: Number> {
    pub(super) scaled: Scaled<'a, T>,
    pub(super) vectors: Vectors<T>,
    /// `D^-1/2`, framed.
    pub(super) roots: Aligned<f64>,
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
        let mut steps = Steps::default();
        let mut iterations = 0;
        let mut watch = Watch::new();
        let (norm, end, ahead) = loop {
            let mut now = sweep(&self.scaled, steps, &mut self.vectors);
            if T::DRIFTS && watch.is_due() {
                now = self.look(system, z, target, &mut watch).unwrap_or(now);
            }
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
        self.take_up(z, T::of(ahead));
        (iterations, norm, end)
    }

    /// Adds `x + ahead p` to `z`.
    pub(super) fn take_up(&self, z: &mut [f64], ahead: T) {
        let Self { scaled: Scaled { frame, .. }, vectors, roots } = self;
        frame.rows_mut(z).enumerate().for_each(|(row, z)| {
            for span in frame.columns(row) {
                let x = vectors.x_ahead(frame, row, span.clone(), ahead);
                for ((z, x), root) in z[span.clone()].iter_mut().zip(x).zip(&roots[frame.start(row) + span.start..]) {
                    *z += x.to_f64() * root;
                }
            }
        });
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
        scaled.each_part(|at, ties| scale_ties(system, roots, at, frame.stride(), ties));
        vectors.each_part(frame, |at, blocks| {
            put_residuals(system, roots, z, at, frame.stride(), blocks);
            for block in blocks {
                let r = block[X];
                *block = [[T::default(); LANES]; VECTORS];
                (block[R], block[P]) = (r, r);
            }
            0.0
        });
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

    /// Norm of the true residual.
    fn norm_left(frame: &Frame, system: &NormalEquations, x: &[f64]) -> f64 {
        let left = system.source.iter().zip(multiply(frame, system, x)).map(|(b, ax)| (b - ax).powi(2));
        left.sum::<f64>().sqrt()
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

    /// A plane whose heights `f32` holds to `1e-4`.
    fn slope(side: usize) -> (Frame, NormalEquations) {
        let frame = Frame::new(&vec![true; side * side], side);
        let mut system = NormalEquations::new(&frame);
        for (row, col) in (0..side * side).map(|at| (at / side, at % side)) {
            let at = frame.start(row) + col;
            for (more, step, rise) in [(col + 1 < side, 1, 3.0), (row + 1 < side, frame.stride(), 2.0)] {
                if more {
                    let weights = if step == 1 { &mut system.right } else { &mut system.below };
                    weights[at] = 1.0;
                    for (at, sign) in [(at, -1.0), (at + step, 1.0)] {
                        system.diagonal[at] += 1.0;
                        system.source[at] += sign * rise;
                    }
                }
            }
        }
        (frame, system)
    }

    #[test]
    fn single_precision_ends_where_the_true_residual_is_small() {
        let (frame, system) = slope(500);
        let target = 1e-4 * dot(&system.source, &system.source).sqrt();
        let [mut single, mut double] = [frame.zeros(), frame.zeros()];
        let (iterations, norm) = Jacobi::<f32>::new(&frame).improve(&system, &mut single, target, 2000, || true);
        let (most, _) = Jacobi::<f64>::new(&frame).improve(&system, &mut double, target, 2000, || true);
        assert!(norm <= target);
        // Left to itself, the residual of `f32` ends at a true one of ninety times this.
        let left = norm_left(&frame, &system, &single);
        assert!(left <= 1.3 * target, "{left} for {target}");
        assert!(10 * iterations <= 11 * most, "{iterations} iterations, {most} of f64");
    }

    #[test]
    fn a_renewed_residual_goes_on_in_the_same_direction() {
        let (frame, system) = system(60, 90);
        let mut solver = Jacobi::<f64>::new(&frame);
        let mut z = frame.zeros();
        solver.begin(&system, &z);
        let mut now = sweep(&solver.scaled, Steps::default(), &mut solver.vectors);
        for _ in 0..5 {
            let steps = both_steps(&now, first_step(&now).0).unwrap();
            now = sweep(&solver.scaled, steps, &mut solver.vectors);
        }
        // Led away, the residual is made true again, and nothing else changes.
        solver.vectors.each_block(&frame, |block| block[R] = block[R].map(|r| 1.01 * r));
        let norm = now.r_d_r.sqrt();
        assert!(solver.look(&system, &mut z, norm, &mut Watch::new()).is_none());
        let renewed = solver.look(&system, &mut z, 1e-3 * norm, &mut Watch::new()).unwrap();
        assert!((norm_left(&frame, &system, &z) / norm - 1.0).abs() <= 1e-10);
        let some = |products: &Products| {
            let Products { r_r, p_v, r_v, v_v, u_v, u_w, w_w, .. } = *products;
            [r_r, p_v, r_v, v_v, u_v, u_w, w_w]
        };
        for (renewed, before) in some(&renewed).into_iter().zip(some(&now)) {
            assert!((renewed / before - 1.0).abs() <= 1e-10, "{renewed} for {before}");
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
