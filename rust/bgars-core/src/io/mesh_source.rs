//! Meshes in pieces, for the writers: what holds a mesh need not hold it a second time in the form of a file.

use crate::Result;
use crate::error::check_length;
use crate::mesh::HeightMesh;

/// Pixels of a height map in a piece, about.
const PIECE_PIXELS: usize = 1 << 14;

/// Vertices of a piece.
#[derive(Clone, Debug, Default)]
pub struct Vertices {
    /// `[x, y, z]`.
    pub positions: Vec<[f32; 3]>,
    /// Unit normals; empty where the mesh has none.
    pub normals: Vec<[f32; 3]>,
    /// Red, green, blue; empty where the mesh has none.
    pub colors: Vec<[u8; 3]>,
}

/// How much there is of a mesh.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug)]
pub struct MeshSize {
    pub vertices: usize,
    pub faces: usize,
    /// Pieces of the vertices, and of the faces.
    pub pieces: [usize; 2],
    pub has_normals: bool,
    pub has_colors: bool,
}

/// A mesh that gives its vertices and faces piece by piece, in the order of the file.
pub trait MeshSource: Sync {
    /// How much there is of it.
    fn size(&self) -> MeshSize;
    /// Replaces the content of `out` by a piece of the vertices; beyond the last, by nothing.
    fn vertices(&self, piece: usize, out: &mut Vertices);
    /// Replaces the content of `out` by a piece of the faces, three vertices each; beyond the last, by nothing.
    fn faces(&self, piece: usize, out: &mut Vec<[u32; 3]>);
}

/// A height map with what is known of each pixel, written without a mesh in memory.
#[derive(Clone, Debug)]
pub struct HeightSource<'a> {
    mesh: HeightMesh<'a>,
    normals: Option<&'a [[f32; 3]]>,
    grey: Option<&'a [u8]>,
}

impl<'a> HeightSource<'a> {
    /// A surface, with the unit normal and the grey level of each pixel where they are known.
    ///
    /// # Errors
    /// [`crate::Error::LengthMismatch`] unless there is one for each pixel.
    pub fn new(mesh: HeightMesh<'a>, normals: Option<&'a [[f32; 3]]>, grey: Option<&'a [u8]>) -> Result<Self> {
        let expected = mesh.rows() * mesh.width();
        check_length("normals", expected, normals.map_or(expected, <[_]>::len))?;
        check_length("grey", expected, grey.map_or(expected, <[_]>::len))?;
        Ok(Self { mesh, normals, grey })
    }

    fn piece_rows(&self) -> usize {
        (PIECE_PIXELS / self.mesh.width()).max(1)
    }

    fn rows(&self, piece: usize) -> std::ops::Range<usize> {
        let rows = self.mesh.rows();
        (piece * self.piece_rows()).min(rows)..((piece + 1) * self.piece_rows()).min(rows)
    }
}

impl MeshSource for HeightSource<'_> {
    fn size(&self) -> MeshSize {
        MeshSize {
            vertices: self.mesh.vertex_count(),
            faces: self.mesh.face_count(),
            pieces: [self.mesh.rows().div_ceil(self.piece_rows()); 2],
            has_normals: self.normals.is_some(),
            has_colors: self.grey.is_some(),
        }
    }

    fn vertices(&self, piece: usize, out: &mut Vertices) {
        out.positions.clear();
        out.normals.clear();
        out.colors.clear();
        for row in self.rows(piece) {
            self.mesh.row_vertices(row, |pixel, position| {
                out.positions.push(position);
                out.normals.extend(self.normals.map(|normals| normals[pixel]));
                out.colors.extend(self.grey.map(|grey| [grey[pixel]; 3]));
            });
        }
    }

    fn faces(&self, piece: usize, out: &mut Vec<[u32; 3]>) {
        out.clear();
        for row in self.rows(piece) {
            self.mesh.row_faces(row, |face| out.push(face));
        }
    }
}
