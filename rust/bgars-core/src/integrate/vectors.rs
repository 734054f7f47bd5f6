//! Operators of faer on vectors, which it hands over as matrices of one column.

use faer::{MatMut, MatRef};

/// A vector from faer, as a slice.
pub(super) fn slice(x: MatRef<'_, f64>) -> &[f64] {
    x.col(0).try_as_col_major().expect("faer hands over contiguous vectors").as_slice()
}

/// The same, to write.
pub(super) fn slice_mut(x: MatMut<'_, f64>) -> &mut [f64] {
    x.col_mut(0).try_as_col_major_mut().expect("faer hands over contiguous vectors").as_slice_mut()
}

/// What is the same for every symmetric operator that needs no work memory: its size, and that it is its own transpose.
macro_rules! symmetric_operator {
    ($size:expr) => {
        fn apply_scratch(&self, _rhs_ncols: usize, _par: faer::Par) -> faer::dyn_stack::StackReq {
            faer::dyn_stack::StackReq::EMPTY
        }

        fn nrows(&self) -> usize {
            $size(self)
        }

        fn ncols(&self) -> usize {
            self.nrows()
        }

        fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
            self.apply(out, rhs, par, stack);
        }
    };
}
pub(super) use symmetric_operator;
