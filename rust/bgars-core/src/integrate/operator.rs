//! The normal equations: a weighted graph Laplacian on the pixels of the mask, its blacks eliminated.

use super::Difference;
use super::checkerboard::{Grid, Weights};
use super::edges::{Axis, Colours, EdgeRow, from_edges};

/// Smallest n_z of an edge: a normal seen edge-on has no finite slope.
const MIN_N_Z: f64 = 1e-3;

/// The pixels to integrate over, their normals and how much each is trusted.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// 3 values a pixel (x right, y up, z to the camera), row-major.
    pub normals: &'a [f32],
    /// True = use.
    pub mask: &'a [bool],
    /// Trust in each pixel, at least 0; `None`: all alike.
    pub weights: Option<&'a [f32]>,
    /// A number for each pixel: where it differs between neighbours, nothing joins them. `None`: all one.
    pub regions: Option<&'a [i32]>,
    /// Pixels in a row.
    pub width: usize,
}

/// One row of the field with its components apart; pixels outside the mask face the camera and are not trusted.
#[derive(Debug, Default, Clone)]
struct FieldRow {
    along: [Vec<f32>; 2],
    n_z: Vec<f32>,
    /// Square root of the pixel's weight, 0 outside the mask.
    trust: Vec<f64>,
}

impl FieldRow {
    fn load(&mut self, field: Field<'_>, row: usize) {
        let span = row * field.width..(row + 1) * field.width;
        let mask = &field.mask[span.clone()];
        self.trust.clear();
        match field.weights {
            Some(weights) => {
                let roots = weights[span.clone()].iter().map(|&weight| f64::from(weight).sqrt());
                self.trust.extend(roots.zip(mask).map(|(root, &used)| if used { root } else { 0.0 }));
            }
            None => self.trust.extend(mask.iter().map(|&used| f64::from(u8::from(used)))),
        }
        let normals = &field.normals[span.start * 3..span.end * 3];
        let component = |axis: usize, outside: f32| {
            normals.chunks_exact(3).zip(mask).map(move |(normal, &used)| if used { normal[axis] } else { outside })
        };
        for (axis, along) in self.along.iter_mut().enumerate() {
            along.clear();
            along.extend(component(axis, 0.0));
        }
        self.n_z.clear();
        self.n_z.extend(component(2, 1.0));
    }
}

impl EdgeRow {
    /// Edges from pixel k of `a` to pixel k of `b`; `sign` is +1 where the axis grows from `a` to `b`; `lead_is_a` says whose
    /// normal the forward difference takes.
    ///
    /// `n_z^2` is the weight that the paper's rows `n_z dz = -n_x` imply.
    fn join(
        &mut self,
        a: (&[f32], &[f32], &[f64]),
        b: (&[f32], &[f32], &[f64]),
        sign: f64,
        difference: Difference,
        lead_is_a: bool,
    ) {
        let edges = a.2.len().min(b.2.len());
        let (share_a, share_b) = match (difference, lead_is_a) {
            (Difference::Trapezoid, _) => (0.5, 0.5),
            (Difference::Forward, true) => (1.0, 0.0),
            (Difference::Forward, false) => (0.0, 1.0),
        };
        for k in 0..edges {
            let along = share_a * f64::from(a.0[k]) + share_b * f64::from(b.0[k]);
            let n_z = (share_a * f64::from(a.1[k]) + share_b * f64::from(b.1[k])).max(MIN_N_Z);
            let trust = a.2[k] * b.2[k];
            self.weight[k] = (trust * n_z * n_z) as f32;
            self.push[k] = -sign * trust * n_z * along;
        }
    }

    /// Takes away the edges between regions: from pixel k of the image to pixel k + `stride`, k counted from `first`.
    fn cut(&mut self, field: Field<'_>, first: usize, stride: usize) {
        let Some(regions) = field.regions else { return };
        for (k, (weight, push)) in self.weight.iter_mut().zip(&mut self.push).enumerate() {
            let (a, b) = (first + k, first + k + stride);
            if b < regions.len() && regions[a] != regions[b] {
                (*weight, *push) = (0.0, 0.0);
            }
        }
    }
}

/// The last two rows of a field that were asked for.
#[derive(Default)]
struct FieldRows {
    rows: [FieldRow; 2],
    loaded: [Option<usize>; 2],
}

impl FieldRows {
    fn load(&mut self, field: Field<'_>, row: usize) {
        if self.loaded[row % 2] != Some(row) {
            self.rows[row % 2].load(field, row);
            self.loaded[row % 2] = Some(row);
        }
    }
}

/// Weights and right side `M^T v` of a field; both zero outside the mask.
pub(super) fn assemble(field: Field<'_>, difference: Difference) -> (Weights, Colours) {
    let width = field.width;
    let grid = Grid { height: field.mask.len() / width, width };
    from_edges(grid, || {
        let mut rows = FieldRows::default();
        move |axis: Axis, row: usize, edges: &mut EdgeRow| {
            rows.load(field, row);
            let FieldRow { along, n_z, trust } = &rows.rows[row % 2];
            match axis {
                Axis::Right => {
                    let (a, b) = ((&along[0][..], &n_z[..], &trust[..]), (&along[0][1..], &n_z[1..], &trust[1..]));
                    edges.join(a, b, 1.0, difference, true);
                    edges.cut(field, row * width, 1);
                }
                Axis::Below => {
                    rows.load(field, row + 1);
                    let [upper, lower] = [&rows.rows[row % 2], &rows.rows[(row + 1) % 2]];
                    let a = (&upper.along[1][..], &upper.n_z[..], &upper.trust[..]);
                    // y grows upward: the forward difference starts at the lower pixel.
                    edges.join(a, (&lower.along[1], &lower.n_z, &lower.trust), -1.0, difference, false);
                    edges.cut(field, row * width, width);
                }
            }
        }
    })
}
