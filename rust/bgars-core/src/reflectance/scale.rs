//! The scale on which grey levels are compared: close to linear where it is dark, logarithmic where it is bright.

/// Grey levels of 255 are bent above about `1 / BEND`.
pub const BEND: f64 = 0.03;

/// `asinh(BEND I) / BEND` of a linear grey level of 255.
#[inline]
pub fn bend(level: f64) -> f64 {
    // `f64::asinh` takes three times as long for digits that nobody needs.
    let x = BEND * level;
    (x.abs() + (x * x + 1.0).sqrt()).ln().copysign(x) / BEND
}

/// [`bend`] of a reading, to 1e-5 grey levels.
#[inline]
pub fn bend_reading(level: f32) -> f32 {
    let x = BEND as f32 * level;
    (x.abs() + (x * x + 1.0).sqrt()).ln().copysign(x) / BEND as f32
}

/// Inverse of [`bend`].
#[inline]
pub fn unbend(bent: f64) -> f64 {
    (BEND * bent).sinh() / BEND
}

/// Derivative of [`bend`].
#[inline]
pub fn bend_slope(level: f64) -> f64 {
    (1.0 + (BEND * level).powi(2)).sqrt().recip()
}
