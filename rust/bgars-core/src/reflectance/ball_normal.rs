//! What is found at a pixel of a ball.

/// A normal of a ball.
#[derive(Clone, Copy, Debug)]
pub struct BallPixel {
    pub pixel: usize,
    pub normal: [f32; 3],
    /// Its place on the disc.
    pub point: [f32; 2],
    /// The place of its circle's normal.
    pub circle_point: [f32; 2],
    /// Standard error of the direction, in radian: data, expectation and circle together.
    pub error_rad: f32,
    /// The same by the data alone.
    pub data_error_rad: f32,
    /// Angle to the normal of the circle, in radian.
    pub off_circle_rad: f32,
    /// Mean loss of a light.
    pub cost: f32,
}
