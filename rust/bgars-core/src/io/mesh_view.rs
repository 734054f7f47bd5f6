//! A mesh as borrowed arrays, in the number types that Python keeps.

use rayon::prelude::*;

use super::mesh_source::{MeshSize, MeshSource, Vertices};
use crate::error::check_length;
use crate::{Error, Result};

/// Vertices or faces of a piece, and faces checked at a time: they stay in the second-level cache.
const BLOCK: usize = 1 << 14;

/// A mesh as plain slices, for the writers; files hold coordinates as `f32` and indices as `u32`.
#[derive(Clone, Copy, Debug)]
pub struct MeshView<'a> {
    /// `[x, y, z]` a vertex.
    pub vertices: &'a [[f64; 3]],
    /// Three vertex indices a face.
    pub faces: &'a [[i64; 3]],
    /// Unit normal of each vertex.
    pub normals: Option<&'a [[f64; 3]]>,
    /// Red, green, blue of each vertex.
    pub colors: Option<&'a [[u8; 3]]>,
}

impl MeshView<'_> {
    /// Checks that the attributes fit the vertices and that every face names vertices that exist.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] or [`Error::OutOfRange`].
    pub fn check(&self) -> Result<()> {
        let expected = self.vertices.len();
        check_length("normals", expected, self.normals.map_or(expected, <[_]>::len))?;
        check_length("colors", expected, self.colors.map_or(expected, <[_]>::len))?;
        // A file has 32 bits for an index; of a negative one the bits are those of a number far above.
        let count = expected.min(1 << 32) as u64;
        let is_bad = |index: &i64| *index as u64 >= count;
        // No early way out: the sum over a block is a loop without a branch.
        let count_bad = |faces: &[[i64; 3]]| faces.as_flattened().iter().filter(|&index| is_bad(index)).count();
        match self.faces.par_chunks(BLOCK).find_first(|faces| count_bad(faces) > 0) {
            None => Ok(()),
            Some(faces) => Err(Error::OutOfRange {
                argument: "faces",
                rule: "indices below the number of vertices",
                value: faces.iter().flatten().copied().find(is_bad).map_or(f64::NAN, |index| index as f64),
            }),
        }
    }
}

impl MeshSource for MeshView<'_> {
    fn size(&self) -> MeshSize {
        let (vertices, faces) = (self.vertices.len(), self.faces.len());
        let pieces = [vertices, faces].map(|items| items.div_ceil(BLOCK));
        let (has_normals, has_colors) = (self.normals.is_some(), self.colors.is_some());
        MeshSize { vertices, faces, pieces, has_normals, has_colors }
    }

    fn vertices(&self, piece: usize, out: &mut Vertices) {
        let single = |vectors: &[[f64; 3]], out: &mut Vec<[f32; 3]>| {
            out.clear();
            out.extend(part(vectors, piece).iter().map(|vector| vector.map(|value| value as f32)));
        };
        single(self.vertices, &mut out.positions);
        single(self.normals.unwrap_or_default(), &mut out.normals);
        out.colors.clear();
        out.colors.extend_from_slice(part(self.colors.unwrap_or_default(), piece));
    }

    fn faces(&self, piece: usize, out: &mut Vec<[u32; 3]>) {
        out.clear();
        out.extend(part(self.faces, piece).iter().map(|face| face.map(|index| index as u32)));
    }
}

/// One block of `items`; nothing beyond the last.
fn part<T>(items: &[T], piece: usize) -> &[T] {
    items.chunks(BLOCK).nth(piece).unwrap_or_default()
}
