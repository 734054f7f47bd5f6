//! placeholder
use crate::Result;
use nalgebra::Vector3;
/// Settings
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RobustParams {}
impl RobustParams {
    pub(super) fn check(&self) -> Result<()> {
        Ok(())
    }
}
/// x
pub fn robust_filter() {}
pub(super) struct RobustFilter {}
impl RobustFilter {
    pub fn new(_p: RobustParams, _lights: usize, _fixed: Option<&[Vector3<f64>]>) -> Self {
        Self {}
    }
    pub fn choose(
        &self,
        _values: &[f32],
        _clipped: &[bool],
        _dirs: &[Vector3<f64>],
        _full: f32,
        _order: &mut Vec<usize>,
        kept: &mut [bool],
    ) {
        kept.fill(true);
    }
}
