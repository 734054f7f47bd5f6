//! Masks that are hard for a solver on grids: thin walls, narrow lanes, mazes, and fields of small holes.

/// A mask and what it shows.
pub type Named = (&'static str, Vec<bool>);

/// Every kind of thin slit, at one size.
#[must_use]
pub fn gallery(side: usize) -> Vec<Named> {
    let mut masks = vec![
        ("winding slits", serpentine(side, side / 9)),
        ("dense cuts", dense_cuts(side)),
        ("dense slanted cuts", slanted_cuts(side)),
        ("crossing at 3 degrees", crossing(side, 3.0)),
        ("crossing at 12 degrees", crossing(side, 12.0)),
    ];
    let lanes: [[(usize, &'static str); 5]; 3] = [
        [(1, "comb 1"), (4, "comb 4"), (8, "comb 8"), (16, "comb 16"), (32, "comb 32")],
        [(1, "serpentine 1"), (4, "serpentine 4"), (8, "serpentine 8"), (16, "serpentine 16"), (32, "serpentine 32")],
        [(1, "maze 1"), (4, "maze 4"), (8, "maze 8"), (16, "maze 16"), (32, "maze 32")],
    ];
    for (kind, make) in [comb, serpentine, maze].into_iter().enumerate() {
        masks.extend(lanes[kind].iter().map(|&(lane, name)| (name, make(side, lane))));
    }
    masks.extend([
        ("spiral 5", spiral(side, 5)),
        ("spiral 16", spiral(side, 16)),
        ("holes of 1 px, 5 %", holes(side, 1, 0.05)),
        ("holes of 1 px, 20 %", holes(side, 1, 0.2)),
        ("holes of 4 px", holes(side, 4, 0.02)),
        ("islands of 6 px", islands(side, 6)),
        ("islands of 23 px", islands(side, 23)),
        ("maze 1 in a corner", cornered_maze(side)),
        ("comb 1, shifted", shifted(side, &comb(side, 1))),
        ("serpentine 1, shifted", shifted(side, &serpentine(side, 1))),
        ("maze 1, shifted", shifted(side, &maze(side, 1))),
        ("percolation", holes(side, 1, 0.4)),
        ("rooms", rooms(side)),
    ]);
    masks
}

/// Numbers in 0 .. 1 from a linear congruence.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1u64 << 31) as f64
    }
}

/// The mask of the pixels (row, col) that are `used`.
fn mask(side: usize, used: impl Fn(usize, usize) -> bool) -> Vec<bool> {
    (0..side * side).map(|pixel| used(pixel / side, pixel % side)).collect()
}

/// Lanes of `lane` pixels side by side, apart by walls of one pixel, all open at the bottom.
#[must_use]
pub fn comb(side: usize, lane: usize) -> Vec<bool> {
    mask(side, |row, col| col % (lane + 1) != lane || row + lane >= side)
}

/// One winding lane of `lane` pixels: walls open at the top and at the bottom by turns.
#[must_use]
pub fn serpentine(side: usize, lane: usize) -> Vec<bool> {
    mask(side, |row, col| {
        let from_gap = if (col / (lane + 1)).is_multiple_of(2) { side - 1 - row } else { row };
        col % (lane + 1) != lane || from_gap < lane
    })
}

/// A perfect maze (a random spanning tree) of lanes of `lane` pixels with walls of one pixel.
#[must_use]
pub fn maze(side: usize, lane: usize) -> Vec<bool> {
    let (pitch, cells) = (lane + 1, side / (lane + 1));
    let mut used =
        mask(side, |row, col| row % pitch != lane && col % pitch != lane && row < cells * pitch && col < cells * pitch);
    let mut random = random(lane as u64);
    let mut seen = vec![false; cells * cells];
    let mut path = vec![0];
    seen[0] = true;
    while let Some(&cell) = path.last() {
        let (row, col) = (cell / cells, cell % cells);
        let first = (random() * 4.0) as usize;
        let next = (first..first + 4).find_map(|turn| {
            let (down, right) = [(0, 1), (1, 0), (0, -1), (-1, 0)][turn % 4];
            let (to_row, to_col) = (row.checked_add_signed(down)?, col.checked_add_signed(right)?);
            (to_row < cells && to_col < cells && !seen[to_row * cells + to_col]).then_some((to_row, to_col))
        });
        let Some((to_row, to_col)) = next else {
            path.pop();
            continue;
        };
        for along in 0..lane {
            let (wall_row, wall_col) = if to_row == row {
                (row * pitch + along, col.min(to_col) * pitch + lane)
            } else {
                (row.min(to_row) * pitch + lane, col * pitch + along)
            };
            used[wall_row * side + wall_col] = true;
        }
        seen[to_row * cells + to_col] = true;
        path.push(to_row * cells + to_col);
    }
    used
}

/// A lane of `lane` pixels that winds inward, walls of one pixel.
#[must_use]
pub fn spiral(side: usize, lane: usize) -> Vec<bool> {
    let pitch = lane + 1;
    mask(side, |row, col| {
        let ring = row.min(col).min(side - 1 - row).min(side - 1 - col);
        let (turn, wall) = (ring / pitch, ring % pitch == lane);
        // The gap through a ring's wall lies beside a barrier across its lane, at the top.
        let middle = side / 2;
        let top = row == ring && row < middle;
        let gap = wall && top && (middle..middle + lane).contains(&col);
        let barrier = !wall && top && col + 1 == middle && turn > 0;
        (!wall || gap) && !barrier
    })
}

/// One cut of 256 pixels along a row or a column for every 128 x 128 pixels.
#[must_use]
pub fn dense_cuts(side: usize) -> Vec<bool> {
    let mut random = random(1);
    let mut used = vec![true; side * side];
    for cut in 0..(side / 128).pow(2) {
        let (row, col) = ((random() * side as f64) as usize, (random() * side as f64) as usize);
        for along in 0..256 {
            let (row, col) = if cut % 2 == 0 { (row, col + along) } else { (row + along, col) };
            if row < side && col < side {
                used[row * side + col] = false;
            }
        }
    }
    used
}

/// The same with cuts in any direction.
#[must_use]
pub fn slanted_cuts(side: usize) -> Vec<bool> {
    let mut random = random(2);
    let mut used = vec![true; side * side];
    for _ in 0..(side / 128).pow(2) {
        let (row, col) = (random() * side as f64, random() * side as f64);
        cut(&mut used, side, (row, col), random() * std::f64::consts::PI, 256.0);
    }
    used
}

/// Two cuts across the image that cross at an acute angle.
#[must_use]
pub fn crossing(side: usize, angle_deg: f64) -> Vec<bool> {
    let mut used = vec![true; side * side];
    let reach = 0.9 * side as f64;
    for angle in [0.4, 0.4 + angle_deg.to_radians()] {
        let middle = side as f64 / 2.0;
        let start = (middle - 0.5 * reach * f64::sin(angle), middle - 0.5 * reach * f64::cos(angle));
        cut(&mut used, side, start, angle, reach);
    }
    used
}

/// Clears a line one pixel thin that no edge crosses.
fn cut(used: &mut [bool], side: usize, (row, col): (f64, f64), angle: f64, length: f64) {
    let (down, right) = (angle.sin(), angle.cos());
    let steps = (length * down.abs().max(right.abs())) as usize;
    let stride = length / steps as f64;
    for step in 0..=steps {
        let along = step as f64 * stride;
        let (row, col) = ((row + along * down).round(), (col + along * right).round());
        if (0.0..side as f64).contains(&row) && (0.0..side as f64).contains(&col) {
            used[row as usize * side + col as usize] = false;
        }
    }
}

/// Square holes at random places, as many as would cover `share` of the image.
#[must_use]
pub fn holes(side: usize, hole: usize, share: f64) -> Vec<bool> {
    let mut random = random(3);
    let mut used = vec![true; side * side];
    for _ in 0..(share * (side * side) as f64 / (hole * hole) as f64) as usize {
        let (row, col) = ((random() * side as f64) as usize, (random() * side as f64) as usize);
        for row in row..(row + hole).min(side) {
            used[row * side + col..row * side + (col + hole).min(side)].fill(false);
        }
    }
    used
}

/// Squares apart by one pixel, each a component of its own, every third one tied to its right neighbour.
#[must_use]
pub fn islands(side: usize, island: usize) -> Vec<bool> {
    let pitch = island + 1;
    mask(side, |row, col| {
        let bridge =
            row % pitch == island / 2 && (col / pitch + row / pitch).is_multiple_of(3) && col % pitch == island;
        (row % pitch != island && col % pitch != island) || bridge
    })
}

/// A full image but for a maze of lanes of one pixel in a sixteenth of it.
#[must_use]
pub fn cornered_maze(side: usize) -> Vec<bool> {
    let part = side / 4;
    let maze = maze(part, 1);
    // Odd rows and columns: the coarser grids have no pixel in a lane.
    mask(side, |row, col| !(1..=part).contains(&row) || !(1..=part).contains(&col) || maze[(row - 1) * part + col - 1])
}

/// A mask moved by one row and one column.
#[must_use]
pub fn shifted(side: usize, used: &[bool]) -> Vec<bool> {
    mask(side, |row, col| row > 0 && col > 0 && used[(row - 1) * side + col - 1])
}

/// Rooms with thick walls between them, and from each to the next a lane of one pixel.
#[must_use]
pub fn rooms(side: usize) -> Vec<bool> {
    let pitch = 64;
    mask(side, |row, col| {
        let inside = row % pitch < 50 && col % pitch < 50;
        let lane = row % pitch == 21 || col % pitch == 21 && (row / pitch).is_multiple_of(3);
        inside || lane
    })
}
