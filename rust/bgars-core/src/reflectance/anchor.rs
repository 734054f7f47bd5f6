//! Calibration spheres that a part brings along: circles of balls in the image.

use std::ops::Range;

use nalgebra::Vector3;

/// Height of a soldered ball's centre over the board, in radii; only the nearness of near lights depends on it.
const CENTRE_HEIGHT: f64 = 0.7;

/// Smallest n_z that errors are carried over at: linear no more beyond it.
const MIN_N_Z: f64 = 0.1;

/// The silhouette of a ball. x right, y up, origin at the image centre, pixels.
#[allow(missing_docs)] // the names say it
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    /// Centre to the right of the image centre.
    pub x_px: f64,
    /// Centre above the image centre.
    pub y_px: f64,
    pub radius_px: f64,
    /// Standard uncertainty of the radius; 0 for a circle that is right.
    pub u_radius_px: f64,
    pub shape: Shape,
}

/// The surface over a circle of radius R.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Part of a sphere of radius R over this ratio: `n_xy = ratio (p - c) / R`. 1: half a ball, seen to its equator; below 1, a
    /// cap lower than half a ball, whose outline is where it meets the board.
    Cap(f64),
    /// Half an ellipsoid whose height is this ratio of R.
    Ellipsoid(f64),
}

impl Shape {
    /// Half a ball.
    pub const SPHERE: Self = Self::Cap(1.0);

    /// Normal at a place `(p - c) / R`; `None` outside.
    fn normal(self, x: f64, y: f64) -> Option<Vector3<f64>> {
        let z2 = 1.0 - x * x - y * y;
        // False for a circle without a radius: z2 is then minus infinity, or not a number at its centre.
        if z2 <= 0.0 || z2.is_nan() {
            return None;
        }
        match self {
            Self::Cap(ratio) => {
                let (x, y) = (ratio * x, ratio * y);
                let z2 = 1.0 - x * x - y * y;
                (z2 > 0.0).then(|| Vector3::new(x, y, z2.sqrt()))
            }
            Self::Ellipsoid(ratio) => Some(Vector3::new(ratio * x, ratio * y, z2.sqrt()).normalize()),
        }
    }
}

impl Circle {
    /// No ball: every pixel is outside, and near lights are taken as the image centre sees them.
    pub const NOWHERE: Self = Self::exact(0.0, 0.0, 0.0);

    /// A circle that is right.
    #[must_use]
    pub const fn exact(x_px: f64, y_px: f64, radius_px: f64) -> Self {
        Self { x_px, y_px, radius_px, u_radius_px: 0.0, shape: Shape::SPHERE }
    }

    /// Standard angle in radian by which the error of the radius turns a normal of its sphere: `n_xy = (p - c) / R` moves
    /// outward by `n_xy u_R / R`, and there the sphere turns away by `1 / n_z`.
    #[must_use]
    #[inline]
    pub fn error_rad(&self, normal: &Vector3<f64>) -> f64 {
        normal.x.hypot(normal.y) * self.u_radius_px / (self.radius_px * normal.z.max(MIN_N_Z))
    }

    /// Normal of its [`Shape`] at a point of the image, of a sphere `n_xy = (p - c) / R`; `None` outside.
    #[must_use]
    #[inline]
    pub fn normal(&self, x_px: f64, y_px: f64) -> Option<Vector3<f64>> {
        self.shape.normal((x_px - self.x_px) / self.radius_px, (y_px - self.y_px) / self.radius_px)
    }

    /// Rows and columns of an image that the circle can touch.
    #[must_use]
    pub fn window(&self, height: usize, width: usize) -> (Range<usize>, Range<usize>) {
        let clamp = |value: f64, size: usize| value.clamp(0.0, size as f64) as usize;
        let (x, y) = (self.x_px + width as f64 / 2.0, height as f64 / 2.0 - self.y_px);
        let reach = self.radius_px + 1.0;
        (
            clamp(y - reach, height)..clamp(y + reach + 1.0, height),
            clamp(x - reach, width)..clamp(x + reach + 1.0, width),
        )
    }

    /// The point in space where the sphere has this normal; the ball sits on the board, a little flattened at its foot.
    #[must_use]
    #[inline]
    pub fn point(&self, normal: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(self.x_px, self.y_px, CENTRE_HEIGHT * self.radius_px) + self.radius_px * normal
    }
}
