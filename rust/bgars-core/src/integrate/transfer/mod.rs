//! Between a grid and the next coarser one, with smoothing on the way: the two halves of a V-cycle.
//!
//! Everything acts on the *reduced* system: the blacks are eliminated exactly, so only the reds are unknown,
//! `S = D_red - W D_black^-1 W^T`. Reds of even rows are the corners (the pixels of the coarser grid), reds of odd rows the
//! centres; blacks lie on the edges between corners. A value of the coarser grid reaches the blacks of even rows from left
//! and right, those of odd rows from above and below, in proportion to the weights of these edges, and from the blacks the
//! centres. Nothing passes an edge of weight zero, so the two sides of a cut stay apart however thin it is.
//!
//! Smoothing is one damping-free Jacobi step on the reduced system (a red-black Gauss-Seidel sweep on the whole) on the way
//! down and its adjoint on the way up. Both halves are plain functions of their input: no thread sees another one's writes. On
//! the finest grid the way up goes on to conjugate gradient's next direction and its product (`advance`), on the others to the
//! blacks (`fill`), which the way down eliminates as it reads them (`right_side`).

mod advance;
mod fill;
mod prolong;
mod restrict;
mod right_side;

pub(super) use advance::{Below, advance};
pub(super) use fill::prolong_and_fill;
pub(super) use prolong::prolong;
pub(super) use restrict::restrict;
pub(super) use right_side::RightSide;

use super::checkerboard::{DOWN, LEFT, RIGHT, UP, Weights};
use super::ring::Ring;
use super::spans::Span;
use super::stencil::Sides;
use crate::vector::Packed;

/// The weights between a row's blacks and their corners: left and right in even rows, above and below in odd ones.
#[inline(always)]
fn corner_ties<V: Packed<Number = f32>>(weights: &Weights, row: isize, span: Span) -> [&[V::Floats]; 2] {
    let Sides([left, right, up, down]) = weights.blacks::<V>(row, span);
    if row.rem_euclid(2) == 0 { [left, right] } else { [up, down] }
}

