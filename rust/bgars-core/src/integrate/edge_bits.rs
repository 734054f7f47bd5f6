//! Which edges a grid has, a bit each: what a mask does around a pixel shows in a few operations for 64 of them at once.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use super::checkerboard::{BAND_ROWS, DOWN, LEFT, RIGHT, UP, Weights};
use crate::memory::Aligned;

/// Reds that one word tells of, the first by its lowest bit.
pub(super) const REDS: usize = u64::BITS as usize;

/// Left, right, up and down.
const SIDES: usize = 4;

/// Sides of any edges, and of real ones.
const ALL_SIDES: usize = 2 * SIDES;

/// For each row, from the one above the grid to the one below: of each side which reds have an edge, virtual ones included,
/// and of each side which have a real one.
#[derive(Debug)]
pub(super) struct EdgeBits {
    rows: Aligned<u64>,
    /// In a row of one side: a word of zeros, those of the reds, and one of zeros.
    side_words: usize,
}

/// The reds of a row that have an edge, by side.
#[derive(Clone, Copy)]
pub(super) struct RowBits<'a> {
    sides: &'a [u64],
    side_words: usize,
}

impl RowBits<'_> {
    /// Those of word `word` that have one to a side.
    #[inline(always)]
    pub fn at(self, side: usize, word: usize) -> u64 {
        self.sides[side * self.side_words + word + 1]
    }

    /// The same of the reds one place before these.
    #[inline(always)]
    pub fn before(self, side: usize, word: usize) -> u64 {
        let at = side * self.side_words + word;
        moved_on(self.sides[at], self.sides[at + 1])
    }

    /// The same of the reds one place behind these.
    #[inline(always)]
    pub fn behind(self, side: usize, word: usize) -> u64 {
        let at = side * self.side_words + word + 1;
        self.sides[at] >> 1 | self.sides[at + 1] << (REDS - 1)
    }

    /// Those that have one to any side.
    #[inline(always)]
    pub fn to_any_side(self, word: usize) -> u64 {
        (self.at(LEFT, word) | self.at(RIGHT, word)) | (self.at(UP, word) | self.at(DOWN, word))
    }
}

/// A word by one place further on, after the one before it.
#[inline(always)]
pub(super) fn moved_on(previous: u64, word: u64) -> u64 {
    previous >> (REDS - 1) | word << 1
}

/// The reds that a word tells of by `bits`, ascending; `word` words are before it.
#[inline(always)]
pub(super) fn reds_of(word: usize, mut bits: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = bits.trailing_zeros() as usize;
        bits &= bits.wrapping_sub(1);
        (bit < REDS).then_some(word * REDS + bit)
    })
}

/// The edges around the centres of an odd row, clockwise from the top (see [`super::lost::Rim`]).
#[derive(Clone, Copy)]
pub(super) struct CellBits<'a> {
    above: RowBits<'a>,
    here: RowBits<'a>,
    below: RowBits<'a>,
}

impl CellBits<'_> {
    /// From each centre to the blacks above, right, below and left.
    #[inline(always)]
    pub fn spokes(self, word: usize) -> [u64; 4] {
        let here = self.here;
        [here.at(UP, word), here.at(RIGHT, word), here.at(DOWN, word), here.at(LEFT, word)]
    }

    /// From each of these blacks to the corners before and after it.
    #[inline(always)]
    pub fn rims(self, word: usize) -> [[u64; 2]; 4] {
        let Self { above, below, .. } = self;
        [
            [above.at(RIGHT, word), above.behind(LEFT, word)],
            [above.behind(DOWN, word), below.behind(UP, word)],
            [below.behind(LEFT, word), below.at(RIGHT, word)],
            [below.at(UP, word), above.at(DOWN, word)],
        ]
    }
}

