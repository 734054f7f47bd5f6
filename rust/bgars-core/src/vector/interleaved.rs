//! Which value goes where when three vectors become x y z of one pixel after the other.

/// For each plane and each of the three vectors that `WIDTH` pixels fill: the place of the plane that each value comes from.
pub(super) const fn places<const WIDTH: usize>() -> [[[i32; WIDTH]; 3]; 3] {
    let mut places = [[[0; WIDTH]; 3]; 3];
    let mut at = 0;
    while at < 3 * WIDTH {
        places[at % 3][at / WIDTH][at % WIDTH] = (at / 3) as i32;
        at += 1;
    }
    places
}

/// The same: bit k is set where value k of the vector comes from this plane.
pub(super) const fn filled<const WIDTH: usize>() -> [[u16; 3]; 3] {
    let mut filled = [[0; 3]; 3];
    let mut at = 0;
    while at < 3 * WIDTH {
        filled[at % 3][at / WIDTH] |= 1 << (at % WIDTH);
        at += 1;
    }
    filled
}
