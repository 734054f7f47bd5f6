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

/// The rows on their way through a band.
pub(super) struct Rings<T: Number> {
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
pub(super) struct Ring<T: Number> {
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

/// What ties a row's pixels to their neighbours on a side, and the vector there.
type Side<'a, V> = (&'a [<V as Packed>::Chunk], &'a [<V as Packed>::Chunk]);

/// A row of the system times a vector whose last rows are in a ring.
pub(super) struct Stencil<'a, V: Packed> {
    /// The vector at each pixel.
    here: &'a [V::Chunk],
    /// To the left, right, above and below.
    sides: [Side<'a, V>; 4],
}

impl<'a, T: Number, V: Packed<Number = T>> Stencil<'a, V> {
    #[inline(always)]
    pub fn new(system: &'a Scaled<'_, T>, x: &'a Ring<T>, row: isize, span: (usize, usize)) -> Self {
        let Scaled { frame, right, below, .. } = system;
        let (at, stride, n) = (frame.start(row as usize) + span.0, frame.stride(), (span.1 - span.0) / V::WIDTH);
        let side = |ties, neighbours| (V::chunks(ties, n), V::chunks(neighbours, n));
        Self {
            here: V::chunks(x.row(row, span), n),
            sides: [
                side(&right[at - 1..], x.after(LANES - 1, row, span)),
                side(&right[at..], x.after(LANES + 1, row, span)),
                side(&below[at - stride..], x.row(row - 1, span)),
                side(&below[at..], x.row(row + 1, span)),
            ],
        }
    }

    /// How many vectors there are.
    #[inline(always)]
    fn len(&self) -> usize {
        self.here.len()
    }

    #[inline(always)]
    fn at(&self, k: usize) -> V {
        let mut product = V::read(&self.here[k]);
        for (ties, values) in &self.sides {
            product = V::read(&ties[k]).times_plus(V::read(&values[k]), product);
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
    let n = new_r.len() / V::WIDTH;
    let (r, v, u, w) = (V::chunks(r, n), V::chunks(v, n), V::chunks(u, n), V::chunks(w, n));
    let (new_r, between) = (V::chunks_mut(new_r, n), V::chunks_mut(between, n));
    for k in 0..n {
        let (v, u) = (V::read(&v[k]), V::read(&u[k]));
        let w = V::read(&w[k]);
        let r = by.of_w.times_plus(w, by.of_v.times_plus(v, V::read(&r[k])));
        by.minus_a1.times_plus(u, r).put(&mut new_r[k]);
        by.minus_a0.times_plus(w, by.b0.times_plus(v, u)).put(&mut between[k]);
    }
}

/// Takes x, p and r of a row over both iterations.
#[inline(always)]
pub(super) fn advance<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    new_r: &[T],
    v: &[T],
    [x, p, r]: [&mut [T]; 3],
) {
    let n = new_r.len() / V::WIDTH;
    let (new_r, v) = (V::chunks(new_r, n), V::chunks(v, n));
    let (x, p, r) = (V::chunks_mut(x, n), V::chunks_mut(p, n), V::chunks_mut(r, n));
    for k in 0..n {
        let p0 = V::read(&p[k]);
        let p1 = by.minus_a0.times_plus(V::read(&v[k]), by.b0.times_plus(p0, V::read(&r[k])));
        let r2 = V::read(&new_r[k]);
        by.a1.times_plus(p1, by.a0.times_plus(p0, V::read(&x[k]))).put(&mut x[k]);
        by.b1.times_plus(p1, r2).put(&mut p[k]);
        r2.put(&mut r[k]);
    }
}

/// A r of the new r, and with it A p of the new p: `A p2 = A r2 + b1 A p1`. A row of the band's own keeps both.
#[inline(always)]
pub(super) fn multiply<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    product: &Stencil<'_, V>,
    between: &[T],
    new_v: &mut [T],
    own: Option<[&mut [T]; 2]>,
) {
    let (between, new_v) = (V::chunks(between, product.len()), V::chunks_mut(new_v, product.len()));
    let Some([u, v]) = own else {
        for k in 0..product.len() {
            let v = by.b1.times_plus(V::read(&between[k]), product.at(k));
            v.put(&mut new_v[k]);
        }
        return;
    };
    let (u, v) = (V::chunks_mut(u, product.len()), V::chunks_mut(v, product.len()));
    for k in 0..product.len() {
        let product: V = product.at(k);
        product.put(&mut u[k]);
        let sum = by.b1.times_plus(V::read(&between[k]), product);
        sum.put(&mut v[k]);
        sum.put(&mut new_v[k]);
    }
}

/// A A p of a row, and its share of the products.
#[inline(always)]
pub(super) fn add_products<T: Number, V: Packed<Number = T>>(
    product: &Stencil<'_, V>,
    [r, p, u, d]: [&[T]; 4],
    w: &mut [T],
    sums: &mut [V; SUMS],
) {
    let n = product.len();
    let (r, p, u, d, out) = (V::chunks(r, n), V::chunks(p, n), V::chunks(u, n), V::chunks(d, n), V::chunks_mut(w, n));
    let [mut r_r, mut p_v, mut r_v, mut v_v, mut r_d_r, mut r_d_v, mut v_d_v, ..] = *sums;
    let [.., mut r_u, mut u_v, mut u_u, mut v_w, mut w_w, mut u_w] = *sums;
    for k in 0..n {
        let w: V = product.at(k);
        w.put(&mut out[k]);
        let (r, p) = (V::read(&r[k]), V::read(&p[k]));
        let (v, u) = (V::read(&product.here[k]), V::read(&u[k]));
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
