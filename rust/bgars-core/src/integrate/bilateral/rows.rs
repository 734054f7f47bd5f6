//! Rows of vectors on their way through a sweep, and what is done to a row.
//!
//! A row here is whole [`LANES`]; of a slice that is longer the rest is left alone.

use super::frame::LANES;
use super::number::Number;
use super::sweep::{Scaled, Steps};
use crate::memory::Aligned;
use crate::vector::Packed;

/// Sums of [`super::sweep::Products`], in its order.
pub(super) const SUMS: usize = 13;

/// Rows beside a band, as the band needs them.
#[derive(Debug)]
pub(super) struct Beside<T: Number> {
    /// The new r.
    pub r: Ring<T>,
    /// `A p1`, between the two iterations.
    pub between: Ring<T>,
    /// The new A p.
    pub v: Ring<T>,
}

impl<T: Number> Beside<T> {
    pub fn new(width: usize) -> Self {
        Self { r: Ring::new(width), between: Ring::new(width), v: Ring::new(width) }
    }

    /// Sets all numbers to zero.
    pub fn clear(&mut self) {
        for ring in [&mut self.r, &mut self.between, &mut self.v] {
            ring.rows.iter_mut().for_each(|row| row.fill(T::default()));
        }
    }
}

/// Three rows of a vector. Where a row has no pixel, numbers of earlier ones are left: no tie reaches them.
#[derive(Debug)]
pub(super) struct Ring<T: Number> {
    rows: [Aligned<T>; 3],
}

impl<T: Number> Ring<T> {
    fn new(width: usize) -> Self {
        Self { rows: std::array::from_fn(|_| Aligned::zeros(width + LANES)) }
    }

    /// Room for some columns of a row, in place of the oldest.
    #[inline(always)]
    pub fn row_mut(&mut self, row: isize, (lo, hi): (usize, usize)) -> &mut [T] {
        &mut self.rows[row.rem_euclid(3) as usize][lo..hi]
    }

    #[inline(always)]
    pub fn row(&self, row: isize, (lo, hi): (usize, usize)) -> &[T] {
        &self.rows[row.rem_euclid(3) as usize][lo..hi]
    }
}

