//! Distances of measured points to the edges of predicted shadows, and the normal equations of all of them.
//!
//! What is done with them: `python/bgars/inspection/bundle.py`.

use multiversion::multiversion;

use super::model::{Ball, Board, Lamp, Shadow};

/// Waves along an edge that measured edges are off by on all shadows alike: cos 0, cos a, cos 2a, cos 3a.
pub const WAVES: usize = 4;
/// Unknowns of a point: x, y, z, radius, q of its ball; two turns of its light and the shift of its image; the board;
/// waves.
pub const TERMS: usize = 5 + 4 + 5 + WAVES;
/// Of a point: derivatives by the unknowns, its distance, and its angle from the tip of the shadow.
pub const COLUMNS: usize = TERMS + 2;
const LEAST_SLOPE: f64 = 1e-3;

/// One light: where it is, how it changes along two directions (per radian), and how far its image is shifted.
#[derive(Clone, Copy, Debug)]
pub struct LightState {
    /// The light.
    pub lamp: Lamp,
    /// Change along the azimuth, and up.
    pub ways: [[f64; 3]; 2],
    /// Along x and y, pixels.
    pub shift: [f64; 2],
}

/// The rows of all points, by ball, then light, then point; [`COLUMNS`] each.
///
/// # Method
/// Derivatives are those of the edge, at the point of it next to the measured one: at the measured point itself they
/// would go with its error, and the products of both would not average out (errors in variables; Fuller 1987, ch. 3).
///
/// `x`, `y`: as many points a shadow as there are, balls times lights times points.
#[must_use]
pub fn edge_rows(
    [x, y]: [&[f64]; 2],
    balls: &[Ball],
    lights: &[LightState],
    board: &Board,
    waves_px: [f64; WAVES],
) -> Vec<[f64; COLUMNS]> {
    let points = x.len() / (balls.len() * lights.len()).max(1);
    let mut rows = Vec::with_capacity(x.len());
    for (ball, &of_ball) in balls.iter().enumerate() {
        for (light, of_light) in lights.iter().enumerate() {
            let shadow = Shadow::new(of_ball, of_light.lamp, board);
            let own = Own { ball: of_ball, light: of_light, waves_px, plane: board.slopes(of_ball.x, of_ball.y) };
            let first = (ball * lights.len() + light) * points;
            for point in first..first + points {
                rows.push(own.row(&shadow, x[point] - of_light.shift[0], y[point] - of_light.shift[1]));
            }
        }
    }
    rows
}

/// What the points of one shadow share.
struct Own<'a> {
    ball: Ball,
    light: &'a LightState,
    waves_px: [f64; WAVES],
    /// Slopes of the board under the ball.
    plane: (f64, f64),
}

impl Own<'_> {
    #[inline]
    fn row(&self, shadow: &Shadow<'_>, x: f64, y: f64) -> [f64; COLUMNS] {
        let Ball { x: ball_x, y: ball_y, radius, q, .. } = self.ball;
        let off = shadow.ray(x, y);
        let off_slope = off.slope().max(LEAST_SLOPE);
        let rough = (off.distance - radius) / (off_slope * off_slope);
        let (x, y) = (x - rough * off.gradient[0], y - rough * off.gradient[1]);
        let beam = shadow.ray(x, y);
        let inverse_slope = 1.0 / beam.slope().max(LEAST_SLOPE);
        // What is left at the foot, and the way to it by the mean slope: exact to second order.
        let distance = (off.distance - beam.distance) * 2.0 / (1.0 / inverse_slope + off_slope)
            + (beam.distance - radius) * inverse_slope;
        let [out_x, out_y, out_z] = beam.outward;
        let rise = out_z / q;
        let [along_azimuth, up] = self
            .light
            .ways
            .map(|[way_x, way_y, way_z]| beam.turn * (out_x * way_x + out_y * way_y + out_z * way_z / q));
        let terms = |x: f64, y: f64| [x, y, x * x, x * y, y * y];
        let (here, under) = (terms(x, y), terms(ball_x, ball_y));
        let [c1, c2, c3, c4, c5] = std::array::from_fn(|term| rise * (beam.lever * here[term] - under[term]));
        let geometry = [
            -out_x - rise * self.plane.0,
            -out_y - rise * self.plane.1,
            -rise,
            -1.0,
            // Every height shrinks together: the closest point moves by -D n_z / q along z.
            -beam.distance * out_z * rise,
            along_azimuth,
            up,
            -beam.gradient[0],
            -beam.gradient[1],
            c1,
            c2,
            c3,
            c4,
            c5,
        ]
        .map(|by| by * inverse_slope);
        // The edge's normal against the way of the light on the board: 0 at the tip, +-pi/2 at the sides.
        let [toward_x, toward_y, _] = beam.toward;
        let angle = (toward_x * beam.gradient[1] - toward_y * beam.gradient[0])
            .atan2(-(toward_x * beam.gradient[0] + toward_y * beam.gradient[1]));
        let cosine = angle.cos();
        let waves = [1.0, cosine, 2.0 * cosine * cosine - 1.0, (4.0 * cosine * cosine - 3.0) * cosine];
        let outward: f64 = waves.iter().zip(self.waves_px).map(|(wave, size_px)| wave * size_px).sum();
        let mut row = [0.0; COLUMNS];
        row[..TERMS - WAVES].copy_from_slice(&geometry);
        row[TERMS - WAVES..TERMS].copy_from_slice(&waves.map(|wave| -wave));
        row[TERMS..].copy_from_slice(&[distance - outward, angle]);
        row
    }
}

