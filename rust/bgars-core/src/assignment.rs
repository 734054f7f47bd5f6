//! The assignment problem: which row takes which column, so that the costs sum to the least.

/// Column of each row, every column once, with the least sum of costs: shortest augmenting paths, row after row.
///
/// `costs` is square, row after row, and finite.
///
/// # References
/// D. F. Crouse, On implementing 2D rectangular assignment algorithms, IEEE Trans. Aerosp. Electron. Syst. 52 (2016).
///
/// # Examples
/// ```
/// let costs = [4.0, 1.0, 3.0, 2.0, 0.0, 5.0, 3.0, 2.0, 2.0];
/// assert_eq!(bgars_core::assignment::assignment(&costs, 3), [1, 0, 2]);
/// ```
///
/// # Cost
/// Of the third order in the number of rows.
///
/// # Panics
/// Costs that are not finite, or of another number than the square of `count`.
#[must_use]
pub fn assignment(costs: &[f64], count: usize) -> Vec<usize> {
    assert!(costs.len() == count * count && costs.iter().all(|cost| cost.is_finite()), "square and finite");
    let mut row_of = vec![None; count];
    let mut column_of = vec![0; count];
    // Prices of rows and columns (dual variables): no cost is less than the sum of its two.
    let (mut of_row, mut of_column) = (vec![0.0; count], vec![0.0; count]);
    for free in 0..count {
        let path = shortest_path(costs, count, free, &row_of, (&of_row, &of_column));
        of_row[free] += path.length;
        for &column in &path.reached {
            let change = path.length - path.lengths[column];
            of_column[column] -= change;
            if let Some(row) = row_of[column] {
                of_row[row] += change;
            }
        }
        // Back along the path, each row takes the column that led on from it.
        let mut column = path.end;
        loop {
            let row = path.from[column];
            row_of[column] = Some(row);
            std::mem::swap(&mut column_of[row], &mut column);
            if row == free {
                break;
            }
        }
    }
    column_of
}

/// From a row without a column to a column without a row, over reduced costs.
struct Path {
    end: usize,
    length: f64,
    /// To each column, as far as known.
    lengths: Vec<f64>,
    /// Row before each column.
    from: Vec<usize>,
    /// Columns whose length is final, the end among them.
    reached: Vec<usize>,
}

/// The shortest such path: E. W. Dijkstra, A note on two problems in connexion with graphs, Numer. Math. 1 (1959).
fn shortest_path(
    costs: &[f64],
    count: usize,
    free: usize,
    row_of: &[Option<usize>],
    (of_row, of_column): (&[f64], &[f64]),
) -> Path {
    let mut path =
        Path { end: 0, length: 0.0, lengths: vec![f64::INFINITY; count], from: vec![0; count], reached: Vec::new() };
    let mut open: Vec<usize> = (0..count).rev().collect();
    let mut row = free;
    loop {
        let mut nearest = 0;
        let mut least = f64::INFINITY;
        for (place, &column) in open.iter().enumerate() {
            let length = path.length + costs[row * count + column] - of_row[row] - of_column[column];
            if length < path.lengths[column] {
                path.from[column] = row;
                path.lengths[column] = length;
            }
            // Among equals one where the path ends.
            let known = path.lengths[column];
            if known < least || (known <= least && row_of[column].is_none()) {
                (least, nearest) = (known, place);
            }
        }
        path.length = least;
        let column = open.swap_remove(nearest);
        path.reached.push(column);
        match row_of[column] {
            Some(next) => row = next,
            None => return Path { end: column, ..path },
        }
    }
}