/// A row of the system times a vector, from left to right.
pub(super) struct Stencil<'a, V: Packed> {
    /// The vector at each pixel, above and below.
    values: [&'a [V::Chunk]; 3],
    /// What ties each pixel to the one on its right, above and below.
    ties: [&'a [V::Chunk]; 3],
    /// The vector and the tie to the right, of the pixels before.
    before: [V; 2],
    /// The vector at the pixels to come.
    here: V,
}

impl<'a, T: Number, V: Packed<Number = T>> Stencil<'a, V> {
    /// `rows` are the vector's above, at and below `row`, from the first pixel of the span; the one at `row` is [`LANES`] longer.
    #[inline(always)]
    pub fn new(system: &'a Scaled<'_, T>, rows: [&'a [T]; 3], row: isize, span: (usize, usize)) -> Self {
        let Scaled { frame, right, below, .. } = system;
        let (at, stride, n) = (frame.start(row as usize) + span.0, frame.stride(), (span.1 - span.0) / V::WIDTH);
        let zero = V::splat(T::default());
        let [above, here, beneath] = rows;
        let here = V::chunks(here, n + 1);
        Self {
            values: [here, V::chunks(above, n), V::chunks(beneath, n)],
            ties: [V::chunks(&right[at..], n), V::chunks(&below[at - stride..], n), V::chunks(&below[at..], n)],
            before: [zero, zero],
            here: V::read(&here[0]),
        }
    }

    /// How many vectors there are.
    #[inline(always)]
    fn len(&self) -> usize {
        self.ties[0].len()
    }

    /// The vector here, and the product.
    #[inline(always)]
    fn next(&mut self, k: usize) -> [V; 2] {
        let (here, next) = (self.here, V::read(&self.values[0][k + 1]));
        let tie = V::read(&self.ties[0][k]);
        let mut product = tie.after_last_of(self.before[1]).times_plus(here.after_last_of(self.before[0]), here);
        product = tie.times_plus(here.before_first_of(next), product);
        product = V::read(&self.ties[1][k]).times_plus(V::read(&self.values[1][k]), product);
        product = V::read(&self.ties[2][k]).times_plus(V::read(&self.values[2][k]), product);
        self.before = [here, tie];
        self.here = next;
        [here, product]
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

/// The new residual, and `A p1` between the two iterations.
#[inline(always)]
fn stepped<V: Packed>(by: &Factors<V>, r: V, v: V, u: V, w: V) -> [V; 2] {
    let new_r = by.minus_a1.times_plus(u, by.of_w.times_plus(w, by.of_v.times_plus(v, r)));
    [new_r, by.minus_a0.times_plus(w, by.b0.times_plus(v, u))]
}

/// Takes a row's residual over both iterations: what a band needs of its neighbours.
#[inline(always)]
pub(super) fn step<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    [r, v, u, w]: [&[T]; 4],
    [new_r, between]: [&mut [T]; 2],
) {
    let n = new_r.len() / V::WIDTH;
    let (r, v, u, w) = (V::chunks(r, n), V::chunks(v, n), V::chunks(u, n), V::chunks(w, n));
    let (new_r, between) = (V::chunks_mut(new_r, n), V::chunks_mut(between, n));
    for k in 0..n {
        let [r, a_p1] = stepped(by, V::read(&r[k]), V::read(&v[k]), V::read(&u[k]), V::read(&w[k]));
        r.put(&mut new_r[k]);
        a_p1.put(&mut between[k]);
    }
}

/// The same of the first `n` vectors of a row of the band, with x and p; v becomes `A p1`.
#[inline(always)]
pub(super) fn advance<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    [x, p, r, v]: [&mut [T]; 4],
    [u, w]: [&[T]; 2],
    n: usize,
) {
    let [x, p, r, v] = [x, p, r, v].map(|vector| V::chunks_mut(vector, n));
    let (u, w) = (V::chunks(u, n), V::chunks(w, n));
    for k in 0..n {
        let (p0, r0, v0) = (V::read(&p[k]), V::read(&r[k]), V::read(&v[k]));
        let [r2, a_p1] = stepped(by, r0, v0, V::read(&u[k]), V::read(&w[k]));
        let p1 = by.minus_a0.times_plus(v0, by.b0.times_plus(p0, r0));
        by.a1.times_plus(p1, by.a0.times_plus(p0, V::read(&x[k]))).put(&mut x[k]);
        by.b1.times_plus(p1, r2).put(&mut p[k]);
        r2.put(&mut r[k]);
        a_p1.put(&mut v[k]);
    }
}

/// A r of the new r, and with it A p of the new p: `A p2 = A r2 + b1 A p1`, the last from v and to it.
#[inline(always)]
pub(super) fn multiply<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    mut product: Stencil<'_, V>,
    [u, v]: [&mut [T]; 2],
) {
    let (u, v) = (V::chunks_mut(u, product.len()), V::chunks_mut(v, product.len()));
    for k in 0..product.len() {
        let [_, a_r] = product.next(k);
        a_r.put(&mut u[k]);
        by.b1.times_plus(V::read(&v[k]), a_r).put(&mut v[k]);
    }
}

/// A p of a row beside the band.
#[inline(always)]
pub(super) fn multiply_beside<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    mut product: Stencil<'_, V>,
    between: &[T],
    v: &mut [T],
) {
    let (between, v) = (V::chunks(between, product.len()), V::chunks_mut(v, product.len()));
    for k in 0..product.len() {
        let [_, a_r] = product.next(k);
        by.b1.times_plus(V::read(&between[k]), a_r).put(&mut v[k]);
    }
}

/// A A p of a row, and its share of the products.
#[inline(always)]
pub(super) fn add_products<T: Number, V: Packed<Number = T>>(
    mut product: Stencil<'_, V>,
    [r, p, u, d]: [&[T]; 4],
    w: &mut [T],
    sums: &mut [V; SUMS],
) {
    let n = product.len();
    let (r, p, u, d, out) = (V::chunks(r, n), V::chunks(p, n), V::chunks(u, n), V::chunks(d, n), V::chunks_mut(w, n));
    let [mut r_r, mut p_v, mut r_v, mut v_v, mut r_d_r, mut r_d_v, mut v_d_v, ..] = *sums;
    let [.., mut r_u, mut u_v, mut u_u, mut v_w, mut w_w, mut u_w] = *sums;
    for k in 0..n {
        let [v, w] = product.next(k);
        w.put(&mut out[k]);
        let (r, p) = (V::read(&r[k]), V::read(&p[k]));
        let u = V::read(&u[k]);
        let d = V::read(&d[k]);
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
    }
    *sums = [r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w];
}

/// Adds what the lanes hold to their sums, and empties them.
#[inline(always)]
pub(super) fn flush<T: Number, V: Packed<Number = T>>(lanes: &mut [V; SUMS], sums: &mut [[f64; LANES]; SUMS]) {
    for (lanes, sums) in lanes.iter_mut().zip(sums) {
        let mut numbers = [T::default(); LANES];
        lanes.write(&mut numbers);
        for (sum, number) in sums.iter_mut().zip(numbers) {
            *sum += number.to_f64();
        }
        *lanes = V::splat(T::default());
    }
}
