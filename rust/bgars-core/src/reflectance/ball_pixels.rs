//! The pixels of balls, and what they show.

use super::anchor::Circle;
use super::observe::Reader;
use super::samples::{Samples, spaced};
use super::shape::CommonShape;
use crate::Lights;
use crate::readings::pixel_centre;

/// Smallest n_z on a sphere of the pixels that tell a shape: nearer the rim a mirror shows the board and the neighbours.
const SHAPE_MIN_N_Z: f64 = 0.5;

/// Usable pixels inside a circle.
pub fn inside(circle: &Circle, (height, width): (usize, usize), usable: impl Fn(usize) -> bool) -> Vec<usize> {
    let (rows, cols) = circle.window(height, width);
    rows.flat_map(|row| cols.clone().map(move |col| (row, col)))
        .filter(|&(row, col)| {
            let (x, y) = pixel_centre(row, col, height, width);
            circle.normal(x, y).is_some() && usable(row * width + col)
        })
        .map(|(row, col)| row * width + col)
        .collect()
}

/// The pixels of each circle that tell its shape.
pub fn core_of(circles: &[Circle], inside: &[Vec<usize>], (height, width): (usize, usize)) -> Vec<Vec<usize>> {
    let tells = |circle: &Circle, pixel: usize| {
        let (x, y) = pixel_centre(pixel / width, pixel % width, height, width);
        circle.normal(x, y).is_some_and(|normal| normal.z > SHAPE_MIN_N_Z)
    };
    let core =
        |(circle, pixels): (&Circle, &Vec<usize>)| pixels.iter().copied().filter(|&p| tells(circle, p)).collect();
    circles.iter().zip(inside).map(core).collect()
}

/// About `count` of some ascending pixels, each followed by its right neighbour.
pub fn paired(pixels: &[usize], count: usize) -> Vec<usize> {
    let has_neighbour = |pixel: &&usize| pixels.binary_search(&(**pixel + 1)).is_ok();
    spaced(pixels, count).filter(has_neighbour).flat_map(|&pixel| [pixel, pixel + 1]).collect()
}

/// The circles with another shape over them; an uncertain shape makes a normal as uncertain as an uncertain radius does.
pub fn with_shape(circles: &[Circle], common: CommonShape) -> Vec<Circle> {
    let shaped =
        |circle: &Circle| Circle { shape: common.shape, u_radius_px: circle.radius_px * common.u_ratio, ..*circle };
    circles.iter().map(shaped).collect()
}

/// Some pixels of each ball with the normals of its circle.
pub fn samples(
    reader: &Reader<'_>,
    lights: &Lights,
    circles: &[Circle],
    inside: &[Vec<usize>],
    clip: &[f64],
    of_each: usize,
    min_n_z: f64,
) -> Samples {
    let mut samples = Samples::new(clip);
    let mut bent = vec![0.0; reader.lights()];
    for (ball, (circle, pixels)) in circles.iter().zip(inside).enumerate() {
        for &pixel in spaced(pixels, of_each) {
            let (x, y) = reader.centre(pixel);
            if let Some(normal) = circle.normal(x, y).filter(|normal| normal.z > min_n_z) {
                reader.read(pixel, &mut bent);
                samples.push(ball, circle, normal, &bent, lights);
            }
        }
    }
    samples
}
