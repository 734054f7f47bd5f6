//! Single pixels of a checkerboard, for the few places where rows are not walked along.

use super::checkerboard::Weights;

/// Pixel k of its colour in a row.
pub(super) type Place = (isize, usize);

/// The weight of an edge of the system; 0 for a virtual edge.
fn real(weight: f32) -> f64 {
    f64::from(weight.max(0.0))
}

/// The blacks around a red and the weights of the edges to them: left, right, up, down. Where there is no pixel the weight
/// is 0 (and the place may lie outside).
pub(super) fn blacks_around(weights: &Weights, (row, k): Place) -> [(Place, f64); 4] {
    let odd = row.rem_euclid(2) as usize;
    [
        ((row, (k + odd).wrapping_sub(1)), real(weights.left(row)[k + 1])),
        ((row, k + odd), real(weights.right(row)[k + 1])),
        ((row - 1, k), real(weights.up(row)[k + 1])),
        ((row + 1, k), real(weights.down(row)[k + 1])),
    ]
}

/// The same for the reds around a black.
pub(super) fn reds_around(weights: &Weights, (row, k): Place) -> [(Place, f64); 4] {
    let odd = row.rem_euclid(2) as usize;
    [
        ((row, (k + 1 - odd).wrapping_sub(1)), real(weights.right(row)[k + 1 - odd])),
        ((row, k + 1 - odd), real(weights.left(row)[k + 2 - odd])),
        ((row - 1, k), real(weights.down(row - 1)[k + 1])),
        ((row + 1, k), real(weights.up(row + 1)[k + 1])),
    ]
}

/// Sum of the weights of a pixel's edges.
pub(super) fn diagonal(edges: [(Place, f64); 4]) -> f64 {
    edges.iter().map(|edge| edge.1).sum()
}

/// Calls `visit(red, weight)` for each red at the far end of a black beside `red`, itself included; several times for one that
/// several blacks lead to. The weights are the entries of `N = W D_black^-1 W^T`.
pub(super) fn each_tie(weights: &Weights, red: Place, mut visit: impl FnMut(Place, f64)) {
    for (black, weight) in blacks_around(weights, red) {
        if weight > 0.0 {
            let reds = reds_around(weights, black);
            let sum = diagonal(reds);
            for (other, far) in reds.into_iter().filter(|edge| edge.1 > 0.0) {
                visit(other, weight * far / sum);
            }
        }
    }
}

/// The entries of `N` in the row of `red`, each once.
pub(super) fn ties(weights: &Weights, red: Place, out: &mut Vec<(Place, f64)>) {
    out.clear();
    each_tie(weights, red, |other, weight| match out.iter_mut().find(|tie| tie.0 == other) {
        Some(tie) => tie.1 += weight,
        None => out.push((other, weight)),
    });
}
