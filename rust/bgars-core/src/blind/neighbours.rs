//! What the neighbours of a pixel say about its normal.

use nalgebra::Vector3;

use crate::median::median;

/// Neighbours up to so many rows and columns away: a window of 5 x 5 pixels.
const REACH: usize = 2;

/// Most pixels of a window.
const WINDOW: usize = (2 * REACH + 1) * (2 * REACH + 1);

/// The median of the normals around a pixel, component by component, of length 1; `None` where no neighbour has one.
///
/// `normals` 3 values a pixel, NaN where there is none. A median keeps edges and passes over up to half of wrong neighbours.
pub(super) fn median_normal(normals: &[f32], (height, width): (usize, usize), pixel: usize) -> Option<Vector3<f64>> {
    let (row, col) = (pixel / width, pixel % width);
    let mut components = [[0.0f32; WINDOW]; 3];
    let mut count = 0;
    for near_row in row.saturating_sub(REACH)..(row + REACH + 1).min(height) {
        for near_col in col.saturating_sub(REACH)..(col + REACH + 1).min(width) {
            let at = 3 * (near_row * width + near_col);
            if normals[at].is_nan() {
                continue;
            }
            for axis in 0..3 {
                components[axis][count] = normals[at + axis];
            }
            count += 1;
        }
    }
    let median = Vector3::from_fn(|axis, _| f64::from(median(&mut components[axis][..count], f32::total_cmp)));
    let length = median.norm();
    (length > 1e-6).then(|| median / length)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_pixel_is_outvoted_and_an_edge_stays() {
        let (height, width) = (7, 7);
        let left = Vector3::new(-0.6, 0.0, 0.8);
        let mut normals: Vec<f32> = Vec::new();
        for pixel in 0..height * width {
            let normal = if pixel % width < 4 { left } else { Vector3::new(0.6, 0.0, 0.8) };
            normals.extend(normal.iter().map(|&value| value as f32));
        }
        normals[3 * (3 * width + 1)] = f32::NAN;
        normals[3 * (3 * width + 2)..3 * (3 * width + 2) + 3].copy_from_slice(&[0.0, 1.0, 0.0]);
        let median = median_normal(&normals, (height, width), 3 * width + 2);
        approx::assert_relative_eq!(median.unwrap_or_default(), left, epsilon = 1e-6);
    }

    #[test]
    fn no_neighbour_no_normal() {
        assert!(median_normal(&[f32::NAN; 27], (3, 3), 4).is_none());
    }
}
