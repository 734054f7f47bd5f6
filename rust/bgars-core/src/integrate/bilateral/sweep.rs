//! One pass over the image for two iterations of conjugate gradient.
//!
//! Plain conjugate gradient reads and writes every vector at least once an iteration. Two iterations take only `A p`, `A A p`
//! and `A r` of the vectors before them, and all their coefficients follow from products of these five (Chronopoulos and Gear,
//! "s-step iterative methods for symmetric linear systems", 1989, with s = 2). The five are kept; a sweep updates them row by
//! row, multiplies twice by A (`A p` follows from `A r`, as p from r), and at once takes the products that the next two
//! iterations need. What each iteration does is otherwise that of the textbook, and so is where it ends.

use multiversion::{multiversion, target::target_cfg_f};
use rayon::prelude::*;

use super::super::real::{Real, on_vectors};
use super::frame::{Frame, LANES};
use super::number::Number;
use super::rows::{Beside, Factors, SUMS, Stencil, add_products, advance, flush, multiply, multiply_beside, step};
use crate::memory::Aligned;
use crate::vector::Packed;

/// Most rows that one task sweeps; of two more on either side it updates the residual for itself.
const MAX_BAND: usize = 64;
/// Rows of a band that its neighbours need: the first two and the last two.
const EDGE: usize = 4;
/// Vectors that a band needs of the rows beside it: r, A p, A r and A A p.
const KEPT: usize = 4;
/// Rows after which the sums of `f32` go over into `f64`.
const FLUSH: usize = 8;

/// `I - C` of a 5-point system scaled to a diagonal of ones. Arrays are framed.
#[derive(Debug)]
pub(super) struct Scaled<'a, T: Number> {
    pub frame: &'a Frame,
    /// `-C` between each pixel and its right neighbour.
    pub right: Aligned<T>,
    /// `-C` between each pixel and the one below.
    pub below: Aligned<T>,
    /// The diagonal that was scaled to one.
    pub diagonal: Aligned<T>,
}

/// What two iterations do: `r1 = r - a0 A p`, `p1 = r1 + b0 p`, `r2 = r1 - a1 A p1`, `p2 = r2 + b1 p1`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Steps {
    pub a0: f64,
    pub b0: f64,
    pub a1: f64,
    pub b1: f64,
}

/// Products of the vectors, with `v = A p`, `w = A v`, `u = A r`, and D the diagonal that was scaled to one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Products {
    pub r_r: f64,
    pub p_v: f64,
    pub r_v: f64,
    pub v_v: f64,
    pub r_d_r: f64,
    pub r_d_v: f64,
    pub v_d_v: f64,
    pub r_u: f64,
    pub u_v: f64,
    pub u_u: f64,
    pub v_w: f64,
    pub w_w: f64,
    pub u_w: f64,
}

/// The vectors of conjugate gradient, framed.
#[derive(Debug)]
pub(super) struct Vectors<T: Number> {
    pub x: Aligned<T>,
    pub p: Aligned<T>,
    pub r: Aligned<T>,
    /// A p.
    v: Aligned<T>,
    /// A r.
    u: Aligned<T>,
    /// A A p.
    w: Aligned<T>,
    /// The edge of each band, row by row: r, v, u and w as they were before a sweep, and as they are after it.
    edges: [Aligned<T>; 2],
    /// Of each band.
    beside: Vec<Beside<T>>,
}

impl<T: Number> Vectors<T> {
    /// All zero. A sweep of no steps, p and r given, makes the products.
    pub fn new(frame: &Frame) -> Self {
        let [x, p, r, v, u, w] = std::array::from_fn(|_| frame.zeros());
        let edges = std::array::from_fn(|_| Aligned::zeros(bands(frame) * EDGE * KEPT * frame.stride()));
        let beside = (0..bands(frame)).map(|_| Beside::new(frame.width)).collect();
        Self { x, p, r, v, u, w, edges, beside }
    }

