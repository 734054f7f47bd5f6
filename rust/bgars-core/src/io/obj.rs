//! Wavefront OBJ text.

use std::io::Write;

use super::blocks::write_pieces;
use super::{MeshSource, Vertices};

/// Writes `mesh` as OBJ: `v x y z [r g b]` (colours 0..1, the common extension), `vn`, `f`; `comments` come first.
///
/// # Method
/// A coordinate has the fewest digits that give the same `f32` back (`12.5`, `1e-7`), a normal six behind the point.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_obj(mesh: &impl MeshSource, comments: &[String], out: &mut (impl Write + Send)) -> std::io::Result<()> {
    for comment in comments {
        writeln!(out, "# {}", comment.replace(['\r', '\n'], " "))?;
    }
    let size = mesh.size();
    let levels: Vec<String> = (0..=255u8).map(|level| format!(" {:.4}", f32::from(level) / 255.0)).collect();
    let encode_vertices = |piece: usize, vertices: &mut Vertices, text: &mut Vec<u8>| {
        mesh.vertices(piece, vertices);
        text.clear();
        for (index, position) in vertices.positions.iter().enumerate() {
            text.push(b'v');
            for &value in position {
                push_shortest(text, value);
            }
            for &level in vertices.colors.get(index).into_iter().flatten() {
                text.extend_from_slice(levels[usize::from(level)].as_bytes());
            }
            text.push(b'\n');
        }
    };
    write_pieces(size.pieces[0], encode_vertices, out)?;
    if size.has_normals {
        let encode_normals = |piece: usize, vertices: &mut Vertices, text: &mut Vec<u8>| {
            mesh.vertices(piece, vertices);
            text.clear();
            for [x, y, z] in &vertices.normals {
                // To memory, which never fails.
                let _ = writeln!(text, "vn {x:.6} {y:.6} {z:.6}");
            }
        };
        write_pieces(size.pieces[0], encode_normals, out)?;
    }
    let encode_faces = |piece: usize, faces: &mut Vec<[u32; 3]>, text: &mut Vec<u8>| {
        mesh.faces(piece, faces);
        text.clear();
        for face in faces {
            push_face(text, face.map(|index| u64::from(index) + 1), size.has_normals);
        }
    };
    write_pieces(size.pieces[1], encode_faces, out)
}

/// A space and the shortest decimal that reads back as `value`.
fn push_shortest(text: &mut Vec<u8>, value: f32) {
    let mut digits = zmij::Buffer::new();
    let digits = digits.format(value);
    text.push(b' ');
    text.extend_from_slice(digits.strip_suffix(".0").unwrap_or(digits).as_bytes());
}

/// `f a b c`, or `f a//a b//b c//c` where vertices have normals; counted from 1.
fn push_face(text: &mut Vec<u8>, face: [u64; 3], with_normals: bool) {
    text.push(b'f');
    for index in face {
        let mut digits = itoa::Buffer::new();
        let digits = digits.format(index).as_bytes();
        text.push(b' ');
        text.extend_from_slice(digits);
        if with_normals {
            text.extend_from_slice(b"//");
            text.extend_from_slice(digits);
        }
    }
    text.push(b'\n');
}
