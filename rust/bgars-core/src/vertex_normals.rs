//! Normals of a mesh's vertices from its faces.

use rayon::prelude::*;

use crate::Result;
use crate::io::{Coordinate, MeshView, VertexIndex};

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
pub fn vertex_normals<V: Coordinate, I: VertexIndex>(vertices: &[[V; 3]], faces: &[[I; 3]]) -> Result<Vec<[f32; 3]>> {
    MeshView { vertices, faces, normals: None, colors: None }.check()?;
    let mut sums = vec![[0f64; 3]; vertices.len()];
    let mut corners = Vec::with_capacity(BLOCK.min(faces.len()));
    for faces in faces.chunks(BLOCK) {
        let measure = |face: &[I; 3]| weighted_normals(face.map(|index| vertices[index.to_u64() as usize]));
        faces.par_iter().map(measure).collect_into_vec(&mut corners);
        for (face, corners) in faces.iter().zip(&corners) {
            for (index, corner) in face.iter().zip(corners) {
                let sum = &mut sums[index.to_u64() as usize];
                *sum = std::array::from_fn(|axis| sum[axis] + corner[axis]);
            }
        }
    }
    Ok(sums.par_iter().map(|&sum| unit(sum).map(|value| value as f32)).collect())
}

/// The face's unit normal times the angle at each of its corners; zero for a face without area.
fn weighted_normals<V: Coordinate>(face: [[V; 3]; 3]) -> [[f64; 3]; 3] {
    let [a, b, c] = face.map(|vertex| vertex.map(Coordinate::to_f64));
    let (ab, ac, bc) = (minus(b, a), minus(c, a), minus(c, b));
    let normal = unit(cross(ab, ac));
    if dot(normal, normal) < 0.5 {
        // No area, no direction.
        return [[0.0; 3]; 3];
    }
    let [ab, ac, bc] = [ab, ac, bc].map(unit);
    let at_a = dot(ab, ac).clamp(-1.0, 1.0).acos();
    let at_b = (-dot(ab, bc)).clamp(-1.0, 1.0).acos();
    [at_a, at_b, std::f64::consts::PI - at_a - at_b].map(|angle| normal.map(|value| value * angle))
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `vector` of length 1; zero where it has none.
fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = dot(vector, vector).sqrt();
    if length > MIN_CROSS && length.is_finite() { vector.map(|value| value / length) } else { [0.0; 3] }
}
