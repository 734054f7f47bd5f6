//! Files: image stacks in, meshes out.

mod blocks;
pub mod color;
pub mod decode;
mod mesh_file;
mod mesh_source;
mod mesh_view;
pub mod obj;
pub mod ply;
pub mod rgb16;

pub use mesh_file::{MeshFormat, write_mesh_file};
pub use mesh_source::{HeightSource, MeshSize, MeshSource, Vertices};
pub use mesh_view::MeshView;
