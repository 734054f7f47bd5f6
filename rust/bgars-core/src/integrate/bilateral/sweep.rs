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
use super::frame::Frame;
use super::number::Number;
use super::rows::{Factors, Rings, SUMS, Stencil, add_products, advance, flush, multiply, step};
use crate::memory::Aligned;
use crate::vector::Packed;

/// Rows that one task sweeps; of two more on either side it updates the residual for itself.
const BAND: usize = 64;
/// Rows that are kept at the border of two bands: two on either side.
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
    /// At each border of two bands, row by row: r, v, u and w as they were before the sweep.
    edges: Aligned<T>,
}

impl<T: Number> Vectors<T> {
    /// All zero.
    pub fn new(frame: &Frame) -> Self {
        let [x, p, r, v, u, w] = std::array::from_fn(|_| frame.zeros());
        let edges = Aligned::zeros((bands(frame) - 1) * EDGE * KEPT * frame.stride());
        Self { x, p, r, v, u, w, edges }
    }

    /// Sets x and the products to zero. A sweep of no steps, p and r given, makes the products.
    pub fn clear(&mut self) {
        for vector in [&mut self.x, &mut self.v, &mut self.u, &mut self.w] {
            vector.fill(T::default());
        }
    }

    /// Keeps the rows on which two bands depend.
    fn keep_edges(&mut self, frame: &Frame) {
        let Self { r, v, u, w, edges, .. } = self;
        let (stride, kept) = (frame.stride(), [&*r, &*v, &*u, &*w]);
        edges.par_chunks_mut(EDGE * KEPT * stride).enumerate().for_each(|(band, edges)| {
            let first = (band + 1) * BAND - EDGE / 2;
            for (row, edges) in (first..frame.height).zip(edges.chunks_mut(KEPT * stride)) {
                for (vector, edge) in kept.iter().zip(edges.chunks_mut(stride)) {
                    edge.copy_from_slice(&vector[frame.start(row)..][..stride]);
                }
            }
        });
    }
}

fn bands(frame: &Frame) -> usize {
    frame.height.div_ceil(BAND)
}

/// Takes two iterations and returns the products of the vectors after them, summed in an order without threads.
pub(super) fn sweep<T: Number>(system: &Scaled<'_, T>, steps: Steps, vectors: &mut Vectors<T>) -> Products {
    let frame = system.frame;
    vectors.keep_edges(frame);
    let (chunk, first) = (BAND * frame.stride(), frame.start(0));
    let Vectors { x, p, r, v, u, w, edges } = vectors;
    let [x, p, r, v, u, w] = [x, p, r, v, u, w].map(|vector| vector[first..].par_chunks_mut(chunk));
    let sums: Vec<[f64; SUMS]> = (x, p, r, v, u, w)
        .into_par_iter()
        .take(bands(frame))
        .enumerate()
        .map_init(
            || Rings::new(frame.width),
            |rings, (band, (x, p, r, v, u, w))| {
                sweep_band(system, steps, edges, band, &mut Own { x, p, r, v, u, w }, rings)
            },
        )
        .collect();
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
    rings: &mut Rings<T>,
) -> [f64; SUMS] {
    on_vectors!(T, sweep_band_with::<T>(system, steps, edges, band, own, rings))
}