/// The weights that tie the centres of an odd row to blacks that have a corner themselves.
struct CentreTies<'a, V: Packed> {
    sides: [&'a [V::Floats]; 4],
    /// Of the black on each side, to its corners.
    ties: [&'a [V::Chunk]; 4],
}

impl<'a, V: Packed<Number = f32>> CentreTies<'a, V> {
    #[inline(always)]
    fn new(sides: [&'a [V::Floats]; 4], row: isize, span: Span, ties: &'a Ring<f32>) -> Self {
        let n = span.vectors::<V>();
        let [above, here, below] = ties.around(row);
        let first = 1 + span.start;
        let ties = [
            V::chunks(&here[first..], n),
            V::chunks(&here[first + 1..], n),
            V::chunks(&above[first..], n),
            V::chunks(&below[first..], n),
        ];
        Self { sides, ties }
    }

    /// Their sum at vector `k`.
    #[inline(always)]
    fn sum(&self, k: usize) -> V {
        let mut sum = V::widen(&self.sides[LEFT][k]).where_positive(V::read(&self.ties[LEFT][k]));
        for side in [RIGHT, UP, DOWN] {
            sum = sum + V::widen(&self.sides[side][k]).where_positive(V::read(&self.ties[side][k]));
        }
        sum
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Grid;
    use crate::integrate::reduction::{eliminate_blacks, fill_and_join, multiply};
    use crate::integrate::steps::Steps;
    use crate::integrate::strays::Changes;
    use crate::memory::Aligned;
    use crate::vector::{One, Portable};

    fn number(seed: usize) -> f32 {
        ((seed * 2_654_435_761) >> 7) as f32 % 1000.0 / 1000.0
    }

    /// Edges of any weight, a quarter of them missing and some virtual.
    fn weights(grid: Grid) -> Weights {
        let mut weights = Weights::zeros(grid);
        for row in 0..grid.height {
            for k in 0..grid.width / 2 {
                let weight = |side: usize| match (row * 991 + k * 4 + side) % 16 {
                    0..4 => 0.0,
                    4 => -0.5,
                    _ => number(row * 991 + k * 4 + side),
                };
                let [left, right, up, down] = std::array::from_fn(weight);
                let inside = |edge: f32, there: bool| if there { edge } else { 0.0 };
                let (first, last) = (k > 0, k + 1 < grid.width / 2);
                let ends = [inside(left, first), inside(right, last), inside(up, row > 0)];
                weights.set_red(row, k, [ends[0], ends[1], ends[2], inside(down, row + 1 < grid.height)]);
            }
        }
        weights
    }

    fn assert_near(a: &[f32], b: &[f32]) {
        assert!(a.iter().any(|a| *a != 0.0));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= 1e-5 * (1.0 + b.abs()), "{a} for {b}");
        }
    }

    type Whole<'a> = dyn Fn(&mut RightSide<'_>, &mut restrict::Restricting, [&mut [f32]; 2], &mut [[f64; 2]]) + 'a;
    type Down<'a> = dyn Fn(&mut restrict::Restricting, [&mut [f32]; 2], &mut [[f64; 2]]) + 'a;

    #[test]
    fn every_instruction_set_does_the_same() {
        let grid = Grid { height: 32, width: 64 };
        let (weights, n, coarse) = (weights(grid), grid.half(), grid.coarser());
        let b: Vec<f32> = (0..grid.half_pixels()).map(|place| number(place) - 0.5).collect();
        let down = |task: &Down<'_>| {
            let [mut reds, mut blacks] = [vec![0.0; coarse.half_pixels()], vec![0.0; coarse.half_pixels()]];
            let mut energies = [[0.0; 2]];
            task(&mut restrict::Restricting::new(n), [&mut reds, &mut blacks], &mut energies);
            [reds, blacks, vec![energies[0][1] as f32]].concat()
        };
        let fast =
            down(&|rows, out, sum| restrict::restrict_rows(&weights, &mut RightSide::Reds(&b), 0, rows, out, sum));
        let portable = down(&|rows, out, sum| {
            restrict::restrict_rows_with::<Portable>(&weights, &mut RightSide::Reds(&b), 0, rows, out, sum);
        });
        let one = down(&|rows, out, sum| {
            restrict::restrict_rows_with::<One<f32>>(&weights, &mut RightSide::Reds(&b), 0, rows, out, sum);
        });
        assert_near(&fast, &portable);
        assert_near(&fast, &one);

        let correction: Vec<f32> = (0..coarse.height * coarse.width).map(|place| number(place + 5) - 0.5).collect();
        let up = |task: &dyn Fn(&mut prolong::Prolonging, &mut [f32])| {
            let mut x = vec![0.0; grid.half_pixels()];
            task(&mut prolong::Prolonging::new(n), &mut x);
            x
        };
        let fast = up(&|rows, x| prolong::prolong_rows(&weights, &b, &correction, 0, rows, x));
        let portable = up(&|rows, x| prolong::prolong_rows_with::<Portable>(&weights, &b, &correction, 0, rows, x));
        let one = up(&|rows, x| prolong::prolong_rows_with::<One<f32>>(&weights, &b, &correction, 0, rows, x));
        assert_near(&fast, &portable);
        assert_near(&fast, &one);

        let blacks: Vec<f32> = b.iter().rev().copied().collect();
        let whole = |task: &Whole<'_>| {
            let mut reduced = vec![0.0; grid.half_pixels()];
            let mut next = [(); 2].map(|()| vec![0.0; coarse.half_pixels()]);
            let mut right = RightSide::Whole { colours: [&b, &blacks], reduced: &mut reduced };
            let out = next.each_mut().map(|colour| &mut colour[..]);
            task(&mut right, &mut restrict::Restricting::new(n), out, &mut [[0.0; 2]]);
            [next.concat(), reduced].concat()
        };
        let fast = whole(&|right, rows, out, sum| restrict::restrict_rows(&weights, right, 0, rows, out, sum));
        let portable = whole(&|right, rows, out, sum| {
            restrict::restrict_rows_with::<Portable>(&weights, right, 0, rows, out, sum);
        });
        let one = whole(&|right, rows, out, sum| {
            restrict::restrict_rows_with::<One<f32>>(&weights, right, 0, rows, out, sum);
        });
        assert_near(&fast, &portable);
        assert_near(&fast, &one);

        let changes = Changes::new(&[], Vec::new());
        let below = Below { b: &b, coarse: &correction, changes: &changes };
        let filled = |task: &dyn Fn(&mut fill::Filling, &mut [f32])| {
            let mut solution = vec![0.0; grid.height * grid.width];
            task(&mut fill::Filling::new(n), &mut solution);
            solution
        };
        let fast = filled(&|rows, out| fill::fill_rows(&weights, below, &blacks, 0, rows, out));
        let portable = filled(&|rows, out| fill::fill_rows_with::<Portable>(&weights, below, &blacks, 0, rows, out));
        let one = filled(&|rows, out| fill::fill_rows_with::<One<f32>>(&weights, below, &blacks, 0, rows, out));
        assert_near(&fast, &portable);
        assert_near(&fast, &one);
    }

    /// Up, turned, multiplied and stepped along in one go, and one after the other: with the same bits, for any number of threads.
    #[test]
    fn the_next_direction_is_what_four_passes_make() {
        let changed: Vec<u32> = (0..4_000).step_by(117).collect();
        for (height, width) in [(1, 64), (33, 20), (9, 1), (300, 70), (130, 64)] {
            let grid = Grid { height, width };
            let (mut weights, n, coarse) = (weights(grid), grid.half(), grid.coarser());
            weights.find_spans();
            let b: Vec<f32> = (0..grid.half_pixels()).map(|place| number(place) - 0.5).collect();
            let correction: Vec<f32> = (0..coarse.height * coarse.width).map(|place| number(place + 5) - 0.5).collect();
            let [before, previous]: [Vec<f32>; 2] =
                [77, 9].map(|seed| (0..grid.half_pixels()).map(|place| number(place + seed) - 0.5).collect());
            let reds: Vec<u32> = changed.iter().copied().filter(|&red| (red as usize) < grid.half_pixels()).collect();
            let changes = Changes::new(&reds, reds.iter().map(|&red| number(red as usize)).collect());

            let mut p = vec![0.0; grid.half_pixels()];
            prolong(&weights, &b, &correction, &mut p);
            changes.add_to(0, &mut p);
            // A product is fused with its sum where the processor does so.
            let near = |fast: f32, slow: f32| (fast - slow).abs() <= 1e-6 * (1.0 + slow.abs());
            let below = Below { b: &b, coarse: &correction, changes: &changes };
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let start = (threads > 1).then(|| Aligned::zeros(p.len()));
                let mut steps = Steps::from(start, p.len());
                steps.add(0.7);
                steps.add(-1.3);
                let due = steps.due();
                let mut found = (before.clone(), vec![0.0; p.len()]);
                let product =
                    pool.install(|| advance(&weights, below, (0.25, &previous), due, &mut found.0, &mut found.1));
                for (at, x) in steps.end(&weights, [&[], &[]]).iter().enumerate() {
                    let is_inside = weights.spans.at((at / n) as isize).range().contains(&(at % n));
                    let taken = 0.7 * f64::from(before[at]) - 1.3 * f64::from(previous[at]);
                    assert!((x - if is_inside { taken } else { 0.0 }).abs() < 1e-12, "{grid:?}: steps of red {at}");
                }
                let mut expected = vec![0.0; p.len()];
                let slow = multiply(&weights, &found.0, &mut expected);
                assert_eq!(found.1, expected, "{grid:?}, {threads} threads");
                assert!((product - slow).abs() <= 1e-12 * slow.abs(), "{grid:?}: {product} for {slow}");
                for row in 0..height {
                    for k in weights.spans.at(row as isize).range() {
                        let at = row * n + k;
                        assert!(near(found.0[at], p[at] + 0.25 * previous[at]), "{grid:?}: row {row}, red {k}");
                    }
                }
            }
        }
    }

    /// Eliminated and restricted, or prolonged and filled in, row by row, and one pass after the other: the same bits, for any
    /// number of threads.
    #[test]
    fn a_whole_grid_in_one_pass_is_as_in_two() {
        let changed: Vec<u32> = (0..4_000).step_by(131).collect();
        for (height, width) in [(1, 64), (33, 20), (9, 1), (300, 70), (130, 64)] {
            let grid = Grid { height, width };
            let (mut weights, size, coarse) = (weights(grid), grid.half_pixels(), grid.coarser());
            weights.find_spans();
            let in_spans = |seed: usize| -> Vec<f32> {
                let mut values = vec![0.0; size];
                for row in 0..height {
                    for k in weights.spans.at(row as isize).range() {
                        values[row * grid.half() + k] = number(row * grid.half() + k + seed) - 0.5;
                    }
                }
                values
            };
            let (reds, blacks) = (in_spans(0), in_spans(99));
            let mut eliminated = reds.clone();
            let of_blacks = eliminate_blacks(&weights, &mut eliminated, &blacks);
            let down = |right: RightSide<'_>| {
                let mut next = [(); 2].map(|()| vec![0.0; coarse.half_pixels()]);
                let sums = restrict(&weights, right, next.each_mut().map(|colour| &mut colour[..]));
                (sums, next)
            };
            let expected = down(RightSide::Reds(&eliminated));
            assert_eq!(expected.0[0], 0.0);
            assert_eq!(expected.1.iter().flatten().any(|&value| value != 0.0), width > 1, "{grid:?}");

            let correction: Vec<f32> = (0..coarse.height * coarse.width).map(|place| number(place + 5) - 0.5).collect();
            let changed: Vec<u32> = changed.iter().copied().filter(|&red| (red as usize) < size).collect();
            let changes = Changes::new(&changed, changed.iter().map(|&red| number(red as usize)).collect());
            let mut solved = vec![0.0; size];
            prolong(&weights, &eliminated, &correction, &mut solved);
            changes.add_to(0, &mut solved);
            let mut solution = vec![0.0; height * width];
            fill_and_join(&weights, &solved, &mut blacks.clone(), &mut solution);
            for threads in [1, 2, 3] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let mut reduced = vec![0.0; size];
                let whole = RightSide::Whole { colours: [&reds, &blacks], reduced: &mut reduced };
                let (sums, next) = pool.install(|| down(whole));
                assert_eq!((sums, &next), ([of_blacks, expected.0[1]], &expected.1), "{grid:?}, {threads} threads");
                assert_eq!(reduced, eliminated, "{grid:?}, {threads} threads");

                let below = Below { b: &reduced, coarse: &correction, changes: &changes };
                let mut found = vec![0.0; solution.len()];
                pool.install(|| prolong_and_fill(&weights, below, &blacks, &mut found));
                assert_eq!(found, solution, "{grid:?}, {threads} threads");
            }
        }
    }

    /// Rows of a matrix times a vector.
    fn times(matrix: &[Vec<f64>], vector: &[f64]) -> Vec<f64> {
        matrix.iter().map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum()).collect()
    }

    fn transposed(matrix: &[Vec<f64>]) -> Vec<Vec<f64>> {
        (0..matrix[0].len()).map(|col| matrix.iter().map(|row| row[col]).collect()).collect()
    }

    fn inverse(value: f64) -> f64 {
        if value > 0.0 { value.recip() } else { 0.0 }
    }

    /// Both halves by matrices that are written down: reds by blacks, and reds by corners.
    #[test]
    fn both_halves_are_those_of_plain_matrices() {
        let grid = Grid { height: 9, width: 64 };
        let (mut weights, n, reds) = (weights(grid), grid.half(), grid.half_pixels());
        let mut edges = vec![vec![0.0; reds]; reds];
        for row in 0..grid.height {
            for k in 0..n {
                let at = row as isize;
                let sides = weights.row(at);
                let mut sides = sides.map(|side| side[k + 1]);
                if row % 2 == 1 {
                    // Virtual edges are tied to corners.
                    sides = sides.map(|weight| weight.max(0.0));
                    weights.set_red(row, k, sides);
                }
                let left = (row * n + k).wrapping_add_signed(row as isize % 2 - 1);
                let ends = [left, left.wrapping_add(1), (row * n + k).wrapping_sub(n), row * n + k + n];
                for (weight, end) in sides.into_iter().zip(ends).filter(|(weight, _)| *weight != 0.0) {
                    edges[row * n + k][end] = f64::from(weight);
                }
            }
        }
        let real: Vec<Vec<f64>> = edges.iter().map(|row| row.iter().map(|weight| weight.max(0.0)).collect()).collect();
        let scale = |matrix: &[Vec<f64>]| -> Vec<f64> { matrix.iter().map(|row| inverse(row.iter().sum())).collect() };
        let (of_reds, of_blacks) = (scale(&real), scale(&transposed(&real)));
        let by = |scale: &[f64], vector: &[f64]| -> Vec<f64> { scale.iter().zip(vector).map(|(a, b)| a * b).collect() };
        let around = |x: &[f64]| times(&real, &by(&of_blacks, &times(&transposed(&real), x)));
        let corners: Vec<usize> = (0..reds).filter(|red| red / n % 2 == 0).collect();
        let to_corners = |black: usize| corners.iter().map(|&corner| edges[corner][black].abs()).collect::<Vec<_>>();
        let on_blacks: Vec<Vec<f64>> = (0..reds)
            .map(|black| {
                let ties = to_corners(black);
                let share = inverse(ties.iter().sum());
                ties.iter().map(|tie| tie * share).collect()
            })
            .collect();
        let interpolation: Vec<Vec<f64>> = (0..reds)
            .map(|red| {
                if red / n % 2 == 0 {
                    return corners.iter().map(|&corner| f64::from(u8::from(corner == red))).collect();
                }
                let tied = |black: usize| on_blacks[black].iter().any(|share| *share > 0.0);
                let share = inverse((0..reds).filter(|&black| tied(black)).map(|black| real[red][black]).sum());
                times(&transposed(&on_blacks), &real[red]).iter().map(|sum| sum * share).collect()
            })
            .collect();
        let single = |values: &[f64]| -> Vec<f32> { values.iter().map(|value| *value as f32).collect() };

        let b: Vec<f64> = (0..reds).map(|place| f64::from(number(place)) - 0.5).collect();
        let coarse: Vec<f64> = (0..corners.len()).map(|place| f64::from(number(place + 5)) - 0.5).collect();
        let sum: Vec<f64> = by(&of_reds, &b).iter().zip(times(&interpolation, &coarse)).map(|(a, c)| a + c).collect();
        let around_sum: Vec<f64> = b.iter().zip(around(&sum)).map(|(b, n)| b + n).collect();
        let mut x = vec![0.0; reds];
        prolong(&weights, &single(&b), &single(&coarse), &mut x);
        assert_near(&x, &single(&by(&of_reds, &around_sum)));

        let expected = times(&transposed(&interpolation), &around(&by(&of_reds, &b)));
        let half = grid.coarser().half();
        let colours: [Vec<f32>; 2] = std::array::from_fn(|_| vec![0.0; grid.coarser().half_pixels()]);
        let [mut reds, mut blacks] = colours;
        restrict(&weights, RightSide::Reds(&single(&b)), [&mut reds, &mut blacks]);
        let found = (0..corners.len()).map(|at| (at / n, at % n)).map(|(row, k)| {
            let colour = if (row + k) % 2 == 0 { &reds } else { &blacks };
            colour[row * half + k / 2]
        });
        assert_near(&found.collect::<Vec<_>>(), &single(&expected));
    }
}
