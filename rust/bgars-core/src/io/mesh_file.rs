//! Mesh files by their names.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use super::MeshSource;
use super::obj::write_obj;
use super::ply::write_ply;
use crate::{Error, Result};

/// Formats of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    /// Binary PLY.
    Ply,
    /// Wavefront OBJ.
    Obj,
}

/// Writes `mesh` to a new file, or over an old one.
///
/// # Errors
/// [`Error::Io`], naming the file.
///
/// # Examples
/// ```
/// use bgars_core::{io::{HeightSource, MeshFormat, write_mesh_file}, mesh::HeightMesh};
/// let mesh = HeightMesh::new(&[0.0, 0.0, 0.0, 1.0], &[true; 4], 2, 10.0)?;
/// let path = std::env::temp_dir().join("bgars-doctest.ply");
/// write_mesh_file(&HeightSource::new(mesh, None, None)?, MeshFormat::Ply, &[], &path)?;
/// assert!(std::fs::read(&path)?.ends_with(&[3, 0, 0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0])); // triangle 0 3 1
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write_mesh_file(mesh: &impl MeshSource, format: MeshFormat, comments: &[String], path: &Path) -> Result<()> {
    let write = || {
        let mut file = File::create(path)?;
        match format {
            MeshFormat::Ply => write_ply(mesh, comments, &mut file)?,
            MeshFormat::Obj => write_obj(mesh, comments, &mut file)?,
        }
        file.flush()
    };
    write().map_err(|source| Error::Io { path: path.to_path_buf(), source })
}
