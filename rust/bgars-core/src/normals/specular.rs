//! The published specular filter: cut the sorted intensities at the first large gap.

/// Fewest values that a cut must leave.
const MIN_KEPT: usize = 3;

/// Marks the lights kept by the sorted-gap filter in `kept`.
///
/// From the darkest value up, at the first difference to the next value that is over `gap` with at least 3 values kept,
/// the rest (the highlights) is dropped. Values of equal size keep the order of their lights.
///
/// # Inputs
/// `values` one a light, any unit; `gap` in the same unit; `order` scratch for the sorted light indices.
///
/// # Examples
/// ```
/// let mut kept = [false; 5];
/// bgars_core::normals::specular_filter(&[10.0, 200.0, 30.0, 20.0, 90.0], 50.0, &mut Vec::new(), &mut kept);
/// assert_eq!(kept, [true, false, true, true, false]);
/// ```
///
/// # Cost
/// O(L log L), no allocation once `order` has grown.
pub fn specular_filter(values: &[f32], gap: f32, order: &mut Vec<usize>, kept: &mut [bool]) {
    sort_lights(values, order);
    let cut = (MIN_KEPT..values.len())
        .find(|&count| values[order[count]] - values[order[count - 1]] > gap)
        .unwrap_or(values.len());
    for (rank, &light) in order.iter().enumerate() {
        kept[light] = rank < cut;
    }
}

/// Fills `order` with the light indices from the darkest to the brightest; ties keep their order.
pub(super) fn sort_lights(values: &[f32], order: &mut Vec<usize>) {
    order.clear();
    order.extend(0..values.len());
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
}