    /// Rows of x, p, r and the three products, to start anew: p = r, all others zero. [`Self::keep_edges`] must follow.
    pub fn rows_mut<'a>(&'a mut self, frame: &'a Frame) -> impl IndexedParallelIterator<Item = [&'a mut [T]; 6]> {
        let Self { x, p, r, v, u, w, .. } = self;
        let [x, p, r, v, u, w] = [x, p, r, v, u, w].map(|vector| frame.parts_mut(vector));
        (x, p, r, v, u, w).into_par_iter().map(|(x, p, r, v, u, w)| [x, p, r, v, u, w])
    }

    /// Keeps what a first sweep needs of the rows, and forgets the last one.
    pub fn keep_edges(&mut self, frame: &Frame) {
        let Self { r, v, u, w, edges: [edges, _], beside, .. } = self;
        beside.iter_mut().for_each(Beside::clear);
        let [r, v, u, w] =
            [r, v, u, w].map(|vector| vector[frame.start(0)..].par_chunks(band_rows(frame) * frame.stride()));
        let edges = edges.par_chunks_mut(EDGE * KEPT * frame.stride()).enumerate();
        edges.zip((r, v, u, w)).for_each(|((band, edge), (r, v, u, w))| keep_edge(frame, band, [r, v, u, w], edge));
    }
}

/// Copies the edge of a band from its rows of r, v, u and w.
fn keep_edge<T: Copy>(frame: &Frame, band: usize, vectors: [&[T]; KEPT], edge: &mut [T]) {
    let (most, stride) = (band_rows(frame), frame.stride());
    let start = band * most;
    let rows = most.min(frame.height() - start);
    for (row, kept) in [0, 1, most - 2, most - 1].into_iter().zip(edge.chunks_mut(KEPT * stride)) {
        if row < rows {
            let (lo, hi) = frame.reach(start + row);
            for (vector, kept) in vectors.iter().zip(kept.chunks_mut(stride)) {
                kept[lo..hi].copy_from_slice(&vector[row * stride..][lo..hi]);
            }
        }
    }
}

/// Rows of a band, so that their number is even: two threads then have as many each. The neighbours of a band need two.
fn band_rows(frame: &Frame) -> usize {
    frame.height().div_ceil(2 * frame.height().div_ceil(2 * MAX_BAND)).max(EDGE / 2)
}

fn bands(frame: &Frame) -> usize {
    frame.height().div_ceil(band_rows(frame))
}

/// Takes two iterations and returns the products of the vectors after them, summed in an order without threads.
pub(super) fn sweep<T: Number>(system: &Scaled<'_, T>, steps: Steps, vectors: &mut Vectors<T>) -> Products {
    let frame = system.frame;
    let (chunk, first) = (band_rows(frame) * frame.stride(), frame.start(0));
    let Vectors { x, p, r, v, u, w, edges: [before, after], beside } = vectors;
    let [x, p, r, v, u, w] = [x, p, r, v, u, w].map(|vector| vector[first..].par_chunks_mut(chunk));
    let edges = after.par_chunks_mut(EDGE * KEPT * frame.stride());
    let sums: Vec<[f64; SUMS]> = (x, p, r, v, u, w, edges, beside)
        .into_par_iter()
        .enumerate()
        .map(|(band, (x, p, r, v, u, w, edge, beside))| {
            let sums = sweep_band(system, steps, before, band, &mut Own { x, p, r, v, u, w }, beside);
            keep_edge(frame, band, [r, v, u, w], edge);
            sums
        })
        .collect();
    vectors.edges.swap(0, 1);
    let mut total = [0.0; SUMS];
    for sums in sums {
        for (total, sum) in total.iter_mut().zip(sums) {
            *total += sum;
        }
    }
    let [r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w] = total;
    Products { r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w }
}

