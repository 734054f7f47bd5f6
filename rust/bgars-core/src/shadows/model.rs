//! The shadow of one spheroid under one light: points on its edge, and rays from the board past the ball.
//!
//! A ray from the board point P to the light meets a spheroid with horizontal semi-axis R and vertical semi-axis q R when
//! it passes its centre closer than R, in a space where heights are divided by q. With w = P - C and u the unit vector to
//! the light, `D = |w - (w . u) u|`, and `(D - R) / |grad D|` is the distance of P to the edge of the shadow.

/// Newton steps from the tangent point down to a bowed board; one is exact on a plane.
const DESCENTS: usize = 3;

/// A spheroid, in pixels.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Centre, to the right.
    pub x: f64,
    /// Centre, up in the image.
    pub y: f64,
    /// Centre above the board under it.
    pub z: f64,
    /// Horizontal semi-axis.
    pub radius: f64,
    /// Vertical over horizontal semi-axis.
    pub q: f64,
}

impl From<[f64; 5]> for Ball {
    fn from([x, y, z, radius, q]: [f64; 5]) -> Self {
        Self { x, y, z, radius, q }
    }
}

/// A light: the unit vector to it, or its position where it is near.
#[derive(Clone, Copy, Debug)]
pub struct Lamp {
    /// Direction, or position in pixels.
    pub vector: [f64; 3],
    /// Which of the two.
    pub near: bool,
}

/// A quadratic board `z = c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2`.
#[derive(Clone, Copy, Debug)]
pub struct Board(pub [f64; 5]);

impl Board {
    /// Height at a place.
    #[must_use]
    #[inline]
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let [c1, c2, c3, c4, c5] = self.0;
        x * (c1 + c3 * x + c4 * y) + y * (c2 + c5 * y)
    }

    /// Slopes dz/dx and dz/dy at a place.
    #[must_use]
    #[inline]
    pub fn slopes(&self, x: f64, y: f64) -> (f64, f64) {
        let [c1, c2, c3, c4, c5] = self.0;
        (c1 + 2.0 * c3 * x + c4 * y, c2 + c4 * x + 2.0 * c5 * y)
    }
}

/// A point on the edge of a shadow, and the height above the board of the tangent point that throws it.
#[derive(Clone, Copy, Debug)]
pub struct EdgePoint {
    /// To the right.
    pub x: f64,
    /// Up in the image.
    pub y: f64,
    /// Above the board under the tangent point.
    pub tangent_height: f64,
}

/// A ray from a board point to the light, as it passes the ball (heights over q).
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// D, to the centre of the ball.
    pub distance: f64,
    /// Way from the board to the closest point.
    pub along: f64,
    /// 1 - along / (way to the lamp); 1 for distant lights.
    pub lever: f64,
    /// How far the closest point moves when the vector of the light changes by 1.
    pub turn: f64,
    /// Unit vector from the centre of the ball to the closest point.
    pub outward: [f64; 3],
    /// Gradient of D on the board.
    pub gradient: [f64; 2],
    /// Unit vector to the light.
    pub toward: [f64; 3],
}

impl Ray {
    /// Length of the gradient of D on the board.
    #[must_use]
    #[inline]
    pub fn slope(&self) -> f64 {
        (self.gradient[0] * self.gradient[0] + self.gradient[1] * self.gradient[1]).sqrt()
    }
}

/// Signed distance to an edge around a point on it, to second order.
///
/// With P the displacement on the board, p its component across the rays and k the lever,
/// `D^2 = D0^2 + 2 D0 grad . P + k^2 |p|^2` is exact on a plane; along the normal of the edge
/// `D = D0 + slope d + bend d^2 / 2`.
#[derive(Clone, Copy, Debug)]
pub struct Nearby {
    centre: f64,
    first: [f64; 2],
    second: [f64; 3],
    inverse_slope: f64,
    half_bend: f64,
}

impl Nearby {
    /// Signed distance at a displacement, positive outside.
    #[must_use]
    #[inline]
    pub fn distance(&self, dx: f64, dy: f64) -> f64 {
        let [xx, xy, yy] = self.second;
        let square =
            dx * (self.first[0] + xx * dx + xy * dy) + dy * (self.first[1] + yy * dy) + self.centre * self.centre;
        let distance = (square.max(0.0).sqrt() - self.centre) * self.inverse_slope;
        distance - self.half_bend * distance * distance
    }
}

/// The shadow that one ball throws under one light.
#[derive(Clone, Copy, Debug)]
pub struct Shadow<'a> {
    ball: Ball,
    lamp: Lamp,
    board: &'a Board,
    /// Height of the board under the ball.
    under: f64,
    /// Middle of the circle of tangent points, from the centre of the ball (heights over q).
    forward: [f64; 3],
    /// Its radii, level and upward.
    side: [f64; 2],
    up: [f64; 3],
}

impl<'a> Shadow<'a> {
    /// The circle of tangent points, from which everything follows.
    #[must_use]
    pub fn new(ball: Ball, lamp: Lamp, board: &'a Board) -> Self {
        let under = board.height(ball.x, ball.y);
        let [x, y, z] = lamp.vector;
        let to = if lamp.near { [x - ball.x, y - ball.y, (z - under - ball.z) / ball.q] } else { [x, y, z / ball.q] };
        let length = norm(to);
        let to = to.map(|part| part / length);
        let level = to[0].hypot(to[1]).max(1e-9);
        let (forward, ring) = if lamp.near {
            let share = ball.radius / length;
            (ball.radius * share, ball.radius * (1.0 - share * share).max(0.0).sqrt())
        } else {
            (0.0, ball.radius)
        };
        Self {
            ball,
            lamp,
            board,
            under,
            forward: to.map(|part| forward * part),
            side: [-ring * to[1] / level, ring * to[0] / level],
            up: [-ring * to[2] * to[0] / level, -ring * to[2] * to[1] / level, ring * level],
        }
    }

