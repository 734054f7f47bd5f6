//! Losses that do not matter: what the coarser grid drops but still connects by a short way around.
//!
//! In a field of scattered holes many a centre ties corners that have no coarse edge between them, but the coarser grid leads
//! around the hole all the same. Only a tie without such a detour is lost: in lanes, and where two walls come close.

use super::checkerboard::Weights;

/// Side of the window of coarse pixels in which a detour must lie: as many as the bits of a word allow.
const WINDOW: usize = 8;

/// Coarse pixels on either side of a cell that belong to its window.
const MARGIN: usize = WINDOW / 2 - 1;

/// The edges of a coarser grid in the window around a cell, one bit a pixel.
pub(super) struct Window {
    rightward: u64,
    downward: u64,
}

impl Window {
    /// The window around the cell whose first corner is coarse pixel (`row`, `col`).
    pub fn around(coarser: &Weights, row: usize, col: usize) -> Self {
        let grid = coarser.grid;
        let (mut rightward, mut downward) = (0, 0);
        for bit in 0..WINDOW * WINDOW {
            let (down, right) = (bit / WINDOW, bit % WINDOW);
            let (Some(row), Some(col)) = ((row + down).checked_sub(MARGIN), (col + right).checked_sub(MARGIN)) else {
                continue;
            };
            if row >= grid.height || col >= grid.width {
                continue;
            }
            let (here, k) = (row as isize, col / 2 + 1);
            let is_red = (row + col).is_multiple_of(2);
            if right + 1 < WINDOW && col + 1 < grid.width {
                let next = col.div_ceil(2) + 1;
                let weight = if is_red { coarser.right(here)[k] } else { coarser.left(here)[next] };
                rightward |= u64::from(weight > 0.0) << bit;
            }
            if down + 1 < WINDOW && row + 1 < grid.height {
                let weight = if is_red { coarser.down(here)[k] } else { coarser.up(here + 1)[k] };
                downward |= u64::from(weight > 0.0) << bit;
            }
        }
        Self { rightward, downward }
    }

    /// The bit of the coarse pixel `down` and `right` of the cell's first corner, each from -1 to 2.
    pub fn pixel(down: isize, right: isize) -> u64 {
        let place = |offset: isize| MARGIN.wrapping_add_signed(offset);
        1 << (place(down) * WINDOW + place(right))
    }

    /// Whether some path within the window joins all `pixels`; false for none.
    pub fn joins(&self, pixels: u64) -> bool {
        let mut reached = pixels & pixels.wrapping_neg();
        loop {
            let sideways = (reached & self.rightward) << 1 | reached >> 1 & self.rightward;
            let further = reached | sideways | (reached & self.downward) << WINDOW | reached >> WINDOW & self.downward;
            if further == reached {
                return pixels != 0 && pixels & !reached == 0;
            }
            reached = further;
        }
    }
}
