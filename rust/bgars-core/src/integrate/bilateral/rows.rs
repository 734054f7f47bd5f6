//! What a sweep does to a row.

use super::frame::LANES;
use super::number::Number;
use super::sweep::Steps;
use crate::vector::Packed;

/// Sums of [`super::sweep::Products`], in its order.
pub(super) const SUMS: usize = 13;

/// All vectors at [`LANES`] pixels of a row, side by side: a sweep walks along one stream of memory, and a part of a row is one
/// slice.
pub(super) type Block<T> = [[T; LANES]; VECTORS];
pub(super) const X: usize = 0;
pub(super) const P: usize = 1;
pub(super) const R: usize = 2;
/// Between the two iterations `A p1`.
pub(super) const A_P: usize = 3;
pub(super) const A_R: usize = 4;
pub(super) const A_A_P: usize = 5;
/// Vectors of a block.
pub(super) const VECTORS: usize = 6;

/// What a band needs of a block beside it: r, A p, A r and A A p.
pub(super) type Edge<T> = [[T; LANES]; KEPT];
/// Vectors of an edge, the last of a block.
pub(super) const KEPT: usize = VECTORS - R;

/// The system at [`LANES`] pixels.
pub(super) type Ties<T> = [[T; LANES]; TIES];
/// `-C` between each pixel and its right neighbour.
pub(super) const RIGHT: usize = 0;
/// `-C` between each pixel and the one below.
pub(super) const BELOW: usize = 1;
/// The diagonal that was scaled to one.
pub(super) const DIAGONAL: usize = 2;
/// Numbers of a pixel in the ties.
pub(super) const TIES: usize = 3;

/// Vector `part` of some lanes.
#[inline(always)]
fn read<T: Number, V: Packed<Number = T>>(lanes: &[T; LANES], part: usize) -> V {
    V::read(&V::chunks(lanes, LANES / V::WIDTH)[part])
}

#[inline(always)]
fn write<T: Number, V: Packed<Number = T>>(vector: V, lanes: &mut [T; LANES], part: usize) {
    vector.put(&mut V::chunks_mut(lanes, LANES / V::WIDTH)[part]);
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

    /// The new residual, and `A p1` between the two iterations.
    #[inline(always)]
    fn step(&self, [r, v, u, w]: [V; 4]) -> [V; 2] {
        let new_r = self.minus_a1.times_plus(u, self.of_w.times_plus(w, self.of_v.times_plus(v, r)));
        [new_r, self.minus_a0.times_plus(w, self.b0.times_plus(v, u))]
    }
}

/// Takes a row of the band over both iterations: x, p and r; v becomes `A p1`.
#[inline(always)]
pub(super) fn advance<T: Number, V: Packed<Number = T>>(by: &Factors<V>, row: &mut [Block<T>]) {
    for block in row {
        for part in 0..LANES / V::WIDTH {
            let [x, p0, r0, v0, u, w] = block.each_ref().map(|lanes| read::<T, V>(lanes, part));
            let [r2, a_p1] = by.step([r0, v0, u, w]);
            let p1 = by.minus_a0.times_plus(v0, by.b0.times_plus(p0, r0));
            write(by.a1.times_plus(p1, by.a0.times_plus(p0, x)), &mut block[X], part);
            write(by.b1.times_plus(p1, r2), &mut block[P], part);
            write(r2, &mut block[R], part);
            write(a_p1, &mut block[A_P], part);
        }
    }
}

/// The same of a row beside the band, of which it needs r and v alone.
#[inline(always)]
pub(super) fn advance_beside<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    edge: &[Edge<T>],
    row: &mut [Block<T>],
) {
    for (edge, block) in edge.iter().zip(row) {
        for part in 0..LANES / V::WIDTH {
            let [r, a_p1] = by.step(edge.each_ref().map(|lanes| read::<T, V>(lanes, part)));
            write(r, &mut block[R], part);
            write(a_p1, &mut block[A_P], part);
        }
    }
}

