//! What every normal would look like: bent grey levels under each light, tabulated on the disc of normals.
//!
//! Any material, and anything learnt about it, then runs through the same kernel.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::disc::from_disc;
use super::material::MIN_N_Z;
use crate::normals::add_product;

/// Lights of one group: what a vector register holds.
pub const GROUP: usize = 8;

/// Values of one group of lights.
pub type Group = [f32; GROUP];

/// Nodes along the diameter of the disc.
pub const SIDE: usize = 161;

/// Nodes beyond the edge of the disc, for interpolation.
const MARGIN: usize = 2;

/// All nodes along one axis.
const FULL_SIDE: usize = SIDE + 2 * MARGIN;

/// Nodes per unit of the disc.
const DENSITY: f32 = (SIDE - 1) as f32 / 2.0;

/// Coarse nodes are this many nodes apart.
const COARSE_STRIDE: usize = 4;

/// Smallest n_z of a coarse node.
const COARSE_MIN_N_Z: f32 = 0.05;

/// Signatures of all normals.
#[derive(Clone, Debug)]
pub struct Signatures {
    groups: usize,
    /// `groups` a node, row by row.
    nodes: Vec<Group>,
    coarse: Coarse,
}

/// Some of the nodes, light by light, to be compared with a pixel all at once.
#[derive(Clone, Debug, Default)]
struct Coarse {
    /// Places on the disc.
    points: Vec<[f32; 2]>,
    /// `points.len()` values for each of the lights.
    values: Vec<f32>,
}

/// A signature and its derivatives along a and b.
#[derive(Clone, Copy, Debug)]
pub struct Signature {
    /// Bent grey levels.
    pub value: Group,
    pub along_a: Group,
    pub along_b: Group,
}

/// The place on the disc of a node.
fn node_point(row: usize, col: usize) -> [f64; 2] {
    let at = |index: usize| (index as f64 - MARGIN as f64) / f64::from(DENSITY) - 1.0;
    [at(col), at(row)]
}

/// Nodes at and beyond the edge stand for the flattest normal that is evaluated.
fn node_place(point: [f64; 2]) -> [f64; 2] {
    let radius = (point[0] * point[0] + point[1] * point[1]).sqrt();
    let largest = (1.0 - MIN_N_Z).sqrt();
    let shrink = if radius > largest { largest / radius } else { 1.0 };
    [point[0] * shrink, point[1] * shrink]
}

impl Signatures {
    /// Tabulates `signature(normal, levels)`, which writes the bent level under each light.
    pub fn tabulate(lights: usize, signature: impl Fn(&Vector3<f64>, &mut [f32]) + Sync) -> Self {
        let groups = lights.div_ceil(GROUP);
        let nodes = vec![[0.0; GROUP]; FULL_SIDE * FULL_SIDE * groups];
        let empty = Self { groups, nodes, coarse: Coarse::default() };
        empty.corrected(lights, |place, levels| signature(&from_disc(place), levels))
    }

    /// The same, corrected: `correct(place, levels)`, bent levels of all lights.
    pub fn corrected(&self, lights: usize, correct: impl Fn([f64; 2], &mut [f32]) + Sync) -> Self {
        let groups = self.groups;
        let mut nodes = self.nodes.clone();
        nodes.par_chunks_mut(FULL_SIDE * groups).enumerate().for_each(|(row, nodes)| {
            for (col, node) in nodes.chunks_exact_mut(groups).enumerate() {
                correct(node_place(node_point(row, col)), &mut node.as_flattened_mut()[..lights]);
            }
        });
        let mut table = Self { groups, nodes, coarse: Coarse::default() };
        table.coarse = table.coarse_nodes(lights);
        table
    }

    fn coarse_nodes(&self, lights: usize) -> Coarse {
        let inside = |row: usize, col: usize| {
            let [a, b] = node_point(row, col);
            1.0 - (a * a + b * b) > f64::from(COARSE_MIN_N_Z)
        };
        let axis = || (MARGIN..MARGIN + SIDE).step_by(COARSE_STRIDE);
        let places: Vec<(usize, usize)> =
            axis().flat_map(|row| axis().map(move |col| (row, col))).filter(|&(row, col)| inside(row, col)).collect();
        let mut values = Vec::with_capacity(places.len() * lights);
        for light in 0..lights {
            values.extend(
                places.iter().map(|&(row, col)| {
                    self.nodes[(row * FULL_SIDE + col) * self.groups + light / GROUP][light % GROUP]
                }),
            );
        }
        let points = places.iter().map(|&(row, col)| node_point(row, col).map(|v| v as f32)).collect();
        Coarse { points, values }
    }

    pub fn groups(&self) -> usize {
        self.groups
    }

    /// The coarse nodes and, for each light, their bent levels.
    pub fn coarse(&self) -> (&[[f32; 2]], &[f32]) {
        (&self.coarse.points, &self.coarse.values)
    }

    /// The signature at a place of the disc for one group of lights, by cubic convolution (Keys 1981, eq. 3 with a = -1/2).
    #[inline(always)]
    #[allow(clippy::manual_clamp)]
    pub fn at<const FMA: bool>(&self, [a, b]: [f32; 2], group: usize) -> Signature {
        let limit = (FULL_SIDE - 3) as f32;
        // Not `clamp`, which would let a NaN through, to a node that does not exist.
        let inside = |position: f32| position.max(1.0).min(limit);
        let col = inside((a + 1.0) * DENSITY + MARGIN as f32);
        let row = inside((b + 1.0) * DENSITY + MARGIN as f32);
        let (first_col, first_row) = (col as usize, row as usize);
        let (wa, da) = weights(col - first_col as f32);
        let (wb, db) = weights(row - first_row as f32);
        let mut signature = Signature { value: [0.0; GROUP], along_a: [0.0; GROUP], along_b: [0.0; GROUP] };
        for i in 0..4 {
            let start = ((first_row + i - 1) * FULL_SIDE + first_col - 1) * self.groups + group;
            let (mut across, mut slope) = ([0.0f32; GROUP], [0.0f32; GROUP]);
            for j in 0..4 {
                let node = &self.nodes[start + j * self.groups];
                for k in 0..GROUP {
                    across[k] = add_product::<FMA>(across[k], wa[j], node[k]);
                    slope[k] = add_product::<FMA>(slope[k], da[j], node[k]);
                }
            }
            for k in 0..GROUP {
                signature.value[k] = add_product::<FMA>(signature.value[k], wb[i], across[k]);
                signature.along_a[k] = add_product::<FMA>(signature.along_a[k], wb[i], slope[k]);
                signature.along_b[k] = add_product::<FMA>(signature.along_b[k], db[i], across[k]);
            }
        }
        for k in 0..GROUP {
            signature.along_a[k] *= DENSITY;
            signature.along_b[k] *= DENSITY;
        }
        signature
    }
}

/// Weights of four neighbours and their derivatives at a fraction between the middle two.
#[inline(always)]
fn weights(t: f32) -> ([f32; 4], [f32; 4]) {
    let (t2, t3) = (t * t, t * t * t);
    (
        [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2],
        [-1.5 * t2 + 2.0 * t - 0.5, 4.5 * t2 - 5.0 * t, -4.5 * t2 + 4.0 * t + 0.5, 1.5 * t2 - t],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_that_is_not_a_number_is_no_place_outside_the_table() {
        let table = Signatures::tabulate(3, |normal, levels| levels.fill(normal.z as f32));
        for place in [[f32::NAN, 0.0], [0.0, f32::NAN], [f32::INFINITY, f32::NEG_INFINITY]] {
            let _ = table.at::<false>(place, 0);
        }
    }
}
