//! A height map as triangles.

use rayon::prelude::*;

use crate::error::{check_length, check_rule};
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

/// A height map as triangles that are made when they are asked for, row by row: a vertex at each pixel centre of the mask,
/// two faces in each square of four pixels, one where three of the four are in the mask.
#[derive(Clone, Debug)]
pub struct HeightMesh<'a> {
    height_px: &'a [f32],
    mask: &'a [bool],
    width: usize,
    pitch: f64,
    /// Vertices before each row, and all of them.
    vertex_starts: Vec<usize>,
    face_count: usize,
}

impl<'a> HeightMesh<'a> {
    /// # Inputs
    /// `height_px` and `mask` row-major in rows of `width`; `pitch` scales pixels to the unit wanted (1: stay in pixels).
    /// World axes: x right, y up, z to the camera, origin at the image centre.
    ///
    /// # Errors
    /// Mismatched lengths, an empty mask, more than 2^32 - 1 pixels.
    pub fn new(height_px: &'a [f32], mask: &'a [bool], width: usize, pitch: f64) -> Result<Self> {
        check_length("height_px", mask.len(), height_px.len())?;
        if width == 0 || !mask.contains(&true) {
            return Err(Error::EmptyMask);
        }
        let holds = u32::try_from(mask.len()).is_ok();
        check_rule("height_px", "at most 2^32 - 1 pixels", mask.len() as f64, holds)?;
        let mut mesh = Self { height_px, mask, width, pitch, vertex_starts: vec![0], face_count: 0 };
        let rows = 0..mask.len() / width;
        let vertices: Vec<usize> =
            rows.clone().into_par_iter().map(|row| mesh.row_mask(row).iter().filter(|&&valid| valid).count()).collect();
        for (row, count) in vertices.into_iter().enumerate() {
            mesh.vertex_starts.push(mesh.vertex_starts[row] + count);
        }
        let faces = |row| mesh.squares(row).map(|square| faces_of_square(square).len()).sum::<usize>();
        mesh.face_count = rows.into_par_iter().map(faces).sum();
        Ok(mesh)
    }

    /// Number of rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.mask.len() / self.width
    }

    /// Pixels in a row.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.vertex_starts[self.rows()]
    }

    /// Number of faces.
    #[must_use]
    pub fn face_count(&self) -> usize {
        self.face_count
    }

    /// Calls `vertex` with pixel (row * width + column) and `[x, y, z]` of each vertex of a row, from left to right.
    #[inline]
    pub fn row_vertices(&self, row: usize, mut vertex: impl FnMut(usize, [f32; 3])) {
        let y = ((self.rows() as f64 / 2.0 - row as f64 - 0.5) * self.pitch) as f32;
        for (col, _) in self.row_mask(row).iter().enumerate().filter(|(_, valid)| **valid) {
            let pixel = row * self.width + col;
            let x = ((col as f64 + 0.5 - self.width as f64 / 2.0) * self.pitch) as f32;
            vertex(pixel, [x, y, (f64::from(self.height_px[pixel]) * self.pitch) as f32]);
        }
    }

    /// Calls `face` with the vertices of each face between a row and the one above, from left to right; none for row 0.
    #[inline]
    pub fn row_faces(&self, row: usize, mut face: impl FnMut([u32; 3])) {
        if row == 0 {
            return;
        }
        // Vertices of the square's left column, if they are there, and how many there were before the right one.
        let [mut upper, mut lower] = [self.vertex_starts[row - 1] as u32, self.vertex_starts[row] as u32];
        for square in self.squares(row) {
            let corners = [upper, lower, lower + u32::from(square[1]), upper + u32::from(square[0])];
            for from in faces_of_square(square) {
                face(from.map(|corner| corners[corner]));
            }
            [upper, lower] = [corners[3], corners[2]];
        }
    }

    fn row_mask(&self, row: usize) -> &'a [bool] {
        &self.mask[row * self.width..(row + 1) * self.width]
    }

    /// Which corners are valid in each square between a row and the one above: upper left, lower left, lower right, upper
    /// right, which is counter-clockwise seen from the camera.
    fn squares(&self, row: usize) -> impl Iterator<Item = [bool; 4]> {
        let [upper, lower] = if row == 0 { [&[][..]; 2] } else { [self.row_mask(row - 1), self.row_mask(row)] };
        upper.windows(2).zip(lower.windows(2)).map(|(upper, lower)| [upper[0], lower[0], lower[1], upper[1]])
    }
}

/// Triangulates the pixels of `mask`: all of a [`HeightMesh`] at once.
///
/// # Errors
/// Those of [`HeightMesh::new`].
pub fn triangulate(height_px: &[f32], mask: &[bool], width: usize, pitch: f64) -> Result<TriangleMesh> {
    let source = HeightMesh::new(height_px, mask, width, pitch)?;
    let rows = || (0..source.rows()).into_par_iter();
    let of_row = |row: usize| {
        let mut vertices = Vec::new();
        source.row_vertices(row, |pixel, position| vertices.push((position, pixel as u32)));
        vertices
    };
    let (vertices, pixels) = rows().flat_map_iter(of_row).unzip();
    let faces_of_row = |row: usize| {
        let mut faces = Vec::new();
        source.row_faces(row, |corners| faces.push(corners));
        faces
    };
    Ok(TriangleMesh { vertices, faces: rows().flat_map_iter(faces_of_row).collect(), pixels })
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
