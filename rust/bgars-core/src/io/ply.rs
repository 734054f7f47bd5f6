//! Binary little-endian PLY (Turk 1994).

use std::io::Write;

use super::blocks::write_pieces;
use super::{MeshSize, MeshSource, Vertices};

/// Bytes of three floats.
const TRIPLE_BYTES: usize = 12;
/// Bytes of a colour.
const COLOR_BYTES: usize = 3;
/// Bytes of a triangle: its number of corners, then three indices.
const FACE_BYTES: usize = 13;

/// Writes `mesh` as binary PLY: x y z [nx ny nz] [red green blue], then triangles; `comments` go into the header.
///
/// # Errors
/// Whatever `out` reports.
///
/// # Cost
/// Little more than `out` takes for the bytes: pieces are encoded on all threads while others are written.
pub fn write_ply(mesh: &impl MeshSource, comments: &[String], out: &mut (impl Write + Send)) -> std::io::Result<()> {
    out.write_all(header(mesh.size(), comments).as_bytes())?;
    let encode_vertices = |piece: usize, vertices: &mut Vertices, block: &mut Vec<u8>| {
        mesh.vertices(piece, vertices);
        encode_vertices(vertices, block);
    };
    write_pieces(mesh.size().pieces[0], encode_vertices, out)?;
    let encode_faces = |piece: usize, faces: &mut Vec<[u32; 3]>, block: &mut Vec<u8>| {
        mesh.faces(piece, faces);
        encode_faces(faces, block);
    };
    write_pieces(mesh.size().pieces[1], encode_faces, out)
}

/// Records of the vertices, one array after the other: each is a loop without a branch.
fn encode_vertices(vertices: &Vertices, block: &mut Vec<u8>) {
    let (has_normals, has_colors) = (!vertices.normals.is_empty(), !vertices.colors.is_empty());
    let record_bytes = TRIPLE_BYTES + TRIPLE_BYTES * usize::from(has_normals) + COLOR_BYTES * usize::from(has_colors);
    block.resize(vertices.positions.len() * record_bytes, 0);
    let triples = [(0, &vertices.positions), (TRIPLE_BYTES, &vertices.normals)];
    for (at, triples) in triples {
        for (record, &triple) in block.chunks_exact_mut(record_bytes).zip(triples) {
            record[at..at + TRIPLE_BYTES].copy_from_slice(&float_bytes(triple));
        }
    }
    let colors_at = record_bytes - COLOR_BYTES;
    for (record, color) in block.chunks_exact_mut(record_bytes).zip(&vertices.colors) {
        record[colors_at..].copy_from_slice(color);
    }
}

fn encode_faces(faces: &[[u32; 3]], block: &mut Vec<u8>) {
    block.resize(faces.len() * FACE_BYTES, 0);
    for (record, face) in block.chunks_exact_mut(FACE_BYTES).zip(faces) {
        let indices: [u8; TRIPLE_BYTES] = bytemuck::cast(face.map(u32::to_le));
        record[0] = 3;
        record[1..].copy_from_slice(&indices);
    }
}

#[inline]
fn float_bytes(values: [f32; 3]) -> [u8; TRIPLE_BYTES] {
    bytemuck::cast(values.map(|value| value.to_bits().to_le()))
}

fn header(mesh: MeshSize, comments: &[String]) -> String {
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    for comment in comments {
        // A line break would end the comment and start a header line of its own.
        header += &format!("comment {}\n", comment.replace(['\r', '\n'], " "));
    }
    header += &format!("element vertex {}\n", mesh.vertices);
    for (written, kind, names) in [
        (true, "float", ["x", "y", "z"]),
        (mesh.has_normals, "float", ["nx", "ny", "nz"]),
        (mesh.has_colors, "uchar", ["red", "green", "blue"]),
    ] {
        header.extend(names.iter().filter(|_| written).map(|name| format!("property {kind} {name}\n")));
    }
    header += &format!("element face {}\nproperty list uchar uint vertex_indices\nend_header\n", mesh.faces);
    header
}
