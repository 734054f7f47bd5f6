//! Rows of vectors on their way through a sweep, and what is done to a row.
//!
//! A row here is whole [`LANES`]: slices may be longer, and what is done to them ends with the shortest that sets the length.

use super::frame::LANES;
use super::number::Number;
use super::sweep::{Scaled, Steps};
use crate::memory::Aligned;
use crate::vector::Packed;

/// Sums of [`super::sweep::Products`], in its order.
pub(super) const SUMS: usize = 13;

/// A row in whole lanes.
type Chunks<'a, T> = &'a [[T; LANES]];

/// The first `n` whole lanes of a row.
#[inline(always)]
fn lanes<T>(row: &[T], n: usize) -> Chunks<'_, T> {
    &row.as_chunks().0[..n]
}

#[inline(always)]
fn lanes_mut<T>(row: &mut [T], n: usize) -> &mut [[T; LANES]] {
    &mut row.as_chunks_mut().0[..n]
}

/// Runs the body for each vector of a row: `$chunk` whole lanes, from `$from` of them on.
macro_rules! each_vector {
    ($n:expr, $chunk:ident, $from:ident, $body:block) => {
        for $chunk in 0..$n {
            for part in 0..LANES / V::WIDTH {
                let $from = part * V::WIDTH;
                $body
            }
        }
    };
}

/// The rows on their way through a band.
pub(super) struct Rings<T> {
    /// The new r.
    pub r: Ring<T>,
    /// `A p1`, between the two iterations.
    pub between: Ring<T>,
    /// The new A p.
    pub v: Ring<T>,
}

impl<T: Number> Rings<T> {
    pub fn new(width: usize) -> Self {
        Self { r: Ring::new(width), between: Ring::new(width), v: Ring::new(width) }
    }
}

/// The last three rows of a vector, with zeros at either end.
pub(super) struct Ring<T> {
    rows: [Aligned<T>; 3],
    spans: [(usize, usize); 3],
}

impl<T: Number> Ring<T> {
    fn new(width: usize) -> Self {
        Self { rows: std::array::from_fn(|_| Aligned::zeros(width + 2 * LANES)), spans: [(0, 0); 3] }
    }

    /// Makes room for a row in place of the oldest: its columns `lo..hi` to be written, the others zero.
    #[inline(always)]
    pub fn begin(&mut self, row: isize, (lo, hi): (usize, usize)) -> &mut [T] {
        let slot = row.rem_euclid(3) as usize;
        let (old_lo, old_hi) = self.spans[slot];
        self.spans[slot] = (lo, hi);
        let row = &mut self.rows[slot];
        if old_lo < lo || hi < old_hi {
            row[LANES + old_lo..LANES + old_hi].fill(T::default());
        }
        &mut row[LANES + lo..LANES + hi]
    }

    #[inline(always)]
    pub fn row(&self, row: isize, span: (usize, usize)) -> &[T] {
        self.after(LANES, row, span)
    }

    /// The pixels of a row for `before` of [`LANES`]; one less gives their neighbours to the left, one more to the right.
    #[inline(always)]
    fn after(&self, before: usize, row: isize, (lo, hi): (usize, usize)) -> &[T] {
        &self.rows[row.rem_euclid(3) as usize][before + lo..before + hi]
    }
}

/// A row of the system times a vector whose last rows are in a ring.
pub(super) struct Stencil<'a, T> {
    n: usize,
    /// The vector at each pixel.
    here: Chunks<'a, T>,
    /// To the left, right, above and below: what ties a pixel to its neighbour, and the vector there.
    sides: [(Chunks<'a, T>, Chunks<'a, T>); 4],
}

impl<'a, T: Number> Stencil<'a, T> {
    #[inline(always)]
    pub fn new(system: &'a Scaled<'_, T>, x: &'a Ring<T>, row: isize, span: (usize, usize)) -> Self {
        let Scaled { frame, right, below, .. } = system;
        let (at, stride, n) = (frame.start(row as usize) + span.0, frame.stride(), (span.1 - span.0) / LANES);
        let side = |ties, neighbours| (lanes(ties, n), lanes(neighbours, n));
        Self {
            n,
            here: lanes(x.row(row, span), n),
            sides: [
                side(&right[at - 1..], x.after(LANES - 1, row, span)),
                side(&right[at..], x.after(LANES + 1, row, span)),
                side(&below[at - stride..], x.row(row - 1, span)),
                side(&below[at..], x.row(row + 1, span)),
            ],
        }
    }

    #[inline(always)]
    fn at<V: Packed<Number = T>>(&self, chunk: usize, from: usize) -> V {
        let mut product = V::load(&self.here[chunk][from..]);
        for (ties, values) in &self.sides {
            product = V::load(&ties[chunk][from..]).times_plus(V::load(&values[chunk][from..]), product);
        }
        product
    }
}

/// [`Steps`] as the vectors take them.
pub(super) struct Factors<V> {
    a0: V,
    minus_a0: V,
    b0: V,
    a1: V,
    minus_a1: V,
    b1: V,
    /// `r2 = r + of_v v - a1 u + of_w w`.
    of_v: V,
    of_w: V,
}

impl<T: Number, V: Packed<Number = T>> Factors<V> {
    #[inline(always)]
    pub fn new(Steps { a0, b0, a1, b1 }: Steps) -> Self {
        Self {
            a0: V::splat(T::of(a0)),
            minus_a0: V::splat(T::of(-a0)),
            b0: V::splat(T::of(b0)),
            a1: V::splat(T::of(a1)),
            minus_a1: V::splat(T::of(-a1)),
            b1: V::splat(T::of(b1)),
            of_v: V::splat(T::of(-(a0 + a1 * b0))),
            of_w: V::splat(T::of(a0 * a1)),
        }
    }
}

