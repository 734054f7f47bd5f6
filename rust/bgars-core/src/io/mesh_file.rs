//! Mesh files by their names.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use super::MeshSource;
use super::obj::write_obj;
use super::ply::write_ply;
use crate::{Error, Result};

/// Formats of a mesh file.
#[allow(missing_docs)] // [`super::ply`] and [`super::obj`] say it
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MeshFormat {
    Ply,
    Obj,
}

/// Writes `mesh` to a new file, or over an old one.
///
/// # Errors
/// [`Error::Io`], naming the file.
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
