//! One pass over the image for two iterations of conjugate gradient.
//!
//! Plain conjugate gradient reads and writes every vector at least once an iteration. Two iterations take only `A p`, `A A p`
//! and `A r` of the vectors before them, and all their coefficients follow from products of these five (Chronopoulos and Gear,
//! "s-step iterative methods for symmetric linear systems", 1989, with s = 2). The five are kept; a sweep updates them row by
//! row, multiplies twice by A (`A r` follows from `A p`, as r from p), and at once takes the products that the next two
//! iterations need. What each iteration does is otherwise that of the textbook, and so is where it ends.

use std::ops::Range;

use rayon::prelude::*;

use super::band::{BESIDE, Band, Scaled, blocks, blocks_mut, edge_length, stride, sweep_band};
use super::frame::{Frame, LANES};
use super::number::Number;
use super::rows::{Block, P, SUMS, Steps, X};
use crate::memory::Aligned;

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

/// The vectors of conjugate gradient.
#[derive(Debug)]
pub(super) struct Vectors<T: Number> {
    bands: Vec<Band<T>>,
    /// [`Edge`](super::rows::Edge)s of each band, row by row: as they were before a sweep, and as they are after it.
    edges: [Aligned<T>; 2],
}

impl<T: Number> Vectors<T> {
    /// All zero.
    pub fn new(frame: &Frame) -> Self {
        let bands: Vec<_> = frame.bands().into_iter().map(|rows| Band::new(frame, rows)).collect();
        let edges = std::array::from_fn(|_| Aligned::zeros(bands.len() * edge_length(frame)));
        Self { bands, edges }
    }

    /// Does `work` to every part of a row: it gets where that begins in framed arrays, and its blocks. Returns the sum of what
    /// it returns, in an order without threads.
    pub fn each_part(&mut self, frame: &Frame, work: impl Fn(usize, &mut [Block<T>]) -> f64 + Sync) -> f64 {
        let stride = stride(frame);
        let bands = self.bands.par_iter_mut().zip(self.edges[0].par_chunks_mut(edge_length(frame)));
        let sums: Vec<f64> = bands
            .map(|(band, edge)| {
                let mut sum = 0.0;
                let rows = blocks_mut(&mut band.blocks).chunks_exact_mut(stride).skip(BESIDE);
                for (row, blocks) in band.rows.clone().zip(rows) {
                    for &(lo, hi) in frame.spans(row as isize) {
                        sum += work(frame.start(row) + lo * LANES, &mut blocks[lo..hi]);
                    }
                }
                band.keep_edge(frame, edge);
                sum
            })
            .collect();
        sums.iter().sum()
    }

    /// Does `work` to every block of the mask.
    pub fn each_block(&mut self, frame: &Frame, work: impl Fn(&mut Block<T>) + Sync) {
        self.each_part(frame, |_, blocks| {
            for block in blocks {
                work(block);
            }
            0.0
        });
    }

    /// `x + ahead p` in some columns of a row.
    pub fn x_ahead(&self, frame: &Frame, row: usize, columns: Range<usize>, ahead: T) -> impl Iterator<Item = T> {
        let band = &self.bands[self.bands.partition_point(|band| band.rows.end <= row)];
        let blocks = &blocks(&band.blocks)[(row - band.rows.start + BESIDE) * stride(frame)..];
        let blocks = &blocks[columns.start / LANES..columns.end / LANES];
        blocks.iter().flat_map(move |block| block[X].iter().zip(&block[P]).map(move |(&x, &p)| x + ahead * p))
    }
}

/// Takes two iterations and returns the products of the vectors after them, summed in an order without threads.
pub(super) fn sweep<T: Number>(system: &Scaled<'_, T>, steps: Steps, vectors: &mut Vectors<T>) -> Products {
    let frame = system.frame;
    let Vectors { bands, edges: [before, after] } = vectors;
    let bands = bands.par_iter_mut().zip(after.par_chunks_mut(edge_length(frame)));
    let sums: Vec<[f64; SUMS]> = bands
        .enumerate()
        .map(|(index, (band, edge))| {
            let sums = sweep_band(system, steps, before, index, band);
            band.keep_edge(frame, edge);
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

#[cfg(test)]
mod tests {
    use super::super::band::sweep_band_with;
    use super::super::rows::{BELOW, DIAGONAL, RIGHT, Ties, VECTORS};
    use super::*;
    use crate::vector::{Portable, PortableDouble};

    fn number(seed: usize) -> f64 {
        ((seed * 2_654_435_761) >> 7) as f64 % 1000.0 / 1000.0
    }

    /// Ties below a fifth on all edges between pixels of a frame, and any vectors.
    fn tied<T: Number>(frame: &Frame) -> (Scaled<'_, T>, Vectors<T>) {
        let used =
            |row: isize, col: usize| frame.spans(row).iter().any(|&(lo, hi)| (lo * LANES..hi * LANES).contains(&col));
        let (mut system, mut vectors) = (Scaled::new(frame), Vectors::new(frame));
        let stride = stride(frame);
        for row in 0..frame.height() {
            for col in (0..frame.width).filter(|&col| used(row as isize, col)) {
                let seed = row * frame.width + col;
                let ties: &mut [Ties<T>] = system.ties.as_chunks_mut().0.as_chunks_mut().0;
                let ties = &mut ties[(row + 1) * stride + col / LANES];
                let tie = |other: bool, seed: usize| T::of(if other { -0.2 * number(seed) } else { 0.0 });
                ties[RIGHT][col % LANES] = tie(used(row as isize, col + 1), seed);
                ties[BELOW][col % LANES] = tie(used(row as isize + 1, col), seed + 7);
                ties[DIAGONAL][col % LANES] = T::of(1.0 + number(seed + 3));
                let band = vectors.bands.iter_mut().find(|band| band.rows.contains(&row)).unwrap();
                let block = &mut blocks_mut(&mut band.blocks)[(row - band.rows.start + BESIDE) * stride + col / LANES];
                for (vector, lanes) in block.iter_mut().enumerate() {
                    lanes[col % LANES] = T::of(number(seed * VECTORS + vector) - 0.5);
                }
            }
        }
        for (band, edge) in vectors.bands.iter().zip(vectors.edges[0].chunks_mut(edge_length(frame))) {
            band.keep_edge(frame, edge);
        }
        (system, vectors)
    }

    /// The vectors after a sweep, in which each band is worked on by `band`.
    fn swept<T: Number>(
        frame: &Frame,
        steps: Steps,
        sweep_band: impl Fn(&Scaled<'_, T>, Steps, &[T], usize, &mut Band<T>) -> [f64; SUMS],
    ) -> (Vec<f64>, Vec<f64>) {
        let (system, mut vectors) = tied::<T>(frame);
        let [edges, _] = &vectors.edges;
        let (mut numbers, mut sums) = (Vec::new(), Vec::new());
        for (index, band) in vectors.bands.iter_mut().enumerate() {
            sums.extend(sweep_band(&system, steps, edges, index, band));
            let own = &blocks(&band.blocks)[BESIDE * stride(frame)..][..band.rows.len() * stride(frame)];
            numbers.extend(own.as_flattened().as_flattened().iter().map(|number| number.to_f64()));
        }
        (numbers, sums)
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
