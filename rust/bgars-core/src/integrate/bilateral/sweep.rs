//! One pass over the image for two iterations of conjugate gradient.
//!
//! Plain conjugate gradient reads and writes every vector at least once an iteration. Two iterations take only `A p`, `A A p`
//! and `A r` of the vectors before them, and all their coefficients follow from products of these five (Chronopoulos and Gear,
//! "s-step iterative methods for symmetric linear systems", 1989, with s = 2). A sweep makes the five row by row, updates with
//! them, and at once takes the products that the next two iterations need; between sweeps only x, p and r are kept. What each
//! iteration does is otherwise that of the textbook, and so is where it ends.

use multiversion::multiversion;
use rayon::prelude::*;

use super::frame::{Aligned, Frame, LANES};
use super::number::Number;
use super::rows::{Ring, Row, Sides};

/// Rows that one task sweeps; it makes three more on either side for itself.
const BAND: usize = 64;
/// Rows after which the sums of `f32` go over into `f64`.
const FLUSH: isize = 8;

/// `I - C` of a 5-point system scaled to a diagonal of ones. Arrays are framed.
#[derive(Debug)]
pub(super) struct Scaled<'a, T> {
    pub frame: &'a Frame,
    /// `C` between each pixel and its right neighbour.
    pub right: Aligned<T>,
    /// `C` between each pixel and the one below.
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

/// The vectors of conjugate gradient, framed; `next` holds p and r while they are made.
#[derive(Debug)]
pub(super) struct Vectors<T> {
    pub x: Aligned<T>,
    pub p: Aligned<T>,
    pub r: Aligned<T>,
    pub next: [Aligned<T>; 2],
}

/// Takes two iterations and returns the products of the vectors after them, summed in an order without threads.
pub(super) fn sweep<T: Number>(system: &Scaled<'_, T>, steps: Steps, vectors: &mut Vectors<T>) -> Products {
    let chunk = BAND * system.frame.stride();
    let first = system.frame.start(0);
    let Vectors { x, p, r, next: [next_p, next_r] } = vectors;
    let old = [&p[..], &r[..]];
    let sums: Vec<[f64; 13]> = x[first..]
        .par_chunks_mut(chunk)
        .zip(next_p[first..].par_chunks_mut(chunk))
        .zip(next_r[first..].par_chunks_mut(chunk))
        .take(system.frame.height.div_ceil(BAND))
        .enumerate()
        .map(|(band, ((x, next_p), next_r))| {
            sweep_band(system, steps, old, band * BAND, Out { x, p: next_p, r: next_r })
        })
        .collect();
    std::mem::swap(p, next_p);
    std::mem::swap(r, next_r);
    let mut total = [0.0; 13];
    for sums in sums {
        for (total, sum) in total.iter_mut().zip(sums) {
            *total += sum;
        }
    }
    let [r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w] = total;
    Products { r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w }
}

/// One band of a sweep. A row goes through four stages, each a row behind the one before, whose neighbours it needs.
struct Band<'a, T> {
    system: &'a Scaled<'a, T>,
    steps: Steps,
    /// Of the vectors as they were: A p and A r.
    old: [Ring<T>; 2],
    /// A p1.
    between: Ring<T>,
    /// The vectors as they become: p, r, A p and A r.
    new: [Ring<T>; 4],
    /// A A p of one row.
    squared: Aligned<T>,
    lanes: [[T; LANES]; 13],
}

/// Where a band writes: the rows of x, p and r that it owns.
struct Out<'a, T> {
    x: &'a mut [T],
    p: &'a mut [T],
    r: &'a mut [T],
}

