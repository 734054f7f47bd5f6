//! The solution, as the sum of conjugate gradient's steps.

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, Weights};
use super::spans::Span;
use crate::memory::Aligned;

/// The sum of all steps. Two at once touch its memory half as often, and both directions are read anyway where the next one is
/// made.
pub(super) struct Steps {
    x: Aligned<f64>,
    /// Nothing was written to `x` yet.
    is_blank: bool,
    /// Sizes of the steps that `x` has not taken yet.
    waiting: Vec<f64>,
}

impl Steps {
    /// From where to start, or from zero.
    pub fn from(start: Option<Aligned<f64>>, size: usize) -> Self {
        let is_blank = start.is_none();
        Self { x: start.unwrap_or_else(|| Aligned::any(size)), is_blank, waiting: Vec::with_capacity(2) }
    }

    /// One more, that may wait: two at most, until they are taken as due.
    pub fn add(&mut self, size: f64) {
        self.waiting.push(size);
    }

    /// The steps along the last two directions if both wait, to be taken by the caller.
    pub fn due(&mut self) -> Option<Due<'_>> {
        let &[first, second] = &self.waiting[..] else { return None };
        self.waiting.clear();
        Some(Due { x: &mut self.x, sizes: [first, second], is_blank: std::mem::take(&mut self.is_blank) })
    }

    /// Where they lead, all of them; the last two were along these directions.
    pub fn end(&mut self, weights: &Weights, [previous, last]: [&[f32]; 2]) -> &[f64] {
        let previous = if let &[_] = &self.waiting[..] {
            self.waiting.push(0.0);
            last
        } else {
            previous
        };
        if let Some(due) = self.due() {
            due.take(weights, [previous, last]);
        }
        if std::mem::take(&mut self.is_blank) {
            self.x.fill(0.0);
        }
        &self.x
    }

    /// The solution, after [`Self::end`].
    pub fn into_solution(self) -> Aligned<f64> {
        self.x
    }
}

/// Two steps to take.
pub(super) struct Due<'a> {
    x: &'a mut [f64],
    /// Along the direction before the last, and along the last.
    sizes: [f64; 2],
    /// Whether `x` holds nothing.
    is_blank: bool,
}

impl<'a> Due<'a> {
    /// The same in chunks of `x`.
    pub fn chunks(self, chunk: usize) -> impl Iterator<Item = Due<'a>> {
        let Self { x, sizes, is_blank } = self;
        x.chunks_mut(chunk).map(move |x| Due { x, sizes, is_blank })
    }

    /// Takes them along the spans of the grid.
    pub fn take(self, weights: &Weights, [previous, last]: [&[f32]; 2]) {
        let chunk = BAND_ROWS * weights.grid.half();
        let bands: Vec<_> = self.chunks(chunk).collect();
        (bands, previous.par_chunks(chunk), last.par_chunks(chunk))
            .into_par_iter()
            .enumerate()
            .for_each(|(band, (mut due, previous, last))| take_band(&mut due, weights, band, [previous, last]));
    }

    /// Takes them in a row, the `row`-th of this chunk, along its span.
    #[inline(always)]
    pub fn take_row(&mut self, row: usize, half: usize, span: Span, [previous, last]: [&[f32]; 2]) {
        let x = &mut self.x[row * half..][..half];
        if self.is_blank {
            x.fill(0.0);
        }
        let [first, second] = self.sizes;
        for ((x, &previous), &last) in x[span.range()].iter_mut().zip(previous).zip(last) {
            *x = (*x + first * f64::from(previous)) + second * f64::from(last);
        }
    }
}

/// [`Due::take`] in a band.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn take_band(due: &mut Due<'_>, weights: &Weights, band: usize, [previous, last]: [&[f32]; 2]) {
    let (half, span) = (weights.grid.half(), weights.spans.band(band));
    for (row, (previous, last)) in previous.chunks(half).zip(last.chunks(half)).enumerate() {
        due.take_row(row, half, span, [&previous[span.range()], &last[span.range()]]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Grid;

    /// Any number of steps, one by one; they are taken in pairs, the last of an odd number alone.
    #[test]
    fn no_step_is_lost() {
        let mut weights = Weights::zeros(Grid { height: 70, width: 96 });
        for row in 40..50 {
            (20..25).for_each(|k| weights.set_red(row, k, [1.0; 4]));
        }
        weights.find_spans();
        let (half, size) = (weights.grid.half(), weights.grid.half_pixels());
        let direction = |step: usize| -> Vec<f32> { (0..size).map(|at| ((at * 31 + step * 7) % 101) as f32).collect() };
        for start in [None, Some(2.0)] {
            for count in 0..6 {
                let began = start.map(|value| {
                    let mut began = Aligned::zeros(size);
                    began.fill(value);
                    began
                });
                let mut steps = Steps::from(began, size);
                let mut last = [vec![], vec![]];
                for step in 0..count {
                    if let Some(due) = steps.due() {
                        due.take(&weights, [&last[0], &last[1]]);
                    }
                    last = [std::mem::take(&mut last[1]), direction(step)];
                    steps.add(1.0 + step as f64);
                }
                let found = steps.end(&weights, [&last[0], &last[1]]);
                for (at, found) in found.iter().enumerate() {
                    let is_inside = weights.spans.at((at / half) as isize).range().contains(&(at % half));
                    let taken = if is_inside { count } else { 0 };
                    let sum: f64 = (0..taken).map(|step| (1.0 + step as f64) * f64::from(direction(step)[at])).sum();
                    assert!((found - start.unwrap_or(0.0) - sum).abs() < 1e-9, "{count} steps, red {at}");
                }
            }
        }
    }
}
