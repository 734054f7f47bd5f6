//! Binary little-endian PLY (Turk 1994).

use std::io::Write;
use std::ops::Range;

use super::blocks::write_blocks;
use super::{Coordinate, MeshView, VertexIndex};

/// Bytes of three floats.
const TRIPLE_BYTES: usize = 12;
/// Bytes of a triangle: its number of corners, then three indices.
const FACE_BYTES: usize = 13;

/// Writes `mesh` as binary PLY: x y z [nx ny nz] [red green blue], then triangles; `comments` go into the header.
///
/// # Errors
/// Whatever `out` reports.
///
/// # Cost
/// Little more than `out` takes for the bytes: blocks are encoded on all threads while others are written.
pub fn write_ply<V: Coordinate, I: VertexIndex>(
    mesh: MeshView<'_, V, I>,
    comments: &[String],
    out: &mut (impl Write + Send),
) -> std::io::Result<()> {
    out.write_all(header(mesh, comments).as_bytes())?;
    write_blocks(mesh.vertices.len(), |vertices, block| encode_vertices(mesh, vertices, block), out)?;
    write_blocks(mesh.faces.len(), |faces, block| encode_faces(&mesh.faces[faces], block), out)
}

/// Records of the vertices, one array after the other: each is a loop without a branch.
fn encode_vertices<V: Coordinate, I: VertexIndex>(
    mesh: MeshView<'_, V, I>,
    vertices: Range<usize>,
    block: &mut Vec<u8>,
) {
    let colors_at = if mesh.normals.is_some() { 2 * TRIPLE_BYTES } else { TRIPLE_BYTES };
    let record_bytes = if mesh.colors.is_some() { colors_at + 3 } else { colors_at };
    block.resize(vertices.len() * record_bytes, 0);
    for (record, &vertex) in block.chunks_exact_mut(record_bytes).zip(&mesh.vertices[vertices.clone()]) {
        record[..TRIPLE_BYTES].copy_from_slice(&float_bytes(vertex));
    }
    if let Some(normals) = mesh.normals {
        for (record, &normal) in block.chunks_exact_mut(record_bytes).zip(&normals[vertices.clone()]) {
            record[TRIPLE_BYTES..2 * TRIPLE_BYTES].copy_from_slice(&float_bytes(normal));
        }
    }
    if let Some(colors) = mesh.colors {
        for (record, color) in block.chunks_exact_mut(record_bytes).zip(&colors[vertices]) {
            record[colors_at..].copy_from_slice(color);
        }
    }
}

fn encode_faces<I: VertexIndex>(faces: &[[I; 3]], block: &mut Vec<u8>) {
    block.resize(faces.len() * FACE_BYTES, 0);
    for (record, face) in block.chunks_exact_mut(FACE_BYTES).zip(faces) {
        let indices: [u8; 12] = bytemuck::cast(face.map(|index| (index.to_u64() as u32).to_le()));
        record[0] = 3;
        record[1..].copy_from_slice(&indices);
    }
}

#[inline]
fn float_bytes<V: Coordinate>(values: [V; 3]) -> [u8; TRIPLE_BYTES] {
    bytemuck::cast(values.map(|value| value.to_f32().to_bits().to_le()))
}

fn header<V: Coordinate, I: VertexIndex>(mesh: MeshView<'_, V, I>, comments: &[String]) -> String {
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    for comment in comments {
        // A line break would end the comment and start a header line of its own.
        header += &format!("comment {}\n", comment.replace(['\r', '\n'], " "));
    }
    header += &format!("element vertex {}\n", mesh.vertices.len());
    for name in ["x", "y", "z"] {
        header += &format!("property float {name}\n");
    }
    if mesh.normals.is_some() {
        for name in ["nx", "ny", "nz"] {
            header += &format!("property float {name}\n");
        }
    }
    if mesh.colors.is_some() {
        for name in ["red", "green", "blue"] {
            header += &format!("property uchar {name}\n");
        }
    }
    header += &format!("element face {}\nproperty list uchar uint vertex_indices\nend_header\n", mesh.faces.len());
    header
}
