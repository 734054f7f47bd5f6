//! Where the light comes from: distant lights, or LEDs near the part.

use nalgebra::{Matrix3, Vector3};

use crate::error::{check_length, check_rule};
use crate::{Error, Result};

/// Smallest accepted [`conditioning`]: below it the lights count as coplanar.
pub const MIN_CONDITIONING: f64 = 1e-6;

/// Largest accepted deviation of a direction's length from 1; text files with 3 digits stay within.
const UNIT_TOLERANCE: f64 = 1e-2;

/// The lights of a capture, one an image. World axes: x right, y up, z toward the camera.
#[derive(Clone, Debug)]
pub enum Lights {
    /// Distant lights: unit vectors from the surface to the light.
    Directional(Vec<Vector3<f64>>),
    /// Point lights near the part.
    Near {
        /// LED positions in pixels; origin = image centre on the board plane.
        positions_px: Vec<Vector3<f64>>,
        /// Distance in pixels at which each light's intensity holds; the fall-off is (this / distance)^2.
        reference_px: Vec<f64>,
    },
}

impl Lights {
    /// Distant lights from unit vectors (normalised again, so that a text file's rounding does no harm).
    ///
    /// # Errors
    /// Fewer than 3 lights, a vector that is not a unit vector within 1 %, or coplanar lights.
    ///
    /// # Examples
    /// ```
    /// use bgars_core::Lights;
    /// let s = 0.5f64.sqrt();
    /// let lights = Lights::directional(&[[s, 0.0, s], [0.0, s, s], [-s, 0.0, s]])?;
    /// assert_eq!(lights.len(), 3);
    /// assert!(Lights::directional(&[[0.0, 0.0, 1.0]; 3]).is_err());
    /// # Ok::<(), bgars_core::Error>(())
    /// ```
    pub fn directional(directions: &[[f64; 3]]) -> Result<Self> {
        let lights = Self::Directional(unit_directions(directions)?);
        lights.check_rank()?;
        Ok(lights)
    }

    /// Near point lights from LED positions in pixels and the distances at which their intensities hold.
    ///
    /// # Errors
    /// Fewer than 3 lights, a light not above the board plane, or lights coplanar with the image centre.
    pub fn near(positions_px: &[[f64; 3]], reference_px: &[f64]) -> Result<Self> {
        check_length("light_reference_distance", positions_px.len(), reference_px.len())?;
        for (index, position) in positions_px.iter().enumerate() {
            if !(position.iter().all(|v| v.is_finite()) && position[2] > 0.0) {
                return Err(Error::LightBelowBoard { index, z: position[2] });
            }
        }
        for &value in reference_px {
            check_rule("light_reference_distance", "finite and above 0", value, value.is_finite() && value > 0.0)?;
        }
        let lights = Self::Near {
            positions_px: positions_px.iter().map(|&p| Vector3::from(p)).collect(),
            reference_px: reference_px.to_vec(),
        };
        lights.check_rank()?;
        Ok(lights)
    }

    /// Number of lights.
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::Directional(directions) => directions.len(),
            Self::Near { positions_px, .. } => positions_px.len(),
        }
    }

    /// Never true for lights that passed their constructor.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Unit direction to light `light` and its relative irradiance (fall-off) at the board point `(x_px, y_px, 0)`.
    #[must_use]
    #[inline]
    pub fn at(&self, light: usize, x_px: f64, y_px: f64) -> (Vector3<f64>, f64) {
        self.at_point(light, &Vector3::new(x_px, y_px, 0.0))
    }

    /// Unit direction to light `light` and its relative irradiance at a point in space, in pixels above the board plane.
    #[must_use]
    #[inline]
    pub fn at_point(&self, light: usize, point_px: &Vector3<f64>) -> (Vector3<f64>, f64) {
        match self {
            Self::Directional(directions) => (directions[light], 1.0),
            Self::Near { positions_px, reference_px } => {
                let to_light = positions_px[light] - point_px;
                let distance = to_light.norm();
                let ratio = reference_px[light] / distance;
                (to_light / distance, ratio * ratio)
            }
        }
    }

    fn check_rank(&self) -> Result<()> {
        if self.len() < 3 {
            return Err(Error::TooFewLights { count: self.len() });
        }
        let mut gram = Matrix3::zeros();
        for light in 0..self.len() {
            let (direction, _) = self.at(light, 0.0, 0.0);
            gram += direction * direction.transpose();
        }
        let conditioning = conditioning(&gram);
        if conditioning < MIN_CONDITIONING {
            return Err(Error::RankDeficientLights { conditioning, limit: MIN_CONDITIONING });
        }
        Ok(())
    }
}

/// Vectors of length 1 from ones of about this length.
///
/// # Errors
/// A vector whose length is not 1 within 1 %.
pub fn unit_directions(directions: &[[f64; 3]]) -> Result<Vec<Vector3<f64>>> {
    let unit = |(index, &direction): (usize, &[f64; 3])| {
        let vector = Vector3::from(direction);
        let length = vector.norm();
        // Written so that NaN is refused.
        if (length - 1.0).abs() <= UNIT_TOLERANCE {
            Ok(vector / length)
        } else {
            Err(Error::NotUnitDirection { index, length })
        }
    };
    directions.iter().enumerate().map(unit).collect()
}

/// `27 det(G) / tr(G)^3` of a Gram matrix `G = L^T L`: 1 for evenly spread lights, 0 for coplanar ones.
///
/// It is the cube of the ratio of the geometric to the arithmetic mean of the eigenvalues: free of scale and cheap.
#[must_use]
#[inline]
pub fn conditioning(gram: &Matrix3<f64>) -> f64 {
    let third = gram.trace() / 3.0;
    if third > 0.0 { gram.determinant() / (third * third * third) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_of_about_unit_length_become_exact_and_others_are_named() -> Result<()> {
        let unit = unit_directions(&[[0.6, 0.0, 0.806], [0.0, 0.595, 0.8]])?;
        assert!(unit.iter().all(|direction| (direction.norm() - 1.0).abs() < 1e-15), "{unit:?}");
        for wrong in [[0.0, 0.0, 1.02], [0.0, 0.0, 0.0], [f64::NAN, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0]] {
            let error = unit_directions(&[[0.0, 0.0, 1.0], wrong]).unwrap_err();
            assert!(matches!(error, Error::NotUnitDirection { index: 1, .. }), "{wrong:?}: {error}");
        }
        Ok(())
    }

    #[test]
    fn a_light_below_the_board_is_named() {
        let error = Lights::near(&[[1.0, 0.0, 5.0], [0.0, 1.0, -5.0], [0.0, 0.0, 5.0]], &[5.0; 3]).unwrap_err();
        assert!(matches!(error, Error::LightBelowBoard { index: 1, .. }), "{error}");
    }
}
