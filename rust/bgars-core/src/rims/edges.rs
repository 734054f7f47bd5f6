//! Edges on rings around centres, as strong as several lights have them.

use std::f64::consts::TAU;

use multiversion::multiversion;
use rayon::prelude::*;

/// Images of several lights, one after the other.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug)]
pub struct Planes<'a> {
    /// `lights * height * width` values.
    pub values: &'a [f32],
    pub lights: usize,
    pub height: usize,
    pub width: usize,
}

/// Change of the value from ring to ring in each direction: of all lights' changes the `rank`-th largest.
///
/// # Inputs
/// `centres` are (row, column); `radii` of all rings, as many for each centre, ascend. `directions` start half a step from
/// +x, counter-clockwise as seen in the image.
///
/// # Method
/// A change spans two rings and is the mean over three neighbouring directions: along a rim nothing changes, and noise
/// falls. Outside the image, and on the first and the last ring, it is 0.
///
/// # Examples
/// ```
/// use bgars_core::rims::{Planes, ring_edges};
/// // A disc of radius 5.7 in every light.
/// let disc = |at: usize| f32::from(u8::from((at / 21).abs_diff(10).pow(2) + (at % 21).abs_diff(10).pow(2) < 33));
/// let values: Vec<f32> = (0..3 * 441).map(|at| disc(at % 441)).collect();
/// let planes = Planes { values: &values, lights: 3, height: 21, width: 21 };
/// let edges = ring_edges(planes, &[[10.0, 10.0]], &[2.0, 3.5, 5.0, 7.0, 8.0], 4, 1);
/// assert_eq!(edges[..5], [0.0, 0.0, 1.0, 1.0, 0.0]);
/// ```
#[must_use]
pub fn ring_edges(planes: Planes<'_>, centres: &[[f64; 2]], radii: &[f64], directions: usize, rank: usize) -> Vec<f32> {
    let rings = radii.len() / centres.len().max(1);
    let size = directions * rings;
    let mut out = vec![0.0; size * centres.len()];
    if size == 0 {
        return out;
    }
    let units: Vec<(f64, f64)> =
        (0..directions).map(|index| ((index as f64 + 0.5) * (TAU / directions as f64)).sin_cos()).collect();
    let make = || (Scratch::new(size), vec![vec![0.0; size]; rank.clamp(1, planes.lights.max(1))]);
    let work = out.par_chunks_mut(size).zip(centres).zip(radii.par_chunks(rings));
    work.for_each_init(make, |(scratch, largest), ((out, &centre), radii)| {
        scratch.place(planes, centre, radii, &units);
        for values in &mut *largest {
            values.fill(0.0);
        }
        for light in 0..planes.lights {
            let plane = &planes.values[light * planes.height * planes.width..];
            rank_light(plane, scratch, directions, largest);
        }
        if let Some(values) = largest.last() {
            out.copy_from_slice(values);
        }
    });
    out
}

/// Where the rings of one centre lie, direction after direction, and room for what they read.
struct Scratch {
    pixels: Vec<u32>,
    share: Vec<f32>,
    values: Vec<f32>,
    edges: Vec<f32>,
}

impl Scratch {
    fn new(size: usize) -> Self {
        Self { pixels: vec![0; size], share: vec![0.0; size], values: vec![0.0; size], edges: vec![0.0; size] }
    }

    fn place(&mut self, planes: Planes<'_>, [row, col]: [f64; 2], radii: &[f64], units: &[(f64, f64)]) {
        let rings = radii.len();
        for (direction, &(sine, cosine)) in units.iter().enumerate() {
            let first = direction * rings;
            for (ring, radius) in radii.iter().enumerate() {
                let r = (row - sine * radius).round_ties_even() as i64;
                let c = (col + cosine * radius).round_ties_even() as i64;
                let inside = (0..planes.height as i64).contains(&r) && (0..planes.width as i64).contains(&c);
                self.pixels[first + ring] = if inside { r as u32 * planes.width as u32 + c as u32 } else { 0 };
                // For now, whether it is inside.
                self.edges[first + ring] = f32::from(u8::from(inside));
            }
            for ring in 1..rings.saturating_sub(1) {
                self.share[first + ring] = self.edges[first + ring - 1] * self.edges[first + ring + 1] / 3.0;
            }
        }
    }
}

/// Merges the edges of one light into the largest so far.
#[multiversion(targets("x86_64+avx2+fma"))]
fn rank_light(plane: &[f32], scratch: &mut Scratch, directions: usize, largest: &mut [Vec<f32>]) {
    let Scratch { pixels, share, values, edges } = scratch;
    for (value, &pixel) in values.iter_mut().zip(pixels.iter()) {
        *value = plane[pixel as usize];
    }
    let rings = values.len() / directions;
    edges.fill(0.0);
    for direction in 0..directions {
        let row = |shift: usize| &values[(direction + shift) % directions * rings..][..rings];
        let (before, here, after) = (row(directions - 1), row(0), row(1));
        let share = &share[direction * rings..][..rings];
        let edges = &mut edges[direction * rings..][..rings];
        for ring in 1..rings.saturating_sub(1) {
            let outer = here[ring + 1] + before[ring + 1] + after[ring + 1];
            let inner = here[ring - 1] + before[ring - 1] + after[ring - 1];
            edges[ring] = (outer - inner).abs() * share[ring];
        }
    }
    for values in largest {
        for (value, edge) in values.iter_mut().zip(edges.iter_mut()) {
            (*value, *edge) = (value.max(*edge), value.min(*edge));
        }
    }
}
