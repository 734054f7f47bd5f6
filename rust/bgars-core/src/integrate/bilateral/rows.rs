//! What a sweep does to a row.

use super::frame::LANES;
use super::number::Number;
use crate::vector::Packed;

/// What two iterations do: `r1 = r - a0 A p`, `p1 = r1 + b0 p`, `r2 = r1 - a1 A p1`, `p2 = r2 + b1 p1`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Steps {
    pub a0: f64,
    pub b0: f64,
    pub a1: f64,
    pub b1: f64,
}

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

/// What a band needs of a block beside it: all but x.
pub(super) type Edge<T> = [[T; LANES]; KEPT];
/// Vectors of an edge, the last of a block.
pub(super) const KEPT: usize = VECTORS - P;

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
    minus_b1: V,
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
            minus_b1: V::splat(T::of(-b1)),
        }
    }

    /// p between the two iterations, `A p1`, and residual and p after them.
    #[inline(always)]
    fn step(&self, [p, r, v, u, w]: [V; 5]) -> [V; 4] {
        let r1 = self.minus_a0.times_plus(v, r);
        let p1 = self.b0.times_plus(p, r1);
        let a_p1 = self.minus_a0.times_plus(w, self.b0.times_plus(v, u));
        let r2 = self.minus_a1.times_plus(a_p1, r1);
        [p1, a_p1, r2, self.b1.times_plus(p1, r2)]
    }
}

/// Takes a row of the band over both iterations: x, p and r; v becomes `A p1`.
#[inline(always)]
pub(super) fn advance<T: Number, V: Packed<Number = T>>(by: &Factors<V>, row: &mut [Block<T>]) {
    for block in row {
        for part in 0..LANES / V::WIDTH {
            advance_part(by, block, part);
        }
    }
}

#[inline(always)]
fn advance_part<T: Number, V: Packed<Number = T>>(by: &Factors<V>, block: &mut Block<T>, part: usize) {
    let [x, p, r, v, u, w] = block.each_ref().map(|lanes| read::<T, V>(lanes, part));
    let [p1, a_p1, r2, p2] = by.step([p, r, v, u, w]);
    write(by.a1.times_plus(p1, by.a0.times_plus(p, x)), &mut block[X], part);
    write(p2, &mut block[P], part);
    write(r2, &mut block[R], part);
    write(a_p1, &mut block[A_P], part);
}

/// The same of a row beside the band, of which it needs p alone.
#[inline(always)]
pub(super) fn advance_beside<T: Number, V: Packed<Number = T>>(
    by: &Factors<V>,
    edge: &[Edge<T>],
    row: &mut [Block<T>],
) {
    for (edge, block) in edge.iter().zip(row) {
        for part in 0..LANES / V::WIDTH {
            let [.., p2] = by.step(edge.each_ref().map(|lanes| read::<T, V>(lanes, part)));
            write(p2, &mut block[P], part);
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

    #[inline(always)]
    fn cross(&self, k: usize) -> Cross<'_, T> {
        Cross {
            above: &self.above[k],
            here: self.here,
            below: &self.below[k],
            ties_above: &self.ties_above[k],
            ties: &self.ties[k],
        }
    }
}

/// A block of a row with those above and below, and what ties them.
struct Cross<'a, T> {
    above: &'a Block<T>,
    /// The whole row.
    here: &'a [Block<T>],
    below: &'a Block<T>,
    ties_above: &'a Ties<T>,
    ties: &'a Ties<T>,
}

/// Four rows that follow each other, and what ties them.
pub(super) struct Rows<'a, T> {
    pub top: &'a [Block<T>],
    /// A block longer than the others, as is `middle`.
    pub last: &'a mut [Block<T>],
    pub middle: &'a mut [Block<T>],
    pub front: &'a mut [Block<T>],
    pub ties_top: &'a [Ties<T>],
    pub ties_last: &'a [Ties<T>],
    pub ties_middle: &'a [Ties<T>],
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

    /// Vector `OF` at part `part` of block `here[k]`, and its product with the system.
    #[inline(always)]
    fn next<const OF: usize>(&mut self, at: &Cross<'_, T>, k: usize, part: usize) -> [V; 2] {
        let Cross { above, here, below, ties_above, ties } = at;
        let is_last = part + 1 == LANES / V::WIDTH;
        let next = if is_last { read(&here[k + 1][OF], 0) } else { read(&here[k][OF], part + 1) };
        let (here, tie) = (self.here, read::<T, V>(&ties[RIGHT], part));
        let given = tie * here;
        let mut product = here + given.after_last_of(self.before);
        product = tie.times_plus(here.before_first_of(next), product);
        product = read::<T, V>(&ties_above[BELOW], part).times_plus(read(&above[OF], part), product);
        product = read::<T, V>(&ties[BELOW], part).times_plus(read(&below[OF], part), product);
        self.before = given;
        self.here = next;
        [here, product]
    }
}

