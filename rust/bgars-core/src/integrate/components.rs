//! Connected parts of a mask: each keeps its own unknown constant.

/// One connected component of the mask (4-neighbourhood).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Component {
    /// Number of pixels.
    pub pixels: usize,
    /// Row of its first pixel in reading order.
    pub first_row: usize,
    /// Column of that pixel.
    pub first_col: usize,
}

/// Labels the components of `mask`: an index a pixel (-1 outside), and the components in the order of their first pixels.
///
/// # Cost
/// Linear in the number of pixels; the stack of a flood fill holds at most the pixels of one component.
pub(super) fn label(mask: &[bool], width: usize) -> (Vec<i32>, Vec<Component>) {
    let mut labels = vec![-1i32; mask.len()];
    let mut components = Vec::new();
    let mut pending = Vec::new();
    for first in 0..mask.len() {
        if !mask[first] || labels[first] >= 0 {
            continue;
        }
        // At most one component a pixel, and images of 2^31 pixels are refused where they are read.
        let index = components.len() as i32;
        let mut pixels = 0;
        labels[first] = index;
        pending.push(first);
        while let Some(pixel) = pending.pop() {
            pixels += 1;
            let col = pixel % width;
            let neighbours = [
                (col > 0).then(|| pixel - 1),
                (col + 1 < width).then(|| pixel + 1),
                pixel.checked_sub(width),
                Some(pixel + width).filter(|&below| below < mask.len()),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if mask[neighbour] && labels[neighbour] < 0 {
                    labels[neighbour] = index;
                    pending.push(neighbour);
                }
            }
        }
        components.push(Component { pixels, first_row: first / width, first_col: first % width });
    }
    (labels, components)
}

/// Subtracts from `field` its mean over each component, so that the free constants are gone.
pub(super) fn remove_means(field: &mut [f64], labels: &[i32], components: &[Component]) {
    let mut sums = vec![0.0; components.len()];
    let index = |label: i32| usize::try_from(label).ok();
    for (&value, &label) in field.iter().zip(labels) {
        if let Some(component) = index(label) {
            sums[component] += value;
        }
    }
    for (sum, component) in sums.iter_mut().zip(components) {
        *sum /= component.pixels as f64;
    }
    for (value, &label) in field.iter_mut().zip(labels) {
        if let Some(component) = index(label) {
            *value -= sums[component];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diagonal_neighbours_are_apart() {
        let mask = [true, false, false, true, false, true];
        let (labels, components) = label(&mask, 2);
        assert_eq!(labels, [0, -1, -1, 1, -1, 1]);
        let sizes: Vec<usize> = components.iter().map(|component| component.pixels).collect();
        assert_eq!(sizes, [1, 2]);
        assert_eq!((components[1].first_row, components[1].first_col), (1, 1));
    }

    #[test]
    fn rows_do_not_wrap_around() {
        let (_, components) = label(&[false, true, true, false], 2);
        assert_eq!(components.len(), 2);
    }
}
