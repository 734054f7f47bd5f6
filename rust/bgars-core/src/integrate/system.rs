//! The linear system and its preconditioner for solvers other than ours: faer's `LinOp` and `Precond`.

use std::sync::{Mutex, PoisonError};

use faer::dyn_stack::{MemStack, StackReq};
use faer::matrix_free::{LinOp, Precond};
use faer::{MatMut, MatRef, Par};

use super::checkerboard::Weights;
use super::edge_bits::EdgeBits;
use super::fill::fill_corners;
use super::multigrid::{Multigrid, Vectors};
use super::operator::{Field, assemble};
use super::reduction::{eliminate_blacks, multiply};
use super::solve::check;
use super::{Difference, Params};
use crate::Result;
use crate::memory::Aligned;

/// The normal equations of [`super::integrate`], their black pixels eliminated: `S x = b` on the red ones.
///
/// For research on solvers, and for comparing ours with faer's. `S` is symmetric and positive semi-definite: the constant of
/// each component is free, and pixels without neighbours have empty rows.
#[derive(Debug)]
pub struct System {
    weights: Weights,
    right_side: Aligned<f64>,
}

impl System {
    /// The system of a field; see [`super::integrate`] for the arguments.
    ///
    /// # Errors
    /// Those of [`super::integrate`] that concern the input.
    ///
    /// # Examples
    /// ```
    /// use bgars_core::integrate::{Difference, System};
    /// let system = System::new(&[0.0, 0.0, 1.0].repeat(12), &[true; 12], 4, None, Difference::Trapezoid)?;
    /// assert_eq!(system.right_side().len(), 6); // every other pixel
    /// # Ok::<(), bgars_core::Error>(())
    /// ```
    pub fn new(
        normals: &[f32],
        mask: &[bool],
        width: usize,
        weights: Option<&[f32]>,
        difference: Difference,
    ) -> Result<Self> {
        let field = Field { normals, mask, weights, regions: None, width };
        check(field, &Params { difference, ..Params::default() })?;
        let (mut weights, mut right) = assemble(field, difference);
        fill_corners(&mut weights);
        eliminate_blacks(&weights, &mut right.reds, &right.blacks);
        Ok(Self { weights, right_side: right.reds })
    }

    /// `b`, one value a red pixel (row + column even); every row of the image has equally many, the last of them zeros.
    #[must_use]
    pub fn right_side(&self) -> &[f64] {
        &self.right_side
    }

    /// `S`.
    #[must_use]
    pub fn operator(&self) -> Operator<'_> {
        Operator { weights: &self.weights }
    }

    /// One multigrid V-cycle, an approximation of the inverse of `S`.
    #[must_use]
    pub fn preconditioner(&self) -> VCycle<'_> {
        let multigrid = Multigrid::new(&self.weights, EdgeBits::of(&self.weights), |_| ());
        VCycle { vectors: Mutex::new(multigrid.vectors()), multigrid, size: self.right_side.len() }
    }
}

/// `S` of a [`System`], one vector at a time.
#[derive(Debug)]
pub struct Operator<'a> {
    weights: &'a Weights,
}

/// The preconditioner of a [`System`]: symmetric, positive definite, and linear up to rounding in `f32`.
#[derive(Debug)]
pub struct VCycle<'a> {
    multigrid: Multigrid<'a>,
    vectors: Mutex<Vectors>,
    size: usize,
}

impl VCycle<'_> {
    /// How many unknowns the grids leave to the graph, which costs several times as much for each: a few where the mask has
    /// no narrow lanes, up to half the pixels where it has nothing else.
    #[must_use]
    pub fn graph_unknowns(&self) -> usize {
        self.multigrid.graph_unknowns()
    }
}

/// A vector from faer, as a slice.
fn slice(x: MatRef<'_, f64>) -> &[f64] {
    x.col(0).try_as_col_major().expect("faer hands over contiguous vectors").as_slice()
}

/// The same, to write.
fn slice_mut(x: MatMut<'_, f64>) -> &mut [f64] {
    x.col_mut(0).try_as_col_major_mut().expect("faer hands over contiguous vectors").as_slice_mut()
}

impl LinOp<f64> for Operator<'_> {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        self.weights.grid.half_pixels()
    }

    fn ncols(&self) -> usize {
        self.nrows()
    }

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        let out = slice_mut(out);
        out.fill(0.0);
        multiply(self.weights, slice(rhs), out);
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

impl LinOp<f64> for VCycle<'_> {
    fn apply_scratch(&self, _rhs_ncols: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn nrows(&self) -> usize {
        self.size
    }

    fn ncols(&self) -> usize {
        self.size
    }

    fn apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        let mut correction = vec![0.0f32; self.size];
        let mut vectors = self.vectors.lock().unwrap_or_else(PoisonError::into_inner);
        let rounded: Vec<f32> = slice(rhs).iter().map(|&number| number as f32).collect();
        self.multigrid.cycle(&rounded, &mut vectors, &mut correction);
        for (out, correction) in slice_mut(out).iter_mut().zip(correction) {
            *out = f64::from(correction);
        }
    }

    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

impl Precond<f64> for VCycle<'_> {}