impl EdgeBits {
    /// The edges of a grid.
    pub fn of(weights: &Weights) -> Self {
        let (rows, half) = (weights.grid.height + 2, weights.grid.half());
        let side_words = half.div_ceil(REDS) + 2;
        let mut bits = Self { rows: Aligned::any(rows * ALL_SIDES * side_words), side_words };
        bits.rows.par_chunks_mut(ALL_SIDES * side_words).with_min_len(BAND_ROWS).enumerate().for_each(|(row, bits)| {
            set_row(weights.row(row as isize - 1).map(|side| &side[1..=half]), bits);
        });
        bits
    }

    /// The reds of `row` (-1 to `height`) that have edges, virtual ones included.
    #[inline(always)]
    pub fn any(&self, row: isize) -> RowBits<'_> {
        self.row(row, 0)
    }

    /// The same of edges that are not virtual.
    #[inline(always)]
    pub fn real(&self, row: isize) -> RowBits<'_> {
        self.row(row, 1)
    }

    #[inline(always)]
    fn row(&self, row: isize, kind: usize) -> RowBits<'_> {
        let words = SIDES * self.side_words;
        RowBits { sides: &self.rows[(2 * (row + 1) as usize + kind) * words..][..words], side_words: self.side_words }
    }

    /// The edges around the centres of odd `row`, virtual ones included.
    #[inline(always)]
    pub fn any_around(&self, row: isize) -> CellBits<'_> {
        CellBits { above: self.any(row - 1), here: self.any(row), below: self.any(row + 1) }
    }

    /// The same without the virtual ones.
    #[inline(always)]
    pub fn real_around(&self, row: isize) -> CellBits<'_> {
        CellBits { above: self.real(row - 1), here: self.real(row), below: self.real(row + 1) }
    }

    /// Adds the virtual edges of red `k` of `row`: where a tie is not zero.
    pub fn tie(&mut self, row: usize, k: usize, ties: [f32; SIDES]) {
        let start = (row + 1) * ALL_SIDES * self.side_words + 1 + k / REDS;
        for (side, tie) in ties.into_iter().enumerate() {
            self.rows[start + side * self.side_words] |= u64::from(tie != 0.0) << (k % REDS);
        }
    }

    /// The words of a row.
    #[inline(always)]
    fn words(&self) -> Range<usize> {
        0..self.side_words - 2
    }

    /// The reds of the words that `tells` makes, ascending. Of those behind the last red of a row it must not tell.
    #[inline(always)]
    pub fn places(&self, tells: impl Fn(usize) -> u64) -> Vec<usize> {
        let mut places = Vec::new();
        for word in self.words() {
            places.extend(reds_of(word, tells(word)));
        }
        places
    }

    /// From the first to the last red of such words; `None` without any.
    pub fn hull(&self, tells: impl Fn(usize) -> u64) -> Option<Range<usize>> {
        let mut words = self.words().filter(|&word| tells(word) != 0);
        let first = words.next()?;
        let last = words.next_back().unwrap_or(first);
        let start = first * REDS + tells(first).trailing_zeros() as usize;
        Some(start..(last + 1) * REDS - tells(last).leading_zeros() as usize)
    }
}

/// Sets the bits of a row from the `weights` of these sides.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
fn set_row(weights: [&[f32]; SIDES], bits: &mut [u64]) {
    let side_words = bits.len() / ALL_SIDES;
    let (any, real) = bits.split_at_mut(SIDES * side_words);
    let sides = any.chunks_exact_mut(side_words).zip(real.chunks_exact_mut(side_words));
    for (weights, (any, real)) in weights.into_iter().zip(sides) {
        let (words, rest) = weights.as_chunks::<REDS>();
        for ((weights, any), real) in words.iter().zip(&mut any[1..]).zip(&mut real[1..]) {
            (*any, *real) = word_of(weights);
        }
        if !rest.is_empty() {
            (any[1 + words.len()], real[1 + words.len()]) = word_of(rest);
        }
        for side in [any, real] {
            (side[0], side[side_words - 1]) = (0, 0);
        }
    }
}

