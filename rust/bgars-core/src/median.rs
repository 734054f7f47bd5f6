//! The median, where the upper of two middle values is good enough.

use std::cmp::Ordering;

/// The middle of some values by `order`, the upper one of an even number; zero without values. Reorders them.
pub(crate) fn median<T: Copy + Default>(values: &mut [T], order: impl Fn(&T, &T) -> Ordering) -> T {
    if values.is_empty() {
        return T::default();
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, order).1
}
