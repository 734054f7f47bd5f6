//! The pixels near the rims of circles, by sector.

use std::f64::consts::TAU;

use rayon::prelude::*;

/// A circle in array coordinates: pixel centres are integers.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    pub row_px: f64,
    pub col_px: f64,
    pub radius_px: f64,
}

/// Pixels around circles by circle and sector (counter-clockwise from +x as seen in the image), padded to equal number.
#[derive(Debug, PartialEq)]
pub struct Bands {
    /// Places a sector has: the most pixels of any.
    pub most: usize,
    /// Rows relative to the pixel next to the centre, 0 for padding.
    pub rows: Vec<f32>,
    /// Columns relative to the pixel next to the centre, 0 for padding.
    pub cols: Vec<f32>,
    /// 1 for pixels, 0 for padding.
    pub weights: Vec<f32>,
}

/// Pixels of one band, row by row: sector, row and column relative to the anchor; and how many each sector has.
type Band = (Vec<(u32, i32, i32)>, Vec<usize>);

/// One pixel in `every` of those whose depth inside its circle is between `-depths[1]` and `depths[0]`, both exclusive.
///
/// # Inputs
/// `circles` and their `depths` (inward, outward, in pixels), equal in number.
///
/// # Method
/// Which pixels are taken is a matter of their place in the image alone, evenly by Roberts' sequence R2 (2018). Counted
/// along the band, one pixel more at its edge would exchange all that follow.
///
/// # Examples
/// ```
/// use bgars_core::rims::{Circle, bands};
/// let circle = Circle { row_px: 3.0, col_px: 3.0, radius_px: 2.0 };
/// let ring = bands(&[circle], &[[0.5, 0.5]], 1, 4);
/// // The four pixels at distance 2, and eight at a distance of the root of 5.
/// assert_eq!((ring.most, ring.weights.iter().sum::<f32>()), (3, 12.0));
/// ```
#[must_use]
pub fn bands(circles: &[Circle], depths: &[[f64; 2]], every: usize, sectors: usize) -> Bands {
    let one = |(circle, depths): (&Circle, &[f64; 2])| band(*circle, *depths, every, sectors);
    let found: Vec<Band> = circles.par_iter().zip(depths).map(one).collect();
    let most = found.iter().flat_map(|(_, counts)| counts).copied().max().unwrap_or(0);
    let size = found.len() * sectors * most;
    let mut out = Bands { most, rows: vec![0.0; size], cols: vec![0.0; size], weights: vec![0.0; size] };
    for (ball, (found, _)) in found.iter().enumerate() {
        let mut next: Vec<usize> = (0..sectors).map(|sector| (ball * sectors + sector) * most).collect();
        for &(sector, row, col) in found {
            let place = &mut next[sector as usize];
            out.rows[*place] = row as f32;
            out.cols[*place] = col as f32;
            out.weights[*place] = 1.0;
            *place += 1;
        }
    }
    out
}

/// Row and column of the pixel next to the centre.
fn anchor(circle: Circle) -> (i64, i64) {
    (circle.row_px.round_ties_even() as i64, circle.col_px.round_ties_even() as i64)
}

fn band(circle: Circle, [inward, outward]: [f64; 2], every: usize, sectors: usize) -> Band {
    let (anchor_row, anchor_col) = anchor(circle);
    let reach = (circle.radius_px + outward).ceil() as i64 + 1;
    let (mut found, mut counts) = (Vec::new(), vec![0; sectors]);
    for row in -reach..=reach {
        let y = (anchor_row + row) as f64 - circle.row_px;
        for col in -reach..=reach {
            let x = (anchor_col + col) as f64 - circle.col_px;
            let depth = circle.radius_px - (x * x + y * y).sqrt();
            if !(depth < inward && depth > -outward) {
                continue;
            }
            if taken(anchor_row + row, anchor_col + col, every) {
                let turn = ((-y).atan2(x) / TAU).rem_euclid(1.0);
                let sector = (turn * sectors as f64) as usize % sectors;
                counts[sector] += 1;
                found.push((sector as u32, row as i32, col as i32));
            }
        }
    }
    (found, counts)
}

/// Whether a pixel is among one in `every`: the fractional part of row / g + col / g^2 with g^3 = g + 1, in units of 2^-32.
fn taken(row: i64, col: i64, every: usize) -> bool {
    let place = row.wrapping_mul(3_242_174_889).wrapping_add(col.wrapping_mul(2_447_445_414)) as u32;
    u64::from(place) * (every as u64) < 1 << 32
}