/// A p of the new p, and with it A r of the new r.
#[inline(always)]
pub(super) fn multiply<T: Number, V: Packed<Number = T>>(by: &Factors<V>, mut row: Around<'_, T>) {
    let row = row.cut();
    let mut walk = Walk::<V>::new(&row.here[0][P]);
    for k in 0..row.ties.len() {
        for part in 0..LANES / V::WIDTH {
            let [_, a_p] = walk.next::<P>(&row.cross(k), k, part);
            keep_a_p(by, a_p, &mut row.here[k], part);
        }
    }
}

/// `A r2 = A p2 - b1 A p1`, the last from the place of A p. The other way round, A p from A r, would hand the rounding of one A p
/// on to the next.
#[inline(always)]
fn keep_a_p<T: Number, V: Packed<Number = T>>(by: &Factors<V>, a_p: V, block: &mut Block<T>, part: usize) {
    write(by.minus_b1.times_plus(read(&block[A_P], part), a_p), &mut block[A_R], part);
    write(a_p, &mut block[A_P], part);
}

/// A A p of a row, and its share of the products.
#[inline(always)]
pub(super) fn add_products<T: Number, V: Packed<Number = T>>(mut row: Around<'_, T>, sums: &mut [V; SUMS]) {
    let row = row.cut();
    let mut own = *sums;
    let mut walk = Walk::<V>::new(&row.here[0][A_P]);
    for k in 0..row.ties.len() {
        for part in 0..LANES / V::WIDTH {
            let products = walk.next::<A_P>(&row.cross(k), k, part);
            add_products_of(products, &mut row.here[k], &row.ties[k], part, &mut own);
        }
    }
    *sums = own;
}

/// What a part of a block, with its `[A p, A A p]`, adds to the sums.
#[inline(always)]
fn add_products_of<T: Number, V: Packed<Number = T>>(
    [v, w]: [V; 2],
    block: &mut Block<T>,
    ties: &Ties<T>,
    part: usize,
    sums: &mut [V; SUMS],
) {
    write(w, &mut block[A_A_P], part);
    let (r, p): (V, V) = (read(&block[R], part), read(&block[P], part));
    let u: V = read(&block[A_R], part);
    let d: V = read(&ties[DIAGONAL], part);
    let (d_r, d_v) = (d * r, d * v);
    let [r_r, p_v, r_v, v_v, r_d_r, r_d_v, v_d_v, r_u, u_v, u_u, v_w, w_w, u_w] = sums;
    *r_r = r.times_plus(r, *r_r);
    *p_v = p.times_plus(v, *p_v);
    *r_v = r.times_plus(v, *r_v);
    *v_v = v.times_plus(v, *v_v);
    *r_d_r = r.times_plus(d_r, *r_d_r);
    *r_d_v = r.times_plus(d_v, *r_d_v);
    *v_d_v = v.times_plus(d_v, *v_d_v);
    *r_u = r.times_plus(u, *r_u);
    *u_v = u.times_plus(v, *u_v);
    *u_u = u.times_plus(u, *u_u);
    *v_w = v.times_plus(w, *v_w);
    *w_w = w.times_plus(w, *w_w);
    *u_w = u.times_plus(w, *u_w);
}

/// The front row advances, the one above it is multiplied, and the last adds its products, block by block: to begin two more
/// loops a row takes as long as two blocks.
#[inline(always)]
pub(super) fn all_stages<T: Number, V: Packed<Number = T>>(by: &Factors<V>, rows: Rows<'_, T>, sums: &mut [V; SUMS]) {
    let Rows { top, last, middle, front, ties_top, ties_last, ties_middle } = rows;
    // Their lengths known to the loop.
    let n = front.len();
    let (top, last, middle, front) = (&top[..n], &mut last[..=n], &mut middle[..=n], &mut front[..n]);
    let [ties_top, ties_last, ties_middle] = [ties_top, ties_last, ties_middle].map(|ties| &ties[..n]);
    let mut own = *sums;
    let (mut walk_middle, mut walk_last) = (Walk::<V>::new(&middle[0][P]), Walk::<V>::new(&last[0][A_P]));
    for k in 0..n {
        for part in 0..LANES / V::WIDTH {
            advance_part(by, &mut front[k], part);
            let (ties_above, ties) = (&ties_last[k], &ties_middle[k]);
            let cross = Cross { above: &last[k], here: middle, below: &front[k], ties_above, ties };
            let [_, a_p] = walk_middle.next::<P>(&cross, k, part);
            keep_a_p(by, a_p, &mut middle[k], part);
            let (ties_above, ties) = (&ties_top[k], &ties_last[k]);
            let cross = Cross { above: &top[k], here: last, below: &middle[k], ties_above, ties };
            let products = walk_last.next::<A_P>(&cross, k, part);
            add_products_of(products, &mut last[k], ties, part, &mut own);
        }
    }
    *sums = own;
}

/// Adds what the lanes hold to their sums.
#[inline(always)]
pub(super) fn flush<T: Number, V: Packed<Number = T>>(lanes: &[V; SUMS], sums: &mut [[f64; LANES]; SUMS]) {
    for (lanes, sums) in lanes.iter().zip(sums) {
        let mut numbers = [T::default(); LANES];
        lanes.write(&mut numbers);
        for (sum, number) in sums.iter_mut().zip(numbers) {
            *sum += number.to_f64();
        }
    }
}