impl<T: Number> Band<'_, T> {
    #[inline(always)]
    fn place(&self, row: isize, (lo, hi): (usize, usize)) -> Row {
        let frame = self.system.frame;
        Row { at: frame.start(row as usize) + lo, n: hi - lo, stride: frame.stride() }
    }

    /// A p and A r.
    #[inline(always)]
    fn multiply(&mut self, row: isize, p: &[T], r: &[T]) {
        let span = self.system.frame.span(row);
        let place = (span.0 < span.1).then(|| self.place(row, span));
        let [v, u] = &mut self.old;
        let outs = [v.begin(row, span), u.begin(row, span)];
        if let Some(place) = place {
            Sides::new(self.system, place).apply_both([p, r], place, outs);
        }
    }

    /// A A p, and with it both iterations; `out` for a row of the band's own, and its place there.
    #[inline(always)]
    fn iterate(&mut self, row: isize, p: &[T], r: &[T], out: Option<(&mut Out<'_, T>, usize)>) {
        let span = self.system.frame.span(row);
        let Steps { a0, b0, a1, b1 } = self.steps;
        // r2 = r - of_v v - a1 u + of_w w
        let (of_v, of_w) = (T::of(a0 + a1 * b0), T::of(a0 * a1));
        let [a0, b0, a1, b1] = [a0, b0, a1, b1].map(T::of);
        let [new_p, new_r, ..] = &mut self.new;
        let (new_p, new_r, between) = (new_p.begin(row, span), new_r.begin(row, span), self.between.begin(row, span));
        if span.0 == span.1 {
            return;
        }
        let n = span.1 - span.0;
        let at = self.system.frame.start(row as usize) + span.0;
        let w = &mut self.squared[..n];
        let [v, u] = &self.old;
        Sides::new(self.system, Row { at, n, stride: self.system.frame.stride() }).apply(v, row, span, w);
        let (v, u) = (&v.row(row, span)[..n], &u.row(row, span)[..n]);
        let (p, r) = (&p[at..][..n], &r[at..][..n]);
        let (new_p, new_r, between) = (&mut new_p[..n], &mut new_r[..n], &mut between[..n]);
        for k in 0..n {
            let p1 = (r[k] - a0 * v[k]) + b0 * p[k];
            let r2 = (r[k] - of_v * v[k]) - (a1 * u[k] - of_w * w[k]);
            new_r[k] = r2;
            new_p[k] = r2 + b1 * p1;
            between[k] = (u[k] - a0 * w[k]) + b0 * v[k];
        }
        if let Some((out, offset)) = out {
            let place = offset + span.0;
            out.p[place..][..n].copy_from_slice(new_p);
            out.r[place..][..n].copy_from_slice(new_r);
            let x = &mut out.x[place..][..n];
            for k in 0..n {
                let p1 = (r[k] - a0 * v[k]) + b0 * p[k];
                x[k] += a0 * p[k] + a1 * p1;
            }
        }
    }

    /// A r of the new r, and with it A p of the new p: `A p2 = A r2 + b1 A p1`.
    #[inline(always)]
    fn multiply_new(&mut self, row: isize) {
        let span = self.system.frame.span(row);
        let b1 = T::of(self.steps.b1);
        let place = (span.0 < span.1).then(|| self.place(row, span));
        let [_, r, v, u] = &mut self.new;
        let (v, u) = (v.begin(row, span), u.begin(row, span));
        let Some(place) = place else { return };
        Sides::new(self.system, place).apply(r, row, span, u);
        let (v, u, between) = (&mut v[..place.n], &u[..place.n], &self.between.row(row, span)[..place.n]);
        for k in 0..place.n {
            v[k] = u[k] + b1 * between[k];
        }
    }

    /// A A p of the new p, and the products.
    #[inline(always)]
    fn add_products(&mut self, row: isize) {
        let span = self.system.frame.span(row);
        if span.0 == span.1 {
            return;
        }
        let place = self.place(row, span);
        let w = &mut self.squared[..place.n];
        let [p, r, v, u] = &self.new;
        Sides::new(self.system, place).apply(v, row, span, w);
        let (p, r, v, u) = (p.row(row, span), r.row(row, span), v.row(row, span), u.row(row, span));
        let d = &self.system.diagonal[place.at..][..place.n];
        let [r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w] = &mut self.lanes;
        add([r, p, v], [r_r, p_v, r_v, v_v], |[r, p, v]| [r * r, p * v, r * v, v * v]);
        add([r, v, d], [r_d_r, r_d_v, v_d_v], |[r, v, d]| [d * r * r, d * r * v, d * v * v]);
        add([r, u, v], [r_u, u_v, u_u], |[r, u, v]| [r * u, u * v, u * u]);
        add([v, w, u], [v_w, w_w, u_w], |[v, w, u]| [v * w, w * w, u * w]);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn sweep_band<T: Number>(
    system: &Scaled<'_, T>,
    steps: Steps,
    [p, r]: [&[T]; 2],
    first: usize,
    mut out: Out<'_, T>,
) -> [f64; 13] {
    let width = system.frame.width;
    let mut band = Band {
        system,
        steps,
        old: std::array::from_fn(|_| Ring::new(width)),
        between: Ring::new(width),
        new: std::array::from_fn(|_| Ring::new(width)),
        squared: Aligned::zeros(width),
        lanes: [[T::default(); LANES]; 13],
    };
    let mut sums = [0.0; 13];
    let (start, end) = (first as isize, (first + BAND).min(system.frame.height) as isize);
    for row in start - 3..end + 3 {
        band.multiply(row, p, r);
        if row > start - 2 {
            let own = (start..end).contains(&(row - 1));
            let offset = (row - 1 - start) * system.frame.stride() as isize;
            band.iterate(row - 1, p, r, own.then_some((&mut out, offset as usize)));
        }
        if row > start {
            band.multiply_new(row - 2);
        }
        if row > start + 2 {
            band.add_products(row - 3);
            if (row - 3 - start) % FLUSH == FLUSH - 1 || row - 3 == end - 1 {
                for (sum, lanes) in sums.iter_mut().zip(&mut band.lanes) {
                    *sum += lanes.iter().map(|lane| lane.to_f64()).sum::<f64>();
                    *lanes = [T::default(); LANES];
                }
            }
        }
    }
    sums
}

/// Adds to each of `sums` its product of three rows, whose length is a multiple of [`LANES`].
#[inline(always)]
fn add<T: Number, const N: usize>(rows: [&[T]; 3], sums: [&mut [T; LANES]; N], products: impl Fn([T; 3]) -> [T; N]) {
    let n = rows[0].len();
    let (a, b, c) = (&rows[0][..n], &rows[1][..n], &rows[2][..n]);
    let mut lanes = [[T::default(); LANES]; N];
    for i in 0..N {
        lanes[i] = *sums[i];
    }
    for ((a, b), c) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)).zip(c.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let products = products([a[lane], b[lane], c[lane]]);
            for i in 0..N {
                lanes[i][lane] += products[i];
            }
        }
    }
    for (sum, lanes) in sums.into_iter().zip(lanes) {
        *sum = lanes;
    }
}
