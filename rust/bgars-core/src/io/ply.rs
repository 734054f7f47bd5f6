//! Binary little-endian PLY (Turk 1994).

use std::io::Write;

use super::MeshView;

/// Vertices or faces encoded at a time.
const BLOCK: usize = 1 << 14;

/// Writes `mesh` as binary PLY: x y z [nx ny nz] [red green blue], then triangles; `comments` go into the header.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_ply(mesh: MeshView<'_>, comments: &[String], out: &mut impl Write) -> std::io::Result<()> {
    out.write_all(header(mesh, comments).as_bytes())?;
    let mut block = Vec::with_capacity(BLOCK * 27);
    for start in (0..mesh.vertices.len()).step_by(BLOCK) {
        block.clear();
        for vertex in start..(start + BLOCK).min(mesh.vertices.len()) {
            push_floats(&mut block, mesh.vertices[vertex]);
            if let Some(normals) = mesh.normals {
                push_floats(&mut block, normals[vertex]);
            }
            if let Some(colors) = mesh.colors {
                block.extend_from_slice(&colors[vertex]);
            }
        }
        out.write_all(&block)?;
    }
    for faces in mesh.faces.chunks(BLOCK) {
        block.clear();
        for face in faces {
            block.push(3);
            for index in face {
                block.extend_from_slice(&index.to_le_bytes());
            }
        }
        out.write_all(&block)?;
    }
    Ok(())
}

fn header(mesh: MeshView<'_>, comments: &[String]) -> String {
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

fn push_floats(block: &mut Vec<u8>, values: [f32; 3]) {
    for value in values {
        block.extend_from_slice(&value.to_le_bytes());
    }
}
