//! The true residual in the place of one that rounding has led away (van der Vorst and Ye, "Residual replacement strategies for
//! Krylov subspace iterative methods for the convergence of true residuals", SIAM J. Sci. Comput. 22, 2000).
//!
//! The residual of conjugate gradient follows from the one before it, and in `f32`, over hundreds of iterations on a large
//! image, comes away from `b - A z`: the solve would end where that is still large, or never. Now and then the surface takes
//! up what was found, and the two are compared; where they differ, the true one goes on with the direction of before.

use super::frame::LANES;
use super::jacobi::Jacobi;
use super::normal_equations::NormalEquations;
use super::number::Number;
use super::rows::{A_A_P, A_P, A_R, P, R, Steps, X};
use super::scaling::{put_residuals, square_gaps};
use super::sweep::{Products, sweep};

/// Sweeps until the residuals are first compared.
const FIRST_LOOK: usize = 128;
/// Fewest and most sweeps from one comparison to the next.
const LOOKS: [f64; 2] = [16.0, 256.0];
/// Largest gap between the residuals that is left, of what the solve aims at.
const LEFT_GAP: f64 = 0.5;
/// The next comparison is where the gap will have grown to this.
const PLANNED_GAP: f64 = 0.75;

/// When to compare the residuals again.
pub(super) struct Watch {
    sweeps: usize,
    next: usize,
}

impl Watch {
    pub fn new() -> Self {
        Self { sweeps: 0, next: FIRST_LOOK }
    }

    /// Counts a sweep.
    pub fn is_due(&mut self) -> bool {
        self.sweeps += 1;
        self.sweeps == self.next
    }

    /// Begins to count anew, after sweeps over which the gap grew to this part of what the solve aims at.
    fn plan(&mut self, gap: f64) {
        self.next = (self.sweeps as f64 * PLANNED_GAP / gap).clamp(LOOKS[0], LOOKS[1]) as usize;
        self.sweeps = 0;
    }
}

impl<T: Number> Jacobi<'_, T> {
    /// Takes up x and compares the residuals; returns the products if r had to be replaced.
    pub(super) fn look(
        &mut self,
        system: &NormalEquations,
        z: &mut [f64],
        target: f64,
        watch: &mut Watch,
    ) -> Option<Products> {
        self.take_up(z, T::default());
        let Self { scaled, vectors, roots } = self;
        let frame = scaled.frame;
        // The true residual, in the place of x.
        let squares = vectors.each_part(frame, |at, blocks| {
            put_residuals(system, roots, z, at, frame.stride(), blocks);
            square_gaps(&system.diagonal[at..], blocks)
        });
        let gap = squares.sqrt() / target;
        watch.plan(gap);
        let zero = [T::default(); LANES];
        if gap <= LEFT_GAP {
            vectors.each_block(frame, |block| block[X] = zero);
            return None;
        }
        // First A (p - r), in the place of A p.
        vectors.each_block(frame, |block| {
            block[R] = std::array::from_fn(|lane| block[P][lane] - block[X][lane]);
            (block[A_P], block[A_R], block[A_A_P]) = (zero, zero, zero);
        });
        sweep(scaled, Steps::default(), vectors);
        // Then A p, and A r as what is left of it; these steps leave x, p and r as they are.
        vectors.each_block(frame, |block| {
            block[P] = std::array::from_fn(|lane| block[P][lane] + block[X][lane]);
            (block[R], block[X], block[A_R], block[A_A_P]) = (block[X], zero, zero, zero);
        });
        let still = Steps { a0: 0.0, b0: -1.0, a1: 0.0, b1: -1.0 };
        Some(sweep(scaled, still, vectors))
    }
}
