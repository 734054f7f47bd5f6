//! A height map as triangles.

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
    let mut mesh = TriangleMesh::default();
    let mut vertex_of_pixel = vec![u32::MAX; mask.len()];
    for pixel in (0..mask.len()).filter(|&pixel| mask[pixel]) {
        let (row, col) = (pixel / width, pixel % width);
        vertex_of_pixel[pixel] = mesh.vertices.len() as u32;
        mesh.pixels.push(pixel as u32);
        mesh.vertices.push([
            ((col as f64 + 0.5 - width as f64 / 2.0) * pitch) as f32,
            ((height as f64 / 2.0 - row as f64 - 0.5) * pitch) as f32,
            (f64::from(height_px[pixel]) * pitch) as f32,
        ]);
    }
    for row in 1..height {
        for col in 1..width {
            let corner = row * width + col;
            // Counter-clockwise seen from the camera: upper left, lower left, lower right, upper right.
            let square = [corner - width - 1, corner - 1, corner, corner - width];
            let vertex = |index: usize| vertex_of_pixel[square[index]];
            match square.map(|pixel| mask[pixel]) {
                [true, true, true, true] => {
                    mesh.faces.push([vertex(0), vertex(1), vertex(2)]);
                    mesh.faces.push([vertex(0), vertex(2), vertex(3)]);
                }
                [false, true, true, true] => mesh.faces.push([vertex(1), vertex(2), vertex(3)]),
                [true, false, true, true] => mesh.faces.push([vertex(0), vertex(2), vertex(3)]),
                [true, true, false, true] => mesh.faces.push([vertex(0), vertex(1), vertex(3)]),
                [true, true, true, false] => mesh.faces.push([vertex(0), vertex(1), vertex(2)]),
                _ => {}
            }
        }
    }
    Ok(mesh)
}