/// The rows of the vectors that a band owns.
struct Own<'a, T> {
    x: &'a mut [T],
    p: &'a mut [T],
    r: &'a mut [T],
    v: &'a mut [T],
    u: &'a mut [T],
    w: &'a mut [T],
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn sweep_band<T: Number>(
    system: &Scaled<'_, T>,
    steps: Steps,
    edges: &[T],
    band: usize,
    own: &mut Own<'_, T>,
    beside: &mut Beside<T>,
) -> [f64; SUMS] {
    on_vectors!(T, sweep_band_with::<T>(system, steps, edges, band, own, beside))
}

/// A row goes through three stages, each a row behind the one before, whose neighbours it needs: r after both iterations (and
/// `A p1`, which waits in the row of v), then `A r` and `A p`, then `A A p`. Rows beside the band go through the first two in
/// memory of their own.
#[inline(always)]
fn sweep_band_with<T: Number, V: Packed<Number = T>>(
    system: &Scaled<'_, T>,
    steps: Steps,
    edges: &[T],
    band: usize,
    own: &mut Own<'_, T>,
    beside: &mut Beside<T>,
) -> [f64; SUMS] {
    let frame = system.frame;
    let stride = frame.stride();
    let rows = band_rows(frame);
    let (start, end) = ((band * rows) as isize, ((band + 1) * rows).min(frame.height()) as isize);
    let factors = Factors::<V>::new(steps);
    let mut lanes = [V::splat(T::default()); SUMS];
    let mut sums = [[0.0; LANES]; SUMS];
    let is_own = |row: isize| (start..end).contains(&row);
    let place = |row: isize, span: (usize, usize)| (row - start) as usize * stride + span.0;
    for row in start - 2..end + 2 {
        for &span in frame.spans(row) {
            if is_own(row) {
                let at = place(row, span);
                let vectors = [&mut own.x[at..], &mut own.p[at..], &mut own.r[at..], &mut own.v[at..]];
                advance(&factors, vectors, [&own.u[at..], &own.w[at..]], (span.1 - span.0) / V::WIDTH);
            } else {
                // Above are the last rows of the band before, below the first of the next one.
                let edge = if row < start { row - start } else { EDGE as isize + row - end };
                let first = (band * EDGE).wrapping_add_signed(edge) * KEPT;
                let kept = |vector: usize| &edges[(first + vector) * stride..][span.0..span.1];
                let outs = [beside.r.row_mut(row, span), beside.between.row_mut(row, span)];
                step(&factors, [kept(0), kept(1), kept(2), kept(3)], outs);
            }
        }

        let row = row - 1;
        if row < start - 1 {
            continue;
        }
        for &span in frame.spans(row) {
            let wide = (span.0, span.1 + LANES);
            let of_r = |row| if is_own(row) { &own.r[place(row, span)..] } else { beside.r.row(row, wide) };
            let product = Stencil::new(system, [of_r(row - 1), of_r(row), of_r(row + 1)], row, span);
            if is_own(row) {
                let at = place(row, span);
                multiply(&factors, product, [&mut own.u[at..], &mut own.v[at..]]);
            } else {
                multiply_beside(&factors, product, beside.between.row(row, span), beside.v.row_mut(row, span));
            }
        }

        let row = row - 1;
        if !is_own(row) {
            continue;
        }
        for &span in frame.spans(row) {
            let at = place(row, span);
            let wide = (span.0, span.1 + LANES);
            let of_v = |row| if is_own(row) { &own.v[place(row, span)..] } else { beside.v.row(row, wide) };
            let product = Stencil::new(system, [of_v(row - 1), of_v(row), of_v(row + 1)], row, span);
            let diagonal = &system.diagonal[frame.start(row as usize) + span.0..];
            let vectors = [&own.r[at..], &own.p[at..], &own.u[at..], diagonal];
            add_products(product, vectors, &mut own.w[at..], &mut lanes);
        }
        if (row - start) as usize % FLUSH == FLUSH - 1 || row == end - 1 {
            flush(&mut lanes, &mut sums);
        }
    }
    sums.map(|lanes| lanes.iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{Portable, PortableDouble};

    fn number(seed: usize) -> f64 {
        ((seed * 2_654_435_761) >> 7) as f64 % 1000.0 / 1000.0
    }

    /// Ties below a fifth on all edges between pixels of a frame.
    fn tied<T: Number>(frame: &Frame) -> (Scaled<'_, T>, Vectors<T>) {
        let used = |row: isize, col: usize| frame.spans(row).iter().any(|span| (span.0..span.1).contains(&col));
        let mut system = Scaled { frame, right: frame.zeros(), below: frame.zeros(), diagonal: frame.zeros() };
        let mut vectors = Vectors::new(frame);
        for row in 0..frame.height() {
            for col in (0..frame.width).filter(|&col| used(row as isize, col)) {
                let at = frame.start(row) + col;
                system.right[at] = T::of(if used(row as isize, col + 1) { -0.2 * number(at) } else { 0.0 });
                system.below[at] = T::of(if used(row as isize + 1, col) { -0.2 * number(at + 7) } else { 0.0 });
                system.diagonal[at] = T::of(1.0 + number(at + 3));
                for (shift, vector) in
                    [&mut vectors.x, &mut vectors.p, &mut vectors.r, &mut vectors.v, &mut vectors.u, &mut vectors.w]
                        .into_iter()
                        .enumerate()
                {
                    vector[at] = T::of(number(at * 6 + shift) - 0.5);
                }
            }
        }
        (system, vectors)
    }

    /// The vectors after a sweep, in which each band is worked on by `band`.
    fn swept<T: Number>(
        frame: &Frame,
        steps: Steps,
        band: impl Fn(&Scaled<'_, T>, Steps, &[T], usize, &mut Own<'_, T>, &mut Beside<T>) -> [f64; SUMS],
    ) -> (Vec<f64>, Vec<f64>) {
        let (system, mut vectors) = tied::<T>(frame);
        vectors.keep_edges(frame);
        let Vectors { x, p, r, v, u, w, edges: [edges, _], beside } = &mut vectors;
        let chunk = band_rows(frame) * frame.stride();
        let mut sums = Vec::new();
        for index in 0..bands(frame) {
            let from = frame.start(0) + index * chunk;
            let [x, p, r, v, u, w] = [&mut *x, p, r, v, u, w].map(|vector| {
                let end = (from + chunk).min(vector.len());
                &mut vector[from..end]
            });
            let mut own = Own { x, p, r, v, u, w };
            sums.extend(band(&system, steps, edges, index, &mut own, &mut beside[index]));
        }
        let all = [&*x, p, r, v, u, w].into_iter().flat_map(|vector| vector.iter().map(|number| number.to_f64()));
        (all.collect(), sums)
    }

    fn assert_near(a: &[f64], b: &[f64], rounding: f64) {
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= rounding * (1.0 + b.abs()), "{a} for {b}");
        }
    }

    #[test]
    fn every_instruction_set_takes_the_same_steps() {
        // A ring: rows differ in length, and some are in two parts.
        let distance = |at: usize| ((at / 200) as f64 - 75.0).hypot((at % 200) as f64 - 99.0);
        let mask: Vec<bool> = (0..150 * 200).map(|at| (45.0..75.0).contains(&distance(at))).collect();
        let frame = Frame::new(&mask, 200);
        assert!((0..150).any(|row| frame.spans(row).len() == 2));
        let steps = Steps { a0: 0.7, b0: 0.3, a1: 0.9, b1: 0.2 };
        let (fast, plain) =
            (swept::<f64>(&frame, steps, sweep_band), swept(&frame, steps, sweep_band_with::<f64, PortableDouble>));
        assert_near(&fast.0, &plain.0, 1e-14);
        assert_near(&fast.1, &plain.1, 1e-12);
        let (single, portable) =
            (swept::<f32>(&frame, steps, sweep_band), swept(&frame, steps, sweep_band_with::<f32, Portable>));
        assert_near(&single.0, &portable.0, 1e-6);
        assert_near(&single.0, &plain.0, 1e-6);
        assert_near(&single.1, &plain.1, 1e-4);
    }
}
