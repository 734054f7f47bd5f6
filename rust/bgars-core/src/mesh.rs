//! A height map as triangles.

use rayon::prelude::*;

use crate::memory::zeros;
use crate::{Error, Result};

/// Vertices and faces of a height map.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// `[x, y, z]` a vertex, in the unit of the pitch.
    pub vertices: Vec<[f32; 3]>,
    /// Three vertex indices a face, counter-clockwise seen from the camera.
    pub faces: Vec<[u32; 3]>,
    /// Pixel of each vertex (row * width + column).
    pub pixels: Vec<u32>,
}

/// Triangulates the pixels of `mask`: a vertex at each pixel centre, two faces in each square of four pixels, one face
/// where three of the four are in the mask.
///
/// # Inputs
/// `height_px` and `mask` row-major in rows of `width`; `pitch` scales pixels to the unit wanted (1: stay in pixels).
/// World axes: x right, y up, z to the camera, origin at the image centre.
///
/// # Errors
/// Mismatched lengths, an empty mask, more than 2^32 - 1 pixels.
///
/// # Examples
/// ```
/// let mesh = bgars_core::mesh::triangulate(&[0.0, 0.0, 0.0, 1.0], &[true; 4], 2, 10.0)?;
/// assert_eq!(mesh.vertices[3], [5.0, -5.0, 10.0]);
/// assert_eq!(mesh.faces.len(), 2);
/// # Ok::<(), bgars_core::Error>(())
/// ```
pub fn triangulate(height_px: &[f32], mask: &[bool], width: usize, pitch: f64) -> Result<TriangleMesh> {
    if height_px.len() != mask.len() {
        return Err(Error::LengthMismatch { argument: "height_px", expected: mask.len(), actual: height_px.len() });
    }
    if width == 0 || !mask.contains(&true) {
        return Err(Error::EmptyMask);
    }
    if u32::try_from(mask.len()).is_err() {
        let value = mask.len() as f64;
        return Err(Error::OutOfRange { argument: "height_px", rule: "at most 2^32 - 1 pixels", value });
    }
    let height = mask.len() / width;
    let vertices_of_row: Vec<usize> =
        mask.par_chunks(width).map(|row| row.iter().filter(|&&valid| valid).count()).collect();
    let vertex_count = vertices_of_row.iter().sum();
    let mut mesh = TriangleMesh { vertices: zeros(vertex_count), faces: Vec::new(), pixels: zeros(vertex_count) };
    let mut vertex_of_pixel = zeros::<u32>(mask.len());
    let starts = starts(&vertices_of_row);
    let rows = (split(&mut mesh.vertices, &vertices_of_row), split(&mut mesh.pixels, &vertices_of_row));
    (starts, rows.0, rows.1, vertex_of_pixel.par_chunks_mut(width)).into_par_iter().enumerate().for_each(
        |(row, (start, vertices, pixels, vertex_of_pixel))| {
            let first = row * width;
            let valid = (0..vertex_of_pixel.len()).filter(|&col| mask[first + col]);
            for (index, col) in valid.enumerate() {
                vertex_of_pixel[col] = (start + index) as u32;
                pixels[index] = (first + col) as u32;
                vertices[index] = [
                    ((col as f64 + 0.5 - width as f64 / 2.0) * pitch) as f32,
                    ((height as f64 / 2.0 - row as f64 - 0.5) * pitch) as f32,
                    (f64::from(height_px[first + col]) * pitch) as f32,
                ];
            }
        },
    );

    let corners = |row: usize, col: usize| {
        let corner = row * width + col;
        // Counter-clockwise seen from the camera: upper left, lower left, lower right, upper right.
        [corner - width - 1, corner - 1, corner, corner - width]
    };
    let faces_at = |square: [usize; 4]| faces_of_square(square.map(|pixel| mask[pixel]));
    let faces_of_row: Vec<usize> = (1..height.max(1))
        .into_par_iter()
        .map(|row| (1..width).map(|col| faces_at(corners(row, col)).len()).sum())
        .collect();
    mesh.faces = zeros(faces_of_row.iter().sum());
    split(&mut mesh.faces, &faces_of_row).into_par_iter().enumerate().for_each(|(row, faces)| {
        let mut faces = faces.iter_mut();
        for col in 1..width {
            let square = corners(row + 1, col);
            for (from, face) in faces_at(square).iter().zip(faces.by_ref()) {
                *face = from.map(|corner| vertex_of_pixel[square[corner]]);
            }
        }
    });
    Ok(mesh)
}

/// Corners of the faces in a square of four pixels, by which of them are in the mask.
fn faces_of_square(valid: [bool; 4]) -> &'static [[usize; 3]] {
    match valid {
        [true, true, true, true] => &[[0, 1, 2], [0, 2, 3]],
        [false, true, true, true] => &[[1, 2, 3]],
        [true, false, true, true] => &[[0, 2, 3]],
        [true, true, false, true] => &[[0, 1, 3]],
        [true, true, true, false] => &[[0, 1, 2]],
        _ => &[],
    }
}

/// Sum of the lengths before each.
fn starts(lengths: &[usize]) -> Vec<usize> {
    lengths.iter().scan(0, |sum, &length| Some(std::mem::replace(sum, *sum + length))).collect()
}

/// Neighbouring parts of `items`, of the given lengths.
fn split<'a, T>(mut items: &'a mut [T], lengths: &[usize]) -> Vec<&'a mut [T]> {
    let part = |&length: &usize| {
        let (part, rest) = std::mem::take(&mut items).split_at_mut(length);
        items = rest;
        part
    };
    lengths.iter().map(part).collect()
}