    /// A point of the edge by sine and cosine of the angle of its tangent point on the terminator: 0 = its top, which
    /// throws the far tip.
    #[must_use]
    pub fn edge(&self, sine: f64, cosine: f64) -> EdgePoint {
        let Self { ball, board, .. } = self;
        let x = ball.x + self.forward[0] + cosine * self.up[0] + sine * self.side[0];
        let y = ball.y + self.forward[1] + cosine * self.up[1] + sine * self.side[1];
        let z = self.under + ball.z + ball.q * (self.forward[2] + cosine * self.up[2]);
        let [lamp_x, lamp_y, lamp_z] = self.lamp.vector;
        let ray = if self.lamp.near { [lamp_x - x, lamp_y - y, lamp_z - z] } else { self.lamp.vector };
        let mut way = z / ray[2];
        for _ in 0..DESCENTS {
            way += (z - way * ray[2] - board.height(x - way * ray[0], y - way * ray[1])) / ray[2];
        }
        EdgePoint { x: x - way * ray[0], y: y - way * ray[1], tangent_height: z - board.height(x, y) }
    }

    /// The ray from a board point to the light.
    #[must_use]
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let Self { ball, board, .. } = self;
        let ground = board.height(x, y);
        let across = [x - ball.x, y - ball.y, (ground - self.under - ball.z) / ball.q];
        let [lamp_x, lamp_y, lamp_z] = self.lamp.vector;
        let to = if self.lamp.near {
            [lamp_x - x, lamp_y - y, (lamp_z - ground) / ball.q]
        } else {
            [lamp_x, lamp_y, lamp_z / ball.q]
        };
        let inverse = 1.0 / norm(to);
        let toward = to.map(|part| part * inverse);
        let along = -(across[0] * toward[0] + across[1] * toward[1] + across[2] * toward[2]);
        let foot = [0, 1, 2].map(|axis| across[axis] + along * toward[axis]);
        let distance = norm(foot);
        let outward = foot.map(|part| part / distance.max(1e-9));
        let turn = along * inverse;
        let lever = if self.lamp.near { 1.0 - turn } else { 1.0 };
        let (slope_x, slope_y) = board.slopes(x, y);
        let rise = outward[2] / ball.q;
        let gradient = [lever * (outward[0] + rise * slope_x), lever * (outward[1] + rise * slope_y)];
        Ray { distance, along, lever, turn, outward, gradient, toward }
    }

    /// Constants of the distance around a point of the edge, whose ray is `ray`.
    #[must_use]
    pub fn near_edge(&self, x: f64, y: f64, ray: &Ray) -> Nearby {
        let (slope_x, slope_y) = self.board.slopes(x, y);
        let (slope_x, slope_y) = (slope_x / self.ball.q, slope_y / self.ball.q);
        let (along_x, along_y) = (ray.toward[0] + slope_x * ray.toward[2], ray.toward[1] + slope_y * ray.toward[2]);
        let square = ray.lever * ray.lever;
        let xx = square * (1.0 + slope_x * slope_x - along_x * along_x);
        let yy = square * (1.0 + slope_y * slope_y - along_y * along_y);
        let xy = square * (slope_x * slope_y - along_x * along_y);
        let slope = ray.slope();
        let [normal_x, normal_y] = ray.gradient.map(|part| part / slope);
        let across = xx * normal_x * normal_x + 2.0 * xy * normal_x * normal_y + yy * normal_y * normal_y;
        let bend = (across - slope * slope) / ray.distance;
        Nearby {
            centre: ray.distance,
            first: ray.gradient.map(|part| 2.0 * ray.distance * part),
            second: [xx, 2.0 * xy, yy],
            inverse_slope: 1.0 / slope,
            half_bend: 0.5 * bend / slope,
        }
    }

    /// Height of the centre over the board as its tangent plane under the ball, and the slopes of that plane, over q.
    pub(super) fn tangent_plane(&self) -> (f64, f64, f64) {
        let (slope_x, slope_y) = self.board.slopes(self.ball.x, self.ball.y);
        (self.ball.z / self.ball.q, slope_x / self.ball.q, slope_y / self.ball.q)
    }
}

pub(super) fn norm([x, y, z]: [f64; 3]) -> f64 {
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every edge point's ray touches the ball, and the distance around it is that of its ray.
    #[test]
    fn rays_from_the_edge_touch_the_ball() {
        let ball = Ball { x: 30.0, y: -20.0, z: 25.0, radius: 30.0, q: 0.9 };
        let board = Board([1e-3, -2e-3, 1e-5, 2e-6, -1e-5]);
        for (vector, near) in [([0.5, 0.5, 0.5f64.sqrt()], false), ([900.0, -700.0, 1200.0], true)] {
            let shadow = Shadow::new(ball, Lamp { vector, near }, &board);
            for degrees in [-80.0f64, -10.0, 0.0, 45.0, 90.0] {
                let (sine, cosine) = degrees.to_radians().sin_cos();
                let point = shadow.edge(sine, cosine);
                let ray = shadow.ray(point.x, point.y);
                approx::assert_abs_diff_eq!(ray.distance, ball.radius, epsilon = 1e-6);
                let nearby = shadow.near_edge(point.x, point.y, &ray);
                let outward = ray.gradient.map(|part| 0.5 * part / ray.slope());
                approx::assert_abs_diff_eq!(nearby.distance(outward[0], outward[1]), 0.5, epsilon = 1e-3);
            }
        }
    }
}
