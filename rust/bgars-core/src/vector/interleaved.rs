//! Which value goes where when three vectors become x y z of one pixel after the other.

/// For each of the three vectors that `WIDTH` pixels fill: the places of its values in x and y (after x), whatever where z
/// belongs; then in these values and z (after them).
pub(super) const fn places<const WIDTH: usize>() -> [[[i32; WIDTH]; 2]; 3] {
    let mut places = [[[0; WIDTH]; 2]; 3];
    let mut at = 0;
    while at < 3 * WIDTH {
        let (vector, place, plane, pixel) = (at / WIDTH, at % WIDTH, at % 3, at / 3);
        places[vector][0][place] = if plane == 1 { (WIDTH + pixel) as i32 } else { pixel as i32 };
        places[vector][1][place] = if plane == 2 { (WIDTH + pixel) as i32 } else { place as i32 };
        at += 1;
    }
    places
}