/// Sums over the points of each shadow of the weighted products of derivatives and distance, `(TERMS + 1)` squared.
#[must_use]
pub fn edge_products(rows: &[[f64; COLUMNS]], weights: &[f64], points: usize) -> Vec<f64> {
    let mut products = Vec::with_capacity(rows.len() / points.max(1) * (TERMS + 1).pow(2));
    for (rows, weights) in rows.chunks_exact(points).zip(weights.chunks_exact(points)) {
        let sums = of_shadow(rows, weights);
        products.extend(sums[..=TERMS].iter().flat_map(|row| &row[..=TERMS]));
    }
    products
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn of_shadow(rows: &[[f64; COLUMNS]], weights: &[f64]) -> [[f64; COLUMNS]; COLUMNS] {
    let mut sums = [[0.0; COLUMNS]; COLUMNS];
    for (row, &weight) in rows.iter().zip(weights) {
        if weight != 0.0 {
            for (sums, value) in sums.iter_mut().zip(row) {
                let weighted = weight * value;
                for (sum, other) in sums.iter_mut().zip(row) {
                    *sum += weighted * other;
                }
            }
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOARD: Board = Board([1e-3, -2e-3, 1e-5, 2e-6, -1e-5]);
    const BALL: Ball = Ball { x: 30.0, y: -20.0, z: 25.0, radius: 30.0, q: 0.9 };

    fn light(near: bool) -> LightState {
        let vector = if near { [900.0, -700.0, 1200.0] } else { [0.5, 0.5, 0.5f64.sqrt()] };
        LightState { lamp: Lamp { vector, near }, ways: [[0.0; 3]; 2], shift: [0.0; 2] }
    }

    /// Derivatives by ball, light, shift and board are those of the distance.
    #[test]
    fn derivatives_are_differences() {
        for near in [false, true] {
            let light = light(near);
            let ways = if near { [[700.0, 900.0, 0.0], [1.0, 2.0, 3.0]] } else { [[-0.5, 0.5, 0.0], [0.3, 0.2, 0.1]] };
            let (sine, cosine) = 0.4f64.sin_cos();
            let point = Shadow::new(BALL, light.lamp, &BOARD).edge(sine, cosine);
            let row =
                edge_rows([&[point.x], &[point.y]], &[BALL], &[LightState { ways, ..light }], &BOARD, [0.0; 4])[0];
            approx::assert_abs_diff_eq!(row[TERMS], 0.0, epsilon = 1e-9);
            for (term, by) in row[..TERMS - WAVES].iter().enumerate() {
                let step = if term >= 11 { 1e-9 } else { 1e-6 };
                let at = |step: f64| {
                    let (mut ball, mut light, mut board) = (BALL, light, BOARD);
                    match term {
                        0 => ball.x += step,
                        1 => ball.y += step,
                        2 => ball.z += step,
                        3 => ball.radius += step,
                        4 => ball.q += step,
                        5 | 6 => (0..3).for_each(|axis| light.lamp.vector[axis] += step * ways[term - 5][axis]),
                        7 | 8 => light.shift[term - 7] += step,
                        _ => board.0[term - 9] += step,
                    }
                    edge_rows([&[point.x], &[point.y]], &[ball], &[light], &board, [0.0; WAVES])[0][TERMS]
                };
                let difference = (at(step) - at(-step)) / (2.0 * step);
                approx::assert_relative_eq!(*by, difference, epsilon = 1e-4, max_relative = 1e-4);
            }
        }
    }

    /// Products are sums over the points of a shadow; points without weight do not count.
    #[test]
    fn products_are_weighted_sums() {
        let [mut first, mut second] = [[1.0; COLUMNS], [f64::NAN; COLUMNS]];
        first[TERMS] = 3.0;
        second[0] = 7.0;
        let products = edge_products(&[first, second], &[2.0, 0.0], 2);
        assert_eq!(products.len(), (TERMS + 1).pow(2));
        let some = [products[0], products[TERMS], products[products.len() - 1]];
        assert_eq!(some.map(f64::to_bits), [2.0, 6.0, 18.0].map(f64::to_bits));
    }
}