/// A row goes through three stages, each a row behind the one before, whose neighbours it needs.
#[inline(always)]
fn sweep_band_with<T: Number, V: Packed<Number = T>>(
    system: &Scaled<'_, T>,
    steps: Steps,
    edges: &[T],
    band: usize,
    own: &mut Own<'_, T>,
    rings: &mut Rings<T>,
) -> [f64; SUMS] {
    let frame = system.frame;
    let stride = frame.stride();
    let (start, end) = ((band * BAND) as isize, ((band + 1) * BAND).min(frame.height) as isize);
    let factors = Factors::<V>::new(steps);
    let Rings { r: new_r, between, v: new_v } = rings;
    let mut lanes = [V::splat(T::default()); SUMS];
    let mut sums = [0.0; SUMS];
    let place = |row: isize, span: (usize, usize)| {
        (start..end).contains(&row).then(|| (row - start) as usize * stride + span.0)
    };
    for row in start - 2..end + 2 {
        let span = frame.span(row);
        let outs = [new_r.begin(row, span), between.begin(row, span)];
        if let Some(at) = place(row, span) {
            step(&factors, [&own.r[at..], &own.v[at..], &own.u[at..], &own.w[at..]], outs);
            let vectors = [&mut own.x[at..], &mut own.p[at..], &mut own.r[at..]];
            advance(&factors, new_r.row(row, span), &own.v[at..], vectors);
        } else if span.0 < span.1 {
            // Two rows above the band are the first of its edge, two below it the last of the next one's.
            let before = if row < start { (band - 1) * EDGE + 2 } else { band * EDGE + 2 };
            let first = before.wrapping_add_signed(if row < start { row - start } else { row - end }) * KEPT;
            let kept = |vector: usize| &edges[(first + vector) * stride..][span.0..span.1];
            step(&factors, [kept(0), kept(1), kept(2), kept(3)], outs);
        }

        let row = row - 1;
        if row < start - 1 {
            continue;
        }
        let span = frame.span(row);
        let out = new_v.begin(row, span);
        if span.0 < span.1 {
            let product = Stencil::new(system, new_r, row, span);
            let own = place(row, span).map(|at| [&mut own.u[at..], &mut own.v[at..]]);
            multiply(&factors, &product, between.row(row, span), out, own);
        }

        let row = row - 1;
        let span = frame.span(row);
        let Some(at) = place(row, span) else { continue };
        if span.0 < span.1 {
            let product = Stencil::new(system, new_v, row, span);
            let diagonal = &system.diagonal[frame.start(row as usize) + span.0..];
            let vectors = [new_r.row(row, span), &own.p[at..], &own.u[at..], diagonal];
            add_products(&product, vectors, &mut own.w[at..], &mut lanes);
        }
        if (row - start) as usize % FLUSH == FLUSH - 1 || row == end - 1 {
            flush(&mut lanes, &mut sums);
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{Portable, PortableDouble};

    fn number(seed: usize) -> f64 {
        ((seed * 2_654_435_761) >> 7) as f64 % 1000.0 / 1000.0
    }

    /// Ties below a fifth on all edges between pixels of a disc, so that rows differ in length.
    fn disc<T: Number>(frame: &Frame) -> (Scaled<'_, T>, Vectors<T>) {
        let mut system = Scaled { frame, right: frame.zeros(), below: frame.zeros(), diagonal: frame.zeros() };
        let mut vectors = Vectors::new(frame);
        for row in 0..frame.height {
            let (lo, hi) = frame.span(row as isize);
            for col in lo..hi {
                let at = frame.start(row) + col;
                let ends_below = frame.span(row as isize + 1);
                system.right[at] = T::of(if col + 1 < hi { -0.2 * number(at) } else { 0.0 });
                system.below[at] =
                    T::of(if (ends_below.0..ends_below.1).contains(&col) { -0.2 * number(at + 7) } else { 0.0 });
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
        band: impl Fn(&Scaled<'_, T>, Steps, &[T], usize, &mut Own<'_, T>, &mut Rings<T>) -> [f64; SUMS],
    ) -> (Vec<f64>, Vec<f64>) {
        let (system, mut vectors) = disc::<T>(frame);
        vectors.keep_edges(frame);
        let Vectors { x, p, r, v, u, w, edges } = &mut vectors;
        let chunk = BAND * frame.stride();
        let mut sums = Vec::new();
        for index in 0..bands(frame) {
            let from = frame.start(0) + index * chunk;
            let [x, p, r, v, u, w] = [&mut *x, p, r, v, u, w].map(|vector| {
                let end = (from + chunk).min(vector.len());
                &mut vector[from..end]
            });
            let mut own = Own { x, p, r, v, u, w };
            sums.extend(band(&system, steps, edges, index, &mut own, &mut Rings::new(frame.width)));
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
        let frame = Frame::new(150, 90, |row, col| (row as f64 - 75.0).hypot(col as f64 - 45.0) < 44.5);
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
