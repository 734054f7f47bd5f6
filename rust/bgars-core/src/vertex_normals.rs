//! Normals of a mesh's vertices from its faces.

use nalgebra::Vector3;
use rayon::prelude::*;

use crate::Result;
use crate::io::MeshView;

/// Faces measured at a time.
const BLOCK: usize = 1 << 16;
/// Shortest cross product of two edges whose face still has a direction.
const MIN_CROSS: f64 = 1e-30;

/// Unit normal of each vertex: the mean of its faces' normals, each weighted by the face's angle at the vertex (Thürmer &
/// Wüthrich 1998, "Computing vertex normals from polygonal facets", section 3); zero where a vertex has no face.
///
/// # Method
/// Faces are measured on all threads, block by block, and summed in their order: the same bits for any number of threads.
///
/// # Errors
/// [`crate::Error::OutOfRange`] where a face names a vertex that does not exist.
///
/// # Examples
/// ```
/// let vertices = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [0.0, 2.0, 5.0], [9.0, 9.0, 9.0]];
/// let normals = bgars_core::vertex_normals::vertex_normals(&vertices, &[[0, 1, 2]])?;
/// assert_eq!(normals, [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0; 3]]);
/// # Ok::<(), bgars_core::Error>(())
/// ```
pub fn vertex_normals(vertices: &[[f64; 3]], faces: &[[i64; 3]]) -> Result<Vec<[f32; 3]>> {
    MeshView { vertices, faces, normals: None, colors: None }.check()?;
    let mut sums = vec![Vector3::zeros(); vertices.len()];
    let mut corners = Vec::with_capacity(BLOCK.min(faces.len()));
    for faces in faces.chunks(BLOCK) {
        let measure = |face: &[i64; 3]| weighted_normals(face.map(|index| vertices[index as usize].into()));
        faces.par_iter().map(measure).collect_into_vec(&mut corners);
        for (face, corners) in faces.iter().zip(&corners) {
            for (&index, corner) in face.iter().zip(corners) {
                sums[index as usize] += corner;
            }
        }
    }
    Ok(sums.par_iter().map(|&sum| unit(sum).map(|value| value as f32).into()).collect())
}

/// The face's unit normal times the angle at each of its corners; zero for a face without area.
fn weighted_normals([a, b, c]: [Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
    let normal = unit((b - a).cross(&(c - a)));
    if normal.norm_squared() < 0.5 {
        // No area, no direction.
        return [Vector3::zeros(); 3];
    }
    let [ab, ac, bc] = [b - a, c - a, c - b].map(unit);
    let at_a = ab.dot(&ac).clamp(-1.0, 1.0).acos();
    let at_b = (-ab.dot(&bc)).clamp(-1.0, 1.0).acos();
    [at_a, at_b, std::f64::consts::PI - at_a - at_b].map(|angle| normal * angle)
}

/// `vector` of length 1; zero where it has none.
fn unit(vector: Vector3<f64>) -> Vector3<f64> {
    let length = vector.norm();
    if length > MIN_CROSS && length.is_finite() { vector / length } else { Vector3::zeros() }
}
