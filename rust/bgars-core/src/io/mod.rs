//! Files: image stacks in, meshes out.

pub mod decode;
pub mod obj;
pub mod ply;
pub mod rgb16;

use crate::{Error, Result};

/// A mesh as plain slices, for the writers.
#[derive(Clone, Copy, Debug)]
pub struct MeshView<'a> {
    /// `[x, y, z]` a vertex.
    pub vertices: &'a [[f32; 3]],
    /// Three vertex indices a face.
    pub faces: &'a [[u32; 3]],
    /// Unit normal of each vertex.
    pub normals: Option<&'a [[f32; 3]]>,
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
        let fits = |argument, actual| {
            if actual == expected { Ok(()) } else { Err(Error::LengthMismatch { argument, expected, actual }) }
        };
        self.normals.map_or(Ok(()), |normals| fits("normals", normals.len()))?;
        self.colors.map_or(Ok(()), |colors| fits("colors", colors.len()))?;
        match self.faces.iter().flatten().max() {
            Some(&index) if index as usize >= expected => Err(Error::OutOfRange {
                argument: "faces",
                rule: "indices below the number of vertices",
                value: f64::from(index),
            }),
            _ => Ok(()),
        }
    }
}
