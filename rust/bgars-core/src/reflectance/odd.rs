//! Places where a ball is not the sphere of its circle: many pixels agree on another normal, and the other balls do not.

use rayon::prelude::*;

use super::ball_normal::BallPixel;
use super::cells::{CellSums, CellTable, SIDE, left_out};
use crate::components::Runs;

/// A place is odd where the ball differs from the others by this angle in radian (1.5 degrees) ...
const MIN_ANGLE_RAD: f32 = 0.026;

/// ... and by so many standard deviations of a ball among the others.
const MIN_SIGMAS: f32 = 4.0;

/// Pixels that the data fix no better than this do not vote.
const VOTER_DEG: f32 = 4.0;

/// An odd place has at least so many cells of the disc, side by side: 2 % of what is seen of a ball.
const MIN_CELLS: usize = 25;

/// Normals that explain their pixels no better than this (mean loss of a light) prove nothing: a cast shadow, a reflection.
const MAX_COST: f32 = 2.0;

/// Channels of the tables: difference to the circle's normal along a and b, loss.
const CHANNELS: usize = 3;
const LOSS: usize = 2;

/// For each ball how its normals differ from its circle's, on the disc; zero where nothing is odd, `None` where nothing is
/// anywhere.
pub fn odd_places(found: &[Vec<BallPixel>]) -> Vec<Option<CellTable>> {
    let own: Vec<Vec<f32>> = found.par_iter().map(|pixels| ball_deviation(pixels)).collect();
    let others = left_out(CHANNELS, &own);
    own.par_iter()
        .zip(others)
        .map(|(own, mut table)| {
            let differences: Vec<[f32; 2]> = own
                .chunks_exact(CHANNELS)
                .enumerate()
                .map(|(cell, own)| {
                    let first = CHANNELS * cell;
                    let difference = std::array::from_fn(|axis| own[axis] - table.middle[first + axis]);
                    let [da, db] = difference;
                    let sigma = table.sigma[first].hypot(table.sigma[first + 1]);
                    let odd = own[LOSS] < MAX_COST && da.hypot(db) > MIN_ANGLE_RAD.max(MIN_SIGMAS * sigma);
                    if odd { difference } else { [0.0; 2] }
                })
                .collect();
            let large = large_groups(&differences.iter().map(|[a, b]| a.hypot(*b) > 0.0).collect::<Vec<_>>());
            for (cell, middle) in table.middle.chunks_exact_mut(CHANNELS).enumerate() {
                let kept = if large[cell] { differences[cell] } else { [0.0; 2] };
                middle[..2].copy_from_slice(&kept);
            }
            large.contains(&true).then_some(table)
        })
        .collect()
}

/// The cells of groups of neighbours that are large enough.
fn large_groups(marked: &[bool]) -> Vec<bool> {
    let groups = Runs::new(marked, None, SIDE);
    let is_large = |&group: &i32| group >= 0 && groups.components[group as usize].pixels >= MIN_CELLS;
    groups.labels().iter().map(is_large).collect()
}

/// Smoothed means of one ball.
fn ball_deviation(pixels: &[BallPixel]) -> Vec<f32> {
    let mut sums = CellSums::new(CHANNELS);
    for pixel in pixels.iter().filter(|pixel| pixel.data_error_rad < VOTER_DEG.to_radians()) {
        let expected = pixel.circle_point.map(f64::from);
        for axis in 0..2 {
            sums.add(expected, axis, pixel.point[axis] - pixel.circle_point[axis]);
        }
        sums.add(expected, LOSS, pixel.cost);
    }
    sums.means()
}
