//! Wavefront OBJ text.

use std::io::Write;

use super::MeshView;

/// Writes `mesh` as OBJ: `v x y z [r g b]` (colours 0..1, the common extension), `vn`, `f`; `comments` come first.
///
/// # Errors
/// Whatever `out` reports.
pub fn write_obj(mesh: MeshView<'_>, comments: &[String], out: &mut impl Write) -> std::io::Result<()> {
    for comment in comments {
        writeln!(out, "# {}", comment.replace(['\r', '\n'], " "))?;
    }
    for (index, [x, y, z]) in mesh.vertices.iter().enumerate() {
        write!(out, "v {x} {y} {z}")?;
        if let Some(colors) = mesh.colors {
            let [r, g, b] = colors[index].map(|level| f32::from(level) / 255.0);
            write!(out, " {r:.4} {g:.4} {b:.4}")?;
        }
        writeln!(out)?;
    }
    for [x, y, z] in mesh.normals.into_iter().flatten() {
        writeln!(out, "vn {x:.6} {y:.6} {z:.6}")?;
    }
    for face in mesh.faces {
        let [a, b, c] = face.map(|index| u64::from(index) + 1);
        if mesh.normals.is_some() {
            writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?;
        } else {
            writeln!(out, "f {a} {b} {c}")?;
        }
    }
    Ok(())
}