/// The new residual of a row, and `A p1` between the two iterations.
#[inline(always)]
pub(super) fn step<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    [r, v, u, w]: [&[T]; 4],
    [new_r, between]: [&mut [T]; 2],
) {
    let n = new_r.len() / LANES;
    let (r, v, u, w) = (lanes(r, n), lanes(v, n), lanes(u, n), lanes(w, n));
    let (new_r, between) = (lanes_mut(new_r, n), lanes_mut(between, n));
    each_vector!(n, chunk, from, {
        let (v, u) = (V::load(&v[chunk][from..]), V::load(&u[chunk][from..]));
        let w = V::load(&w[chunk][from..]);
        let r = by.of_w.times_plus(w, by.of_v.times_plus(v, V::load(&r[chunk][from..])));
        by.minus_a1.times_plus(u, r).write(&mut new_r[chunk][from..]);
        by.minus_a0.times_plus(w, by.b0.times_plus(v, u)).write(&mut between[chunk][from..]);
    });
}

/// Takes x, p and r of a row over both iterations.
#[inline(always)]
pub(super) fn advance<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    new_r: &[T],
    v: &[T],
    [x, p, r]: [&mut [T]; 3],
) {
    let n = new_r.len() / LANES;
    let (new_r, v) = (lanes(new_r, n), lanes(v, n));
    let (x, p, r) = (lanes_mut(x, n), lanes_mut(p, n), lanes_mut(r, n));
    each_vector!(n, chunk, from, {
        let p0 = V::load(&p[chunk][from..]);
        let p1 = by.minus_a0.times_plus(V::load(&v[chunk][from..]), by.b0.times_plus(p0, V::load(&r[chunk][from..])));
        let r2 = V::load(&new_r[chunk][from..]);
        by.a1.times_plus(p1, by.a0.times_plus(p0, V::load(&x[chunk][from..]))).write(&mut x[chunk][from..]);
        by.b1.times_plus(p1, r2).write(&mut p[chunk][from..]);
        r2.write(&mut r[chunk][from..]);
    });
}

/// A r of the new r, and with it A p of the new p: `A p2 = A r2 + b1 A p1`. A row of the band's own keeps both.
#[inline(always)]
pub(super) fn multiply<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    product: &Stencil<'_, T>,
    between: &[T],
    new_v: &mut [T],
    own: Option<[&mut [T]; 2]>,
) {
    let (between, new_v) = (lanes(between, product.n), lanes_mut(new_v, product.n));
    let Some([u, v]) = own else {
        each_vector!(product.n, chunk, from, {
            let v = by.b1.times_plus(V::load(&between[chunk][from..]), product.at(chunk, from));
            v.write(&mut new_v[chunk][from..]);
        });
        return;
    };
    let (u, v) = (lanes_mut(u, product.n), lanes_mut(v, product.n));
    each_vector!(product.n, chunk, from, {
        let product: V = product.at(chunk, from);
        product.write(&mut u[chunk][from..]);
        let sum = by.b1.times_plus(V::load(&between[chunk][from..]), product);
        sum.write(&mut v[chunk][from..]);
        sum.write(&mut new_v[chunk][from..]);
    });
}

/// A A p of a row, and its share of the products.
#[inline(always)]
pub(super) fn add_products<T: Number, V: Packed<Number = T>>(
    product: &Stencil<'_, T>,
    [r, p, u, d]: [&[T]; 4],
    w: &mut [T],
    sums: &mut [V; SUMS],
) {
    let n = product.n;
    let (r, p, u, d, out) = (lanes(r, n), lanes(p, n), lanes(u, n), lanes(d, n), lanes_mut(w, n));
    let [mut r_r, mut p_v, mut r_v, mut v_v, mut r_d_r, mut r_d_v, mut v_d_v, ..] = *sums;
    let [.., mut r_u, mut u_v, mut u_u, mut v_w, mut w_w, mut u_w] = *sums;
    each_vector!(n, chunk, from, {
        let w: V = product.at(chunk, from);
        w.write(&mut out[chunk][from..]);
        let (r, p) = (V::load(&r[chunk][from..]), V::load(&p[chunk][from..]));
        let (v, u) = (V::load(&product.here[chunk][from..]), V::load(&u[chunk][from..]));
        let d = V::load(&d[chunk][from..]);
        let (d_r, d_v) = (d * r, d * v);
        r_r = r.times_plus(r, r_r);
        p_v = p.times_plus(v, p_v);
        r_v = r.times_plus(v, r_v);
        v_v = v.times_plus(v, v_v);
        r_d_r = r.times_plus(d_r, r_d_r);
        r_d_v = r.times_plus(d_v, r_d_v);
        v_d_v = v.times_plus(d_v, v_d_v);
        r_u = r.times_plus(u, r_u);
        u_v = u.times_plus(v, u_v);
        u_u = u.times_plus(u, u_u);
        v_w = v.times_plus(w, v_w);
        w_w = w.times_plus(w, w_w);
        u_w = u.times_plus(w, u_w);
    });
    *sums = [r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w];
}

/// Adds up what the lanes hold, and empties them.
#[inline(always)]
pub(super) fn flush<T: Number, V: Packed<Number = T>>(lanes: &mut [V; SUMS], sums: &mut [f64; SUMS]) {
    for (lanes, sum) in lanes.iter_mut().zip(sums) {
        let mut numbers = [T::default(); LANES];
        lanes.write(&mut numbers);
        *sum += numbers[..V::WIDTH].iter().map(|number| number.to_f64()).sum::<f64>();
        *lanes = V::splat(T::default());
    }
}