/// Which of up to [`REDS`] weights are not zero, and which are above.
#[inline(always)]
fn word_of(weights: &[f32]) -> (u64, u64) {
    let (mut any, mut real) = (0, 0);
    for (k, &weight) in weights.iter().enumerate() {
        any |= u64::from(weight != 0.0) << k;
        real |= u64::from(weight > 0.0) << k;
    }
    (any, real)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::checkerboard::Grid;
    use crate::integrate::lost::CellRow;

    /// A bit for each edge, and for those one place further on either side; also in grids whose rows fill no word.
    #[test]
    fn every_edge_has_its_bit() {
        let mut grids = vec![Weights::ragged([0.0, 0.0, 0.3, 0.7, 1e-30, -0.5])];
        for (height, width) in [(1, 1), (3, 20), (5, 128), (4, 130)] {
            let mut weights = Weights::zeros(Grid { height, width });
            for row in 0..height {
                for k in 0..width / 2 {
                    weights.set_red(row, k, std::array::from_fn(|side| [0.0, -1.0, 2.0][(row + k * 5 + side) % 3]));
                }
            }
            grids.push(weights);
        }
        for weights in grids {
            let (grid, bits) = (weights.grid, EdgeBits::of(&weights));
            for row in -1..=grid.height as isize {
                for (side, edges) in weights.row(row).into_iter().enumerate() {
                    for (bits, is_there) in [
                        (bits.any(row), (|weight: f32| weight != 0.0) as fn(f32) -> bool),
                        (bits.real(row), |weight| weight > 0.0),
                    ] {
                        for k in 0..grid.half() {
                            let told = |word: u64| word >> (k % REDS) & 1 == 1;
                            let word = k / REDS;
                            let found =
                                [bits.before(side, word), bits.at(side, word), bits.behind(side, word)].map(told);
                            assert_eq!(found, [k, k + 1, k + 2].map(|at| is_there(edges[at])), "{grid:?}, {row}, {k}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn nothing_is_left_of_what_was_there() {
        for half in [1, 64, 100] {
            let weights: Vec<f32> = (0..half).map(|k| [0.0, -1.0, 2.0][k % 3]).collect();
            let len = ALL_SIDES * (half.div_ceil(REDS) + 2);
            let [mut fresh, mut used] = [vec![0; len], vec![u64::MAX; len]];
            for bits in [&mut fresh, &mut used] {
                set_row([&weights; SIDES], bits);
            }
            assert_eq!(fresh, used, "{half}");
        }
    }

    #[test]
    fn cells_are_those_of_their_weights() {
        let weights = Weights::ragged([0.0, 0.0, 0.3, 0.7, 1.0, -0.5]);
        let bits = EdgeBits::of(&weights);
        for row in (1..40).step_by(2) {
            let cells = CellRow::new(&weights, row);
            for k in 0..weights.grid.half() {
                let told = |word: u64| word >> (k % REDS) & 1 == 1;
                let (any, real) = (bits.any_around(row), bits.real_around(row));
                assert_eq!(any.spokes(k / REDS).map(told), cells.spokes.map(|side| side[k] != 0.0));
                assert_eq!(real.spokes(k / REDS).map(told), cells.spokes.map(|side| side[k] > 0.0));
                assert_eq!(
                    any.rims(k / REDS).map(|rim| rim.map(told)),
                    cells.rims.map(|rim| rim.map(|side| side[k] != 0.0))
                );
                assert_eq!(
                    real.rims(k / REDS).map(|rim| rim.map(told)),
                    cells.rims.map(|rim| rim.map(|side| side[k] > 0.0))
                );
            }
        }
    }

    #[test]
    fn a_red_that_is_tied_later_has_its_bits() {
        let mut weights = Weights::ragged([0.0, 0.0, 0.3, 0.7, 1.0, -0.5]);
        let mut bits = EdgeBits::of(&weights);
        for (row, k) in [(0, 0), (0, 44), (39, 44)] {
            let ties = [0.5, 0.0, 0.25, 0.0];
            weights.set_red(row, k, ties.map(|tie: f32| -tie));
            bits.tie(row, k, ties);
        }
        assert_eq!(bits.rows[..], EdgeBits::of(&weights).rows[..]);
    }
}