/// A row with those above and below, and what ties them.
pub(super) struct Around<'a, T> {
    pub above: &'a [Block<T>],
    /// A block longer than the others.
    pub here: &'a mut [Block<T>],
    pub below: &'a [Block<T>],
    pub ties_above: &'a [Ties<T>],
    pub ties: &'a [Ties<T>],
}

impl<T> Around<'_, T> {
    /// The slices, their lengths known to the loops.
    #[inline(always)]
    fn cut(&mut self) -> Around<'_, T> {
        let n = self.ties.len();
        Around {
            above: &self.above[..n],
            here: &mut self.here[..=n],
            below: &self.below[..n],
            ties_above: &self.ties_above[..n],
            ties: &self.ties[..n],
        }
    }
}

/// What the pixels before give to those on their right, and the vector at the pixels to come.
struct Walk<V> {
    before: V,
    here: V,
}

impl<T: Number, V: Packed<Number = T>> Walk<V> {
    #[inline(always)]
    fn new(first: &[T; LANES]) -> Self {
        Self { before: V::splat(T::default()), here: read(first, 0) }
    }

    /// Vector `OF` at part `part` of block k, and its product with the system.
    #[inline(always)]
    fn next<const OF: usize>(&mut self, row: &Around<'_, T>, k: usize, part: usize) -> [V; 2] {
        let is_last = part + 1 == LANES / V::WIDTH;
        let next = if is_last { read(&row.here[k + 1][OF], 0) } else { read(&row.here[k][OF], part + 1) };
        let (here, tie) = (self.here, read::<T, V>(&row.ties[k][RIGHT], part));
        let given = tie * here;
        let mut product = here + given.after_last_of(self.before);
        product = tie.times_plus(here.before_first_of(next), product);
        product = read::<T, V>(&row.ties_above[k][BELOW], part).times_plus(read(&row.above[k][OF], part), product);
        product = read::<T, V>(&row.ties[k][BELOW], part).times_plus(read(&row.below[k][OF], part), product);
        self.before = given;
        self.here = next;
        [here, product]
    }
}

/// A r of the new r, and with it A p of the new p: `A p2 = A r2 + b1 A p1`, the last from its place and to it.
#[inline(always)]
pub(super) fn multiply<T: Number, V: Packed<Number = T>>(by: &Factors<V>, mut row: Around<'_, T>) {
    let row = row.cut();
    let mut walk = Walk::<V>::new(&row.here[0][R]);
    for k in 0..row.ties.len() {
        for part in 0..LANES / V::WIDTH {
            let [_, a_r] = walk.next::<R>(&row, k, part);
            let block = &mut row.here[k];
            write(a_r, &mut block[A_R], part);
            write(by.b1.times_plus(read(&block[A_P], part), a_r), &mut block[A_P], part);
        }
    }
}

/// A A p of a row, and its share of the products.
#[inline(always)]
pub(super) fn add_products<T: Number, V: Packed<Number = T>>(mut row: Around<'_, T>, sums: &mut [V; SUMS]) {
    let row = row.cut();
    let [mut r_r, mut p_v, mut r_v, mut v_v, mut r_d_r, mut r_d_v, mut v_d_v, ..] = *sums;
    let [.., mut r_u, mut u_v, mut u_u, mut v_w, mut w_w, mut u_w] = *sums;
    let mut walk = Walk::<V>::new(&row.here[0][A_P]);
    for k in 0..row.ties.len() {
        for part in 0..LANES / V::WIDTH {
            let [v, w] = walk.next::<A_P>(&row, k, part);
            let block = &mut row.here[k];
            write(w, &mut block[A_A_P], part);
            let (r, p): (V, V) = (read(&block[R], part), read(&block[P], part));
            let u: V = read(&block[A_R], part);
            let d: V = read(&row.ties[k][DIAGONAL], part);
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
