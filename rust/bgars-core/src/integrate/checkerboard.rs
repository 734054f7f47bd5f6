//! The pixel grid as a checkerboard: every edge joins a red and a black pixel.
//!
//! Pixel (row, col) is red where row + col is even. A row of `width` pixels is kept as `half = ceil(width / 2)` reds and as many
//! blacks: red k of an even row is column 2k and black k column 2k + 1; in odd rows it is the other way round (a pixel that is
//! missing at the end is one without edges). Then the neighbours of red k above and below are black k, and left and right
//! are two blacks that follow each other, so every stencil runs over contiguous memory.

use multiversion::multiversion;

/// Rows of pixels that one task works on; even, so that tasks own whole rows of the coarse grid.
pub(super) const BAND_ROWS: usize = 32;
/// Values that are worth waking a thread for: some microseconds.
pub(super) const TASK: usize = 1 << 14;

/// One of the two colours of pixels, which are also the two parts of a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Colour {
    Red = 0,
    Black = 1,
}

/// Both of them, in the order in which vectors keep them.
pub(super) const COLOURS: [Colour; 2] = [Colour::Red, Colour::Black];

impl Colour {
    /// That of the pixel at some row and column.
    pub fn at(row: usize, col: usize) -> Self {
        COLOURS[(row + col) % 2]
    }

    pub fn other(self) -> Self {
        COLOURS[1 - self as usize]
    }

    /// 0 if the first pixel of a row has this colour, else 1.
    #[inline(always)]
    pub fn first_col(self, row: usize) -> usize {
        (row + self as usize) % 2
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Grid {
    pub height: usize,
    pub width: usize,
}

impl Grid {
    /// Pixels of one colour in a row.
    pub fn half(self) -> usize {
        self.width.div_ceil(2)
    }

    pub fn half_pixels(self) -> usize {
        self.height * self.half()
    }

    /// The grid of blocks of 2 x 2 pixels.
    pub fn coarse(self) -> Self {
        Self { height: self.height.div_ceil(2), width: self.half() }
    }
}

/// The bounding box of a mask, its first row and column in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crop {
    pub row: usize,
    pub col: usize,
    pub grid: Grid,
}

impl Crop {
    /// The smallest box around a mask that has at least one pixel.
    pub fn around(mask: &[bool], width: usize) -> Self {
        let rows: Vec<&[bool]> = mask.chunks(width).collect();
        let top = rows.iter().position(|row| row.contains(&true)).unwrap_or(0);
        let bottom = rows.iter().rposition(|row| row.contains(&true)).unwrap_or(0);
        let (mut left, mut right) = (width, 0);
        for row in &rows[top..=bottom] {
            left = row.iter().take(left).position(|&used| used).unwrap_or(left);
            right += row[right..].iter().rposition(|&used| used).map_or(0, |col| col + 1);
        }
        Self { row: top, col: left, grid: Grid { height: bottom + 1 - top, width: right - left } }
    }
}

/// The colour of a row's first pixel, and the other one.
#[inline(always)]
pub(super) fn by_column<T>(row: usize, [reds, blacks]: [T; 2]) -> [T; 2] {
    if row.is_multiple_of(2) { [reds, blacks] } else { [blacks, reds] }
}

/// Splits a row of pixels into its reds and blacks, with zeros for a pixel that is missing at the end.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn split_row<T: Copy + Default>(row: usize, pixels: &[T], [reds, blacks]: [&mut [T]; 2]) {
    let [first, second] = by_column(row, [reds, blacks]);
    for (pair, (first, second)) in pixels.chunks_exact(2).zip(first.iter_mut().zip(second.iter_mut())) {
        (*first, *second) = (pair[0], pair[1]);
    }
    if pixels.len() % 2 == 1 {
        (first[pixels.len() / 2], second[pixels.len() / 2]) = (pixels[pixels.len() - 1], T::default());
    }
}

/// Joins reds and blacks to a row of pixels.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx512bw", "x86_64+avx2+fma"))]
pub(super) fn join_row<T: Copy>(row: usize, [reds, blacks]: [&[T]; 2], pixels: &mut [T]) {
    let [first, second] = by_column(row, [reds, blacks]);
    for (pair, (&first, &second)) in pixels.chunks_exact_mut(2).zip(first.iter().zip(second)) {
        (pair[0], pair[1]) = (first, second);
    }
    let last = pixels.len() / 2;
    if let Some(pixel) = pixels.chunks_exact_mut(2).into_remainder().first_mut() {
        *pixel = first[last];
    }
}
